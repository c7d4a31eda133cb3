/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_undistort_kernel.h"

#if EVS_SIMD_X86

#include <emmintrin.h>

typedef struct {
    const evs_point_t *points;
    const uint16_t *tiles;
    __m128i last;  /* x and y of the last pixel */
    __m128i pitch; /* 1 and the width */
    __m128i polarity;
} tables_t;

/* x and y of four events. */
static inline __attribute__((always_inline)) __m128i pixels_of(const tables_t *t, const evs_event_t *ev)
{
    const __m128 a = _mm_castsi128_ps(_mm_loadu_si128((const __m128i *)(const void *)ev));
    const __m128 b = _mm_castsi128_ps(_mm_loadu_si128((const __m128i *)(const void *)(ev + 2)));
    return _mm_andnot_si128(t->polarity, _mm_castps_si128(_mm_shuffle_ps(a, b, _MM_SHUFFLE(3, 1, 3, 1))));
}

/* Four events on the sensor: two indices at a time leave the vector unit. */
static inline __attribute__((always_inline)) void look_up_four(const tables_t *t, __m128i xy, evs_point_t *points,
                                                               uint16_t *tiles)
{
    const __m128i at = _mm_madd_epi16(xy, t->pitch);
    const uint64_t low = (uint64_t)_mm_cvtsi128_si64(at);
    const uint64_t high = (uint64_t)_mm_cvtsi128_si64(_mm_unpackhi_epi64(at, at));
    const uint32_t at0 = (uint32_t)low, at1 = (uint32_t)(low >> 32), at2 = (uint32_t)high, at3 = (uint32_t)(high >> 32);
    points[0] = t->points[at0];
    points[1] = t->points[at1];
    points[2] = t->points[at2];
    points[3] = t->points[at3];
    if (tiles != NULL) {
        tiles[0] = t->tiles[at0];
        tiles[1] = t->tiles[at1];
        tiles[2] = t->tiles[at2];
        tiles[3] = t->tiles[at3];
    }
}

/* False, and nothing written, when some of the eight events lie off the sensor. */
static inline __attribute__((always_inline)) bool look_up_eight(const tables_t *t, const evs_event_t *ev,
                                                                evs_point_t *points, uint16_t *tiles)
{
    const __m128i a = pixels_of(t, ev);
    const __m128i b = pixels_of(t, ev + 4);
    const __m128i beyond = _mm_or_si128(_mm_subs_epu16(a, t->last), _mm_subs_epu16(b, t->last));
    if (_mm_movemask_epi8(_mm_cmpeq_epi8(beyond, _mm_setzero_si128())) != 0xFFFF) { return false; }
    look_up_four(t, a, points, tiles);
    look_up_four(t, b, points + 4, (tiles != NULL) ? tiles + 4 : NULL);
    return true;
}

size_t evs_undistort_map_sse2(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points, uint16_t *tiles)
{
    const tables_t t = {
        u->points,
        u->tiles,
        _mm_set1_epi32((int32_t)((u->width_px - 1u) | ((u->height_px - 1u) << 16))),
        _mm_set1_epi32((int32_t)(1u | ((uint32_t)u->width_px << 16))),
        _mm_set1_epi32((int32_t)((uint32_t)EVS_EVENT_POLARITY_BIT << 16)),
    };
    const evs_event_t *const end = ev + (n & ~(size_t)7u);
    if (tiles == NULL) {
        for (; ev != end; ev += 8, points += 8) {
            if (!look_up_eight(&t, ev, points, NULL)) { evs_undistort_map_plain(u, ev, 8u, points, NULL); }
        }
    } else {
        for (; ev != end; ev += 8, points += 8, tiles += 8) {
            if (!look_up_eight(&t, ev, points, tiles)) { evs_undistort_map_plain(u, ev, 8u, points, tiles); }
        }
    }
    return n & ~(size_t)7u;
}

#else
typedef int evs_undistort_sse2_empty_t; /* ISO C wants a declaration in every file. */
#endif
