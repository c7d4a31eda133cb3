/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_flow_kernel.h"

#if EVS_SIMD_DSP && !EVS_SIMD_MVE

#include <string.h>

/*
 * Two samples at a time, for windows of every second pixel, on cores with the DSP extension. Of the four bytes of a word the
 * even ones are a pixel of each sample and the odd ones the next. UXTB16 spreads them over the halves of a register; a
 * multiplication by a weight then does both, since the weighted sums fit 15 bits.
 *
 * The window has at most 16 x 16 samples, so that its sums fit 32 bits.
 */
EVS_STATIC_ASSERT(INT64_C(16) * 16 * EVS_FLOW_GRADIENT_MAX * EVS_FLOW_GREY_MAX <= INT32_MAX, "sums of a pull");
EVS_STATIC_ASSERT(EVS_FLOW_SIDE(EVS_FLOW_WINDOW_MAX_PX, 2) == 16u, "samples of a row");

static inline uint32_t load(const void *p)
{
    uint32_t v;
    memcpy(&v, p, sizeof v);
    return v;
}
static inline void store(void *p, uint32_t v) { memcpy(p, &v, sizeof v); }

static inline uint32_t even_bytes(uint32_t v)
{
    uint32_t out;
    __asm__("uxtb16 %0, %1" : "=r"(out) : "r"(v));
    return out;
}
static inline uint32_t odd_bytes(uint32_t v)
{
    uint32_t out;
    __asm__("uxtb16 %0, %1, ror #8" : "=r"(out) : "r"(v));
    return out;
}
static inline uint32_t sub_halves(uint32_t a, uint32_t b)
{
    uint32_t out;
    __asm__("ssub16 %0, %1, %2" : "=r"(out) : "r"(a), "r"(b));
    return out;
}
static inline uint32_t add_halves(uint32_t a, uint32_t b)
{
    uint32_t out;
    __asm__("sadd16 %0, %1, %2" : "=r"(out) : "r"(a), "r"(b));
    return out;
}
static inline int32_t add_products(int32_t acc, uint32_t a, uint32_t b)
{
    __asm__("smlad %0, %1, %2, %3" : "=r"(acc) : "r"(a), "r"(b), "r"(acc));
    return acc;
}

/* Greys Q7 of two samples from the pixels left and right in the upper and in the lower row. */
static inline uint32_t blend(const evs_flow_place_t *w, uint32_t upper, uint32_t upper_right, uint32_t lower,
                             uint32_t lower_right)
{
    return upper * w->w00 + upper_right * w->w01 + lower * w->w10 + lower_right * w->w11;
}

/* Gradients Q1 of two samples. */
static inline uint32_t gradient(uint32_t before, uint32_t after)
{
    const uint32_t twice = add_halves(sub_halves(after, before), 0x00400040u);
    const int32_t high = (int32_t)twice >> 23;
    const int32_t low = (int32_t)(twice << 16) >> 23;
    return ((uint32_t)low & 0xFFFFu) | ((uint32_t)high << 16);
}

/* Column by column of pairs, so that what lies above a sample is what lay below the one before. */
void evs_flow_template_dsp(evs_flow_t *flow, evs_flow_place_t at, evs_flow_texture_t *texture)
{
    const size_t n = flow->n_side;
    const size_t pitch = at.pitch;
    const size_t next_row = flow->n_pitch / 8u * EVS_FLOW_GROUP;
    int32_t xx = 0, xy = 0, yy = 0;
    for (size_t c = 0u; c < flow->n_pitch; c += 2u) {
        /* The pixels of the two samples lie at -1 0 1 2: e0 o0 e2 o2, in the row of the samples and in the next one. */
        int16_t *sample = evs_flow_sample(flow, 0u, c);
        if (c >= n) {
            for (size_t i = 0u; i < n; i++) {
                store(sample + EVS_FLOW_DX, 0u);
                store(sample + EVS_FLOW_DY, 0u);
                sample += next_row;
            }
            continue;
        }
        const uint32_t mask = (c + 1u < n) ? 0xFFFFFFFFu : 0xFFFFu; /* The second one may not be a sample. */
        const uint8_t *px = at.px - pitch - 1 + 2u * c;
        uint32_t near = load(px), far = load(px + 2);
        const uint32_t top = odd_bytes(near) * at.w00 + even_bytes(far) * at.w01;
        px += pitch;
        near = load(px);
        far = load(px + 2);
        uint32_t e0 = even_bytes(near), o0 = odd_bytes(near), e2 = even_bytes(far), o2 = odd_bytes(far);
        uint32_t above = top + o0 * at.w10 + e2 * at.w11;
        for (size_t i = 0u; i < n; i++) {
            px += pitch;
            near = load(px);
            far = load(px + 2);
            uint32_t left = e0 * at.w00 + o0 * at.w01;
            uint32_t here = o0 * at.w00 + e2 * at.w01;
            uint32_t right = e2 * at.w00 + o2 * at.w01;
            e0 = even_bytes(near);
            o0 = odd_bytes(near);
            e2 = even_bytes(far);
            o2 = odd_bytes(far);
            left += e0 * at.w10 + o0 * at.w11;
            here += o0 * at.w10 + e2 * at.w11;
            right += e2 * at.w10 + o2 * at.w11;
            const uint32_t dx = gradient(left, right) & mask;
            uint32_t below = o0 * at.w00 + e2 * at.w01;
            px += pitch;
            near = load(px);
            far = load(px + 2);
            e0 = even_bytes(near);
            o0 = odd_bytes(near);
            e2 = even_bytes(far);
            o2 = odd_bytes(far);
            below += o0 * at.w10 + e2 * at.w11;
            const uint32_t dy = gradient(above, below) & mask;
            above = below;
            store(sample, here);
            store(sample + EVS_FLOW_DX, dx);
            store(sample + EVS_FLOW_DY, dy);
            sample += next_row;
            xx = add_products(xx, dx, dx);
            xy = add_products(xy, dx, dy);
            yy = add_products(yy, dy, dy);
        }
    }
    *texture = (evs_flow_texture_t){xx, xy, yy};
}

void evs_flow_pull_dsp(const evs_flow_t *flow, evs_flow_place_t at, evs_flow_pull_t *pull)
{
    const int16_t *group = flow->samples;
    const size_t n_groups = flow->n_pitch / 8u;
    const size_t next_row = 2u * at.pitch - 16u * n_groups;
    const uint8_t *px = at.px;
    int32_t x = 0, y = 0;
    for (size_t i = flow->n_side; i > 0u; i--) {
        for (size_t g = n_groups; g > 0u; g--) {
#define PAIR(k)                                                                                                        \
    do {                                                                                                               \
        const uint32_t upper = load(px + 4 * (k)), lower = load(px + at.pitch + 4 * (k));                              \
        const uint32_t grey = blend(&at, even_bytes(upper), odd_bytes(upper), even_bytes(lower), odd_bytes(lower));    \
        const uint32_t difference = sub_halves(grey, load(group + 2 * (k)));                                           \
        x = add_products(x, load(group + EVS_FLOW_DX + 2 * (k)), difference);                                          \
        y = add_products(y, load(group + EVS_FLOW_DY + 2 * (k)), difference);                                          \
    } while (0)
            PAIR(0);
            PAIR(1);
            PAIR(2);
            PAIR(3);
#undef PAIR
            px += 16;
            group += EVS_FLOW_GROUP;
        }
        px += next_row;
    }
    *pull = (evs_flow_pull_t){x, y};
}

#else
typedef int evs_flow_dsp_empty_t; /* ISO C wants a declaration in every file. */
#endif
