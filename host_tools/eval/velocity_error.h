/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  velocity_error.h
 * @brief How far estimated directions of the camera's velocity are from true ones.
 *
 * Model    The error is the angle between the two vectors, both in the camera's frame. Truth is either a table of
 *          velocities, or poses: the difference of the positions half a baseline before and after, turned into the
 *          camera's frame by the orientation in the middle. A lever arm between the tracked body and the camera is not
 *          taken into account.
 *          A direction means little where the camera hardly moves: samples whose true speed is below
 *          EVL_SLOW_SHARE of the mean true speed (over all samples that have a truth) are counted and left out.
 */
#ifndef EVL_VELOCITY_ERROR_H
#define EVL_VELOCITY_ERROR_H

#include "pose_track.h"
#include "stats.h"

#define EVL_SLOW_SHARE 0.25

typedef struct {
    int64_t t_us;
    evl_vec3_t v;
} evl_velocity_t;

typedef struct {
    evl_velocity_t *at;
    size_t n;
    evh_tally_t tally; /**< A row of NaN (no estimate was possible) counts as not finite. */
} evl_velocities_t;

/** Columns t vx vy vz, further ones ignored: velocity.csv of a run, velocity.txt of the simulator. */
bool evl_velocities_read(evl_velocities_t *v, const char *path, evh_error_t *err);
void evl_velocities_free(evl_velocities_t *v);

/** Where the truth comes from: the table, if there is one, else the poses. */
typedef struct {
    const evl_velocities_t *table;
    const evh_poses_t *poses;
    int64_t baseline_us;
    evl_quat_t q_bc; /**< Poses: body from camera. */
} evl_velocity_truth_t;

/** The true velocity in the camera's frame, m/s. @return false where the truth does not reach, or has a gap. */
bool evl_velocity_at(const evl_velocity_truth_t *truth, int64_t t_us, evl_vec3_t *v);

typedef struct {
    size_t n_estimates; /**< In the span that was asked for, zero vectors left out. */
    size_t n_zero;
    size_t n_no_truth;
    size_t n_slow;
    double mean_speed_m_s; /**< Of the truth. */
    evl_stats_t error_deg;
} evl_velocity_result_t;

/** Estimates in [from, to). @return false when memory is short. */
bool evl_velocity_compare(const evl_velocities_t *est, const evl_velocity_truth_t *truth, int64_t from_us,
                          int64_t to_us, evl_velocity_result_t *result);

#endif
