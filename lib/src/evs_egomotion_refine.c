/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Gauss-Newton on the residual across the flow direction, in the tangent plane of v, and what is known of its result. */
#include "evs_egomotion_private.h"

/* --- frames ----------------------------------------------------------------------------------------------------- */

static evs_vec3_t unit_or(evs_vec3_t v, evs_vec3_t otherwise)
{
    evs_vec3_t unit = otherwise;
    return (evs_vec3_normalize(v, &unit) == EVS_OK) ? unit : otherwise;
}

ego_frame_t ego_frame(evs_vec3_t v)
{
    const uint32_t x = evs_abs_u32(v.x);
    const uint32_t y = evs_abs_u32(v.y);
    const uint32_t z = evs_abs_u32(v.z);
    const bool x_least = (x <= y) && (x <= z);
    const bool y_least = !x_least && (y <= z);
    const evs_vec3_t axis = {x_least ? EVS_ONE_Q30 : 0, y_least ? EVS_ONE_Q30 : 0,
                             (!x_least && !y_least) ? EVS_ONE_Q30 : 0};
    ego_frame_t f;
    f.v = v;
    f.b0 = unit_or(evs_vec3_cross(v, axis, 30u), axis);
    f.b1 = evs_vec3_cross(v, f.b0, 30u);
    return f;
}

/* Half a radian at most, Q30: far steps of a linear model mean nothing. */
#define STEP_MAX_Q30 (INT32_C(1) << 29)

evs_vec3_t ego_move(const ego_frame_t *f, evs_scaled_t d0, evs_scaled_t d1)
{
    const int32_t s0 = evs_clamp(evs_scaled_to_q(d0, 30), -STEP_MAX_Q30, STEP_MAX_Q30) / 2; /* halves: the sum below */
    const int32_t s1 = evs_clamp(evs_scaled_to_q(d1, 30), -STEP_MAX_Q30, STEP_MAX_Q30) / 2; /* stays under 2^31 */
    const evs_vec3_t moved = {f->v.x / 2 + evs_q_mul(f->b0.x, s0, 30u) + evs_q_mul(f->b1.x, s1, 30u),
                              f->v.y / 2 + evs_q_mul(f->b0.y, s0, 30u) + evs_q_mul(f->b1.y, s1, 30u),
                              f->v.z / 2 + evs_q_mul(f->b0.z, s0, 30u) + evs_q_mul(f->b1.z, s1, 30u)};
    return unit_or(moved, f->v);
}

/* --- residuals -------------------------------------------------------------------------------------------------- */

ego_scale_t ego_scale(uint32_t s)
{
    const unsigned e = 31u - evs_clz32(s);
    const ego_scale_t scale = {(s * s) << (28u - 2u * e), e + 2u};
    return scale;
}

/* How a vector's residual r depends on a step (d0, d1): |a| dr = j0 d0 + j1 d1, in steps. And r / |a| in 1/16 steps. */
typedef struct {
    int32_t j0; /* |j| < 2^18 */
    int32_t j1;
    int32_t r_per_a_q4; /* below 2^30 */
} slope_t;

static slope_t slope(const ego_set_t *set, const ego_vector_t *p, const ego_view_t *w, uint32_t inv, ego_dir_t b0,
                     ego_dir_t b1)
{
    const unsigned shift = EGO_INV_BITS + set->one_bits;
    const int32_t rho = ego_clip16(((int64_t)w->d * (int64_t)inv) >> shift);
    const int32_t p0 = (p->x * b0.x + p->y * b0.y + b0.z) >> 15;
    const int32_t p1 = (p->x * b1.x + p->y * b1.y + b1.z) >> 15;
    slope_t s;
    s.r_per_a_q4 = (int32_t)(((int64_t)w->c * (int64_t)inv) >> (shift - 4u)); /* |c| < 2^28.5, inv <= 2^24: < 2^30 */
    s.j0 = (rho * p1) >> set->one_bits;
    s.j1 = -((rho * p0) >> set->one_bits);
    return s;
}

/* A direction whose product with (x, y, 1) is wanted: here z, not x and y, is multiplied by "one". */
static ego_dir_t plane_dir(const ego_set_t *set, evs_vec3_t b_q30)
{
    const ego_dir_t dir = {ego_q14(b_q30.x), ego_q14(b_q30.y), ego_q14(b_q30.z) * (INT32_C(2) << set->one_bits)};
    return dir;
}

/* --- steps ------------------------------------------------------------------------------------------------------ */

bool ego_step(const ego_set_t *set, uint32_t s, uint32_t stride, evs_vec3_t *v_q30)
{
    const ego_frame_t f = ego_frame(*v_q30);
    const ego_dir_t dir = ego_dir(set, f.v);
    const ego_dir_t b0 = plane_dir(set, f.b0);
    const ego_dir_t b1 = plane_dir(set, f.b1);
    const ego_scale_t scale = ego_scale(s);
    int64_t h00 = 0, h01 = 0, h11 = 0, g0 = 0, g1 = 0;
    for (uint32_t i = 0u; i < set->n; i += stride) {
        const ego_vector_t *const p = &set->vec[i];
        const ego_view_t w = ego_view(p, dir);
        if ((w.d <= 0) || ego_near_focus(set, &w)) { continue; }
        const uint32_t share = ego_share_q15(scale, &w);
        const uint32_t weight = (share * share) >> 15;
        const uint32_t inv = ego_inv_a2(set, w.a2);
        const slope_t j = slope(set, p, &w, inv, b0, b1);
        const int64_t weight_inv = (int64_t)(((uint64_t)weight * inv) >> 15);
        const int32_t k0 = (int32_t)((weight_inv * j.j0) >> EGO_INV_BITS); /* |j| < 2^18, weight_inv <= 2^24 */
        const int32_t k1 = (int32_t)((weight_inv * j.j1) >> EGO_INV_BITS);
        const int32_t wr_q4 = (int32_t)evs_shr_r64((int64_t)weight * j.r_per_a_q4, 15u);
        h00 += (int64_t)k0 * j.j0;
        h01 += (int64_t)k0 * j.j1;
        h11 += (int64_t)k1 * j.j1;
        g0 += (int64_t)wr_q4 * j.j0;
        g1 += (int64_t)wr_q4 * j.j1;
    }
    evs_scaled_t h[3] = {evs_scaled(h00, 0), evs_scaled(h01, 0), evs_scaled(h11, 0)};
    evs_scaled_t step[2] = {evs_scaled(-g0, -4), evs_scaled(-g1, -4)};
    if (!evs_scaled_solve(h, step, 2u)) { return false; }
    *v_q30 = ego_move(&f, step[0], step[1]);
    return true;
}

uint32_t ego_noise(const ego_set_t *set, evs_vec3_t v_q30)
{
    const ego_dir_t dir = ego_dir(set, v_q30);
    const unsigned shift = EGO_INV_BITS + set->one_bits - 4u; /* r / |a| in 1/16 steps */
    uint32_t m = 0u;
    for (uint32_t i = 0u; i < set->n; i++) {
        const ego_view_t w = ego_view(&set->vec[i], dir);
        if (ego_near_focus(set, &w)) { continue; }
        const int64_t r_per_a = ((int64_t)w.c * (int64_t)ego_inv_a2(set, w.a2)) >> shift; /* |.| < 2^30 */
        set->key[m++] = ego_key((uint64_t)(w.c * r_per_a) >> set->one_bits);              /* 16 r^2 */
    }
    if (m == 0u) { return EGO_CLIP; }
    /* The lower quartile instead of the median: |r| of a normal distribution lies below 0.3186 sigma for a quarter. With half
     * of the vectors outliers it still falls among the good ones. 3.1383 = 1 / 0.3186, and 4 = sqrt(16). */
    const uint64_t r2_q4 = ego_key_value(ego_select(set->key, m, m / 4u));
    return (uint32_t)(((uint64_t)evs_sqrt_u64(r2_q4 << 16) * 205672u) >> 26);
}

bool ego_agrees(const ego_vector_t *p, ego_dir_t dir, uint32_t limit)
{
    const ego_view_t w = ego_view(p, dir);
    if (w.d <= 0) { return false; }
    const uint64_t c2 = (uint64_t)((int64_t)w.c * w.c);
    return c2 <= (uint64_t)w.a2 * limit * limit;
}

/* --- covariance ------------------------------------------------------------------------------------------------- */

static int64_t gradient(int32_t wr_q4, int32_t j) /* in 4 steps^2; with the limit 2^16 squares of it fit 64 bits */
{
    const int64_t z = ((int64_t)wr_q4 * j) >> 6;
    const int64_t limit = INT64_C(1) << 23;
    return (z > limit) ? limit : ((z < -limit) ? -limit : z);
}

bool ego_covariance(const ego_set_t *set, const ego_frame_t *f, uint32_t s, evs_scaled_t cov[3])
{
    const ego_dir_t dir = ego_dir(set, f->v);
    const ego_dir_t b0 = plane_dir(set, f->b0);
    const ego_dir_t b1 = plane_dir(set, f->b1);
    const ego_scale_t scale = ego_scale(s);
    int64_t h00 = 0, h01 = 0, h11 = 0; /* sum of w J J': the Hessian of Gauss-Newton */
    int64_t m00 = 0, m01 = 0, m11 = 0; /* sum of w^2 r^2 J J': the variance of the gradient */
    int64_t curvature = 0;             /* sum of psi' J'J: how much flatter the cost really is */
    for (uint32_t i = 0u; i < set->n; i++) {
        const ego_vector_t *const p = &set->vec[i];
        const ego_view_t w = ego_view(p, dir);
        if ((w.d <= 0) || ego_near_focus(set, &w)) { continue; }
        const int32_t share = (int32_t)ego_share_q15(scale, &w);
        const int32_t weight = (share * share) >> 15;
        const int32_t bend = (weight * ((4 * share - 3 * 32768) / 4)) >> 13; /* psi' = q^2 (4 q - 3) */
        const uint32_t inv = ego_inv_a2(set, w.a2);
        const slope_t j = slope(set, p, &w, inv, b0, b1);
        const int32_t i0 = (int32_t)(((int64_t)inv * j.j0) >> EGO_INV_BITS);
        const int32_t i1 = (int32_t)(((int64_t)inv * j.j1) >> EGO_INV_BITS);
        const int64_t jj00 = (int64_t)i0 * j.j0; /* < 2^45 */
        const int64_t jj11 = (int64_t)i1 * j.j1;
        h00 += (jj00 * weight) >> 15;
        h01 += ((int64_t)i0 * j.j1 * weight) >> 15;
        h11 += (jj11 * weight) >> 15;
        curvature += ((jj00 + jj11) * bend) >> 15;
        const int32_t wr_q4 = (int32_t)evs_shr_r64((int64_t)weight * j.r_per_a_q4, 15u);
        const int64_t z0 = gradient(wr_q4, j.j0);
        const int64_t z1 = gradient(wr_q4, j.j1);
        m00 += z0 * z0;
        m01 += z0 * z1;
        m11 += z1 * z1;
    }
    const evs_scaled_t a = evs_scaled(h00, 0);
    const evs_scaled_t b = evs_scaled(h01, 0);
    const evs_scaled_t c = evs_scaled(h11, 0);
    const evs_scaled_t ac = evs_scaled_mul(a, c);
    const evs_scaled_t det = evs_scaled_sub(ac, evs_scaled_mul(b, b));
    const evs_scaled_t least = {ac.m, ac.e - 20};
    if ((a.m <= 0) || (c.m <= 0) || evs_scaled_less(det, least) || (curvature <= 0)) { return false; }

    /* cov = H^-1 M H^-1 / kappa^2, kappa being the trace of the true Hessian over that of H: the true one by itself need
     * not be positive, and its inverse would be noise. */
    const evs_scaled_t kappa = evs_scaled_div(evs_scaled(curvature, 0), evs_scaled(h00 + h11, 0));
    const evs_scaled_t den = evs_scaled_mul(det, kappa);
    const evs_scaled_t i00 = evs_scaled_div(c, den);
    const evs_scaled_t i01 = evs_scaled_div(evs_scaled(-h01, 0), den);
    const evs_scaled_t i11 = evs_scaled_div(a, den);
    const evs_scaled_t n00 = evs_scaled(m00, 4);
    const evs_scaled_t n01 = evs_scaled(m01, 4);
    const evs_scaled_t n11 = evs_scaled(m11, 4);
    const evs_scaled_t t00 = evs_scaled_add(evs_scaled_mul(i00, n00), evs_scaled_mul(i01, n01)); /* I N */
    const evs_scaled_t t01 = evs_scaled_add(evs_scaled_mul(i00, n01), evs_scaled_mul(i01, n11));
    const evs_scaled_t t10 = evs_scaled_add(evs_scaled_mul(i01, n00), evs_scaled_mul(i11, n01));
    const evs_scaled_t t11 = evs_scaled_add(evs_scaled_mul(i01, n01), evs_scaled_mul(i11, n11));
    cov[0] = evs_scaled_add(evs_scaled_mul(t00, i00), evs_scaled_mul(t01, i01)); /* I N I */
    cov[1] = evs_scaled_add(evs_scaled_mul(t00, i01), evs_scaled_mul(t01, i11));
    cov[2] = evs_scaled_add(evs_scaled_mul(t10, i01), evs_scaled_mul(t11, i11));
    return true;
}
