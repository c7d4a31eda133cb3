/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * Images of events on this machine: ns per event and us per image, the least of many rounds.
 * Run it by hand, in the release preset: bench_images_host [WIDTH HEIGHT]
 */
#include "bench_scene.h"

#include "evs/iwe.h"
#include "evs/surface.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { W_MAX = 1280, H_MAX = 960, N_EVENTS = 16384, ROUNDS = 200 };

static evs_event_t events[N_EVENTS];
static evs_point_t points[N_EVENTS];
static uint32_t iwe_memory[EVS_IWE_BYTES(W_MAX, H_MAX, EVS_IWE_GAUSSIAN) / 4u];
static uint16_t surface_memory[EVS_SURFACE_BYTES(W_MAX, H_MAX) / 2u];
static uint8_t plane[W_MAX * H_MAX];
static uint8_t half[W_MAX * H_MAX / 4];

static double now_ns(void)
{
    struct timespec t;
    (void)timespec_get(&t, TIME_UTC);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static void keep_least(double *least, double since_ns)
{
    const double ns = now_ns() - since_ns;
    if (ns < *least) { *least = ns; }
}

static void bench_iwe(const char *name, evs_iwe_vote_t vote, uint16_t width_px, uint16_t height_px)
{
    evs_iwe_config_t cfg = evs_iwe_config_default(width_px, height_px);
    evs_iwe_t iwe;
    double add = 1e18;
    double render = 1e18;
    cfg.vote = vote;
    cfg.smooth = vote != EVS_IWE_GAUSSIAN;
    if (evs_iwe_init(&iwe, &cfg, iwe_memory, sizeof iwe_memory) != EVS_OK) { exit(1); }
    for (int i = 0; i < ROUNDS; i++) {
        evs_iwe_clear(&iwe);
        double start = now_ns();
        evs_iwe_add(&iwe, points, N_EVENTS);
        keep_least(&add, start);
        start = now_ns();
        evs_iwe_render(&iwe, plane);
        keep_least(&render, start);
    }
    printf("%-20s %6.2f ns/event  %7.1f us/image\n", name, add / N_EVENTS, render / 1e3);
}

static void bench_surface(uint16_t width_px, uint16_t height_px)
{
    const evs_surface_config_t cfg = evs_surface_config_default(width_px, height_px);
    evs_surface_t surface;
    double add = 1e18;
    double render = 1e18;
    if (evs_surface_init(&surface, &cfg, surface_memory, sizeof surface_memory) != EVS_OK) { exit(1); }
    for (int i = 0; i < ROUNDS; i++) {
        scene_events(events, points, N_EVENTS, width_px, height_px, 2u);
        double start = now_ns();
        evs_surface_add(&surface, events, points, N_EVENTS);
        keep_least(&add, start);
        start = now_ns();
        evs_surface_render(&surface, events[N_EVENTS - 1].t_us, plane);
        keep_least(&render, start);
    }
    printf("%-20s %6.2f ns/event  %7.1f us/image\n", "time surface", add / N_EVENTS, render / 1e3);
}

int main(int argc, char **argv)
{
    const int width = (argc == 3) ? atoi(argv[1]) : 240;
    const int height = (argc == 3) ? atoi(argv[2]) : 180;
    if ((width < 1) || (width > W_MAX) || (height < 1) || (height > H_MAX)) { return 1; }
    const evs_image_t image = {plane, (uint16_t)width, (uint16_t)height};
    double halve = 1e18;

    scene_events(events, points, N_EVENTS, (uint32_t)width, (uint32_t)height, 2u);
    bench_iwe("IWE nearest", EVS_IWE_NEAREST, image.width_px, image.height_px);
    bench_iwe("IWE bilinear", EVS_IWE_BILINEAR, image.width_px, image.height_px);
    bench_iwe("IWE Gaussian", EVS_IWE_GAUSSIAN, image.width_px, image.height_px);
    bench_surface(image.width_px, image.height_px);
    for (int i = 0; i < ROUNDS; i++) {
        const double start = now_ns();
        evs_image_halve(&image, half);
        keep_least(&halve, start);
    }
    printf("%-20s %17s%7.1f us/image\n", "half the image", "", halve / 1e3);
    return 0;
}
