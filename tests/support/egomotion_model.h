/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * The estimators of evs/egomotion.h in double precision, written from their description: the robust one, the best that
 * can be done by one who knows which vectors are good, and the published ones.
 */
#ifndef EVS_TEST_EGOMOTION_MODEL_H
#define EVS_TEST_EGOMOTION_MODEL_H

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { MODEL_N_MAX = 512 };

typedef struct {
    double x, y, u, v;
} model_flow_t;

static double model_key[MODEL_N_MAX];

static int model_compare(const void *a, const void *b)
{
    const double p = *(const double *)a;
    const double q = *(const double *)b;
    return (p > q) - (p < q);
}

static double model_kth(size_t n, size_t k)
{
    qsort(model_key, n, sizeof model_key[0], model_compare);
    return model_key[k];
}

static void model_unit(double v[3])
{
    const double n = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++) { v[i] /= n; }
}

static void model_cross(const double a[3], const double b[3], double c[3])
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static void model_tangent(const double v[3], double t0[3], double t1[3])
{
    const double e[3] = {fabs(v[0]) < 0.6 ? 1.0 : 0.0, fabs(v[0]) < 0.6 ? 0.0 : 1.0, 0.0};
    model_cross(v, e, t0);
    model_unit(t0);
    model_cross(v, t0, t1);
}

/* --- the robust estimator -------------------------------------------------------------------------------------- */

/* A Gauss-Newton step times `longer`, or by the trace of the true Hessian where that is 0; s = 0 weighs all alike,
 * `bad` (or NULL) tells which vectors do not count, d > 0 or not. */
static void model_step(const model_flow_t *f, size_t n, size_t stride, double s, double rho_max,
                       const unsigned char *bad, double longer, double v[3])
{
    double t0[3], t1[3], h00 = 0, h01 = 0, h11 = 0, g0 = 0, g1 = 0, bent = 0;
    model_tangent(v, t0, t1);
    for (size_t i = 0; i < n; i += stride) {
        const double ax = f[i].x * v[2] - v[0];
        const double ay = f[i].y * v[2] - v[1];
        const double a2 = ax * ax + ay * ay;
        const double c = f[i].u * ay - f[i].v * ax;
        const double d = f[i].u * ax + f[i].v * ay;
        if ((a2 < 1.0 / 1024.0) || ((bad == NULL) ? (d <= 0.0) : (bad[i] != 0u))) { continue; }
        const double share = (s > 0.0) ? s * s / (s * s + c * c / a2) : 1.0;
        const double w = share * share / a2;
        const double p0 = f[i].x * t0[0] + f[i].y * t0[1] + t0[2];
        const double p1 = f[i].x * t1[0] + f[i].y * t1[1] + t1[2];
        const double rho = fmin(d / a2, rho_max);
        const double j0 = rho * p1;
        const double j1 = -rho * p0;
        h00 += w * j0 * j0;
        h01 += w * j0 * j1;
        h11 += w * j1 * j1;
        bent += (4.0 * share - 3.0) * w * (j0 * j0 + j1 * j1);
        g0 += w * c * j0;
        g1 += w * c * j1;
    }
    const double det = h00 * h11 - h01 * h01;
    if (longer <= 0.0) { longer = (bent > 0.0) ? (h00 + h11) / bent : 0.0; }
    if (!(det > 0.0)) { return; }
    const double d0 = -longer * (h11 * g0 - h01 * g1) / det;
    const double d1 = -longer * (h00 * g1 - h01 * g0) / det;
    for (int k = 0; k < 3; k++) { v[k] += fmax(-0.5, fmin(0.5, d0)) * t0[k] + fmax(-0.5, fmin(0.5, d1)) * t1[k]; }
    model_unit(v);
}

/* sigma from the lower quartile of |r| */
static double model_noise(const model_flow_t *f, size_t n, size_t stride, const double v[3])
{
    size_t m = 0;
    for (size_t i = 0; i < n; i += stride) {
        const double ax = f[i].x * v[2] - v[0];
        const double ay = f[i].y * v[2] - v[1];
        const double a2 = ax * ax + ay * ay;
        if (a2 >= 1.0 / 1024.0) { model_key[m++] = fabs(f[i].u * ay - f[i].v * ax) / sqrt(a2); }
    }
    return model_kth(m, m / 4u) / 0.31864;
}

/* Sum of the weights of Geman and McClure. */
static double model_explained(const model_flow_t *f, size_t n, size_t stride, double s, const double v[3])
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i += stride) {
        const double ax = f[i].x * v[2] - v[0];
        const double ay = f[i].y * v[2] - v[1];
        const double c = f[i].u * ay - f[i].v * ax;
        const double share = s * s / (s * s + c * c / (ax * ax + ay * ay));
        sum += (f[i].u * ax + f[i].v * ay > 0.0) ? share * share : 0.0;
    }
    return sum;
}

enum { MODEL_HYPOTHESES = 128, MODEL_CANDIDATES = 3 }; /* the second half of the hypotheses is the first, negated */

static void model_hypothesis(int h, double q[3])
{
    const double z = 1.0 - (h % 64 + 0.5) / 64.0;
    const double angle = (h % 64) * 3.14159265358979323846 * (3.0 - sqrt(5.0));
    const double sign = (h < 64) ? 1.0 : -1.0;
    q[0] = sign * sqrt(1.0 - z * z) * cos(angle);
    q[1] = sign * sqrt(1.0 - z * z) * sin(angle);
    q[2] = sign * z;
}

static int model_vote(const model_flow_t *f, size_t n, size_t from, size_t to, size_t m, double median,
                      const double q[3])
{
    int votes = 0;
    for (size_t k = from; k < to; k++) {
        const model_flow_t *const p = &f[k * n / m];
        const double ax = p->x * q[2] - q[0];
        const double ay = p->y * q[2] - q[1];
        const double c = p->u * ay - p->v * ax;
        const bool near = c * c <= median * median / 8.0 * (ax * ax + ay * ay);
        votes += (near && (p->u * ax + p->v * ay > 0.0)) ? 1 : 0;
    }
    return votes;
}

static void model_robust(const model_flow_t *f, size_t n, double v[3])
{
    for (size_t i = 0; i < n; i++) { model_key[i] = hypot(f[i].u, f[i].v); }
    const double median = model_kth(n, n / 2u);
    const size_t m = (n < 128u) ? n : 128u;
    const size_t some = (n + 127u) / 128u;
    int votes[MODEL_HYPOTHESES];
    int most = 0;
    for (int h = 0; h < MODEL_HYPOTHESES; h++) {
        double q[3];
        model_hypothesis(h, q);
        votes[h] = model_vote(f, n, 0u, (m + 1u) / 2u, m, median, q);
        if (votes[h] > most) { most = votes[h]; }
    }
    int first_half[MODEL_HYPOTHESES];
    memcpy(first_half, votes, sizeof votes);
    for (int h = 0; h < MODEL_HYPOTHESES; h++) {
        const int other = (h + 64) % MODEL_HYPOTHESES;
        double q[3];
        model_hypothesis(h, q);
        if ((8 * first_half[h] < 5 * most) && (8 * first_half[other] < 5 * most)) { continue; }
        votes[h] += model_vote(f, n, (m + 1u) / 2u, m, m, median, q);
    }
    double start[MODEL_CANDIDATES][3];
    int n_starts = 0;
    for (int best_of_all = 0; n_starts < MODEL_CANDIDATES; n_starts++) {
        int best = 0;
        for (int k = 1; k < MODEL_HYPOTHESES; k++) { /* the order of the library: both signs of a direction in turn */
            const int h = (k % 2) * 64 + k / 2;
            if (votes[h] > votes[best]) { best = h; }
        }
        if (n_starts == 0) { best_of_all = votes[best]; }
        if ((n_starts > 0) && (8 * votes[best] <= 5 * best_of_all)) { break; }
        model_hypothesis(best, start[n_starts]);
        for (int h = 0; h < MODEL_HYPOTHESES; h++) {
            double q[3];
            model_hypothesis(h, q);
            const double cosine = q[0] * start[n_starts][0] + q[1] * start[n_starts][1] + q[2] * start[n_starts][2];
            if (cosine > cos(25.0 * 3.14159265358979323846 / 180.0)) { votes[h] = 0; }
        }
    }
    double noise = 1e9;
    for (int k = 0; k < n_starts; k++) {
        for (int i = 0; i < 2; i++) { model_step(f, n, some, 0.5 * median, 16.0 * median, NULL, 1.0, start[k]); }
        noise = fmin(noise, model_noise(f, n, some, start[k]));
    }
    double most_explained = -1.0;
    for (int k = 0; k < n_starts; k++) {
        const double wide = fmax(0.02 * median, fmin(median, 2.25 * noise));
        model_step(f, n, some, wide, 16.0 * median, NULL, 1.0, start[k]);
        const double explained = model_explained(f, n, some, fmax(0.02 * median, fmin(median, noise)), start[k]);
        if (explained > most_explained) {
            most_explained = explained;
            memcpy(v, start[k], sizeof start[k]);
        }
    }
    for (int i = 0; i < 4; i++) {
        const size_t stride = (i == 0) ? some : ((i == 1) ? (n + 255u) / 256u : 1u);
        if (i == 2) { noise = model_noise(f, n, (n + 255u) / 256u, v); }
        const double s = fmax(0.02 * median, fmin(median, 2.25 * noise));
        model_step(f, n, stride, s, 16.0 * median, NULL, (i < 3) ? 1.375 : 0.0, v);
    }
}

/* Least squares on the good vectors, from the truth: what nobody can do better. */
static void model_oracle(const model_flow_t *f, size_t n, const unsigned char *bad, const double truth[3], double v[3])
{
    memcpy(v, truth, 3u * sizeof v[0]);
    for (int i = 0; i < 10; i++) { model_step(f, n, 1u, 0.0, 1e9, bad, 1.0, v); }
}

/* --- the published estimators ------------------------------------------------------------------------------------ */

/* Sum of w^2 r^2 with the rotation eliminated (joint) or zero; leaves the residuals in r. */
static double model_published_cost(const model_flow_t *f, size_t n, bool joint, const double *w, const double v[3],
                                   double *r)
{
    static double slope[MODEL_N_MAX][3];
    double a[3][4] = {{0}};
    double turn[3] = {0, 0, 0};
    double cost = 0.0;
    for (size_t i = 0; i < n; i++) {
        const double x = f[i].x, y = f[i].y;
        const double ax = x * v[2] - v[0], ay = y * v[2] - v[1];
        const double length = sqrt(ax * ax + ay * ay) + 1e-15;
        const double bu[3] = {x * y, -1.0 - x * x, y};
        const double bv[3] = {1.0 + y * y, -x * y, -x};
        r[i] = (f[i].u * ay - f[i].v * ax) / length;
        for (int k = 0; k < 3; k++) { slope[i][k] = (bv[k] * ax - bu[k] * ay) / length; }
        for (int k = 0; k < 3; k++) {
            for (int l = 0; l < 3; l++) { a[k][l] += w[i] * w[i] * slope[i][k] * slope[i][l]; }
            a[k][3] -= w[i] * w[i] * slope[i][k] * r[i];
        }
    }
    for (int k = 0; joint && (k < 3); k++) { /* Gauss-Jordan; the matrix is positive definite */
        for (int row = 0; row < 3; row++) {
            if (row == k) { continue; }
            const double factor = a[row][k] / a[k][k];
            for (int c = k; c < 4; c++) { a[row][c] -= factor * a[k][c]; }
        }
    }
    for (int k = 0; joint && (k < 3); k++) { turn[k] = a[k][3] / a[k][k]; }
    for (size_t i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++) { r[i] += slope[i][k] * turn[k]; }
        cost += w[i] * w[i] * r[i] * r[i];
    }
    return cost;
}

static void model_node(int azimuth, int radius, int n, double v[3])
{
    const double r = (double)radius / (n - 1);
    const double angle = 2.0 * 3.14159265358979323846 * azimuth / (n - 1);
    v[0] = r * cos(angle);
    v[1] = r * sin(angle);
    v[2] = sqrt(fabs(1.0 - r * r));
}

/* Without a sign. */
static void model_published(const model_flow_t *f, size_t n, bool joint, double best[3])
{
    static double w[MODEL_N_MAX], r[MODEL_N_MAX], sum[MODEL_N_MAX];
    double v[3];
    for (size_t i = 0; i < n; i++) {
        w[i] = 1.0;
        sum[i] = 0.0;
    }
    for (int radius = 0; radius < 11; radius++) {
        for (int azimuth = 0; azimuth < ((radius == 0) ? 1 : 11); azimuth++) {
            double mean = 0.0;
            model_node(azimuth, radius, 11, v);
            (void)model_published_cost(f, n, joint, w, v, r);
            for (size_t i = 0; i < n; i++) {
                r[i] = r[i] * r[i] / hypot(f[i].u, f[i].v);
                mean += r[i] / (double)n;
            }
            for (size_t i = 0; i < n; i++) { sum[i] += exp(-r[i] / mean) / mean; }
        }
    }
    double low = sum[0], high = sum[0];
    for (size_t i = 0; i < n; i++) {
        low = fmin(low, sum[i]);
        high = fmax(high, sum[i]);
    }
    for (size_t i = 0; i < n; i++) { w[i] = (sum[i] - low) / (high - low); }
    double least = 1e300;
    for (int radius = 0; radius < 25; radius++) {
        for (int azimuth = 0; azimuth < 25; azimuth++) {
            model_node(azimuth, radius, 25, v);
            const double cost = model_published_cost(f, n, joint, w, v, r);
            if (cost < least) {
                least = cost;
                memcpy(best, v, sizeof v);
            }
        }
    }
    for (double reach = 0.05; reach > 1e-5;) { /* a pattern search: slow, and needs no derivative */
        double t0[3], t1[3];
        bool lower = false;
        model_tangent(best, t0, t1);
        for (int k = 0; (k < 8) && !lower; k++) {
            for (int i = 0; i < 3; i++) {
                v[i] = best[i] + reach * (cos(k * 0.785398163) * t0[i] + sin(k * 0.785398163) * t1[i]);
            }
            model_unit(v);
            const double cost = model_published_cost(f, n, joint, w, v, r);
            lower = cost < least;
            if (lower) {
                least = cost;
                memcpy(best, v, sizeof v);
            }
        }
        if (!lower) { reach /= 2.0; }
    }
}

#endif
