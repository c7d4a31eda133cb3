/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  semihost.h
 * @brief Semihosting: a program on a bare core asks the emulator or debug probe to read files, print and exit.
 *
 * Follows "Semihosting for AArch32 and AArch64" (Arm) and "RISC-V Semihosting". On a board without a probe the calls
 * end in a fault: this is for tests and benchmarks, not for a product.
 */
#ifndef EVS_BOARD_SEMIHOST_H
#define EVS_BOARD_SEMIHOST_H

#include <stddef.h>
#include <stdint.h>

#define SEMIHOST_READ_BINARY  1 /**< fopen() mode "rb". */
#define SEMIHOST_WRITE_TEXT   4 /**< fopen() mode "w". */
#define SEMIHOST_CONSOLE_PATH ":tt"

/** @return a handle, or -1. A relative path starts where the emulator was started. */
int semihost_open(const char *path, int mode);
void semihost_close(int handle);
/** @return bytes read; 0 at the end of the file; -1 on an error. */
int32_t semihost_read(int handle, void *bytes, size_t n_bytes);
/** @return 0 if all was written, else -1. */
int semihost_write(int handle, const void *bytes, size_t n_bytes);
/** The command line: words with a blank between, the program first. @return 0, or -1 if it does not fit. */
int semihost_command_line(char *text, size_t n_text);
/** End the emulation; @p code becomes the exit status of the emulator. */
void semihost_exit(int code) __attribute__((noreturn));

#endif
