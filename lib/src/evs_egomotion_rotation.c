/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Rotation left in the flow: estimated under a prior together with v, and the question whether it is all there is. */
#include "evs_egomotion_private.h"

enum { DIM = 5, N_TRIANGLE = DIM * (DIM + 1) / 2, SLOPE_MAX = (1 << 18) - 1 };

/* --- joint steps ------------------------------------------------------------------------------------------------ */

typedef struct {
    int64_t h[N_TRIANGLE]; /* sum of w J J' */
    int64_t g_q2[DIM];     /* sum of w r J */
} sums_t;

/* What tells the spread of the result. */
typedef struct {
    evs_ego_cell_sum_t *cells;
    int64_t curvature; /* sum of psi' |J|^2 over the two of v */
} spread_t;

/* Sums over every stride-th vector; those of the spread where it is not NULL. */
static void add_up(const evs_ego_set_t *set, const evs_ego_frame_t *f, uint32_t s, uint32_t stride, sums_t *sums,
                   spread_t *spread)
{
    const evs_ego_loop_t loop = evs_ego_loop(set, f, s);
    *sums = (sums_t){.h = {0}};
    for (uint32_t i = 0u; i < set->n; i += stride) {
        const evs_ego_vector_t *const p = &set->vec[i];
        evs_ego_pull_t a;
        evs_ego_pull_more_t more;
        if (!evs_ego_pull(set, p, &loop, &a, &more)) { continue; }
        const evs_ego_rows_t rows = evs_ego_rows(set, p);
        int32_t j[DIM] = {a.j.j0, a.j.j1, 0, 0, 0};
        EVS_EGO_UNROLL
        for (unsigned k = 0u; k < 3u; k++) {
            const int64_t across =
                ((int64_t)rows.bv[k] * more.view.ax - (int64_t)rows.bu[k] * more.view.ay) >> (set->one_bits + 1u);
            j[2u + k] = evs_clamp(evs_sat32(across), -SLOPE_MAX, SLOPE_MAX);
        }
        unsigned at = 0u;
        EVS_EGO_UNROLL
        for (unsigned k = 0u; k < DIM; k++) {
            const int32_t wj = (k == 0u) ? a.k0 : ((k == 1u) ? a.k1 : evs_ego_weigh(more.weight_q30, more.inv, j[k]));
            sums->g_q2[k] += (int64_t)a.wr_q2 * j[k];
            EVS_EGO_UNROLL
            for (unsigned l = 0u; l <= k; l++) { sums->h[at++] += (int64_t)wj * j[l]; }
        }
        if (spread == NULL) { continue; }
        evs_ego_cell_sum_t *const cell = &spread->cells[evs_ego_cell(set, p)];
        cell->h[0] += (int64_t)a.k0 * j[0];
        cell->h[1] += (int64_t)a.k0 * j[1];
        cell->h[2] += (int64_t)a.k1 * j[1];
        for (unsigned k = 0u; k < DIM; k++) { cell->z[k] += evs_ego_gradient(a.wr_q2, j[k]); }
        spread->curvature += (int64_t)evs_ego_bend(&a, a.k0) * j[0] + (int64_t)evs_ego_bend(&a, a.k1) * j[1];
    }
}

/* The rotation is counted in 2^one_bits steps per unit, as its slopes are; to rad: */
evs_scaled_t evs_ego_rotation_unit(const evs_ego_set_t *set, const evs_egomotion_result_t *scale)
{
    return evs_scaled((int64_t)scale->median_flow_q24, (int32_t)set->one_bits - 24 - EVS_EGO_MEDIAN_BITS);
}

evs_scaled_t evs_ego_rotation_prior(const evs_ego_set_t *set, const evs_egomotion_result_t *scale, uint32_t noise,
                                    int32_t sigma_rad_q28)
{
    const evs_scaled_t sigma = evs_scaled_div(evs_scaled(sigma_rad_q28, -28), evs_ego_rotation_unit(set, scale));
    const evs_scaled_t ratio = evs_scaled_div(evs_scaled((int64_t)noise + 1, 0), sigma);
    return evs_scaled_mul(ratio, ratio);
}

bool evs_ego_step_rotation(const evs_ego_set_t *set, const evs_egomotion_result_t *scale, uint32_t s, uint32_t stride,
                           evs_vec3_t *v_q30, evs_ego_rotation_t *rot)
{
    const evs_ego_frame_t f = evs_ego_frame(*v_q30);
    const evs_scaled_t unit = evs_ego_rotation_unit(set, scale);
    const int32_t now[3] = {rot->rad_q28.x, rot->rad_q28.y, rot->rad_q28.z};
    sums_t sums;
    evs_scaled_t h[N_TRIANGLE];
    evs_scaled_t step[DIM];
    add_up(set, &f, s, stride, &sums, NULL);
    for (unsigned i = 0u; i < N_TRIANGLE; i++) { h[i] = evs_scaled(sums.h[i], 0); }
    for (unsigned i = 0u; i < DIM; i++) { step[i] = evs_scaled(-sums.g_q2[i], -2); }
    for (unsigned k = 0u; k < 3u; k++) {
        evs_scaled_t *const diagonal = &h[(2u + k) * (3u + k) / 2u + 2u + k];
        const evs_scaled_t found = evs_scaled_div(evs_scaled(now[k], -28), unit);
        *diagonal = evs_scaled_add(*diagonal, rot->prior);
        step[2u + k] = evs_scaled_sub(step[2u + k], evs_scaled_mul(rot->prior, found));
    }
    if (!evs_scaled_solve(h, step, DIM)) { return false; }
    *v_q30 = evs_ego_move(&f, step[0], step[1]);
    int32_t next[3];
    for (unsigned k = 0u; k < 3u; k++) {
        const int64_t sum = (int64_t)now[k] + evs_scaled_to_q(evs_scaled_mul(step[2u + k], unit), 28);
        next[k] = evs_clamp(evs_sat32(sum), -EVS_EGO_ROTATION_MAX, EVS_EGO_ROTATION_MAX);
    }
    rot->rad_q28 = (evs_vec3_t){next[0], next[1], next[2]};
    return true;
}

bool evs_ego_covariance_rotation(const evs_ego_set_t *set, const evs_ego_frame_t *f, uint32_t s, uint32_t noise,
                                 evs_scaled_t prior, evs_scaled_t cov[4])
{
    sums_t sums;
    evs_scaled_t h[N_TRIANGLE];
    evs_scaled_t m[N_TRIANGLE];
    spread_t spread = {.cells = evs_ego_cells(set), .curvature = 0};
    add_up(set, f, s, 1u, &sums, &spread);
    if (spread.curvature <= 0) { return false; }
    const evs_scaled_t kappa = evs_scaled_div(evs_scaled(spread.curvature, 0), evs_scaled(sums.h[0] + sums.h[2], 0));
    for (unsigned i = 0u; i < N_TRIANGLE; i++) { h[i] = evs_scaled_mul(evs_scaled(sums.h[i], 0), kappa); }
    evs_ego_spread(spread.cells, DIM, m);
    cov[3] = evs_ego_halves_apart(spread.cells, kappa);
    const evs_scaled_t of_prior = evs_scaled_mul(prior, evs_scaled((int64_t)noise * noise + 1, 0));
    for (unsigned k = 0u; k < 3u; k++) {
        const unsigned at = (2u + k) * (3u + k) / 2u + 2u + k;
        h[at] = evs_scaled_add(h[at], prior);
        m[at] = evs_scaled_add(m[at], of_prior);
    }
    return evs_ego_sandwich(h, m, DIM, cov);
}

/* --- is it all rotation? ---------------------------------------------------------------------------------------- */

/* a / b in Q15 for a <= b, b > 0. */
static uint32_t ratio_q15(uint32_t a, uint32_t b)
{
    const unsigned up = evs_clz32(b);
    return (a << up) / ((b << up) >> 15);
}

/* One weighted least-squares solution for the turn, weights from the last one. */
static bool fit_turn(const evs_ego_set_t *set, uint32_t stride, uint32_t s2, evs_ego_turn_t *t)
{
    int64_t h[6] = {0};
    int64_t g[3] = {0};
    for (uint32_t i = 0u; i < set->n; i += stride) {
        const evs_ego_vector_t *const p = &set->vec[i];
        const evs_ego_rows_t r = evs_ego_rows(set, p);
        int32_t left[2];
        evs_ego_left_over(set, p, &r, t, left);
        const uint32_t e = (uint32_t)(left[0] * left[0]) + (uint32_t)(left[1] * left[1]);
        const uint32_t share = ratio_q15(s2, s2 + (e >> 1));
        const int32_t weight_q8 = (int32_t)((share * share) >> 22);
        unsigned at = 0u;
        EVS_EGO_UNROLL
        for (unsigned k = 0u; k < 3u; k++) { /* slopes below 2^18: sums below 2^(36 + 1 + 16) */
            const int32_t wu = (r.bu[k] * weight_q8) >> 8;
            const int32_t wv = (r.bv[k] * weight_q8) >> 8;
            g[k] += (int64_t)wu * left[0] + (int64_t)wv * left[1];
            EVS_EGO_UNROLL
            for (unsigned l = 0u; l <= k; l++) { h[at++] += (int64_t)wu * r.bu[l] + (int64_t)wv * r.bv[l]; }
        }
    }
    evs_scaled_t a[6];
    evs_scaled_t x[3];
    for (unsigned i = 0u; i < 6u; i++) { a[i] = evs_scaled(h[i], 0); }
    for (unsigned i = 0u; i < 3u; i++) { x[i] = evs_scaled(g[i], (int32_t)set->one_bits + 1); }
    if (!evs_scaled_solve(a, x, 3u)) { return false; }
    for (unsigned k = 0u; k < 3u; k++) {
        const int64_t w = (int64_t)t->w_q8[k] + evs_scaled_to_q(x[k], 8);
        t->w_q8[k] = evs_clamp(evs_sat32(w), -EVS_EGO_TURN_MAX, EVS_EGO_TURN_MAX);
    }
    return true;
}

/* Fit a turn to some of the vectors, at the scales of the median flow, half of it, and twice s. */
static bool find_turn(const evs_ego_set_t *set, uint32_t stride, uint32_t s, evs_ego_turn_t *t)
{
    for (unsigned i = 0u; i < 4u; i++) {
        const uint32_t wide = (UINT32_C(1) << EVS_EGO_MEDIAN_BITS) >> i;
        const uint32_t scale = ((i < 2u) && (wide > s)) ? wide : s;
        if (!fit_turn(set, stride, scale * scale, t)) { return false; }
    }
    return true;
}

/* The share of the vectors that an explanation explains is estimated from the mean of s^2 / (s^2 + r^2): less what a
 * vector of its length and a random direction would give on average, over what a good one would give less the same. */
typedef struct {
    uint32_t got;    /* sums */
    uint32_t chance; /* over fewer of them */
} explained_t;

enum { GOOD_Q15 = 27200 }; /* 0.83: the mean of s^2 / (s^2 + r^2) for normal r of half the scale s */

static evs_scaled_t share_of(const explained_t *x, uint32_t n, uint32_t n_chance)
{
    const int64_t by_chance = (int64_t)x->chance * n / n_chance;
    const int64_t possible = (int64_t)GOOD_Q15 * n - by_chance;
    return evs_scaled_div(evs_scaled((int64_t)x->got - by_chance, 0), evs_scaled((possible > 0) ? possible : 1, 0));
}

/* By how much v explains more of the vectors than a turn does, Q15. Of at most 1024 vectors. */
static int32_t lead_over_turn(const evs_ego_set_t *set, uint32_t stride, evs_vec3_t v_q30, uint32_t s,
                              const evs_ego_turn_t *t)
{
    const evs_ego_dir_t dir = evs_ego_dir(set, v_q30);
    const evs_ego_scale_t kernel = evs_ego_scale(s);
    const uint32_t s2 = s * s;
    const uint32_t each = (set->n > EVS_EGO_SUBSET) ? 4u : 1u; /* chance needs no more than a quarter of many */
    explained_t by_v = {0u, 0u};
    explained_t by_turn = {0u, 0u};
    uint32_t n = 0u;
    uint32_t n_chance = 0u;
    for (uint32_t i = 0u; i < set->n; i += stride, n++) {
        const evs_ego_vector_t *const p = &set->vec[i];
        const evs_ego_view_t w = evs_ego_view(p, dir);
        const evs_ego_rows_t r = evs_ego_rows(set, p);
        int32_t left[2];
        evs_ego_left_over(set, p, &r, t, left);
        const uint32_t e = (uint32_t)(left[0] * left[0]) + (uint32_t)(left[1] * left[1]);
        by_v.got += (w.d > 0) ? evs_ego_share_q15(kernel, &w) : 0u;
        by_turn.got += ratio_q15(s2, s2 + (e >> 1));
        if (n % each != 0u) { continue; }
        const int32_t turned[2] = {p->u - left[0], p->v - left[1]};
        const uint64_t u2 = (uint64_t)(p->u * p->u + p->v * p->v);
        const uint64_t b2 = (uint64_t)((int64_t)turned[0] * turned[0] + (int64_t)turned[1] * turned[1]);
        /* the mean over the direction of u: s / sqrt(s^2 + u^2) and, in two dimensions, s^2 / sqrt(a^2 - u^2 b^2) */
        const uint64_t a = s2 + ((u2 + b2) >> 1);
        by_v.chance += ratio_q15(s, evs_sqrt_u64(s2 + u2)) / 2u; /* and half point the wrong way */
        by_turn.chance += ratio_q15(s2, evs_sqrt_u64(a * a - u2 * b2));
        n_chance++;
    }
    return evs_scaled_to_q(evs_scaled_sub(share_of(&by_v, n, n_chance), share_of(&by_turn, n, n_chance)), 15);
}

bool evs_ego_is_rotation(const evs_ego_set_t *set, evs_vec3_t v_q30, uint32_t s)
{
    enum { CLEAR_Q15 = 10000, FEW = 64, MORE = 512 }; /* a lead of 0.3 needs no second look */
    const uint32_t coarse = (set->n + FEW - 1u) / FEW;
    const uint32_t fine = (set->n + MORE - 1u) / MORE;
    const uint32_t half = (set->n + MORE / 2u - 1u) / (MORE / 2u);
    evs_ego_turn_t t = {{0, 0, 0}};
    if (!find_turn(set, coarse, s, &t)) { return false; }
    if ((coarse > 1u) && (lead_over_turn(set, coarse, v_q30, s, &t) > CLEAR_Q15)) { return false; }
    if (!fit_turn(set, half, s * s, &t)) { return false; }
    /* for a pure rotation the lead is 0 with a deviation of about 0.45 / sqrt(n): half as much again */
    const int32_t limit =
        (int32_t)(((INT32_C(7) << 15) / 10) * 16 / (int32_t)evs_sqrt_u64((uint64_t)(set->n / fine) << 8));
    return lead_over_turn(set, fine, v_q30, s, &t) <= limit;
}
