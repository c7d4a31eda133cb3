/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/tiles.h"

/* ceil(2^21 / tile): see the proof in the header. A single tile needs no quotient. */
static uint32_t reciprocal_q21(uint32_t tile_px, uint32_t n_tiles)
{
    return (n_tiles == 1u) ? 0u : ((UINT32_C(1) << EVS_TILE_RCP_BITS) + tile_px - 1u) / tile_px;
}

evs_status_t evs_tile_grid_init(evs_tile_grid_t *grid, uint16_t width_px, uint16_t height_px, uint16_t n_cols,
                                uint16_t n_rows)
{
    if (grid == NULL) { return EVS_ERR_NULL; }
    if ((width_px > EVS_SENSOR_MAX_PX) || (height_px > EVS_SENSOR_MAX_PX)) { return EVS_ERR_ARG; }
    if ((n_cols < 1u) || (n_cols > width_px) || (n_rows < 1u) || (n_rows > height_px)) { return EVS_ERR_ARG; }
    if ((uint32_t)n_cols * n_rows > EVS_TILES_MAX) { return EVS_ERR_ARG; }

    const uint16_t tile_width_px = (uint16_t)(width_px / n_cols);
    const uint16_t tile_height_px = (uint16_t)(height_px / n_rows);
    *grid = (evs_tile_grid_t){
        .width_px = width_px,
        .height_px = height_px,
        .n_cols = n_cols,
        .n_rows = n_rows,
        .tile_width_px = tile_width_px,
        .tile_height_px = tile_height_px,
        .n_tiles = (uint32_t)n_cols * n_rows,
        .rcp_x_q21 = reciprocal_q21(tile_width_px, n_cols),
        .rcp_y_q21 = reciprocal_q21(tile_height_px, n_rows),
    };
    return EVS_OK;
}
