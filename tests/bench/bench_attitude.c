/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * Instructions of one attitude update. The carrier rolls, pitches and turns by several rad/s and is shaken by several
 * m/s^2, so that no branch is spared; the bias is given and the start is over, as in the middle of a flight.
 * Samples come from short integer oscillators: what they cost lies outside the marked regions.
 */
#include "bench_markers.h"
#include "bench_regions.h"
#include "evs/attitude.h"

enum { WARM_UP = 8000, STEP_US = 1000 };

static evs_attitude_t att;
static uint32_t now_us;
static uint32_t n;

/* A sine of the given period in samples, as amplitude / 2^30 of Q30. */
static int32_t wave(uint32_t period, int32_t amplitude)
{
    int32_t sin_q30, cos_q30;
    evs_sincos((int32_t)(n * (UINT32_MAX / period)), &sin_q30, &cos_q30);
    return evs_q_mul(sin_q30, amplitude, 30);
}

static evs_vec3_t rate(void)
{
    const evs_vec3_t v = {wave(97u, 60000000), wave(131u, 50000000), wave(173u, 40000000)};
    return v;
}
static evs_vec3_t acceleration(void)
{
    const evs_vec3_t v = {wave(53u, 5000000), wave(71u, 6000000), 10283000 + wave(61u, 4000000)};
    return v;
}
static evs_vec3_t field(void)
{
    const evs_vec3_t v = {wave(401u, 1000000), 1300000, -2600000 + wave(307u, 400000)};
    return v;
}

static void begin(bool with_mag)
{
    const evs_attitude_config_t cfg = evs_attitude_config_default();
    const evs_vec3_t bias = {1000, -2000, 3000};
    if ((evs_attitude_init(&att, &cfg) != EVS_OK) || (evs_attitude_set_bias(&att, bias) != EVS_OK)) { return; }
    if (evs_attitude_set_orientation(&att, evs_quat_identity()) != EVS_OK) { return; } /* no start to get over */
    for (int i = 0; i < WARM_UP; i++) {
        now_us += STEP_US;
        n++;
        evs_attitude_push_gyro(&att, now_us, rate());
        evs_attitude_push_accel(&att, now_us, acceleration());
        if (with_mag) { evs_attitude_push_mag(&att, now_us, field()); }
    }
}

int main(void)
{
    begin(false);
    for (int i = 0; i < BENCH_UPDATES; i++) {
        now_us += STEP_US;
        n++;
        const evs_vec3_t w = rate();
        const evs_vec3_t a = acceleration();
        BENCH_START(BENCH_UPDATE_6D);
        evs_attitude_push_gyro(&att, now_us, w);
        evs_attitude_push_accel(&att, now_us, a);
        BENCH_STOP(BENCH_UPDATE_6D);
    }
    begin(true);
    for (int i = 0; i < BENCH_UPDATES; i++) {
        now_us += STEP_US;
        n++;
        const evs_vec3_t w = rate();
        const evs_vec3_t a = acceleration();
        const evs_vec3_t m = field();
        BENCH_START(BENCH_UPDATE_9D);
        BENCH_START(BENCH_GYRO);
        evs_attitude_push_gyro(&att, now_us, w);
        BENCH_STOP(BENCH_GYRO);
        BENCH_START(BENCH_ACCEL);
        evs_attitude_push_accel(&att, now_us, a);
        BENCH_STOP(BENCH_ACCEL);
        BENCH_START(BENCH_MAG);
        evs_attitude_push_mag(&att, now_us, m);
        BENCH_STOP(BENCH_MAG);
        BENCH_STOP(BENCH_UPDATE_9D);
    }
    for (int i = 0; i < WARM_UP + BENCH_UPDATES; i++) { /* lying still */
        const evs_vec3_t w = {900, -2100, 3050};
        const evs_vec3_t a = {1000, 2000, 10283000};
        const evs_vec3_t m = {0, 1300000, -2600000};
        now_us += STEP_US;
        if (i < WARM_UP) {
            evs_attitude_push_gyro(&att, now_us, w);
            evs_attitude_push_accel(&att, now_us, a);
            evs_attitude_push_mag(&att, now_us, m);
            continue;
        }
        BENCH_START(BENCH_REST_9D);
        BENCH_START(BENCH_REST_6D);
        evs_attitude_push_gyro(&att, now_us, w);
        evs_attitude_push_accel(&att, now_us, a);
        BENCH_STOP(BENCH_REST_6D);
        evs_attitude_push_mag(&att, now_us, m);
        BENCH_STOP(BENCH_REST_9D);
    }
    return 0;
}
