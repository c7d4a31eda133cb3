/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "imu.h"

#include <math.h>
#include <string.h>

#include "rng.h"

void evsim_imu_init(evsim_imu_t *imu, const evsim_imu_settings_t *settings, const evsim_motion_t *motion, uint64_t seed)
{
    memset(imu, 0, sizeof *imu);
    imu->settings = settings;
    imu->motion = motion;
    imu->seed = seed;
}

static double clip(double value, double range) { return fmin(fmax(value, -range), range); }

void evsim_imu_next(evsim_imu_t *imu, int64_t t_ns, evsim_imu_sample_t *sample)
{
    const evsim_imu_settings_t *const s = imu->settings;
    const double root_rate = sqrt(s->rate_hz);
    evsim_state_t state;
    evsim_motion_at(imu->motion, (double)(t_ns + s->offset_us * 1000) * 1e-9, &state);
    for (unsigned i = 0u; i < 3u; i++) {
        const double white_a = evsim_gauss(imu->seed, EVSIM_STREAM_IMU_NOISE, i, imu->n);
        const double white_g = evsim_gauss(imu->seed, EVSIM_STREAM_IMU_NOISE, 3u + i, imu->n);
        sample->accel_m_s2[i] =
            clip(state.f_c_m_s2.v[i] + s->accel_bias_m_s2[i] + imu->walk[i] + s->accel_noise * root_rate * white_a,
                 s->accel_range_m_s2);
        sample->gyro_rad_s[i] =
            clip(state.w_c_rad_s.v[i] + s->gyro_bias_rad_s[i] + imu->walk[3u + i] + s->gyro_noise * root_rate * white_g,
                 s->gyro_range_rad_s);
        imu->walk[i] += s->accel_walk / root_rate * evsim_gauss(imu->seed, EVSIM_STREAM_IMU_NOISE, 6u + i, imu->n);
        imu->walk[3u + i] += s->gyro_walk / root_rate * evsim_gauss(imu->seed, EVSIM_STREAM_IMU_NOISE, 9u + i, imu->n);
    }
    imu->n++;
}
