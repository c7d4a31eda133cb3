/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/corners.h
 * @brief Points worth tracking: the best Shi-Tomasi corner of each cell of an image.
 *
 * Model    score = the smaller eigenvalue of the sums of products of Sobel gradients over 5 x 5 px [1], rounded down:
 *          OpenCV's cornerMinEigenVal() with block 5, times 5100^2. The image is divided into square cells; each gives
 *          its best pixel (of equals the first, row by row), unless the score is 0 or below min_permille of the
 *          image's highest. Pixels closer than EVS_CORNERS_MARGIN_PX to the border have no score: their block is not whole.
 * Memory   one evs_corners_t and EVS_CORNERS_BYTES() of caller memory: a few rows and one entry per cell, needed only
 *          during evs_corners_find(), or from evs_corners_begin() to evs_corners_take(), so it may be shared with other
 *          work.
 * Cost     one pass over the image; a root only where a cell has a new best. docs/performance.md counts it. In pieces the
 *          same, and some 30 instructions per piece.
 * Numeric  integers only, bit-exact on every target. No score or order is rounded: comparisons are by exact products.
 * Threads  no shared state; one context must not be entered from two threads or ISRs at once.
 *
 * [1] J. Shi, C. Tomasi, "Good Features to Track", CVPR 1994. doi:10.1109/CVPR.1994.323794
 */
#ifndef EVS_CORNERS_H
#define EVS_CORNERS_H

#include "evs/image.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_CORNERS_MARGIN_PX   3u   /**< Half a block and the reach of the gradient. */
#define EVS_CORNERS_CELL_MIN_PX 4u   /**< Smallest cell_px. */
#define EVS_CORNERS_CELL_MAX_PX 256u /**< Largest cell_px. */

/** Most corners that an image can have: its cells. A constant expression. */
#define EVS_CORNERS_CELLS(width_px, height_px, cell_px)                                                                \
    ((((size_t)(width_px) + (cell_px)-1u) / (cell_px)) * (((size_t)(height_px) + (cell_px)-1u) / (cell_px)))

/** Bytes of memory for images of this size. A constant expression. */
#define EVS_CORNERS_BYTES(width_px, height_px, cell_px)                                                                \
    (EVS_CORNERS_CELLS(width_px, height_px, cell_px) * sizeof(evs_corner_t) + (size_t)(width_px)*36u)

typedef struct { /** A corner: a pixel and how good it is. */
    uint16_t x_px;
    uint16_t y_px;
    uint32_t score;
} evs_corner_t;

typedef struct {           /** Settings; copied by evs_corners_init(). */
    uint16_t width_px;     /**< Of the images. [1, EVS_SENSOR_MAX_PX] */
    uint16_t height_px;    /**< [1, EVS_SENSOR_MAX_PX] */
    uint16_t cell_px;      /**< Side of a cell; the last column and row may be narrower. [4, 256], default 16. */
    uint16_t min_permille; /**< Lowest score, in 1/1000 of the image's highest. [0, 1000], default 10. */
} evs_corners_config_t;

typedef struct { /** Context. A complete type only so that you can place it: every member is private. */
    evs_corners_config_t cfg;
    uint16_t n_columns; /* of cells */
    uint16_t n_rows;
    uint16_t y_next; /* the row that is looked at next */
    uint32_t highest;
    uint32_t floor; /* scores up to this are too low */
    evs_image_t image;
    void *memory;
} evs_corners_t;

/** The defaults for images of this size. */
evs_corners_config_t evs_corners_config_default(uint16_t width_px, uint16_t height_px);

/**
 * Bind a context to caller memory.
 * @param[out] corners  Untouched on error.
 * @param      memory   Kept by reference, aligned to 4; contents do not matter, neither now nor between two calls.
 * @param      n_bytes  At least EVS_CORNERS_BYTES(cfg->width_px, cfg->height_px, cfg->cell_px).
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (a setting is out of range) or EVS_ERR_SIZE (too little memory, or misaligned).
 */
EVS_NODISCARD evs_status_t evs_corners_init(evs_corners_t *corners, const evs_corners_config_t *cfg, void *memory,
                                            size_t n_bytes);

/**
 * The corners of an image, cell by cell, row by row.
 * @param      image  Of the size in the settings.
 * @param[out] out    Room for @p max corners. When there are more, the best ones are returned (of equals the first).
 * @return how many: at most max and at most the number of cells. 0 for an image without a corner, or smaller than 7 x 7 px.
 */
size_t evs_corners_find(evs_corners_t *corners, const evs_image_t *image, evs_corner_t *out, size_t max);

/** The same in pieces, for a loop that has other things to do: begin, scan until there is nothing left, take. */
void evs_corners_begin(evs_corners_t *corners, const evs_image_t *image);

/** Look at up to @p n_rows rows more. The image must be unchanged. @return true when all have been looked at. */
bool evs_corners_scan(evs_corners_t *corners, size_t n_rows);

/** The corners, as evs_corners_find() returns them, after evs_corners_scan() has returned true. */
size_t evs_corners_take(const evs_corners_t *corners, evs_corner_t *out, size_t max);

#ifdef __cplusplus
}
#endif
#endif
