/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "run_sharpness.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "decimal.h"
#include "event_source.h"
#include "lines.h"
#include "sharpness.h"
#include "stats.h"

#define POINT_MAX_E4 20479375 /* No point lies further out, see evs/types.h; in 1/10000 px. */

#define TELL_LINES 16384u

/* The two pictures of the same events, while they are being filled. */
typedef struct {
    evl_sharpness_t before, after;
    evl_pictures_t *out;
    evl_picture_t now;
    bool open;
} pair_t;

typedef struct {
    int64_t t_us;
    evs_point_t undistorted, stabilized;
    uint32_t window;
    bool known; /* It has both positions. */
} row_t;

static bool next_field(const char **p, const char *end)
{
    while ((*p < end) && (**p != ',')) { (*p)++; }
    if (*p == end) { return false; }
    (*p)++;
    return true;
}

/* A position in 1/16 px, written exactly with four decimals. "nan" is one that is not known. */
static bool take_q4(const char **p, const char *end, int16_t *q4, bool *known)
{
    int64_t value = 0;
    if ((end - *p >= 3) && (memcmp(*p, "nan", 3u) == 0)) {
        *p += 3;
        *known = false;
        return true;
    }
    if (!evh_decimal_parse(p, end, 4, &value, NULL) || (value < -POINT_MAX_E4) || (value > POINT_MAX_E4)) {
        return false;
    }
    *q4 = (int16_t)((value * 16) / 10000);
    return true;
}

/* t_s,x_px,y_px,p,x_undist_px,y_undist_px,x_stab_px,y_stab_px,window */
static bool take_row(const evh_line_t *line, row_t *row)
{
    const char *p = line->text;
    const char *const end = line->text + line->length;
    int64_t window = 0;
    row->known = true;
    if (!evh_decimal_parse(&p, end, 6, &row->t_us, NULL) || (row->t_us > EVH_TIME_MAX_US) ||
        (row->t_us < -EVH_TIME_MAX_US)) {
        return false;
    }
    for (int i = 0; i < 4; i++) {
        if (!next_field(&p, end)) { return false; }
    }
    if (!take_q4(&p, end, &row->undistorted.x_q4, &row->known) || !next_field(&p, end) ||
        !take_q4(&p, end, &row->undistorted.y_q4, &row->known) || !next_field(&p, end) ||
        !take_q4(&p, end, &row->stabilized.x_q4, &row->known) || !next_field(&p, end) ||
        !take_q4(&p, end, &row->stabilized.y_q4, &row->known) || !next_field(&p, end) ||
        !evh_decimal_parse(&p, end, 0, &window, NULL) || (p != end) || (window < 0) || (window > UINT32_MAX)) {
        return false;
    }
    row->window = (uint32_t)window;
    return true;
}

static bool finish(pair_t *p)
{
    evl_pictures_t *const list = p->out;
    if (!p->open) { return true; }
    p->open = false;
    if (list->n == list->cap) {
        const size_t larger = (list->cap == 0u) ? 256u : 2u * list->cap;
        evl_picture_t *const grown = realloc(list->at, larger * sizeof *grown);
        if (grown == NULL) { return false; }
        list->at = grown;
        list->cap = larger;
    }
    p->now.unstabilized = evl_sharpness_value(&p->before);
    p->now.stabilized = evl_sharpness_value(&p->after);
    list->at[list->n++] = p->now;
    evl_sharpness_clear(&p->before);
    evl_sharpness_clear(&p->after);
    return true;
}

static void add(pair_t *p, const row_t *row)
{
    if (!p->open) {
        p->open = true;
        p->now.window = row->window;
        p->now.t_first_us = row->t_us;
        p->now.n_events = 0u;
    }
    p->now.n_events++;
    evl_sharpness_add(&p->before, &row->undistorted, 1u);
    evl_sharpness_add(&p->after, &row->stabilized, 1u);
}

/* Walks through windows.csv beside the events: whether a window began with a saccade. */
typedef struct {
    evh_lines_t lines;
    uint32_t index;
    bool saccade;
    bool at_end;
} windows_t;

static bool next_window(windows_t *w, evh_error_t *err)
{
    evh_line_t line;
    while (evh_lines_next(&w->lines, &line, err)) {
        const char *p = line.text;
        const char *const end = line.text + line.length;
        int64_t index = 0;
        if ((line.length == 0u) || (line.text[0] == '#')) { continue; }
        if (!evh_decimal_parse(&p, end, 0, &index, NULL) || (index < 0) || (index > UINT32_MAX)) {
            return evh_fail(err, "%s: line %" PRIu64 ": not a row of windows.csv", w->lines.path, w->lines.line);
        }
        for (int i = 0; i < 6; i++) {
            if (!next_field(&p, end)) {
                return evh_fail(err, "%s: line %" PRIu64 ": too few columns", w->lines.path, w->lines.line);
            }
        }
        w->index = (uint32_t)index;
        w->saccade = (p < end) && (*p == '1');
        return true;
    }
    w->at_end = true;
    return err->text[0] == '\0';
}

static bool is_saccade(windows_t *w, uint32_t window, bool *saccade, evh_error_t *err)
{
    while (!w->at_end && (w->index < window)) {
        if (!next_window(w, err)) { return false; }
    }
    *saccade = !w->at_end && (w->index == window) && w->saccade;
    return true;
}

static bool take_all(evl_run_sharpness_t *s, evh_lines_t *lines, windows_t *windows, pair_t kinds[2], int64_t from_us,
                     int64_t to_us, const evl_waiting_t *waiting, evh_error_t *err)
{
    evh_line_t line;
    row_t row;
    while (evh_lines_next(lines, &line, err)) {
        if ((waiting != NULL) && (lines->line % TELL_LINES == 0u)) {
            waiting->tell(waiting->user, evh_lines_fraction(lines), lines->line);
        }
        if ((line.length == 0u) || (line.text[0] == '#')) { continue; }
        if (!take_row(&line, &row)) {
            return evh_fail(err, "%s: line %" PRIu64 ": not a row of events.csv", lines->path, lines->line);
        }
        if (!row.known || (row.t_us < from_us) || (row.t_us >= to_us)) { continue; }
        s->n_events++;
        if (kinds[0].open && (row.window != kinds[0].now.window)) {
            bool saccade = false;
            if (!is_saccade(windows, row.window, &saccade, err)) { return false; }
            if (!finish(&kinds[0]) || (saccade && !finish(&kinds[1]))) { return evh_fail(err, "out of memory"); }
        }
        if (kinds[1].open && (row.t_us - kinds[1].now.t_first_us >= EVL_PICTURE_US) && !finish(&kinds[1])) {
            return evh_fail(err, "out of memory");
        }
        add(&kinds[0], &row);
        add(&kinds[1], &row);
    }
    if (err->text[0] != '\0') { return false; }
    return (finish(&kinds[0]) && finish(&kinds[1])) || evh_fail(err, "out of memory");
}

bool evl_run_sharpness(evl_run_sharpness_t *s, const char *events_path, const char *windows_path, uint16_t width_px,
                       uint16_t height_px, int64_t from_us, int64_t to_us, const evl_waiting_t *waiting,
                       evh_error_t *err)
{
    evh_lines_t lines;
    windows_t windows;
    pair_t kinds[2];
    bool ok = true;
    memset(s, 0, sizeof *s);
    memset(kinds, 0, sizeof kinds);
    memset(&windows, 0, sizeof windows);
    if (!evh_lines_open(&lines, events_path, err)) { return false; }
    if (!evh_lines_open(&windows.lines, windows_path, err)) {
        evh_lines_close(&lines);
        return false;
    }
    kinds[0].out = &s->per_window;
    kinds[1].out = &s->per_100ms;
    for (int k = 0; k < 2; k++) {
        ok = evl_sharpness_open(&kinds[k].before, width_px, height_px) && ok;
        ok = evl_sharpness_open(&kinds[k].after, width_px, height_px) && ok;
    }
    if (!ok) {
        (void)evh_fail(err, "out of memory");
    } else {
        ok = next_window(&windows, err) && take_all(s, &lines, &windows, kinds, from_us, to_us, waiting, err);
    }
    for (int k = 0; k < 2; k++) {
        evl_sharpness_close(&kinds[k].before);
        evl_sharpness_close(&kinds[k].after);
    }
    evh_lines_close(&windows.lines);
    evh_lines_close(&lines);
    if (!ok) { evl_run_sharpness_free(s); }
    return ok;
}

void evl_run_sharpness_free(evl_run_sharpness_t *s)
{
    free(s->per_window.at);
    free(s->per_100ms.at);
    memset(s, 0, sizeof *s);
}

bool evl_gain(const evl_pictures_t *pictures, evl_gain_t *gain)
{
    evl_list_t gains;
    bool ok = true;
    memset(gain, 0, sizeof *gain);
    memset(&gains, 0, sizeof gains);
    for (size_t i = 0u; ok && (i < pictures->n); i++) {
        const evl_picture_t *const p = &pictures->at[i];
        if (!(p->unstabilized > 0.0)) { continue; }
        gain->unstabilized += p->unstabilized;
        gain->stabilized += p->stabilized;
        ok = evl_list_add(&gains, p->stabilized / p->unstabilized);
    }
    gain->n = gains.n;
    if (gains.n > 0u) {
        gain->gain = gain->stabilized / gain->unstabilized;
        gain->unstabilized /= (double)gains.n;
        gain->stabilized /= (double)gains.n;
        gain->gain_median = evl_list_stats(&gains).median;
    }
    evl_list_free(&gains);
    return ok;
}
