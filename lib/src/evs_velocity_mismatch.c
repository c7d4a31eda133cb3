/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Do two images show the same? A tracker finds something in any two. */
#include "evs/fixed.h"
#include "evs_velocity_private.h"

/* Windows are compared at every fourth pixel up to 12 px to either side of their middle. */
enum { LOOK_PX = 12, LOOK_STEP_PX = 4 };

/* Sums of |newest - older| over every fourth pixel of two windows, as far as both lie in the image. */
typedef struct {
    uint32_t sum;
    uint32_t n;
} difference_t;

static void add_difference(difference_t *d, const evs_image_t *newest, evs_position_t at, const evs_image_t *older,
                           evs_position_t other)
{
    const int32_t x = evs_shr_r(at.x_q8, 8), y = evs_shr_r(at.y_q8, 8);
    const int32_t to_x = evs_shr_r(other.x_q8, 8) - x, to_y = evs_shr_r(other.y_q8, 8) - y;
    const int32_t width_px = newest->width_px, height_px = newest->height_px;
    for (int32_t row = y - LOOK_PX; row <= y + LOOK_PX; row += LOOK_STEP_PX) {
        if ((row < 0) || (row >= height_px) || (row + to_y < 0) || (row + to_y >= height_px)) { continue; }
        const uint8_t *const a = &newest->px[row * width_px];
        const uint8_t *const b = &older->px[(row + to_y) * width_px];
        for (int32_t col = x - LOOK_PX; col <= x + LOOK_PX; col += LOOK_STEP_PX) {
            if ((col < 0) || (col >= width_px) || (col + to_x < 0) || (col + to_x >= width_px)) { continue; }
            const int32_t apart = (int32_t)a[col] - b[col + to_x];
            d->sum += (uint32_t)((apart < 0) ? -apart : apart);
            d->n++;
        }
    }
}

uint16_t evs_velocity_mismatch_q8(const evs_velocity_t *v)
{
    const evs_image_t newest = evs_velocity_image_of(v, evs_keyframes_plane(&v->keyframes));
    const evs_image_t older = evs_velocity_image_of(v, v->older_px);
    difference_t same = {0u, 0u};
    difference_t other = {0u, 0u};
    const evs_flow_track_t *before = NULL;
    for (size_t i = 0u; i < v->n_tracks; i++) {
        const evs_flow_track_t *const track = &v->tracks[i];
        if (track->status != EVS_FLOW_OK) { continue; }
        add_difference(&same, &newest, track->from, &older, track->to);
        if (before != NULL) { add_difference(&other, &newest, track->from, &older, before->to); }
        before = track;
    }
    /* The means' quotient; fewer than 2^19 samples of fewer than 8 bits each. */
    const uint64_t above = (uint64_t)same.sum * other.n * 256u;
    const uint64_t below = (uint64_t)other.sum * same.n;
    if (below == 0u) { return UINT16_MAX; }
    const uint64_t quotient = (above + below / 2u) / below;
    return (quotient < UINT16_MAX) ? (uint16_t)quotient : UINT16_MAX;
}
