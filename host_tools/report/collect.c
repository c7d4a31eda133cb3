/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "collect.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "evs/float.h"

#define DEG 57.295779513082320877

/* Pixels blurred per event of the recording: enough to measure every window of usual size. */
#define CREDIT_PX 16.0

evr_report_t *evr_report_open(uint16_t width_px, uint16_t height_px, double focal_px)
{
    evr_report_t *const r = calloc(1u, sizeof *r);
    if (r == NULL) { return NULL; }
    r->width_px = width_px;
    r->height_px = height_px;
    r->focal_px = focal_px;
    evr_shake_clear(&r->shake);
    for (int i = 0; i < 3; i++) {
        evr_series_clear(&r->attitude_deg[i]);
        evr_series_clear(&r->rate_deg_s[i]);
    }
    evr_counts_clear(&r->events);
    evr_series_clear(&r->window_ms);
    evr_series_clear(&r->window_gain);
    r->credit = (double)width_px * height_px;
    if (!evr_spans_open(&r->spans, width_px, height_px) || !evr_clip_open(&r->clip, width_px, height_px) ||
        !evr_flight_open(&r->flight, width_px, height_px) ||
        !evl_sharpness_open(&r->window_before, width_px, height_px) ||
        !evl_sharpness_open(&r->window_after, width_px, height_px)) {
        evr_report_close(r);
        return NULL;
    }
    return r;
}

void evr_report_close(evr_report_t *r)
{
    if (r == NULL) { return; }
    evr_spans_close(&r->spans);
    evr_clip_close(&r->clip);
    evr_flight_close(&r->flight);
    evl_sharpness_close(&r->window_before);
    evl_sharpness_close(&r->window_after);
    free(r);
}

void evr_report_start(evr_report_t *r, int64_t first_us)
{
    r->first_us = first_us;
    r->last_us = first_us;
}

/* conj(a) b: b seen from a. */
static void relative(const double a[4], const double b[4], double out[4])
{
    out[0] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    out[1] = a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2];
    out[2] = a[0] * b[2] - a[2] * b[0] - a[3] * b[1] + a[1] * b[3];
    out[3] = a[0] * b[3] - a[3] * b[0] - a[1] * b[2] + a[2] * b[1];
}

/* The rotation vector of q: of all that mean the same rotation the one nearest to the last, so that a camera that keeps
 * turning draws a line and no saw. */
static void turn_of(const double q[4], double turn[3])
{
    const double s = sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const double angle = 2.0 * atan2(s, q[0]);
    const double full = 6.283185307179586;
    double along = 0.0;
    double best;
    if (s < 1e-12) { /* No axis: whole turns about the old one. */
        const double old = sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]);
        const double scale = (old > 1.0) ? full * round(old / full) / old : 0.0;
        for (int i = 0; i < 3; i++) { turn[i] *= scale; }
        return;
    }
    for (int i = 0; i < 3; i++) { along += turn[i] * q[i + 1] / s; }
    best = angle + full * round((along - angle) / full);
    for (int i = 0; i < 3; i++) { turn[i] = best * q[i + 1] / s; }
}

void evr_report_orientation(evr_report_t *r, int64_t t_us, const evs_orientation_t *o)
{
    const double q[4] = {evs_q_to_double(o->q_wc.w, 30u), evs_q_to_double(o->q_wc.x, 30u),
                         evs_q_to_double(o->q_wc.y, 30u), evs_q_to_double(o->q_wc.z, 30u)};
    const double w[3] = {evs_q_to_double(o->rate_rad_s_q24.x, 24u), evs_q_to_double(o->rate_rad_s_q24.y, 24u),
                         evs_q_to_double(o->rate_rad_s_q24.z, 24u)};
    const int64_t since_us = t_us - r->first_us;
    double from_start[4];
    r->turning = true;
    evr_shake_put(&r->shake, t_us, sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), r->focal_px * hypot(w[0], w[1]));
    if (since_us < 0) { return; } /* The filter warming up. */
    if (!r->has_start) { memcpy(r->start_wxyz, q, sizeof q); }
    r->has_start = true;
    relative(r->start_wxyz, q, from_start);
    turn_of(from_start, r->turn_rad);
    for (int i = 0; i < 3; i++) {
        evr_series_put(&r->attitude_deg[i], since_us, r->turn_rad[i] * DEG);
        evr_series_put(&r->rate_deg_s[i], since_us, w[i] * DEG);
    }
}

static void begin_window(evr_report_t *r)
{
    const double n_pixels = (double)r->width_px * r->height_px;
    r->window_open = true;
    r->measuring = (r->credit >= n_pixels);
    if (r->measuring) { r->credit -= n_pixels; }
}

static void take_saccade(evr_report_t *r, int64_t t_us)
{
    r->saccade_taken = true;
    if (r->n_saccades < EVR_SACCADES_MAX) { r->saccade_us[r->n_saccades] = t_us - r->first_us; }
    r->n_saccades++;
}

static void end_window(evr_report_t *r, int64_t first_us, int64_t last_us)
{
    r->n_windows++;
    evr_series_put(&r->window_ms, first_us - r->first_us, (double)(last_us - first_us) * 1e-3);
    if (r->measuring) {
        const double before = evl_sharpness_value(&r->window_before);
        const double after = evl_sharpness_value(&r->window_after);
        if (before > 0.0) { evr_series_put(&r->window_gain, first_us - r->first_us, after / before); }
        r->window_before_sum += before;
        r->window_after_sum += after;
        r->n_measured++;
        evl_sharpness_clear(&r->window_before);
        evl_sharpness_clear(&r->window_after);
    }
    r->window_open = false;
    r->saccade_taken = false;
    r->measuring = false;
}

/* Both pictures get the same events: those whose orientation is unknown have no place in the second, and none in the
 * comparison. */
static void measure(evr_report_t *r, const evs_pipeline_chunk_t *c, bool saccade, const int64_t *t_us)
{
    evr_spans_add(&r->spans, &r->shake, saccade, t_us, c->undistorted, c->stabilized, c->n);
    if (r->measuring) {
        evl_sharpness_add(&r->window_before, c->undistorted, c->n);
        evl_sharpness_add(&r->window_after, c->stabilized, c->n);
    }
}

void evr_report_chunk(evr_report_t *r, const evs_pipeline_chunk_t *c, const int64_t *t_us, int64_t window_first_us,
                      int64_t window_last_us)
{
    if (c->n > 0u) {
        const bool saccade = c->saccade && !r->saccade_taken;
        if (!r->window_open) { begin_window(r); }
        if (saccade) { take_saccade(r, t_us[0]); }
        evr_clip_add(&r->clip, &r->shake, t_us, c->events, c->undistorted, c->stabilized, c->n);
        if (c->oriented || !r->turning) { measure(r, c, saccade, t_us); }
        evr_counts_add(&r->events, r->first_us, t_us, c->n);
        r->n_events += c->n;
        r->credit += CREDIT_PX * (double)c->n;
        r->last_us = t_us[c->n - 1u];
    }
    if (c->end.reason != EVS_WINDOW_OPEN) { end_window(r, window_first_us, window_last_us); }
}

void evr_report_direction(evr_report_t *r, const evr_direction_t *d) { evr_flight_add(&r->flight, d, r->first_us); }

void evr_report_flow(evr_report_t *r, const evr_flow_t *flow)
{
    evr_flight_add_flow(&r->flight, flow, (size_t)r->width_px * r->height_px);
}

evr_numbers_t evr_report_finish(evr_report_t *r)
{
    evr_numbers_t x = {0};
    evr_spans_finish(&r->spans, &r->shake);
    r->take = evr_clip_finish(&r->clip, &r->shake);
    if (r->spans.n_spans > 0u) {
        x.sharpness_before = r->spans.before_sum / (double)r->spans.n_spans;
        x.sharpness_after = r->spans.after_sum / (double)r->spans.n_spans;
    }
    x.rate_rad_s = r->spans.all.rate_rad_s;
    x.rate_max_rad_s = r->spans.all.rate_max_rad_s;
    x.motion_px_s = r->spans.all.motion_px_s;
    x.motion_max_px_s = r->spans.all.motion_max_px_s;
    x.n_directions = r->flight.sigma_deg.total;
    x.n_directions_true = r->flight.error_deg.total;
    x.sigma_deg = evr_angles_median(&r->flight.sigma_deg);
    x.direction_error_deg = evr_angles_median(&r->flight.error_deg);
    return x;
}
