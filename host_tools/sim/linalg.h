/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  linalg.h
 * @brief The few operations on 3-vectors and rotations that the simulator needs, in double precision.
 */
#ifndef EVSIM_LINALG_H
#define EVSIM_LINALG_H

#include <math.h>

#define EVSIM_PI 3.14159265358979323846

typedef struct {
    double v[3];
} evsim_vec_t;

/** R.m[row][column]. */
typedef struct {
    double m[3][3];
} evsim_mat_t;

static inline evsim_vec_t evsim_vec(double x, double y, double z) { return (evsim_vec_t){{x, y, z}}; }

static inline double evsim_dot(evsim_vec_t a, evsim_vec_t b)
{
    return a.v[0] * b.v[0] + a.v[1] * b.v[1] + a.v[2] * b.v[2];
}

static inline evsim_vec_t evsim_add(evsim_vec_t a, evsim_vec_t b)
{
    return evsim_vec(a.v[0] + b.v[0], a.v[1] + b.v[1], a.v[2] + b.v[2]);
}

static inline evsim_vec_t evsim_sub(evsim_vec_t a, evsim_vec_t b)
{
    return evsim_vec(a.v[0] - b.v[0], a.v[1] - b.v[1], a.v[2] - b.v[2]);
}

static inline evsim_vec_t evsim_scale(double s, evsim_vec_t a) { return evsim_vec(s * a.v[0], s * a.v[1], s * a.v[2]); }

static inline evsim_vec_t evsim_cross(evsim_vec_t a, evsim_vec_t b)
{
    return evsim_vec(a.v[1] * b.v[2] - a.v[2] * b.v[1], a.v[2] * b.v[0] - a.v[0] * b.v[2],
                     a.v[0] * b.v[1] - a.v[1] * b.v[0]);
}

static inline double evsim_norm(evsim_vec_t a) { return sqrt(evsim_dot(a, a)); }

static inline evsim_vec_t evsim_unit(evsim_vec_t a) { return evsim_scale(1.0 / evsim_norm(a), a); }

static inline evsim_vec_t evsim_rotate(const evsim_mat_t *r, evsim_vec_t a)
{
    return evsim_vec(r->m[0][0] * a.v[0] + r->m[0][1] * a.v[1] + r->m[0][2] * a.v[2],
                     r->m[1][0] * a.v[0] + r->m[1][1] * a.v[1] + r->m[1][2] * a.v[2],
                     r->m[2][0] * a.v[0] + r->m[2][1] * a.v[1] + r->m[2][2] * a.v[2]);
}

/** R' a */
static inline evsim_vec_t evsim_rotate_back(const evsim_mat_t *r, evsim_vec_t a)
{
    return evsim_vec(r->m[0][0] * a.v[0] + r->m[1][0] * a.v[1] + r->m[2][0] * a.v[2],
                     r->m[0][1] * a.v[0] + r->m[1][1] * a.v[1] + r->m[2][1] * a.v[2],
                     r->m[0][2] * a.v[0] + r->m[1][2] * a.v[1] + r->m[2][2] * a.v[2]);
}

/** Quaternion w x y z, Hamilton. */
typedef struct {
    double q[4];
} evsim_quat_t;

static inline evsim_quat_t evsim_quat_mul(evsim_quat_t a, evsim_quat_t b)
{
    const double *const p = a.q;
    const double *const r = b.q;
    return (evsim_quat_t){
        {p[0] * r[0] - p[1] * r[1] - p[2] * r[2] - p[3] * r[3], p[0] * r[1] + p[1] * r[0] + p[2] * r[3] - p[3] * r[2],
         p[0] * r[2] - p[1] * r[3] + p[2] * r[0] + p[3] * r[1], p[0] * r[3] + p[1] * r[2] - p[2] * r[1] + p[3] * r[0]}};
}

static inline evsim_mat_t evsim_quat_to_mat(evsim_quat_t a)
{
    const double w = a.q[0];
    const double x = a.q[1];
    const double y = a.q[2];
    const double z = a.q[3];
    return (evsim_mat_t){{{1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)},
                          {2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)},
                          {2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)}}};
}

#endif
