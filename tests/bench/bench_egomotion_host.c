/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* How long the direction of velocity takes on this computer: the median over many scenes. Run it by hand, in the release
 * preset, on an idle machine. */
#define _POSIX_C_SOURCE 200809L
#include "flow_scene.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { N_MAX = 500, N_SCENES = 4001 };

static evs_egomotion_flow_t flow[N_MAX];
static uint32_t scratch[EVS_EGOMOTION_BYTES(N_MAX) / 4u];
static double took_us[N_SCENES];

static double now_us(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e6 + (double)t.tv_nsec * 1e-3;
}

static int by_size(const void *a, const void *b)
{
    const double p = *(const double *)a;
    const double q = *(const double *)b;
    return (p > q) - (p < q);
}

static void measure(size_t n, double rotation_sigma_rad)
{
    const scene_settings_t s = scene_settings(0.5, 0.1);
    evs_egomotion_config_t cfg = evs_egomotion_config_default();
    cfg.rotation_sigma_rad_q28 = evs_q_from_double(rotation_sigma_rad, 28);
    for (int i = 0; i < N_SCENES; i++) {
        scene_truth_t truth = {{0, 0, 1}, {0, 0, 0}};
        evs_egomotion_result_t result;
        scene_direction(truth.v);
        scene_make(&s, &truth, flow, n);
        const double start_us = now_us();
        if (evs_egomotion_solve(&cfg, flow, n, scratch, sizeof scratch, &result) != EVS_OK) { exit(1); }
        took_us[i] = now_us() - start_us;
    }
    qsort(took_us, N_SCENES, sizeof took_us[0], by_size);
    (void)printf("%3u vectors%s: median %.1f us, fastest tenth below %.1f us\n", (unsigned)n,
                 (rotation_sigma_rad > 0.0) ? ", rotation under a prior" : "", took_us[N_SCENES / 2],
                 took_us[N_SCENES / 10]);
}

int main(void)
{
    measure(500, 0.0);
    measure(100, 0.0);
    measure(500, 0.001);
    return 0;
}
