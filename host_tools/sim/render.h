/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  render.h
 * @brief Linear intensity of every pixel from a given pose: ray casting of planes, which in the camera's own axes is
 *        three scalar products a plane, with culling by tiles, mip-mapped textures and anti-aliased edges.
 *
 * With the camera at p, a plane through o with normal n is met by the ray d = (x, y, 1) at depth z where
 *     1/z = c . d,   c = R' n / (n . (o - p))
 * and the plane's coordinate along u there is (c (u . (p - o)) + R' u) . d times z: also a scalar product before the
 * division. Bounds are lines in the image, so the distance to an edge in pixels, which edges are smoothed by, is one
 * too.
 */
#ifndef EVSIM_RENDER_H
#define EVSIM_RENDER_H

#include "camera.h"
#include "motion.h"
#include "scene.h"

/** A surface in the axes of the camera at one moment. */
typedef struct {
    float inverse_depth[3];
    float u[3]; /**< Texels times inverse depth. */
    float v[3];
    float edge[4][3]; /**< Distance inside each edge, in ray units. */
    float offset_u;
    float offset_v;
    float gain;
    bool bounded;
    const evsim_texture_t *texture;
} evsim_view_surface_t;

typedef struct {
    evsim_view_surface_t surface[EVSIM_SURFACES_MAX];
    unsigned n_surfaces;
    float background;
} evsim_view_t;

void evsim_view_init(evsim_view_t *view, const evsim_scene_t *scene, const evsim_state_t *state);

/** 1 / depth along the ray (x, y, 1); 0 where nothing is. */
double evsim_view_inverse_depth(const evsim_view_t *view, double x, double y);

/** Rows of one band (EVSIM_TILE_H rows, fewer at the bottom), width_px values a row. */
void evsim_render_band(const evsim_view_t *view, const evsim_camera_t *camera, unsigned band, float *intensity);

#endif
