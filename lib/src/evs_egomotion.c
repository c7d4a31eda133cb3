/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_egomotion_private.h"

#define ROTATION_SIGMA_MAX (INT32_C(1) << 28)
#define PI_Q28             INT32_C(843314857)
#define SIGMA_MAX_Q28      (INT32_C(1) << 28) /* 1 rad: beyond that a linear model says nothing */

enum {
    WIDE_STEPS = 2,   /* from the hypothesis to where the noise can be judged */
    NARROW_STEPS = 4, /* the noise is judged again after two of them */
    LONGER = 11,      /* eighths: weights fall off, so that a plain step is too short */
    SCALE_MIN = 20,   /* steps: 2 % of the median flow, what 16 bits resolve without loss */
    SCALE_MAX = 1 << EVS_EGO_MEDIAN_BITS,
    SCALE_WIDE = SCALE_MAX / 2,
    NOISE_VECTORS = 256, /* enough to choose a scale by */
    HALVES_Q8 = 37,      /* sigma is at least 1 / 2.6 of how far a half of the image is off, the square in 1/256 */
    INLIER_LIMIT_MIN = 8 /* steps: the rounding of what has no noise */
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
    const bool published = (cfg->method == EVS_EGOMOTION_PAPER) || (cfg->method == EVS_EGOMOTION_ERL);
    return ((cfg->method == EVS_EGOMOTION_ROBUST) || (published && (EVS_NO_PAPER == 0))) &&
           (cfg->flow_kind == EVS_EGOMOTION_FULL_FLOW) && (cfg->rotation_sigma_rad_q28 >= 0) &&
           (cfg->rotation_sigma_rad_q28 <= ROTATION_SIGMA_MAX) && (cfg->variance_factor_q8 >= 256u);
}

/* --- judging ---------------------------------------------------------------------------------------------------- */

/* Probability, Q16, that a vector of this length and of random direction ends within `limit` of a given line on the
 * given side: asin(limit / length) / pi, here by x (1 + x^2 / 2) / pi. */
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

/* How many steps a vector is long, to 7 %: good enough to guess at chance. */
static uint32_t about_length(const evs_ego_vector_t *p)
{
    const uint32_t u = evs_abs_u32(p->u);
    const uint32_t v = evs_abs_u32(p->v);
    return (u > v) ? u + (v * 3u) / 8u : v + (u * 3u) / 8u;
}

/* Whether a vector ends within `limit` steps of the line along a, on the side that d tells. */
static bool is_near_line(const evs_ego_view_t *w, uint32_t limit)
{
    return (uint64_t)((int64_t)w->c * w->c) <= (uint64_t)w->a2 * (limit * limit);
}

/* Vectors by cells of the image. */
typedef struct {
    uint16_t n_all[EVS_EGO_CELLS];
    uint16_t n_good[EVS_EGO_CELLS];
} cells_t;

/* Whether the outliers come in patches, as those of an object that moves by itself do, and not evenly: chi^2 per degree
 * of freedom, at least 1. */
static evs_scaled_t patchiness(const cells_t *cells, uint32_t n_all, uint32_t n_good)
{
    const int64_t n = n_all;
    const int64_t good = n_good;
    evs_scaled_t sum = evs_scaled(0, 0);
    int32_t n_used = 0;
    for (unsigned c = 0u; c < EVS_EGO_CELLS; c++) {
        if (cells->n_all[c] == 0u) { continue; }
        const evs_scaled_t off = evs_scaled(cells->n_good[c] * n - cells->n_all[c] * good, 0);
        const evs_scaled_t variance = evs_scaled(cells->n_all[c] * good * (n - good) + n * n / 4 + 1, 0);
        sum = evs_scaled_add(sum, evs_scaled_div(evs_scaled_mul(off, off), variance));
        n_used++;
    }
    const evs_scaled_t one = evs_scaled(1, 0);
    if (n_used < 2) { return one; }
    const evs_scaled_t per_degree = evs_scaled_div(sum, evs_scaled(n_used - 1, 0));
    return evs_scaled_less(per_degree, one) ? one : per_degree;
}

/* Count the vectors that agree, and ask whether they are enough, more than chance would give, and of one sign.
 * Returns the patchiness of the others. */
static evs_scaled_t judge_count(const evs_ego_set_t *set, evs_egomotion_result_t *result)
{
    cells_t cells = {{0}, {0}};
    const evs_ego_dir_t dir = evs_ego_dir(set, result->v_q30);
    const uint32_t limit = result->inlier_limit_;
    uint64_t chance_q16 = 0u;
    const uint32_t each = (set->n > EVS_EGO_SUBSET) ? 4u : 1u; /* chance is summed up of a quarter of many */
    uint32_t n_against = 0u;
    for (uint32_t i = 0u; i < set->n; i++) {
        const evs_ego_view_t w = evs_ego_view(&set->vec[i], dir);
        if (i % each == 0u) { chance_q16 += by_chance_q16(about_length(&set->vec[i]), limit); }
        const uint32_t cell = evs_ego_cell(set, &set->vec[i]);
        cells.n_all[cell]++;
        if (!is_near_line(&w, limit)) { continue; }
        cells.n_good[cell] = (uint16_t)(cells.n_good[cell] + ((w.d > 0) ? 1u : 0u));
        result->n_inliers += (w.d > 0) ? 1u : 0u;
        n_against += (w.d < 0) ? 1u : 0u;
    }
    chance_q16 *= each;
    if (result->n_inliers < EVS_EGOMOTION_INLIERS_MIN) { result->flags |= EVS_EGOMOTION_FEW; }
    if (within(result->n_inliers, chance_q16, 4u)) { result->flags |= EVS_EGOMOTION_CHANCE; }
    /* tossed coins differ by more than three times the root of their number once in 400 throws */
    const int64_t lead = (int64_t)result->n_inliers - n_against;
    if ((lead <= 0) || (lead * lead <= 9 * ((int64_t)result->n_inliers + n_against))) {
        result->flags |= EVS_EGOMOTION_SIGN_UNSURE;
    }
    return patchiness(&cells, set->n, result->n_inliers);
}

bool evs_egomotion_is_inlier(const evs_egomotion_result_t *result, const evs_egomotion_flow_t *flow)
{
    evs_ego_vector_t p;
    EVS_ASSERT((result != NULL) && (flow != NULL));
    if ((result->n_flow == 0u) || !evs_ego_pack_one(result, flow, &p)) { return false; }
    const evs_ego_set_t set = {.one_bits = 13u - result->position_shift_};
    const evs_ego_view_t w = evs_ego_view(&p, evs_ego_dir(&set, result->v_q30));
    return (w.d > 0) && is_near_line(&w, result->inlier_limit_);
}

/* What is judged of an estimate. */
typedef struct {
    uint32_t noise; /* steps */
    evs_scaled_t patchiness;
} judgement_t;

static judgement_t judge(const evs_ego_set_t *set, evs_egomotion_result_t *result)
{
    judgement_t j;
    j.noise = evs_ego_noise(set, result->v_q30, NOISE_VECTORS);
    result->noise_q24 = evs_ego_steps_to_q24(result, j.noise);
    result->inlier_limit_ = (uint16_t)evs_clamp((int32_t)(j.noise * 5u / 2u), INLIER_LIMIT_MIN, 2 * EVS_EGO_CLIP);
    j.patchiness = judge_count(set, result);
    return j;
}

/* Covariance of the tangent plane in rad^2, or NULL for none, to the camera's axes, and sigma. */
static void put_spread(const evs_egomotion_config_t *cfg, const judgement_t *judgement, evs_scaled_t *cov,
                       const evs_ego_frame_t *f, evs_egomotion_result_t *result)
{
    if (cov == NULL) {
        result->flags |= EVS_EGOMOTION_DEGENERATE;
        return;
    }
    /* few vectors fit themselves better than they fit the truth; and where outliers come in patches, more of the same
     * are likely among the good ones: the root is between ignoring that and believing it of all */
    const int64_t n = (result->n_inliers > 9u) ? result->n_inliers : 9;
    const evs_scaled_t few = evs_scaled_div(evs_scaled(n * cfg->variance_factor_q8, -8), evs_scaled(n - 8, 0));
    evs_scaled_t factor = evs_scaled_mul(few, evs_scaled_sqrt(judgement->patchiness));
    /* and halves of the image that contradict each other say that some of the good vectors are not */
    const evs_scaled_t var = evs_scaled_mul(evs_scaled_add(cov[0], cov[2]), factor);
    const evs_scaled_t at_least = evs_scaled_mul(cov[3], evs_scaled(HALVES_Q8, -8));
    if ((var.m > 0) && evs_scaled_less(var, at_least)) {
        factor = evs_scaled_mul(factor, evs_scaled_div(at_least, var));
    }
    for (unsigned i = 0u; i < 3u; i++) { cov[i] = evs_scaled_mul(cov[i], factor); }
    /* flow is rounded, and equal vectors are alike: that does not average out */
    cov[0] = evs_scaled_add(cov[0], evs_scaled(1, -24));
    cov[2] = evs_scaled_add(cov[2], evs_scaled(1, -24));
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

/* What one call works on. */
typedef struct {
    evs_ego_set_t set;
    uint32_t *likelihood; /* PAPER, ERL: room for one per vector */
    const evs_egomotion_flow_t *flow;
    size_t n;
} evs_ego_call_t;

/* --- the robust estimate ---------------------------------------------------------------------------------------- */

static uint32_t kernel_scale(uint32_t noise)
{
    return (uint32_t)evs_clamp((int32_t)(9u * noise / 4u), SCALE_MIN, SCALE_MAX);
}

/* The narrow steps with the rotation: it is taken out of the flow anew after each. */
static uint32_t refine_rotation(const evs_egomotion_config_t *cfg, const evs_ego_call_t *call, uint32_t noise,
                                evs_vec3_t *v, evs_ego_rotation_t *rot, evs_egomotion_result_t *result)
{
    const uint32_t fewer = (call->set.n + NOISE_VECTORS - 1u) / NOISE_VECTORS;
    uint32_t s = SCALE_WIDE;
    for (int i = 0; i < NARROW_STEPS; i++) {
        if (i == 2) { noise = evs_ego_noise(&call->set, *v, NOISE_VECTORS); }
        if ((i & 1) == 0) {
            s = kernel_scale(noise);
            rot->prior = evs_ego_rotation_prior(&call->set, result, noise, cfg->rotation_sigma_rad_q28);
        }
        if (!evs_ego_step_rotation(&call->set, result, s, (i < 2) ? fewer : 1u, v, rot)) { break; }
        result->rotation_rad_q28 = rot->rad_q28;
        evs_ego_repack(&call->set, call->flow, call->n, result);
    }
    return s;
}

/* Where to refine from. The best of the hypotheses need not lie in the basin of the best answer: a direction that
 * explains some of the scene and some of an object that moves by itself may fit more vectors roughly, but fewer well. So
 * a few are led to where their minimum shows, and compared at the scale of the noise. */
static evs_vec3_t start(const evs_ego_set_t *set, uint32_t *noise_found)
{
    const uint32_t some = (set->n + EVS_EGO_SUBSET - 1u) / EVS_EGO_SUBSET;
    evs_vec3_t v[EVS_EGO_CANDIDATES];
    const uint32_t n = evs_ego_search(set, v);
    uint32_t noise = UINT32_MAX;
    for (uint32_t k = 0u; k < n; k++) {
        for (int i = 0; i < WIDE_STEPS; i++) { (void)evs_ego_step(set, SCALE_WIDE, some, 8, &v[k]); }
        const uint32_t noise_here = evs_ego_noise(set, v[k], EVS_EGO_SUBSET);
        if (noise_here < noise) { noise = noise_here; }
    }
    uint32_t best = 0u;
    uint32_t most = 0u;
    for (uint32_t k = 0u; k < n; k++) {
        (void)evs_ego_step(set, kernel_scale(noise), some, 8, &v[k]);
        const uint32_t scale = (uint32_t)evs_clamp((int32_t)noise, SCALE_MIN, SCALE_MAX);
        const uint32_t explained = evs_ego_explained(set, v[k], scale, EVS_EGO_SUBSET);
        if (explained > most) {
            best = k;
            most = explained;
        }
    }
    *noise_found = noise;
    return v[best];
}

static void solve_robust(const evs_egomotion_config_t *cfg, const evs_ego_call_t *call, evs_egomotion_result_t *result)
{
    const evs_ego_set_t *const set = &call->set;
    const bool with_rotation = cfg->rotation_sigma_rad_q28 > 0;
    evs_ego_rotation_t rot = {{0, 0, 0}, {0, 0}};
    uint32_t s = SCALE_WIDE;
    uint32_t noise;
    evs_vec3_t v = start(set, &noise);
    evs_ego_frame_t f;
    evs_scaled_t cov[4];
    bool definite = true;
    if (with_rotation) {
        s = refine_rotation(cfg, call, noise, &v, &rot, result);
        f = evs_ego_frame(v);
    } else {
        /* what the later steps correct costs less */
        const uint32_t stride[NARROW_STEPS - 1] = {(set->n + EVS_EGO_SUBSET - 1u) / EVS_EGO_SUBSET,
                                                   (set->n + NOISE_VECTORS - 1u) / NOISE_VECTORS, 1u};
        for (int i = 0; i < NARROW_STEPS - 1; i++) {
            if (i == 2) { noise = evs_ego_noise(set, v, NOISE_VECTORS); }
            s = kernel_scale(noise);
            (void)evs_ego_step(set, s, stride[i], LONGER, &v);
        }
        f = evs_ego_frame(v);
        evs_scaled_t step[2];
        definite = evs_ego_covariance(set, &f, s, cov, step); /* the last step comes along with it */
        if (definite) { v = evs_ego_move(&f, step[0], step[1]); }
        f = evs_ego_carry(&f, v);
    }
    result->v_q30 = v;
    const judgement_t j = judge(set, result);
    if (evs_ego_is_rotation(set, v, s)) { result->flags |= EVS_EGOMOTION_ROTATION; }
    if (with_rotation) { definite = evs_ego_covariance_rotation(set, &f, s, j.noise, rot.prior, cov); }
    put_spread(cfg, &j, definite ? cov : NULL, &f, result);
}

/* --- the published estimates ------------------------------------------------------------------------------------ */

#if !EVS_NO_PAPER
static void solve_paper(const evs_egomotion_config_t *cfg, const evs_ego_call_t *call, evs_egomotion_result_t *result)
{
    const evs_ego_set_t *const set = &call->set;
    const bool joint = cfg->method == EVS_EGOMOTION_ERL;
    evs_scaled_t cov[4];
    const bool definite = evs_ego_paper(set, joint, call->likelihood, result, cov);
    evs_ego_repack(set, call->flow, call->n, result);
    const judgement_t j = judge(set, result);
    if (!joint && evs_ego_is_rotation(set, result->v_q30, kernel_scale(j.noise))) {
        result->flags |= EVS_EGOMOTION_ROTATION;
    }
    const evs_ego_frame_t f = evs_ego_frame(result->v_q30);
    put_spread(cfg, &j, definite ? cov : NULL, &f, result);
}
#endif

/* --- the call --------------------------------------------------------------------------------------------------- */

evs_status_t evs_egomotion_solve(const evs_egomotion_config_t *cfg, const evs_egomotion_flow_t *flow, size_t n,
                                 void *scratch, size_t n_scratch, evs_egomotion_result_t *result)
{
    if ((cfg == NULL) || (result == NULL) || (((flow == NULL) || (scratch == NULL)) && (n > 0u))) {
        return EVS_ERR_NULL;
    }
    if (!config_ok(cfg)) { return EVS_ERR_ARG; }
    const bool robust = cfg->method == EVS_EGOMOTION_ROBUST;
    const size_t n_needed = (n == 0u) ? 0u : (robust ? EVS_EGOMOTION_BYTES(n) : EVS_EGOMOTION_PAPER_BYTES(n));
    if ((n > EVS_EGOMOTION_N_MAX) || (n_scratch < n_needed) || (((uintptr_t)scratch & 3u) != 0u)) {
        return EVS_ERR_SIZE;
    }
    evs_ego_call_t call = {.set = {.subset = scratch, .one_bits = 13u}, .flow = flow, .n = n};
    if (n > 0u) {
        call.set.vec = (evs_ego_vector_t *)(call.set.subset + 1);
        call.likelihood = (uint32_t *)(void *)(call.set.vec + n); /* 8 n bytes on: still aligned */
        call.set.key = robust ? (uint16_t *)call.likelihood : (uint16_t *)(call.likelihood + n);
    }
    evs_egomotion_result_t r = {.v_q30 = {0, 0, EVS_ONE_Q30}, .sigma_rad_q28 = PI_Q28};
    evs_ego_pack(&call.set, flow, n, &r);
    if (call.set.n == 0u) {
        r.flags = EVS_EGOMOTION_FEW | EVS_EGOMOTION_STILL;
    } else if (robust) {
        solve_robust(cfg, &call, &r);
    }
#if !EVS_NO_PAPER
    else {
        solve_paper(cfg, &call, &r);
    }
#endif
    if (r.flags == 0u) {
        r.flags = EVS_EGOMOTION_VALID;
    } else {
        r.sigma_rad_q28 = PI_Q28;
        for (int i = 0; i < 6; i++) { r.covariance_rad2_q30[i] = 0; }
    }
    *result = r;
    return EVS_OK;
}
