/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * ERL and ERL-V as published, for comparison. The rotation is eliminated by least squares for each hypothesis (ERL) or
 * zero (ERL-V); weights are likelihoods over a coarse polar grid of hypotheses, the minimum of the weighted cost is
 * sought on a fine one and then followed downhill. Polar grids, the division of the residual by the length of the flow
 * and the missing sign are theirs.
 */
#include "evs_egomotion_private.h"

enum {
    DIM = 5,
    N_TRIANGLE = DIM * (DIM + 1) / 2,
    GRID_COARSE = 11, /* azimuths and radii; the first and the last azimuth are the same, and count twice */
    GRID_FINE = 25,
    FINEST = 1 << 15, /* last step downhill, Q30: 3e-5 rad */
    HALVINGS = 10,    /* from the first, 2 degrees */
    SLOPE_MAX = (1 << 18) - 1
};

/* What the estimators share. */
typedef struct {
    const evs_ego_set_t *set;
    uint32_t *likelihood; /* sum over hypotheses */
    bool joint;
    bool weighted; /* by set->key, Q15; else all vectors count alike */
} paper_t;

static uint32_t weight_q15(const paper_t *e, uint32_t i) { return e->weighted ? e->set->key[i] : 32768u; }

/* --- one hypothesis --------------------------------------------------------------------------------------------- */

/* A residual r = r0 + n w, in 1/16 steps, and its slopes by the rotation, Q13. */
typedef struct {
    int32_t r0_q4;
    int32_t n_q13[3];
} row_t;

static row_t make_row(const paper_t *e, uint32_t i, evs_ego_dir_t dir)
{
    const evs_ego_vector_t *const p = &e->set->vec[i];
    const evs_ego_view_t w = evs_ego_view(p, dir);
    row_t row = {0, {0, 0, 0}};
    if (w.a2 == 0u) { return row; } /* at the focus itself any flow will do */
    unsigned shift;
    const uint32_t r = evs_rsqrt_u64(w.a2, &shift) >> 1; /* 1 / |a| = r 2^-(shift - 1) */
    row.r0_q4 = (int32_t)(((int64_t)w.c * r) >> (shift - 5u));
    if (e->joint) {
        const evs_ego_rows_t b = evs_ego_rows(e->set, p);
        for (unsigned k = 0u; k < 3u; k++) { /* bu, bv at 2^(one_bits + 1), a / |a| without unit */
            const int64_t across = ((int64_t)b.bv[k] * w.ax - (int64_t)b.bu[k] * w.ay) >> 8;
            row.n_q13[k] = evs_sat32((across * r) >> (shift - 1u - 8u + e->set->one_bits + 1u - 13u));
        }
    }
    return row;
}

static int32_t residual_q4(const row_t *row, const evs_ego_turn_t *t)
{
    int64_t r = 0;
    for (unsigned k = 0u; k < 3u; k++) { r += (int64_t)row->n_q13[k] * t->w_q8[k]; }
    return evs_clamp(evs_sat32(row->r0_q4 + (r >> 17)), -(EVS_EGO_CLIP << 6), EVS_EGO_CLIP << 6);
}

/* The rotation that suits a direction best. */
static evs_ego_turn_t eliminate(const paper_t *e, evs_ego_dir_t dir)
{
    evs_ego_turn_t t = {{0, 0, 0}};
    if (!e->joint) { return t; }
    int64_t h[6] = {0};
    int64_t g[3] = {0};
    for (uint32_t i = 0u; i < e->set->n; i++) {
        const row_t row = make_row(e, i, dir);
        const uint32_t w = weight_q15(e, i);
        const int64_t w2_q8 = (int64_t)((w * w) >> 22);
        unsigned at = 0u;
        for (unsigned k = 0u; k < 3u; k++) { /* slopes below 2^20: sums below 2^(8 + 40 + 16) only for wild positions */
            g[k] -= w2_q8 * (((int64_t)row.n_q13[k] * row.r0_q4) >> 4);
            for (unsigned l = 0u; l <= k; l++) { h[at++] += w2_q8 * (((int64_t)row.n_q13[k] * row.n_q13[l]) >> 8); }
        }
    }
    evs_scaled_t a[6];
    evs_scaled_t x[3];
    for (unsigned i = 0u; i < 6u; i++) { a[i] = evs_scaled(h[i], 8 - 26); }
    for (unsigned k = 0u; k < 3u; k++) { x[k] = evs_scaled(g[k], 4 - 13 - 4); }
    if (!evs_scaled_solve(a, x, 3u)) { return t; }
    for (unsigned k = 0u; k < 3u; k++) {
        t.w_q8[k] = evs_clamp(evs_scaled_to_q(x[k], 8), -EVS_EGO_TURN_MAX, EVS_EGO_TURN_MAX);
    }
    return t;
}

/* Sum of w^2 r^2. */
static uint64_t cost(const paper_t *e, evs_vec3_t v_q30, evs_ego_turn_t *turn)
{
    const evs_ego_dir_t dir = evs_ego_dir(e->set, v_q30);
    *turn = eliminate(e, dir);
    uint64_t sum = 0u;
    for (uint32_t i = 0u; i < e->set->n; i++) {
        const row_t row = make_row(e, i, dir);
        const int64_t r_q4 = residual_q4(&row, turn);
        const uint32_t w = weight_q15(e, i);
        sum += ((uint64_t)(r_q4 * r_q4) * ((w * w) >> 16)) >> 8; /* 2^(38 + 14 - 8), times 2^16 vectors */
    }
    return sum;
}

/* --- hypotheses ------------------------------------------------------------------------------------------------- */

/* Direction of a node of a polar grid of n x n over the half sphere z >= 0. */
static evs_vec3_t node(uint32_t azimuth, uint32_t radius, uint32_t n)
{
    int32_t sin_q30;
    int32_t cos_q30;
    evs_sincos((int32_t)(uint32_t)(((uint64_t)azimuth << 32) / (n - 1u)), &sin_q30, &cos_q30);
    const int32_t r_q30 = (int32_t)(((uint32_t)EVS_ONE_Q30 / (n - 1u)) * radius);
    const uint64_t r2_q60 = (uint64_t)((int64_t)r_q30 * r_q30);
    const evs_vec3_t v = {evs_q_mul(cos_q30, r_q30, 30u), evs_q_mul(sin_q30, r_q30, 30u),
                          (int32_t)evs_sqrt_u64((UINT64_C(1) << 60) - r2_q60)};
    return v;
}

/* r^2 over the length of the flow, Q8. */
static uint32_t error_q8(const paper_t *e, uint32_t i, evs_ego_dir_t dir, const evs_ego_turn_t *t)
{
    const evs_ego_vector_t *const p = &e->set->vec[i];
    const row_t row = make_row(e, i, dir);
    const int64_t r_q4 = residual_q4(&row, t);
    const uint32_t length = evs_sqrt_u64((uint64_t)(p->u * p->u + p->v * p->v));
    const uint64_t error = (uint64_t)(r_q4 * r_q4) / ((length > 0u) ? length : 1u);
    return (error < (UINT32_C(1) << 30)) ? (uint32_t)error : UINT32_C(1) << 30;
}

/* Add exp(-E / M) / M of one hypothesis to every vector, M being the mean of the E. */
static void add_likelihood(const paper_t *e, evs_vec3_t v_q30)
{
    const uint32_t n = e->set->n;
    const evs_ego_dir_t dir = evs_ego_dir(e->set, v_q30);
    const evs_ego_turn_t t = eliminate(e, dir);
    uint64_t sum = 0u;
    for (uint32_t i = 0u; i < n; i++) { sum += error_q8(e, i, dir, &t); }
    const uint64_t mean = sum / n;
    const uint32_t m = (mean > 256u) ? (uint32_t)mean : 256u; /* a step: what rounding leaves */
    for (uint32_t i = 0u; i < n; i++) {
        const uint64_t x_q16 = ((uint64_t)error_q8(e, i, dir, &t) << 16) / m;
        const int32_t exponent = (x_q16 < (UINT64_C(32) << 16)) ? -(int32_t)x_q16 : -(INT32_C(32) << 16);
        e->likelihood[i] += (uint32_t)(((uint64_t)evs_exp_q16(exponent) * (UINT32_MAX / m)) >> 16); /* < 2^24 */
    }
}

/* Likelihoods to weights between 0 and 1. */
static void make_weights(paper_t *e)
{
    const uint32_t n = e->set->n;
    uint32_t least = UINT32_MAX;
    uint32_t most = 0u;
    for (uint32_t i = 0u; i < n; i++) { e->likelihood[i] = 0u; }
    add_likelihood(e, node(0u, 0u, GRID_COARSE)); /* the pole once */
    for (uint32_t radius = 1u; radius < GRID_COARSE; radius++) {
        for (uint32_t azimuth = 0u; azimuth < GRID_COARSE; azimuth++) {
            add_likelihood(e, node(azimuth, radius, GRID_COARSE));
        }
    }
    for (uint32_t i = 0u; i < n; i++) {
        const uint32_t x = e->likelihood[i];
        least = (x < least) ? x : least;
        most = (x > most) ? x : most;
    }
    const uint32_t span = most - least;
    for (uint32_t i = 0u; i < n; i++) {
        const uint64_t part = (uint64_t)(e->likelihood[i] - least) << 15;
        e->set->key[i] = (uint16_t)((span == 0u) ? 32768u : part / span);
    }
    e->weighted = true;
}

static evs_vec3_t search_grid(const paper_t *e, uint64_t *least)
{
    evs_vec3_t best = {0, 0, EVS_ONE_Q30};
    evs_ego_turn_t t;
    *least = UINT64_MAX;
    for (uint32_t radius = 0u; radius < GRID_FINE; radius++) {
        for (uint32_t azimuth = 0u; azimuth < GRID_FINE; azimuth++) {
            const evs_vec3_t v = node(azimuth, radius, GRID_FINE);
            const uint64_t here = cost(e, v, &t);
            if (here < *least) {
                *least = here;
                best = v;
            }
        }
    }
    return best;
}

/* The nearest local minimum, by steps in eight directions that are halved when none leads down: needs no derivative,
 * whose approximation by least squares misleads when many vectors are outliers. */
static evs_vec3_t downhill(const paper_t *e, evs_vec3_t v, uint64_t least)
{
    for (int32_t reach = 2 * FINEST << HALVINGS; reach > FINEST;) {
        const evs_ego_frame_t f = evs_ego_frame(v);
        bool lower = false;
        for (uint32_t k = 0u; (k < 8u) && !lower; k++) {
            int32_t sin_q30;
            int32_t cos_q30;
            evs_ego_turn_t turn;
            evs_sincos((int32_t)(k << 29), &sin_q30, &cos_q30);
            const evs_vec3_t next = evs_ego_move(&f, evs_scaled(evs_q_mul(cos_q30, reach, 30u), -30),
                                                 evs_scaled(evs_q_mul(sin_q30, reach, 30u), -30));
            const uint64_t here = cost(e, next, &turn);
            lower = here < least;
            if (lower) {
                v = next;
                least = here;
            }
        }
        if (!lower) { reach /= 2; }
    }
    return v;
}

/* --- spread ----------------------------------------------------------------------------------------------------- */

/* Sums of w^2 J J', and of w^2 r J by cells, for the first dim unknowns. */
static void add_up(const paper_t *e, const evs_ego_frame_t *f, const evs_ego_turn_t *turn, unsigned dim, int64_t *h,
                   evs_ego_cell_sum_t *cells)
{
    const evs_ego_set_t *const set = e->set;
    const evs_ego_loop_t loop = evs_ego_loop(set, f, 1u << EVS_EGO_MEDIAN_BITS); /* for its directions */
    for (unsigned k = 0u; k < dim * (dim + 1u) / 2u; k++) { h[k] = 0; }
    for (uint32_t i = 0u; i < set->n; i++) {
        const evs_ego_rows_t rows = evs_ego_rows(set, &set->vec[i]);
        int32_t left[2];
        evs_ego_left_over(set, &set->vec[i], &rows, turn, left);
        const int32_t limit = EVS_EGO_CLIP * 181 / 256; /* the length stays below EVS_EGO_CLIP */
        const evs_ego_vector_t p = {set->vec[i].x, set->vec[i].y, (int16_t)evs_clamp(left[0], -limit, limit),
                                    (int16_t)evs_clamp(left[1], -limit, limit)};
        const evs_ego_view_t w = evs_ego_view(&p, loop.v);
        if (evs_ego_near_focus(set, &w)) { continue; }
        const uint32_t weight_q30 = weight_q15(e, i) * weight_q15(e, i);
        const uint32_t inv = evs_ego_inv_a2(set, w.a2);
        const evs_ego_slope_t slope = evs_ego_slope(set, &p, w.d, inv, loop.b0, loop.b1);
        const int32_t wr_q2 = evs_mul_hi((int32_t)weight_q30, evs_ego_over_a2_q2(set, w.c, inv) * 4);
        int32_t j[DIM] = {slope.j0, slope.j1, 0, 0, 0};
        for (unsigned k = 0u; k + 2u < dim; k++) {
            const int64_t across = ((int64_t)rows.bv[k] * w.ax - (int64_t)rows.bu[k] * w.ay) >> (set->one_bits + 1u);
            j[2u + k] = evs_clamp(evs_sat32(across), -SLOPE_MAX, SLOPE_MAX);
        }
        unsigned at = 0u;
        for (unsigned k = 0u; k < dim; k++) {
            const int32_t wj = evs_ego_weigh(weight_q30, inv, j[k]);
            cells[evs_ego_cell(set, &p)].z[k] += evs_ego_gradient(wr_q2, j[k]);
            for (unsigned l = 0u; l <= k; l++) { h[at++] += (int64_t)wj * j[l]; }
        }
    }
}

/* --- the estimate ----------------------------------------------------------------------------------------------- */

/* The published cost knows no sign: the one for which more of the weight has a positive inverse depth. */
static bool points_back(const paper_t *e, evs_vec3_t v_q30, const evs_ego_turn_t *turn)
{
    const evs_ego_dir_t dir = evs_ego_dir(e->set, v_q30);
    int64_t votes = 0;
    for (uint32_t i = 0u; i < e->set->n; i++) {
        const evs_ego_rows_t rows = evs_ego_rows(e->set, &e->set->vec[i]);
        int32_t left[2];
        evs_ego_left_over(e->set, &e->set->vec[i], &rows, turn, left);
        const evs_ego_view_t w = evs_ego_view(&e->set->vec[i], dir);
        const int64_t d = (int64_t)left[0] * w.ax + (int64_t)left[1] * w.ay;
        votes += (d > 0) ? (int64_t)weight_q15(e, i) : ((d < 0) ? -(int64_t)weight_q15(e, i) : 0);
    }
    return votes < 0;
}

static int32_t turn_to_rad_q28(const evs_egomotion_result_t *scale, int32_t w_q8)
{
    const evs_scaled_t step = evs_scaled((int64_t)scale->median_flow_q24, -24 - EVS_EGO_MEDIAN_BITS);
    return evs_clamp(evs_scaled_to_q(evs_scaled_mul(evs_scaled(w_q8, -8), step), 28), -EVS_EGO_ROTATION_MAX,
                     EVS_EGO_ROTATION_MAX);
}

bool evs_ego_paper(const evs_ego_set_t *set, bool joint, uint32_t *likelihood, evs_egomotion_result_t *result,
                   evs_scaled_t cov[4])
{
    paper_t e = {.set = set, .likelihood = likelihood, .joint = joint, .weighted = false};
    const unsigned dim = joint ? 5u : 2u;
    uint64_t least;
    evs_ego_turn_t turn;
    make_weights(&e);
    evs_vec3_t v = search_grid(&e, &least);
    v = downhill(&e, v, least);
    (void)cost(&e, v, &turn);
    if (points_back(&e, v, &turn)) { v = (evs_vec3_t){-v.x, -v.y, -v.z}; }
    result->v_q30 = v;
    if (joint) {
        result->rotation_rad_q28 =
            (evs_vec3_t){turn_to_rad_q28(result, turn.w_q8[0]), turn_to_rad_q28(result, turn.w_q8[1]),
                         turn_to_rad_q28(result, turn.w_q8[2])};
    }
    const evs_ego_frame_t f = evs_ego_frame(v);
    int64_t sums[N_TRIANGLE];
    evs_scaled_t h[N_TRIANGLE];
    evs_scaled_t m[N_TRIANGLE];
    evs_ego_cell_sum_t *const cells = evs_ego_cells(set);
    add_up(&e, &f, &turn, dim, sums, cells);
    for (unsigned k = 0u; k < dim * (dim + 1u) / 2u; k++) { h[k] = evs_scaled(sums[k], 0); }
    evs_ego_spread(cells, dim, m);
    cov[3] = evs_scaled(0, 0);
    return evs_ego_sandwich(h, m, dim, cov);
}
