/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/vec.h
 * @brief Vectors, unit quaternions and rotation matrices in fixed point.
 *
 * Model    Quaternions are Hamilton's, w first; q_ab rotates vectors of frame b into frame a, and q_ac = q_ab q_bc.
 *          q and -q are the same rotation; functions keep the sign that the formula gives unless they say otherwise.
 * Memory   none; the functions are pure.
 * Cost     product 16 multiplications; exponential about 15, and a product per halving beyond 1 rad; logarithm one
 *          root, one atan2, one reciprocal. evs_quat_rate() divides (64 bits): it is not for the hot path.
 * Numeric  integers only, bit-exact on every target. Quaternions and matrices Q30, vectors in any Q that the caller
 *          keeps track of. Rounds to nearest, halves up. Errors: tests/unit/test_vec.c.
 * Threads  no state.
 */
#ifndef EVS_VEC_H
#define EVS_VEC_H

#include "evs/fixed.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A vector; the number of fractional bits is part of the name of what holds it. */
typedef struct {
    int32_t x;
    int32_t y;
    int32_t z;
} evs_vec3_t;

/** A unit quaternion in Q30. */
typedef struct {
    int32_t w;
    int32_t x;
    int32_t y;
    int32_t z;
} evs_quat_t;

/** A rotation matrix in Q30, m[row][column]. */
typedef struct {
    int32_t m[3][3];
} evs_mat3_t;

#define EVS_ONE_Q30 INT32_C(0x40000000)

static inline evs_quat_t evs_quat_identity(void)
{
    const evs_quat_t q = {EVS_ONE_Q30, 0, 0, 0};
    return q;
}

/* --- vectors --------------------------------------------------------------------------------------------------- */

/** Sum, saturating. */
static inline evs_vec3_t evs_vec3_add(evs_vec3_t a, evs_vec3_t b)
{
    const evs_vec3_t sum = {evs_add_sat(a.x, b.x), evs_add_sat(a.y, b.y), evs_add_sat(a.z, b.z)};
    return sum;
}

/** Difference, saturating. */
static inline evs_vec3_t evs_vec3_sub(evs_vec3_t a, evs_vec3_t b)
{
    const evs_vec3_t diff = {evs_sub_sat(a.x, b.x), evs_sub_sat(a.y, b.y), evs_sub_sat(a.z, b.z)};
    return diff;
}

/** Every component times factor / 2^n, rounded, saturating. n in [1, 62]. */
static inline evs_vec3_t evs_vec3_scale(evs_vec3_t v, int32_t factor, unsigned n)
{
    const evs_vec3_t scaled = {evs_q_mul_sat(v.x, factor, n), evs_q_mul_sat(v.y, factor, n),
                               evs_q_mul_sat(v.z, factor, n)};
    return scaled;
}

/** Sum of squares; its Q is twice that of v. At most 3 * 2^62. */
static inline uint64_t evs_vec3_norm_sq(evs_vec3_t v)
{
    return (uint64_t)((int64_t)v.x * v.x) + (uint64_t)((int64_t)v.y * v.y) + (uint64_t)((int64_t)v.z * v.z);
}

/** a x b / 2^n, rounded, saturating. n in [1, 62]; components up to 2^30 in magnitude. */
evs_vec3_t evs_vec3_cross(evs_vec3_t a, evs_vec3_t b, unsigned n);

/**
 * Unit vector of v in Q30; error of each component <= 2^-28.
 * @return EVS_OK, or EVS_ERR_NUMERIC for the zero vector (unit untouched).
 */
EVS_NODISCARD evs_status_t evs_vec3_normalize(evs_vec3_t v, evs_vec3_t *unit_q30);

/* --- quaternions ----------------------------------------------------------------------------------------------- */

static inline evs_quat_t evs_quat_conj(evs_quat_t q)
{
    const evs_quat_t c = {q.w, evs_sub_sat(0, q.x), evs_sub_sat(0, q.y), evs_sub_sat(0, q.z)};
    return c;
}

/** Hamilton product a b of unit quaternions. Not renormalized: rounding adds at most 2^-31 per component. */
evs_quat_t evs_quat_mul(evs_quat_t a, evs_quat_t b);

/**
 * Bring q (of any length) to unit length; error of each component <= 2^-28.
 * @return EVS_OK, or EVS_ERR_NUMERIC when all components are zero (unit untouched).
 */
EVS_NODISCARD evs_status_t evs_quat_normalize(evs_quat_t q, evs_quat_t *unit);

/** Rotate v by the unit quaternion q. Components of v up to 2^29 in magnitude. */
evs_vec3_t evs_quat_rotate(evs_quat_t q, evs_vec3_t v);

/** exp: the rotation by the vector r (axis times angle, rad in Q28, components in [-8, 8)). */
evs_quat_t evs_quat_from_rotvec(evs_vec3_t r_rad_q28);

/** log: the rotation vector of the unit quaternion q, of length <= pi, rad in Q28. Error <= 2e-8 rad. */
evs_vec3_t evs_quat_to_rotvec(evs_quat_t q);

/**
 * Constant rate, seen in the rotating frame, that leads from q_a to q_b in dt_us: log(q_a^-1 q_b) / dt.
 * @param[out] rate_rad_s_q24  Saturates at 128 rad/s.
 * @return EVS_OK, or EVS_ERR_ARG when dt_us is not in [1, 10^7] (rate untouched).
 */
EVS_NODISCARD evs_status_t evs_quat_rate(evs_quat_t q_a, evs_quat_t q_b, int32_t dt_us, evs_vec3_t *rate_rad_s_q24);

/** The rotation vector, rad in Q28, of a rate held for t_us in [0, 10^6]: rate * t, saturating. */
evs_vec3_t evs_rotvec_of_rate(evs_vec3_t rate_rad_s_q24, int32_t t_us);

/* --- matrices -------------------------------------------------------------------------------------------------- */

/** The matrix of the unit quaternion q; error of each entry <= 2^-28. */
evs_mat3_t evs_quat_to_mat3(evs_quat_t q);

/** m v, rounded, saturating. Entries of m up to 2^30 in magnitude. */
evs_vec3_t evs_mat3_apply(const evs_mat3_t *m, evs_vec3_t v);

#ifdef __cplusplus
}
#endif
#endif
