/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  pose_track.h
 * @brief Poses at any time: between two samples that are close enough, and nowhere else.
 *
 * A gap in the truth (markers hidden, recorder paused) must not be bridged by a straight line and then be counted as
 * the error of the estimate.
 */
#ifndef EVL_POSE_TRACK_H
#define EVL_POSE_TRACK_H

#include "poses_text.h"
#include "rotation.h"

#define EVL_GAP_MAX_US 100000 /**< Samples further apart are not interpolated. */

/** Orientation by slerp. @return false outside of the samples and in gaps. @p q may be NULL: just ask. */
bool evl_track_orientation(const evh_poses_t *track, int64_t t_us, evl_quat_t *q);

/** Position, linear. The same rule. */
bool evl_track_position(const evh_poses_t *track, int64_t t_us, evl_vec3_t *p_m);

/** The first sample later than t_us; track->n when there is none. */
size_t evl_track_after(const evh_poses_t *track, int64_t t_us);

#endif
