/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Double-precision models and a fixed-seed generator for the tests. Written without looking at the kernels. */
#ifndef EVS_TEST_MODEL_H
#define EVS_TEST_MODEL_H

#include "evs/float.h"

#include <math.h>

#define MODEL_PI 3.14159265358979323846

typedef struct {
    double w, x, y, z;
} model_quat_t;

/* Uniform in [lo, hi); a linear congruential generator, so that every target draws the same numbers. */
static inline double model_uniform(double lo, double hi)
{
    static uint32_t seed = 12345u;
    seed = seed * 1664525u + 1013904223u;
    return lo + (hi - lo) * (double)(seed >> 8) / 16777216.0;
}

static inline model_quat_t model_mul(model_quat_t a, model_quat_t b)
{
    const model_quat_t c = {
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
    return c;
}

static inline model_quat_t model_conj(model_quat_t q)
{
    const model_quat_t c = {q.w, -q.x, -q.y, -q.z};
    return c;
}

static inline model_quat_t model_normalize(model_quat_t q)
{
    const double n = sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
    const model_quat_t u = {q.w / n, q.x / n, q.y / n, q.z / n};
    return u;
}

/* Rotation by the vector (x, y, z): axis times angle. */
static inline model_quat_t model_exp(double x, double y, double z)
{
    const double a = sqrt(x * x + y * y + z * z);
    const double s = (a > 1e-9) ? sin(a / 2) / a : 0.5;
    const model_quat_t q = {cos(a / 2), x * s, y * s, z * s};
    return q;
}

static inline model_quat_t model_random_rotation(double max_rad)
{
    return model_exp(model_uniform(-1, 1) * max_rad / 1.7320508, model_uniform(-1, 1) * max_rad / 1.7320508,
                     model_uniform(-1, 1) * max_rad / 1.7320508);
}

static inline void model_rotate(model_quat_t q, const double v[3], double out[3])
{
    const model_quat_t p = {0.0, v[0], v[1], v[2]};
    const model_quat_t r = model_mul(model_mul(q, p), model_conj(q));
    out[0] = r.x;
    out[1] = r.y;
    out[2] = r.z;
}

/* Angle of the rotation from a to b, rad. */
static inline double model_angle(model_quat_t a, model_quat_t b)
{
    const model_quat_t d = model_mul(model_conj(a), b);
    return 2.0 * atan2(sqrt(d.x * d.x + d.y * d.y + d.z * d.z), fabs(d.w));
}

/* Angle between two vectors, rad. */
static inline double model_angle_between(const double a[3], const double b[3])
{
    const double cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    return atan2(sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]),
                 a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
}

static inline void model_from_unit(evs_vec3_t v_q30, double out[3])
{
    out[0] = evs_q_to_double(v_q30.x, 30);
    out[1] = evs_q_to_double(v_q30.y, 30);
    out[2] = evs_q_to_double(v_q30.z, 30);
}

static inline evs_quat_t model_to_fixed(model_quat_t q) { return evs_quat_from_double(q.w, q.x, q.y, q.z); }

static inline model_quat_t model_from_fixed(evs_quat_t q)
{
    const model_quat_t m = {evs_q_to_double(q.w, 30), evs_q_to_double(q.x, 30), evs_q_to_double(q.y, 30),
                            evs_q_to_double(q.z, 30)};
    return m;
}

#endif
