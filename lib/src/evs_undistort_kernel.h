/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Full tables by vector instructions. Private. */
#ifndef EVS_UNDISTORT_KERNEL_H
#define EVS_UNDISTORT_KERNEL_H

#include "evs/undistort.h"
#include "evs_simd.h"

/*
 * What evs_undistort_map() and, with tiles, evs_undistort_map_tiles() do with a table of step 1 (and a tile table),
 * eight events at a time: Helium, SSE2. Returns how many it mapped: all but the last few.
 */
size_t evs_undistort_map_mve(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points, uint16_t *tiles);
size_t evs_undistort_map_sse2(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points,
                              uint16_t *tiles);

/* The plain C for these, any number of them. `tiles` may be NULL. */
void evs_undistort_map_plain(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points, uint16_t *tiles);

#endif
