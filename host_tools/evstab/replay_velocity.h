/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  replay_velocity.h
 * @brief evstab replay: the images of the windows and what their pairs tell. velocity.csv, pairs.csv, frames, the report.
 *
 * The middle of a pair's interval is what a row belongs to. It runs back when the interval grows from one pair to the
 * next, so rows wait until no earlier one can come.
 */
#ifndef EVT_REPLAY_VELOCITY_H
#define EVT_REPLAY_VELOCITY_H

#include "replay.h"

/** A row of the two files. */
typedef struct {
    int64_t t_us; /**< Host time. */
    evs_velocity_result_t pair;
} evt_velocity_row_t;

typedef struct {
    const evt_replay_t *r;
    evt_replay_velocity_counts_t *counts;
    evr_report_t *report; /**< NULL: nobody looks on. */
    evh_csv_t velocity, pairs, frames;
    bool has_velocity, has_pairs, has_frames;
    char *frames_dir;

    evt_velocity_row_t *waiting; /**< By time. */
    size_t n_waiting, cap_waiting;

    uint8_t *image; /**< Of the newest window: the library's own changes its place. */
    bool has_image;
    int64_t image_us;

    evr_arrow_t *arrows;
    evh_poses_t truth; /**< For the report; n = 0: none. */
} evt_velocity_log_t;

/** Open the files that the settings ask for. */
bool evt_velocity_log_open(evt_velocity_log_t *log, const evt_replay_t *r, const char *dir, evr_report_t *report,
                           evt_replay_velocity_counts_t *counts, evh_error_t *err);

/** A window has closed. @param t_last_us  Host time of its last event. */
bool evt_velocity_log_window(evt_velocity_log_t *log, const evs_pipeline_chunk_t *chunk, int64_t t_last_us,
                             evh_error_t *err);

/** A pair has been solved. */
bool evt_velocity_log_pair(evt_velocity_log_t *log, const evs_pipeline_t *pipeline, const evs_velocity_result_t *pair,
                           evh_error_t *err);

/** Write what waits, and close. Frees after a failure too. */
bool evt_velocity_log_close(evt_velocity_log_t *log, evh_error_t *err);

#endif
