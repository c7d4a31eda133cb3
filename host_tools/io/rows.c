/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "rows.h"

#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "decimal.h"
#include "event_source.h"

#define TIME_UNIT_UNKNOWN INT_MAX
#define GIVE_UP_ROWS      1000u

static const struct {
    const char *name;
    evh_quantity_t quantity;
} NAMES[] = {
    {"t_s", EVH_Q_T},       {"t", EVH_Q_T},         {"t_us", EVH_Q_T},          {"t_ns", EVH_Q_T},
    {"time", EVH_Q_T},      {"timestamp", EVH_Q_T}, {"gx_rad_s", EVH_Q_GX},     {"gy_rad_s", EVH_Q_GY},
    {"gz_rad_s", EVH_Q_GZ}, {"gx", EVH_Q_GX},       {"gy", EVH_Q_GY},           {"gz", EVH_Q_GZ},
    {"w_rs_s_x", EVH_Q_GX}, {"w_rs_s_y", EVH_Q_GY}, {"w_rs_s_z", EVH_Q_GZ},     {"ax_m_s2", EVH_Q_AX},
    {"ay_m_s2", EVH_Q_AY},  {"az_m_s2", EVH_Q_AZ},  {"ax", EVH_Q_AX},           {"ay", EVH_Q_AY},
    {"az", EVH_Q_AZ},       {"a_rs_s_x", EVH_Q_AX}, {"a_rs_s_y", EVH_Q_AY},     {"a_rs_s_z", EVH_Q_AZ},
    {"mx_ut", EVH_Q_MX},    {"my_ut", EVH_Q_MY},    {"mz_ut", EVH_Q_MZ},        {"mx", EVH_Q_MX},
    {"my", EVH_Q_MY},       {"mz", EVH_Q_MZ},       {"px", EVH_Q_PX},           {"py", EVH_Q_PY},
    {"pz", EVH_Q_PZ},       {"tx", EVH_Q_PX},       {"ty", EVH_Q_PY},           {"tz", EVH_Q_PZ},
    {"p_rs_r_x", EVH_Q_PX}, {"p_rs_r_y", EVH_Q_PY}, {"p_rs_r_z", EVH_Q_PZ},     {"qw", EVH_Q_QW},
    {"qx", EVH_Q_QX},       {"qy", EVH_Q_QY},       {"qz", EVH_Q_QZ},           {"q_rs_w", EVH_Q_QW},
    {"q_rs_x", EVH_Q_QX},   {"q_rs_y", EVH_Q_QY},   {"q_rs_z", EVH_Q_QZ},       {"vx", EVH_Q_VX},
    {"vy", EVH_Q_VY},       {"vz", EVH_Q_VZ},       {"sigma_deg", EVH_Q_SIGMA}, {"interval_s", EVH_Q_SPAN},
};

static const char *const QUANTITY_NAMES[EVH_Q_COUNT] = {
    "t_s",   "gx_rad_s", "gy_rad_s", "gz_rad_s", "ax_m_s2",   "ay_m_s2",   "az_m_s2", "mx_ut",
    "my_ut", "mz_ut",    "px",       "py",       "pz",        "qw",        "qx",      "qy",
    "qz",    "vx",       "vy",       "vz",       "sigma_deg", "interval_s"};

static bool is_blank(char c) { return (c == ' ') || (c == '\t') || (c == '\r'); }
static char lower(char c) { return ((c >= 'A') && (c <= 'Z')) ? (char)(c - 'A' + 'a') : c; }

/* One field of a line, without the blanks around it. */
typedef struct {
    const char *text;
    size_t length;
} field_t;

/* Split at commas or semicolons where the line has one, else at blanks. @return the count, cut at `cap`. */
static size_t split(const char *text, size_t length, field_t *field, size_t cap)
{
    const char *const end = text + length;
    const bool by_comma = (memchr(text, ',', length) != NULL) || (memchr(text, ';', length) != NULL);
    const char *p = text;
    size_t n = 0u;
    while (n < cap) {
        const char *stop;
        const char *next;
        while ((p < end) && is_blank(*p)) { p++; }
        if ((p == end) && !(by_comma && (n > 0u))) { break; }
        for (stop = p; stop < end; stop++) {
            if (by_comma ? ((*stop == ',') || (*stop == ';')) : is_blank(*stop)) { break; }
        }
        next = (stop < end) ? stop + 1 : end;
        field[n].text = p;
        while ((stop > p) && is_blank(stop[-1])) { stop--; }
        field[n++].length = (size_t)(stop - p);
        if (next == end) { break; }
        p = next;
    }
    return n;
}

/* "timestamp [ns]" and "timestamp(s)" are "timestamp". */
static size_t length_without_unit(const char *name, size_t length)
{
    for (size_t i = 0u; i < length; i++) {
        if ((name[i] == '[') || (name[i] == '(')) { length = i; }
    }
    while ((length > 0u) && is_blank(name[length - 1u])) { length--; }
    return length;
}

evh_quantity_t evh_quantity_from_name(const char *name, size_t length)
{
    char key[16];
    const size_t n = length_without_unit(name, length);
    if ((n == 0u) || (n >= sizeof key)) { return EVH_Q_SKIP; }
    for (size_t i = 0u; i < n; i++) { key[i] = lower(name[i]); }
    key[n] = '\0';
    for (size_t i = 0u; i < sizeof NAMES / sizeof NAMES[0]; i++) {
        if (strcmp(key, NAMES[i].name) == 0) { return NAMES[i].quantity; }
    }
    return EVH_Q_SKIP;
}

const char *evh_quantity_name(evh_quantity_t quantity)
{
    return (quantity < EVH_Q_COUNT) ? QUANTITY_NAMES[quantity] : "?";
}

static uint32_t quantities_of(const evh_layout_t *layout)
{
    uint32_t bits = 0u;
    for (size_t i = 0u; i < layout->n_columns; i++) {
        if (layout->column[i] < EVH_Q_COUNT) { bits |= EVH_BIT(layout->column[i]); }
    }
    return bits;
}

static bool contains(const field_t *field, const char *word)
{
    const size_t n = strlen(word);
    for (size_t i = 0u; i + n <= field->length; i++) {
        if (memcmp(field->text + i, word, n) == 0) { return true; }
    }
    return false;
}

static int time_unit_of(const field_t *field)
{
    if (contains(field, "[ns]") || contains(field, "(ns)") || contains(field, "t_ns")) { return -3; }
    if (contains(field, "[us]") || contains(field, "(us)") || contains(field, "t_us")) { return 0; }
    if (contains(field, "[s]") || contains(field, "(s)") || contains(field, "t_s")) { return 6; }
    return TIME_UNIT_UNKNOWN;
}

/* Try the line as a header. A commented header parts its names by blanks or commas. @return true if it was used. */
static bool take_header(evh_rows_t *rows, const char *text, size_t length)
{
    field_t field[EVH_ROWS_COLUMNS_MAX];
    evh_layout_t layout;
    int unit = TIME_UNIT_UNKNOWN;
    size_t n;
    while ((length > 0u) && (is_blank(*text) || (*text == '#'))) {
        text++;
        length--;
    }
    n = split(text, length, field, EVH_ROWS_COLUMNS_MAX);
    layout.n_columns = n;
    for (size_t i = 0u; i < n; i++) {
        layout.column[i] = evh_quantity_from_name(field[i].text, field[i].length);
        if (layout.column[i] == EVH_Q_T) { unit = time_unit_of(&field[i]); }
        for (size_t k = 0u; k < i; k++) {
            if (layout.column[k] == layout.column[i]) {
                layout.column[i] = EVH_Q_SKIP;
            } /* The first of a name counts. */
        }
    }
    if ((quantities_of(&layout) & rows->required) != rows->required) { return false; }
    rows->layout = layout;
    rows->from_header = true;
    rows->time_decimals = unit;
    return true;
}

/* Without a unit in the header: an integer too large for seconds is ns (19 digits today) or us (16 digits). */
static int guess_time_unit(const field_t *field)
{
    if (memchr(field->text, '.', field->length) != NULL) { return 6; }
    if (memchr(field->text, 'e', field->length) != NULL) { return 6; }
    return (field->length >= 18u) ? -3 : (field->length >= 15u) ? 0 : 6;
}

static bool parse_time(evh_rows_t *rows, const field_t *field, int64_t *t_us)
{
    const char *p = field->text;
    const char *const end = field->text + field->length;
    if (rows->time_decimals == TIME_UNIT_UNKNOWN) { rows->time_decimals = guess_time_unit(field); }
    return evh_decimal_parse(&p, end, rows->time_decimals, t_us, NULL) && (p == end) && (*t_us <= EVH_TIME_MAX_US) &&
           (*t_us >= -EVH_TIME_MAX_US);
}

static evh_fault_t parse_number(const field_t *field, double limit, double *value)
{
    char *stop = NULL;
    *value = strtod(field->text, &stop); /* The byte after a line is readable and no part of a number. */
    if (stop != field->text + field->length) { return EVH_FAULT_MALFORMED; }
    if (!isfinite(*value)) { return EVH_FAULT_NOT_FINITE; }
    if ((limit > 0.0) && (fabs(*value) > limit)) { return EVH_FAULT_RANGE; }
    return EVH_FAULT_NONE;
}

static bool keep_first(evh_fault_t *fault, evh_fault_t found)
{
    if (*fault == EVH_FAULT_NONE) { *fault = found; }
    return found == EVH_FAULT_NONE;
}

static void parse_row(evh_rows_t *rows, const evh_line_t *line, evh_row_t *row)
{
    field_t field[EVH_ROWS_COLUMNS_MAX];
    const size_t n = line->overlong ? 0u : split(line->text, line->length, field, EVH_ROWS_COLUMNS_MAX);

    memset(row, 0, sizeof *row);
    row->line = rows->lines.line;
    for (size_t i = 0u; i < rows->layout.n_columns; i++) {
        const evh_quantity_t q = rows->layout.column[i];
        if (q == EVH_Q_SKIP) { continue; }
        if ((i >= n) || (field[i].length == 0u)) {
            if ((rows->required & EVH_BIT(q)) != 0u) { keep_first(&row->fault, EVH_FAULT_MALFORMED); }
            continue;
        }
        if (q == EVH_Q_T) {
            row->has_time = parse_time(rows, &field[i], &row->t_us);
            if (!row->has_time) {
                double ignored = 0.0;
                const evh_fault_t why = parse_number(&field[i], 0.0, &ignored);
                keep_first(&row->fault, (why == EVH_FAULT_NONE) ? EVH_FAULT_RANGE : why);
            }
        } else if (keep_first(&row->fault, parse_number(&field[i], rows->limit[q], &row->value[q]))) {
            row->present |= EVH_BIT(q);
        }
    }
    if (row->has_time) { row->present |= EVH_BIT(EVH_Q_T); }
}

/* The next line that is no comment and not blank. */
static bool next_data_line(evh_rows_t *rows, evh_line_t *line, evh_error_t *err)
{
    while (evh_lines_next(&rows->lines, line, err)) {
        size_t i = 0u;
        while ((i < line->length) && is_blank(line->text[i])) { i++; }
        if (i == line->length) { continue; }
        if (line->text[i] != '#') { return true; }
        if (rows->tally.n_good + evh_tally_skipped(&rows->tally) == 0u) {
            (void)take_header(rows, line->text, line->length);
        }
    }
    return false;
}

static bool starts_with_letter(const evh_line_t *line)
{
    size_t i = 0u;
    char c;
    while ((i < line->length) && is_blank(line->text[i])) { i++; }
    c = lower((i < line->length) ? line->text[i] : ' ');
    return (c >= 'a') && (c <= 'z');
}

static void fill_ahead(evh_rows_t *rows, evh_error_t *err)
{
    evh_line_t line;
    rows->has_ahead = next_data_line(rows, &line, err);
    if (rows->has_ahead) { parse_row(rows, &line, &rows->ahead); }
}

static bool missing_columns(evh_rows_t *rows, const evh_layout_t *have, bool from_header, evh_error_t *err)
{
    char list[256] = "";
    const uint32_t missing = rows->required & ~quantities_of(have);
    size_t at = 0u;
    for (int q = 0; (q < EVH_Q_COUNT) && (at < sizeof list); q++) {
        if ((missing & EVH_BIT(q)) == 0u) { continue; }
        at += (size_t)snprintf(list + at, sizeof list - at, "%s%s", (at > 0u) ? ", " : "", QUANTITY_NAMES[q]);
    }
    if (!from_header) {
        return evh_fail(err, "%s: line %" PRIu64 ": no header names the columns; the first line must be one, with %s",
                        rows->lines.path, rows->lines.line, list);
    }
    return evh_fail(err, "%s: line %" PRIu64 ": the header lacks columns that are needed: %s", rows->lines.path,
                    rows->lines.line, list);
}

/* What the first line that is no comment says: a header without '#', or data of the caller's layout. */
static bool take_first_line(evh_rows_t *rows, const evh_layout_t *layout, const evh_line_t *line, evh_error_t *err)
{
    if (starts_with_letter(line) && !line->overlong) {
        if (!take_header(rows, line->text, line->length)) {
            field_t field[EVH_ROWS_COLUMNS_MAX];
            evh_layout_t have = {.n_columns = split(line->text, line->length, field, EVH_ROWS_COLUMNS_MAX)};
            for (size_t i = 0u; i < have.n_columns; i++) {
                have.column[i] = evh_quantity_from_name(field[i].text, field[i].length);
            }
            /* Letters that name nothing we know: a damaged first row where the columns are known anyway. */
            if ((layout == NULL) || (quantities_of(&have) != 0u)) { return missing_columns(rows, &have, true, err); }
            parse_row(rows, line, &rows->ahead);
            rows->has_ahead = true;
            return true;
        }
        fill_ahead(rows, err);
        return !rows->lines.failed;
    }
    if (rows->layout.n_columns == 0u) { return missing_columns(rows, &rows->layout, false, err); }
    parse_row(rows, line, &rows->ahead);
    rows->has_ahead = true;
    return true;
}

bool evh_rows_open(evh_rows_t *rows, const char *path, const evh_layout_t *layout, uint32_t required, evh_error_t *err)
{
    evh_line_t line;
    memset(rows, 0, sizeof *rows);
    if (!evh_lines_open(&rows->lines, path, err)) { return false; }
    rows->required = required;
    rows->time_decimals = TIME_UNIT_UNKNOWN;
    if (layout != NULL) { rows->layout = *layout; }
    if (next_data_line(rows, &line, err)) {
        if (take_first_line(rows, layout, &line, err)) { return true; }
    } else if (!rows->lines.failed) {
        return true; /* Empty: the caller knows whether that matters. */
    }
    evh_rows_close(rows);
    return false;
}

static void judge_time(evh_rows_t *rows, evh_row_t *row)
{
    const bool far_ahead = !rows->started || (row->t_us - rows->last_us > EVH_TIME_JUMP_US);
    const bool next_is_earlier = rows->has_ahead && rows->ahead.has_time && (rows->ahead.t_us < row->t_us);
    if (rows->started && (row->t_us <= rows->last_us)) {
        row->fault = EVH_FAULT_TIME_BACK;
    } else if (far_ahead && (next_is_earlier || (rows->started && !rows->has_ahead))) {
        row->fault = EVH_FAULT_TIME_JUMP;
    } else {
        rows->started = true;
        rows->last_us = row->t_us;
    }
}

bool evh_rows_next_any(evh_rows_t *rows, evh_row_t *row, evh_error_t *err)
{
    if (!rows->has_ahead) { return false; }
    *row = rows->ahead;
    fill_ahead(rows, err);
    if (row->fault == EVH_FAULT_NONE) { judge_time(rows, row); }
    if (row->fault == EVH_FAULT_NONE) {
        rows->tally.n_good++;
    } else {
        evh_tally_fault(&rows->tally, row->fault, row->line);
    }
    return true;
}

bool evh_rows_next(evh_rows_t *rows, evh_row_t *row, evh_error_t *err)
{
    while (evh_rows_next_any(rows, row, err)) {
        if (row->fault == EVH_FAULT_NONE) { return true; }
        if ((rows->tally.n_good == 0u) && (evh_tally_skipped(&rows->tally) >= GIVE_UP_ROWS)) {
            evh_fail(err, "%s: none of the first %u lines holds the numbers that are needed; is this the right file?",
                     rows->lines.path, GIVE_UP_ROWS);
            rows->has_ahead = false;
            return false;
        }
    }
    return false;
}

void evh_rows_close(evh_rows_t *rows)
{
    evh_lines_close(&rows->lines);
    rows->has_ahead = false;
}
