/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  report.h
 * @brief report.html: what a run looked like, in one file that needs nothing else.
 *
 * The run hands over orientations and chunks as they come. What is kept is of fixed size, however long the recording:
 * about 50 MB for 240 x 180, most of it the pictures of the animation.
 */
#ifndef EVR_REPORT_H
#define EVR_REPORT_H

#include "error.h"
#include "evs/pipeline.h"

typedef struct evr_report evr_report_t;

/** @return NULL when memory is short. */
evr_report_t *evr_report_open(uint16_t width_px, uint16_t height_px, double focal_px);
void evr_report_close(evr_report_t *r);

/** Before anything else: the host time of the first event, which is 0 in every plot. */
void evr_report_start(evr_report_t *r, int64_t first_us);

/** Ahead of the events that need it. @param t_us  Host time, by the events' clock. */
void evr_report_orientation(evr_report_t *r, int64_t t_us, const evs_orientation_t *o);

/** @param t_us  Host time of each event; window_first_us, window_last_us those of the window, when it ends here. */
void evr_report_chunk(evr_report_t *r, const evs_pipeline_chunk_t *chunk, const int64_t *t_us, int64_t window_first_us,
                      int64_t window_last_us);

/** An estimate of the direction of flight. */
typedef struct {
    int64_t t_us; /**< Host time. */
    double v[3];  /**< Unit vector in the camera's frame. */
    double sigma_rad;
    double truth[3]; /**< The true velocity in the same frame, of any length; 0 0 0 = not known. */
} evr_direction_t;

void evr_report_direction(evr_report_t *r, const evr_direction_t *d);

/** How a piece of the picture moved: where it is in the newest image, and by how much it came there. Pixels. */
typedef struct {
    double x, y, dx, dy;
    bool inlier; /**< Fits the direction. */
} evr_arrow_t;

/** A pair of images that gave a direction. */
typedef struct {
    const uint8_t *px; /**< The newest image, of the sensor's size. Copied if need be. */
    int64_t t_us;      /**< Host time of it. */
    int64_t interval_us;
    double v[3]; /**< The direction in the frame of the image. */
    double sigma_rad;
    double fx_px, fy_px, cx_px, cy_px;
    const evr_arrow_t *arrows;
    size_t n;
} evr_flow_t;

/** The page shows the one with the smallest uncertainty. */
void evr_report_flow(evr_report_t *r, const evr_flow_t *flow);

/** The numbers that matter. After the last event. */
typedef struct {
    double sharpness_before, sharpness_after; /**< Mean over spans of up to 120 ms, never across a saccade. */
    double rate_rad_s, rate_max_rad_s;        /**< Of the rotation that was removed; 0 when nothing is known. */
    double motion_px_s, motion_max_px_s;      /**< Its motion at the image centre. */
    uint64_t n_directions, n_directions_true; /**< Estimates of the direction of flight; those with a truth. */
    double sigma_deg, direction_error_deg;    /**< Medians; NaN of none. */
} evr_numbers_t;

/** Call it once, after the last event and before evr_report_write(). */
evr_numbers_t evr_report_finish(evr_report_t *r);

/**
 * Write DIR/report.html.
 * @param name     Of the recording, any bytes.
 * @param summary  JSON text: settings and counts, as in summary.json.
 */
bool evr_report_write(const evr_report_t *r, const char *dir, const char *name, const char *summary, evh_error_t *err);

#endif
