/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_flow_kernel.h"

#if EVS_SIMD_X86

#include <emmintrin.h>

/*
 * Eight samples at a time, column by column of such groups, so that a row of pixels is loaded once and kept for the row
 * above it. With stride 2 the even bytes of a load are one pixel of each sample and the odd ones the next.
 *
 * Sums of gradient times difference: a 32-bit lane takes 8 samples of each of 31 rows at most.
 */
EVS_STATIC_ASSERT(INT64_C(31) * 8 * EVS_FLOW_GRADIENT_MAX * EVS_FLOW_GREY_MAX <= INT32_MAX, "lanes of a pull");

typedef struct {
    __m128i w00, w01, w10, w11;
} weights_t;

static inline weights_t weights_of(const evs_flow_place_t *at)
{
    const weights_t w = {_mm_set1_epi16((int16_t)at->w00), _mm_set1_epi16((int16_t)at->w01),
                         _mm_set1_epi16((int16_t)at->w10), _mm_set1_epi16((int16_t)at->w11)};
    return w;
}

/* Grey Q7 from the pixels left and right in the upper and in the lower row. */
static inline __m128i blend(const weights_t *w, __m128i upper, __m128i upper_right, __m128i lower, __m128i lower_right)
{
    const __m128i above = _mm_add_epi16(_mm_mullo_epi16(upper, w->w00), _mm_mullo_epi16(upper_right, w->w01));
    const __m128i below = _mm_add_epi16(_mm_mullo_epi16(lower, w->w10), _mm_mullo_epi16(lower_right, w->w11));
    return _mm_add_epi16(above, below);
}

static inline __m128i load(const int16_t *p) { return _mm_loadu_si128((const __m128i *)(const void *)p); }
static inline void store(int16_t *p, __m128i v) { _mm_storeu_si128((__m128i *)(void *)p, v); }

/* N pixels from px on for each of eight samples. */
static inline void pixels(__m128i *out, const uint8_t *px, size_t stride, size_t n)
{
    if (stride == 1u) {
        for (size_t k = 0u; k < n; k++) {
            out[k] = _mm_unpacklo_epi8(_mm_loadl_epi64((const __m128i *)(const void *)(px + k)), _mm_setzero_si128());
        }
    } else {
        for (size_t k = 0u; k < n; k += 2u) {
            const __m128i bytes = _mm_loadu_si128((const __m128i *)(const void *)(px + k));
            out[k] = _mm_and_si128(bytes, _mm_set1_epi16(0xFF));
            out[k + 1u] = _mm_srli_epi16(bytes, 8);
        }
    }
}

/* All bits set in the samples c .. c + 7 that there are, of n. */
static inline __m128i present(size_t c, size_t n)
{
    const __m128i index = _mm_set_epi16(7, 6, 5, 4, 3, 2, 1, 0);
    return _mm_cmplt_epi16(index, _mm_set1_epi16((int16_t)(n - c)));
}

static inline __m128i gradient(__m128i before, __m128i after)
{
    return _mm_srai_epi16(_mm_add_epi16(_mm_sub_epi16(after, before), _mm_set1_epi16(64)), 7);
}

static inline int64_t sum_lanes(__m128i v)
{
    int32_t lane[4];
    _mm_storeu_si128((__m128i *)(void *)lane, v);
    return ((int64_t)lane[0] + lane[1]) + ((int64_t)lane[2] + lane[3]);
}

/* --- template ---------------------------------------------------------------------------------------------------- */

static inline void make_template(evs_flow_t *flow, const evs_flow_place_t *at, evs_flow_texture_t *texture,
                                 size_t stride)
{
    const weights_t w = weights_of(at);
    const size_t n = flow->n_side;
    const size_t pitch = at->pitch;
    __m128i xx = _mm_setzero_si128(), xy = xx, yy = xx;
    for (size_t c = 0u; c < flow->n_pitch; c += 8u) {
        const uint8_t *px = at->px - pitch - 1 + c * stride;
        const __m128i mask = present(c, n);
        __m128i first[4], second[4], third[4]; /* The row of the samples and the two below it. */
        pixels(third, px, stride, 4u);
        px += pitch;
        pixels(first, px, stride, 4u);
        __m128i above = blend(&w, third[1], third[2], first[1], first[2]);
        __m128i here = above;
        for (size_t i = 0u; i < n; i++) {
            if ((stride == 2u) || (i == 0u)) { /* With stride 1 they were below the row before. */
                px += pitch;
                pixels(second, px, stride, 4u);
                here = blend(&w, first[1], first[2], second[1], second[2]);
            }
            const __m128i left = blend(&w, first[0], first[1], second[0], second[1]);
            const __m128i right = blend(&w, first[2], first[3], second[2], second[3]);
            px += pitch;
            pixels(third, px, stride, 4u);
            const __m128i below = blend(&w, second[1], second[2], third[1], third[2]);
            const __m128i dx = _mm_and_si128(gradient(left, right), mask);
            const __m128i dy = _mm_and_si128(gradient(above, below), mask);
            int16_t *const group = evs_flow_sample(flow, i, c);
            store(group, here);
            store(group + EVS_FLOW_DX, dx);
            store(group + EVS_FLOW_DY, dy);
            xx = _mm_add_epi32(xx, _mm_madd_epi16(dx, dx));
            xy = _mm_add_epi32(xy, _mm_madd_epi16(dx, dy));
            yy = _mm_add_epi32(yy, _mm_madd_epi16(dy, dy));
            above = (stride == 1u) ? here : below;
            here = below;
            for (size_t k = 0u; k < 4u; k++) {
                first[k] = (stride == 1u) ? second[k] : third[k];
                second[k] = third[k];
            }
        }
    }
    texture->xx = (int32_t)sum_lanes(xx);
    texture->xy = (int32_t)sum_lanes(xy);
    texture->yy = (int32_t)sum_lanes(yy);
}

void evs_flow_template_sse2(evs_flow_t *flow, evs_flow_place_t at, evs_flow_texture_t *texture)
{
    if (flow->cfg.stride_px == 1u) {
        make_template(flow, &at, texture, 1u);
    } else {
        make_template(flow, &at, texture, 2u);
    }
}

/* --- pull and difference ----------------------------------------------------------------------------------------- */

static inline void make_pull(const evs_flow_t *flow, const evs_flow_place_t *at, evs_flow_pull_t *pull, size_t stride)
{
    const weights_t w = weights_of(at);
    const size_t n = flow->n_side;
    __m128i x = _mm_setzero_si128(), y = x;
    for (size_t c = 0u; c < flow->n_pitch; c += 8u) {
        const uint8_t *px = at->px + c * stride;
        const int16_t *group = evs_flow_sample(flow, 0u, c);
        const size_t next_row = flow->n_pitch / 8u * EVS_FLOW_GROUP;
        __m128i upper[2], lower[2];
        pixels(upper, px, stride, 2u);
        for (size_t i = 0u; i < n; i++) {
            px += at->pitch;
            pixels(lower, px, stride, 2u);
            const __m128i grey = blend(&w, upper[0], upper[1], lower[0], lower[1]);
            const __m128i difference = _mm_sub_epi16(grey, load(group));
            x = _mm_add_epi32(x, _mm_madd_epi16(load(group + EVS_FLOW_DX), difference));
            y = _mm_add_epi32(y, _mm_madd_epi16(load(group + EVS_FLOW_DY), difference));
            group += next_row;
            if (stride == 1u) {
                upper[0] = lower[0];
                upper[1] = lower[1];
            } else if (i + 1u < n) {
                px += at->pitch;
                pixels(upper, px, stride, 2u);
            }
        }
    }
    pull->x = sum_lanes(x);
    pull->y = sum_lanes(y);
}

void evs_flow_pull_sse2(const evs_flow_t *flow, evs_flow_place_t at, evs_flow_pull_t *pull)
{
    if (flow->cfg.stride_px == 1u) {
        make_pull(flow, &at, pull, 1u);
    } else {
        make_pull(flow, &at, pull, 2u);
    }
}

static inline uint32_t make_difference(const evs_flow_t *flow, const evs_flow_place_t *at, size_t stride)
{
    const weights_t w = weights_of(at);
    __m128i sum = _mm_setzero_si128();
    for (size_t c = 0u; c < flow->n_pitch; c += 8u) {
        const uint8_t *px = at->px + c * stride;
        const __m128i mask = present(c, flow->n_side);
        for (size_t i = 0u; i < flow->n_side; i++) {
            __m128i upper[2], lower[2];
            pixels(upper, px, stride, 2u);
            pixels(lower, px + at->pitch, stride, 2u);
            const __m128i difference =
                _mm_sub_epi16(blend(&w, upper[0], upper[1], lower[0], lower[1]), load(evs_flow_sample(flow, i, c)));
            const __m128i size = _mm_max_epi16(difference, _mm_sub_epi16(_mm_setzero_si128(), difference));
            sum = _mm_add_epi32(sum, _mm_madd_epi16(_mm_and_si128(size, mask), _mm_set1_epi16(1)));
            px += stride * at->pitch;
        }
    }
    return (uint32_t)sum_lanes(sum);
}

uint32_t evs_flow_difference_sse2(const evs_flow_t *flow, evs_flow_place_t at)
{
    return (flow->cfg.stride_px == 1u) ? make_difference(flow, &at, 1u) : make_difference(flow, &at, 2u);
}

#else
typedef int evs_flow_sse2_empty_t; /* ISO C wants a declaration in every file. */
#endif
