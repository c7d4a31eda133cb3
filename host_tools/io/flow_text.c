/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "flow_text.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "decimal.h"

static const char *const NAMES[EVH_FLOW_COLUMNS] = {"x", "y", "u", "v", "frame"};

static bool is_blank(char c) { return (c == ' ') || (c == '\t') || (c == '\r'); }

typedef struct {
    const char *text;
    size_t length;
} field_t;

/* Walks over the fields of a line. */
typedef struct {
    const char *at;
    const char *end;
    bool by_comma;
    bool done;
} split_t;

static split_t split(const char *text, size_t length)
{
    const split_t s = {text, text + length, (memchr(text, ',', length) != NULL) || (memchr(text, ';', length) != NULL),
                       false};
    return s;
}

static bool next_field(split_t *s, field_t *field)
{
    const char *p = s->at;
    if (s->done) { return false; }
    while ((p < s->end) && is_blank(*p)) { p++; }
    if (!s->by_comma && (p == s->end)) { return false; }
    const char *stop = p;
    while ((stop < s->end) && !(s->by_comma ? ((*stop == ',') || (*stop == ';')) : is_blank(*stop))) { stop++; }
    s->done = stop == s->end;
    s->at = s->done ? stop : stop + 1;
    while ((stop > p) && is_blank(stop[-1])) { stop--; }
    field->text = p;
    field->length = (size_t)(stop - p);
    return true;
}

/* The next line that is no comment and not blank; a comment is one only after the header. */
static bool next_line(evh_flow_t *flow, evh_line_t *line, evh_error_t *err)
{
    while (evh_lines_next(&flow->lines, line, err)) {
        size_t i = 0u;
        while ((i < line->length) && is_blank(line->text[i])) { i++; }
        if ((i < line->length) && (line->text[i] != '#')) { return true; }
        if ((i < line->length) && (flow->column[EVH_FLOW_X] == SIZE_MAX)) { /* "#frame,x,y,u,v" is a header, too */
            line->text += i + 1u;
            line->length -= i + 1u;
            return true;
        }
    }
    return false;
}

static bool same(const field_t *field, const char *name)
{
    const size_t n = strlen(name);
    if (field->length != n) { return false; }
    for (size_t i = 0u; i < n; i++) {
        const char c = field->text[i];
        if (((c >= 'A') && (c <= 'Z') ? (char)(c - 'A' + 'a') : c) != name[i]) { return false; }
    }
    return true;
}

/* @return whether the line names all columns that are needed. */
static bool read_header(evh_flow_t *flow, const evh_line_t *line)
{
    split_t s = split(line->text, line->length);
    field_t field;
    for (size_t i = 0u; next_field(&s, &field); i++) {
        for (size_t k = 0u; k < EVH_FLOW_COLUMNS; k++) {
            if ((flow->column[k] == SIZE_MAX) && same(&field, NAMES[k])) { flow->column[k] = i; } /* the first counts */
        }
    }
    for (size_t k = EVH_FLOW_X; k <= EVH_FLOW_V; k++) {
        if (flow->column[k] == SIZE_MAX) { return false; }
    }
    return true;
}

bool evh_flow_open(evh_flow_t *flow, const char *path, evh_error_t *err)
{
    memset(flow, 0, sizeof *flow);
    for (size_t k = 0u; k < EVH_FLOW_COLUMNS; k++) { flow->column[k] = SIZE_MAX; }
    if (!evh_lines_open(&flow->lines, path, err)) { return false; }
    bool ok = false;
    bool any = false;
    evh_line_t line;
    while (!ok && next_line(flow, &line, err)) {
        const bool comment = (line.text > flow->lines.buffer) && (line.text[-1] == '#');
        any = true;
        ok = !line.overlong && read_header(flow, &line);
        if (ok) { break; }
        for (size_t k = 0u; k < EVH_FLOW_COLUMNS; k++) { flow->column[k] = SIZE_MAX; }
        if (!comment) { break; } /* comments may come before the header */
    }
    if (ok) { return true; }
    if (!flow->lines.failed) {
        (void)(any ? evh_fail(err, "%s: line %" PRIu64 ": no header with the columns x, y, u, v", path,
                              flow->lines.line)
                   : evh_fail(err, "%s: the file is empty", path));
    }
    evh_flow_close(flow);
    return false;
}

static evh_fault_t parse_number(const field_t *field, double limit, double *value)
{
    char *stop = NULL;
    if (field->length == 0u) { return EVH_FAULT_MALFORMED; }
    *value = strtod(field->text, &stop); /* the byte after a line is readable and no part of a number */
    if (stop != field->text + field->length) { return EVH_FAULT_MALFORMED; }
    if (!isfinite(*value)) { return EVH_FAULT_NOT_FINITE; }
    return (fabs(*value) < limit) ? EVH_FAULT_NONE : EVH_FAULT_RANGE;
}

static evh_fault_t parse_frame(const field_t *field, evh_flow_row_t *row)
{
    const char *p = field->text;
    bool exact = false;
    if (!evh_decimal_parse(&p, field->text + field->length, 0, &row->frame, &exact) || !exact ||
        (p != field->text + field->length)) {
        return EVH_FAULT_MALFORMED;
    }
    row->has_frame = true;
    return EVH_FAULT_NONE;
}

static void parse_row(const evh_flow_t *flow, const evh_line_t *line, evh_flow_row_t *row)
{
    double *const value[] = {&row->x, &row->y, &row->u, &row->v};
    size_t n_found = 0u;
    split_t s = split(line->text, line->length);
    field_t field;
    for (size_t i = 0u; next_field(&s, &field); i++) {
        for (size_t k = 0u; k < EVH_FLOW_COLUMNS; k++) {
            if (flow->column[k] != i) { continue; }
            const double limit = (k <= EVH_FLOW_Y) ? EVH_FLOW_POSITION_LIMIT : EVH_FLOW_LENGTH_LIMIT;
            const evh_fault_t fault =
                (k == EVH_FLOW_FRAME) ? parse_frame(&field, row) : parse_number(&field, limit, value[k]);
            if (row->fault == EVH_FAULT_NONE) { row->fault = fault; }
            n_found++;
        }
    }
    const size_t n_needed = (flow->column[EVH_FLOW_FRAME] == SIZE_MAX) ? 4u : 5u;
    if ((n_found < n_needed) && (row->fault == EVH_FAULT_NONE)) { row->fault = EVH_FAULT_MALFORMED; }
}

bool evh_flow_next(evh_flow_t *flow, evh_flow_row_t *row, evh_error_t *err)
{
    evh_line_t line;
    if (!next_line(flow, &line, err)) { return false; }
    memset(row, 0, sizeof *row);
    row->line = flow->lines.line;
    row->has_frame = flow->column[EVH_FLOW_FRAME] == SIZE_MAX;
    if (line.overlong) {
        row->fault = EVH_FAULT_MALFORMED;
    } else {
        parse_row(flow, &line, row);
    }
    if (row->fault == EVH_FAULT_NONE) {
        flow->tally.n_good++;
    } else {
        evh_tally_fault(&flow->tally, row->fault, row->line);
    }
    return true;
}

void evh_flow_close(evh_flow_t *flow) { evh_lines_close(&flow->lines); }
