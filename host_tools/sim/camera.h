/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  camera.h
 * @brief The ray of every pixel, by inverting the lens model (Brown-Conrady, as in ECD's calib.txt) once.
 */
#ifndef EVSIM_CAMERA_H
#define EVSIM_CAMERA_H

#include <stdbool.h>
#include <stdint.h>

#include "calib.h"
#include "error.h"

#define EVSIM_TILE_W 16u /**< Pixels of a tile, the unit of culling. */
#define EVSIM_TILE_H 8u  /**< Also the rows of a band, the unit of work of a thread. */

/** Rays of a tile lie in this rectangle. */
typedef struct {
    float x_mid, y_mid, x_half, y_half;
} evsim_tile_t;

/** A ray to judge the image motion by: one of a coarse grid. */
typedef struct {
    double x, y;
    double px_per_x[2]; /**< Pixel motion (x, y) per unit of ray motion in x. */
    double px_per_y[2];
} evsim_probe_t;

#define EVSIM_PROBES_MAX 192u

typedef struct {
    unsigned width_px;
    unsigned height_px;
    unsigned n_tiles_x;
    unsigned n_bands;
    float *ray_x; /**< Ray (x, y, 1) of each pixel, row-major. */
    float *ray_y;
    float *pitch; /**< Size of the pixel in ray units: its angular resolution. */
    evsim_tile_t *tile;
    evsim_probe_t probe[EVSIM_PROBES_MAX];
    unsigned n_probes;
} evsim_camera_t;

/** Free with evsim_camera_free(), also after a failure. */
bool evsim_camera_init(evsim_camera_t *camera, const evh_calib_t *calib, evh_error_t *err);
void evsim_camera_free(evsim_camera_t *camera);

/** Distort a ray: what the lens makes of (x, y, 1). Jacobian d(out)/d(x, y) row-major; may be NULL. */
void evsim_distort(const evh_calib_t *calib, double x, double y, double out[2], double jacobian[4]);

/** The ray that the lens sends to this pixel. @return false where the model has no inverse. */
bool evsim_undistort(const evh_calib_t *calib, double x_px, double y_px, double ray[2]);

#endif
