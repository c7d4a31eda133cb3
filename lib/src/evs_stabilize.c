/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/stabilize.h"

#define SLICE_MIN_US 50u

evs_stabilize_config_t evs_stabilize_config_default(const evs_pinhole_t *pinhole)
{
    EVS_ASSERT(pinhole != NULL);
    const evs_stabilize_config_t cfg = {.pinhole = *pinhole,
                                        .rotation = EVS_ROTATION_SLICE,
                                        .saccade_px_q4 = (uint16_t)((pinhole->width_px * 16u + 3u) / 6u),
                                        .slice_max_us = 1000u,
                                        .slice_blur_q4 = 4u};
    return cfg;
}

evs_status_t evs_stabilize_init(evs_stabilize_t *st, const evs_stabilize_config_t *cfg)
{
    if ((st == NULL) || (cfg == NULL)) { return EVS_ERR_NULL; }
    const bool ok = (evs_pinhole_check(&cfg->pinhole) == EVS_OK) &&
                    ((cfg->rotation == EVS_ROTATION_SLICE) || (cfg->rotation == EVS_ROTATION_WINDOW)) &&
                    (cfg->saccade_px_q4 <= EVS_POINT_MAX_Q4) && (cfg->slice_max_us >= SLICE_MIN_US) &&
                    (cfg->slice_max_us <= 10000u) && (cfg->slice_blur_q4 >= 1u) && (cfg->slice_blur_q4 <= 160u);
    if (!ok) { return EVS_ERR_ARG; }
    *st = (evs_stabilize_t){.cfg = *cfg};
    evs_stabilize_reset(st);
    return EVS_OK;
}

void evs_stabilize_reset(evs_stabilize_t *st)
{
    EVS_ASSERT(st != NULL);
    st->has_reference = false;
    st->q_rw = evs_quat_identity();
    st->q_rc = evs_quat_identity();
    evs_homography_set(&st->forward, &st->cfg.pinhole, st->q_rc);
}

/* Whether the current rotation carries the image centre further than the limit, or out of sight. */
static bool centre_has_left(const evs_stabilize_t *st)
{
    if (st->cfg.saccade_px_q4 == EVS_STABILIZE_SACCADE_OFF) { return false; }
    const evs_point_t centre = {(int16_t)((st->cfg.pinhole.width_px - 1) * 8),
                                (int16_t)((st->cfg.pinhole.height_px - 1) * 8)};
    evs_point_t mapped;
    evs_homography_map(&st->forward, &centre, 1u, &mapped);
    if (evs_point_is_outside(mapped)) { return true; }
    const int64_t dx = mapped.x_q4 - centre.x_q4;
    const int64_t dy = mapped.y_q4 - centre.y_q4;
    return dx * dx + dy * dy > (int64_t)st->cfg.saccade_px_q4 * st->cfg.saccade_px_q4;
}

bool evs_stabilize_begin_window(evs_stabilize_t *st, evs_quat_t q_wc)
{
    EVS_ASSERT(st != NULL);
    const bool first = !st->has_reference;
    if (first) {
        st->q_rw = evs_quat_conj(q_wc);
        st->has_reference = true;
    }
    evs_stabilize_set_orientation(st, q_wc);
    if (first || !centre_has_left(st)) { return false; }
    st->q_rw = evs_quat_conj(q_wc);
    evs_stabilize_set_orientation(st, q_wc);
    return true;
}

void evs_stabilize_set_orientation(evs_stabilize_t *st, evs_quat_t q_wc)
{
    EVS_ASSERT((st != NULL) && st->has_reference);
    /* Two unit quaternions a rounding apart from unit length multiply to one that is not: the matrix wants it exact. */
    const evs_quat_t q_rc = evs_quat_mul(st->q_rw, q_wc);
    if (evs_quat_normalize(q_rc, &st->q_rc) != EVS_OK) { st->q_rc = evs_quat_identity(); }
    evs_homography_set(&st->forward, &st->cfg.pinhole, st->q_rc);
}

uint32_t evs_stabilize_slice_us(const evs_stabilize_t *st, evs_vec3_t rate_rad_s_q24)
{
    EVS_ASSERT(st != NULL);
    const int32_t focal_q16 =
        (st->cfg.pinhole.fx_q16 > st->cfg.pinhole.fy_q16) ? st->cfg.pinhole.fx_q16 : st->cfg.pinhole.fy_q16;
    const uint64_t rate_q24 = evs_sqrt_u64(evs_vec3_norm_sq(rate_rad_s_q24));
    const uint32_t px_per_s = (uint32_t)((rate_q24 * (uint64_t)(focal_q16 >> 8)) >> 32); /* Q24 * Q8 */
    /* px_per_s * slice / 2 <= blur: slice = 2 blur / 16 * 10^6 / px_per_s. */
    const uint32_t budget = (uint32_t)st->cfg.slice_blur_q4 * 125000u;
    if (px_per_s * (uint64_t)st->cfg.slice_max_us <= budget) { return st->cfg.slice_max_us; }
    const uint32_t slice_us = budget / px_per_s;
    return (slice_us < SLICE_MIN_US) ? SLICE_MIN_US : slice_us;
}

void evs_stabilize_map(const evs_stabilize_t *st, const evs_point_t *in, size_t n, evs_point_t *out)
{
    EVS_ASSERT((st != NULL) && st->has_reference);
    evs_homography_map(&st->forward, in, n, out);
}

void evs_stabilize_inverse(const evs_stabilize_t *st, evs_homography_t *inverse)
{
    EVS_ASSERT((st != NULL) && (inverse != NULL));
    evs_homography_set(inverse, &st->cfg.pinhole, evs_quat_conj(st->q_rc));
}
