/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  board.h
 * @brief From reset to main() and back, for the emulated boards on which the tests run.
 *
 *   reset   startup_arm.c or startup_riscv.c: what C code needs of the core, then board_start()
 *   start   start.c: .data, .bss, the command line, main(argc, argv), exit status
 *   faults  any exception prints its number and address, and ends the run with BOARD_EXIT_FAULT
 */
#ifndef EVS_BOARD_H
#define EVS_BOARD_H

#include <stdint.h>

#define BOARD_EXIT_ASSERT 98 /**< An assert() failed. */
#define BOARD_EXIT_FAULT  99 /**< The core took an exception. */

/** Print one character to the host's standard output; lines are sent whole. */
void board_putc(int c);
void board_puts(const char *text);
void board_put_hex(uint32_t value);
void board_flush(void);

/** Called by the reset code, on a core that is ready for C. */
void board_start(void) __attribute__((noreturn));
/** Called by the exception code. @param cause IPSR or mcause. @param pc the instruction that failed. */
void board_fault(uint32_t cause, uint32_t pc) __attribute__((noreturn));

#endif
