/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Reset and exceptions of Cortex-M. */
#include "board.h"

extern char board_stack_top[]; /* Placed by sections.ld. */

void board_reset(void);
void board_exception(void);
void board_report(const uint32_t *frame);
void *__aeabi_read_tp(void);

/* Naked, and the coprocessors first: for an M55 the compiler may use vector registers in any C code. */
__attribute__((naked)) void board_reset(void)
{
    __asm__ volatile(
#if defined(__ARM_FP) || defined(__ARM_FEATURE_MVE)
        "ldr r0, =0xE000ED88\n" /* CPACR: */
        "ldr r1, [r0]\n"
        "orr r1, r1, #0xF00000\n" /* full access to CP10 and CP11 */
        "str r1, [r0]\n"
        "dsb\n"
        "isb\n"
#endif
#if defined(__ARM_FEATURE_MVE)
        "mov r0, #0x40000\n" /* FPSCR.LTPSIZE = 4: no tail predication is going on */
        "vmsr fpscr, r0\n"
#endif
        "ldr r0, =0xE000ED08\n" /* VTOR */
        "ldr r1, =board_vectors\n"
        "str r1, [r0]\n"
        "dsb\n"
        "bl board_start\n");
}

/* At entry of an exception the core has pushed r0-r3, r12, lr, pc, xpsr. */
__attribute__((naked)) void board_exception(void)
{
    __asm__ volatile("mrs r0, msp\n"
                     "b board_report\n");
}

void board_report(const uint32_t *frame)
{
    uint32_t ipsr;
    __asm__ volatile("mrs %0, ipsr" : "=r"(ipsr));
    board_fault(ipsr, frame[6]);
}

/* Where thread-local variables are (errno of the C library): 8 bytes before them, by the ABI. Changes r0 only. */
__attribute__((naked)) void *__aeabi_read_tp(void)
{
    __asm__ volatile("ldr r0, =board_tls_start - 8\n"
                     "bx lr\n");
}

typedef void (*vector_t)(void);

/* The stack, reset, and 14 system exceptions; no interrupt is ever enabled. */
__attribute__((used, section(".vectors"), aligned(128))) const vector_t board_vectors[16] = {
    (vector_t)(uintptr_t)board_stack_top,
    board_reset,
    board_exception,
    board_exception,
    board_exception,
    board_exception,
    board_exception,
    board_exception,
    board_exception,
    board_exception,
    board_exception,
    board_exception,
    board_exception,
    board_exception,
    board_exception,
    board_exception,
};
