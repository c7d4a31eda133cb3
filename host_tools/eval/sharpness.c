/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "sharpness.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RADIUS 4 /* 4 sigma. */

bool evl_sharpness_open(evl_sharpness_t *s, uint16_t width_px, uint16_t height_px)
{
    const size_t n = (size_t)width_px * height_px;
    memset(s, 0, sizeof *s);
    if (n == 0u) { return false; }
    s->width_px = width_px;
    s->height_px = height_px;
    s->count = calloc(n, sizeof *s->count);
    s->row = malloc((width_px + 2u * RADIUS) * sizeof *s->row);
    if ((s->count != NULL) && (s->row != NULL)) { return true; }
    evl_sharpness_close(s);
    return false;
}

void evl_sharpness_close(evl_sharpness_t *s)
{
    free(s->count);
    free(s->row);
    memset(s, 0, sizeof *s);
}

void evl_sharpness_clear(evl_sharpness_t *s)
{
    const size_t n = (size_t)s->width_px * s->height_px;
    for (size_t i = 0u; i < n; i++) { s->count[i] = 0.0; }
    s->n_inside = 0u;
    s->n_off = 0u;
}

/* 1/16 px to the nearest pixel, halves up, below 0 too: counted from -2048 px, where nothing is negative. */
static int nearest_px(int16_t q4) { return (int)((unsigned)(q4 + 2048 * 16 + 8) / 16u) - 2048; }

void evl_sharpness_add(evl_sharpness_t *s, const evs_point_t *points, size_t n)
{
    for (size_t i = 0u; i < n; i++) { /* The marker of a missing position is off every sensor. */
        const int x = nearest_px(points[i].x_q4);
        const int y = nearest_px(points[i].y_q4);
        if ((x >= 0) && (y >= 0) && (x < s->width_px) && (y < s->height_px)) {
            s->count[(size_t)y * s->width_px + (size_t)x] += 1.0;
            s->n_inside++;
        } else {
            s->n_off++;
        }
    }
}

/* Mirror an index into [0, n): ... 1 0 | 0 1 .. n-1 | n-1 n-2 ..., over and over on a sensor of very few pixels. */
static size_t mirrored(int i, int n)
{
    while ((i < 0) || (i >= n)) { i = (i < 0) ? -1 - i : 2 * n - 1 - i; }
    return (size_t)i;
}

/* Weights of offsets 0..RADIUS; with both sides they sum to 1. */
static void gaussian(double weight[RADIUS + 1])
{
    double sum = 0.0;
    for (int i = 0; i <= RADIUS; i++) {
        weight[i] = exp(-0.5 * i * i);
        sum += (i == 0) ? weight[i] : 2.0 * weight[i];
    }
    for (int i = 0; i <= RADIUS; i++) { weight[i] /= sum; }
}

/* Row y blurred along y, with the mirrored border that the blur along x needs. */
static void blur_column_wise(const evl_sharpness_t *s, int y, const double *weight)
{
    const int w = s->width_px;
    double *const row = s->row + RADIUS;
    const double *const middle = s->count + (size_t)y * s->width_px;
    for (int x = 0; x < w; x++) { row[x] = weight[0] * middle[x]; }
    for (int k = 1; k <= RADIUS; k++) {
        const double *const above = s->count + mirrored(y - k, s->height_px) * s->width_px;
        const double *const below = s->count + mirrored(y + k, s->height_px) * s->width_px;
        for (int x = 0; x < w; x++) { row[x] += weight[k] * (above[x] + below[x]); }
    }
    for (int k = 1; k <= RADIUS; k++) {
        row[-k] = row[mirrored(-k, w)];
        row[w - 1 + k] = row[mirrored(w - 1 + k, w)];
    }
}

double evl_sharpness_value(const evl_sharpness_t *s)
{
    const double n = (double)s->width_px * s->height_px;
    const double mean = (double)s->n_inside / n; /* The blur keeps it. */
    const double *const row = s->row + RADIUS;
    double weight[RADIUS + 1];
    double sum = 0.0;
    double squares = 0.0;
    gaussian(weight);
    for (int y = 0; y < s->height_px; y++) {
        blur_column_wise(s, y, weight);
        for (int x = 0; x < s->width_px; x++) {
            double v = weight[0] * row[x] - mean;
            for (int k = 1; k <= RADIUS; k++) { v += weight[k] * (row[x - k] + row[x + k]); }
            sum += v;
            squares += v * v;
        }
    }
    return squares / n - (sum / n) * (sum / n);
}
