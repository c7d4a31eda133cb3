/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * Made-up optical flow with a known answer, in double precision: a 240x180 camera with K = (199, 199, 132, 110) in a
 * scene of random depths. Written without looking at the solver.
 */
#ifndef EVS_TEST_FLOW_SCENE_H
#define EVS_TEST_FLOW_SCENE_H

#include "evs/egomotion.h"
#include "evs/float.h"
#include "model.h"

#include <math.h>

#define SCENE_F 199.0

typedef struct {
    double v[3]; /* truth: own velocity, unit */
    double w[3]; /* rotation left in the flow, rad over the interval */
} scene_truth_t;

typedef struct {
    double noise_px;    /* 1 sigma per component */
    double outliers;    /* share of vectors whose direction is random and whose length is another vector's */
    double depth_low_m; /* depths are uniform in [low, high] */
    double depth_high_m;
    double way_m;        /* that the camera moves in the interval */
    double object_share; /* share of the image covered by a disc that moves by itself */
    double object_way_m; /* its way and depth; 0: those of the others */
    double object_depth_m;
} scene_settings_t;

static uint64_t scene_seed = 1u;

/* Uniform in [0, 1): the upper bits of a 64-bit congruential generator, the same on every target. */
static inline double scene_uniform(void)
{
    scene_seed = scene_seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(uint32_t)(scene_seed >> 32) / 4294967296.0;
}

static inline double scene_normal(void)
{
    const double r = sqrt(-2.0 * log(1.0 - scene_uniform()));
    return r * cos(2.0 * MODEL_PI * scene_uniform());
}

static inline void scene_direction(double v[3])
{
    const double z = 2.0 * scene_uniform() - 1.0;
    const double angle = 2.0 * MODEL_PI * scene_uniform();
    const double r = sqrt(1.0 - z * z);
    v[0] = r * cos(angle);
    v[1] = r * sin(angle);
    v[2] = z;
}

static inline scene_settings_t scene_settings(double noise_px, double outliers)
{
    const scene_settings_t s = {noise_px, outliers, 1.0, 5.0, 0.05, 0.0, 0.0, 0.0};
    return s;
}

static inline evs_egomotion_flow_t scene_vector(double x, double y, double u, double v)
{
    const evs_egomotion_flow_t f = {evs_q_from_double(x, 24), evs_q_from_double(y, 24), evs_q_from_double(u, 24),
                                    evs_q_from_double(v, 24)};
    return f;
}

/* Flow of a point at depth z under a motion: derived from d(X / Z) = (dX - x dZ) / Z with dX = -V - w x X. */
static inline void scene_flow(double x, double y, double z, const double way[3], const double w[3], double flow[2])
{
    const double dx = -way[0] / z - (w[1] - w[2] * y);
    const double dy = -way[1] / z - (w[2] * x - w[0]);
    const double dz = -way[2] / z - (w[0] * y - w[1] * x);
    flow[0] = dx - x * dz;
    flow[1] = dy - y * dz;
}

/* n vectors of a scene with truth->v and truth->w. bad[i], where it is not NULL, tells whether vector i is an outlier
 * or belongs to the object. */
static inline void scene_make_labelled(const scene_settings_t *s, const scene_truth_t *truth, evs_egomotion_flow_t *out,
                                       size_t n, unsigned char *bad)
{
    const double radius_px = sqrt(s->object_share * 240.0 * 180.0 / MODEL_PI);
    const double object_x = 40.0 + 160.0 * scene_uniform();
    const double object_y = 40.0 + 100.0 * scene_uniform();
    double object_v[3];
    scene_direction(object_v);
    for (size_t i = 0; i < n; i++) {
        const double px = 240.0 * scene_uniform();
        const double py = 180.0 * scene_uniform();
        const double x = (px - 132.0) / SCENE_F;
        const double y = (py - 110.0) / SCENE_F;
        const bool on_object = hypot(px - object_x, py - object_y) < radius_px;
        const double depth = s->depth_low_m + (s->depth_high_m - s->depth_low_m) * scene_uniform();
        const double z = (on_object && (s->object_depth_m > 0.0)) ? s->object_depth_m : depth;
        const double *const dir = on_object ? object_v : truth->v;
        const double way_m = (on_object && (s->object_way_m > 0.0)) ? s->object_way_m : s->way_m;
        const double way[3] = {dir[0] * way_m, dir[1] * way_m, dir[2] * way_m};
        double flow[2];
        scene_flow(x, y, z, way, truth->w, flow);
        out[i] = scene_vector(x, y, flow[0], flow[1]);
        if (bad != NULL) { bad[i] = on_object ? 1u : 0u; }
    }
    for (size_t i = 0; i < n; i++) { /* lengths come from vectors before or after their own turn: either will do */
        double u = evs_q_to_double(out[i].u_q24, 24);
        double v = evs_q_to_double(out[i].v_q24, 24);
        if (scene_uniform() < s->outliers) {
            const evs_egomotion_flow_t *const other = &out[(size_t)(scene_uniform() * (double)n)];
            const double length = hypot(evs_q_to_double(other->u_q24, 24), evs_q_to_double(other->v_q24, 24));
            const double angle = 2.0 * MODEL_PI * scene_uniform();
            u = length * cos(angle);
            v = length * sin(angle);
            if (bad != NULL) { bad[i] = 1u; }
        }
        u += scene_normal() * s->noise_px / SCENE_F;
        v += scene_normal() * s->noise_px / SCENE_F;
        out[i].u_q24 = evs_q_from_double(u, 24);
        out[i].v_q24 = evs_q_from_double(v, 24);
    }
}

static inline void scene_make(const scene_settings_t *s, const scene_truth_t *truth, evs_egomotion_flow_t *out,
                              size_t n)
{
    scene_make_labelled(s, truth, out, n, NULL);
}

static inline double scene_error_deg(const evs_egomotion_result_t *result, const double v[3])
{
    double found[3];
    model_from_unit(result->v_q30, found);
    return model_angle_between(found, v) * 180.0 / MODEL_PI;
}

static inline double scene_sigma_deg(const evs_egomotion_result_t *result)
{
    return evs_q_to_double(result->sigma_rad_q28, 28) * 180.0 / MODEL_PI;
}

#endif
