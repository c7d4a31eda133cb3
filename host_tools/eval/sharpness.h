/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  sharpness.h
 * @brief How sharp a picture of events is: the variance over the sensor of the blurred count image.
 *
 * Each point counts once at its nearest pixel; points off the sensor do not count. The count image is blurred by a
 * Gaussian of 1 px, cut at 4 px, with the border mirrored (scipy.ndimage.gaussian_filter with its defaults), and the
 * population variance of the result is the sharpness: events that pile up on one edge raise it, smeared ones do not.
 */
#ifndef EVL_SHARPNESS_H
#define EVL_SHARPNESS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "evs/types.h"

typedef struct {
    uint16_t width_px, height_px;
    uint64_t n_inside; /**< Points that were counted. */
    uint64_t n_off;    /**< Points that were not: no position, or off the sensor. */
    double *count;     /**< Row-major, width x height. Doubles: exact, and ready to be blurred. */
    double *row;       /**< One row with its mirrored border. */
} evl_sharpness_t;

/** An empty picture. @return false when memory is short or a side is 0; evl_sharpness_close() is fine then too. */
bool evl_sharpness_open(evl_sharpness_t *s, uint16_t width_px, uint16_t height_px);
void evl_sharpness_close(evl_sharpness_t *s);

/** Back to the empty picture. */
void evl_sharpness_clear(evl_sharpness_t *s);

void evl_sharpness_add(evl_sharpness_t *s, const evs_point_t *points, size_t n);

/** The measure of what was added since the last clear; 0 for an empty picture. The picture stays as it is. */
double evl_sharpness_value(const evl_sharpness_t *s);

#endif
