/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "pixels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "rng.h"

#define THRESHOLD_MIN 0.01
#define NEVER_NS      INT64_MAX
#define NEVER_US      INT64_MIN

static double threshold(const evsim_settings_t *s, double mean, size_t pixel, uint64_t n)
{
    return fmax(mean + s->contrast_sigma * evsim_gauss(s->seed, EVSIM_STREAM_CONTRAST, pixel, n), THRESHOLD_MIN);
}

static void draw_noise(evsim_pixels_t *p, size_t i, int64_t from_ns)
{
    const double rate_hz = p->noise_hz + (p->hot[i] ? p->hot_hz : 0.0);
    if (rate_hz > 0.0) {
        const double wait_ns = -log(evsim_uniform(p->seed, EVSIM_STREAM_NOISE, i, p->n_noise[i]++)) / rate_hz * 1e9;
        p->noise_ns[i] = (wait_ns < 9e18 - (double)from_ns) ? from_ns + (int64_t)wait_ns : NEVER_NS;
    } else {
        p->noise_ns[i] = NEVER_NS;
    }
}

bool evsim_pixels_init(evsim_pixels_t *p, const evsim_settings_t *s, evh_error_t *err)
{
    const size_t n = (size_t)s->calib.width_px * s->calib.height_px;
    memset(p, 0, sizeof *p);
    p->width_px = s->calib.width_px;
    p->height_px = s->calib.height_px;
    p->seed = s->seed;
    p->noise_hz = s->noise_hz;
    p->hot_hz = s->hot_hz;
    p->refractory_us = s->refractory_us;
    p->level = calloc(n, sizeof *p->level);
    p->on = calloc(n, sizeof *p->on);
    p->off = calloc(n, sizeof *p->off);
    p->log_before = calloc(n, sizeof *p->log_before);
    p->before = calloc(n, sizeof *p->before);
    p->noise_ns = calloc(n, sizeof *p->noise_ns);
    p->last_us = calloc(n, sizeof *p->last_us);
    p->n_noise = calloc(n, sizeof *p->n_noise);
    p->hot = calloc(n, sizeof *p->hot);
    if ((p->level == NULL) || (p->on == NULL) || (p->off == NULL) || (p->log_before == NULL) || (p->before == NULL) ||
        (p->noise_ns == NULL) || (p->last_us == NULL) || (p->n_noise == NULL) || (p->hot == NULL)) {
        return evh_fail(err, "out of memory for a sensor of %ux%u pixels", p->width_px, p->height_px);
    }
    for (uint64_t k = 0u, left = (s->n_hot < n) ? s->n_hot : n; left > 0u; k++) {
        const size_t i = (size_t)(evsim_bits(s->seed, EVSIM_STREAM_HOT, 0u, k) % n);
        left -= p->hot[i] ? 0u : 1u;
        p->hot[i] = true;
    }
    for (size_t i = 0u; i < n; i++) {
        p->on[i] = (float)threshold(s, s->contrast_on, i, 0u);
        p->off[i] = (float)threshold(s, s->contrast_off, i, 1u);
        p->last_us[i] = NEVER_US;
        draw_noise(p, i, 0);
    }
    return true;
}

void evsim_pixels_free(evsim_pixels_t *p)
{
    free(p->level);
    free(p->on);
    free(p->off);
    free(p->log_before);
    free(p->before);
    free(p->noise_ns);
    free(p->last_us);
    free(p->n_noise);
    free(p->hot);
    memset(p, 0, sizeof *p);
}

void evsim_pixels_start(evsim_pixels_t *p, unsigned y0, unsigned rows, const float *intensity)
{
    const size_t first = (size_t)y0 * p->width_px;
    const size_t n = (size_t)rows * p->width_px;
    for (size_t k = 0u; k < n; k++) {
        const size_t i = first + k;
        const float value = logf(intensity[k] + EVSIM_DARK);
        const float place = (float)evsim_uniform(p->seed, EVSIM_STREAM_REFERENCE, i, 0u);
        p->before[i] = intensity[k];
        p->log_before[i] = value;
        p->level[i] = value + 0.98f * (place * (p->on[i] + p->off[i]) - p->on[i]);
    }
}

static void append(evsim_event_list_t *list, evsim_event_t event)
{
    if (list->n == list->cap) {
        const size_t cap = (list->cap > 0u) ? 2u * list->cap : 1024u;
        evsim_event_t *const grown = realloc(list->event, cap * sizeof *grown);
        if (grown == NULL) {
            list->out_of_memory = true;
            return;
        }
        list->event = grown;
        list->cap = cap;
    }
    list->event[list->n++] = event;
}

static void emit(evsim_pixels_t *p, size_t i, int64_t t_ns, bool brighter, const evsim_interval_t *interval,
                 evsim_event_list_t *out)
{
    const int64_t t_us = (t_ns + 500) / 1000;
    if ((p->last_us[i] != NEVER_US) && (t_us - p->last_us[i] < p->refractory_us)) { return; }
    p->last_us[i] = t_us;
    append(out, (evsim_event_t){(uint32_t)(t_us - interval->base_us), (uint16_t)(i % p->width_px),
                                (uint16_t)((i / p->width_px) | (brighter ? 0x8000u : 0u))});
}

/* All that happens in a pixel until the end of the interval. */
static void happen(evsim_pixels_t *p, size_t i, float from, float to, const evsim_interval_t *interval,
                   evsim_event_list_t *out)
{
    const bool brighter = to > from;
    const double slope_ns =
        (to != from) ? (double)(interval->t1_ns - interval->t0_ns) / ((double)to - (double)from) : 0.0;
    for (;;) {
        const float next = brighter ? p->level[i] + p->on[i] : p->level[i] - p->off[i];
        int64_t signal_ns = NEVER_NS;
        if (brighter ? (next <= to) : (next >= to)) {
            const int64_t after_ns = (int64_t)(((double)next - (double)from) * slope_ns);
            signal_ns = interval->t0_ns + ((after_ns > 0) ? after_ns : 0);
            if (signal_ns > interval->t1_ns) { signal_ns = interval->t1_ns; }
        }
        if ((signal_ns == NEVER_NS) && (p->noise_ns[i] > interval->t1_ns)) { return; }
        if (signal_ns <= p->noise_ns[i]) {
            p->level[i] = next;
            emit(p, i, signal_ns, brighter, interval, out);
        } else {
            const int64_t t_ns = p->noise_ns[i];
            emit(p, i, t_ns, (evsim_bits(p->seed, EVSIM_STREAM_NOISE, i, ~(uint64_t)p->n_noise[i]) & 1u) != 0u,
                 interval, out);
            draw_noise(p, i, t_ns);
        }
    }
}

void evsim_pixels_step(evsim_pixels_t *p, unsigned y0, unsigned rows, const float *intensity,
                       const evsim_interval_t *interval, evsim_event_list_t *out)
{
    const size_t first = (size_t)y0 * p->width_px;
    const size_t n = (size_t)rows * p->width_px;
    for (size_t k = 0u; k < n; k++) {
        const size_t i = first + k;
        const float to = (intensity[k] == p->before[i]) ? p->log_before[i] : logf(intensity[k] + EVSIM_DARK);
        if ((to - p->level[i] >= p->on[i]) || (p->level[i] - to >= p->off[i]) || (p->noise_ns[i] <= interval->t1_ns)) {
            happen(p, i, p->log_before[i], to, interval, out);
        }
        p->before[i] = intensity[k];
        p->log_before[i] = to;
    }
}

void evsim_events_merge(const evsim_event_list_t *list, unsigned n_lists, uint32_t span_us, uint32_t *count,
                        evsim_event_t *sorted)
{
    memset(count, 0, ((size_t)span_us + 2u) * sizeof *count);
    for (unsigned l = 0u; l < n_lists; l++) {
        for (size_t i = 0u; i < list[l].n; i++) { count[list[l].event[i].t_us + 1u]++; }
    }
    for (uint32_t t = 0u; t <= span_us; t++) { count[t + 1u] += count[t]; }
    for (unsigned l = 0u; l < n_lists; l++) {
        for (size_t i = 0u; i < list[l].n; i++) { sorted[count[list[l].event[i].t_us]++] = list[l].event[i]; }
    }
}
