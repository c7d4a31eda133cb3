/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs_egomotion_private.h
 * @brief Private: what the parts of the ego-motion solver share.
 *
 * Formats. Positions (x, y, 1) are int16 with 1 = 2^(one_bits + 1); products with a unit vector in Q14, divided by 2^15, have
 * one_bits fractional bits. With one_bits = 13, 12, 11 positions reach 2, 4, 8, and each such product fits an int16.
 * Flow is int16 in steps of which the median length has 2^10; longer than 8 medians is shortened to that, so that an
 * outlier does not eat the bits of the others.
 *
 * Names, for a direction V: a = (x Vz - Vx, y Vz - Vy), the direction of the flow; c = u ay - v ax and d = u ax + v ay, its
 * components across and along, times |a|; r = c / |a| is the residual, d / |a|^2 the inverse depth rho.
 */
#ifndef EVS_EGOMOTION_PRIVATE_H
#define EVS_EGOMOTION_PRIVATE_H

#include "evs/egomotion.h"
#include "evs_scaled.h"

enum {
    EGO_MEDIAN_BITS = 10, /* median flow length: 2^10 steps */
    EGO_CLIP = 8 << EGO_MEDIAN_BITS,
    EGO_SUBSET = 128, /* vectors that the search looks at */
    EGO_INV_BITS = 14 /* of 1 / |a|^2 */
};

typedef struct {
    int16_t x;
    int16_t y;
    int16_t u;
    int16_t v;
} ego_vector_t;

/* The vectors of one call, packed, and what is told of all of them. */
typedef struct {
    ego_vector_t *vec;
    uint16_t *key; /* one per vector: room for what is to be ordered */
    uint32_t n;
    unsigned one_bits;
} ego_set_t;

/* A unit vector and two that complete it to a right-handed frame: b0 x b1 = v. Q30. */
typedef struct {
    evs_vec3_t v;
    evs_vec3_t b0;
    evs_vec3_t b1;
} ego_frame_t;

/* A direction ready for the inner loops: x and y are multiplied by "one". */
typedef struct {
    int32_t x;
    int32_t y;
    int32_t z;
} ego_dir_t;

/* What a vector shows under a direction. */
typedef struct {
    int32_t ax;
    int32_t ay;
    int32_t c;
    int32_t d;
    uint32_t a2;
} ego_view_t;

static inline int32_t ego_q14(int32_t q30) { return evs_shr_r(q30, 16u); }

static inline ego_dir_t ego_dir(const ego_set_t *set, evs_vec3_t v_q30)
{
    const int32_t one = INT32_C(2) << set->one_bits;
    const ego_dir_t dir = {ego_q14(v_q30.x) * one, ego_q14(v_q30.y) * one, ego_q14(v_q30.z)};
    return dir;
}

/* |c|, |d| < 2^28.5; a2 < 2^30. */
static inline ego_view_t ego_view(const ego_vector_t *p, ego_dir_t dir)
{
    ego_view_t w;
    w.ax = (p->x * dir.z - dir.x) >> 15;
    w.ay = (p->y * dir.z - dir.y) >> 15;
    w.c = p->u * w.ay - p->v * w.ax;
    w.d = p->u * w.ax + p->v * w.ay;
    w.a2 = (uint32_t)(w.ax * w.ax + w.ay * w.ay);
    return w;
}

/* Closer to the focus of expansion than 1/32 a vector says too little and would overflow what follows. */
static inline bool ego_near_focus(const ego_set_t *set, const ego_view_t *w)
{
    return w->a2 < (UINT32_C(1) << (2u * set->one_bits - 10u));
}

/* 1 / |a|^2 with EGO_INV_BITS; at most 2^24 unless near the focus. */
static inline uint32_t ego_inv_a2(const ego_set_t *set, uint32_t a2)
{
    return UINT32_MAX / (a2 >> (2u * set->one_bits - 18u));
}

/* A squared scale, for weights: s2 = (s / 2^e)^2 in Q28 with s in [2^e, 2^(e+1)), and the shift that makes c alike. */
typedef struct {
    uint32_t s2_q28;
    unsigned shift;
} ego_scale_t;

ego_scale_t ego_scale(uint32_t s); /* s in steps, [16, 2^13] */

/* s^2 / (s^2 + r^2) in Q15, from c = r |a|. The weight of Geman and McClure is its square. */
static inline uint32_t ego_share_q15(ego_scale_t scale, const ego_view_t *w)
{
    const uint32_t c = evs_abs_u32(w->c) >> scale.shift;
    const uint32_t c_sat = (c < 60000u) ? c : 60000u;
    const uint32_t k = evs_mul_hi_u(w->a2, scale.s2_q28);
    const uint32_t sum = k + c_sat * c_sat + 1u;
    const unsigned up = evs_clz32(sum);
    return (k << up) / ((sum << up) >> 15);
}

static inline int32_t ego_clip16(int64_t x)
{
    if (x > INT16_MAX) { return INT16_MAX; }
    return (x < INT16_MIN) ? INT16_MIN : (int32_t)x;
}

/* --- evs_egomotion_pack.c --- */

/* Count, scale and pack the vectors; fills the counts, the median and the private members of the result. */
void ego_pack(ego_set_t *set, const evs_egomotion_flow_t *flow, size_t n, evs_egomotion_result_t *result);
/* Pack one vector as ego_pack() did; false where it was left out. */
bool ego_pack_one(const evs_egomotion_result_t *scale, const evs_egomotion_flow_t *flow, ego_vector_t *packed);
/* Steps to K^-1 px, Q24. */
uint32_t ego_steps_to_q24(const evs_egomotion_result_t *scale, uint32_t steps);
/* A 16-bit key in the order of x; relative resolution 2^-10. And the middle of the values with that key. */
uint16_t ego_key(uint64_t x);
uint64_t ego_key_value(uint16_t key);
/* The k-th smallest of n keys, k from 0. */
uint16_t ego_select(const uint16_t *key, uint32_t n, uint32_t k);

/* --- evs_egomotion_search.c --- */

/* The best of the signed hypotheses. */
evs_vec3_t ego_search(const ego_set_t *set);

/* --- evs_egomotion_refine.c --- */

ego_frame_t ego_frame(evs_vec3_t v_q30);
/* Move along the tangent plane by (d0, d1), at most half a radian, and normalize. */
evs_vec3_t ego_move(const ego_frame_t *f, evs_scaled_t d0, evs_scaled_t d1);
/* A Gauss-Newton step with Geman-McClure weights of scale s on every stride-th vector; false: no step was possible. */
bool ego_step(const ego_set_t *set, uint32_t s, uint32_t stride, evs_vec3_t *v_q30);
/* Robust 1 sigma of the residuals in steps. */
uint32_t ego_noise(const ego_set_t *set, evs_vec3_t v_q30);
/* Whether r is within limit steps and d positive. */
bool ego_agrees(const ego_vector_t *p, ego_dir_t dir, uint32_t limit);
/* Sandwich covariance of v under the kernel of scale s: the sum is in the tangent plane 00, 01, 11, rad^2.
 * False: not positive definite. */
bool ego_covariance(const ego_set_t *set, const ego_frame_t *f, uint32_t s, evs_scaled_t cov[3]);

#endif
