/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  text.h
 * @brief A text that grows, and the encodings that a page needs: HTML, JSON inside a script element, base64.
 *
 * A shortage of memory is remembered, so calls may be made blindly: ask `failed` at the end.
 */
#ifndef EVR_TEXT_H
#define EVR_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "error.h"

typedef struct {
    char *bytes; /**< Ends with '\0'; NULL while empty. */
    size_t n;    /**< Without the '\0'. */
    size_t cap;
    bool failed;
} evr_text_t;

void evr_text_free(evr_text_t *t);

void evr_put(evr_text_t *t, const char *text);
void evr_put_n(evr_text_t *t, const char *bytes, size_t n);
void evr_printf(evr_text_t *t, const char *format, ...) EVH_PRINTF(2, 3);

/** Text for the inside of an element or a quoted attribute: & < > " ' become references. */
void evr_put_html(evr_text_t *t, const char *text);

/** A JSON string with its quotes, of any bytes. */
void evr_put_json_string(evr_text_t *t, const char *text);

/** JSON that is valid already, made safe for a script element: no byte sequence in it can end the element. */
void evr_put_json_in_html(evr_text_t *t, const char *json);

void evr_put_base64(evr_text_t *t, const uint8_t *bytes, size_t n);

/** A number in a few digits; "null" for one that JSON has no word for. */
void evr_put_number(evr_text_t *t, double value, int digits);

#endif
