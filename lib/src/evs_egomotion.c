/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_egomotion_private.h"

#define PI_Q28        INT32_C(843314857)
#define SIGMA_MAX_Q28 (INT32_C(1) << 28) /* 1 rad: beyond that a linear model says nothing */

enum {
    WIDE_STEPS = 2,   /* from the hypothesis to where the noise can be judged */
    NARROW_STEPS = 4, /* the noise is judged again after two of them */
    SCALE_MIN = 20,   /* steps: 2 % of the median flow, what 16 bits resolve without loss */
    SCALE_MAX = 1 << EGO_MEDIAN_BITS,
    SCALE_WIDE = SCALE_MAX / 2,
    INLIER_LIMIT_MIN = 8 /* steps: the rounding of what is free of noise */
};

evs_egomotion_config_t evs_egomotion_config_default(void)
{
    const evs_egomotion_config_t cfg = {.method = EVS_EGOMOTION_ROBUST,
                                        .flow_kind = EVS_EGOMOTION_FULL_FLOW,
                                        .rotation_sigma_rad_q28 = 0,
                                        .variance_factor_q8 = 256u};
    return cfg;
}

static bool config_ok(const evs_egomotion_config_t *cfg)
{
    return (cfg->method == EVS_EGOMOTION_ROBUST) && (cfg->flow_kind == EVS_EGOMOTION_FULL_FLOW) &&
           (cfg->rotation_sigma_rad_q28 == 0) && (cfg->variance_factor_q8 >= 256u);
}

bool evs_egomotion_is_inlier(const evs_egomotion_result_t *result, const evs_egomotion_flow_t *flow)
{
    ego_vector_t p;
    EVS_ASSERT((result != NULL) && (flow != NULL));
    if ((result->n_flow == 0u) || !ego_pack_one(result, flow, &p)) { return false; }
    const ego_set_t set = {.one_bits = 13u - result->position_shift_};
    return ego_agrees(&p, ego_dir(&set, result->v_q30), result->inlier_limit_);
}

/* --- judging ---------------------------------------------------------------------------------------------------- */

/* Probability, Q16, that a vector of this length and of random direction ends within `limit` of a given line on the given
 * side: asin(limit / length) / pi, here by x (1 + x^2 / 2) / pi. */
static uint32_t by_chance_q16(uint32_t length, uint32_t limit)
{
    if (length <= limit) { return 32768u; }
    const uint32_t x_q15 = (limit << 15) / length;
    const uint32_t x3_q15 = (((x_q15 * x_q15) >> 15) * x_q15) >> 16; /* x^3 / 2 */
    return ((x_q15 + x3_q15) * 20861u) >> 15;                        /* 20861 = 2^16 / pi */
}

/* Whether n is no more than the mean by k of its standard deviations, as far as these are the root of the mean. */
static bool within(uint64_t n, uint64_t mean_q16, uint32_t k)
{
    return (n << 16) <= mean_q16 + (uint64_t)k * 256u * evs_sqrt_u64(mean_q16);
}

/* Count the vectors that agree, and ask whether they are enough, more than chance would give, and of one sign. */
static void judge_count(const ego_set_t *set, evs_egomotion_result_t *result)
{
    const ego_dir_t dir = ego_dir(set, result->v_q30);
    const uint32_t limit = result->inlier_limit_;
    uint64_t chance_q16 = 0u;
    uint32_t n_against = 0u;
    for (uint32_t i = 0u; i < set->n; i++) {
        const ego_vector_t *const p = &set->vec[i];
        const ego_vector_t back = {p->x, p->y, (int16_t)-p->u, (int16_t)-p->v};
        result->n_inliers += ego_agrees(p, dir, limit) ? 1u : 0u;
        n_against += ego_agrees(&back, dir, limit) ? 1u : 0u;
        chance_q16 += by_chance_q16(evs_sqrt_u64((uint64_t)((int32_t)p->u * p->u + (int32_t)p->v * p->v)), limit);
    }
    if (result->n_inliers < EVS_EGOMOTION_INLIERS_MIN) { result->flags |= EVS_EGOMOTION_FEW; }
    if (within(result->n_inliers, chance_q16, 4u)) { result->flags |= EVS_EGOMOTION_CHANCE; }
    const uint64_t half_q16 = (uint64_t)(result->n_inliers + n_against) << 15;
    if (within(result->n_inliers, half_q16, 3u)) { result->flags |= EVS_EGOMOTION_SIGN_UNSURE; }
}

/* Covariance of the tangent plane in rad^2 to the camera's axes, and sigma. */
static void put_covariance(const ego_frame_t *f, const evs_scaled_t cov[3], evs_egomotion_result_t *result)
{
    const evs_scaled_t sigma = evs_scaled_sqrt(evs_scaled_add(cov[0], cov[2]));
    const int32_t sigma_q28 = evs_scaled_to_q(sigma, 28);
    if (sigma_q28 > SIGMA_MAX_Q28) {
        result->flags |= EVS_EGOMOTION_DEGENERATE;
        return;
    }
    result->sigma_rad_q28 = sigma_q28;
    const int32_t b0[3] = {f->b0.x, f->b0.y, f->b0.z};
    const int32_t b1[3] = {f->b1.x, f->b1.y, f->b1.z};
    const int32_t c00 = evs_scaled_to_q(cov[0], 30);
    const int32_t c01 = evs_scaled_to_q(cov[1], 30);
    const int32_t c11 = evs_scaled_to_q(cov[2], 30);
    unsigned at = 0u;
    for (unsigned i = 0u; i < 3u; i++) {
        const int64_t t0 = evs_shr_r64((int64_t)c00 * b0[i] + (int64_t)c01 * b1[i], 30u);
        const int64_t t1 = evs_shr_r64((int64_t)c01 * b0[i] + (int64_t)c11 * b1[i], 30u);
        for (unsigned j = i; j < 3u; j++) {
            result->covariance_rad2_q30[at++] = evs_sat32(evs_shr_r64(t0 * b0[j] + t1 * b1[j], 30u));
        }
    }
}

/* --- the robust estimate ---------------------------------------------------------------------------------------- */

static uint32_t kernel_scale(uint32_t noise)
{
    return (uint32_t)evs_clamp((int32_t)(2u * noise), SCALE_MIN, SCALE_MAX);
}

static void solve_robust(const evs_egomotion_config_t *cfg, const ego_set_t *set, evs_egomotion_result_t *result)
{
    evs_vec3_t v = ego_search(set);
    for (int i = 0; i < WIDE_STEPS; i++) { (void)ego_step(set, SCALE_WIDE, 1u, &v); }
    uint32_t s = SCALE_WIDE;
    for (int i = 0; i < NARROW_STEPS; i++) {
        if ((i & 1) == 0) { s = kernel_scale(ego_noise(set, v)); }
        (void)ego_step(set, s, 1u, &v);
    }
    const uint32_t noise = ego_noise(set, v);
    result->v_q30 = v;
    result->noise_q24 = ego_steps_to_q24(result, noise);
    result->inlier_limit_ = (uint16_t)evs_clamp((int32_t)(noise * 5u / 2u), INLIER_LIMIT_MIN, 2 * EGO_CLIP);
    judge_count(set, result);

    const ego_frame_t f = ego_frame(v);
    evs_scaled_t cov[3];
    if (ego_covariance(set, &f, s, cov)) {
        for (int i = 0; i < 3; i++) { cov[i] = evs_scaled_mul(cov[i], evs_scaled(cfg->variance_factor_q8, -8)); }
        put_covariance(&f, cov, result);
    } else {
        result->flags |= EVS_EGOMOTION_DEGENERATE;
    }
}

/* --- the call --------------------------------------------------------------------------------------------------- */

evs_status_t evs_egomotion_solve(const evs_egomotion_config_t *cfg, const evs_egomotion_flow_t *flow, size_t n,
                                 void *scratch, size_t n_scratch, evs_egomotion_result_t *result)
{
    if ((cfg == NULL) || (result == NULL) || (((flow == NULL) || (scratch == NULL)) && (n > 0u))) {
        return EVS_ERR_NULL;
    }
    if (!config_ok(cfg)) { return EVS_ERR_ARG; }
    if ((n > EVS_EGOMOTION_N_MAX) || (n_scratch < EVS_EGOMOTION_BYTES(n)) || (((uintptr_t)scratch & 3u) != 0u)) {
        return EVS_ERR_SIZE;
    }
    ego_set_t set = {.vec = scratch, .key = (uint16_t *)((ego_vector_t *)scratch + n), .n = 0u, .one_bits = 13u};
    evs_egomotion_result_t r = {.v_q30 = {0, 0, EVS_ONE_Q30}, .sigma_rad_q28 = PI_Q28};
    ego_pack(&set, flow, n, &r);
    if (set.n == 0u) {
        r.flags = EVS_EGOMOTION_FEW | EVS_EGOMOTION_STILL;
    } else {
        solve_robust(cfg, &set, &r);
    }
    if (r.flags == 0u) {
        r.flags = EVS_EGOMOTION_VALID;
    } else {
        r.sigma_rad_q28 = PI_Q28;
        for (int i = 0; i < 6; i++) { r.covariance_rad2_q30[i] = 0; }
    }
    *result = r;
    return EVS_OK;
}
