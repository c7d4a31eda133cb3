/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  velocity_error.h
 * @brief How far estimated directions of the camera's velocity are from true ones.
 *
 * Model    The error is the angle between the two vectors, both in the camera's frame. Truth is either a table of
 *          velocities, or poses: the slope, in the middle, of the parabola that fits the positions over a baseline best
 *          (those of the samples within it, and at its two ends the straight line between two samples), turned into the
 *          camera's frame by the orientation in the middle. Positions are noisy: a fit to all of them errs by half as
 *          much as the difference of two. A lever arm between the tracked body and the camera is not taken into account.
 *          A direction means little where the camera hardly moves: samples whose true speed is below
 *          EVL_SLOW_SHARE of the mean true speed (over all samples that have a truth) are counted and left out.
 *          An estimate may say how sure it is: the RMS of its angle, sigma. Were its errors Gaussian and sigma right,
 *          63 % of them would be within 1 sigma and 98 % within 2: an angle has two components.
 */
#ifndef EVL_VELOCITY_ERROR_H
#define EVL_VELOCITY_ERROR_H

#include "pose_track.h"
#include "stats.h"

#define EVL_SLOW_SHARE 0.25

/** Older than this an estimate is of no use: time counts as covered for so long after each. */
#define EVL_COVER_US 100000

typedef struct {
    int64_t t_us;
    evl_vec3_t v;
    double sigma_deg;    /**< NaN: not told. */
    int64_t interval_us; /**< Of the flow that it comes from; 0: not told. */
} evl_velocity_t;

typedef struct {
    evl_velocity_t *at;
    size_t n;
    evh_tally_t tally; /**< A row of NaN (no estimate was possible) counts as not finite. */
} evl_velocities_t;

/** Columns t vx vy vz, and sigma_deg where a header names it: velocity.csv of a run, velocity.txt of the simulator. */
bool evl_velocities_read(evl_velocities_t *v, const char *path, evh_error_t *err);
void evl_velocities_free(evl_velocities_t *v);

/** Give the estimates the intervals of a run's pairs.csv, by their times. */
bool evl_velocities_read_intervals(evl_velocities_t *v, const char *path, evh_error_t *err);

/** Where the truth comes from: the table, if there is one, else the poses. */
typedef struct {
    const evl_velocities_t *table;
    const evh_poses_t *poses;
    int64_t baseline_us;
    evl_quat_t q_bc; /**< Poses: body from camera. */
} evl_velocity_truth_t;

/** The true velocity in the camera's frame, m/s. @return false where the truth does not reach, or has a gap. */
bool evl_velocity_at(const evl_velocity_truth_t *truth, int64_t t_us, evl_vec3_t *v);

/**
 * The mean true velocity over an interval around t_us, from poses, in the camera's frame at t_us: from where the camera
 * was at its beginning to where it was at its end. That is what flow over the interval shows.
 */
bool evl_velocity_over(const evh_poses_t *poses, evl_quat_t q_bc, int64_t t_us, int64_t interval_us, evl_vec3_t *v);

typedef struct {
    size_t n_estimates; /**< In the span that was asked for, zero vectors left out. */
    size_t n_zero;
    size_t n_no_truth;
    size_t n_slow;
    double mean_speed_m_s; /**< Of the truth. */
    evl_stats_t error_deg;
    evl_stats_t interval_error_deg; /**< Against the mean over the interval, where it is told and there are poses. */
    size_t n_sigma; /**< Of these errors (over the interval, where it is told) so many have a sigma... */
    size_t n_within_sigma, n_within_2_sigma; /**< ...and are so small. */
} evl_velocity_result_t;

/** Estimates in [from, to). @return false when memory is short. */
bool evl_velocity_compare(const evl_velocities_t *est, const evl_velocity_truth_t *truth, int64_t from_us,
                          int64_t to_us, evl_velocity_result_t *result);

/** The share of [from_us, to_us) in which an estimate of the last EVL_COVER_US was at hand. 0 for an empty span. */
double evl_velocity_coverage(const evl_velocities_t *est, int64_t from_us, int64_t to_us);

#endif
