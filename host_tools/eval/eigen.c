/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "eigen.h"

#include <math.h>

#define SWEEPS 60 /* Convergence is quadratic; a handful does for n = 4. */

/* Turn rows and columns p, q so that m[p][q] becomes 0; v collects the rotations, one eigenvector per row. */
static void rotate(double *m, double *v, int n, int p, int q)
{
    const double off = m[p * n + q];
    const double theta = (m[q * n + q] - m[p * n + p]) / (2.0 * off);
    const double t = ((theta < 0.0) ? -1.0 : 1.0) / (fabs(theta) + sqrt(theta * theta + 1.0));
    const double c = 1.0 / sqrt(t * t + 1.0);
    const double s = t * c;
    for (int k = 0; k < n; k++) {
        const double a = m[k * n + p];
        const double b = m[k * n + q];
        m[k * n + p] = c * a - s * b;
        m[k * n + q] = s * a + c * b;
    }
    for (int k = 0; k < n; k++) {
        const double a = m[p * n + k];
        const double b = m[q * n + k];
        const double va = v[p * n + k];
        const double vb = v[q * n + k];
        m[p * n + k] = c * a - s * b;
        m[q * n + k] = s * a + c * b;
        v[p * n + k] = c * va - s * vb;
        v[q * n + k] = s * va + c * vb;
    }
}

static void swap_rows(double *v, int n, int a, int b)
{
    for (int k = 0; k < n; k++) {
        const double t = v[a * n + k];
        v[a * n + k] = v[b * n + k];
        v[b * n + k] = t;
    }
}

void evl_eigen_symmetric(double *m, int n, double *values, double *vectors)
{
    for (int i = 0; i < n * n; i++) { vectors[i] = (i % (n + 1) == 0) ? 1.0 : 0.0; }
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        double off = 0.0;
        for (int p = 0; p < n; p++) {
            for (int q = p + 1; q < n; q++) {
                off += fabs(m[p * n + q]);
                if (m[p * n + q] != 0.0) { rotate(m, vectors, n, p, q); }
            }
        }
        if (!(off > 0.0)) { break; }
    }
    for (int i = 0; i < n; i++) { values[i] = m[i * n + i]; }
    for (int i = 0; i < n; i++) {
        for (int k = i + 1; k < n; k++) {
            if (values[k] > values[i]) {
                const double t = values[i];
                values[i] = values[k];
                values[k] = t;
                swap_rows(vectors, n, i, k);
            }
        }
    }
}
