/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include "events_text.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "decimal.h"
#include "lines.h"

/* A file whose first lines hold no event at all is some other kind of file: say so instead of skipping it whole. */
#define GIVE_UP_LINES 1000u

/* Whole seconds in the fast path: ten digits, which is all that int64 microseconds can be asked for in practice. */
#define SECONDS_DIGITS_MAX 10

_Static_assert(EVH_TIME_MAX_US >= INT64_C(10000000000) * 1000000, "the fast path must not exceed the time limit");

typedef struct {
    evh_event_source_t base;
    evh_lines_t lines;
    int64_t last_us;  /* Of the newest event handed out. */
    bool started;     /* One event was handed out. */
    bool has_pending; /* An event far ahead of the last one (or the very first), not believed yet. */
    evs_event_t pending;
    int64_t pending_us;
    uint64_t pending_line;
} reader_t;

typedef struct {
    int64_t t_us;
    int64_t x_px;
    int64_t y_px;
    bool brighter;
} record_t;

/* Output block of one read(). */
typedef struct {
    evs_event_t *ev;
    int64_t *t_us;
    size_t n;
    size_t cap;
} block_t;

static bool is_separator(char c) { return (c == ' ') || (c == '\t') || (c == ','); }

static const char *skip_separators(const char *p, const char *end)
{
    while ((p < end) && is_separator(*p)) { p++; }
    return p;
}

static bool take_integer(const char **p, const char *end, int64_t *value)
{
    bool exact = false;
    *p = skip_separators(*p, end);
    return evh_decimal_parse(p, end, 0, value, &exact) && exact && ((*p == end) || is_separator(**p));
}

/* A line that says "nan" or "inf" where a number belongs is named as such; users know that fault by name. */
static evh_fault_t name_the_fault(const char *text, const char *end)
{
    for (const char *p = text; p + 2 < end; p++) {
        const int a = p[0] | 0x20;
        const int b = p[1] | 0x20;
        const int c = p[2] | 0x20;
        if (((a == 'n') && (b == 'a') && (c == 'n')) || ((a == 'i') && (b == 'n') && (c == 'f'))) {
            return EVH_FAULT_NOT_FINITE;
        }
    }
    return EVH_FAULT_MALFORMED;
}

/* Any spelling: signs, exponents (numpy.savetxt writes 1.0e+00), commas. Used when the fast path does not match. */
static evh_fault_t parse_line(const char *text, const char *end, record_t *r)
{
    const char *p = skip_separators(text, end);
    int64_t polarity = 0;
    if (!evh_decimal_parse(&p, end, 6, &r->t_us, NULL) || (p == end) || !is_separator(*p) ||
        !take_integer(&p, end, &r->x_px) || !take_integer(&p, end, &r->y_px) || !take_integer(&p, end, &polarity) ||
        (skip_separators(p, end) != end) || (polarity < -1) || (polarity > 1)) {
        return name_the_fault(text, end);
    }
    if ((r->t_us > EVH_TIME_MAX_US) || (r->t_us < -EVH_TIME_MAX_US)) { return EVH_FAULT_RANGE; }
    r->brighter = (polarity == 1);
    return EVH_FAULT_NONE;
}

static void emit(reader_t *self, block_t *out, evs_event_t ev, int64_t t_us)
{
    out->ev[out->n] = ev;
    out->t_us[out->n] = t_us;
    out->n++;
    self->last_us = t_us;
    self->started = true;
}

/* Decide on a record. May hand out two events (the pending one and this one): the caller leaves room. */
static void accept(reader_t *self, block_t *out, const record_t *r, uint64_t line)
{
    evs_event_t ev;
    if ((r->x_px < 0) || (r->y_px < 0) || (r->x_px >= self->base.width_px) || (r->y_px >= self->base.height_px)) {
        evh_tally_fault(&self->base.tally, EVH_FAULT_OFF_SENSOR, line);
        return;
    }
    if (self->has_pending) {
        self->has_pending = false;
        if (r->t_us >= self->pending_us) {
            emit(self, out, self->pending, self->pending_us);
        } else {
            evh_tally_fault(&self->base.tally, EVH_FAULT_TIME_JUMP, self->pending_line);
        }
    }
    if (self->started && (r->t_us < self->last_us)) {
        evh_tally_fault(&self->base.tally, EVH_FAULT_TIME_BACK, line);
        return;
    }
    ev = evs_event_make((uint32_t)(uint64_t)r->t_us, (uint16_t)r->x_px, (uint16_t)r->y_px, r->brighter);
    if (!self->started || (r->t_us - self->last_us > EVH_TIME_JUMP_US)) {
        self->has_pending = true;
        self->pending = ev;
        self->pending_us = r->t_us;
        self->pending_line = line;
        return;
    }
    emit(self, out, ev, r->t_us);
}

static bool is_blank(const char *text, const char *end)
{
    const char *const p = skip_separators(text, end);
    return (p == end) || (*p == '#');
}

static void take_line(reader_t *self, block_t *out, const evh_line_t *line)
{
    const char *const end = line->text + line->length;
    record_t r;
    evh_fault_t fault = EVH_FAULT_MALFORMED;
    if (!line->overlong) {
        if (is_blank(line->text, end)) { return; }
        fault = parse_line(line->text, end, &r);
    }
    if (fault != EVH_FAULT_NONE) {
        evh_tally_fault(&self->base.tally, fault, self->lines.line);
        return;
    }
    accept(self, out, &r, self->lines.line);
}

static inline unsigned digit_of(char c) { return (unsigned)(unsigned char)c - (unsigned)'0'; }

/* "digits.digits x y p\n" with single blanks, on the sensor, in order: the shape of all but a handful of lines. Reads
 * no further than the line end, which the caller guarantees. @return the start of the next line, NULL for anything
 * else. */
static inline const char *parse_fast(const char *p, const reader_t *self, int64_t *t_us, uint32_t *x_px, uint32_t *y_px,
                                     bool *brighter)
{
    const char *const start = p;
    uint64_t t = 0u;
    uint32_t x = 0u;
    uint32_t y = 0u;
    unsigned d;
    int n = 0;

    while ((d = digit_of(*p)) < 10u) {
        t = t * 10u + d;
        p++;
    }
    if ((*p != '.') || (p == start) || (p - start > SECONDS_DIGITS_MAX)) { return NULL; }
    p++;
    for (; (n < 6) && ((d = digit_of(*p)) < 10u); n++) {
        t = t * 10u + d;
        p++;
    }
    if (n == 0) { return NULL; }
    for (; n < 6; n++) { t *= 10u; }
    if ((d = digit_of(*p)) < 10u) { /* Nearest microsecond; further digits cannot change it. */
        t += (d >= 5u) ? 1u : 0u;
        do {
            p++;
        } while (digit_of(*p) < 10u);
    }
    if ((*p++ != ' ') || ((d = digit_of(*p)) > 9u)) { return NULL; }
    do {
        x = x * 10u + d;
        p++;
    } while (((d = digit_of(*p)) < 10u) && (x < 100000u));
    if ((*p++ != ' ') || ((d = digit_of(*p)) > 9u)) { return NULL; }
    do {
        y = y * 10u + d;
        p++;
    } while (((d = digit_of(*p)) < 10u) && (y < 100000u));
    if ((*p++ != ' ') || ((d = digit_of(*p)) > 1u)) { return NULL; }
    p++;
    if (*p == '\r') { p++; }
    if ((*p != '\n') || (x >= self->base.width_px) || (y >= self->base.height_px)) { return NULL; }
    *t_us = (int64_t)t;
    *x_px = x;
    *y_px = y;
    *brighter = (d == 1u);
    return p + 1;
}

/* As many fast lines as the buffer and the block hold; stops in front of the first line that needs care. */
static void take_fast_lines(reader_t *self, block_t *out)
{
    evh_lines_t *const in = &self->lines;
    const char *p = in->buffer + in->begin;
    const char *const end = in->buffer + in->whole_end;
    const size_t n_before = out->n;

    if (!self->started || self->has_pending || (p == end) || (end[-1] != '\n') || in->skipping) { return; }
    while ((p < end) && (out->n < out->cap)) {
        int64_t t_us = 0;
        uint32_t x_px = 0u;
        uint32_t y_px = 0u;
        bool brighter = false;
        const char *const next = parse_fast(p, self, &t_us, &x_px, &y_px, &brighter);
        if ((next == NULL) || (t_us < self->last_us) || (t_us - self->last_us > EVH_TIME_JUMP_US)) { break; }
        out->ev[out->n] = evs_event_make((uint32_t)(uint64_t)t_us, (uint16_t)x_px, (uint16_t)y_px, brighter);
        out->t_us[out->n] = t_us;
        out->n++;
        self->last_us = t_us;
        p = next;
    }
    in->offset_bytes += (uint64_t)(p - (in->buffer + in->begin));
    in->begin = (size_t)(p - in->buffer);
    in->line += out->n - n_before;
}

static ssize_t read_events(evh_event_source_t *base, evs_event_t *ev, int64_t *t_us, size_t cap, evh_error_t *err)
{
    reader_t *const self = (reader_t *)base;
    block_t out = {ev, t_us, 0u, cap};
    evh_line_t line;

    while (out.n + 2u <= out.cap) { /* Room for the pending event and one more. */
        take_fast_lines(self, &out);
        if (out.n + 2u > out.cap) { break; }
        if (!evh_lines_next(&self->lines, &line, err)) { break; }
        take_line(self, &out, &line);
        if (!self->started && !self->has_pending && (evh_tally_skipped(&base->tally) >= GIVE_UP_LINES)) {
            evh_fail(
                err,
                "%s: none of the first %u lines is an event (\"t x y p\", on a %ux%u sensor); the first fault is in "
                "line %" PRIu64 "; is this the right file, the right --size?",
                base->path, GIVE_UP_LINES, (unsigned)base->width_px, (unsigned)base->height_px,
                evh_tally_first_line(&base->tally));
            return -1;
        }
    }
    if ((out.n == 0u) && !self->lines.failed && self->has_pending) {
        /* The end. A file of one event is a recording; a last event far ahead of all others is not believed. */
        self->has_pending = false;
        if (!self->started) {
            emit(self, &out, self->pending, self->pending_us);
        } else {
            evh_tally_fault(&base->tally, EVH_FAULT_TIME_JUMP, self->pending_line);
        }
    }
    base->tally.n_good += out.n;
    if (out.n > 0u) { return (ssize_t)out.n; }
    return self->lines.failed ? -1 : 0;
}

static double fraction(const evh_event_source_t *base) { return evh_lines_fraction(&((const reader_t *)base)->lines); }

static void close_events(evh_event_source_t *base)
{
    reader_t *const self = (reader_t *)base;
    evh_lines_close(&self->lines);
    free(base->path);
    free(self);
}

evh_event_source_t *evh_events_text_open(const char *path, uint16_t width_px, uint16_t height_px, evh_error_t *err)
{
    reader_t *const self = calloc(1u, sizeof *self);
    if (self == NULL) {
        evh_fail(err, "%s: out of memory", path);
        return NULL;
    }
    if (!evh_lines_open(&self->lines, path, err)) {
        free(self);
        return NULL;
    }
    self->base.read = read_events;
    self->base.fraction = fraction;
    self->base.close = close_events;
    self->base.format = "event text (t x y p)";
    self->base.path = strdup(path);
    self->base.width_px = width_px;
    self->base.height_px = height_px;
    if (self->base.path == NULL) {
        close_events(&self->base);
        evh_fail(err, "%s: out of memory", path);
        return NULL;
    }
    return &self->base;
}
