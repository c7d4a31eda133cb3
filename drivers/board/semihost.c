/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "semihost.h"

#include <string.h>

/* Operation numbers. */
enum {
    SYS_OPEN = 0x01,
    SYS_CLOSE = 0x02,
    SYS_WRITE = 0x05,
    SYS_READ = 0x06,
    SYS_GET_CMDLINE = 0x15,
    SYS_EXIT_EXTENDED = 0x20
};

#define ADP_STOPPED_APPLICATION_EXIT 0x20026u

/* The one instruction sequence behind everything: operation and argument block go in, an answer comes out. */
static int32_t call(uint32_t operation, const void *arguments)
{
#if defined(__arm__)
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = arguments;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return (int32_t)r0;
#elif defined(__riscv)
    register uint32_t a0 __asm__("a0") = operation;
    register const void *a1 __asm__("a1") = arguments;
    /* An ebreak means semihosting only between these two shifts, all three uncompressed and in one page. */
    __asm__ volatile(".balign 16\n"
                     ".option push\n"
                     ".option norvc\n"
                     "slli x0, x0, 0x1f\n"
                     "ebreak\n"
                     "srai x0, x0, 7\n"
                     ".option pop\n"
                     : "+r"(a0)
                     : "r"(a1)
                     : "memory");
    return (int32_t)a0;
#else
#error "semihost.c knows Arm and RISC-V"
#endif
}

int semihost_open(const char *path, int mode)
{
    const uintptr_t arguments[3] = {(uintptr_t)path, (uintptr_t)mode, strlen(path)};
    return (int)call(SYS_OPEN, arguments);
}

void semihost_close(int handle)
{
    const uintptr_t arguments[1] = {(uintptr_t)handle};
    (void)call(SYS_CLOSE, arguments);
}

int32_t semihost_read(int handle, void *bytes, size_t n_bytes)
{
    const uintptr_t arguments[3] = {(uintptr_t)handle, (uintptr_t)bytes, n_bytes};
    const int32_t n_missing = call(SYS_READ, arguments); /* It answers how many bytes it did not read. */
    return ((n_missing < 0) || ((size_t)n_missing > n_bytes)) ? -1 : (int32_t)n_bytes - n_missing;
}

int semihost_write(int handle, const void *bytes, size_t n_bytes)
{
    const uintptr_t arguments[3] = {(uintptr_t)handle, (uintptr_t)bytes, n_bytes};
    return (call(SYS_WRITE, arguments) == 0) ? 0 : -1;
}

int semihost_command_line(char *text, size_t n_text)
{
    const uintptr_t arguments[2] = {(uintptr_t)text, n_text};
    return (call(SYS_GET_CMDLINE, arguments) == 0) ? 0 : -1;
}

void semihost_exit(int code)
{
    const uintptr_t arguments[2] = {ADP_STOPPED_APPLICATION_EXIT, (uintptr_t)code};
    for (;;) { (void)call(SYS_EXIT_EXTENDED, arguments); }
}
