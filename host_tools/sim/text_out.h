/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  text_out.h
 * @brief A text file of numbers, plain or gzip. The first failure is kept and reported when it is closed.
 */
#ifndef EVSIM_TEXT_OUT_H
#define EVSIM_TEXT_OUT_H

#include <stddef.h>
#include <stdint.h>
#include <zlib.h>

#include "error.h"

#define EVSIM_TEXT_BLOCK (1u << 18)

typedef struct {
    gzFile file;
    char *path;
    char *buffer;
    size_t length;
    int failure; /**< errno of the first failed write. */
} evsim_text_t;

/** Create DIR/NAME. */
bool evsim_text_open(evsim_text_t *text, const char *dir, const char *name, bool gz, evh_error_t *err);

/** Room for @p bytes (at most 4096) more; then evsim_text_advance(). */
char *evsim_text_reserve(evsim_text_t *text, size_t bytes);
void evsim_text_advance(evsim_text_t *text, char *end);

/** A line: time with 9 decimals, then @p n numbers with 9 decimals. */
void evsim_text_row(evsim_text_t *text, int64_t t_ns, const double *number, size_t n);

bool evsim_text_close(evsim_text_t *text, evh_error_t *err);

#endif
