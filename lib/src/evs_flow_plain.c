/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_flow_kernel.h"

/* One row of the interpolated template: pixels first, first + step, .. up to n. */
static void blend_row(int16_t *row, const uint8_t *px, const evs_flow_place_t *at, size_t first, size_t step, size_t n)
{
    for (size_t x = first; x < n; x += step) { row[x] = (int16_t)evs_flow_blend(px + x, at); }
}

/* Row i of the template from three interpolated rows. */
static void template_row(const evs_flow_t *flow, size_t i, const int16_t *above, const int16_t *here,
                         const int16_t *below, evs_flow_texture_t *texture)
{
    const size_t stride = flow->cfg.stride_px;
    int16_t *sample = evs_flow_sample(flow, i, 0u);
    int32_t xx = 0, xy = 0, yy = 0;
    size_t x = 1u;
    for (size_t c = 0u; c < flow->n_pitch; c++) {
        int32_t dx = 0, dy = 0;
        if (c < flow->n_side) {
            dx = evs_flow_gradient(here[x - 1u], here[x + 1u]);
            dy = evs_flow_gradient(above[x], below[x]);
            sample[0] = here[x];
            x += stride;
        }
        sample[EVS_FLOW_DX] = (int16_t)dx;
        sample[EVS_FLOW_DY] = (int16_t)dy;
        xx += dx * dx;
        xy += dx * dy;
        yy += dy * dy;
        sample += (c % 8u == 7u) ? EVS_FLOW_GROUP - 7 : 1;
    }
    texture->xx += xx;
    texture->xy += xy;
    texture->yy += yy;
}

void evs_flow_template_plain(evs_flow_t *flow, evs_flow_place_t at, evs_flow_texture_t *texture)
{
    const size_t width = flow->cfg.window_px + 2u;
    const size_t stride = flow->cfg.stride_px;
    int16_t *row[3];
    for (size_t k = 0u; k < 3u; k++) { row[k] = flow->rows + k * EVS_FLOW_ROW(flow->cfg.window_px); }

    *texture = (evs_flow_texture_t){0, 0, 0};
    const uint8_t *px = at.px - at.pitch - 1;
    size_t i = 0u;
    for (size_t y = 0u; y < width; y++) {
        /* Of the rows between two sampled ones only what lies above and below a sample is needed. */
        const bool sampled = (stride == 1u) || ((y & 1u) != 0u);
        blend_row(row[2], px, &at, sampled ? 0u : 1u, sampled ? 1u : 2u, width);
        if ((y >= 2u) && ((stride == 1u) || !sampled)) { template_row(flow, i++, row[0], row[1], row[2], texture); }
        int16_t *const oldest = row[0];
        row[0] = row[1];
        row[1] = row[2];
        row[2] = oldest;
        px += at.pitch;
    }
}

/* How many of the eight samples from c on there are, of n. */
static size_t in_group(size_t c, size_t n) { return (n - c < 8u) ? n - c : 8u; }

void evs_flow_pull_plain(const evs_flow_t *flow, evs_flow_place_t at, evs_flow_pull_t *pull)
{
    const size_t stride = flow->cfg.stride_px;
    const int16_t *group = flow->samples;
    *pull = (evs_flow_pull_t){0, 0};
    for (size_t i = 0u; i < flow->n_side; i++) {
        const uint8_t *px = at.px;
        int32_t x = 0, y = 0; /* at most 31 * 255 * 32640 < 2^28 */
        for (size_t c = 0u; c < flow->n_side; c += 8u) {
            const int16_t *const end = group + in_group(c, flow->n_side);
            for (const int16_t *sample = group; sample != end; sample++) {
                const int32_t difference = evs_flow_blend(px, &at) - sample[0];
                x += sample[EVS_FLOW_DX] * difference;
                y += sample[EVS_FLOW_DY] * difference;
                px += stride;
            }
            group += EVS_FLOW_GROUP;
        }
        pull->x += x;
        pull->y += y;
        at.px += stride * at.pitch;
    }
}

uint32_t evs_flow_difference_plain(const evs_flow_t *flow, evs_flow_place_t at)
{
    const size_t stride = flow->cfg.stride_px;
    const int16_t *group = flow->samples;
    uint32_t sum = 0u;
    for (size_t i = 0u; i < flow->n_side; i++) {
        const uint8_t *px = at.px;
        for (size_t c = 0u; c < flow->n_side; c += 8u) {
            const int16_t *const end = group + in_group(c, flow->n_side);
            for (const int16_t *sample = group; sample != end; sample++) {
                sum += evs_abs_u32(evs_flow_blend(px, &at) - sample[0]);
                px += stride;
            }
            group += EVS_FLOW_GROUP;
        }
        at.px += stride * at.pitch;
    }
    return sum;
}
