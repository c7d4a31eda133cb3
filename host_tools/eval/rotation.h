/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  rotation.h
 * @brief Rotations in double precision, for judging what the integer library did. Quaternions are Hamilton's, w first.
 *
 * On purpose not the library's own arithmetic: what measures an error must not share it.
 */
#ifndef EVL_ROTATION_H
#define EVL_ROTATION_H

#define EVL_DEG_PER_RAD 57.29577951308232

typedef struct {
    double w, x, y, z;
} evl_quat_t;

typedef struct {
    double x, y, z;
} evl_vec3_t;

static inline evl_quat_t evl_quat(const double wxyz[4])
{
    const evl_quat_t q = {wxyz[0], wxyz[1], wxyz[2], wxyz[3]};
    return q;
}
static inline evl_quat_t evl_quat_identity(void)
{
    const evl_quat_t q = {1.0, 0.0, 0.0, 0.0};
    return q;
}
static inline evl_quat_t evl_quat_conj(evl_quat_t q)
{
    const evl_quat_t c = {q.w, -q.x, -q.y, -q.z};
    return c;
}

evl_quat_t evl_quat_mul(evl_quat_t a, evl_quat_t b);
evl_quat_t evl_quat_unit(evl_quat_t q);
evl_vec3_t evl_quat_rotate(evl_quat_t q, evl_vec3_t v);

/** Angle of the rotation, [0, pi] rad; exact near 0 too, where 2 acos|w| loses half the digits. */
double evl_quat_angle(evl_quat_t q);

/** The shorter way from a (s = 0) to b (s = 1). */
evl_quat_t evl_quat_slerp(evl_quat_t a, evl_quat_t b, double s);

/** Rotation vector of the shorter rotation, and back. */
evl_vec3_t evl_quat_log(evl_quat_t q);
evl_quat_t evl_quat_exp(evl_vec3_t r);

/** Angle between two vectors, [0, pi] rad, without the loss of acos near 0; NaN when one is zero. */
double evl_angle_between(evl_vec3_t a, evl_vec3_t b);

static inline double evl_dot(evl_vec3_t a, evl_vec3_t b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
evl_vec3_t evl_cross(evl_vec3_t a, evl_vec3_t b);
double evl_norm(evl_vec3_t v);

#endif
