/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * Contrast maximization with markers around it; bench_table.py makes docs/performance.md of the counts. A window of 16000
 * events over 240 x 180: 600 dots that move away from the centre by up to 7 px while it is open, and one event in five
 * of noise.
 */
#include "bench_markers.h"
#include "bench_regions.h"

#include "board.h"
#include "evs/warp.h"

enum { W = BENCH_IMAGE_WIDTH, H = BENCH_IMAGE_HEIGHT, N = BENCH_WARP_EVENTS, DOTS = 600 };

static evs_event_t events[N];
static evs_point_t points[N];
static evs_point_t dots[DOTS];
static uint16_t memory[EVS_WARP_BYTES(W, H, EVS_WARP_BUDGET_TILED, EVS_WARP_MAX_PX, 1u) / 2u];
static evs_warp_t warp;
static evs_flow_grid_t flow;

static uint32_t next_random(uint32_t below)
{
    static uint32_t state = 0x2545F491u;
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return (state >> 4) % below;
}

static evs_point_t random_point(void)
{
    const evs_point_t p = {(int16_t)next_random(16u * W - 16u), (int16_t)next_random(16u * H - 16u)};
    return p;
}

/* The pixel of a dot at time t of N, from -1/2 to 1/2 of its displacement of 1/16 of the way from the centre. */
static int16_t pixel_q4(int32_t at_q4, int32_t centre_q4, int32_t t, int32_t n_px)
{
    const int32_t moved_q4 = at_q4 + (at_q4 - centre_q4) * (2 * t - N) / (32 * N);
    return (int16_t)(evs_clamp((moved_q4 + 8) >> 4, 0, n_px - 1) * 16);
}

static void make_scene(void)
{
    for (int32_t i = 0; i < DOTS; i++) { dots[i] = random_point(); }
    for (int32_t i = 0; i < N; i++) {
        const evs_point_t at = (next_random(5u) == 0u) ? random_point() : dots[next_random(DOTS)];
        events[i] = evs_event_make((uint32_t)i, 0u, 0u, false);
        points[i].x_q4 = pixel_q4(at.x_q4, 8 * W, i, W);
        points[i].y_q4 = pixel_q4(at.y_q4, 8 * H, i, H);
    }
}

static bool set_up(evs_warp_kind_t kind, evs_warp_cost_t cost)
{
    evs_warp_config_t cfg = evs_warp_config_default(kind, W, H);
    cfg.cost = cost;
    return evs_warp_init(&warp, &cfg, memory, sizeof memory) == EVS_OK;
}

static bool run(void)
{
    evs_warp_result_t global, global_gradient, tiled, tiled_gradient;
    if (!set_up(EVS_WARP_GLOBAL, EVS_WARP_MEAN_SQUARE)) { return false; }
    BENCH_START(BENCH_WARP_GLOBAL);
    evs_warp_estimate(&warp, events, points, N, NULL, &flow, &global);
    BENCH_STOP(BENCH_WARP_GLOBAL);

    if (!set_up(EVS_WARP_GLOBAL, EVS_WARP_GRADIENT)) { return false; }
    BENCH_START(BENCH_WARP_GLOBAL_GRADIENT);
    evs_warp_estimate(&warp, events, points, N, NULL, &flow, &global_gradient);
    BENCH_STOP(BENCH_WARP_GLOBAL_GRADIENT);

    if (!set_up(EVS_WARP_TILED, EVS_WARP_GRADIENT)) { return false; }
    BENCH_START(BENCH_WARP_TILED_GRADIENT);
    evs_warp_estimate(&warp, events, points, N, NULL, &flow, &tiled_gradient);
    BENCH_STOP(BENCH_WARP_TILED_GRADIENT);

    if (!set_up(EVS_WARP_TILED, EVS_WARP_MEAN_SQUARE)) { return false; }
    BENCH_START(BENCH_WARP_TILED);
    evs_warp_estimate(&warp, events, points, N, NULL, &flow, &tiled);
    BENCH_STOP(BENCH_WARP_TILED);

    BENCH_START(BENCH_WARP_MAP);
    evs_warp_map(&flow, events, points, N, (uint32_t)N / 2u, points);
    BENCH_STOP(BENCH_WARP_MAP);
    /* The dots part from the centre: tiles must see it. */
    return (tiled.flags == 0u) && (tiled_gradient.flags == 0u) && (global.n_events == (N + 2) / 3) &&
           (global_gradient.n_events == (N + 2) / 3) && (tiled.n_events == N);
}

int main(void)
{
    make_scene();
    if (!run()) {
        board_puts("bench_warp: another answer than expected\n");
        return 1;
    }
    return 0;
}
