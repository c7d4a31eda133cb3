/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* What the bench programs mark. bench_table.py reads the numbers from here: one "NAME = value" per line. */
#ifndef EVS_BENCH_REGIONS_H
#define EVS_BENCH_REGIONS_H

enum {
    BENCH_EVENTS = 256, /* per batch */
    BENCH_BATCHES = 16
};

enum {
    BENCH_LOOKUP_FULL = 0,
    BENCH_LOOKUP_FULL_TILES = 1,
    BENCH_LOOKUP_GRID = 2,
    BENCH_LOOKUP_GRID_TILES = 3,
    BENCH_WINDOW = 4,
    BENCH_ROTATE = 5,
    BENCH_SLICE = 6,
    BENCH_PIPELINE = 7
};

/* bench_attitude.c */
enum { BENCH_UPDATES = 1000 };

enum {
    BENCH_GYRO = 0,
    BENCH_ACCEL = 1,
    BENCH_MAG = 2,
    BENCH_UPDATE_6D = 3,
    BENCH_UPDATE_9D = 4,
    BENCH_REST_6D = 5,
    BENCH_REST_9D = 6
};

/* bench_images.c */
enum {
    BENCH_IMAGE_WIDTH = 240,
    BENCH_IMAGE_HEIGHT = 180,
    BENCH_IMAGES = 3,
    BENCH_IMAGE_BATCHES = 48 /* of events, per image */
};

enum {
    BENCH_IWE_NEAREST = 0,
    BENCH_IWE_BILINEAR = 1,
    BENCH_IWE_GAUSSIAN = 2,
    BENCH_SURFACE = 3,
    BENCH_RENDER_NEAREST = 4,
    BENCH_RENDER_BILINEAR = 5,
    BENCH_RENDER_GAUSSIAN = 6,
    BENCH_RENDER_SURFACE = 7,
    BENCH_HALVE = 8
};

/* bench_flow.c */
enum { BENCH_TRACKS = 128 };

enum {
    BENCH_CORNERS = 0,
    BENCH_TRACK_ALL = 1,
    BENCH_IMAGE_PAIR = 2,
};

/* bench_velocity.c */
enum { BENCH_DIRECTION_TRACKS = 180 };

enum {
    BENCH_DIRECTION = 0,
    BENCH_TURN = 1,
};

/* bench_egomotion.c */
enum { BENCH_SOLVES = 8 };

enum {
    BENCH_SOLVE_500 = 0,
    BENCH_SOLVE_500_ROTATION = 1,
    BENCH_SOLVE_100 = 2,
    BENCH_SOLVE_500_PLANE = 3,
    BENCH_BIAS_100 = 4,
};

/* bench_warp.c */
enum { BENCH_WARP_EVENTS = 16000 };

enum {
    BENCH_WARP_GLOBAL = 0,
    BENCH_WARP_GLOBAL_GRADIENT = 1,
    BENCH_WARP_TILED = 2,
    BENCH_WARP_TILED_GRADIENT = 3,
    BENCH_WARP_MAP = 4
};

#endif
