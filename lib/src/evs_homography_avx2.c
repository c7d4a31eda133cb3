/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_homography_kernel.h"

#if EVS_SIMD_X86

#include <immintrin.h>

#define AVX2 __attribute__((target("avx2")))

/* The coefficients of a row, c = hi * 2^16 + lo with a signed lo, as pairs for the x and the y of a point. */
typedef struct {
    __m256i hi;
    __m256i lo;
    __m256i shift;
} row_t;

static uint32_t pair(int32_t x, int32_t y) { return ((uint32_t)x & 0xFFFFu) | ((uint32_t)y << 16); }

AVX2 static row_t make_row(int32_t cx, int32_t cy, int32_t shift)
{
    const int32_t hi_x = (cx + 0x8000) >> 16;
    const int32_t hi_y = (cy + 0x8000) >> 16;
    const row_t row = {_mm256_set1_epi32((int32_t)pair(hi_x, hi_y)), _mm256_set1_epi32((int32_t)pair(cx, cy)),
                       _mm256_set1_epi32(shift)};
    return row;
}

/* shift + cx x / 2^16 + cy y / 2^16, each rounded down: c x / 2^16 = hi x + floor(lo x / 2^16). */
AVX2 static __m256i apply_row(row_t row, __m256i xy)
{
    const __m256i ones = _mm256_set1_epi16(1);
    const __m256i high = _mm256_madd_epi16(xy, row.hi);
    const __m256i low = _mm256_madd_epi16(_mm256_mulhi_epi16(xy, row.lo), ones);
    return _mm256_add_epi32(row.shift, _mm256_add_epi32(high, low));
}

AVX2 static __m256i mul_hi(__m256i a, __m256i b)
{
    const __m256i even = _mm256_srli_epi64(_mm256_mul_epi32(a, b), 32);
    const __m256i odd = _mm256_mul_epi32(_mm256_srli_epi64(a, 32), _mm256_srli_epi64(b, 32));
    return _mm256_blend_epi32(even, odd, 0xAA);
}

AVX2 size_t evs_homography_map_avx2(const evs_homography_t *h, const evs_point_t *in, size_t n, evs_point_t *out)
{
    const row_t row_w = make_row(h->wx_q35, h->wy_q35, h->w0_q23);
    const row_t row_a = make_row(h->ax_q28, h->ay_q28, h->a0_q16);
    const row_t row_b = make_row(h->bx_q28, h->by_q28, h->b0_q16);
    const __m256i cx = _mm256_set1_epi32(h->cx_q13);
    const __m256i cy = _mm256_set1_epi32(h->cy_q13);
    const __m256i marker = _mm256_set1_epi32(MARKER);
    const __m256i most = _mm256_set1_epi32(EVS_POINT_MAX_Q4);

    size_t i = 0u;
    for (; i + 8u <= n; i += 8u) {
        const __m256i xy = _mm256_loadu_si256((const __m256i *)(const void *)(in + i));
        const __m256i w = apply_row(row_w, xy);
        const __m256i cell = _mm256_srli_epi32(w, W_CELL_BITS);
        const __m256i refused = _mm256_or_si256(_mm256_cmpgt_epi32(cell, _mm256_set1_epi32(EVS_RECIP_CELLS - 1)),
                                                _mm256_cmpeq_epi32(xy, marker));
        if (_mm256_testz_si256(refused, refused) == 0) {
            evs_homography_map_plain(h, in + i, 8u, out + i);
            continue;
        }
        const __m256i value = _mm256_i32gather_epi32(&evs_recip_q29[0][0], cell, 8);
        const __m256i slope = _mm256_i32gather_epi32(&evs_recip_q29[0][1], cell, 8);
        /* slope * f / 2^16 with f the signed low half of w: multiplied by f * 2^16, the upper half of the product. */
        const __m256i r = _mm256_add_epi32(value, mul_hi(slope, _mm256_slli_epi32(w, 16)));
        const __m256i x = _mm256_srai_epi32(_mm256_add_epi32(cx, mul_hi(apply_row(row_a, xy), r)), 9);
        const __m256i y = _mm256_srai_epi32(_mm256_add_epi32(cy, mul_hi(apply_row(row_b, xy), r)), 9);
        const __m256i beyond = _mm256_or_si256(_mm256_cmpgt_epi32(_mm256_abs_epi32(x), most),
                                               _mm256_cmpgt_epi32(_mm256_abs_epi32(y), most));
        const __m256i point = _mm256_blend_epi16(x, _mm256_slli_epi32(y, 16), 0xAA);
        _mm256_storeu_si256((__m256i *)(void *)(out + i), _mm256_blendv_epi8(point, marker, beyond));
    }
    return i;
}

#else
typedef int evs_homography_avx2_empty_t; /* ISO C wants a declaration in every file. */
#endif
