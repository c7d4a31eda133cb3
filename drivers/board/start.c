/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "board.h"
#include "semihost.h"

#include <string.h>

int main(int argc, char **argv);

/* Placed by sections.ld. */
extern char board_data_load[], board_data_start[], board_data_end[];
extern char board_bss_start[], board_bss_end[];

enum { COMMAND_LINE_BYTES = 512, ARGS_MAX = 16, LINE_BYTES = 128 };

static int console = -1;
static char line[LINE_BYTES];
static size_t n_line;

void board_flush(void)
{
    if ((n_line > 0u) && (console >= 0)) { (void)semihost_write(console, line, n_line); }
    n_line = 0u;
}

void board_putc(int c)
{
    line[n_line++] = (char)c;
    if ((c == '\n') || (n_line == sizeof line)) { board_flush(); }
}

void board_puts(const char *text)
{
    while (*text != '\0') { board_putc(*text++); }
}

void board_put_hex(uint32_t value)
{
    for (int shift = 28; shift >= 0; shift -= 4) { board_putc("0123456789abcdef"[(value >> shift) & 0xFu]); }
}

/* Cut the command line at its blanks, in place. */
static int split(char *text, char **argv, int n_argv)
{
    int argc = 0;
    while (argc < n_argv - 1) {
        while (*text == ' ') { text++; }
        if (*text == '\0') { break; }
        argv[argc++] = text;
        while ((*text != ' ') && (*text != '\0')) { text++; }
        if (*text == ' ') { *text++ = '\0'; }
    }
    argv[argc] = NULL;
    return argc;
}

void board_start(void)
{
    static char command_line[COMMAND_LINE_BYTES];
    static char *argv[ARGS_MAX + 1];

    memcpy(board_data_start, board_data_load, (size_t)(board_data_end - board_data_start));
    memset(board_bss_start, 0, (size_t)(board_bss_end - board_bss_start));

    console = semihost_open(SEMIHOST_CONSOLE_PATH, SEMIHOST_WRITE_TEXT);
    if (semihost_command_line(command_line, sizeof command_line) != 0) { command_line[0] = '\0'; }
    const int code = main(split(command_line, argv, ARGS_MAX + 1), argv);
    board_flush();
    semihost_exit(code);
}

void board_fault(uint32_t cause, uint32_t pc)
{
    board_puts("\nboard: exception ");
    board_put_hex(cause);
    board_puts(" at ");
    board_put_hex(pc);
    board_putc('\n');
    semihost_exit(BOARD_EXIT_FAULT);
}
