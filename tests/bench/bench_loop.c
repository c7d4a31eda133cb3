/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Regions whose instructions are known, so that the counter itself can be tested. */
#include "bench_markers.h"

enum { EMPTY = 0, LOOP = 1, ROUND_IT = 2, CALLS = 10 };

/* 1 + 100 * 2 instructions. */
static void loop(void)
{
#if defined(__arm__)
    __asm__ volatile("movs r0, #100\n"
                     "1: subs r0, r0, #1\n"
                     "bne 1b\n"
                     :
                     :
                     : "r0", "cc");
#else
    __asm__ volatile("li t0, 100\n"
                     "1: addi t0, t0, -1\n"
                     "bnez t0, 1b\n"
                     :
                     :
                     : "t0");
#endif
}

int main(void)
{
    for (int i = 0; i < CALLS; i++) {
        BENCH_START(EMPTY);
        BENCH_STOP(EMPTY);
        BENCH_START(ROUND_IT);
        BENCH_START(LOOP);
        loop();
        BENCH_STOP(LOOP);
        BENCH_STOP(ROUND_IT);
    }
    return 0;
}
