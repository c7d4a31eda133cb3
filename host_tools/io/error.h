/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  error.h
 * @brief How the host tools report: one line that names the file, the place and what to do.
 */
#ifndef EVH_ERROR_H
#define EVH_ERROR_H

#include <stdbool.h>

#if defined(__GNUC__)
#define EVH_PRINTF(fmt, args) __attribute__((format(printf, fmt, args)))
#else
#define EVH_PRINTF(fmt, args)
#endif

/** The text of the first thing that went wrong; empty while nothing has. */
typedef struct {
    char text[1024];
} evh_error_t;

/** Store the message unless one is stored already (the first cause is the useful one). Always returns false. */
bool evh_fail(evh_error_t *err, const char *format, ...) EVH_PRINTF(2, 3);

/** Print "evstab: note: ..." to stderr; silent after evh_set_quiet(true). */
void evh_note(const char *format, ...) EVH_PRINTF(1, 2);

void evh_set_quiet(bool quiet);
bool evh_is_quiet(void);

#endif
