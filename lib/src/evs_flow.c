/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/flow.h"

#include "evs_flow_kernel.h"

#include <string.h>

/* --- pyramid ---------------------------------------------------------------------------------------------------- */

evs_status_t evs_pyramid_build(evs_pyramid_t *pyramid, const evs_image_t *image, uint16_t n_levels, uint8_t *memory,
                               size_t n_bytes)
{
    if ((pyramid == NULL) || (image == NULL) || (image->px == NULL) || ((memory == NULL) && (n_levels > 1u))) {
        return EVS_ERR_NULL;
    }
    if (!evs_in_range(n_levels, 1u, EVS_FLOW_LEVELS_MAX) || !evs_in_range(image->width_px, 1u, EVS_SENSOR_MAX_PX) ||
        !evs_in_range(image->height_px, 1u, EVS_SENSOR_MAX_PX)) {
        return EVS_ERR_ARG;
    }
    if (n_bytes < EVS_PYRAMID_BYTES(image->width_px, image->height_px, n_levels)) { return EVS_ERR_SIZE; }

    evs_pyramid_t made = {.n_levels = n_levels};
    made.level[0] = *image;
    for (uint16_t i = 1u; i < n_levels; i++) {
        const evs_image_t *const above = &made.level[i - 1u];
        evs_image_halve(above, memory);
        made.level[i] = (evs_image_t){.px = memory,
                                      .width_px = (uint16_t)EVS_IMAGE_HALF(above->width_px),
                                      .height_px = (uint16_t)EVS_IMAGE_HALF(above->height_px)};
        memory += EVS_IMAGE_BYTES(made.level[i].width_px, made.level[i].height_px);
    }
    *pyramid = made;
    return EVS_OK;
}

/* --- configuration ---------------------------------------------------------------------------------------------- */

evs_flow_config_t evs_flow_config_default(void)
{
    const evs_flow_config_t cfg = {.window_px = 25u,
                                   .stride_px = 2u,
                                   .n_iterations = 5u,
                                   .epsilon_q8 = 3u,
                                   .min_eigen_q8 = 26u,
                                   .max_backward_q8 = 128u};
    return cfg;
}

evs_status_t evs_flow_init(evs_flow_t *flow, const evs_flow_config_t *cfg, void *memory, size_t n_bytes)
{
    if ((flow == NULL) || (cfg == NULL) || (memory == NULL)) { return EVS_ERR_NULL; }
    const uint32_t window = cfg->window_px;
    const uint32_t stride = cfg->stride_px;
    if (!evs_in_range(window, EVS_FLOW_WINDOW_MIN_PX, EVS_FLOW_WINDOW_MAX_PX) || (window % 2u == 0u) ||
        !evs_in_range(stride, 1u, 2u) || !evs_in_range(cfg->n_iterations, 1u, EVS_FLOW_ITERATIONS_MAX) ||
        (cfg->epsilon_q8 > 256u) || (cfg->min_eigen_q8 == 0u)) {
        return EVS_ERR_ARG;
    }
    if ((n_bytes < EVS_FLOW_BYTES(window, stride)) || (((uintptr_t)memory & 3u) != 0u)) { return EVS_ERR_SIZE; }

    const size_t n = EVS_FLOW_SIDE(window, stride) * EVS_FLOW_PITCH(window, stride);
    int16_t *const samples = memory;
    *flow = (evs_flow_t){.cfg = *cfg,
                         .n_side = (uint16_t)EVS_FLOW_SIDE(window, stride),
                         .n_pitch = (uint16_t)EVS_FLOW_PITCH(window, stride),
                         .samples = samples,
                         .rows = samples + 3u * n,
                         .patch = (uint8_t *)(void *)(samples + 3u * n + 3u * EVS_FLOW_ROW(window)),
                         .patch_columns = (uint16_t)EVS_FLOW_PATCH_COLUMNS(window, stride),
                         .patch_rows = (uint16_t)EVS_FLOW_PATCH_ROWS(window)};
    return EVS_OK;
}

/* --- windows ---------------------------------------------------------------------------------------------------- */

/* An image and what part of it the patch shows, if any. */
typedef struct {
    const evs_image_t *image;
    int32_t patch_x, patch_y; /* of its first pixel */
    bool patched;
} view_t;

static view_t view_of(const evs_image_t *image)
{
    const view_t view = {image, 0, 0, false};
    return view;
}

/* memset() and memcpy() for a few bytes: those of a microcontroller's C library go one by one. */
static inline void copy_word(uint8_t *out, const void *in) { memcpy(out, in, 4u); }
static inline void copy_tail(uint8_t *out, const void *in, int32_t n_bytes)
{
    const uint8_t *const bytes = in;
    if ((n_bytes & 2) != 0) { memcpy(out, bytes, 2u); }
    if ((n_bytes & 1) != 0) { out[n_bytes & 2] = bytes[n_bytes & 2]; }
}
static inline void fill_bytes(uint8_t *out, uint8_t grey, int32_t n_bytes)
{
    const uint32_t word = grey * 0x01010101u;
    for (; n_bytes >= 4; n_bytes -= 4) {
        copy_word(out, &word);
        out += 4;
    }
    copy_tail(out, &word, n_bytes);
}
static inline void copy_bytes(uint8_t *out, const uint8_t *in, int32_t n_bytes)
{
    for (; n_bytes >= 16; n_bytes -= 16) {
        copy_word(out, in);
        copy_word(out + 4, in + 4);
        copy_word(out + 8, in + 8);
        copy_word(out + 12, in + 12);
        out += 16;
        in += 16;
    }
    for (; n_bytes >= 4; n_bytes -= 4) {
        copy_word(out, in);
        out += 4;
        in += 4;
    }
    copy_tail(out, in, n_bytes);
}

/* Copy a part of the image that reaches over its border, which goes on outside. */
static void fill_patch(const evs_flow_t *flow, view_t *view, int32_t x, int32_t y)
{
    const int32_t w = view->image->width_px;
    const int32_t h = view->image->height_px;
    const int32_t columns = flow->patch_columns;
    const int32_t n_left = evs_clamp(-x, 0, columns);
    const int32_t n_right = evs_clamp(x + columns - w, 0, columns);
    const int32_t n_inside = columns - n_left - n_right; /* at least 0: nothing is both left and right of an image */
    const int32_t begin = evs_clamp(x, 0, w - 1);
    const int32_t last = w - 1 - begin;
    uint8_t *out = flow->patch;
    for (int32_t row = y; row < y + flow->patch_rows; row++) {
        const uint8_t *const in = view->image->px + (evs_clamp(row, 0, h - 1) * w + begin);
        if (n_left > 0) { fill_bytes(out, in[0], n_left); }
        copy_bytes(out + n_left, in, n_inside);
        if (n_right > 0) { fill_bytes(out + n_left + n_inside, in[last], n_right); }
        out += columns;
    }
    view->patch_x = x;
    view->patch_y = y;
    view->patched = true;
}

/* The window whose centre is at `centre`: in the image, or in the patch where the kernels would read past the border. */
static evs_flow_place_t place(const evs_flow_t *flow, view_t *view, evs_position_t centre)
{
    const int32_t half_q8 = (flow->cfg.window_px / 2) * 256;
    const int32_t x_q8 = centre.x_q8 - half_q8;
    const int32_t y_q8 = centre.y_q8 - half_q8;
    const int32_t x = (x_q8 >> 8) - 1; /* The template reads one pixel before the window, too. */
    const int32_t y = (y_q8 >> 8) - 1;
    const int32_t spare = EVS_FLOW_SPARE_PX;
    const int32_t n_columns = flow->patch_columns - 2 * spare;
    const int32_t n_rows = flow->patch_rows - 2 * spare;

    evs_flow_place_t at;
    evs_flow_set_weights(&at, ((uint32_t)x_q8 & 255u) / 2u, ((uint32_t)y_q8 & 255u) / 2u);
    /* What kernels read past the window only has to be memory: the next row will do, and the last row has none. */
    const int32_t n_needed = flow->cfg.window_px + 3;
    const int32_t w = view->image->width_px;
    const int32_t h = view->image->height_px;
    if ((x >= 0) && (y >= 0) && (x + n_needed <= w) && (y + n_rows <= h) &&
        ((x + n_columns <= w) || (y + n_rows < h))) {
        at.pitch = (size_t)w;
        at.px = view->image->px + (size_t)(y + 1) * at.pitch + (size_t)(x + 1);
        return at;
    }
    if (!view->patched || (x < view->patch_x) || (x > view->patch_x + 2 * spare) || (y < view->patch_y) ||
        (y > view->patch_y + 2 * spare)) {
        fill_patch(flow, view, x - spare, y - spare);
    }
    at.pitch = flow->patch_columns;
    at.px = flow->patch + (size_t)(y - view->patch_y + 1) * at.pitch + (size_t)(x - view->patch_x + 1);
    return at;
}

/* --- steps ------------------------------------------------------------------------------------------------------ */

/* The inverse of the texture: step Q8 = (entries * pull) >> shift. */
typedef struct {
    int32_t xx, xy, yy;
    unsigned shift;
} solver_t;

/* Product of two numbers, one of them normalized to 32 bits, its upper half. */
static int32_t scale(int32_t entry, unsigned left, uint32_t reciprocal)
{
    const int64_t product = (int64_t)entry * (int64_t)(UINT64_C(1) << left);
    return (int32_t)((product * (int64_t)(reciprocal >> 1)) >> 31);
}

/*
 * Invert the texture, unless its smaller eigenvalue is below the limit (that makes the determinant at least limit^2 >= 1).
 * The sums are 4 times the squares of gradients and the pull is 256 times gradient times difference, so the step is
 * pull / sums / 64 px, or 4 pull / sums in Q8: 4 adjugate / determinant.
 */
static bool invert(const evs_flow_t *flow, const evs_flow_texture_t *t, solver_t *inverse)
{
    const uint32_t n = (uint32_t)flow->n_side * flow->n_side;
    const int32_t limit = (int32_t)((n * flow->cfg.min_eigen_q8 + 63u) / 64u);
    if ((t->xx < limit) || (t->yy < limit) || ((int64_t)(t->xx - limit) * (t->yy - limit) < (int64_t)t->xy * t->xy)) {
        return false;
    }
    const uint64_t det = (uint64_t)((int64_t)t->xx * t->yy - (int64_t)t->xy * t->xy);
    const unsigned det_zeros = evs_clz64(det);
    const uint32_t det_top = (uint32_t)((det << det_zeros) >> 32); /* det = det_top * 2^(32 - det_zeros) */
    unsigned recip_shift;
    const uint32_t recip = evs_recip_u32(det_top, &recip_shift);
    /* The largest entry is on the diagonal: bring it to [2^29, 2^30). */
    const unsigned left = evs_clz32((uint32_t)((t->xx > t->yy) ? t->xx : t->yy)) - 2u;
    inverse->xx = scale(t->yy, left, recip);
    inverse->xy = -scale(t->xy, left, recip);
    inverse->yy = scale(t->xx, left, recip);
    inverse->shift = left + recip_shift - det_zeros - 2u; /* in [24, 58]: the eigenvalues lie in [1, 2^26) */
    return true;
}

/* Entries are below 2^30 and pulls within 32 bits, so the sum is below 2^62. */
static int32_t step_q8(int32_t a, int32_t pull_a, int32_t b, int32_t pull_b, unsigned shift, int32_t most)
{
    const int64_t sum = (int64_t)a * pull_a + (int64_t)b * pull_b;
    const int64_t step = evs_shr_r64(sum, shift);
    return (int32_t)((step > most) ? most : ((step < -most) ? -most : step));
}

/* Positions of windows that still see some of an image: their centres are at most half a window outside. */
static int32_t within(int32_t v_q8, uint16_t n_px, int32_t reach_q8)
{
    return evs_clamp(v_q8, -reach_q8, (n_px - 1) * 256 + reach_q8);
}

static evs_position_t even(evs_position_t p)
{
    const evs_position_t e = {p.x_q8 & ~1, p.y_q8 & ~1};
    return e;
}

/*
 * Take the template at `from`, and step from *to on until it fits. Positions are those of the level.
 * Windows lie at multiples of 1/128 px. What a position has beyond that is not lost: it is the same displacement that is
 * looked for, and a step counts from where the window lay.
 * false: no texture, *to is as it was.
 */
static bool iterate(evs_flow_t *flow, const evs_image_t *from_image, const evs_image_t *to_image, evs_position_t from,
                    evs_position_t *to)
{
    view_t view = view_of(from_image);
    evs_flow_texture_t texture;
    solver_t inverse;
    const evs_position_t origin = even(from);
    evs_flow_template(flow, place(flow, &view, origin), &texture);
    if (!invert(flow, &texture, &inverse)) { return false; }

    const int32_t beyond_x_q8 = from.x_q8 - origin.x_q8;
    const int32_t beyond_y_q8 = from.y_q8 - origin.y_q8;
    const int32_t reach_q8 = (flow->cfg.window_px / 2) * 256;
    const uint32_t epsilon_q8 = flow->cfg.epsilon_q8;
    view = view_of(to_image);
    for (uint16_t i = 0u; i < flow->cfg.n_iterations; i++) {
        evs_flow_pull_t pull;
        const evs_position_t at = even((evs_position_t){to->x_q8 - beyond_x_q8, to->y_q8 - beyond_y_q8});
        evs_flow_pull(flow, place(flow, &view, at), &pull);
        const int32_t pull_x = evs_sat32(pull.x);
        const int32_t pull_y = evs_sat32(pull.y);
        const int32_t x_q8 = step_q8(inverse.xx, pull_x, inverse.xy, pull_y, inverse.shift, reach_q8);
        const int32_t y_q8 = step_q8(inverse.xy, pull_x, inverse.yy, pull_y, inverse.shift, reach_q8);
        to->x_q8 = within(at.x_q8 + beyond_x_q8 - x_q8, to_image->width_px, reach_q8);
        to->y_q8 = within(at.y_q8 + beyond_y_q8 - y_q8, to_image->height_px, reach_q8);
        if ((evs_abs_u32(x_q8) <= epsilon_q8) && (evs_abs_u32(y_q8) <= epsilon_q8)) { break; }
    }
    return true;
}

/* --- tracks ----------------------------------------------------------------------------------------------------- */

static bool on_image(evs_position_t p, const evs_image_t *image, int32_t reach_q8)
{
    return (p.x_q8 >= -reach_q8) && (p.x_q8 <= (image->width_px - 1) * 256 + reach_q8) && (p.y_q8 >= -reach_q8) &&
           (p.y_q8 <= (image->height_px - 1) * 256 + reach_q8);
}

/* Pixel (x, y) of a level lies at (2 x + 1/2, 2 y + 1/2) of the finer one. */
static evs_position_t coarser(evs_position_t p)
{
    const evs_position_t c = {(p.x_q8 - 128) >> 1, (p.y_q8 - 128) >> 1};
    return c;
}
static evs_position_t finer(evs_position_t p)
{
    const evs_position_t f = {p.x_q8 * 2 + 128, p.y_q8 * 2 + 128};
    return f;
}

/* From the finest level back: does the way end where it came from? */
static bool returns(evs_flow_t *flow, const evs_image_t *from, const evs_image_t *to, const evs_flow_track_t *track)
{
    evs_position_t back = track->from;
    if (!iterate(flow, to, from, track->to, &back)) { return false; }
    const int64_t x = back.x_q8 - track->from.x_q8;
    const int64_t y = back.y_q8 - track->from.y_q8;
    const int64_t most = flow->cfg.max_backward_q8;
    return x * x + y * y <= most * most;
}

static evs_flow_status_t track_one(evs_flow_t *flow, const evs_pyramid_t *from, const evs_pyramid_t *to,
                                   uint32_t n_levels, evs_flow_track_t *track)
{
    const evs_image_t *const first = &from->level[0];
    const evs_image_t *const second = &to->level[0];
    const int32_t reach_q8 = (flow->cfg.window_px / 2) * 256;
    if (!on_image(track->from, first, 0) || !on_image(track->to, second, reach_q8)) { return EVS_FLOW_LOST_BORDER; }

    evs_position_t at[EVS_FLOW_LEVELS_MAX];
    at[0] = track->from;
    evs_position_t found = track->to;
    for (uint32_t i = 1u; i < n_levels; i++) {
        at[i] = coarser(at[i - 1u]);
        found = coarser(found);
    }
    bool ok = false;
    for (uint32_t i = n_levels; i-- > 0u;) {
        ok = iterate(flow, &from->level[i], &to->level[i], at[i], &found); /* A coarse level may be too flat. */
        if (i > 0u) { found = finer(found); }
    }
    track->to = found;
    if (!ok) { return EVS_FLOW_LOST_TEXTURE; }
    if (!on_image(found, second, 0)) { return EVS_FLOW_LOST_BORDER; }

    view_t view = view_of(second);
    const uint32_t n = (uint32_t)flow->n_side * flow->n_side;
    const uint32_t difference_q7 = evs_flow_difference(flow, place(flow, &view, found));
    track->residual_q8 = (uint16_t)((difference_q7 * 2u + n / 2u) / n);
    if ((flow->cfg.max_backward_q8 > 0u) && !returns(flow, first, second, track)) {
        track->residual_q8 = 0u;
        return EVS_FLOW_LOST_BACKWARD;
    }
    return EVS_FLOW_OK;
}

void evs_flow_track(evs_flow_t *flow, const evs_pyramid_t *from, const evs_pyramid_t *to, evs_flow_track_t *tracks,
                    size_t n)
{
    EVS_ASSERT((flow != NULL) && (from != NULL) && (to != NULL) && ((tracks != NULL) || (n == 0u)));
    EVS_ASSERT((from->level[0].width_px == to->level[0].width_px) &&
               (from->level[0].height_px == to->level[0].height_px));
    const uint32_t n_levels = (from->n_levels < to->n_levels) ? from->n_levels : to->n_levels;
    for (size_t i = 0u; i < n; i++) {
        tracks[i].residual_q8 = 0u;
        tracks[i].status = (uint8_t)track_one(flow, from, to, n_levels, &tracks[i]);
    }
}
