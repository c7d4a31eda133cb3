/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/keyframes.h"

#include <string.h>

#define TARGET_MAX_Q4  4096u
#define US_PER_S       UINT32_C(1000000)
#define SPEED_SHARE_Q8 128 /* of the newest pair in the running mean */
#define AGES_MAX       3u  /* baselines: an older partner would show patches that have moved too far */

enum { N_LINE = 64 }; /* pixels that are mapped in one call */

evs_keyframes_config_t evs_keyframes_config_default(const evs_pinhole_t *pinhole)
{
    EVS_ASSERT(pinhole != NULL);
    const evs_keyframes_config_t cfg = {.pinhole = *pinhole,
                                        .n_stored = 3u,
                                        .target_px_q4 = 80u,
                                        .baseline_min_us = 10000u,
                                        .baseline_max_us = 250000u,
                                        .baseline_first_us = 70000u,
                                        .age_max_us = 400000u};
    return cfg;
}

static bool config_ok(const evs_keyframes_config_t *cfg)
{
    return (evs_pinhole_check(&cfg->pinhole) == EVS_OK) && (cfg->n_stored >= 1u) &&
           (cfg->n_stored <= EVS_KEYFRAMES_MAX) && (cfg->target_px_q4 >= 1u) && (cfg->target_px_q4 <= TARGET_MAX_Q4) &&
           (cfg->baseline_min_us >= 1u) && (cfg->baseline_min_us <= cfg->baseline_first_us) &&
           (cfg->baseline_first_us <= cfg->baseline_max_us) && (cfg->baseline_max_us <= cfg->age_max_us) &&
           (cfg->age_max_us <= EVS_KEYFRAMES_AGE_MAX_US);
}

static size_t plane_bytes(const evs_keyframes_config_t *cfg)
{
    return EVS_IMAGE_BYTES(cfg->pinhole.width_px, cfg->pinhole.height_px);
}

evs_status_t evs_keyframes_init(evs_keyframes_t *k, const evs_keyframes_config_t *cfg, void *memory, size_t n_bytes)
{
    if ((k == NULL) || (cfg == NULL) || (memory == NULL)) { return EVS_ERR_NULL; }
    if (!config_ok(cfg)) { return EVS_ERR_ARG; }
    if (n_bytes < plane_bytes(cfg) * (cfg->n_stored + 1u)) { return EVS_ERR_SIZE; }

    *k = (evs_keyframes_t){.cfg = *cfg, .baseline_us = cfg->baseline_first_us};
    for (size_t i = 0u; i <= cfg->n_stored; i++) { k->stored[i].px = (uint8_t *)memory + i * plane_bytes(cfg); }
    return EVS_OK;
}

/* Drop the n oldest. The plane of the newest image moves up to stored[n_used], where it is looked for. */
static void drop_oldest(evs_keyframes_t *k, size_t n)
{
    evs_keyframe_t dropped[EVS_KEYFRAMES_MAX];
    const size_t n_kept = k->n_used + 1u - n;
    if (n == 0u) { return; }
    memcpy(dropped, k->stored, n * sizeof dropped[0]);
    memmove(k->stored, &k->stored[n], n_kept * sizeof dropped[0]);
    memcpy(&k->stored[n_kept], dropped, n * sizeof dropped[0]);
    k->n_used -= n;
}

void evs_keyframes_clear(evs_keyframes_t *k)
{
    EVS_ASSERT(k != NULL);
    drop_oldest(k, k->n_used);
}

size_t evs_keyframes_choose(evs_keyframes_t *k, uint32_t t_us)
{
    EVS_ASSERT(k != NULL);
    size_t n_old = 0u;
    for (size_t i = 0u; i < k->n_used; i++) { /* a time that ran back is a great age too: it wraps */
        if (t_us - k->stored[i].t_us > k->cfg.age_max_us) { n_old = i + 1u; }
    }
    drop_oldest(k, n_old);

    size_t best = EVS_KEYFRAMES_NONE;
    uint32_t best_off_us = UINT32_MAX;
    for (size_t i = 0u; i < k->n_used; i++) {
        const uint32_t age_us = t_us - k->stored[i].t_us;
        if ((age_us == 0u) || (age_us < k->cfg.baseline_min_us / 2u) || (age_us / AGES_MAX > k->baseline_us)) {
            continue;
        }
        const uint32_t off_us = (age_us > k->baseline_us) ? age_us - k->baseline_us : k->baseline_us - age_us;
        if (off_us < best_off_us) {
            best = i;
            best_off_us = off_us;
        }
    }
    return best;
}

/* The pixel of `px` nearest to a point; 0 where the image does not reach. */
static inline uint8_t pixel_at(const uint8_t *px, uint32_t width_px, uint32_t height_px, evs_point_t at)
{
    const uint32_t x = (uint32_t)((at.x_q4 + 8) >> 4);
    const uint32_t y = (uint32_t)((at.y_q4 + 8) >> 4);
    return ((x < width_px) && (y < height_px)) ? px[y * width_px + x] : 0u;
}

bool evs_keyframes_turn(evs_keyframes_t *k, size_t index, evs_quat_t q_wr, uint8_t *scratch)
{
    EVS_ASSERT((k != NULL) && (index < k->n_used) && (scratch != NULL));
    evs_keyframe_t *const frame = &k->stored[index];
    if ((q_wr.w == frame->q_wr.w) && (q_wr.x == frame->q_wr.x) && (q_wr.y == frame->q_wr.y) &&
        (q_wr.z == frame->q_wr.z)) {
        return false;
    }
    /* For each pixel of the turned image, where it was before: from the new reference to the old. */
    evs_homography_t h;
    evs_homography_set(&h, &k->cfg.pinhole, evs_quat_mul(evs_quat_conj(frame->q_wr), q_wr));
    const uint32_t width_px = k->cfg.pinhole.width_px;
    const uint32_t height_px = k->cfg.pinhole.height_px;
    uint8_t *out = scratch;
    evs_point_t line[N_LINE];
    for (uint32_t y = 0u; y < height_px; y++) {
        for (uint32_t x0 = 0u; x0 < width_px; x0 += N_LINE) {
            const uint32_t n = (width_px - x0 < N_LINE) ? width_px - x0 : N_LINE;
            for (uint32_t i = 0u; i < n; i++) {
                line[i] = (evs_point_t){(int16_t)((x0 + i) * 16u), (int16_t)(y * 16u)};
            }
            evs_homography_map(&h, line, n, line);
            for (uint32_t i = 0u; i < n; i++) { *out++ = pixel_at(frame->px, width_px, height_px, line[i]); }
        }
    }
    memcpy(frame->px, scratch, plane_bytes(&k->cfg));
    frame->q_wr = q_wr;
    return true;
}

bool evs_keyframes_store(evs_keyframes_t *k, uint32_t t_us, evs_quat_t q_wr)
{
    EVS_ASSERT(k != NULL);
    if ((k->n_used > 0u) && (t_us - k->stored[k->n_used - 1u].t_us < k->baseline_us / 2u)) { return false; }
    if (k->n_used == k->cfg.n_stored) { drop_oldest(k, 1u); }
    k->stored[k->n_used].t_us = t_us;
    k->stored[k->n_used].q_wr = q_wr;
    k->n_used++;
    return true;
}

static uint32_t baseline_of(const evs_keyframes_t *k, uint32_t speed_px_s_q4)
{
    const uint32_t at_least_px_s_q4 = (speed_px_s_q4 > 0u) ? speed_px_s_q4 : 1u;
    const uint32_t baseline_us = k->cfg.target_px_q4 * US_PER_S / at_least_px_s_q4;
    if (baseline_us < k->cfg.baseline_min_us) { return k->cfg.baseline_min_us; }
    return (baseline_us < k->cfg.baseline_max_us) ? baseline_us : k->cfg.baseline_max_us;
}

void evs_keyframes_learn(evs_keyframes_t *k, uint32_t speed_px_s_q4)
{
    EVS_ASSERT(k != NULL);
    /* No faster than crosses the target within the shortest baseline: one wild pair must not keep it short for long. */
    const uint32_t fastest = k->cfg.target_px_q4 * US_PER_S / k->cfg.baseline_min_us + 1u;
    const int64_t speed = (speed_px_s_q4 < fastest) ? speed_px_s_q4 : fastest;
    const int64_t change = evs_shr_r64((speed - k->speed_px_s_q4) * SPEED_SHARE_Q8, 8u);
    k->speed_px_s_q4 = k->speed_known ? (uint32_t)(k->speed_px_s_q4 + change) : (uint32_t)speed;
    k->speed_known = true;
    k->baseline_us = baseline_of(k, k->speed_px_s_q4);
}

void evs_keyframes_shorten(evs_keyframes_t *k)
{
    EVS_ASSERT(k != NULL);
    const uint32_t shorter_us = k->baseline_us - k->baseline_us / 4u;
    k->baseline_us = (shorter_us > k->cfg.baseline_min_us) ? shorter_us : k->cfg.baseline_min_us;
    if (k->speed_known) { k->speed_px_s_q4 = k->cfg.target_px_q4 * US_PER_S / k->baseline_us; }
}
