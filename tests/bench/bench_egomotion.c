/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * Instructions of one estimate of the direction of velocity: 500 and 100 vectors with 0.5 px of noise, a tenth of them
 * outliers, without and with a prior on the residual rotation; and 128 vectors on a plane under a lateral motion, where
 * the question whether all is rotation takes its second look. And of what 100 vectors tell of the gyro's bias.
 */
#include "bench_markers.h"
#include "bench_regions.h"
#include "evs/gyro_bias.h"
#include "flow_scene.h"

enum { N_MANY = 500, N_FEW = 100 };

static evs_egomotion_flow_t flow[N_MANY];
static uint32_t scratch[EVS_EGOMOTION_BYTES(N_MANY) / 4u];
static evs_egomotion_result_t result;
static evs_gyro_bias_t bias;

static void solve(const evs_egomotion_config_t *cfg, size_t n)
{
    if (evs_egomotion_solve(cfg, flow, n, scratch, sizeof scratch, &result) != EVS_OK) { result.flags = 0u; }
}

static void make(size_t n, bool plane)
{
    scene_settings_t s = scene_settings(0.5, 0.1);
    scene_truth_t truth = {{1.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    if (plane) {
        s.depth_low_m = s.depth_high_m = 2.5;
    } else {
        scene_direction(truth.v);
    }
    scene_make(&s, &truth, flow, n);
}

int main(void)
{
    const evs_egomotion_config_t plain = evs_egomotion_config_default();
    evs_egomotion_config_t prior = plain;
    prior.rotation_sigma_rad_q28 = 234265; /* 1 deg/s over 50 ms */
    for (int i = 0; i < BENCH_SOLVES; i++) {
        make(N_MANY, false);
        BENCH_START(BENCH_SOLVE_500);
        solve(&plain, N_MANY);
        BENCH_STOP(BENCH_SOLVE_500);
        BENCH_START(BENCH_SOLVE_500_ROTATION);
        solve(&prior, N_MANY);
        BENCH_STOP(BENCH_SOLVE_500_ROTATION);
        make(N_FEW, false);
        BENCH_START(BENCH_SOLVE_100);
        solve(&plain, N_FEW);
        BENCH_STOP(BENCH_SOLVE_100);
        const evs_gyro_bias_pair_t pair = {.flow = flow,
                                           .n = N_FEW,
                                           .v_q30 = result.v_q30,
                                           .noise_q24 = result.noise_q24,
                                           .q_cr = evs_quat_identity(),
                                           .t_us = 50000u * ((uint32_t)i + 1u),
                                           .interval_us = 50000u};
        BENCH_START(BENCH_BIAS_100);
        evs_gyro_bias_learn(&bias, &pair);
        BENCH_STOP(BENCH_BIAS_100);
        make(N_MANY, true);
        BENCH_START(BENCH_SOLVE_500_PLANE);
        solve(&plain, N_MANY);
        BENCH_STOP(BENCH_SOLVE_500_PLANE);
    }
    return 0;
}
