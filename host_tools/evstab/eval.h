/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  eval.h
 * @brief evstab eval, in two parts: the comparison, and what is told about it (table, eval.json).
 */
#ifndef EVT_EVAL_H
#define EVT_EVAL_H

#include <stdio.h>

#include "attitude_error.h"
#include "run_sharpness.h"
#include "velocity_error.h"

/** What was asked for. */
typedef struct {
    const char *run;
    const char *truth;          /**< NULL: none. */
    const char *velocity_truth; /**< NULL: from the poses. */
    evl_align_kind_t align;
    int64_t poses_offset_us; /**< t_event = t_pose + offset. */
    int64_t baseline_us;
    int64_t from_us, to_us; /**< [from, to) */
} evt_eval_t;

/** What came out; each part counts only where its has_ flag is set. */
typedef struct {
    char attitude_source[16]; /**< Of the run: "imu", ... */
    bool has_attitude;
    evl_attitude_result_t attitude;
    bool has_velocity;
    uint64_t n_no_estimate; /**< Rows of velocity.csv without one. */
    evl_velocity_result_t velocity;
    double coverage; /**< evl_velocity_coverage() over the run; NaN: its span is not known. */
    bool has_sharpness;
    evl_run_sharpness_t sharpness;
    evl_gain_t per_window, per_100ms;
} evt_eval_result_t;

const char *evt_align_name(evl_align_kind_t kind);

void evt_eval_print(const evt_eval_t *e, const evt_eval_result_t *x, FILE *out);
bool evt_eval_write_json(const evt_eval_t *e, const evt_eval_result_t *x, const char *path, evh_error_t *err);

#endif
