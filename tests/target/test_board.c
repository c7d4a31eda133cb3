/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Does drivers/board keep what the other tests rely on? Each way to end a run has its own word on the command line. */
#include "board.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { EXIT_AS_ASKED = 42 };

static int initialized = 7;
static int cleared;
static volatile double minus_one = -1.0;

static int check(int argc, char **argv)
{
    if (initialized != 7) { return 1; }
    if (cleared != 0) { return 2; }
    if ((argc != 3) || (strcmp(argv[1], "check") != 0) || (strcmp(argv[2], "a,b") != 0)) { return 3; }
    errno = 0; /* Thread-local, and not next to anything it may overwrite. */
    if (!isnan(sqrt(minus_one)) || (initialized != 7) || (cleared != 0)) { return 4; }
    if ((floor(minus_one * 11395335.03) != -11395336.0) || (ceil(minus_one * -11395335.03) != 11395336.0)) { return 5; }
    return (fabs(sin(-minus_one) - 0.8414709848078965) < 1e-15) ? EXIT_AS_ASKED : 6;
}

/* An instruction that no core knows. */
static void fail(void) { __asm__ volatile(".short 0xde00\n.short 0\n"); }

int main(int argc, char **argv)
{
    const char *what = (argc > 1) ? argv[1] : "";
    if (strcmp(what, "check") == 0) {
        printf("printed by printf %d\n", initialized);
        return check(argc, argv);
    }
    if (strcmp(what, "assert") == 0) { assert(initialized == cleared); }
    if (strcmp(what, "fault") == 0) { fail(); }
    return 1;
}
