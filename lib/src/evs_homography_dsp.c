/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_homography_kernel.h"

#if EVS_SIMD_DSP && !EVS_SIMD_MVE

/*
 * map_fast() of two points in 39 instructions, for cores with the DSP extension.
 *
 * No branch per point: saturation tells what is out of range. USAT and SSAT set the sticky flag Q when they change
 * something, and nothing else in the loop sets it (the accumulations stay below 2^31 by the limits in
 * evs_homography.c). Once per pair a sum of the flags and the counter decides. A pair with Q set is left to map_fast().
 *
 *     refused here                        because
 *     depth ratio outside [1/2, 3/2)      USAT to the 8 bits of a cell
 *     x or y outside 2^15 / 16 px         SSAT to 15 bits: half of what a point can hold, so that what passes is valid.
 *                                         The span lies around the origin, or around the principal point when that
 *                                         is far from it (WIDE).
 *     the marker                          taken for a point (-2048, -2048 px) it maps to outside the span. Where a long
 *                                         lens has turned so far as to see it, evs_homography_map_dsp() maps nothing.
 */

/* What the loop loads, in its order. */
typedef struct {
    int32_t wx, wy, w0;
    const int32_t (*recip)[2];
    int32_t ax, ay, a0, cx;
    int32_t bx, by, b0;
    int32_t cy;
    int32_t centre_q4; /* WIDE: both halves of the middle of the span, packed. */
    uint32_t saved[9]; /* The loop's own stack frame, here so that -fstack-usage sees it. */
} block_t;

#define OFFSET_CY    "44"
#define OFFSET_SAVED "52"
EVS_STATIC_ASSERT(offsetof(block_t, cy) == 44u, "OFFSET_CY");
EVS_STATIC_ASSERT(offsetof(block_t, saved) == 52u, "OFFSET_SAVED");

/*
 * map_pairs(block, in, out, -pairs): maps pairs of points until all are done or one is refused; returns the end of what
 * it wrote. `in` and `out` at multiples of 4: LDM and STM ask for it. n pairs are counted up from -n, so that N is the
 * only flag set while some are left; then "mrs" gives Q in bit 27 and N in bit 31, rotated by one Q in bit 28 and N in
 * bit 0. Added to the counter that is the one to count, and when Q is set a leap over zero.
 *
 * Naked functions, because all registers are in use and a frame pointer would be one too many.
 *   r0 block, r1 in, r2 out, r3 counter; from line to line: r4 r5 the points, r10 r11 their reciprocals,
 *   r12 r9 their new x, lr r8 their new y.
 */
#define MAP_PAIRS(UNBIAS)                                                                                              \
    __asm__ volatile("add    r12, r0, #" OFFSET_SAVED "     \n"                                                        \
                     "stmia  r12, {r4-r11, lr}              \n"                                                        \
                     "mov    r4, #0x80000000                \n"                                                        \
                     "msr    apsr_nzcvqg, r4                \n" /* N set, all others clear */                          \
                     "b      2f                             \n"                                                        \
                     "1:                                    \n"                                                        \
                     "stmia  r2!, {r4, r5}                  \n" /* the pair before */                                  \
                     "2:                                    \n"                                                        \
                     "ldmia  r1!, {r4, r5}                  \n"                                                        \
                     "ldmia  r0!, {r6, r7, r8, r9}          \n" /* wx wy w0 table */                                   \
                     "smlawb r10, r6, r4, r8                \n"                                                        \
                     "smlawb r8, r6, r5, r8                 \n"                                                        \
                     "smlawt r10, r7, r4, r10               \n"                                                        \
                     "smlawt r8, r7, r5, r8                 \n"                                                        \
                     "usat   r6, #8, r10, asr #15           \n" /* cells; Q if out of the table */                     \
                     "usat   r7, #8, r8, asr #15            \n"                                                        \
                     "add    r6, r9, r6, lsl #3             \n"                                                        \
                     "add    r9, r9, r7, lsl #3             \n"                                                        \
                     "ldrd   r11, r12, [r6]                 \n" /* value, slope */                                     \
                     "ldrd   r6, r7, [r9]                   \n"                                                        \
                     "smlawb r10, r12, r10, r11             \n" /* 1 / w */                                            \
                     "smlawb r11, r7, r8, r6                \n"                                                        \
                     "ldmia  r0!, {r6, r7, r8, r9}          \n" /* ax ay a0 cx */                                      \
                     "smlawb r12, r6, r4, r8                \n"                                                        \
                     "smlawb r8, r6, r5, r8                 \n"                                                        \
                     "smlawt r12, r7, r4, r12               \n"                                                        \
                     "smlawt r8, r7, r5, r8                 \n"                                                        \
                     "smmla  r12, r12, r10, r9              \n"                                                        \
                     "smmla  r9, r8, r11, r9                \n"                                                        \
                     "ssat   r12, #15, r12, asr #9          \n" /* x; Q if out of the span */                          \
                     "ssat   r9, #15, r9, asr #9            \n"                                                        \
                     "ldmia  r0!, {r6, r7, r8}              \n" /* bx by b0 */                                         \
                     "smlawb lr, r6, r4, r8                 \n"                                                        \
                     "smlawb r8, r6, r5, r8                 \n"                                                        \
                     "smlawt lr, r7, r4, lr                 \n"                                                        \
                     "smlawt r8, r7, r5, r8                 \n"                                                        \
                     "ldrd   r6, r7, [r0], #-" OFFSET_CY "  \n" /* cy centre; back to the start of the block */        \
                     "smmla  lr, lr, r10, r6                \n"                                                        \
                     "smmla  r8, r8, r11, r6                \n"                                                        \
                     "ssat   lr, #15, lr, asr #9            \n"                                                        \
                     "ssat   r8, #15, r8, asr #9            \n"                                                        \
                     "pkhbt  r4, r12, lr, lsl #16           \n"                                                        \
                     "pkhbt  r5, r9, r8, lsl #16            \n" UNBIAS "mrs    r6, apsr                       \n"      \
                     "adds   r3, r3, r6, ror #31            \n" /* one more, or the leap */                            \
                     "bmi    1b                             \n"                                                        \
                     "bne    3f                             \n"                                                        \
                     "stmia  r2!, {r4, r5}                  \n" /* zero: this was the last */                          \
                     "3:                                    \n"                                                        \
                     "add    r12, r0, #" OFFSET_SAVED "     \n"                                                        \
                     "mov    r0, r2                         \n"                                                        \
                     "ldmia  r12, {r4-r11, pc}              \n" ::                                                     \
                         : "r0", "r1", "r2", "r3", "r12", "cc", "memory")

static __attribute__((naked, noinline)) evs_point_t *map_pairs(__attribute__((unused)) block_t *block,
                                                               __attribute__((unused)) const evs_point_t *in,
                                                               __attribute__((unused)) evs_point_t *out,
                                                               __attribute__((unused)) int32_t minus_pairs)
{
    MAP_PAIRS("");
}

static __attribute__((naked, noinline)) evs_point_t *map_pairs_wide(__attribute__((unused)) block_t *block,
                                                                    __attribute__((unused)) const evs_point_t *in,
                                                                    __attribute__((unused)) evs_point_t *out,
                                                                    __attribute__((unused)) int32_t minus_pairs)
{
    MAP_PAIRS("qadd16 r4, r4, r7 \n qadd16 r5, r5, r7 \n"); /* In range: it saturates nothing, and spares the flags. */
}

#define SPAN_Q4  (1 << 15)
#define NEAR_Q13 UINT32_C(0x400000) /* 512 px */

/* Middle of the span along one axis: the principal point, as far as the span stays within what a point can hold. */
static int32_t centre_q4(int32_t c_q13) { return evs_clamp(c_q13 >> 9, -16000, 16000); }

static bool in_span(int32_t v_q4, int32_t middle_q4) { return (uint32_t)(v_q4 - middle_q4 + SPAN_Q4 / 2) < SPAN_Q4; }

size_t evs_homography_map_dsp(const evs_homography_t *h, const evs_point_t *in, size_t n, evs_point_t *out)
{
    const bool wide = (evs_abs_u32(h->cx_q13) > NEAR_Q13) || (evs_abs_u32(h->cy_q13) > NEAR_Q13);
    const int32_t x_q4 = wide ? centre_q4(h->cx_q13) : 0;
    const int32_t y_q4 = wide ? centre_q4(h->cy_q13) : 0;
    int32_t marker_x_q4, marker_y_q4;
    if (position_q4(h, MARKER, &marker_x_q4, &marker_y_q4) && in_span(marker_x_q4, x_q4) &&
        in_span(marker_y_q4, y_q4)) {
        return 0u;
    }
    if ((((uintptr_t)in | (uintptr_t)out) & 3u) != 0u) { return 0u; }

    block_t block;
    block.wx = h->wx_q35;
    block.wy = h->wy_q35;
    block.w0 = h->w0_q23;
    block.recip = evs_recip_q29;
    block.ax = h->ax_q28;
    block.ay = h->ay_q28;
    block.a0 = h->a0_q16;
    block.cx = h->cx_q13 - x_q4 * 512;
    block.bx = h->bx_q28;
    block.by = h->by_q28;
    block.b0 = h->b0_q16;
    block.cy = h->cy_q13 - y_q4 * 512;
    block.centre_q4 = (int32_t)(((uint32_t)x_q4 & 0xFFFFu) | ((uint32_t)y_q4 << 16));

    size_t done = 0u;
    while (n - done >= 2u) {
        const int32_t minus_pairs = -(int32_t)((n - done) / 2u);
        const evs_point_t *const end = wide ? map_pairs_wide(&block, in + done, out + done, minus_pairs)
                                            : map_pairs(&block, in + done, out + done, minus_pairs);
        done = (size_t)(end - out);
        if (n - done >= 2u) {
            evs_homography_map_plain(h, in + done, 2u, out + done);
            done += 2u;
        }
    }
    return done;
}

#else
typedef int evs_homography_dsp_empty_t; /* ISO C wants a declaration in every file. */
#endif
