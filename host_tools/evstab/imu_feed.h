/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  imu_feed.h
 * @brief The order in which one row of an IMU file goes into a filter: the same as in a firmware (README).
 *
 * A row holds all sensors at one time. The gyro comes last: its sample is what makes the orientation of that time
 * known, with everything that the other sensors told up to then. So the very first orientation is level already.
 */
#ifndef EVT_IMU_FEED_H
#define EVT_IMU_FEED_H

#include "imu_text.h"
#include "to_device.h"

typedef struct {
    void *filter;
    void (*gyro)(void *filter, uint32_t t_us, evs_vec3_t rate_rad_s_q24);
    void (*accel)(void *filter, uint32_t t_us, evs_vec3_t accel_m_s2_q20);
    void (*mag)(void *filter, uint32_t t_us, evs_vec3_t field_ut_q16);
} evt_imu_feed_t;

static inline void evt_imu_feed(const evt_imu_feed_t *feed, const evh_imu_sample_t *s)
{
    const uint32_t t_us = evt_time_us(s->t_us);
    feed->accel(feed->filter, t_us, evt_accel_q20(s->accel_m_s2));
    if (s->has_mag) { feed->mag(feed->filter, t_us, evt_field_q16(s->mag_ut)); }
    feed->gyro(feed->filter, t_us, evt_rate_q24(s->gyro_rad_s));
}

#endif
