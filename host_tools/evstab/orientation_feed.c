/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "orientation_feed.h"

#include <string.h>

#define RATE_SPAN_MAX_US 1000000 /* Poses further apart tell nothing about the rate between them. */

static void push_gyro(void *p, uint32_t t_us, evs_vec3_t v) { evs_pipeline_push_gyro(p, t_us, v); }
static void push_accel(void *p, uint32_t t_us, evs_vec3_t v) { evs_pipeline_push_accel(p, t_us, v); }
static void push_mag(void *p, uint32_t t_us, evs_vec3_t v) { evs_pipeline_push_mag(p, t_us, v); }

static bool is_imu(const evt_orientation_feed_t *feed)
{
    return (feed->kind == EVT_ATTITUDE_IMU) || (feed->kind == EVT_ATTITUDE_GYRO);
}

bool evt_orientation_feed_fetch(evt_orientation_feed_t *feed, evh_error_t *err)
{
    if (is_imu(feed)) {
        feed->has_next = evh_imu_next(&feed->imu, &feed->next_imu, err);
        feed->next_us = feed->next_imu.t_us + feed->offset_us;
    } else {
        feed->has_next = (feed->next_pose < feed->poses.n);
        if (feed->has_next) { feed->next_us = feed->poses.pose[feed->next_pose].t_us + feed->offset_us; }
    }
    return err->text[0] == '\0';
}

bool evt_orientation_feed_open(evt_orientation_feed_t *feed, const evt_replay_t *r, evs_pipeline_t *pipeline,
                               evh_error_t *err)
{
    memset(feed, 0, sizeof *feed);
    feed->kind = r->attitude;
    feed->pipeline = pipeline;
    feed->offset_us = r->pipeline.track.offset_us;
    feed->imu_feed = (evt_imu_feed_t){pipeline, push_gyro, push_accel, push_mag};
    if (is_imu(feed)) {
        if (!evh_imu_open(&feed->imu, r->rec.imu, &r->imu_order, err)) { return false; }
        feed->imu_open = true;
    }
    if ((feed->kind == EVT_ATTITUDE_TRUTH) && !evh_poses_read(&feed->poses, r->rec.poses, err)) { return false; }
    if (feed->kind != EVT_ATTITUDE_NONE) {
        (void)evt_orientation_feed_fetch(feed, err);
        if (!feed->has_next) {
            return evh_fail(err, "%s: holds no usable sample; try another --attitude",
                            is_imu(feed) ? r->rec.imu : r->rec.poses);
        }
    }
    return true;
}

static evs_quat_t quat_of(const evh_pose_t *pose)
{
    const double *const q = pose->q_wxyz; /* Of unit length: the reader saw to it. */
    return evs_quat_from_double(q[0], q[1], q[2], q[3]);
}

/* Poses have no rates: that between the neighbours, as far as they are near. */
static evs_vec3_t rate_at(const evh_poses_t *poses, size_t i)
{
    const evs_vec3_t zero = {0, 0, 0};
    evs_vec3_t rate = zero;
    size_t a = (i > 0u) ? i - 1u : i;
    size_t b = (i + 1u < poses->n) ? i + 1u : i;
    int64_t dt_us;
    if (poses->pose[i].t_us - poses->pose[a].t_us > RATE_SPAN_MAX_US) { a = i; }
    if (poses->pose[b].t_us - poses->pose[i].t_us > RATE_SPAN_MAX_US) { b = i; }
    dt_us = poses->pose[b].t_us - poses->pose[a].t_us;
    if (evs_quat_rate(quat_of(&poses->pose[a]), quat_of(&poses->pose[b]), (int32_t)dt_us, &rate) != EVS_OK) {
        return zero; /* A lone pose. */
    }
    return rate;
}

static void push_pose(evt_orientation_feed_t *feed, evs_orientation_t *newest, bool *known)
{
    const size_t i = feed->next_pose++;
    newest->t_us = evt_time_us(feed->poses.pose[i].t_us);
    newest->q_wc = quat_of(&feed->poses.pose[i]);
    newest->rate_rad_s_q24 = rate_at(&feed->poses, i);
    *known = (evs_pipeline_push_orientation(feed->pipeline, newest) == EVS_OK);
}

void evt_orientation_feed_push(evt_orientation_feed_t *feed, evs_orientation_t *newest, uint32_t *flags, bool *known)
{
    if (is_imu(feed)) {
        evt_imu_feed(&feed->imu_feed, &feed->next_imu);
        *known = (evs_pipeline_newest_orientation(feed->pipeline, newest) == EVS_OK) &&
                 (newest->t_us == evt_time_us(feed->next_imu.t_us));
        *flags = evs_attitude_flags(evs_pipeline_attitude(feed->pipeline));
    } else {
        push_pose(feed, newest, known);
        *flags = EVS_ATTITUDE_TILT_KNOWN | EVS_ATTITUDE_HEADING_KNOWN;
    }
}

void evt_orientation_feed_close(evt_orientation_feed_t *feed, evt_replay_result_t *result)
{
    if (feed->imu_open) {
        result->imu_tally = feed->imu.rows.tally;
        evh_imu_close(&feed->imu);
    }
    result->poses_tally = feed->poses.tally;
    evh_poses_free(&feed->poses);
}
