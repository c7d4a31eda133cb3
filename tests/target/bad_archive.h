/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The prototypes of bad_archive.c, so that it compiles under the same warnings as everything else. */
#ifndef EVS_BAD_ARCHIVE_H
#define EVS_BAD_ARCHIVE_H

#if defined(SIN_heap)
void *evs_bad(int n);
#elif defined(SIN_double)
double evs_bad(double a, double b);
#elif defined(SIN_libm)
double evs_bad(double a);
#elif defined(SIN_stdio)
int evs_bad(int n);
#else
int evs_bad(void);
#endif

#endif
