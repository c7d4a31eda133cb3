/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "error.h"

#include <stdarg.h>
#include <stdio.h>

static bool quiet_now;

/* Names come from the command line and from files: a control character in one must not break the one-line rule. */
static void make_printable(char *text)
{
    for (; *text != '\0'; text++) {
        const unsigned char c = (unsigned char)*text;
        if ((c < 0x20u) || (c == 0x7Fu)) { *text = '?'; }
    }
}

bool evh_fail(evh_error_t *err, const char *format, ...)
{
    if (err->text[0] == '\0') {
        va_list args;
        va_start(args, format);
        (void)vsnprintf(err->text, sizeof err->text, format, args);
        va_end(args);
        make_printable(err->text);
    }
    return false;
}

void evh_note(const char *format, ...)
{
    char text[1024];
    va_list args;
    if (quiet_now) { return; }
    va_start(args, format);
    (void)vsnprintf(text, sizeof text, format, args);
    va_end(args);
    make_printable(text);
    (void)fprintf(stderr, "evstab: note: %s\n", text);
}

void evh_set_quiet(bool quiet) { quiet_now = quiet; }

bool evh_is_quiet(void) { return quiet_now; }
