/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* What picolibc asks of a board. Only tests need it: the library calls nothing of this. */
#include "board.h"
#include "semihost.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

void __assert_func(const char *file, int line, const char *function, const char *condition) __attribute__((noreturn));
void _exit(int code) __attribute__((noreturn));

static int put(char c, FILE *stream)
{
    (void)stream;
    board_putc((unsigned char)c);
    return (unsigned char)c;
}

static FILE console = FDEV_SETUP_STREAM(put, NULL, NULL, _FDEV_SETUP_WRITE);
FILE *const stdout = &console;
FILE *const stderr = &console;

void _exit(int code)
{
    board_flush();
    semihost_exit(code);
}

void __assert_func(const char *file, int line, const char *function, const char *condition)
{
    printf("%s:%d: %s: assertion failed: %s\n", file, line, (function != NULL) ? function : "?", condition);
    _exit(BOARD_EXIT_ASSERT);
}

/* picolibc 1.8 (Debian 12, Ubuntu 24.04) loses a carry in floor() and ceil() of numbers beyond 2^20 with a fraction:
 * floor(-11395335.03) gave -11395328. The models in the tests must not be wrong; ours come first in the link. */
double floor(double x)
{
    const double whole = trunc(x);
    return (whole > x) ? whole - 1.0 : whole;
}

double ceil(double x)
{
    const double whole = trunc(x);
    return (whole < x) ? whole + 1.0 : whole;
}
