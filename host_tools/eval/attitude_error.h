/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  attitude_error.h
 * @brief How far estimated orientations are from true ones.
 *
 * Model    e = q_est . q_ref^-1 in the earth's frame, q_ref aligned (align.h).
 *          total 2 acos|e_w|; heading 2 atan|e_z / e_w|; inclination 2 acos sqrt(e_w^2 + e_z^2).
 *          over T: the rotation that the estimate makes from t to t + T against the true one. It is what stabilization
 *          feels: a constant error does not blur.
 *          Truth is taken at the estimates' times, by slerp, where its samples are close enough (pose_track.h).
 */
#ifndef EVL_ATTITUDE_ERROR_H
#define EVL_ATTITUDE_ERROR_H

#include "align.h"
#include "pose_track.h"
#include "stats.h"

typedef struct {
    double total_rad, inclination_rad, heading_rad;
} evl_attitude_error_t;

/** The error of one estimate against an aligned truth. */
evl_attitude_error_t evl_attitude_error(evl_quat_t est, evl_quat_t ref);

typedef struct {
    size_t n_estimates; /**< In the span that was asked for. */
    size_t n_no_truth;  /**< Of them, where no truth is. */
    int64_t t_first_us, t_last_us;
    evl_align_t align;
    evl_stats_t total_deg, inclination_deg, heading_deg;
    evl_stats_t over_100ms_deg, over_1s_deg;
} evl_attitude_result_t;

/**
 * Compare estimates in [from, to) with the truth. With nothing to compare the result has total_deg.n = 0.
 * @return false when memory is short.
 */
bool evl_attitude_compare(const evh_poses_t *est, const evh_poses_t *truth, int64_t from_us, int64_t to_us,
                          evl_align_kind_t align, evl_attitude_result_t *result);

#endif
