/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <math.h>
#include <string.h>

#include "imu.h"
#include "unity.h"

static evsim_settings_t settings;
static evsim_motion_t motion;
static evsim_imu_t imu;

void setUp(void)
{
    evsim_settings_default(&settings, EVSIM_SCENE_ROOM);
    settings.motion = EVSIM_MOTION_SWEEP;
    settings.imu.gyro_noise = 0.0;
    settings.imu.accel_noise = 0.0;
    settings.imu.gyro_walk = 0.0;
    settings.imu.accel_walk = 0.0;
    memset(settings.imu.gyro_bias_rad_s, 0, sizeof settings.imu.gyro_bias_rad_s);
    memset(settings.imu.accel_bias_m_s2, 0, sizeof settings.imu.accel_bias_m_s2);
    evsim_motion_init(&motion, &settings);
    evsim_imu_init(&imu, &settings.imu, &motion, settings.seed);
}

void tearDown(void) {}

static void test_a_perfect_imu_reads_the_motion(void)
{
    for (int64_t t_ns = 0; t_ns < 1000000000; t_ns += 1000000) {
        evsim_imu_sample_t s;
        evsim_state_t want;
        evsim_imu_next(&imu, t_ns, &s);
        evsim_motion_at(&motion, (double)t_ns * 1e-9, &want);
        for (int i = 0; i < 3; i++) {
            TEST_ASSERT_EQUAL_DOUBLE(want.f_c_m_s2.v[i], s.accel_m_s2[i]);
            TEST_ASSERT_EQUAL_DOUBLE(want.w_c_rad_s.v[i], s.gyro_rad_s[i]);
        }
    }
}

static void test_offset_means_that_event_time_is_imu_time_plus_offset(void)
{
    evsim_imu_sample_t s;
    evsim_state_t want;
    settings.imu.offset_us = -2500;
    evsim_imu_next(&imu, 400000000, &s);
    evsim_motion_at(&motion, 0.3975, &want);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, want.w_c_rad_s.v[0], s.gyro_rad_s[0]);
}

static void test_bias_adds_and_the_range_ends_readings(void)
{
    evsim_imu_sample_t s;
    evsim_state_t want;
    settings.imu.gyro_bias_rad_s[1] = 0.25;
    evsim_imu_next(&imu, 0, &s);
    evsim_motion_at(&motion, 0.0, &want);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, want.w_c_rad_s.v[1] + 0.25, s.gyro_rad_s[1]);
    settings.imu.gyro_range_rad_s = 0.5;
    settings.imu.accel_range_m_s2 = 5.0;
    for (int64_t t_ns = 0; t_ns < 1000000000; t_ns += 1000000) {
        evsim_imu_next(&imu, t_ns, &s);
        evsim_motion_at(&motion, (double)t_ns * 1e-9, &want);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, fmin(fmax(want.w_c_rad_s.v[2], -0.5), 0.5), s.gyro_rad_s[2]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, fmin(fmax(want.f_c_m_s2.v[1], -5.0), 5.0), s.accel_m_s2[1]);
    }
}

static void test_noise_has_the_stated_density_and_walk(void)
{
    enum { N = 20000 };
    static double gyro[N];
    double white = 0.0;
    double steps = 0.0;
    settings.motion = EVSIM_MOTION_STATIC;
    evsim_motion_init(&motion, &settings);
    settings.imu.gyro_noise = 0.01;
    for (int i = 0; i < N; i++) {
        evsim_imu_sample_t s;
        evsim_imu_next(&imu, (int64_t)i * 1000000, &s);
        white += s.gyro_rad_s[0] * s.gyro_rad_s[0] / N;
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.04 * 0.1, 0.01 * 0.01 * 1000.0, white); /* density^2 * rate; 4 sigma */
    settings.imu.gyro_noise = 0.0;
    settings.imu.gyro_walk = 0.02;
    evsim_imu_init(&imu, &settings.imu, &motion, 9u);
    for (int i = 0; i < N; i++) {
        evsim_imu_sample_t s;
        evsim_imu_next(&imu, (int64_t)i * 1000000, &s);
        gyro[i] = s.gyro_rad_s[0];
        if (i > 0) { steps += (gyro[i] - gyro[i - 1]) * (gyro[i] - gyro[i - 1]); }
    }
    TEST_ASSERT_EQUAL_DOUBLE(0.0, gyro[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.04 * 0.02 * 0.02 * 20.0, 0.02 * 0.02 * 20.0, steps); /* walk^2 * 20 s */
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_perfect_imu_reads_the_motion);
    RUN_TEST(test_offset_means_that_event_time_is_imu_time_plus_offset);
    RUN_TEST(test_bias_adds_and_the_range_ends_readings);
    RUN_TEST(test_noise_has_the_stated_density_and_walk);
    return UNITY_END();
}
