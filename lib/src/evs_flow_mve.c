/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_flow_kernel.h"

#if EVS_SIMD_MVE

#include <arm_mve.h>

/*
 * Eight samples at a time with Helium. With stride 2 the even bytes of a load are one pixel of each sample and the odd ones
 * the next. Sums are taken across the lanes, those of a pull into 64 bits.
 */

/* Grey Q7 from the pixels left and right in the upper and in the lower row. */
static inline int16x8_t blend(const evs_flow_place_t *at, int16x8_t upper, int16x8_t upper_right, int16x8_t lower,
                              int16x8_t lower_right)
{
    int16x8_t sum = vmulq_n_s16(upper, (int16_t)at->w00);
    sum = vmlaq_n_s16(sum, upper_right, (int16_t)at->w01);
    sum = vmlaq_n_s16(sum, lower, (int16_t)at->w10);
    return vmlaq_n_s16(sum, lower_right, (int16_t)at->w11);
}

/* Pixels k and k + 1 of each of eight samples. */
static inline void pixels(int16x8_t out[2], const uint8_t *px, size_t stride)
{
    if (stride == 1u) {
        out[0] = vreinterpretq_s16_u16(vldrbq_u16(px));
        out[1] = vreinterpretq_s16_u16(vldrbq_u16(px + 1));
    } else {
        const uint8x16_t bytes = vldrbq_u8(px);
        out[0] = vreinterpretq_s16_u16(vmovlbq_u8(bytes));
        out[1] = vreinterpretq_s16_u16(vmovltq_u8(bytes));
    }
}

static inline int16x8_t gradient(int16x8_t before, int16x8_t after)
{
    return vrshrq_n_s16(vsubq_s16(after, before), 7);
}

/* --- template ---------------------------------------------------------------------------------------------------- */

static inline void make_template(const evs_flow_t *flow, const evs_flow_place_t *at, evs_flow_texture_t *texture,
                                 size_t stride)
{
    const size_t n = flow->n_side;
    const size_t pitch = at->pitch;
    const size_t next_row = flow->n_pitch / 8u * EVS_FLOW_GROUP;
    int32_t xx = 0, xy = 0, yy = 0;
    for (size_t c = 0u; c < n; c += 8u) {
        const mve_pred16_t present = vctp16q((uint32_t)(n - c));
        const uint8_t *px = at->px - pitch - 1 + c * stride;
        int16_t *group = evs_flow_sample(flow, 0u, c);
        int16x8_t upper[4], lower[4];
        pixels(upper, px, stride);
        pixels(upper + 2, px + 2, stride);
        px += pitch;
        pixels(lower, px, stride);
        pixels(lower + 2, px + 2, stride);
        int16x8_t above = blend(at, upper[1], upper[2], lower[1], lower[2]);
        for (size_t i = 0u; i < n; i++) {
            for (size_t k = 0u; k < 4u; k++) { upper[k] = lower[k]; }
            px += pitch;
            pixels(lower, px, stride);
            pixels(lower + 2, px + 2, stride);
            const int16x8_t left = blend(at, upper[0], upper[1], lower[0], lower[1]);
            const int16x8_t here = blend(at, upper[1], upper[2], lower[1], lower[2]);
            const int16x8_t right = blend(at, upper[2], upper[3], lower[2], lower[3]);
            int16x8_t next[4];
            pixels(next, px + pitch, stride);
            pixels(next + 2, px + pitch + 2, stride);
            const int16x8_t below = blend(at, lower[1], lower[2], next[1], next[2]);
            const int16x8_t zero = vdupq_n_s16(0);
            const int16x8_t dx = vpselq_s16(gradient(left, right), zero, present);
            const int16x8_t dy = vpselq_s16(gradient(above, below), zero, present);
            vst1q_s16(group, here);
            vst1q_s16(group + EVS_FLOW_DX, dx);
            vst1q_s16(group + EVS_FLOW_DY, dy);
            xx = vmladavaq_s16(xx, dx, dx);
            xy = vmladavaq_s16(xy, dx, dy);
            yy = vmladavaq_s16(yy, dy, dy);
            group += next_row;
            if (stride == 1u) {
                above = here;
            } else {
                above = below;
                px += pitch;
                for (size_t k = 0u; k < 4u; k++) { lower[k] = next[k]; }
            }
        }
    }
    *texture = (evs_flow_texture_t){xx, xy, yy};
}

void evs_flow_template_mve(evs_flow_t *flow, evs_flow_place_t at, evs_flow_texture_t *texture)
{
    if (flow->cfg.stride_px == 1u) {
        make_template(flow, &at, texture, 1u);
    } else {
        make_template(flow, &at, texture, 2u);
    }
}

/* --- pull and difference ----------------------------------------------------------------------------------------- */

static inline int16x8_t difference_of(const evs_flow_place_t *at, const uint8_t *px, const int16_t *group,
                                      size_t stride)
{
    int16x8_t upper[2], lower[2];
    pixels(upper, px, stride);
    pixels(lower, px + at->pitch, stride);
    return vsubq_s16(blend(at, upper[0], upper[1], lower[0], lower[1]), vld1q_s16(group));
}

static inline void make_pull(const evs_flow_t *flow, const evs_flow_place_t *at, evs_flow_pull_t *pull, size_t stride)
{
    const int16_t *group = flow->samples;
    const uint8_t *row = at->px;
    int64_t x = 0, y = 0;
    for (size_t i = flow->n_side; i > 0u; i--) {
        const uint8_t *px = row;
        for (size_t c = 0u; c < flow->n_pitch; c += 8u) {
            const int16x8_t difference = difference_of(at, px, group, stride);
            x = vmlaldavaq_s16(x, vld1q_s16(group + EVS_FLOW_DX), difference);
            y = vmlaldavaq_s16(y, vld1q_s16(group + EVS_FLOW_DY), difference);
            px += 8u * stride;
            group += EVS_FLOW_GROUP;
        }
        row += stride * at->pitch;
    }
    *pull = (evs_flow_pull_t){x, y};
}

void evs_flow_pull_mve(const evs_flow_t *flow, evs_flow_place_t at, evs_flow_pull_t *pull)
{
    if (flow->cfg.stride_px == 1u) {
        make_pull(flow, &at, pull, 1u);
    } else {
        make_pull(flow, &at, pull, 2u);
    }
}

static inline uint32_t make_difference(const evs_flow_t *flow, const evs_flow_place_t *at, size_t stride)
{
    const int16_t *group = flow->samples;
    const uint8_t *row = at->px;
    uint32_t sum = 0u;
    for (size_t i = flow->n_side; i > 0u; i--) {
        const uint8_t *px = row;
        for (size_t c = 0u; c < flow->n_pitch; c += 8u) {
            const uint16x8_t size = vreinterpretq_u16_s16(vabsq_s16(difference_of(at, px, group, stride)));
            sum = (c + 8u <= flow->n_side) ? vaddvaq_u16(sum, size)
                                           : vaddvaq_p_u16(sum, size, vctp16q((uint32_t)(flow->n_side - c)));
            px += 8u * stride;
            group += EVS_FLOW_GROUP;
        }
        row += stride * at->pitch;
    }
    return sum;
}

uint32_t evs_flow_difference_mve(const evs_flow_t *flow, evs_flow_place_t at)
{
    return (flow->cfg.stride_px == 1u) ? make_difference(flow, &at, 1u) : make_difference(flow, &at, 2u);
}

#else
typedef int evs_flow_mve_empty_t; /* ISO C wants a declaration in every file. */
#endif
