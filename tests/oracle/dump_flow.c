/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * usage: dump_flow corners WIDTH HEIGHT IMAGE CELL PERMILLE REPEAT
 *        dump_flow track WIDTH HEIGHT IMAGE IMAGE LEVELS WINDOW STRIDE ITERATIONS EPSILON BACKWARD REPEAT
 *
 * An IMAGE is a file of WIDTH * HEIGHT bytes. Prints one line
 *   corners   "x y score" per corner,
 *   track     "x y residual status" per line "from_x from_y to_x to_y" on standard input, positions in 1/256 px,
 * and, when REPEAT is not 0, repeats the work so often and prints "ns MEDIAN" on standard error: of evs_corners_find(), or
 * of making both pyramids and tracking all points.
 */
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "evs/corners.h"
#include "evs/flow.h"

enum { MOST = 20000, MOST_REPEATS = 1000 };

static evs_flow_track_t tracks[MOST], work[MOST];
static double times_ns[MOST_REPEATS];

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void print_median(int n)
{
    if (n == 0) { return; }
    qsort(times_ns, (size_t)n, sizeof times_ns[0], compare);
    fprintf(stderr, "ns %.0f\n", times_ns[n / 2]);
}

static bool read_image(evs_image_t *image, const char *path, int width, int height)
{
    const size_t n = (size_t)width * (size_t)height;
    uint8_t *const px = malloc(n);
    FILE *const f = fopen(path, "rb");
    const bool ok = (px != NULL) && (f != NULL) && (fread(px, 1, n, f) == n);
    if (f != NULL) { fclose(f); }
    if (!ok) {
        free(px);
        fprintf(stderr, "dump_flow: %s is no image of %d x %d\n", path, width, height);
        return false;
    }
    *image = (evs_image_t){px, (uint16_t)width, (uint16_t)height};
    return true;
}

static int print_corners(const evs_image_t *image, const int *number, int n_repeat)
{
    evs_corners_config_t cfg = evs_corners_config_default(image->width_px, image->height_px);
    cfg.cell_px = (uint16_t)number[0];
    cfg.min_permille = (uint16_t)number[1];
    const size_t n_bytes = EVS_CORNERS_BYTES(cfg.width_px, cfg.height_px, cfg.cell_px);
    const size_t most = EVS_CORNERS_CELLS(cfg.width_px, cfg.height_px, cfg.cell_px);
    void *const memory = malloc(n_bytes);
    evs_corner_t *const found = malloc(most * sizeof *found);
    evs_corners_t corners;
    const bool ok =
        (memory != NULL) && (found != NULL) && (evs_corners_init(&corners, &cfg, memory, n_bytes) == EVS_OK);
    if (ok) {
        size_t n = evs_corners_find(&corners, image, found, most);
        for (size_t i = 0; i < n; i++) {
            printf("%u %u %lu\n", found[i].x_px, found[i].y_px, (unsigned long)found[i].score);
        }
        for (int i = 0; i < n_repeat; i++) {
            const double start = now_ns();
            n = evs_corners_find(&corners, image, found, most);
            times_ns[i] = now_ns() - start;
        }
        print_median(n_repeat);
    } else {
        fputs("dump_flow: refused\n", stderr);
    }
    free(memory);
    free(found);
    return ok ? 0 : 1;
}

static bool track_once(evs_flow_t *flow, const evs_image_t *images, uint16_t n_levels, uint8_t *const *levels,
                       size_t n_bytes, size_t n)
{
    evs_pyramid_t pyramid[2];
    memcpy(work, tracks, n * sizeof tracks[0]);
    for (size_t i = 0; i < 2u; i++) {
        if (evs_pyramid_build(&pyramid[i], &images[i], n_levels, levels[i], n_bytes) != EVS_OK) { return false; }
    }
    evs_flow_track(flow, &pyramid[0], &pyramid[1], work, n);
    return true;
}

static int print_tracks(const evs_image_t *images, const int *number, int n_repeat)
{
    evs_flow_config_t cfg = evs_flow_config_default();
    cfg.window_px = (uint16_t)number[1];
    cfg.stride_px = (uint16_t)number[2];
    cfg.n_iterations = (uint16_t)number[3];
    cfg.epsilon_q8 = (uint16_t)number[4];
    cfg.max_backward_q8 = (uint16_t)number[5];
    size_t n = 0;
    long x0, y0, x1, y1;
    while ((n < MOST) && (scanf("%ld %ld %ld %ld", &x0, &y0, &x1, &y1) == 4)) {
        tracks[n++] = (evs_flow_track_t){.from = {(int32_t)x0, (int32_t)y0}, .to = {(int32_t)x1, (int32_t)y1}};
    }
    static uint32_t memory[EVS_FLOW_BYTES(31, 1) / 4u + 1u];
    const size_t n_bytes = EVS_PYRAMID_BYTES(images[0].width_px, images[0].height_px, EVS_FLOW_LEVELS_MAX);
    uint8_t *const levels[2] = {malloc(n_bytes), malloc(n_bytes)};
    const uint16_t n_levels = (uint16_t)number[0];
    evs_flow_t flow;
    const bool ok = (levels[0] != NULL) && (levels[1] != NULL) &&
                    (evs_flow_init(&flow, &cfg, memory, sizeof memory) == EVS_OK) &&
                    track_once(&flow, images, n_levels, levels, n_bytes, n);
    if (ok) {
        for (size_t i = 0; i < n; i++) {
            printf("%ld %ld %u %u\n", (long)work[i].to.x_q8, (long)work[i].to.y_q8, work[i].residual_q8,
                   work[i].status);
        }
        for (int i = 0; i < n_repeat; i++) {
            const double start = now_ns();
            (void)track_once(&flow, images, n_levels, levels, n_bytes, n);
            times_ns[i] = now_ns() - start;
        }
        print_median(n_repeat);
    } else {
        fputs("dump_flow: refused\n", stderr);
    }
    free(levels[0]);
    free(levels[1]);
    return ok ? 0 : 1;
}

int main(int argc, char **argv)
{
    const bool corners = (argc == 8) && (strcmp(argv[1], "corners") == 0);
    const bool track = (argc == 13) && (strcmp(argv[1], "track") == 0);
    if (!corners && !track) {
        fputs(
            "usage: dump_flow corners WIDTH HEIGHT IMAGE CELL PERMILLE REPEAT\n"
            "       dump_flow track WIDTH HEIGHT IMAGE IMAGE LEVELS WINDOW STRIDE ITERATIONS EPSILON BACKWARD REPEAT\n",
            stderr);
        return 2;
    }
    const int width = atoi(argv[2]);
    const int height = atoi(argv[3]);
    const int n_repeat = atoi(argv[argc - 1]);
    if ((width < 1) || (width > 2048) || (height < 1) || (height > 2048) || (n_repeat < 0) ||
        (n_repeat > MOST_REPEATS)) {
        fputs("dump_flow: a number is out of range\n", stderr);
        return 2;
    }
    const int n_images = track ? 2 : 1;
    int number[7];
    for (int i = 4 + n_images; i < argc - 1; i++) { number[i - 4 - n_images] = atoi(argv[i]); }
    evs_image_t images[2] = {{NULL, 0, 0}, {NULL, 0, 0}};
    int status = 1;
    if (read_image(&images[0], argv[4], width, height) && (!track || read_image(&images[1], argv[5], width, height))) {
        status = track ? print_tracks(images, number, n_repeat) : print_corners(images, number, n_repeat);
    }
    for (int i = 0; i < 2; i++) { free((void *)(uintptr_t)images[i].px); }
    return status;
}
