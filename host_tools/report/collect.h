/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  collect.h
 * @brief Inside of the report: what is collected, for the file that writes the page.
 */
#ifndef EVR_COLLECT_H
#define EVR_COLLECT_H

#include "clip.h"
#include "direction.h"
#include "report.h"
#include "series.h"
#include "shake.h"
#include "span.h"

#define EVR_SACCADES_MAX 2000u /**< Times that are kept; the others are only counted. */

struct evr_report {
    uint16_t width_px, height_px;
    double focal_px;
    int64_t first_us, last_us;
    uint64_t n_events;

    evr_shake_t shake;
    evr_spans_t spans;
    evr_clip_t clip;
    const evr_take_t *take;
    evr_flight_t flight;

    bool turning;   /**< There are orientations at all. */
    bool has_start; /**< There is an orientation that the others are relative to. */
    double start_wxyz[4];
    double turn_rad[3]; /**< The last rotation vector, so that the next one continues it. */
    evr_series_t attitude_deg[3];
    evr_series_t rate_deg_s[3];
    evr_counts_t events;
    evr_series_t window_ms;
    evr_series_t window_gain;

    evl_sharpness_t window_before, window_after;
    bool measuring; /**< The open window is measured. */
    double credit;  /**< Pixels that may be blurred: a measure costs time in proportion to the sensor. */
    uint64_t n_windows, n_measured;
    double window_before_sum, window_after_sum;

    bool window_open;
    bool saccade_taken; /**< That of the open window. */
    uint64_t n_saccades;
    int64_t saccade_us[EVR_SACCADES_MAX];
};

#endif
