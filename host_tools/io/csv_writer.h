/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  csv_writer.h
 * @brief Text output in large blocks, numbers formatted from integers: exact, and fast enough for every event.
 *
 * The first failure is kept and reported by evh_csv_close(); until then calls may be made blindly.
 */
#ifndef EVH_CSV_WRITER_H
#define EVH_CSV_WRITER_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "error.h"

typedef struct {
    FILE *file;
    char *path;
    char *buffer;
    size_t length;
    int failure; /**< errno of the first failed write. */
} evh_csv_t;

/** Create DIR/NAME and write @p header as its first line. */
bool evh_csv_open(evh_csv_t *csv, const char *dir, const char *name, const char *header, evh_error_t *err);

/** The same with the whole path. */
bool evh_csv_open_path(evh_csv_t *csv, const char *path, const char *header, evh_error_t *err);

/** Make room for @p bytes more (at most 64 KiB) and return where to write them; then evh_csv_advance(). */
char *evh_csv_reserve(evh_csv_t *csv, size_t bytes);
void evh_csv_advance(evh_csv_t *csv, char *end);

/** Append to a reserved place; each returns the new end. */
char *evh_put_uint(char *out, uint64_t value);
char *evh_put_int(char *out, int64_t value);
char *evh_put_time_us(char *out, int64_t t_us); /**< Seconds with 6 decimals, exact. */
char *evh_put_q4(char *out, int16_t value_q4);  /**< 1/16 units with 4 decimals, exact. */
char *evh_put_q(char *out, int32_t value, unsigned bits,
                unsigned decimals); /**< Rounded to that many decimals (<= 9). */
char *evh_put_text(char *out, const char *text);

/** Flush and close. @return false if anything failed since opening: full disk, say. Also frees after a failed run. */
bool evh_csv_close(evh_csv_t *csv, evh_error_t *err);

#endif
