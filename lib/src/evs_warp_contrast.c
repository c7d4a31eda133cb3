/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_warp_private.h"

#include <string.h>

/* A vote is 256 in all, so that a cell holds 256 events at the same place; a hot pixel must not wrap it. */
static inline void add(uint16_t *cell, uint32_t vote)
{
    const uint32_t sum = *cell + vote;
    *cell = (uint16_t)((sum > UINT16_MAX) ? UINT16_MAX : sum);
}

void evs_warp_vote(const evs_warp_view_t *view, uint16_t *cells, const evs_warp_event_t *ev, size_t n, int32_t dx_q6,
                   int32_t dy_q6)
{
    const unsigned down = view->shift + 2u; /* from Q6 px to Q4 cells */
    const int32_t half = (int32_t)(UINT32_C(1) << (down - 1u));
    const int32_t x0_q6 = view->x_px * 64 - half;
    const int32_t y0_q6 = view->y_px * 64 - half;
    const uint32_t width = view->width;
    const uint32_t height = view->height;
    for (size_t i = 0u; i < n; i++) {
        const int32_t x_q4 = (ev[i].x_q4 * 4 - evs_shr_r(ev[i].dt_q15 * dx_q6, 15u) - x0_q6) >> down;
        const int32_t y_q4 = (ev[i].y_q4 * 4 - evs_shr_r(ev[i].dt_q15 * dy_q6, 15u) - y0_q6) >> down;
        const uint32_t x = (uint32_t)(x_q4 >> 4);
        const uint32_t y = (uint32_t)(y_q4 >> 4);
        if ((x >= width - 1u) || (y >= height - 1u)) { continue; }
        const uint32_t fx = (uint32_t)x_q4 & 15u;
        const uint32_t fy = (uint32_t)y_q4 & 15u;
        const uint32_t both = fx * fy;
        uint16_t *const cell = cells + y * width + x;
        add(cell, 256u - 16u * (fx + fy) + both);
        add(cell + 1, 16u * fx - both);
        add(cell + width, 16u * fy - both);
        add(cell + width + 1, both);
    }
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
