/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  poses_text.h
 * @brief Ground-truth poses in text: ECD groundtruth.txt and TUM files (t px py pz qx qy qz qw), EuRoC and TUM-VI csv.
 *
 * Read whole: an hour at 200 Hz is 46 MB. A quaternion whose length is off by more than 5 % is skipped and counted, the
 * others are normalized (files print a few digits only).
 */
#ifndef EVH_POSES_TEXT_H
#define EVH_POSES_TEXT_H

#include "rows.h"

typedef struct {
    int64_t t_us;
    double p_m[3];
    double q_wxyz[4]; /**< As recorded: body (camera or marker frame) to world. */
} evh_pose_t;

typedef struct {
    evh_pose_t *pose;
    size_t n;
    evh_tally_t tally;
} evh_poses_t;

bool evh_poses_read(evh_poses_t *poses, const char *path, evh_error_t *err);
void evh_poses_free(evh_poses_t *poses);

#endif
