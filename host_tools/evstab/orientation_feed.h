/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  orientation_feed.h
 * @brief The orientations of a recording, in the order of time, into the pipeline: IMU samples or recorded poses.
 */
#ifndef EVT_ORIENTATION_FEED_H
#define EVT_ORIENTATION_FEED_H

#include "imu_feed.h"
#include "replay.h"

typedef struct {
    evt_attitude_t kind;
    evs_pipeline_t *pipeline;
    int64_t offset_us; /**< t_event - t_sample. */
    evh_imu_t imu;
    bool imu_open;
    evt_imu_feed_t imu_feed;
    evh_imu_sample_t next_imu;
    evh_poses_t poses;
    size_t next_pose;
    bool has_next;
    int64_t next_us; /**< Time of the next sample, by the events' clock. */
} evt_orientation_feed_t;

bool evt_orientation_feed_open(evt_orientation_feed_t *feed, const evt_replay_t *r, evs_pipeline_t *pipeline,
                               evh_error_t *err);

/**
 * Push the sample at hand (feed->has_next); evt_orientation_feed_fetch() gets the one after it.
 * @param[out] newest, flags  What attitude.csv tells; newest->t_us is by the sample's clock.
 * @param[out] known  false when the sample gave no orientation.
 */
void evt_orientation_feed_push(evt_orientation_feed_t *feed, evs_orientation_t *newest, uint32_t *flags, bool *known);

/** Read on. @return false when reading failed; the end only clears feed->has_next. */
bool evt_orientation_feed_fetch(evt_orientation_feed_t *feed, evh_error_t *err);

void evt_orientation_feed_close(evt_orientation_feed_t *feed, evt_replay_result_t *result);

#endif
