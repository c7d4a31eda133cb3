/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* What bench_events.c and bench_attitude.c mark. bench_table.py reads the numbers from here: one "NAME = value" per line. */
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

#endif
