/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "texture.h"

#include <math.h>
#include <stdlib.h>

bool evsim_texture_init(evsim_texture_t *texture, unsigned log2_size)
{
    size_t n = 0u;
    memset(texture, 0, sizeof *texture);
    texture->log2_size = log2_size;
    for (unsigned k = 0u; k <= log2_size; k++) { n += (size_t)1u << (2u * k); }
    texture->storage = malloc(n * sizeof *texture->storage);
    if (texture->storage == NULL) { return false; }
    n = 0u;
    for (unsigned k = 0u; k <= log2_size; k++) {
        texture->level[k] = texture->storage + n;
        n += (size_t)1u << (2u * (log2_size - k));
    }
    return true;
}

void evsim_texture_finish(evsim_texture_t *texture)
{
    for (unsigned k = 1u; k <= texture->log2_size; k++) {
        const unsigned side = 1u << (texture->log2_size - k);
        const float *const fine = texture->level[k - 1u];
        float *const coarse = texture->level[k];
        for (unsigned y = 0u; y < side; y++) {
            const float *const row = fine + (size_t)(2u * y) * (2u * side);
            for (unsigned x = 0u; x < side; x++) {
                const float *const p = row + 2u * x;
                coarse[(size_t)y * side + x] = 0.25f * (p[0] + p[1] + p[2u * side] + p[2u * side + 1u]);
            }
        }
    }
}

/* The mean of samples [low, high) of a row, ends taken in part; linear between samples where it is enlarged. */
static double area_mean(const double *row, unsigned n, double low, double high)
{
    double sum = 0.0;
    unsigned first = (unsigned)low;
    if (high - low <= 1.0) { /* Enlarged: interpolate at the middle. */
        const double at = fmin(fmax(0.5 * (low + high) - 0.5, 0.0), (double)(n - 1u));
        const unsigned i = (unsigned)at;
        const unsigned next = (i + 1u < n) ? i + 1u : i;
        return row[i] + (at - (double)i) * (row[next] - row[i]);
    }
    for (; (first < n) && ((double)first < high); first++) {
        const double from = fmax(low, (double)first);
        const double to = fmin(high, (double)first + 1.0);
        sum += row[first] * (to - from);
    }
    return sum / (high - low);
}

bool evsim_texture_from_image(evsim_texture_t *texture, const uint8_t *gray, unsigned width_px, unsigned height_px)
{
    const unsigned side = 1u << texture->log2_size;
    const unsigned longest = (width_px > height_px) ? width_px : height_px;
    double *const line = malloc(longest * sizeof *line);
    double *const wide = malloc((size_t)side * height_px * sizeof *wide); /* side columns, height_px rows, by column. */
    const bool ok = (line != NULL) && (wide != NULL);
    if (ok) {
        const double step_x = (double)width_px / side;
        const double step_y = (double)height_px / side;
        for (unsigned y = 0u; y < height_px; y++) {
            for (unsigned x = 0u; x < width_px; x++) { line[x] = gray[(size_t)y * width_px + x] / 255.0; }
            for (unsigned x = 0u; x < side; x++) {
                wide[(size_t)x * height_px + y] = area_mean(line, width_px, x * step_x, (x + 1u) * step_x);
            }
        }
        for (unsigned x = 0u; x < side; x++) {
            for (unsigned y = 0u; y < side; y++) {
                texture->level[0][(size_t)y * side + x] =
                    (float)area_mean(wide + (size_t)x * height_px, height_px, y * step_y, (y + 1u) * step_y);
            }
        }
    }
    free(line);
    free(wide);
    return ok;
}

void evsim_texture_free(evsim_texture_t *texture)
{
    free(texture->storage);
    memset(texture, 0, sizeof *texture);
}
