/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "detect.h"

#include <stdlib.h>
#include <string.h>

#include "rows.h"

#define LINES_LOOKED_AT 50
#define NUMBERS_MAX     12u

static bool ends_with(const char *text, const char *end)
{
    const size_t n = strlen(text);
    const size_t m = strlen(end);
    return (n >= m) && (strcmp(text + n - m, end) == 0);
}

static bool is_separator(char c) { return (c == ' ') || (c == '\t') || (c == ',') || (c == ';') || (c == '\r'); }

/* The leading numbers of a line; *rest tells whether something else follows them. */
static size_t numbers_of(const evh_line_t *line, double *number, bool *rest)
{
    const char *p = line->text;
    const char *const end = line->text + line->length;
    size_t n = 0u;
    *rest = false;
    for (;;) {
        char *stop = NULL;
        while ((p < end) && is_separator(*p)) { p++; }
        if ((p == end) || (n == NUMBERS_MAX)) { return n; }
        number[n] = strtod(p, &stop);
        if ((stop == p) || ((stop < end) && !is_separator(*stop))) {
            *rest = true;
            return n;
        }
        n++;
        p = stop;
    }
}

/* What the names in a header promise. */
static evh_kind_t kind_of_names(const evh_line_t *line)
{
    bool gyro = false;
    bool quaternion = false;
    const char *p = line->text;
    const char *const end = line->text + line->length;
    while (p < end) {
        const char *stop = p;
        evh_quantity_t q;
        while ((stop < end) && !is_separator(*stop) && (*stop != '#')) { stop++; }
        q = evh_quantity_from_name(p, (size_t)(stop - p));
        gyro = gyro || (q == EVH_Q_GX);
        quaternion = quaternion || (q == EVH_Q_QW);
        p = stop + 1;
    }
    return gyro ? EVH_KIND_IMU : quaternion ? EVH_KIND_POSES : EVH_KIND_UNKNOWN;
}

static bool is_whole(double x) { return (x >= -1e9) && (x <= 1e9) && ((double)(long)x >= x) && ((double)(long)x <= x); }

static evh_kind_t kind_of_numbers(const double *v, size_t n, bool rest)
{
    if ((n == 1u) && rest) { return EVH_KIND_IMAGES; }
    if (rest) { return EVH_KIND_UNKNOWN; }
    if ((n == 4u) && is_whole(v[1]) && is_whole(v[2]) && is_whole(v[3]) && (v[3] >= -1.0) && (v[3] <= 1.0)) {
        return EVH_KIND_EVENTS;
    }
    if ((n == 4u) || (n == 9u)) { return EVH_KIND_CALIB; }
    if (n == 7u) { return EVH_KIND_IMU; }
    return (n == 8u) ? EVH_KIND_POSES : EVH_KIND_UNKNOWN;
}

/* Text has no control characters; in binary data anything can look like anything. */
static bool is_text(const evh_line_t *line)
{
    for (size_t i = 0u; i < line->length; i++) {
        const unsigned char c = (unsigned char)line->text[i];
        if (((c < 0x20u) && (c != (unsigned char)'\t') && (c != (unsigned char)'\r')) || (c == 0x7Fu)) { return false; }
    }
    return true;
}

static bool is_yaml_line(const evh_line_t *line)
{
    size_t i = 0u;
    const char *const text = line->text;
    if ((line->length >= 5u) && (memcmp(text, "%YAML", 5u) == 0)) { return true; }
    while ((i < line->length) &&
           (((text[i] | 0x20) >= 'a' && (text[i] | 0x20) <= 'z') || (text[i] == '_') || (text[i] == '/'))) {
        i++;
    }
    while ((i > 0u) && (i < line->length) && (text[i] == ' ')) { i++; }
    return (i > 0u) && (i < line->length) && (text[i] == ':') && ((i + 1u == line->length) || (text[i + 1u] == ' '));
}

bool evh_detect(const char *path, evh_kind_t *kind, evh_error_t *err)
{
    evh_lines_t lines;
    evh_line_t line;
    bool any = false;
    *kind = EVH_KIND_UNKNOWN;
    if (!evh_lines_open(&lines, path, err)) { return false; }
    if (ends_with(path, ".yaml") || ends_with(path, ".yml")) { *kind = EVH_KIND_CONFIG; }
    for (int i = 0; (i < LINES_LOOKED_AT) && (*kind == EVH_KIND_UNKNOWN) && evh_lines_next(&lines, &line, err); i++) {
        double number[NUMBERS_MAX];
        bool rest = false;
        size_t n;
        any = any || (line.length > 0u);
        if (line.overlong || !is_text(&line)) { break; } /* Binary. */
        if (line.length == 0u) { continue; }
        *kind = kind_of_names(&line);
        if ((*kind == EVH_KIND_UNKNOWN) && is_yaml_line(&line)) { *kind = EVH_KIND_CONFIG; }
        if ((*kind == EVH_KIND_UNKNOWN) && (line.text[0] != '#')) {
            n = numbers_of(&line, number, &rest);
            *kind = kind_of_numbers(number, n, rest);
        }
    }
    if (!any && !lines.failed && (*kind == EVH_KIND_UNKNOWN)) { *kind = EVH_KIND_EMPTY; }
    evh_lines_close(&lines);
    return err->text[0] == '\0';
}
