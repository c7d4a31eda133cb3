/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_homography_kernel.h"

#if EVS_SIMD_MVE

/*
 * map_fast() of four points in 36 instructions. A group with a point that the fast path refuses, or that leaves the
 * range of a point, is left to the plain C.
 *
 * The products round down as the plain C does: VQDMLAH adds (2 a b) / 2^32, so with the coordinate times 2^15 it adds
 * coef * coordinate / 2^16. Points lie at multiples of 2, hence the loads and stores by 16 bits.
 *
 * The narrowing at the end saturates, so that one comparison of 16 bits finds what is out of range. It rounds, too, for
 * which the half in cx_q13 and cy_q13 is taken out: GNU as 2.40 assembles VQSHRN, which would not, as VQRSHRN.
 */

/* What the loop loads. */
typedef struct {
    int32_t w0[4], a0[4], b0[4];
    int32_t ax, ay, bx, by;
    int32_t wx, wy, cx, cy;
    const int32_t (*recip)[2];
    uint32_t from_q4;   /* refuse a group with a coordinate of this size */
    uint32_t saved[17]; /* The loop's own stack frame, here so that -fstack-usage sees it. */
} block_t;

EVS_STATIC_ASSERT(offsetof(block_t, ax) == 48u, "an offset in map_fours()");
EVS_STATIC_ASSERT(offsetof(block_t, wx) == 64u, "an offset in map_fours()");
EVS_STATIC_ASSERT(offsetof(block_t, recip) == 80u, "an offset in map_fours()");
EVS_STATIC_ASSERT(offsetof(block_t, saved) == 88u, "an offset in map_fours()");

/*
 * Maps groups of four until all (at least one) are done or one is refused; returns the end of what it wrote. A naked
 * function, because the compiler, short of registers, reloads and copies half as much again.
 *   r0 block, r1 in, r2 out, lr groups left, r4 and r5 table, r6 last cell, r7 from_q4, r8 r9 wx wy, r10 r11 cx cy;
 *   q0 x, q1 y, q4 reciprocals of w.
 */
static __attribute__((naked, noinline)) evs_point_t *map_fours(__attribute__((unused)) block_t *block,
                                                               __attribute__((unused)) const evs_point_t *in,
                                                               __attribute__((unused)) evs_point_t *out,
                                                               __attribute__((unused)) size_t n_fours)
{
    __asm__ volatile("add         r12, r0, #88               \n"
                     "stmia       r12!, {r4-r11, lr}         \n"
                     "vstmia      r12, {d8-d11}              \n"
                     "ldrd        r8, r9, [r0, #64]          \n"
                     "ldrd        r10, r11, [r0, #72]        \n"
                     "ldrd        r4, r7, [r0, #80]          \n"
                     "add         r5, r4, #4                 \n"
                     "mov         r6, #255                   \n"
                     "dls         lr, r3                     \n"
                     "1:                                     \n"
                     "vldrh.u16   q3, [r1], #16              \n"
                     "vldrw.u32   q2, [r0]                   \n" /* w0 */
                     "vshllb.s16  q0, q3, #15                \n"
                     "vshllt.s16  q1, q3, #15                \n"
                     "vqdmlah.s32 q2, q0, r8                 \n"
                     "vqdmlah.s32 q2, q1, r9                 \n"
                     "vshr.u32    q3, q2, #15                \n" /* cell */
                     "vcmp.u32    hi, q3, r6                 \n"
                     "vmrs        r3, p0                     \n"
                     "vshl.i32    q3, q3, #1                 \n"
                     "cbnz        r3, 2f                     \n"
                     "vldrw.u32   q4, [r4, q3, uxtw #2]      \n" /* value */
                     "vldrw.u32   q5, [r5, q3, uxtw #2]      \n" /* slope */
                     "vshl.i32    q2, q2, #16                \n"
                     "vmulh.s32   q5, q5, q2                 \n"
                     "vadd.i32    q4, q4, q5                 \n"
                     "ldrd        r3, r12, [r0, #48]         \n" /* ax ay */
                     "vldrw.u32   q2, [r0, #16]              \n" /* a0 */
                     "vqdmlah.s32 q2, q0, r3                 \n"
                     "vqdmlah.s32 q2, q1, r12                \n"
                     "vmulh.s32   q2, q2, q4                 \n"
                     "vadd.i32    q2, q2, r10                \n"
                     "ldrd        r3, r12, [r0, #56]         \n" /* bx by */
                     "vldrw.u32   q5, [r0, #32]              \n" /* b0 */
                     "vqdmlah.s32 q5, q0, r3                 \n"
                     "vqdmlah.s32 q5, q1, r12                \n"
                     "vmulh.s32   q5, q5, q4                 \n"
                     "vadd.i32    q5, q5, r11                \n"
                     "vqrshrnb.s32 q3, q2, #9                \n" /* x to the even halves */
                     "vqrshrnt.s32 q3, q5, #9                \n" /* y to the odd ones */
                     "vabs.s16    q2, q3                     \n"
                     "vcmp.u16    cs, q2, r7                 \n"
                     "vmrs        r3, p0                     \n"
                     "cbnz        r3, 2f                     \n"
                     "vstrh.16    q3, [r2], #16              \n"
                     "le          lr, 1b                     \n"
                     "2:                                     \n"
                     "add         r12, r0, #88               \n"
                     "mov         r0, r2                     \n"
                     "ldmia       r12!, {r4-r11, lr}         \n"
                     "vldmia      r12, {d8-d11}              \n"
                     "bx          lr                         \n" ::
                         : "r0", "r1", "r2", "r3", "r12", "q0", "q1", "q2", "q3", "cc", "memory");
}

/*
 * From which coordinate on a group is refused: what a point cannot hold, or where the marker would go if it were taken
 * for a point; so the marker needs no comparison of its own.
 */
static uint32_t refused_from_q4(const evs_homography_t *h)
{
    const uint32_t from_q4 = EVS_POINT_MAX_Q4 + 1;
    int32_t x_q4, y_q4;
    if (!position_q4(h, MARKER, &x_q4, &y_q4)) { return from_q4; }
    const uint32_t x_abs = evs_abs_u32(x_q4);
    const uint32_t y_abs = evs_abs_u32(y_q4);
    const uint32_t reach_q4 = (x_abs > y_abs) ? x_abs : y_abs;
    return (reach_q4 < from_q4) ? reach_q4 : from_q4;
}

size_t evs_homography_map_mve(const evs_homography_t *h, const evs_point_t *in, size_t n, evs_point_t *out)
{
    block_t block;
    for (size_t k = 0u; k < 4u; k++) {
        block.w0[k] = h->w0_q23;
        block.a0[k] = h->a0_q16;
        block.b0[k] = h->b0_q16;
    }
    block.ax = h->ax_q28;
    block.ay = h->ay_q28;
    block.bx = h->bx_q28;
    block.by = h->by_q28;
    block.wx = h->wx_q35;
    block.wy = h->wy_q35;
    block.cx = h->cx_q13 - 256;
    block.cy = h->cy_q13 - 256;
    block.recip = evs_recip_q29;
    block.from_q4 = refused_from_q4(h);

    size_t done = 0u;
    while (n - done >= 4u) {
        const evs_point_t *const end = map_fours(&block, in + done, out + done, (n - done) / 4u);
        done = (size_t)(end - out);
        if (n - done >= 4u) {
            evs_homography_map_plain(h, in + done, 4u, out + done);
            done += 4u;
        }
    }
    return done;
}

#else
typedef int evs_homography_mve_empty_t; /* ISO C wants a declaration in every file. */
#endif
