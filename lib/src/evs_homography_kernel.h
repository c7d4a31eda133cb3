/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* One point through a homography. Private to the kernels; every variant must give these bits. */
#ifndef EVS_HOMOGRAPHY_KERNEL_H
#define EVS_HOMOGRAPHY_KERNEL_H

#include "evs/homography.h"
#include "evs_simd.h"

#define W_CELL_BITS     15 /* Depth ratio Q23: 256 cells of 2^15 on [1/2, 3/2). */
#define EVS_RECIP_CELLS 256
extern const int32_t evs_recip_q29[EVS_RECIP_CELLS][2]; /* 1 / ratio: value and slope in each cell */

/* Plain C, point by point: map_fast() of n points, also where a variant below refuses some. */
void evs_homography_map_plain(const evs_homography_t *h, const evs_point_t *in, size_t n, evs_point_t *out);

/* The map by exact division, for points that the fast path refuses. */
evs_point_t evs_homography_map_exact(const evs_homography_t *h, evs_point_t p);

/* map_fast() of eight points at a time. Only where the processor has AVX2. */
void evs_homography_map_avx2(const evs_homography_t *h, const evs_point_t *in, size_t n, evs_point_t *out);

/* The same for Arm's microcontrollers: points by two or by four. They return how many they mapped, and may leave any
 * number of points at the end. */
size_t evs_homography_map_dsp(const evs_homography_t *h, const evs_point_t *in, size_t n, evs_point_t *out);
size_t evs_homography_map_mve(const evs_homography_t *h, const evs_point_t *in, size_t n, evs_point_t *out);

#if EVS_SIMD_DSP
/* One instruction each on cores with the DSP extension; the plain C beside them is what they compute. */
static inline int32_t madw_low(int32_t acc, int32_t coef, int32_t packed)
{
    __asm__("smlawb %0, %1, %2, %3" : "=r"(acc) : "r"(coef), "r"(packed), "r"(acc));
    return acc;
}
static inline int32_t madw_high(int32_t acc, int32_t coef, int32_t packed)
{
    __asm__("smlawt %0, %1, %2, %3" : "=r"(acc) : "r"(coef), "r"(packed), "r"(acc));
    return acc;
}
static inline int32_t add_mul_hi(int32_t acc, int32_t a, int32_t b)
{
    __asm__("smmla %0, %1, %2, %3" : "=r"(acc) : "r"(a), "r"(b), "r"(acc));
    return acc;
}
#else
/* acc + coef * (half of packed) / 2^16, rounded down: the upper half of the product with the half shifted to the top,
 * which cores without such an instruction (RV32: mulh) have. */
static inline int32_t madw_low(int32_t acc, int32_t coef, int32_t packed)
{
    return acc + evs_mul_hi(coef, (int32_t)((uint32_t)packed << 16));
}
static inline int32_t madw_high(int32_t acc, int32_t coef, int32_t packed)
{
    return acc + evs_mul_hi(coef, (int32_t)((uint32_t)packed & 0xFFFF0000u));
}
static inline int32_t add_mul_hi(int32_t acc, int32_t a, int32_t b) { return acc + evs_mul_hi(a, b); }
#endif

#define MARKER ((int32_t)UINT32_C(0x80008000)) /* EVS_POINT_OUTSIDE, packed */

/* x in the low, y in the high half: how a point lies in memory on a little-endian core. */
static inline int32_t pack_point(evs_point_t p)
{
    return (int32_t)((uint32_t)(uint16_t)p.x_q4 | ((uint32_t)(uint16_t)p.y_q4 << 16));
}

/* Depth ratio less 1/2; the fast path needs [0, 1). */
static inline int32_t ratio_q23(const evs_homography_t *h, int32_t xy)
{
    return madw_high(madw_low(h->w0_q23, h->wx_q35, xy), h->wy_q35, xy);
}

/* Position of a point by its ratio, as far out as it may be; false when the ratio is none for the fast path. */
static inline bool position_q4(const evs_homography_t *h, int32_t xy, int32_t *x_q4, int32_t *y_q4)
{
    const int32_t w_q23 = ratio_q23(h, xy);
    const uint32_t cell = (uint32_t)w_q23 >> W_CELL_BITS;
    if (cell >= EVS_RECIP_CELLS) { return false; }
    const int32_t r_q29 = madw_low(evs_recip_q29[cell][0], evs_recip_q29[cell][1], w_q23);
    const int32_t a_q16 = madw_high(madw_low(h->a0_q16, h->ax_q28, xy), h->ay_q28, xy);
    const int32_t b_q16 = madw_high(madw_low(h->b0_q16, h->bx_q28, xy), h->by_q28, xy);
    *x_q4 = add_mul_hi(h->cx_q13, a_q16, r_q29) >> 9;
    *y_q4 = add_mul_hi(h->cy_q13, b_q16, r_q29) >> 9;
    return true;
}

static inline evs_point_t map_fast(const evs_homography_t *h, evs_point_t p)
{
    const int32_t xy = pack_point(p);
    int32_t x_q4, y_q4;
    if ((xy == MARKER) || !position_q4(h, xy, &x_q4, &y_q4)) { return evs_homography_map_exact(h, p); }
    if (((uint32_t)(x_q4 + EVS_POINT_MAX_Q4) > 2u * EVS_POINT_MAX_Q4) ||
        ((uint32_t)(y_q4 + EVS_POINT_MAX_Q4) > 2u * EVS_POINT_MAX_Q4)) {
        return evs_point_outside();
    }
    const evs_point_t mapped = {(int16_t)x_q4, (int16_t)y_q4};
    return mapped;
}

#endif
