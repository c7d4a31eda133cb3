/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The contrast of warped events: what the search of evs_warp.c evaluates again and again. */
#ifndef EVS_WARP_PRIVATE_H
#define EVS_WARP_PRIVATE_H

#include "evs/warp.h"

typedef struct { /* A part of the image, in cells of 2^shift px. */
    uint32_t width;
    uint32_t height;
    unsigned shift;
    int32_t x_px; /* centre of the first cell's first pixel */
    int32_t y_px;
} evs_warp_view_t;

/* Vote for every stride-th of n events, moved by -dt * d, where they fall into the view. cells: width * height. Returns
 * false when a cell has wrapped: then clear them and vote with a limit. */
bool evs_warp_vote(const evs_warp_view_t *view, uint16_t *cells, const evs_warp_event_t *ev, size_t n, uint32_t stride,
                   int32_t dx_q6, int32_t dy_q6);

/* The same, each cell limited to 65535. */
void evs_warp_vote_limited(const evs_warp_view_t *view, uint16_t *cells, const evs_warp_event_t *ev, size_t n,
                           uint32_t stride, int32_t dx_q6, int32_t dy_q6);

/* Contrast of the smoothed image. The row behind the image must be zero; GRADIENT smooths in place and uses the row
 * after that as scratch. */
uint64_t evs_warp_contrast(const evs_warp_view_t *view, uint16_t *cells, evs_warp_cost_t cost);

#endif
