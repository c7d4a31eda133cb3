/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/image.h
 * @brief An 8-bit grey image, and half of it: the plane that renderers write and that corners and flow read.
 *
 * Model    rows follow each other without gaps, so pixel (x, y) is px[y * width_px + x]. Halving is the mean of 2 x 2 px,
 *          one level of a pyramid. Pixel (x, y) of the half lies at (2 x + 1/2, 2 y + 1/2) of the whole.
 * Memory   the caller's; an evs_image_t only points to it.
 * Cost     halving: one pass.
 * Numeric  integers only, bit-exact on every target. Means are rounded, halves up.
 * Threads  no state.
 */
#ifndef EVS_IMAGE_H
#define EVS_IMAGE_H

#include "evs/types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct { /** A plane of width_px * height_px bytes, both in [1, EVS_SENSOR_MAX_PX]. */
    const uint8_t *px;
    uint16_t width_px;
    uint16_t height_px;
} evs_image_t;

/** Bytes of an image, a constant expression; and the width or height of half of one. */
#define EVS_IMAGE_BYTES(width_px, height_px) ((size_t)(width_px) * (height_px))
#define EVS_IMAGE_HALF(n)                    (((n) + 1u) / 2u)

/**
 * Half the image by the mean of 2 x 2 px. A last odd column or row is averaged with itself.
 * @param[out] out  EVS_IMAGE_HALF(width_px) * EVS_IMAGE_HALF(height_px) bytes, none of them of the image itself.
 */
void evs_image_halve(const evs_image_t *in, uint8_t *out);

#ifdef __cplusplus
}
#endif
#endif
