/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/flow_grid.h
 * @brief A coarse grid of image velocities: filled from scattered flow, read out at any point.
 *
 * Model    n_cols x n_rows tiles of width / n_cols by height / n_rows px, a velocity at the centre of each, bilinear
 *          in between, the value of the edge beyond the outermost centres.
 *          Fill: the velocity of a tile is the median of its samples, component by component. A tile with fewer
 *          than three samples that agree with it must pass the normalized median test [1] against its neighbours.
 *          Tiles without a velocity of their own take the mean of their neighbours, ring by ring; when no tile is
 *          left, all take the median of all samples.
 * Memory   one evs_flow_grid_t, no more.
 * Cost     evs_flow_grid_at() 110 instructions on a Cortex-M7, no division. evs_flow_grid_fill() one look at each sample per tile.
 * Numeric  integers only, bit-exact on every target. Velocities in 1/8 px/s, up to 4095 px/s, saturating. Lookup
 *          errs by less than 1 LSB and 2^-10 of the difference between neighbouring tiles.
 * Time     intervals in us of 32 bits; no clock.
 * Threads  a grid is only read by the lookups; it must not be written at the same time.
 *
 * [1] J. Westerweel, F. Scarano, "Universal outlier detection for PIV data", Experiments in Fluids 39, 2005.
 *     doi:10.1007/s00348-005-0016-6
 */
#ifndef EVS_FLOW_GRID_H
#define EVS_FLOW_GRID_H

#include "evs/fixed.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_FLOW_GRID_TILES_MAX 64u
#define EVS_FLOW_GRID_COLS      8u /**< The usual grid. */
#define EVS_FLOW_GRID_ROWS      6u

#define EVS_FLOW_GRID_RCP_BITS    25u
#define EVS_FLOW_GRID_WEIGHT_BITS 12u

/** An image velocity in 1/8 px/s. */
typedef struct {
    int16_t x_px_s_q3;
    int16_t y_px_s_q3;
} evs_flow_velocity_t;

/** A velocity measured at a point. */
typedef struct {
    evs_point_t at;
    evs_flow_velocity_t v;
} evs_flow_sample_t;

typedef struct { /** A grid. Read it with the functions below: every member is private. */
    uint16_t width_px;
    uint16_t height_px;
    uint8_t n_cols;
    uint8_t n_rows;
    uint8_t n_measured; /* tiles with a velocity of their own */
    evs_flow_velocity_t global;
    uint32_t rcp_x_q25; /* tiles per 1/16 px */
    uint32_t rcp_y_q25;
    evs_flow_velocity_t tiles[EVS_FLOW_GRID_TILES_MAX]; /* row by row */
} evs_flow_grid_t;

/**
 * Set up a grid of zero velocity.
 * @param[out] grid                Untouched on error.
 * @param      width_px,height_px  [1, EVS_SENSOR_MAX_PX]
 * @param      n_cols,n_rows       [1, width_px] and [1, height_px]; their product at most EVS_FLOW_GRID_TILES_MAX.
 * @return EVS_OK, EVS_ERR_NULL or EVS_ERR_ARG.
 */
EVS_NODISCARD evs_status_t evs_flow_grid_init(evs_flow_grid_t *grid, uint16_t width_px, uint16_t height_px,
                                              uint16_t n_cols, uint16_t n_rows);

/** The same velocity everywhere; no tile counts as measured. */
void evs_flow_grid_set_all(evs_flow_grid_t *grid, evs_flow_velocity_t v);

/** Zero velocity everywhere. */
void evs_flow_grid_clear(evs_flow_grid_t *grid);

/** The velocity of one tile: for those who measure it themselves, as evs/warp.h. */
void evs_flow_grid_set_tile(evs_flow_grid_t *grid, uint16_t col, uint16_t row, evs_flow_velocity_t v);

/**
 * Replace all velocities by those of samples. Samples off the image are ignored; without any other the grid is left as
 * it is. Of more than 32 samples in a tile (for evs_flow_grid_global(): on the image) every k-th is used.
 * @param n  At most 65535.
 * @return the number of samples on the image.
 */
size_t evs_flow_grid_fill(evs_flow_grid_t *grid, const evs_flow_sample_t *samples, size_t n);

/** Move every velocity towards that of another grid with as many tiles: v += weight * (other - v), weight in [0, 256] / 256. */
void evs_flow_grid_blend(evs_flow_grid_t *grid, const evs_flow_grid_t *other, uint16_t weight_q8);

/** Velocity from a displacement over dt_us > 0, saturating. */
evs_flow_velocity_t evs_flow_velocity_from(int32_t dx_px_q8, int32_t dy_px_q8, uint32_t dt_us);

/** The tile of a point, counted row by row, or EVS_FLOW_GRID_TILES_MAX off the image. */
uint32_t evs_flow_grid_tile_of(const evs_flow_grid_t *grid, evs_point_t p);

/** The centre of a tile, to 1/16 px. */
evs_point_t evs_flow_grid_centre(const evs_flow_grid_t *grid, uint16_t col, uint16_t row);

/** Median of all samples of the last fill, or what evs_flow_grid_set_all() was given. */
static inline evs_flow_velocity_t evs_flow_grid_global(const evs_flow_grid_t *grid) { return grid->global; }

/** How many tiles have a velocity of their own from the last fill. */
static inline uint32_t evs_flow_grid_n_measured(const evs_flow_grid_t *grid) { return grid->n_measured; }

/** The velocity of one tile. */
static inline evs_flow_velocity_t evs_flow_grid_tile(const evs_flow_grid_t *grid, uint16_t col, uint16_t row)
{
    EVS_ASSERT((col < grid->n_cols) && (row < grid->n_rows));
    return grid->tiles[(uint32_t)row * grid->n_cols + col];
}

/* Position along one axis in tiles, Q12, from the centre of the first: limited to the centre of the last. */
static inline uint32_t evs_flow_grid_axis(int32_t at_q4, uint32_t n_px, uint32_t rcp_q25, uint32_t n_tiles)
{
    const int32_t from_edge_q4 = evs_clamp(at_q4 + 8, 0, (int32_t)(16u * n_px) - 1);
    const uint32_t tiles_q12 =
        ((uint32_t)from_edge_q4 * rcp_q25) >> (EVS_FLOW_GRID_RCP_BITS - EVS_FLOW_GRID_WEIGHT_BITS);
    const uint32_t half = 1u << (EVS_FLOW_GRID_WEIGHT_BITS - 1u);
    const uint32_t last = (n_tiles - 1u) << EVS_FLOW_GRID_WEIGHT_BITS;
    const uint32_t from_centre_q12 = (tiles_q12 < half) ? 0u : tiles_q12 - half;
    return (from_centre_q12 > last) ? last : from_centre_q12;
}

/* Bilinear in a cell of four values; weights Q12. 16 + 12 bits and then 18 + 12 + 1 bits: 32 are enough. */
static inline int16_t evs_flow_grid_bilinear(int32_t v00, int32_t v01, int32_t v10, int32_t v11, int32_t wx, int32_t wy)
{
    const int32_t top = evs_shr_r(v00 * 4096 + (v01 - v00) * wx, 10); /* two more bits than the values */
    const int32_t bottom = evs_shr_r(v10 * 4096 + (v11 - v10) * wx, 10);
    return (int16_t)evs_shr_r(top * 4096 + (bottom - top) * wy, 14);
}

/** The velocity at a point. Off the image (EVS_POINT_OUTSIDE too) that of the nearest point on it. */
static inline evs_flow_velocity_t evs_flow_grid_at(const evs_flow_grid_t *grid, evs_point_t p)
{
    const uint32_t x_q12 = evs_flow_grid_axis(p.x_q4, grid->width_px, grid->rcp_x_q25, grid->n_cols);
    const uint32_t y_q12 = evs_flow_grid_axis(p.y_q4, grid->height_px, grid->rcp_y_q25, grid->n_rows);
    const uint32_t col = x_q12 >> EVS_FLOW_GRID_WEIGHT_BITS;
    const uint32_t row = y_q12 >> EVS_FLOW_GRID_WEIGHT_BITS;
    const int32_t wx = (int32_t)(x_q12 & 4095u);
    const int32_t wy = (int32_t)(y_q12 & 4095u);
    /* At the last centre the weight is 0 and the neighbour does not exist. */
    const evs_flow_velocity_t *const a = &grid->tiles[row * grid->n_cols + col];
    const evs_flow_velocity_t *const b = a + ((row + 1u < grid->n_rows) ? grid->n_cols : 0u);
    const uint32_t next = (col + 1u < grid->n_cols) ? 1u : 0u;
    evs_flow_velocity_t v;
    v.x_px_s_q3 = evs_flow_grid_bilinear(a[0].x_px_s_q3, a[next].x_px_s_q3, b[0].x_px_s_q3, b[next].x_px_s_q3, wx, wy);
    v.y_px_s_q3 = evs_flow_grid_bilinear(a[0].y_px_s_q3, a[next].y_px_s_q3, b[0].y_px_s_q3, b[next].y_px_s_q3, wx, wy);
    return v;
}

/* v * dt in px with 4 (shift 35) or 8 (shift 31) fractional bits: 2^35 / (8 * 10^6 / 16) = 68719.48. The product stays
 * below 2^63 for every velocity and interval; the factor's error is 7e-6. */
#define EVS_FLOW_PER_US 68719

/** How far a point moves in dt_us, Q8 px, saturating. */
static inline int32_t evs_flow_displacement_q8(int16_t px_s_q3, int32_t dt_us)
{
    return evs_sat32(evs_shr_r64((int64_t)px_s_q3 * dt_us * EVS_FLOW_PER_US, 31));
}

/** The same in Q4 px, the unit of evs_point_t. */
static inline int32_t evs_flow_displacement_q4(int16_t px_s_q3, int32_t dt_us)
{
    return (int32_t)evs_shr_r64((int64_t)px_s_q3 * dt_us * EVS_FLOW_PER_US, 35);
}

#ifdef __cplusplus
}
#endif
#endif
