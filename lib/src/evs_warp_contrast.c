/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_warp_private.h"

#include <string.h>

/* Votes on one cell, if they fit. */
static inline uint32_t add(uint16_t *cell, uint32_t vote, uint32_t most)
{
    const uint32_t sum = *cell + vote;
    *cell = (uint16_t)((sum > most) ? most : sum);
    return sum;
}

/*
 * A vote is 256 in all, so that a cell holds 255 events at the same place: a hot pixel would wrap it. That is rare, and a
 * limit for every vote is a sixth of the work. So votes are first added without (most = UINT32_MAX), and the result
 * tells whether some cell has wrapped.
 *
 * A position is below 2^12 px, a displacement below 2^5; in Q18 both together fit 32 bits.
 */
static inline bool vote_all(const evs_warp_view_t *view, uint16_t *cells, const evs_warp_event_t *ev,
                            const evs_warp_event_t *end, uint32_t stride, int32_t dx_q6, int32_t dy_q6, uint32_t most)
{
    const unsigned down = 14u + view->shift; /* from Q18 px to Q4 cells, rounded */
    const int32_t half = (int32_t)(UINT32_C(1) << (down - 1u));
    const int32_t x0_q18 = half - view->x_px * (1 << 18);
    const int32_t y0_q18 = half - view->y_px * (1 << 18);
    const uint32_t width = view->width;
    const uint32_t last_x = view->width - 1u;
    const uint32_t last_y = view->height - 1u;
    uint32_t sums = 0u;
    for (; ev < end; ev += stride) {
        const int32_t x_q4 = (x0_q18 + ev->x_q4 * (1 << 14) - ev->dt_q12 * dx_q6) >> down;
        const int32_t y_q4 = (y0_q18 + ev->y_q4 * (1 << 14) - ev->dt_q12 * dy_q6) >> down;
        const uint32_t x = (uint32_t)(x_q4 >> 4);
        const uint32_t y = (uint32_t)(y_q4 >> 4);
        if ((x >= last_x) || (y >= last_y)) { continue; }
        const uint32_t fx = (uint32_t)x_q4 & 15u;
        const uint32_t fy = (uint32_t)y_q4 & 15u;
        const uint32_t both = fx * fy;
        uint16_t *const cell = cells + y * width + x;
        uint16_t *const below = cell + width;
        sums |= add(cell, 256u - 16u * (fx + fy) + both, most);
        sums |= add(cell + 1, 16u * fx - both, most);
        sums |= add(below, 16u * fy - both, most);
        sums |= add(below + 1, both, most);
    }
    return sums <= UINT16_MAX;
}

bool evs_warp_vote(const evs_warp_view_t *view, uint16_t *cells, const evs_warp_event_t *ev, size_t n, uint32_t stride,
                   int32_t dx_q6, int32_t dy_q6)
{
    return vote_all(view, cells, ev, ev + n, stride, dx_q6, dy_q6, UINT32_MAX);
}

void evs_warp_vote_limited(const evs_warp_view_t *view, uint16_t *cells, const evs_warp_event_t *ev, size_t n,
                           uint32_t stride, int32_t dx_q6, int32_t dy_q6)
{
    (void)vote_all(view, cells, ev, ev + n, stride, dx_q6, dy_q6, UINT16_MAX);
}

/* 1 2 1 down a column of three rows. */
static inline uint32_t column(const uint16_t *above, const uint16_t *row, const uint16_t *below, uint32_t x)
{
    return (uint32_t)above[x] + 2u * row[x] + below[x];
}

/* 1 2 1 across three columns; the weights add up to 16. */
static inline uint32_t across(uint32_t left, uint32_t middle, uint32_t right)
{
    return (left + 2u * middle + right + 8u) >> 4;
}

/* Sum of squares of the smoothed image, which is not stored. Beyond the image there is nothing. */
static uint64_t sum_of_squares(const evs_warp_view_t *view, const uint16_t *cells)
{
    const uint32_t width = view->width;
    const uint16_t *const zero = cells + width * view->height;
    const uint16_t *above = zero;
    uint64_t sum = 0u;
    for (uint32_t y = 0u; y < view->height; y++) {
        const uint16_t *const row = cells + y * width;
        const uint16_t *const below = row + width;
        uint32_t left = 0u;
        uint32_t middle = column(above, row, below, 0u);
        for (uint32_t x = 1u; x < width; x++) {
            const uint32_t right = column(above, row, below, x);
            const uint32_t v = across(left, middle, right);
            sum += (uint64_t)v * v;
            left = middle;
            middle = right;
        }
        const uint32_t v = across(left, middle, 0u);
        sum += (uint64_t)v * v;
        above = row;
    }
    return sum;
}

/* Smooth in place. Each row is needed once more after it has been written, as the row above: it is kept in a copy. */
static void smooth(const evs_warp_view_t *view, uint16_t *cells)
{
    const uint32_t width = view->width;
    uint16_t *const above = cells + width * (view->height + 1u);
    memset(above, 0, width * sizeof above[0]);
    for (uint32_t y = 0u; y < view->height; y++) {
        uint16_t *const row = cells + y * width;
        const uint16_t *const below = row + width;
        uint32_t left = 0u;
        uint32_t middle = column(above, row, below, 0u);
        for (uint32_t x = 1u; x < width; x++) {
            const uint32_t right = column(above, row, below, x);
            above[x - 1u] = row[x - 1u];
            row[x - 1u] = (uint16_t)across(left, middle, right);
            left = middle;
            middle = right;
        }
        above[width - 1u] = row[width - 1u];
        row[width - 1u] = (uint16_t)across(left, middle, 0u);
    }
}

/* Sum of the squared Sobel gradient, without the border. */
static uint64_t sum_of_gradients(const evs_warp_view_t *view, const uint16_t *cells)
{
    const uint32_t width = view->width;
    uint64_t sum = 0u;
    for (uint32_t y = 1u; y + 1u < view->height; y++) {
        const uint16_t *const row = cells + y * width;
        const uint16_t *const above = row - width;
        const uint16_t *const below = row + width;
        for (uint32_t x = 1u; x + 1u < width; x++) {
            const int32_t falling = below[x + 1u] - above[x - 1u]; /* both diagonals serve both components */
            const int32_t rising = above[x + 1u] - below[x - 1u];
            const int64_t gx = falling + rising + 2 * ((int32_t)row[x + 1u] - row[x - 1u]);
            const int64_t gy = falling - rising + 2 * ((int32_t)below[x] - above[x]);
            sum += (uint64_t)(gx * gx) + (uint64_t)(gy * gy);
        }
    }
    return sum;
}

uint64_t evs_warp_contrast(const evs_warp_view_t *view, uint16_t *cells, evs_warp_cost_t cost)
{
    if (cost == EVS_WARP_MEAN_SQUARE) { return sum_of_squares(view, cells); }
    smooth(view, cells);
    return sum_of_gradients(view, cells);
}
