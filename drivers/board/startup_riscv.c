/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Reset and traps of RV32. */
#include "board.h"

/* Every core has them, but binutils 2.38 and later want to be told; "-march=..._zicsr" would miss the libraries. */
#define CSR_OPCODES ".option arch, +zicsr\n"

void board_reset(void);
void board_trap(void);

__attribute__((naked, used, section(".vectors"))) void board_reset(void)
{
    __asm__ volatile(".option push\n"
                     ".option norelax\n" /* gp must not be set relative to itself */
                     "la gp, __global_pointer$\n"
                     ".option pop\n"
                     "la sp, board_stack_top\n"
                     "la tp, board_tls_start\n"
                     ".option push\n" CSR_OPCODES "la t0, board_trap\n"
                     "csrw mtvec, t0\n"
#if defined(__riscv_flen)
                     "li t0, 0x2000\n" /* mstatus.FS = initial */
                     "csrs mstatus, t0\n"
#endif
                     ".option pop\n"
                     "call board_start\n");
}

__attribute__((naked, aligned(4))) void board_trap(void)
{
    __asm__ volatile(".option push\n" CSR_OPCODES "csrr a0, mcause\n"
                     "csrr a1, mepc\n"
                     ".option pop\n"
                     "call board_fault\n");
}
