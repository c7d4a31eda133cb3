/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_homography_kernel.h"

#if EVS_SIMD_MVE

#include <arm_mve.h>

/*
 * map_fast() of four points at a time. A group with a point that the fast path refuses, or that leaves the range of a
 * point, goes through map_fast() itself.
 *
 * The products round down as the plain C does: VQDMLAH adds (2 a b) / 2^32, so with the coordinate times 2^15 it adds
 * coef * coordinate / 2^16. Points lie at multiples of 2, hence the loads and stores by 16 bits.
 */
static inline int32x4_t apply_row(int32_t c0, int32_t cx, int32_t cy, int32x4_t x_q19, int32x4_t y_q19)
{
    return vqdmlahq_n_s32(vqdmlahq_n_s32(vdupq_n_s32(c0), x_q19, cx), y_q19, cy);
}

/*
 * From which coordinate on a group is refused: what a point cannot hold, or where the marker would go if it were taken
 * for a point; so the marker needs no comparison of its own.
 */
static uint16_t refused_from_q4(const evs_homography_t *h)
{
    const uint32_t from_q4 = EVS_POINT_MAX_Q4 + 1;
    int32_t x_q4, y_q4;
    if (!position_q4(h, MARKER, &x_q4, &y_q4)) { return (uint16_t)from_q4; }
    const uint32_t x_abs = evs_abs_u32(x_q4);
    const uint32_t y_abs = evs_abs_u32(y_q4);
    const uint32_t reach_q4 = (x_abs > y_abs) ? x_abs : y_abs;
    return (uint16_t)((reach_q4 < from_q4) ? reach_q4 : from_q4);
}

size_t evs_homography_map_mve(const evs_homography_t *h, const evs_point_t *in, size_t n, evs_point_t *out)
{
    const uint16_t from_q4 = refused_from_q4(h);
    const evs_point_t *const end = in + (n & ~(size_t)3u);
    const evs_homography_t c = *h; /* `out` cannot alias a copy */
    while (in != end) {
        const int16x8_t xy = vldrhq_s16(&in->x_q4);
        const int32x4_t x = vshllbq_n_s16(xy, 15);
        const int32x4_t y = vshlltq_n_s16(xy, 15);
        const int32x4_t w = apply_row(c.w0_q23, c.wx_q35, c.wy_q35, x, y);
        const uint32x4_t cell = vshrq_n_u32(vreinterpretq_u32_s32(w), W_CELL_BITS);
        bool refused = vcmphiq_n_u32(cell, EVS_RECIP_CELLS - 1u) != 0u;
        if (!refused) {
            const uint32x4_t at = vshlq_n_u32(cell, 1);
            const int32x4_t value = vldrwq_gather_shifted_offset_s32(&evs_recip_q29[0][0], at);
            const int32x4_t slope = vldrwq_gather_shifted_offset_s32(&evs_recip_q29[0][1], at);
            const int32x4_t r = vaddq_s32(value, vmulhq_s32(slope, vshlq_n_s32(w, 16)));
            const int32x4_t a = apply_row(c.a0_q16, c.ax_q28, c.ay_q28, x, y);
            const int32x4_t b = apply_row(c.b0_q16, c.bx_q28, c.by_q28, x, y);
            /*
             * The narrowing saturates, so that one comparison of 16 bits finds what is out of range. It rounds, too,
             * for which the half in cx_q13 is taken out: GNU as 2.40 assembles VQSHRN, which does not, as VQRSHRN.
             */
            int16x8_t p = vqrshrnbq_n_s32(xy, vaddq_n_s32(vmulhq_s32(a, r), c.cx_q13 - 256), 9);
            p = vqrshrntq_n_s32(p, vaddq_n_s32(vmulhq_s32(b, r), c.cy_q13 - 256), 9);
            refused = vcmpcsq_n_u16(vreinterpretq_u16_s16(vabsq_s16(p)), from_q4) != 0u;
            if (!refused) { vstrhq_s16(&out->x_q4, p); }
        }
        if (refused) { evs_homography_map_plain(h, in, 4u, out); }
        in += 4;
        out += 4;
    }
    return n & ~(size_t)3u;
}

#else
typedef int evs_homography_mve_empty_t; /* ISO C wants a declaration in every file. */
#endif
