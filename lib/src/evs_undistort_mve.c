/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_undistort_kernel.h"

#if EVS_SIMD_MVE

#include <arm_mve.h>

typedef struct {
    const uint32_t *points;
    const uint16_t *tiles;
    uint32_t width_px;
    uint16x8_t last; /* x and y of the last pixel */
    uint32x4_t polarity;
    uint32x4_t pairs[2]; /* offsets of the coordinates of eight events, in bytes */
} tables_t;

/* Four events on the sensor. Points lie at multiples of 2, hence the store by 16 bits. */
static inline __attribute__((always_inline)) void look_up_four(const tables_t *t, uint32x4_t xy, evs_point_t *points,
                                                               uint16_t *tiles)
{
    const uint32x4_t at = vmlaq_n_u32(vmovlbq_u16(vreinterpretq_u16_u32(xy)), vshrq_n_u32(xy, 16), t->width_px);
    const uint32x4_t found = vldrwq_gather_shifted_offset_u32(t->points, at);
    vstrhq_u16((uint16_t *)(void *)points, vreinterpretq_u16_u32(found));
    if (tiles != NULL) { vstrhq_u32(tiles, vldrhq_gather_shifted_offset_u32(t->tiles, at)); }
}

/* False, and nothing written, when some of the eight events lie off the sensor. */
static inline __attribute__((always_inline)) bool look_up_eight(const tables_t *t, const evs_event_t *ev,
                                                                evs_point_t *points, uint16_t *tiles)
{
    const uint32_t *const words = (const uint32_t *)(const void *)ev;
    const uint32x4_t a = vbicq_u32(vldrwq_gather_offset_u32(words, t->pairs[0]), t->polarity);
    const uint32x4_t b = vbicq_u32(vldrwq_gather_offset_u32(words, t->pairs[1]), t->polarity);
    const uint16x8_t beyond =
        vorrq_u16(vqsubq_u16(vreinterpretq_u16_u32(a), t->last), vqsubq_u16(vreinterpretq_u16_u32(b), t->last));
    if (vaddvq_u16(beyond) != 0u) { return false; }
    look_up_four(t, a, points, tiles);
    look_up_four(t, b, points + 4, (tiles != NULL) ? tiles + 4 : NULL);
    return true;
}

size_t evs_undistort_map_mve(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points, uint16_t *tiles)
{
    if (((uintptr_t)u->points & 3u) != 0u) { return 0u; } /* a gather asks for whole words */
    const uint32x4_t offsets = vmulq_n_u32(vidupq_n_u32(0u, 1), sizeof(evs_event_t));
    const tables_t t = {
        (const uint32_t *)(const void *)u->points,
        u->tiles,
        u->width_px,
        vreinterpretq_u16_u32(vdupq_n_u32((u->width_px - 1u) | ((u->height_px - 1u) << 16))),
        vdupq_n_u32((uint32_t)EVS_EVENT_POLARITY_BIT << 16),
        {vaddq_n_u32(offsets, offsetof(evs_event_t, x_px)),
         vaddq_n_u32(offsets, offsetof(evs_event_t, x_px) + 4u * sizeof(evs_event_t))},
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
typedef int evs_undistort_mve_empty_t; /* ISO C wants a declaration in every file. */
#endif
