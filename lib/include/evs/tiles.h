/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/tiles.h
 * @brief A grid of tiles over the sensor: which tile a position falls into.
 *
 * Model    n_cols x n_rows tiles, each floor(width / n_cols) x floor(height / n_rows) px; the last column and the last
 *          row are larger by the remainder. A position is rounded half up to a pixel first. Tiles count row by row.
 * Memory   one evs_tile_grid_t, 24 bytes.
 * Cost     evs_tile_of_point(): two multiplications, no division.
 * Numeric  integers only. The multiplication by a reciprocal equals the division for every position on a sensor.
 * Threads  a grid is only read once it is set up.
 */
#ifndef EVS_TILES_H
#define EVS_TILES_H

#include "evs/types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_TILE_NONE     0xFFFFu /**< Tile of a position off the sensor, and of EVS_POINT_OUTSIDE. */
#define EVS_TILES_MAX     0xFFFFu /**< Largest number of tiles: indices 0 .. 0xFFFE. */
#define EVS_TILE_RCP_BITS 21

/* With two columns or more a tile is at most s = 1024 px wide, and x <= 2047. With m = ceil(2^21 / s) the quotient
 * x m / 2^21 exceeds x / s by x e / (2^21 s), e = m s - 2^21 < s, which is less than 1 / s because x e < 2^21; and
 * x m stays below 2^32 even at s = 1. A single column needs no quotient: m = 0. */
EVS_STATIC_ASSERT((EVS_SENSOR_MAX_PX - 1u) * (EVS_SENSOR_MAX_PX / 2u - 1u) < (1u << EVS_TILE_RCP_BITS),
                  "the reciprocal of a tile size is not exact over the sensor");

typedef struct { /** A grid. Set it up with evs_tile_grid_init(); then read, do not write. */
    uint16_t width_px;
    uint16_t height_px;
    uint16_t n_cols;
    uint16_t n_rows;
    uint16_t tile_width_px;
    uint16_t tile_height_px;
    uint32_t n_tiles; /**< n_cols * n_rows, at most EVS_TILES_MAX. */
    uint32_t rcp_x_q21;
    uint32_t rcp_y_q21;
} evs_tile_grid_t;

/**
 * @param[out] grid              Untouched on error.
 * @param      width_px,height_px  [1, EVS_SENSOR_MAX_PX]
 * @param      n_cols,n_rows     [1, width_px] and [1, height_px]; their product at most EVS_TILES_MAX.
 * @return EVS_OK, EVS_ERR_NULL or EVS_ERR_ARG.
 */
EVS_NODISCARD evs_status_t evs_tile_grid_init(evs_tile_grid_t *grid, uint16_t width_px, uint16_t height_px,
                                              uint16_t n_cols, uint16_t n_rows);

/** The tile of a pixel, or EVS_TILE_NONE off the sensor. */
static inline uint16_t evs_tile_of_pixel(const evs_tile_grid_t *grid, int32_t x_px, int32_t y_px)
{
    /* One unsigned comparison per axis catches negative pixels too. */
    if (((uint32_t)x_px >= grid->width_px) || ((uint32_t)y_px >= grid->height_px)) { return EVS_TILE_NONE; }
    uint32_t col = ((uint32_t)x_px * grid->rcp_x_q21) >> EVS_TILE_RCP_BITS;
    uint32_t row = ((uint32_t)y_px * grid->rcp_y_q21) >> EVS_TILE_RCP_BITS;
    if (col >= grid->n_cols) { col = grid->n_cols - 1u; } /* the last one absorbs the remainder */
    if (row >= grid->n_rows) { row = grid->n_rows - 1u; }
    return (uint16_t)(row * grid->n_cols + col);
}

/** The tile of a position, or EVS_TILE_NONE. EVS_POINT_OUTSIDE needs no test of its own: it rounds to pixel -2048. */
static inline uint16_t evs_tile_of_point(const evs_tile_grid_t *grid, evs_point_t p)
{
    return evs_tile_of_pixel(grid, (p.x_q4 + 8) >> 4, (p.y_q4 + 8) >> 4);
}

#ifdef __cplusplus
}
#endif
#endif
