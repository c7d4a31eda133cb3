/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* One sin per build, chosen by SIN: what the symbol gate must refuse. Built for the targets, never run. */
#include "bad_archive.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#if defined(SIN_heap)
void *evs_bad(int n) { return malloc((size_t)n); }
#elif defined(SIN_double)
double evs_bad(double a, double b) { return a * b; }
#elif defined(SIN_libm)
double evs_bad(double a) { return atan2(a, 2.0); }
#elif defined(SIN_stdio)
int evs_bad(int n) { return printf("%d\n", n); }
#elif defined(SIN_data)
int evs_bad(void)
{
    static int calls = 5;
    return calls++;
}
#elif defined(SIN_bss)
int evs_bad(void)
{
    static int calls;
    return calls++;
}
#else
#error "define one SIN_..."
#endif
