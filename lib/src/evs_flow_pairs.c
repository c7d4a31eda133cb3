/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_flow_kernel.h"

#include <string.h>

/*
 * Two samples at a time in one 32-bit register, for windows of every second pixel. Of four bytes in a row the even ones
 * are a pixel of each sample and the odd ones the next. Spread over the halves of a register, one multiplication by a
 * weight does both, since weighted sums fit 15 bits.
 *
 * The window has at most 16 x 16 samples, so that its sums fit 32 bits.
 */
EVS_STATIC_ASSERT(INT64_C(16) * 16 * EVS_FLOW_GRADIENT_MAX * EVS_FLOW_GREY_MAX <= INT32_MAX, "sums of a pull");
EVS_STATIC_ASSERT(EVS_FLOW_SIDE(EVS_FLOW_WINDOW_MAX_PX, 2) == 16u, "samples of a row");

/* Two numbers of 16 bits, the first one in the low half. */
typedef uint32_t pair_t;

#if EVS_SIMD_DSP

/* One instruction each on cores with the DSP extension; the plain C beside them is what they compute. */
static inline uint32_t load(const void *p)
{
    uint32_t v;
    memcpy(&v, p, sizeof v);
    return v;
}
static inline pair_t even_bytes(uint32_t v)
{
    pair_t out;
    __asm__("uxtb16 %0, %1" : "=r"(out) : "r"(v));
    return out;
}
static inline pair_t odd_bytes(uint32_t v)
{
    pair_t out;
    __asm__("uxtb16 %0, %1, ror #8" : "=r"(out) : "r"(v));
    return out;
}
static inline void read_pixels(const uint8_t *px, pair_t out[2])
{
    const uint32_t bytes = load(px);
    out[0] = even_bytes(bytes);
    out[1] = odd_bytes(bytes);
}
static inline void read_more_pixels(const uint8_t *px, pair_t out[4])
{
    read_pixels(px, out);
    read_pixels(px + 2, out + 2);
}
static inline pair_t read_pair(const int16_t *p) { return load(p); }
static inline void write_pair(int16_t *p, pair_t v) { memcpy(p, &v, sizeof v); }
static inline pair_t subtract(pair_t a, pair_t b)
{
    pair_t out;
    __asm__("ssub16 %0, %1, %2" : "=r"(out) : "r"(a), "r"(b));
    return out;
}
static inline int32_t add_products(int32_t acc, pair_t a, pair_t b)
{
    __asm__("smlad %0, %1, %2, %3" : "=r"(acc) : "r"(a), "r"(b), "r"(acc));
    return acc;
}
static inline pair_t gradient(pair_t before, pair_t after)
{
    const pair_t twice = subtract(after + 0x00400040u, before); /* Greys are far enough from 2^16. */
    const int32_t first = (int32_t)(twice << 16) >> 23;
    const int32_t second = (int32_t)twice >> 23;
    pair_t out;
    __asm__("pkhbt %0, %1, %2, lsl #16" : "=r"(out) : "r"(first), "r"(second));
    return out;
}

#else

static inline void read_pixels(const uint8_t *px, pair_t out[2])
{
    out[0] = px[0] | ((uint32_t)px[2] << 16);
    out[1] = px[1] | ((uint32_t)px[3] << 16);
}
static inline void read_more_pixels(const uint8_t *px, pair_t out[4])
{
    read_pixels(px, out);
    out[2] = (out[0] >> 16) | ((uint32_t)px[4] << 16);
    out[3] = (out[1] >> 16) | ((uint32_t)px[5] << 16);
}
static inline int32_t first_of(pair_t v) { return (int16_t)(v & 0xFFFFu); }
static inline int32_t second_of(pair_t v) { return (int32_t)v >> 16; }
static inline pair_t make_pair(int32_t first, int32_t second)
{
    return ((uint32_t)first & 0xFFFFu) | ((uint32_t)second << 16);
}
static inline void write_pair(int16_t *p, pair_t v)
{
    p[0] = (int16_t)first_of(v);
    p[1] = (int16_t)second_of(v);
}
static inline int32_t add_products(int32_t acc, pair_t a, pair_t b)
{
    return acc + first_of(a) * first_of(b) + second_of(a) * second_of(b);
}
static inline pair_t gradient(pair_t before, pair_t after)
{
    return make_pair(evs_flow_gradient(first_of(before), first_of(after)),
                     evs_flow_gradient(second_of(before), second_of(after)));
}

#endif

/* --- template ---------------------------------------------------------------------------------------------------- */

/*
 * Column by column of pairs, so that what lies above a sample is what lay below the one before. The pixels at -1 0 1 2
 * of a sample are read from each row: px[0] and px[1] are left of it, px[1] and px[2] around it, px[2] and px[3] right.
 */
static inline void template_column(const evs_flow_t *flow, const evs_flow_place_t *at, size_t c,
                                   evs_flow_texture_t *texture)
{
    const uint32_t w00 = at->w00, w01 = at->w01, w10 = at->w10, w11 = at->w11;
    const size_t pitch = at->pitch;
    const size_t next_row = flow->n_pitch / 8u * EVS_FLOW_GROUP;
    const uint8_t *px = at->px - pitch - 1 + 2u * c;
    int16_t *sample = evs_flow_sample(flow, 0u, c);
    int32_t xx = texture->xx, xy = texture->xy, yy = texture->yy;
    pair_t p[4];
    read_more_pixels(px, p);
    pair_t above = p[1] * w00 + p[2] * w01;
    px += pitch;
    read_more_pixels(px, p);
    above += p[1] * w10 + p[2] * w11;
    for (size_t i = flow->n_side; i > 0u; i--) {
        pair_t left = p[0] * w00 + p[1] * w01;
        pair_t here = p[1] * w00 + p[2] * w01;
        pair_t right = p[2] * w00 + p[3] * w01;
        px += pitch;
        read_more_pixels(px, p);
        left += p[0] * w10 + p[1] * w11;
        here += p[1] * w10 + p[2] * w11;
        right += p[2] * w10 + p[3] * w11;
        pair_t below = p[1] * w00 + p[2] * w01;
        const pair_t dx = gradient(left, right);
        write_pair(sample, here);
        write_pair(sample + EVS_FLOW_DX, dx);
        px += pitch;
        read_more_pixels(px, p);
        below += p[1] * w10 + p[2] * w11;
        const pair_t dy = gradient(above, below);
        write_pair(sample + EVS_FLOW_DY, dy);
        above = below;
        sample += next_row;
        xx = add_products(xx, dx, dx);
        xy = add_products(xy, dx, dy);
        yy = add_products(yy, dy, dy);
    }
    *texture = (evs_flow_texture_t){xx, xy, yy};
}

/* What lies past the samples has no gradient; of a pair with one sample the second one is taken out again. */
static void end_rows(const evs_flow_t *flow, evs_flow_texture_t *texture)
{
    for (size_t i = 0u; i < flow->n_side; i++) {
        for (size_t c = flow->n_side; c < flow->n_pitch; c++) {
            int16_t *const sample = evs_flow_sample(flow, i, c);
            if ((c % 2u == 1u) && (c == flow->n_side)) {
                const int32_t dx = sample[EVS_FLOW_DX], dy = sample[EVS_FLOW_DY];
                texture->xx -= dx * dx;
                texture->xy -= dx * dy;
                texture->yy -= dy * dy;
            }
            sample[EVS_FLOW_DX] = 0;
            sample[EVS_FLOW_DY] = 0;
        }
    }
}

void evs_flow_template_pairs(evs_flow_t *flow, evs_flow_place_t at, evs_flow_texture_t *texture)
{
    *texture = (evs_flow_texture_t){0, 0, 0};
    for (size_t c = 0u; c < flow->n_side; c += 2u) { template_column(flow, &at, c, texture); }
    if (flow->n_side < flow->n_pitch) { end_rows(flow, texture); }
}

/* --- pull and difference ----------------------------------------------------------------------------------------- */

#if EVS_SIMD_DSP

/* What the loop loads, and its own stack frame, here so that -fstack-usage sees it. */
typedef struct {
    const uint8_t *px;
    size_t pitch;
    uint32_t w00, w01, w10, w11;
    const int16_t *group;
    size_t n_rows;
    uint32_t saved[9];
} block_t;

EVS_STATIC_ASSERT(offsetof(block_t, saved) == 32u, "an offset in pull_rows()");

/*
 * One or two groups of eight samples in each row, 16 instructions a pair: the sums go to the first two words of the block.
 * Naked functions, because all registers are in use.
 *   r0 block, r1 px, r2 pitch, r3-r6 weights, r7 group, r8 and r9 the sums; r10-r12 and lr are free.
 */
#define PULL_PAIR(offset, offset_dx, offset_dy)                                                                        \
    "ldr    r10, [r1, r2]              \n"                                                                             \
    "ldr    r11, [r1], #4              \n"                                                                             \
    "uxtb16 r12, r11                   \n"                                                                             \
    "mul    lr, r12, r3                \n"                                                                             \
    "uxtb16 r11, r11, ror #8           \n"                                                                             \
    "mla    lr, r11, r4, lr            \n"                                                                             \
    "uxtb16 r12, r10                   \n"                                                                             \
    "mla    lr, r12, r5, lr            \n"                                                                             \
    "uxtb16 r10, r10, ror #8           \n"                                                                             \
    "mla    lr, r10, r6, lr            \n"                                                                             \
    "ldr    r12, [r7, #" offset "]     \n"                                                                             \
    "ssub16 lr, lr, r12                \n"                                                                             \
    "ldr    r10, [r7, #" offset_dx "]  \n"                                                                             \
    "ldr    r11, [r7, #" offset_dy "]  \n"                                                                             \
    "smlad  r8, r10, lr, r8            \n"                                                                             \
    "smlad  r9, r11, lr, r9            \n"
#define PULL_GROUP                                                                                                     \
    PULL_PAIR("0", "16", "32")                                                                                         \
    PULL_PAIR("4", "20", "36") PULL_PAIR("8", "24", "40") PULL_PAIR("12", "28", "44") "adds r7, r7, #48 \n"
#define PULL_ROWS(GROUPS, BYTES)                                                                                       \
    __asm__ volatile("add    r12, r0, #32               \n"                                                            \
                     "stmia  r12, {r4-r11, lr}          \n"                                                            \
                     "ldmia  r0, {r1-r7}                \n"                                                            \
                     "mov    r8, #0                     \n"                                                            \
                     "mov    r9, #0                     \n"                                                            \
                     "1:                                \n" GROUPS "add    r1, r1, r2, lsl #1         \n"              \
                     "sub    r1, r1, #" BYTES "         \n"                                                            \
                     "ldr    r10, [r0, #28]             \n"                                                            \
                     "subs   r10, r10, #1               \n"                                                            \
                     "str    r10, [r0, #28]             \n"                                                            \
                     "bne    1b                         \n"                                                            \
                     "stmia  r0, {r8, r9}               \n"                                                            \
                     "add    r12, r0, #32               \n"                                                            \
                     "ldmia  r12, {r4-r11, pc}          \n" ::                                                         \
                         : "memory")

static __attribute__((naked, noinline)) void pull_rows_of_one(__attribute__((unused)) block_t *block)
{
    PULL_ROWS(PULL_GROUP, "16");
}
static __attribute__((naked, noinline)) void pull_rows_of_two(__attribute__((unused)) block_t *block)
{
    PULL_ROWS(PULL_GROUP PULL_GROUP, "32");
}

void evs_flow_pull_pairs(const evs_flow_t *flow, evs_flow_place_t at, evs_flow_pull_t *pull)
{
    union {
        block_t block;
        int32_t sums[2];
    } u;
    u.block = (block_t){.px = at.px,
                        .pitch = at.pitch,
                        .w00 = at.w00,
                        .w01 = at.w01,
                        .w10 = at.w10,
                        .w11 = at.w11,
                        .group = flow->samples,
                        .n_rows = flow->n_side};
    if (flow->n_pitch == 8u) {
        pull_rows_of_one(&u.block);
    } else {
        pull_rows_of_two(&u.block);
    }
    *pull = (evs_flow_pull_t){u.sums[0], u.sums[1]};
}

/* Sum of the absolute values of two differences, added. */
static inline uint32_t add_sizes(uint32_t acc, pair_t a, pair_t b)
{
    pair_t size;
    __asm__("ssub16 %0, %1, %2 \n"
            "ssub16 %1, %2, %1 \n"
            "sel    %0, %1, %0 \n"
            : "=&r"(size), "+r"(a)
            : "r"(b)
            : "cc");
    return (uint32_t)add_products((int32_t)acc, size, 0x00010001u);
}

uint32_t evs_flow_difference_pairs(const evs_flow_t *flow, evs_flow_place_t at)
{
    uint32_t sum = 0u;
    for (size_t i = 0u; i < flow->n_side; i++) {
        const int16_t *sample = evs_flow_sample(flow, i, 0u);
        const uint8_t *px = at.px;
        size_t c = 0u;
        for (; c + 2u <= flow->n_side; c += 2u) {
            pair_t upper[2], lower[2];
            read_pixels(px, upper);
            read_pixels(px + at.pitch, lower);
            const pair_t grey = upper[0] * at.w00 + upper[1] * at.w01 + lower[0] * at.w10 + lower[1] * at.w11;
            sum = add_sizes(sum, grey, read_pair(sample));
            px += 4;
            sample += (c % 8u == 6u) ? EVS_FLOW_GROUP - 6 : 2;
        }
        if (c < flow->n_side) { sum += evs_abs_u32(evs_flow_blend(px, &at) - *sample); }
        at.px += 2u * at.pitch;
    }
    return sum;
}

#else

/* Without these instructions pairs are no faster. */
void evs_flow_pull_pairs(const evs_flow_t *flow, evs_flow_place_t at, evs_flow_pull_t *pull)
{
    evs_flow_pull_plain(flow, at, pull);
}
uint32_t evs_flow_difference_pairs(const evs_flow_t *flow, evs_flow_place_t at)
{
    return evs_flow_difference_plain(flow, at);
}

#endif
