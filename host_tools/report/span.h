/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  span.h
 * @brief Before and after: the pictures of the span in which the camera turned fastest, and what stabilization gained
 * over all spans.
 *
 * A span is 120 ms of events, less when a saccade moves the reference (a picture must have one reference). Each is
 * measured once. The one shown has the highest mean rate among those of at least 30 ms with events enough to see
 * something; if there is none, the one with most events.
 */
#ifndef EVR_SPAN_H
#define EVR_SPAN_H

#include "shake.h"
#include "sharpness.h"

typedef struct {
    int64_t first_us, last_us;
    uint64_t n_events;
    double before, after; /**< Sharpness. */
    evr_shake_mean_t shake;
} evr_span_facts_t;

typedef struct {
    evl_sharpness_t before, after;     /**< The open span. */
    evr_span_facts_t now;              /**< Of the open span. */
    evr_span_facts_t best;             /**< Of the one shown. */
    bool best_good;                    /**< It is long and full enough. */
    uint8_t *best_before, *best_after; /**< Its pictures: counts up to 255. */
    uint64_t n_spans;
    double before_sum, after_sum;
    evr_shake_mean_t all; /**< Means over all spans by duration, and maxima. */
    double all_us;
} evr_spans_t;

bool evr_spans_open(evr_spans_t *s, uint16_t width_px, uint16_t height_px);
void evr_spans_close(evr_spans_t *s);

/** Consecutive events. @param saccade  The reference moved right before them. */
void evr_spans_add(evr_spans_t *s, const evr_shake_t *shake, bool saccade, const int64_t *t_us,
                   const evs_point_t *undistorted, const evs_point_t *stabilized, size_t n);

/** After the last event. */
void evr_spans_finish(evr_spans_t *s, const evr_shake_t *shake);

#endif
