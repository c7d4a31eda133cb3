/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  scene.h
 * @brief What the camera sees: textured planes. A plane without bounds is a wall of a convex room that the camera is
 *        in; one with bounds is a panel floating in it.
 */
#ifndef EVSIM_SCENE_H
#define EVSIM_SCENE_H

#include "linalg.h"
#include "pool.h"
#include "settings.h"
#include "texture.h"

#define EVSIM_SURFACES_MAX 32u

typedef struct {
    evsim_vec_t centre_m;
    evsim_vec_t u; /**< Unit vectors in the plane: to the right and down for who looks at it. */
    evsim_vec_t v;
    bool bounded;
    double half_u_m;
    double half_v_m;
    unsigned texture;
    double texels_per_m_u;
    double texels_per_m_v;
    double offset_u; /**< Texel at the centre. */
    double offset_v;
    double gain; /**< Of the light on it. */
} evsim_surface_t;

typedef struct {
    evsim_surface_t surface[EVSIM_SURFACES_MAX];
    unsigned n_surfaces;
    evsim_texture_t texture[EVSIM_TEXTURES_MAX];
    double aspect[EVSIM_TEXTURES_MAX]; /**< Width / height as it shall be seen. */
    unsigned n_textures;
    double background; /**< Where there is no surface. */
} evsim_scene_t;

/** Free with evsim_scene_free(), also after a failure. */
bool evsim_scene_init(evsim_scene_t *scene, const evsim_settings_t *settings, evsim_pool_t *pool, evh_error_t *err);
void evsim_scene_free(evsim_scene_t *scene);

#endif
