/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Gauss-Newton on the residual across the flow direction, in the tangent plane of v, and the spread of its result. */
#include "evs_egomotion_private.h"

#include <string.h>

/* --- frames ----------------------------------------------------------------------------------------------------- */

static evs_vec3_t unit_or(evs_vec3_t v, evs_vec3_t otherwise)
{
    evs_vec3_t unit = otherwise;
    return (evs_vec3_normalize(v, &unit) == EVS_OK) ? unit : otherwise;
}

evs_ego_frame_t evs_ego_frame(evs_vec3_t v)
{
    const uint32_t x = evs_abs_u32(v.x);
    const uint32_t y = evs_abs_u32(v.y);
    const uint32_t z = evs_abs_u32(v.z);
    const bool x_least = (x <= y) && (x <= z);
    const bool y_least = !x_least && (y <= z);
    const evs_vec3_t axis = {x_least ? EVS_ONE_Q30 : 0, y_least ? EVS_ONE_Q30 : 0,
                             (!x_least && !y_least) ? EVS_ONE_Q30 : 0};
    evs_ego_frame_t f;
    f.v = v;
    f.b0 = unit_or(evs_vec3_cross(v, axis, 30u), axis);
    f.b1 = evs_vec3_cross(v, f.b0, 30u);
    return f;
}

evs_ego_frame_t evs_ego_carry(const evs_ego_frame_t *f, evs_vec3_t v)
{
    evs_ego_frame_t g = {v, f->b0, f->b1};
    g.b1 = unit_or(evs_vec3_cross(v, f->b0, 30u), f->b1);
    g.b0 = evs_vec3_cross(g.b1, v, 30u);
    return g;
}

/* Half a radian at most, Q30: far steps of a linear model mean nothing. */
#define STEP_MAX_Q30 (INT32_C(1) << 29)

evs_vec3_t evs_ego_move(const evs_ego_frame_t *f, evs_scaled_t d0, evs_scaled_t d1)
{
    const int32_t s0 = evs_clamp(evs_scaled_to_q(d0, 30), -STEP_MAX_Q30, STEP_MAX_Q30) / 2; /* halves: the sum below */
    const int32_t s1 = evs_clamp(evs_scaled_to_q(d1, 30), -STEP_MAX_Q30, STEP_MAX_Q30) / 2; /* stays under 2^31 */
    const evs_vec3_t moved = {f->v.x / 2 + evs_q_mul(f->b0.x, s0, 30u) + evs_q_mul(f->b1.x, s1, 30u),
                              f->v.y / 2 + evs_q_mul(f->b0.y, s0, 30u) + evs_q_mul(f->b1.y, s1, 30u),
                              f->v.z / 2 + evs_q_mul(f->b0.z, s0, 30u) + evs_q_mul(f->b1.z, s1, 30u)};
    return unit_or(moved, f->v);
}

/* --- residuals -------------------------------------------------------------------------------------------------- */

evs_ego_scale_t evs_ego_scale(uint32_t s)
{
    const unsigned e = 31u - evs_clz32(s);
    const evs_ego_scale_t scale = {(s * s) << (28u - 2u * e), e + 2u};
    return scale;
}

/* --- steps ------------------------------------------------------------------------------------------------------ */

bool evs_ego_step(const evs_ego_set_t *set, uint32_t s, uint32_t stride, int32_t eighths, evs_vec3_t *v_q30)
{
    const evs_ego_frame_t f = evs_ego_frame(*v_q30);
    const evs_ego_loop_t loop = evs_ego_loop(set, &f, s);
    int64_t h00 = 0, h01 = 0, h11 = 0; /* sum of w J J': the Hessian of Gauss-Newton */
    int64_t g0_q2 = 0, g1_q2 = 0;      /* sum of w r J: the gradient */
    for (uint32_t i = 0u; i < set->n; i += stride) {
        evs_ego_pull_t a;
        if (!evs_ego_pull(set, &set->vec[i], &loop, &a, NULL)) { continue; }
        h00 += (int64_t)a.k0 * a.j.j0;
        h01 += (int64_t)a.k0 * a.j.j1;
        h11 += (int64_t)a.k1 * a.j.j1;
        g0_q2 += (int64_t)a.wr_q2 * a.j.j0;
        g1_q2 += (int64_t)a.wr_q2 * a.j.j1;
    }
    evs_scaled_t h[3] = {evs_scaled(h00, 0), evs_scaled(h01, 0), evs_scaled(h11, 0)};
    evs_scaled_t step[2] = {evs_scaled(-g0_q2, -2), evs_scaled(-g1_q2, -2)};
    if (!evs_scaled_solve(h, step, 2u)) { return false; }
    for (unsigned i = 0u; i < 2u; i++) { step[i] = evs_scaled_mul(step[i], evs_scaled(eighths, -3)); }
    *v_q30 = evs_ego_move(&f, step[0], step[1]);
    return true;
}

uint32_t evs_ego_noise(const evs_ego_set_t *set, evs_vec3_t v_q30, uint32_t n_max)
{
    const evs_ego_dir_t dir = evs_ego_dir(set, v_q30);
    const uint32_t stride = (set->n + n_max - 1u) / n_max;
    uint32_t m = 0u;
    for (uint32_t i = 0u; i < set->n; i += stride) {
        const evs_ego_view_t w = evs_ego_view(&set->vec[i], dir);
        if (evs_ego_near_focus(set, &w)) { continue; }
        const int32_t r_per_a_q2 = evs_ego_over_a2_q2(set, w.c, evs_ego_inv_a2(set, w.a2));
        const uint64_t r2_q4 = (uint64_t)((int64_t)w.c * r_per_a_q2) >> (set->one_bits - 2u); /* below 2^31 */
        set->key[m++] = evs_ego_key32((uint32_t)r2_q4);
    }
    if (m == 0u) { return EVS_EGO_CLIP; }
    /* The lower quartile instead of the median: |r| of a normal distribution lies below 0.3186 sigma for a quarter.
     * With half of the vectors outliers it still falls among the good ones. 3.1383 = 1 / 0.3186, and 4 = sqrt(16). */
    const uint64_t r2_q4 = evs_ego_key_value(evs_ego_select(set->key, m, m / 4u));
    return (uint32_t)(((uint64_t)evs_sqrt_u64(r2_q4 << 16) * 205672u) >> 26);
}

uint32_t evs_ego_explained(const evs_ego_set_t *set, evs_vec3_t v_q30, uint32_t s, uint32_t n_max)
{
    const evs_ego_dir_t dir = evs_ego_dir(set, v_q30);
    const evs_ego_scale_t kernel = evs_ego_scale(s);
    const uint32_t stride = (set->n + n_max - 1u) / n_max;
    uint32_t sum = 0u;
    for (uint32_t i = 0u; i < set->n; i += stride) {
        const evs_ego_view_t w = evs_ego_view(&set->vec[i], dir);
        if (w.d <= 0) { continue; }
        const uint32_t share = evs_ego_share_q15(kernel, &w);
        sum += (share * share) >> 15;
    }
    return sum;
}

/* --- covariance ------------------------------------------------------------------------------------------------- */

static unsigned at(unsigned i, unsigned j) { return (i >= j) ? i * (i + 1u) / 2u + j : j * (j + 1u) / 2u + i; }

/* x' M y for a symmetric M. */
static evs_scaled_t form(const evs_scaled_t *m, const evs_scaled_t *x, const evs_scaled_t *y, unsigned dim)
{
    evs_scaled_t sum = {0, 0};
    for (unsigned i = 0u; i < dim; i++) {
        for (unsigned j = 0u; j < dim; j++) {
            sum = evs_scaled_add(sum, evs_scaled_mul(m[at(i, j)], evs_scaled_mul(x[i], y[j])));
        }
    }
    return sum;
}

EVS_STATIC_ASSERT(EVS_EGO_CELLS * sizeof(evs_ego_cell_sum_t) + 7u <= sizeof(evs_ego_subset_t),
                  "the cells fit, wherever an 8-byte boundary lies");

evs_ego_cell_sum_t *evs_ego_cells(const evs_ego_set_t *set)
{
    unsigned char *const at = (unsigned char *)set->subset;
    evs_ego_cell_sum_t *const cells = (evs_ego_cell_sum_t *)(void *)(at + ((8u - ((uintptr_t)at & 7u)) & 7u));
    memset(cells, 0, EVS_EGO_CELLS * sizeof cells[0]);
    return cells;
}

void evs_ego_spread(const evs_ego_cell_sum_t *cells, unsigned dim, evs_scaled_t *m)
{
    int32_t n_used = 0;
    for (unsigned i = 0u; i < dim * (dim + 1u) / 2u; i++) { m[i] = evs_scaled(0, 0); }
    for (unsigned c = 0u; c < EVS_EGO_CELLS; c++) {
        const int64_t *const z = cells[c].z;
        unsigned k = 0u;
        int64_t any = 0;
        for (unsigned i = 0u; i < dim; i++) {
            any |= z[i];
            for (unsigned j = 0u; j <= i; j++, k++) {
                m[k] = evs_scaled_add(m[k], evs_scaled_mul(evs_scaled(z[i], 2), evs_scaled(z[j], 2)));
            }
        }
        n_used += (any != 0) ? 1 : 0;
    }
    /* the sum over all cells is zero at the minimum, in as many directions as were estimated */
    const int32_t n_degrees = (n_used > (int32_t)dim) ? n_used - (int32_t)dim : 1;
    const evs_scaled_t correction = evs_scaled_div(evs_scaled(n_used, 0), evs_scaled(n_degrees, 0));
    for (unsigned i = 0u; i < dim * (dim + 1u) / 2u; i++) { m[i] = evs_scaled_mul(m[i], correction); }
}

static bool in_half(unsigned cell, unsigned half)
{
    const unsigned column = cell % EVS_EGO_COLUMNS;
    const unsigned row = cell / EVS_EGO_COLUMNS;
    const bool second = (half < 2u) ? (column >= EVS_EGO_COLUMNS / 2u) : (row >= EVS_EGO_ROWS / 2u);
    return second == ((half & 1u) != 0u);
}

evs_scaled_t evs_ego_halves_apart(const evs_ego_cell_sum_t *cells, evs_scaled_t kappa)
{
    evs_scaled_t most = evs_scaled(0, 0);
    for (unsigned half = 0u; half < 4u; half++) {
        evs_ego_cell_sum_t sum = {{0}, {0}};
        for (unsigned c = 0u; c < EVS_EGO_CELLS; c++) {
            if (!in_half(c, half)) { continue; }
            for (unsigned i = 0u; i < 3u; i++) { sum.h[i] += cells[c].h[i]; }
            for (unsigned i = 0u; i < 2u; i++) { sum.z[i] += cells[c].z[i]; }
        }
        evs_scaled_t h[3] = {evs_scaled(sum.h[0], 0), evs_scaled(sum.h[1], 0), evs_scaled(sum.h[2], 0)};
        evs_scaled_t step[2] = {evs_scaled(sum.z[0], 2), evs_scaled(sum.z[1], 2)};
        if (!evs_scaled_solve(h, step, 2u)) { continue; }
        const evs_scaled_t sq = evs_scaled_add(evs_scaled_mul(step[0], step[0]), evs_scaled_mul(step[1], step[1]));
        if (evs_scaled_less(most, sq)) { most = sq; }
    }
    return evs_scaled_div(most, evs_scaled_mul(kappa, kappa));
}

bool evs_ego_sandwich(const evs_scaled_t *h, const evs_scaled_t *m, unsigned dim, evs_scaled_t cov[3])
{
    evs_scaled_t x[2][EVS_SCALED_DIM_MAX] = {{{0, 0}}};
    for (unsigned i = 0u; i < 2u; i++) { /* the first two columns of H^-1 */
        evs_scaled_t factors[EVS_SCALED_DIM_MAX * (EVS_SCALED_DIM_MAX + 1u) / 2u];
        memcpy(factors, h, dim * (dim + 1u) / 2u * sizeof factors[0]);
        x[i][i] = evs_scaled(1, 0);
        if (!evs_scaled_solve(factors, x[i], dim)) { return false; }
    }
    cov[0] = form(m, x[0], x[0], dim);
    cov[1] = form(m, x[0], x[1], dim);
    cov[2] = form(m, x[1], x[1], dim);
    return true;
}

bool evs_ego_covariance(const evs_ego_set_t *set, const evs_ego_frame_t *f, uint32_t s, evs_scaled_t cov[4],
                        evs_scaled_t step[2])
{
    const evs_ego_loop_t loop = evs_ego_loop(set, f, s);
    evs_ego_cell_sum_t total = {{0}, {0}};
    int64_t curvature = 0; /* sum of psi' |J|^2: the trace of the true Hessian */
    uint64_t spread = 0u;  /* sum of the squares of the gradient, vector by vector */
    evs_ego_cell_sum_t *const cells = evs_ego_cells(set);
    for (uint32_t i = 0u; i < set->n; i++) {
        evs_ego_pull_t a;
        if (!evs_ego_pull(set, &set->vec[i], &loop, &a, NULL)) { continue; }
        evs_ego_cell_sum_t *const cell = &cells[evs_ego_cell(set, &set->vec[i])];
        cell->h[0] += (int64_t)a.k0 * a.j.j0;
        cell->h[1] += (int64_t)a.k0 * a.j.j1;
        cell->h[2] += (int64_t)a.k1 * a.j.j1;
        curvature += (int64_t)evs_ego_bend(&a, a.k0) * a.j.j0 + (int64_t)evs_ego_bend(&a, a.k1) * a.j.j1;
        const int32_t z0 = evs_ego_gradient(a.wr_q2, a.j.j0);
        const int32_t z1 = evs_ego_gradient(a.wr_q2, a.j.j1);
        cell->z[0] += z0;
        cell->z[1] += z1;
        spread += (uint64_t)((int64_t)z0 * z0) + (uint64_t)((int64_t)z1 * z1);
    }
    if (curvature <= 0) { return false; }
    for (unsigned c = 0u; c < EVS_EGO_CELLS; c++) {
        for (unsigned i = 0u; i < 3u; i++) { total.h[i] += cells[c].h[i]; }
        for (unsigned i = 0u; i < 2u; i++) { total.z[i] += cells[c].z[i]; }
    }
    /* cov = H^-1 M H^-1 / kappa^2, kappa being the trace of the true Hessian over that of H: the true one by itself
     * need not be positive, and its inverse would be noise. */
    const evs_scaled_t kappa = evs_scaled_div(evs_scaled(curvature, 0), evs_scaled(total.h[0] + total.h[2], 0));
    evs_scaled_t h[3];
    evs_scaled_t factors[3];
    for (unsigned i = 0u; i < 3u; i++) { factors[i] = h[i] = evs_scaled_mul(evs_scaled(total.h[i], 0), kappa); }
    for (unsigned i = 0u; i < 2u; i++) { step[i] = evs_scaled(-total.z[i], 2); }
    if (!evs_scaled_solve(factors, step, 2u)) { return false; }
    evs_scaled_t m[3];
    evs_ego_spread(cells, 2u, m);
    cov[3] = evs_ego_halves_apart(cells, kappa);
    /* cells are few: should chance have made their sums small, believe the vectors */
    const evs_scaled_t at_least = evs_scaled((int64_t)(spread >> 1), 5);
    const evs_scaled_t trace = evs_scaled_add(m[0], m[2]);
    if ((trace.m > 0) && evs_scaled_less(trace, at_least)) {
        const evs_scaled_t more = evs_scaled_div(at_least, trace);
        for (unsigned i = 0u; i < 3u; i++) { m[i] = evs_scaled_mul(m[i], more); }
    }
    return evs_ego_sandwich(h, m, 2u, cov);
}
