/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "attitude_error.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* By atan2: acos of a number near 1 would turn the last digits of a file into a hundredth of a degree. */
evl_attitude_error_t evl_attitude_error(evl_quat_t est, evl_quat_t ref)
{
    const evl_quat_t e = evl_quat_mul(est, evl_quat_conj(ref));
    evl_attitude_error_t error;
    error.total_rad = evl_quat_angle(e);
    error.heading_rad = 2.0 * atan2(fabs(e.z), fabs(e.w));
    error.inclination_rad = 2.0 * atan2(sqrt(e.x * e.x + e.y * e.y), sqrt(e.w * e.w + e.z * e.z));
    return error;
}

/* Each estimate of the span that has a truth. @return their count. */
static size_t make_pairs(const evh_poses_t *est, const evh_poses_t *truth, int64_t from_us, int64_t to_us,
                         evl_pair_t *pair, evl_attitude_result_t *x)
{
    size_t n = 0u;
    for (size_t i = 0u; i < est->n; i++) {
        const int64_t t_us = est->pose[i].t_us;
        if ((t_us < from_us) || (t_us >= to_us)) { continue; }
        x->n_estimates++;
        if (!evl_track_orientation(truth, t_us, &pair[n].ref)) {
            x->n_no_truth++;
            continue;
        }
        pair[n].est = evl_quat(est->pose[i].q_wxyz);
        pair[n].t_us = t_us;
        n++;
    }
    return n;
}

static bool compare_absolute(const evl_pair_t *pair, size_t n, evl_attitude_result_t *x)
{
    evl_list_t list[3];
    bool ok = true;
    memset(list, 0, sizeof list);
    for (size_t i = 0u; ok && (i < n); i++) {
        const evl_attitude_error_t e = evl_attitude_error(pair[i].est, evl_align_apply(&x->align, pair[i].ref));
        ok = evl_list_add(&list[0], e.total_rad * EVL_DEG_PER_RAD) &&
             evl_list_add(&list[1], e.inclination_rad * EVL_DEG_PER_RAD) &&
             evl_list_add(&list[2], e.heading_rad * EVL_DEG_PER_RAD);
    }
    x->total_deg = evl_list_stats(&list[0]);
    x->inclination_deg = evl_list_stats(&list[1]);
    x->heading_deg = evl_list_stats(&list[2]);
    for (int k = 0; k < 3; k++) { evl_list_free(&list[k]); }
    return ok;
}

/* `left` cancels; `right` does not. */
static bool compare_over(const evh_poses_t *est, const evh_poses_t *truth, const evl_pair_t *pair, size_t n,
                         int64_t span_us, const evl_align_t *align, evl_stats_t *stats)
{
    evl_list_t list;
    bool ok = true;
    memset(&list, 0, sizeof list);
    for (size_t i = 0u; ok && (i < n); i++) {
        const int64_t t_us = pair[i].t_us + span_us;
        evl_quat_t est_then;
        evl_quat_t ref_then;
        evl_quat_t turned_est;
        evl_quat_t turned_ref;
        if ((t_us > pair[n - 1u].t_us) || !evl_track_orientation(est, t_us, &est_then) ||
            !evl_track_orientation(truth, t_us, &ref_then)) {
            continue;
        }
        turned_est = evl_quat_mul(evl_quat_conj(pair[i].est), est_then);
        turned_ref =
            evl_quat_mul(evl_quat_conj(evl_quat_mul(pair[i].ref, align->right)), evl_quat_mul(ref_then, align->right));
        ok = evl_list_add(&list, EVL_DEG_PER_RAD * evl_quat_angle(evl_quat_mul(evl_quat_conj(turned_ref), turned_est)));
    }
    *stats = evl_list_stats(&list);
    evl_list_free(&list);
    return ok;
}

bool evl_attitude_compare(const evh_poses_t *est, const evh_poses_t *truth, int64_t from_us, int64_t to_us,
                          evl_align_kind_t align, evl_attitude_result_t *result)
{
    evl_pair_t *const pair = malloc((est->n + 1u) * sizeof *pair);
    bool ok = true;
    size_t n;
    memset(result, 0, sizeof *result);
    result->align.kind = align;
    result->align.left = evl_quat_identity();
    result->align.right = evl_quat_identity();
    if (pair == NULL) { return false; }
    n = make_pairs(est, truth, from_us, to_us, pair, result);
    if (n > 0u) {
        result->t_first_us = pair[0].t_us;
        result->t_last_us = pair[n - 1u].t_us;
        result->align = evl_align(align, pair, n);
        ok = compare_absolute(pair, n, result) &&
             compare_over(est, truth, pair, n, 100000, &result->align, &result->over_100ms_deg) &&
             compare_over(est, truth, pair, n, 1000000, &result->align, &result->over_1s_deg);
    }
    free(pair);
    return ok;
}
