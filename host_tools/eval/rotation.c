/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "rotation.h"

#include <math.h>

/* Below this half angle sin(x)/x is 1 in a double. */
#define TINY_RAD 1e-9

evl_quat_t evl_quat_mul(evl_quat_t a, evl_quat_t b)
{
    const evl_quat_t q = {
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
    };
    return q;
}

static double vector_norm(evl_quat_t q) { return sqrt(q.x * q.x + q.y * q.y + q.z * q.z); }

evl_quat_t evl_quat_unit(evl_quat_t q)
{
    const double n = sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
    const evl_quat_t u = {q.w / n, q.x / n, q.y / n, q.z / n};
    return u;
}

evl_vec3_t evl_cross(evl_vec3_t a, evl_vec3_t b)
{
    const evl_vec3_t c = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    return c;
}

double evl_norm(evl_vec3_t v) { return sqrt(evl_dot(v, v)); }

evl_vec3_t evl_quat_rotate(evl_quat_t q, evl_vec3_t v)
{
    const evl_quat_t p = {0.0, v.x, v.y, v.z};
    const evl_quat_t r = evl_quat_mul(evl_quat_mul(q, p), evl_quat_conj(q));
    const evl_vec3_t out = {r.x, r.y, r.z};
    return out;
}

double evl_quat_angle(evl_quat_t q) { return 2.0 * atan2(vector_norm(q), fabs(q.w)); }

evl_vec3_t evl_quat_log(evl_quat_t q)
{
    const double s = vector_norm(q);
    const double sign = (q.w < 0.0) ? -1.0 : 1.0;
    const double k = sign * ((s > TINY_RAD) ? 2.0 * atan2(s, fabs(q.w)) / s : 2.0);
    const evl_vec3_t r = {k * q.x, k * q.y, k * q.z};
    return r;
}

evl_quat_t evl_quat_exp(evl_vec3_t r)
{
    const double half = 0.5 * evl_norm(r);
    const double k = (half > TINY_RAD) ? 0.5 * sin(half) / half : 0.5;
    const evl_quat_t q = {cos(half), k * r.x, k * r.y, k * r.z};
    return q;
}

evl_quat_t evl_quat_slerp(evl_quat_t a, evl_quat_t b, double s)
{
    const evl_vec3_t r = evl_quat_log(evl_quat_mul(evl_quat_conj(a), b));
    const evl_vec3_t part = {s * r.x, s * r.y, s * r.z};
    return evl_quat_mul(a, evl_quat_exp(part));
}

double evl_angle_between(evl_vec3_t a, evl_vec3_t b)
{
    const double across = evl_norm(evl_cross(a, b));
    const double along = evl_dot(a, b);
    if (!(evl_norm(a) > 0.0) || !(evl_norm(b) > 0.0)) { return (double)NAN; }
    return atan2(across, along);
}
