/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  pixels.h
 * @brief The event pixels: thresholds on the change of log intensity, refractory period, background noise, hot pixels.
 *
 * Model: ESIM (H. Rebecq, D. Gehrig, D. Scaramuzza, "ESIM: an Open Event Camera Simulator", CoRL 2018). Between two
 * renders the log intensity of a pixel is a straight line; an event is where it is one threshold away from the level of
 * the event before. Within the refractory period an event is lost, but the level still follows. Every pixel has its own
 * two thresholds (normal, sigma) and starts at a random place between them, as if it had always been there. Noise
 * events (Poisson) come beside the signal: they leave the level as it is, but not the refractory period.
 */
#ifndef EVSIM_PIXELS_H
#define EVSIM_PIXELS_H

#include "settings.h"

/** An event of one batch; t_us counts from the batch's base. */
typedef struct {
    uint32_t t_us;
    uint16_t x_px;
    uint16_t y_px; /**< Bit 15: brighter. */
} evsim_event_t;

typedef struct {
    evsim_event_t *event;
    size_t n;
    size_t cap;
    bool out_of_memory;
} evsim_event_list_t;

/** The straight line between two renders. */
typedef struct {
    int64_t t0_ns;
    int64_t t1_ns;
    int64_t base_us;
} evsim_interval_t;

typedef struct {
    unsigned width_px;
    unsigned height_px;
    uint64_t seed;
    double noise_hz;
    double hot_hz;
    int64_t refractory_us;
    float *level; /**< Log intensity of the last event. */
    float *on;    /**< Thresholds, positive. */
    float *off;
    float *log_before; /**< Log intensity at the last render. */
    float *before;     /**< Intensity at the last render. */
    int64_t *noise_ns; /**< When the next noise event is due. */
    int64_t *last_us;  /**< When the last event was. */
    uint32_t *n_noise;
    bool *hot;
} evsim_pixels_t;

/** Added to the intensity before the logarithm: the dark current. */
#define EVSIM_DARK 0.02f

/** Free with evsim_pixels_free(), also after a failure. */
bool evsim_pixels_init(evsim_pixels_t *pixels, const evsim_settings_t *settings, evh_error_t *err);
void evsim_pixels_free(evsim_pixels_t *pixels);

/** The intensity at the start, for rows [y0, y0 + rows). Row-major, width_px values a row. */
void evsim_pixels_start(evsim_pixels_t *pixels, unsigned y0, unsigned rows, const float *intensity);

/** The intensity at interval->t1_ns for these rows: append what happens until then. */
void evsim_pixels_step(evsim_pixels_t *pixels, unsigned y0, unsigned rows, const float *intensity,
                       const evsim_interval_t *interval, evsim_event_list_t *out);

/**
 * All lists in the order of time into @p sorted. Events of the same microsecond stay in the order of the lists and, in
 * a list, in the order of appending: this does not depend on who filled which list.
 * @param count  Scratch, span_us + 2 words.
 */
void evsim_events_merge(const evsim_event_list_t *list, unsigned n_lists, uint32_t span_us, uint32_t *count,
                        evsim_event_t *sorted);

#endif
