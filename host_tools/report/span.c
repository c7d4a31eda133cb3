/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "span.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SPAN_US      120000
#define GOOD_US      30000
#define PX_PER_EVENT 50u /* A picture with fewer events than one per so many pixels shows little. */

static size_t n_pixels(const evr_spans_t *s) { return (size_t)s->before.width_px * s->before.height_px; }

bool evr_spans_open(evr_spans_t *s, uint16_t width_px, uint16_t height_px)
{
    bool ok;
    memset(s, 0, sizeof *s);
    ok = evl_sharpness_open(&s->before, width_px, height_px) && evl_sharpness_open(&s->after, width_px, height_px);
    if (ok) {
        s->best_before = calloc(n_pixels(s), 1u);
        s->best_after = calloc(n_pixels(s), 1u);
        ok = (s->best_before != NULL) && (s->best_after != NULL);
    }
    if (!ok) { evr_spans_close(s); }
    return ok;
}

void evr_spans_close(evr_spans_t *s)
{
    evl_sharpness_close(&s->before);
    evl_sharpness_close(&s->after);
    free(s->best_before);
    free(s->best_after);
    memset(s, 0, sizeof *s);
}

static void keep_picture(uint8_t *to, const evl_sharpness_t *from, size_t n)
{
    for (size_t i = 0u; i < n; i++) { to[i] = (uint8_t)fmin(from->count[i], 255.0); }
}

static bool is_better(const evr_spans_t *s, bool good)
{
    if (good != s->best_good) { return good; }
    if (good) {
        if (s->now.shake.rate_rad_s != s->best.shake.rate_rad_s) {
            return s->now.shake.rate_rad_s > s->best.shake.rate_rad_s;
        }
        return s->now.n_events > s->best.n_events; /* Nothing known about rates, say. */
    }
    return s->now.n_events > s->best.n_events;
}

static void take_into_all(evr_spans_t *s)
{
    const evr_shake_mean_t *const x = &s->now.shake;
    const double us = (double)(s->now.last_us - s->now.first_us + 1);
    s->before_sum += s->now.before;
    s->after_sum += s->now.after;
    s->n_spans++;
    if (x->n == 0u) { return; }
    s->all_us += us;
    s->all.rate_rad_s += (x->rate_rad_s - s->all.rate_rad_s) * us / s->all_us;
    s->all.motion_px_s += (x->motion_px_s - s->all.motion_px_s) * us / s->all_us;
    s->all.rate_max_rad_s = fmax(s->all.rate_max_rad_s, x->rate_max_rad_s);
    s->all.motion_max_px_s = fmax(s->all.motion_max_px_s, x->motion_max_px_s);
    s->all.n += x->n;
}

static void end_span(evr_spans_t *s, const evr_shake_t *shake)
{
    bool good;
    if (s->now.n_events == 0u) { return; }
    s->now.before = evl_sharpness_value(&s->before);
    s->now.after = evl_sharpness_value(&s->after);
    s->now.shake = evr_shake_between(shake, s->now.first_us, s->now.last_us);
    good = (s->now.last_us - s->now.first_us >= GOOD_US) && (s->now.n_events * PX_PER_EVENT >= n_pixels(s));
    if ((s->n_spans == 0u) || is_better(s, good)) {
        s->best = s->now;
        s->best_good = good;
        keep_picture(s->best_before, &s->before, n_pixels(s));
        keep_picture(s->best_after, &s->after, n_pixels(s));
    }
    take_into_all(s);
    memset(&s->now, 0, sizeof s->now);
    evl_sharpness_clear(&s->before);
    evl_sharpness_clear(&s->after);
}

void evr_spans_add(evr_spans_t *s, const evr_shake_t *shake, bool saccade, const int64_t *t_us,
                   const evs_point_t *undistorted, const evs_point_t *stabilized, size_t n)
{
    size_t i = 0u;
    if (saccade) { end_span(s, shake); }
    while (i < n) {
        size_t end = i;
        if (s->now.n_events == 0u) { s->now.first_us = t_us[i]; }
        while ((end < n) && (t_us[end] >= s->now.first_us) && (t_us[end] - s->now.first_us < SPAN_US)) { end++; }
        if (end == i) { /* Full, or the clock restarted. */
            end_span(s, shake);
            continue;
        }
        evl_sharpness_add(&s->before, undistorted + i, end - i);
        evl_sharpness_add(&s->after, stabilized + i, end - i);
        s->now.n_events += end - i;
        s->now.last_us = t_us[end - 1u];
        i = end;
    }
}

void evr_spans_finish(evr_spans_t *s, const evr_shake_t *shake) { end_span(s, shake); }
