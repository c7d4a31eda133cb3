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

/* A Gauss-Newton step; s = 0 weighs all alike, `use` (or NULL) tells which vectors count, d > 0 or not. */
static void model_step(const model_flow_t *f, size_t n, size_t stride, double s, double rho_max,
                       const unsigned char *bad, double v[3])
{
    double t0[3], t1[3], h00 = 0, h01 = 0, h11 = 0, g0 = 0, g1 = 0;
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
        g0 += w * c * j0;
        g1 += w * c * j1;
    }
    const double det = h00 * h11 - h01 * h01;
    if (!(det > 0.0)) { return; }
    const double d0 = -(h11 * g0 - h01 * g1) / det;
    const double d1 = -(h00 * g1 - h01 * g0) / det;
    for (int k = 0; k < 3; k++) { v[k] += fmax(-0.5, fmin(0.5, d0)) * t0[k] + fmax(-0.5, fmin(0.5, d1)) * t1[k]; }
    model_unit(v);
}

/* sigma from the lower quartile of |r| */
static double model_noise(const model_flow_t *f, size_t n, const double v[3])
{
    const size_t stride = (n + 255u) / 256u;
    size_t m = 0;
    for (size_t i = 0; i < n; i += stride) {
        const double ax = f[i].x * v[2] - v[0];
        const double ay = f[i].y * v[2] - v[1];
        const double a2 = ax * ax + ay * ay;
        if (a2 >= 1.0 / 1024.0) { model_key[m++] = fabs(f[i].u * ay - f[i].v * ax) / sqrt(a2); }
    }
    return model_kth(m, m / 4u) / 0.31864;
}

static void model_robust(const model_flow_t *f, size_t n, double v[3])
{
    for (size_t i = 0; i < n; i++) { model_key[i] = hypot(f[i].u, f[i].v); }
    const double median = model_kth(n, n / 2u);
    const size_t m = (n < 128u) ? n : 128u;
    size_t most = 0;
    for (int h = 0; h < 64; h++) {
        const double z = 1.0 - (h + 0.5) / 64.0;
        const double angle = h * 3.14159265358979323846 * (3.0 - sqrt(5.0));
        const double q[3] = {sqrt(1.0 - z * z) * cos(angle), sqrt(1.0 - z * z) * sin(angle), z};
        size_t votes[2] = {0, 0};
        for (size_t k = 0; k < m; k++) {
            const model_flow_t *const p = &f[k * n / m];
            const double ax = p->x * q[2] - q[0];
            const double ay = p->y * q[2] - q[1];
            const double c = p->u * ay - p->v * ax;
            if (c * c <= median * median / 8.0 * (ax * ax + ay * ay)) { votes[p->u * ax + p->v * ay > 0.0]++; }
        }
        for (int sign = 1; sign >= 0; sign--) {
            if (votes[sign] > most) {
                most = votes[sign];
                for (int k = 0; k < 3; k++) { v[k] = (sign == 1) ? q[k] : -q[k]; }
            }
        }
    }
    for (int i = 0; i < 2; i++) { model_step(f, n, (n + 127u) / 128u, 0.5 * median, 16.0 * median, NULL, v); }
    double s = 0.0;
    for (int i = 0; i < 4; i++) {
        if (i % 2 == 0) { s = fmax(0.02 * median, fmin(median, 2.25 * model_noise(f, n, v))); }
        model_step(f, n, (i < 2) ? (n + 255u) / 256u : 1u, s, 16.0 * median, NULL, v);
    }
}

/* Least squares on the good vectors, from the truth: what nobody can do better. */
static void model_oracle(const model_flow_t *f, size_t n, const unsigned char *bad, const double truth[3], double v[3])
{
    memcpy(v, truth, 3u * sizeof v[0]);
    for (int i = 0; i < 10; i++) { model_step(f, n, 1u, 0.0, 1e9, bad, v); }
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
