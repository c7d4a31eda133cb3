/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/flow_grid.h"

/* Samples that a median looks at: more would not make it better. */
#define MEDIAN_MAX 32u

/* The normalized median test: a residual of more than twice the neighbours' own spread is an outlier. The spread has a
 * floor, the noise of tracking: 0.5 px over 30 ms. */
#define OUTLIER_FACTOR   2
#define OUTLIER_FLOOR_Q3 (16 * 8)

/* This many samples that agree with their median, within twice the noise, need no confirmation by the neighbours. */
#define AGREE_MIN          3u
#define AGREE_TOLERANCE_Q3 (OUTLIER_FACTOR * OUTLIER_FLOOR_Q3)

typedef struct { /* Values being sorted as they come. */
    int16_t sorted[MEDIAN_MAX];
    uint32_t n;
} median_t;

EVS_STATIC_ASSERT(EVS_FLOW_GRID_TILES_MAX <= 64u, "a set of tiles is a uint64_t");
EVS_STATIC_ASSERT(((uint64_t)EVS_FLOW_GRID_TILES_MAX << EVS_FLOW_GRID_RCP_BITS) + 16u * EVS_SENSOR_MAX_PX <= UINT32_MAX,
                  "a position times the reciprocal does not fit 32 bits");

/* Tiles per 1/16 px. Rounded up, so that a border between tiles that lies on 1/16 px belongs to the tile after it. */
static uint32_t reciprocal_q25(uint32_t n_px, uint32_t n_tiles)
{
    return ((n_tiles << EVS_FLOW_GRID_RCP_BITS) + 16u * n_px - 1u) / (16u * n_px);
}

evs_status_t evs_flow_grid_init(evs_flow_grid_t *grid, uint16_t width_px, uint16_t height_px, uint16_t n_cols,
                                uint16_t n_rows)
{
    if (grid == NULL) { return EVS_ERR_NULL; }
    if ((width_px > EVS_SENSOR_MAX_PX) || (height_px > EVS_SENSOR_MAX_PX)) { return EVS_ERR_ARG; }
    if ((n_cols < 1u) || (n_cols > width_px) || (n_rows < 1u) || (n_rows > height_px)) { return EVS_ERR_ARG; }
    if ((uint32_t)n_cols * n_rows > EVS_FLOW_GRID_TILES_MAX) { return EVS_ERR_ARG; }

    *grid = (evs_flow_grid_t){
        .width_px = width_px,
        .height_px = height_px,
        .n_cols = (uint8_t)n_cols,
        .n_rows = (uint8_t)n_rows,
        .rcp_x_q25 = reciprocal_q25(width_px, n_cols),
        .rcp_y_q25 = reciprocal_q25(height_px, n_rows),
    };
    return EVS_OK;
}

static uint32_t tile_count(const evs_flow_grid_t *grid) { return (uint32_t)grid->n_cols * grid->n_rows; }

void evs_flow_grid_set_all(evs_flow_grid_t *grid, evs_flow_velocity_t v)
{
    EVS_ASSERT(grid != NULL);
    for (uint32_t i = 0u; i < tile_count(grid); i++) { grid->tiles[i] = v; }
    grid->global = v;
    grid->n_measured = 0u;
}

void evs_flow_grid_clear(evs_flow_grid_t *grid)
{
    const evs_flow_velocity_t zero = {0, 0};
    evs_flow_grid_set_all(grid, zero);
}

void evs_flow_grid_set_tile(evs_flow_grid_t *grid, uint16_t col, uint16_t row, evs_flow_velocity_t v)
{
    EVS_ASSERT((grid != NULL) && (col < grid->n_cols) && (row < grid->n_rows));
    grid->tiles[(uint32_t)row * grid->n_cols + col] = v;
}

uint32_t evs_flow_grid_tile_of(const evs_flow_grid_t *grid, evs_point_t p)
{
    EVS_ASSERT(grid != NULL);
    const int32_t x_q4 = p.x_q4 + 8;
    const int32_t y_q4 = p.y_q4 + 8;
    if ((x_q4 < 0) || (x_q4 >= (int32_t)(16u * (uint32_t)grid->width_px)) || (y_q4 < 0) ||
        (y_q4 >= (int32_t)(16u * (uint32_t)grid->height_px))) {
        return EVS_FLOW_GRID_TILES_MAX;
    }
    uint32_t col = ((uint32_t)x_q4 * grid->rcp_x_q25) >> EVS_FLOW_GRID_RCP_BITS;
    uint32_t row = ((uint32_t)y_q4 * grid->rcp_y_q25) >> EVS_FLOW_GRID_RCP_BITS;
    if (col >= grid->n_cols) { col = grid->n_cols - 1u; } /* the reciprocal is rounded up */
    if (row >= grid->n_rows) { row = grid->n_rows - 1u; }
    return row * grid->n_cols + col;
}

/* The centre of tile k along an axis, Q4 px from the centre of the first pixel. */
static int16_t centre_q4(uint32_t k, uint32_t n_px, uint32_t n_tiles)
{
    return (int16_t)((int32_t)((2u * k + 1u) * 8u * n_px / n_tiles) - 8);
}

evs_point_t evs_flow_grid_centre(const evs_flow_grid_t *grid, uint16_t col, uint16_t row)
{
    EVS_ASSERT((grid != NULL) && (col < grid->n_cols) && (row < grid->n_rows));
    const evs_point_t p = {centre_q4(col, grid->width_px, grid->n_cols), centre_q4(row, grid->height_px, grid->n_rows)};
    return p;
}

/* --- medians --------------------------------------------------------------------------------------------------- */

static void median_add(median_t *m, int16_t value)
{
    uint32_t i = m->n++;
    while ((i > 0u) && (m->sorted[i - 1u] > value)) {
        m->sorted[i] = m->sorted[i - 1u];
        i--;
    }
    m->sorted[i] = value;
}

/* The mean of the middle two when their number is even. */
static int16_t median_get(const median_t *m)
{
    return (int16_t)evs_shr_r((int32_t)m->sorted[(m->n - 1u) / 2u] + m->sorted[m->n / 2u], 1u);
}

static uint32_t median_agree(const median_t *m)
{
    const int32_t middle = median_get(m);
    uint32_t n = 0u;
    for (uint32_t i = 0u; i < m->n; i++) { n += (evs_abs_u32(m->sorted[i] - middle) <= AGREE_TOLERANCE_Q3) ? 1u : 0u; }
    return n;
}

/* --- samples into tiles ---------------------------------------------------------------------------------------- */

/* Median of the samples of one tile, or of all on the image (tile = EVS_FLOW_GRID_TILES_MAX). n_in of them are there.
 * Returns whether enough of them agree with it. */
static bool median_of_samples(const evs_flow_grid_t *grid, const evs_flow_sample_t *samples, size_t n, uint32_t tile,
                              size_t n_in, evs_flow_velocity_t *v)
{
    const size_t stride = (n_in + MEDIAN_MAX - 1u) / MEDIAN_MAX;
    size_t wait = 0u;
    median_t x = {.n = 0u};
    median_t y = {.n = 0u};
    for (size_t i = 0u; i < n; i++) {
        const uint32_t of = evs_flow_grid_tile_of(grid, samples[i].at);
        if ((of == EVS_FLOW_GRID_TILES_MAX) || ((tile != EVS_FLOW_GRID_TILES_MAX) && (of != tile))) { continue; }
        if (wait == 0u) {
            median_add(&x, samples[i].v.x_px_s_q3);
            median_add(&y, samples[i].v.y_px_s_q3);
            wait = stride;
        }
        wait--;
    }
    v->x_px_s_q3 = median_get(&x);
    v->y_px_s_q3 = median_get(&y);
    return (median_agree(&x) >= AGREE_MIN) && (median_agree(&y) >= AGREE_MIN);
}

/* --- tiles from their neighbours ------------------------------------------------------------------------------- */

static bool has(uint64_t set, uint32_t tile) { return ((set >> tile) & 1u) != 0u; }

/* The tiles of a set next to a tile: up to 8, or the 4 that share a side. */
static uint32_t neighbours(const evs_flow_grid_t *grid, uint64_t set, uint32_t tile, bool corners, uint8_t *found)
{
    const int32_t col = (int32_t)(tile % grid->n_cols);
    const int32_t row = (int32_t)(tile / grid->n_cols);
    uint32_t n = 0u;
    for (int32_t r = row - 1; r <= row + 1; r++) {
        for (int32_t c = col - 1; c <= col + 1; c++) {
            const bool corner = (r != row) && (c != col);
            if ((r < 0) || (r >= grid->n_rows) || (c < 0) || (c >= grid->n_cols) || (corner && !corners)) { continue; }
            const uint32_t other = (uint32_t)r * grid->n_cols + (uint32_t)c;
            if ((other != tile) && has(set, other)) { found[n++] = (uint8_t)other; }
        }
    }
    return n;
}

/* The normalized median test on one component. */
static bool is_outlier(int16_t value, const median_t *around)
{
    const int32_t middle = median_get(around);
    median_t deviation = {.n = 0u};
    for (uint32_t i = 0u; i < around->n; i++) {
        const int32_t off = around->sorted[i] - middle;
        median_add(&deviation, evs_sat16((off < 0) ? -off : off));
    }
    const int32_t residual = (value < middle) ? middle - value : value - middle;
    return residual > OUTLIER_FACTOR * (median_get(&deviation) + OUTLIER_FLOOR_Q3);
}

/* Whether a tile disagrees with its measured neighbours. Fewer than three of them cannot tell. */
static bool disagrees(const evs_flow_grid_t *grid, uint64_t measured, uint32_t tile)
{
    uint8_t around[8];
    const uint32_t n = neighbours(grid, measured, tile, true, around);
    if (n < 3u) { return false; }
    median_t x = {.n = 0u};
    median_t y = {.n = 0u};
    for (uint32_t i = 0u; i < n; i++) {
        median_add(&x, grid->tiles[around[i]].x_px_s_q3);
        median_add(&y, grid->tiles[around[i]].y_px_s_q3);
    }
    return is_outlier(grid->tiles[tile].x_px_s_q3, &x) || is_outlier(grid->tiles[tile].y_px_s_q3, &y);
}

/* sum / n rounded, for n values of 16 bits: division of a number made positive. */
static int16_t mean(int32_t sum, uint32_t n)
{
    return (int16_t)((int32_t)(((uint32_t)(sum + 32768 * (int32_t)n) + n / 2u) / n) - 32768);
}

/* Give every tile a velocity: those at the border of the known ones take the mean of these, until none is left. The
 * tiles of one ring see the known ones of the ring before, so that the order within it does not matter. */
static void spread(evs_flow_grid_t *grid, uint64_t known)
{
    const uint32_t n_tiles = tile_count(grid);
    uint64_t before = 0u;
    while (known != before) {
        before = known;
        for (uint32_t tile = 0u; tile < n_tiles; tile++) {
            if (has(before, tile)) { continue; }
            uint8_t around[8];
            const uint32_t n = neighbours(grid, before, tile, false, around);
            if (n == 0u) { continue; }
            int32_t sum_x = 0;
            int32_t sum_y = 0;
            for (uint32_t i = 0u; i < n; i++) {
                sum_x += grid->tiles[around[i]].x_px_s_q3;
                sum_y += grid->tiles[around[i]].y_px_s_q3;
            }
            grid->tiles[tile].x_px_s_q3 = mean(sum_x, n);
            grid->tiles[tile].y_px_s_q3 = mean(sum_y, n);
            known |= UINT64_C(1) << tile;
        }
    }
}

size_t evs_flow_grid_fill(evs_flow_grid_t *grid, const evs_flow_sample_t *samples, size_t n)
{
    EVS_ASSERT((grid != NULL) && ((samples != NULL) || (n == 0u)) && (n <= UINT16_MAX));
    const uint32_t n_tiles = tile_count(grid);
    uint16_t n_in[EVS_FLOW_GRID_TILES_MAX + 1u] = {0};
    for (size_t i = 0u; i < n; i++) { n_in[evs_flow_grid_tile_of(grid, samples[i].at)]++; }
    const size_t n_on = n - n_in[EVS_FLOW_GRID_TILES_MAX];
    if (n_on == 0u) { return 0u; }

    uint64_t measured = 0u;
    uint64_t sure = 0u;
    for (uint32_t tile = 0u; tile < n_tiles; tile++) {
        if (n_in[tile] == 0u) { continue; }
        const bool agree = median_of_samples(grid, samples, n, tile, n_in[tile], &grid->tiles[tile]);
        measured |= UINT64_C(1) << tile;
        if (agree) { sure |= UINT64_C(1) << tile; }
    }
    (void)median_of_samples(grid, samples, n, EVS_FLOW_GRID_TILES_MAX, n_on, &grid->global);

    uint64_t kept = measured;
    grid->n_measured = 0u;
    for (uint32_t tile = 0u; tile < n_tiles; tile++) {
        if (!has(measured, tile)) { continue; }
        if (!has(sure, tile) && disagrees(grid, measured, tile)) {
            kept &= ~(UINT64_C(1) << tile);
        } else {
            grid->n_measured++;
        }
    }
    if (kept != 0u) {
        spread(grid, kept);
    } else { /* they all contradict one another */
        evs_flow_grid_set_all(grid, grid->global);
    }
    return n_on;
}

/* --- arithmetic ------------------------------------------------------------------------------------------------ */

static int16_t blend(int16_t from, int16_t to, int32_t weight_q8)
{
    return (int16_t)(from + evs_shr_r((to - from) * weight_q8, 8u));
}

static evs_flow_velocity_t blend_both(evs_flow_velocity_t from, evs_flow_velocity_t to, int32_t weight_q8)
{
    const evs_flow_velocity_t v = {blend(from.x_px_s_q3, to.x_px_s_q3, weight_q8),
                                   blend(from.y_px_s_q3, to.y_px_s_q3, weight_q8)};
    return v;
}

void evs_flow_grid_blend(evs_flow_grid_t *grid, const evs_flow_grid_t *other, uint16_t weight_q8)
{
    EVS_ASSERT((grid != NULL) && (other != NULL) && (weight_q8 <= 256u));
    EVS_ASSERT((grid->n_cols == other->n_cols) && (grid->n_rows == other->n_rows));
    for (uint32_t i = 0u; i < tile_count(grid); i++) {
        grid->tiles[i] = blend_both(grid->tiles[i], other->tiles[i], weight_q8);
    }
    grid->global = blend_both(grid->global, other->global, weight_q8);
}

/* d / dt: Q8 px per us times 10^6 * 8 / 256 = 31250. A displacement of more than 4096 px is as good as that. */
static int16_t velocity(int32_t d_px_q8, uint32_t per_us, unsigned shift)
{
    const int64_t d = evs_clamp(d_px_q8, -(INT32_C(1) << 20), INT32_C(1) << 20);
    const int64_t v = evs_shr_r64(d * 31250 * (int64_t)(per_us >> 6), shift - 6u);
    return evs_sat16(evs_sat32(v));
}

evs_flow_velocity_t evs_flow_velocity_from(int32_t dx_px_q8, int32_t dy_px_q8, uint32_t dt_us)
{
    EVS_ASSERT(dt_us > 0u);
    unsigned shift;
    const uint32_t per_us = evs_recip_u32((dt_us > 0u) ? dt_us : 1u, &shift);
    const evs_flow_velocity_t v = {velocity(dx_px_q8, per_us, shift), velocity(dy_px_q8, per_us, shift)};
    return v;
}
