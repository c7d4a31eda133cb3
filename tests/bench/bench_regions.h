/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* What bench_events.c marks. bench_table.py reads the numbers from here: one "NAME = value" per line. */
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
    BENCH_SLICE = 6
};

#endif
