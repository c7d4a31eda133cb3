/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/iwe.h"

#include "evs_tables.h"

#include <string.h>

enum { REACH = 3, SUPPORT = 2 * REACH + 1 }; /* of the Gaussian, px */

evs_iwe_config_t evs_iwe_config_default(uint16_t width_px, uint16_t height_px)
{
    const evs_iwe_config_t cfg = {.width_px = width_px,
                                  .height_px = height_px,
                                  .vote = EVS_IWE_NEAREST,
                                  .smooth = true,
                                  .scale = EVS_IWE_SCALE_SIGMA,
                                  .n_sigma_q4 = 48u,
                                  .full_q4 = 128u};
    return cfg;
}

static bool side_ok(uint16_t side_px) { return (side_px >= 1u) && (side_px <= EVS_SENSOR_MAX_PX); }

static bool config_ok(const evs_iwe_config_t *cfg)
{
    const bool vote_ok =
        (cfg->vote == EVS_IWE_NEAREST) || (cfg->vote == EVS_IWE_BILINEAR) || (cfg->vote == EVS_IWE_GAUSSIAN);
    const bool scale_ok = ((cfg->scale == EVS_IWE_SCALE_SIGMA) && (cfg->n_sigma_q4 <= EVS_IWE_N_SIGMA_MAX_Q4)) ||
                          ((cfg->scale == EVS_IWE_SCALE_FIXED) && (cfg->full_q4 >= 1u));
    return side_ok(cfg->width_px) && side_ok(cfg->height_px) && vote_ok && scale_ok;
}

static size_t votes_bytes(const evs_iwe_config_t *cfg)
{
    return EVS_IWE_VOTES_BYTES_(cfg->width_px, cfg->height_px, cfg->vote);
}

evs_status_t evs_iwe_init(evs_iwe_t *iwe, const evs_iwe_config_t *cfg, void *memory, size_t n_bytes)
{
    if ((iwe == NULL) || (cfg == NULL) || (memory == NULL)) { return EVS_ERR_NULL; }
    if (!config_ok(cfg) || (((uintptr_t)memory % sizeof(uint32_t)) != 0u)) { return EVS_ERR_ARG; }
    if (n_bytes < EVS_IWE_BYTES(cfg->width_px, cfg->height_px, cfg->vote)) { return EVS_ERR_SIZE; }

    *iwe = (evs_iwe_t){.cfg = *cfg, .votes = memory, .row = (uint32_t *)(void *)((uint8_t *)memory + votes_bytes(cfg))};
    evs_iwe_clear(iwe);
    return EVS_OK;
}

void evs_iwe_clear(evs_iwe_t *iwe)
{
    EVS_ASSERT(iwe != NULL);
    memset(iwe->votes, 0, votes_bytes(&iwe->cfg));
    iwe->n_votes = 0u;
}

/* The nearest pixel, as evs/tiles.h rounds. EVS_POINT_OUTSIDE rounds to -2048: off every image. */
static inline int32_t nearest(int16_t q4) { return (q4 + 8) >> 4; }

static size_t add_nearest(const evs_iwe_t *iwe, const evs_point_t *points, size_t n)
{
    uint8_t *const votes = iwe->votes;
    const uint32_t width = iwe->cfg.width_px;
    const uint32_t height = iwe->cfg.height_px;
    size_t n_taken = 0u;
    for (size_t i = 0u; i < n; i++) {
        /* Negative ones are beyond any width. */
        const uint32_t x = (uint32_t)nearest(points[i].x_q4);
        const uint32_t y = (uint32_t)nearest(points[i].y_q4);
        if ((x >= width) || (y >= height)) { continue; }
        uint8_t *const vote = votes + y * width + x;
        const uint32_t sum = *vote + 1u;
        *vote = (uint8_t)(sum - (sum >> 8));
        n_taken++;
    }
    return n_taken;
}

static inline void add_sat(uint16_t *vote, uint32_t weight)
{
    const uint32_t sum = *vote + weight;
    *vote = (sum > UINT16_MAX) ? (uint16_t)UINT16_MAX : (uint16_t)sum;
}

static void add_bilinear(const evs_iwe_t *iwe, evs_point_t p)
{
    const int32_t width = iwe->cfg.width_px;
    const int32_t x = p.x_q4 >> 4;
    const int32_t y = p.y_q4 >> 4;
    const uint32_t right = (uint32_t)p.x_q4 & 15u;
    const uint32_t below = (uint32_t)p.y_q4 & 15u;
    uint16_t *const votes = iwe->votes;
    const bool in_x[2] = {x >= 0, x + 1 < width};
    const bool in_y[2] = {y >= 0, y + 1 < iwe->cfg.height_px};
    const uint32_t w_x[2] = {16u - right, right};
    const uint32_t w_y[2] = {16u - below, below};
    for (int32_t dy = 0; dy < 2; dy++) {
        for (int32_t dx = 0; dx < 2; dx++) {
            if (in_x[dx] && in_y[dy]) { add_sat(votes + ((y + dy) * width + x + dx), w_x[dx] * w_y[dy]); }
        }
    }
}

/* Seven votes of a row, Q10 from the product of two Q16. */
static inline void add_gauss_row(uint16_t *row, const uint16_t *w_x, uint32_t w_y, int32_t from, int32_t to)
{
    for (int32_t k = from; k < to; k++) { add_sat(row + k, (w_x[k] * w_y + (UINT32_C(1) << 21)) >> 22); }
}

static void add_gaussian(const evs_iwe_t *iwe, evs_point_t p)
{
    const int32_t width = iwe->cfg.width_px;
    const int32_t height = iwe->cfg.height_px;
    const int32_t left = nearest(p.x_q4) - REACH;
    const int32_t top = nearest(p.y_q4) - REACH;
    const uint16_t *const w_x = evs_gauss_q16[(p.x_q4 + 8) & 15];
    const uint16_t *const w_y = evs_gauss_q16[(p.y_q4 + 8) & 15];
    const int32_t from_y = (top < 0) ? -top : 0;
    const int32_t to_y = (top + SUPPORT > height) ? height - top : SUPPORT;
    uint16_t *const votes = iwe->votes;
    if ((left >= 0) && (left + SUPPORT <= width)) {
        uint16_t *row = votes + ((top + from_y) * width + left);
        for (int32_t k = from_y; k < to_y; k++, row += width) { add_gauss_row(row, w_x, w_y[k], 0, SUPPORT); }
    } else {
        const int32_t from_x = (left < 0) ? -left : 0;
        const int32_t to_x = (left + SUPPORT > width) ? width - left : SUPPORT;
        for (int32_t k = from_y; k < to_y; k++) {
            uint16_t *const row = votes + ((top + k) * width + left + from_x);
            add_gauss_row(row, w_x + from_x, w_y[k], 0, to_x - from_x);
        }
    }
}

void evs_iwe_add(evs_iwe_t *iwe, const evs_point_t *points, size_t n)
{
    EVS_ASSERT((iwe != NULL) && ((points != NULL) || (n == 0u)));
    size_t n_taken = 0u;
    if (iwe->cfg.vote == EVS_IWE_NEAREST) {
        n_taken = add_nearest(iwe, points, n);
    } else {
        const bool gaussian = iwe->cfg.vote == EVS_IWE_GAUSSIAN;
        for (size_t i = 0u; i < n; i++) {
            const evs_point_t p = points[i];
            if (((uint32_t)nearest(p.x_q4) >= iwe->cfg.width_px) || ((uint32_t)nearest(p.y_q4) >= iwe->cfg.height_px)) {
                continue;
            }
            if (gaussian) {
                add_gaussian(iwe, p);
            } else {
                add_bilinear(iwe, p);
            }
            n_taken++;
        }
    }
    evs_count_add(&iwe->n_votes, n_taken);
    evs_count_add(&iwe->n_outside, n - n_taken);
}
