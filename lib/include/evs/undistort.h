/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/undistort.h
 * @brief Undistortion of events by table: the first step of the hot path.
 *
 * Model    evs_camera_undistort_point() of every pixel, tabulated either for each pixel (step 1: exact) or on a grid of
 *          2, 4, 8, 16 or 32 px with bilinear interpolation in between. Outputs are evs_point_t, 1/16 px.
 * Tiles    For the area-count window each event can be given the tile of its undistorted position, looked up in a
 *          second table or computed from the point: the same numbers either way.
 * Memory   one evs_undistort_t, EVS_UNDISTORT_POINTS(w, h, step) points of 4 bytes and, if wanted,
 *          EVS_UNDISTORT_TILES(w, h) indices of 2 bytes. Both tables may lie in flash.
 *            240 x 180   step 1 172800 B   step 4 11224 B   step 8 2976 B    tiles 86400 B
 *            640 x 480   step 1 1228800 B  step 8 19764 B   step 16 5084 B   tiles 614400 B
 * Cost     per event 8 instructions (Cortex-M4/M7; M55: 3) with step 1 and 46 on a grid; the tile 2 more from a table,
 *          24 computed. Building takes one inversion of the lens per point with step 1 and about five on a grid: 45
 *          million instructions for 240 x 180 and step 8.
 * Numeric  integers only, bit-exact on every target. Step 1: the model rounded half up to 1/16 px. A grid adds the
 *          error of linear interpolation, about step^2 / 16 times the curvature of the lens: inside the image at most
 *          0.093 px at step 8 and 0.066 px at step 4 for the ECD camera; docs/modules/undistort.md lists more.
 * Threads  no shared state; one context must not be entered from two threads or ISRs at once.
 */
#ifndef EVS_UNDISTORT_H
#define EVS_UNDISTORT_H

#include "evs/camera.h"
#include "evs/tiles.h"
#include "evs/types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_UNDISTORT_STEP_MAX_PX 32u /**< Steps are powers of two up to this. */

/** Nodes along an axis of @p length_px pixels. A grid ends on or behind the last pixel and holds one node more, so that
 *  every pixel has a right and a lower neighbour. */
#define EVS_UNDISTORT_NODES(length_px, step_px)                                                                        \
    (((step_px) == 1u) ? (size_t)(length_px) : ((size_t)(length_px)-1u) / (size_t)(step_px) + 2u)

/** Points of a table. A constant expression: use it to size a static array. */
#define EVS_UNDISTORT_POINTS(width_px, height_px, step_px)                                                             \
    (EVS_UNDISTORT_NODES(width_px, step_px) * EVS_UNDISTORT_NODES(height_px, step_px))

/** Entries of a tile table: one per pixel whatever the step. */
#define EVS_UNDISTORT_TILES(width_px, height_px) ((size_t)(width_px) * (size_t)(height_px))

typedef struct {               /** Context. A complete type only so that you can place it: every member is private. */
    const evs_point_t *points; /**< Row by row. */
    const uint16_t *tiles;     /**< One per pixel, or NULL: compute them. */
    uint32_t n_rejected;       /**< Events off the sensor; saturates. */
    uint16_t width_px;
    uint16_t height_px;
    uint16_t n_nodes_x; /**< Points in a row of the table. */
    uint8_t step_log2;
    bool has_tiles; /**< A tile grid was given. */
    bool has_gaps;  /**< Some node of a grid has no position. */
    evs_tile_grid_t grid;
} evs_undistort_t;

/**
 * Compute the table of a camera into caller memory.
 * @param[out] u         Untouched on error.
 * @param      step_px   1, 2, 4, 8, 16 or 32.
 * @param[out] points    Kept by reference; must outlive @p u. Untouched on error.
 * @param      n_points  At least EVS_UNDISTORT_POINTS(width, height, step_px).
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (step) or EVS_ERR_SIZE.
 */
EVS_NODISCARD evs_status_t evs_undistort_build(evs_undistort_t *u, const evs_camera_t *cam, uint16_t step_px,
                                               evs_point_t *points, size_t n_points);

/**
 * Use a table that exists already, such as one that `evstab lut` wrote as a `const` array for flash. Nothing is copied.
 * @param[out] u                 Untouched on error.
 * @param      width_px,height_px  Sensor that the table was made for, [1, EVS_SENSOR_MAX_PX].
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (step or sensor size) or EVS_ERR_SIZE (@p n_points too few).
 */
EVS_NODISCARD evs_status_t evs_undistort_bind(evs_undistort_t *u, uint16_t width_px, uint16_t height_px,
                                              uint16_t step_px, const evs_point_t *points, size_t n_points);

/**
 * Compute a tile table into caller memory, so that evs_undistort_map_tiles() looks tiles up.
 * @param      u        Has its points already. Untouched on error.
 * @param      grid     Copied. Its sensor size must be the table's.
 * @param[out] tiles    Kept by reference; must outlive @p u. Untouched on error.
 * @param      n_tiles  At least EVS_UNDISTORT_TILES(width, height).
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (the grid is of another sensor) or EVS_ERR_SIZE.
 */
EVS_NODISCARD evs_status_t evs_undistort_build_tiles(evs_undistort_t *u, const evs_tile_grid_t *grid, uint16_t *tiles,
                                                     size_t n_tiles);

/**
 * Use a tile table that exists already, or with @p tiles NULL and @p n_tiles 0 none: tiles are then computed from the
 * points, at about ten instructions per event. Otherwise as evs_undistort_build_tiles().
 */
EVS_NODISCARD evs_status_t evs_undistort_bind_tiles(evs_undistort_t *u, const evs_tile_grid_t *grid,
                                                    const uint16_t *tiles, size_t n_tiles);

/** The undistorted position of one pixel; EVS_POINT_OUTSIDE when it has none or lies off the sensor (not counted). */
evs_point_t evs_undistort_pixel(const evs_undistort_t *u, uint16_t x_px, uint16_t y_px);

/**
 * The undistorted position of each of @p n events.
 * @param[out] points  n points, no overlap with @p ev. An event off the sensor is counted and gets EVS_POINT_OUTSIDE,
 * as does (uncounted) a pixel that has no undistorted position; on a grid that holds for the whole cell around such a
 * node.
 */
void evs_undistort_map(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points);

/**
 * evs_undistort_map(), and the tile of each position in the grid given before.
 * @param[out] tiles  n indices; EVS_TILE_NONE where the point is outside or off the sensor.
 */
void evs_undistort_map_tiles(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points, uint16_t *tiles);

/** Events off the sensor so far; saturates. */
uint32_t evs_undistort_n_rejected(const evs_undistort_t *u);

#ifdef __cplusplus
}
#endif
#endif
