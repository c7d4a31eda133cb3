/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  imu.h
 * @brief An IMU that moves with the camera, axes alike: exact rate and specific force plus bias, random walk of the
 *        bias, white noise, and the ends of its range.
 */
#ifndef EVSIM_IMU_H
#define EVSIM_IMU_H

#include "motion.h"

typedef struct {
    double accel_m_s2[3];
    double gyro_rad_s[3];
} evsim_imu_sample_t;

typedef struct {
    const evsim_imu_settings_t *settings;
    const evsim_motion_t *motion;
    uint64_t seed;
    uint64_t n; /**< Samples so far. */
    double walk[6];
} evsim_imu_t;

/** Keeps both pointers. */
void evsim_imu_init(evsim_imu_t *imu, const evsim_imu_settings_t *settings, const evsim_motion_t *motion,
                    uint64_t seed);

/** The next sample, stamped @p t_ns by the IMU's own clock. Call in the order of time, once a period. */
void evsim_imu_next(evsim_imu_t *imu, int64_t t_ns, evsim_imu_sample_t *sample);

#endif
