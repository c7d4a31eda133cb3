/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "settings.h"

#include <math.h>
#include <string.h>

#include "rng.h"

const char *const evsim_scene_names[EVSIM_SCENES] = {"room", "poster", "shapes", "panorama"};
const char *const evsim_motion_names[EVSIM_MOTIONS] = {"handheld", "hover", "sweep", "flap", "rotate", "static"};

static const evsim_motion_kind_t DEFAULT_MOTION[EVSIM_SCENES] = {EVSIM_MOTION_FLAP, EVSIM_MOTION_HANDHELD,
                                                                 EVSIM_MOTION_HANDHELD, EVSIM_MOTION_ROTATE};

void evsim_default_calib(evh_calib_t *calib, uint16_t width_px, uint16_t height_px)
{
    const double longer = (double)((width_px > height_px) ? width_px : height_px);
    memset(calib, 0, sizeof *calib);
    calib->width_px = width_px;
    calib->height_px = height_px;
    calib->fx_px = fmax(0.83 * longer, 1.0);
    calib->fy_px = calib->fx_px;
    calib->cx_px = 0.5 * (double)(width_px - 1);
    calib->cy_px = 0.5 * (double)(height_px - 1);
    calib->dist[0] = -0.36;
    calib->dist[1] = 0.15;
}

void evsim_random_direction(double length, uint64_t seed, unsigned index, double out[3])
{
    double norm = 0.0;
    for (unsigned i = 0u; i < 3u; i++) {
        out[i] = evsim_gauss(seed, EVSIM_STREAM_IMU_BIAS, index, i);
        norm += out[i] * out[i];
    }
    for (unsigned i = 0u; i < 3u; i++) { out[i] *= length / sqrt(norm); }
}

void evsim_settings_default(evsim_settings_t *s, evsim_scene_kind_t scene)
{
    memset(s, 0, sizeof *s);
    s->scene = scene;
    s->motion = DEFAULT_MOTION[scene];
    s->duration_us = 3000000;
    s->seed = 1u;
    evsim_default_calib(&s->calib, 240u, 180u);
    s->frames = true;
    s->fps_hz = 24.0;
    s->exposure_us = 10000;
    s->contrast_on = 0.35;
    s->contrast_off = 0.35;
    s->contrast_sigma = 0.02;
    s->refractory_us = 100;
    s->noise_hz = 0.1;
    s->hot_hz = 200.0;
    s->imu.rate_hz = 1000.0;
    evsim_random_direction(0.01, s->seed, 0u, s->imu.gyro_bias_rad_s);
    evsim_random_direction(0.05, s->seed, 1u, s->imu.accel_bias_m_s2);
    s->imu.gyro_noise = 1e-4;
    s->imu.accel_noise = 4e-3;
    s->imu.gyro_walk = 2e-4;
    s->imu.accel_walk = 1e-3;
    s->imu.gyro_range_rad_s = 2000.0 * 3.14159265358979323846 / 180.0;
    s->imu.accel_range_m_s2 = 16.0 * 9.81;
    s->jobs = 1u;
}
