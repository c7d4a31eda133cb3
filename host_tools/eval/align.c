/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "align.h"

#include <math.h>
#include <string.h>

#include "eigen.h"

#define SECOND_US    1000000
#define REST_RAD     (1.0 / EVL_DEG_PER_RAD) /* Turned by this much, the truth has started to move... */
#define REST_LEAD_US 100000                  /* ...and a little before that, it had too. */

/* Motion between two samples that far apart tells the mounting: long against the noise, short against the drift. */
#define LAG_US 200000

#define ITERATIONS 50
#define DONE_RAD   1e-12

evl_quat_t evl_align_apply(const evl_align_t *align, evl_quat_t ref)
{
    return evl_quat_mul(evl_quat_mul(align->left, ref), align->right);
}

bool evl_align_is_told(const evl_align_t *align, double rmse_rad)
{
    return (align->kind != EVL_ALIGN_FULL) || ((align->spread_rad >= EVL_ALIGN_SPREAD_MIN_RAD) &&
                                               (align->spread_rad >= EVL_ALIGN_SPREAD_PER_RMSE * rmse_rad));
}

/* The last second of rest before the truth starts to turn, else the first second. */
static void choose_second(evl_align_t *a, const evl_pair_t *pair, size_t n)
{
    a->from_us = pair[0].t_us;
    a->at_rest = false;
    for (size_t i = 0u; i < n; i++) {
        if (evl_quat_angle(evl_quat_mul(evl_quat_conj(pair[0].ref), pair[i].ref)) > REST_RAD) {
            const int64_t rest_end_us = pair[i].t_us - REST_LEAD_US;
            a->at_rest = (rest_end_us - pair[0].t_us >= SECOND_US);
            if (a->at_rest) { a->from_us = rest_end_us - SECOND_US; }
            break;
        }
    }
    a->to_us = a->from_us + SECOND_US;
    if (a->to_us > pair[n - 1u].t_us) { a->to_us = pair[n - 1u].t_us; }
}

static bool in_second(const evl_align_t *a, const evl_pair_t *p)
{
    return (p->t_us >= a->from_us) && (p->t_us <= a->to_us);
}

/* Circular mean of the heading of e. */
static evl_quat_t mean_heading(const evl_align_t *a, const evl_pair_t *pair, size_t n)
{
    double s = 0.0;
    double c = 0.0;
    evl_vec3_t r = {0.0, 0.0, 0.0};
    for (size_t i = 0u; i < n; i++) {
        const evl_quat_t e = evl_quat_mul(pair[i].est, evl_quat_conj(pair[i].ref));
        const double heading = 2.0 * atan2(e.z, e.w);
        if (!in_second(a, &pair[i])) { continue; }
        s += sin(heading);
        c += cos(heading);
    }
    r.z = atan2(s, c);
    return evl_quat_exp(r);
}

/* The rotation nearest to all est . (ref . right)^-1: top eigenvector of the sum of their outer products. */
static evl_quat_t mean_left(const evl_align_t *a, const evl_pair_t *pair, size_t n, bool all)
{
    double m[16] = {0.0};
    double vectors[16];
    double values[4];
    for (size_t i = 0u; i < n; i++) {
        const evl_quat_t e = evl_quat_mul(pair[i].est, evl_quat_conj(evl_quat_mul(pair[i].ref, a->right)));
        const double part[4] = {e.w, e.x, e.y, e.z};
        if (!all && !in_second(a, &pair[i])) { continue; }
        for (int k = 0; k < 16; k++) { m[k] += part[k / 4] * part[k % 4]; }
    }
    evl_eigen_symmetric(m, 4, values, vectors);
    return evl_quat_unit(evl_quat(&vectors[0]));
}

/* The mounting from how both turn: est_i^-1 est_j = right^-1 (ref_i^-1 ref_j) right, so that the rotation vectors obey
 * r_ref = right r_est. The best such rotation by Horn's quaternion method. */
static evl_quat_t first_right(const evl_pair_t *pair, size_t n)
{
    double s[3][3] = {{0.0}};
    double m[16];
    double vectors[16];
    double values[4];
    size_t j = 0u;
    for (size_t i = 0u; i < n; i++) {
        while ((j < n) && (pair[j].t_us - pair[i].t_us < LAG_US)) { j++; }
        if (j == n) { break; }
        if (pair[j].t_us - pair[i].t_us < 2 * LAG_US) {
            const evl_vec3_t e = evl_quat_log(evl_quat_mul(evl_quat_conj(pair[i].est), pair[j].est));
            const evl_vec3_t r = evl_quat_log(evl_quat_mul(evl_quat_conj(pair[i].ref), pair[j].ref));
            const double from[3] = {e.x, e.y, e.z};
            const double to[3] = {r.x, r.y, r.z};
            for (int k = 0; k < 9; k++) { s[k / 3][k % 3] += from[k / 3] * to[k % 3]; }
        }
    }
    m[0] = s[0][0] + s[1][1] + s[2][2];
    m[1] = m[4] = s[1][2] - s[2][1];
    m[2] = m[8] = s[2][0] - s[0][2];
    m[3] = m[12] = s[0][1] - s[1][0];
    m[5] = s[0][0] - s[1][1] - s[2][2];
    m[6] = m[9] = s[0][1] + s[1][0];
    m[7] = m[13] = s[2][0] + s[0][2];
    m[10] = s[1][1] - s[0][0] - s[2][2];
    m[11] = m[14] = s[1][2] + s[2][1];
    m[15] = s[2][2] - s[0][0] - s[1][1];
    evl_eigen_symmetric(m, 4, values, vectors);
    return evl_quat_unit(evl_quat(&vectors[0]));
}

static void to_matrix(evl_quat_t q, double r[3][3])
{
    static const evl_vec3_t AXIS[3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    for (int k = 0; k < 3; k++) {
        const evl_vec3_t column = evl_quat_rotate(q, AXIS[k]);
        r[0][k] = column.x;
        r[1][k] = column.y;
        r[2][k] = column.z;
    }
}

/* x = pseudo-inverse(m) b: directions that the motion does not tell are left as they are. */
static void solve_known(double m[9], double n, const double b[3], double x[3], double *least)
{
    double values[3];
    double vectors[9];
    evl_eigen_symmetric(m, 3, values, vectors);
    *least = values[2];
    x[0] = x[1] = x[2] = 0.0;
    for (int k = 0; k < 3; k++) {
        const double *const v = &vectors[3 * k];
        if (values[k] <= 1e-9 * n) { continue; }
        for (int i = 0; i < 3; i++) { x[i] += v[i] * (v[0] * b[0] + v[1] * b[1] + v[2] * b[2]) / values[k]; }
    }
}

/* One step of Gauss and Newton on small rotations a (to the left) and b (to the right): the error
 * log(est . (left ref right)^-1) changes by a + R_i b, with R_i the aligned truth. @return the size of the step. */
static double improve(evl_align_t *align, const evl_pair_t *pair, size_t n)
{
    double sum_r[3][3] = {{0.0}};
    double sum_e[3] = {0.0};
    double sum_rte[3] = {0.0};
    double m[9];
    double rhs[3];
    double b[3];
    double a[3];
    double least = 0.0;
    evl_vec3_t step;
    double size;

    for (size_t i = 0u; i < n; i++) {
        const evl_quat_t predicted = evl_align_apply(align, pair[i].ref);
        const evl_vec3_t log_e = evl_quat_log(evl_quat_mul(pair[i].est, evl_quat_conj(predicted)));
        const double e[3] = {log_e.x, log_e.y, log_e.z};
        double r[3][3];
        to_matrix(predicted, r);
        for (int k = 0; k < 9; k++) {
            sum_r[k / 3][k % 3] += r[k / 3][k % 3];
            sum_rte[k % 3] += r[k / 3][k % 3] * e[k / 3];
        }
        for (int k = 0; k < 3; k++) { sum_e[k] += e[k]; }
    }
    /* Eliminate a; what is left of b is how much the orientations differ from each other. */
    for (int i = 0; i < 3; i++) {
        rhs[i] = sum_rte[i];
        for (int k = 0; k < 3; k++) {
            rhs[i] -= sum_r[k][i] * sum_e[k] / (double)n;
            m[3 * i + k] = (i == k) ? (double)n : 0.0;
            for (int l = 0; l < 3; l++) { m[3 * i + k] -= sum_r[l][i] * sum_r[l][k] / (double)n; }
        }
    }
    solve_known(m, (double)n, rhs, b, &least);
    for (int i = 0; i < 3; i++) {
        a[i] = sum_e[i];
        for (int k = 0; k < 3; k++) { a[i] -= sum_r[i][k] * b[k]; }
        a[i] /= (double)n;
    }
    align->spread_rad = sqrt((least > 0.0) ? least / (double)n : 0.0);
    step.x = a[0];
    step.y = a[1];
    step.z = a[2];
    size = evl_norm(step);
    align->left = evl_quat_unit(evl_quat_mul(evl_quat_exp(step), align->left));
    step.x = b[0];
    step.y = b[1];
    step.z = b[2];
    align->right = evl_quat_unit(evl_quat_mul(align->right, evl_quat_exp(step)));
    return size + evl_norm(step);
}

evl_align_t evl_align(evl_align_kind_t kind, const evl_pair_t *pair, size_t n)
{
    evl_align_t a;
    memset(&a, 0, sizeof a);
    a.kind = kind;
    a.left = evl_quat_identity();
    a.right = evl_quat_identity();
    a.from_us = pair[0].t_us;
    a.to_us = pair[n - 1u].t_us;
    switch (kind) {
    case EVL_ALIGN_NONE:
        break;
    case EVL_ALIGN_HEADING:
        choose_second(&a, pair, n);
        a.left = mean_heading(&a, pair, n);
        break;
    case EVL_ALIGN_WORLD:
        choose_second(&a, pair, n);
        a.left = mean_left(&a, pair, n, false);
        break;
    case EVL_ALIGN_FULL:
        a.right = first_right(pair, n);
        a.left = mean_left(&a, pair, n, true);
        for (int i = 0; (i < ITERATIONS) && (improve(&a, pair, n) > DONE_RAD); i++) {}
        break;
    }
    return a;
}
