/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_homography_kernel.h"

#if EVS_SIMD_X86

#include <immintrin.h>
#include <string.h>

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

static int64_t cell_at(uint64_t index)
{
    int64_t cell;
    memcpy(&cell, evs_recip_q29[index], sizeof cell);
    return cell;
}

typedef struct { /* Of points 0 2 4 6 and of points 1 3 5 7, one in 64 bits. */
    __m256i even;
    __m256i odd;
} halves_t;

/* The table's cells, value below slope. Plain loads are faster than the gather instructions. */
AVX2 static halves_t look_up(__m256i index)
{
    const __m128i low = _mm256_castsi256_si128(index);
    const __m128i high = _mm256_extracti128_si256(index, 1);
    const uint64_t i01 = (uint64_t)_mm_cvtsi128_si64(low);
    const uint64_t i23 = (uint64_t)_mm_extract_epi64(low, 1);
    const uint64_t i45 = (uint64_t)_mm_cvtsi128_si64(high);
    const uint64_t i67 = (uint64_t)_mm_extract_epi64(high, 1);
    const halves_t cells = {
        _mm256_setr_epi64x(cell_at((uint32_t)i01), cell_at((uint32_t)i23), cell_at((uint32_t)i45),
                           cell_at((uint32_t)i67)),
        _mm256_setr_epi64x(cell_at(i01 >> 32), cell_at(i23 >> 32), cell_at(i45 >> 32), cell_at(i67 >> 32))};
    return cells;
}

/* value + slope f / 2^16 with f the signed low half of w: multiplied by f * 2^16, the upper half of the product. */
AVX2 static __m256i interpolate(__m256i cells, __m256i f_q16)
{
    const __m256i slope = _mm256_srli_epi64(cells, 32);
    return _mm256_add_epi32(cells, _mm256_srli_epi64(_mm256_mul_epi32(slope, f_q16), 32));
}

/* (c + a r / 2^32) / 2^9 of points 0 2 1 3 4 6 5 7: the order in which one instruction takes the upper halves. */
AVX2 static __m256i quotient(__m256i a, halves_t r, __m256i c)
{
    const __m256 even = _mm256_castsi256_ps(_mm256_mul_epi32(a, r.even));
    const __m256 odd = _mm256_castsi256_ps(_mm256_mul_epi32(_mm256_srli_epi64(a, 32), r.odd));
    const __m256i upper = _mm256_castps_si256(_mm256_shuffle_ps(even, odd, _MM_SHUFFLE(3, 1, 3, 1)));
    return _mm256_srai_epi32(_mm256_add_epi32(c, upper), 9);
}

typedef struct {
    row_t w, a, b;
    __m256i cx;
    __m256i cy;
} rows_t;

AVX2 static rows_t rows_of(const evs_homography_t *h)
{
    const rows_t rows = {make_row(h->wx_q35, h->wy_q35, h->w0_q23), make_row(h->ax_q28, h->ay_q28, h->a0_q16),
                         make_row(h->bx_q28, h->by_q28, h->b0_q16), _mm256_set1_epi32(h->cx_q13),
                         _mm256_set1_epi32(h->cy_q13)};
    return rows;
}

/* Eight points; false when the fast path refuses some. */
AVX2 static inline __attribute__((always_inline)) bool map_eight(rows_t rows, __m256i xy, __m256i *mapped)
{
    const __m256i marker = _mm256_set1_epi32(MARKER);
    const __m256i no_cell = _mm256_set1_epi32(-EVS_RECIP_CELLS);
    const __m256i w = apply_row(rows.w, xy);
    const __m256i cell = _mm256_srli_epi32(w, W_CELL_BITS);
    const __m256i refused = _mm256_or_si256(cell, _mm256_cmpeq_epi32(xy, marker));
    if (_mm256_testz_si256(refused, no_cell) == 0) { return false; }

    const halves_t cells = look_up(cell);
    const __m256i f = _mm256_slli_epi32(w, 16);
    const halves_t r = {interpolate(cells.even, f), interpolate(cells.odd, _mm256_srli_epi64(f, 32))};
    const __m256i x = quotient(apply_row(rows.a, xy), r, rows.cx);
    const __m256i y = quotient(apply_row(rows.b, xy), r, rows.cy);
    /* From x0 x2 x1 x3 y0 y2 y1 y3 to x0 y0 x1 y1 ... */
    const __m128i pairs = _mm_setr_epi8(0, 1, 8, 9, 4, 5, 12, 13, 2, 3, 10, 11, 6, 7, 14, 15);
    const __m256i point = _mm256_shuffle_epi8(_mm256_packs_epi32(x, y), _mm256_broadcastsi128_si256(pairs));
    /* What the narrowing saturates is out of range and remains so. */
    const __m256i excess = _mm256_subs_epu16(_mm256_abs_epi16(point), _mm256_set1_epi16(EVS_POINT_MAX_Q4));
    const __m256i valid = _mm256_cmpeq_epi32(excess, _mm256_setzero_si256());
    *mapped = _mm256_blendv_epi8(marker, point, valid);
    return true;
}

AVX2 void evs_homography_map_avx2(const evs_homography_t *h, const evs_point_t *in, size_t n, evs_point_t *out)
{
    const rows_t rows = rows_of(h);
    __m256i mapped;
    size_t i = 0u;
    for (; n - i >= 8u; i += 8u) {
        if (map_eight(rows, _mm256_loadu_si256((const __m256i *)(const void *)(in + i)), &mapped)) {
            _mm256_storeu_si256((__m256i *)(void *)(out + i), mapped);
        } else {
            evs_homography_map_plain(h, in + i, 8u, out + i);
        }
    }
    if (i == n) { return; }
    const __m256i rest =
        _mm256_cmpgt_epi32(_mm256_set1_epi32((int32_t)(n - i)), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
    if (map_eight(rows, _mm256_maskload_epi32((const int *)(const void *)(in + i), rest), &mapped)) {
        _mm256_maskstore_epi32((int *)(void *)(out + i), rest, mapped);
    } else {
        evs_homography_map_plain(h, in + i, n - i, out + i);
    }
}

#else
typedef int evs_homography_avx2_empty_t; /* ISO C wants a declaration in every file. */
#endif
