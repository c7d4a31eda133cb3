/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "text.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void evr_text_free(evr_text_t *t)
{
    free(t->bytes);
    memset(t, 0, sizeof *t);
}

/* Room for n more bytes and the end. @return where they go, NULL when there is no memory. */
static char *reserve(evr_text_t *t, size_t n)
{
    if (t->failed) { return NULL; }
    if (n >= t->cap - t->n) {
        const size_t cap = 2u * t->cap + n + 256u;
        char *const more = realloc(t->bytes, cap);
        if (more == NULL) {
            t->failed = true;
            return NULL;
        }
        t->bytes = more;
        t->cap = cap;
    }
    return t->bytes + t->n;
}

static void advance(evr_text_t *t, size_t n)
{
    t->n += n;
    t->bytes[t->n] = '\0';
}

void evr_put_n(evr_text_t *t, const char *bytes, size_t n)
{
    char *const to = reserve(t, n);
    if (to == NULL) { return; }
    memcpy(to, bytes, n);
    advance(t, n);
}

void evr_put(evr_text_t *t, const char *text) { evr_put_n(t, text, strlen(text)); }

void evr_printf(evr_text_t *t, const char *format, ...)
{
    char line[256];
    va_list args;
    int n;
    va_start(args, format);
    n = vsnprintf(line, sizeof line, format, args);
    va_end(args);
    if ((n < 0) || ((size_t)n >= sizeof line)) {
        t->failed = true; /* A bug of the caller's: long texts go through evr_put(). */
        return;
    }
    evr_put_n(t, line, (size_t)n);
}

void evr_put_html(evr_text_t *t, const char *text)
{
    for (; *text != '\0'; text++) {
        switch (*text) {
        case '&':
            evr_put(t, "&amp;");
            break;
        case '<':
            evr_put(t, "&lt;");
            break;
        case '>':
            evr_put(t, "&gt;");
            break;
        case '"':
            evr_put(t, "&quot;");
            break;
        case '\'':
            evr_put(t, "&#39;");
            break;
        default:
            evr_put_n(t, text, 1u);
            break;
        }
    }
}

/* What may not stand in a JSON string, or could end a script element or begin a comment in it. */
static bool must_escape(char c) { return ((unsigned char)c < 0x20u) || (strchr("\"\\<>&", c) != NULL); }

void evr_put_json_string(evr_text_t *t, const char *text)
{
    evr_put(t, "\"");
    for (; *text != '\0'; text++) {
        if (must_escape(*text)) {
            evr_printf(t, "\\u%04x", (unsigned)(unsigned char)*text);
        } else {
            evr_put_n(t, text, 1u);
        }
    }
    evr_put(t, "\"");
}

void evr_put_json_in_html(evr_text_t *t, const char *json)
{
    while (*json != '\0') {
        const size_t plain = strcspn(json, "<>&"); /* They occur in strings only. */
        evr_put_n(t, json, plain);
        json += plain;
        if (*json != '\0') { evr_printf(t, "\\u%04x", (unsigned)(unsigned char)*json++); }
    }
}

void evr_put_base64(evr_text_t *t, const uint8_t *bytes, size_t n)
{
    static const char DIGIT[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    char *to = reserve(t, (n + 2u) / 3u * 4u);
    if (to == NULL) { return; }
    for (size_t i = 0u; i < n; i += 3u) {
        const uint32_t b1 = (i + 1u < n) ? bytes[i + 1u] : 0u;
        const uint32_t b2 = (i + 2u < n) ? bytes[i + 2u] : 0u;
        const uint32_t word = ((uint32_t)bytes[i] << 16) | (b1 << 8) | b2;
        *to++ = DIGIT[word >> 18];
        *to++ = DIGIT[(word >> 12) & 63u];
        *to++ = (i + 1u < n) ? DIGIT[(word >> 6) & 63u] : '=';
        *to++ = (i + 2u < n) ? DIGIT[word & 63u] : '=';
    }
    advance(t, (n + 2u) / 3u * 4u);
}

void evr_put_number(evr_text_t *t, double value, int digits)
{
    if (isfinite(value)) {
        evr_printf(t, "%.*g", digits, value);
    } else {
        evr_put(t, "null");
    }
}
