/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * Images of events, with markers around each step; bench_table.py makes docs/performance.md of the counts. A window of
 * 12288 events over 240 x 180, which is the default area window on a textured scene, at half a million events a second.
 */
#include "bench_markers.h"
#include "bench_regions.h"
#include "bench_scene.h"

#include "board.h"
#include "evs/iwe.h"
#include "evs/surface.h"

enum { W = BENCH_IMAGE_WIDTH, H = BENCH_IMAGE_HEIGHT };

static evs_event_t events[BENCH_EVENTS];
static evs_point_t points[BENCH_EVENTS];

static evs_iwe_t nearest, bilinear, gaussian;
static uint32_t nearest_memory[EVS_IWE_BYTES(W, H, EVS_IWE_NEAREST) / 4u];
static uint32_t bilinear_memory[EVS_IWE_BYTES(W, H, EVS_IWE_BILINEAR) / 4u];
static uint32_t gaussian_memory[EVS_IWE_BYTES(W, H, EVS_IWE_GAUSSIAN) / 4u];
static evs_surface_t surface;
static uint16_t surface_memory[EVS_SURFACE_BYTES(W, H) / 2u];
static uint8_t plane[W * H];
static uint8_t half[EVS_IMAGE_HALF(W) * EVS_IMAGE_HALF(H)];

static bool set_up(evs_iwe_t *iwe, evs_iwe_vote_t vote, void *memory, size_t n_bytes)
{
    evs_iwe_config_t cfg = evs_iwe_config_default(W, H);
    cfg.vote = vote;
    cfg.smooth = vote != EVS_IWE_GAUSSIAN;
    return evs_iwe_init(iwe, &cfg, memory, n_bytes) == EVS_OK;
}

static void run_batch(void)
{
    scene_events(events, points, BENCH_EVENTS, W, H, 2u);
    BENCH_START(BENCH_IWE_NEAREST);
    evs_iwe_add(&nearest, points, BENCH_EVENTS);
    BENCH_STOP(BENCH_IWE_NEAREST);

    BENCH_START(BENCH_IWE_BILINEAR);
    evs_iwe_add(&bilinear, points, BENCH_EVENTS);
    BENCH_STOP(BENCH_IWE_BILINEAR);

    BENCH_START(BENCH_IWE_GAUSSIAN);
    evs_iwe_add(&gaussian, points, BENCH_EVENTS);
    BENCH_STOP(BENCH_IWE_GAUSSIAN);

    BENCH_START(BENCH_SURFACE);
    evs_surface_add(&surface, events, points, BENCH_EVENTS);
    BENCH_STOP(BENCH_SURFACE);
}

static void run_image(void)
{
    const evs_image_t image = {plane, W, H};

    BENCH_START(BENCH_RENDER_BILINEAR);
    evs_iwe_render(&bilinear, plane);
    BENCH_STOP(BENCH_RENDER_BILINEAR);

    BENCH_START(BENCH_RENDER_GAUSSIAN);
    evs_iwe_render(&gaussian, plane);
    BENCH_STOP(BENCH_RENDER_GAUSSIAN);

    BENCH_START(BENCH_RENDER_SURFACE);
    evs_surface_render(&surface, events[BENCH_EVENTS - 1].t_us, plane);
    BENCH_STOP(BENCH_RENDER_SURFACE);

    BENCH_START(BENCH_RENDER_NEAREST);
    evs_iwe_render(&nearest, plane);
    BENCH_STOP(BENCH_RENDER_NEAREST);

    BENCH_START(BENCH_HALVE);
    evs_image_halve(&image, half);
    BENCH_STOP(BENCH_HALVE);

    evs_iwe_clear(&nearest);
    evs_iwe_clear(&bilinear);
    evs_iwe_clear(&gaussian);
}

int main(void)
{
    const evs_surface_config_t cfg = evs_surface_config_default(W, H);
    if (!set_up(&nearest, EVS_IWE_NEAREST, nearest_memory, sizeof nearest_memory) ||
        !set_up(&bilinear, EVS_IWE_BILINEAR, bilinear_memory, sizeof bilinear_memory) ||
        !set_up(&gaussian, EVS_IWE_GAUSSIAN, gaussian_memory, sizeof gaussian_memory) ||
        (evs_surface_init(&surface, &cfg, surface_memory, sizeof surface_memory) != EVS_OK)) {
        board_puts("bench_images: set-up refused\n");
        return 1;
    }
    for (int i = 0; i < BENCH_IMAGES; i++) {
        for (int k = 0; k < BENCH_IMAGE_BATCHES; k++) { run_batch(); }
        run_image();
    }
    return 0;
}
