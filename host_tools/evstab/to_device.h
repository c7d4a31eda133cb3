/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  to_device.h
 * @brief From what files hold (doubles, 64-bit time) to what the library takes (fixed point, 32-bit microseconds).
 */
#ifndef EVT_TO_DEVICE_H
#define EVT_TO_DEVICE_H

#include "calib.h"
#include "evs/camera.h"
#include "evs/float.h"

/** The device's clock: the low 32 bits, also of a negative time. */
static inline uint32_t evt_time_us(int64_t t_us) { return (uint32_t)(uint64_t)t_us; }

/** A calibration that passed evh_calib_check(), for a sensor of this size. */
evs_camera_config_t evt_camera_config(const evh_calib_t *calib, uint16_t width_px, uint16_t height_px);

static inline evs_vec3_t evt_rate_q24(const double rad_s[3])
{
    return evs_vec3_from_double(rad_s[0], rad_s[1], rad_s[2], 24);
}
static inline evs_vec3_t evt_accel_q20(const double m_s2[3])
{
    return evs_vec3_from_double(m_s2[0], m_s2[1], m_s2[2], 20);
}
static inline evs_vec3_t evt_field_q16(const double ut[3]) { return evs_vec3_from_double(ut[0], ut[1], ut[2], 16); }

#endif
