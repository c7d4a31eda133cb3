/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "pose_track.h"

/* The last sample at or before t_us, and how far the next one is (0..1 of the way). Times ascend strictly. */
static bool find(const evh_poses_t *track, int64_t t_us, size_t *at, double *s)
{
    size_t low = 0u;
    size_t high = track->n;
    if ((track->n == 0u) || (t_us < track->pose[0].t_us) || (t_us > track->pose[track->n - 1u].t_us)) { return false; }
    while (high - low > 1u) {
        const size_t middle = low + (high - low) / 2u;
        if (track->pose[middle].t_us <= t_us) {
            low = middle;
        } else {
            high = middle;
        }
    }
    *at = low;
    *s = 0.0;
    if (track->pose[low].t_us == t_us) { return true; }
    if (track->pose[low + 1u].t_us - track->pose[low].t_us > EVL_GAP_MAX_US) { return false; }
    *s = (double)(t_us - track->pose[low].t_us) / (double)(track->pose[low + 1u].t_us - track->pose[low].t_us);
    return true;
}

bool evl_track_orientation(const evh_poses_t *track, int64_t t_us, evl_quat_t *q)
{
    size_t i = 0u;
    double s = 0.0;
    if (!find(track, t_us, &i, &s)) { return false; }
    if (q != NULL) {
        *q = evl_quat(track->pose[i].q_wxyz);
        if (s > 0.0) { *q = evl_quat_slerp(*q, evl_quat(track->pose[i + 1u].q_wxyz), s); }
    }
    return true;
}

bool evl_track_position(const evh_poses_t *track, int64_t t_us, evl_vec3_t *p_m)
{
    size_t i = 0u;
    double s = 0.0;
    double p[3];
    if (!find(track, t_us, &i, &s)) { return false; }
    for (int k = 0; k < 3; k++) {
        p[k] = track->pose[i].p_m[k];
        if (s > 0.0) { p[k] += s * (track->pose[i + 1u].p_m[k] - p[k]); }
    }
    p_m->x = p[0];
    p_m->y = p[1];
    p_m->z = p[2];
    return true;
}

size_t evl_track_after(const evh_poses_t *track, int64_t t_us)
{
    size_t low = 0u;
    size_t high = track->n;
    while (low < high) {
        const size_t middle = low + (high - low) / 2u;
        if (track->pose[middle].t_us <= t_us) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}
