/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/iwe.h"

#include "evs_simd.h"
#include "evs_tables.h"

#include <string.h>

#if EVS_SIMD_X86
#include <emmintrin.h>
#endif

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
    if (!config_ok(cfg)) { return EVS_ERR_ARG; }
    const size_t needed = EVS_IWE_BYTES(cfg->width_px, cfg->height_px, cfg->vote);
    if ((n_bytes < needed) || (((uintptr_t)memory & 3u) != 0u)) { return EVS_ERR_SIZE; }

    *iwe =
        (evs_iwe_t){.cfg = *cfg, .votes = memory, .rows = (uint32_t *)(void *)((uint8_t *)memory + votes_bytes(cfg))};
    evs_iwe_clear(iwe);
    return EVS_OK;
}

void evs_iwe_clear(evs_iwe_t *iwe)
{
    EVS_ASSERT(iwe != NULL);
    memset(iwe->votes, 0, votes_bytes(&iwe->cfg));
    iwe->n_votes = 0u;
}

/* The nearest pixel, as evs/tiles.h rounds. EVS_POINT_OUTSIDE rounds to -2048, and negative ones are beyond any width. */
static inline uint32_t nearest(int16_t q4) { return (uint32_t)((q4 + 8) >> 4); }

static size_t add_nearest(const evs_iwe_t *iwe, const evs_point_t *points, size_t n)
{
    uint8_t *const votes = iwe->votes;
    const uint32_t width = iwe->cfg.width_px;
    const uint32_t height = iwe->cfg.height_px;
    const evs_point_t *const end = points + n;
    size_t n_off = 0u;
    for (const evs_point_t *p = points; p != end; p++) {
        const uint32_t x = nearest(p->x_q4);
        const uint32_t y = nearest(p->y_q4);
        if ((x < width) && (y < height)) {
            uint8_t *const vote = votes + y * width + x;
            const uint32_t sum = *vote + 1u;
            *vote = (uint8_t)(sum - (sum >> 8));
        } else {
            n_off++;
        }
    }
    return n_off;
}

static inline void add_sat(uint16_t *vote, uint32_t weight)
{
    const uint32_t sum = *vote + weight;
    *vote = (sum > UINT16_MAX) ? (uint16_t)UINT16_MAX : (uint16_t)sum;
}

static void add_bilinear(const evs_iwe_t *iwe, evs_point_t p)
{
    const int32_t width = iwe->cfg.width_px;
    const int32_t height = iwe->cfg.height_px;
    const int32_t x = p.x_q4 >> 4;
    const int32_t y = p.y_q4 >> 4;
    const uint32_t right = (uint32_t)p.x_q4 & 15u;
    const uint32_t below = (uint32_t)p.y_q4 & 15u;
    /* Beyond a border its weight goes nowhere; the pixel on it stands in, so that the address is valid. */
    const uint32_t w_left = (x >= 0) ? 16u - right : 0u;
    const uint32_t w_right = (x + 1 < width) ? right : 0u;
    const uint32_t w_top = (y >= 0) ? 16u - below : 0u;
    const uint32_t w_bottom = (y + 1 < height) ? below : 0u;
    uint16_t *const top = (uint16_t *)iwe->votes + ((y >= 0) ? y : 0) * width;
    uint16_t *const bottom = (uint16_t *)iwe->votes + ((y + 1 < height) ? y + 1 : y) * width;
    const int32_t x_left = (x >= 0) ? x : 0;
    const int32_t x_right = (x + 1 < width) ? x + 1 : x;
    add_sat(top + x_left, w_left * w_top);
    add_sat(top + x_right, w_right * w_top);
    add_sat(bottom + x_left, w_left * w_bottom);
    add_sat(bottom + x_right, w_right * w_bottom);
}

/* Votes of n pixels in a row, Q10 from a product of two Q15. */
static inline void add_gauss_row(uint16_t *row, const uint16_t *w_x, uint32_t w_y, int32_t n)
{
    for (int32_t k = 0; k < n; k++) { add_sat(row + k, (w_x[k] * w_y + (UINT32_C(1) << 19)) >> 20); }
}

#if EVS_SIMD_X86
/* The same for a whole row and the zero behind it, which may meet the next row or the one for rendering. */
static inline void add_gauss_whole_row(uint16_t *row, const uint16_t *w_x, uint32_t w_y)
{
    /* Two shifts with the half between them round as one does. */
    const __m128i product =
        _mm_mulhi_epu16(_mm_loadu_si128((const __m128i *)(const void *)w_x), _mm_set1_epi16((short)w_y));
    const __m128i votes = _mm_srli_epi16(_mm_add_epi16(product, _mm_set1_epi16(8)), 4);
    __m128i *const at = (__m128i *)(void *)row;
    _mm_storeu_si128(at, _mm_adds_epu16(_mm_loadu_si128(at), votes));
}
#else
static inline void add_gauss_whole_row(uint16_t *row, const uint16_t *w_x, uint32_t w_y)
{
    add_gauss_row(row, w_x, w_y, SUPPORT);
}
#endif

static void add_gaussian(const evs_iwe_t *iwe, evs_point_t p)
{
    const int32_t width = iwe->cfg.width_px;
    const int32_t height = iwe->cfg.height_px;
    const int32_t left = (int32_t)nearest(p.x_q4) - REACH;
    const int32_t top = (int32_t)nearest(p.y_q4) - REACH;
    const uint16_t *const w_x = evs_gauss_q15[(p.x_q4 + 8) & 15];
    const uint16_t *const w_y = evs_gauss_q15[(p.y_q4 + 8) & 15];
    const int32_t from_y = (top < 0) ? -top : 0;
    const int32_t to_y = (top + SUPPORT > height) ? height - top : SUPPORT;
    const int32_t from_x = (left < 0) ? -left : 0;
    uint16_t *row = (uint16_t *)iwe->votes + ((top + from_y) * width + left + from_x);
    if ((from_x == 0) && (left + SUPPORT <= width)) {
        for (int32_t k = from_y; k < to_y; k++, row += width) { add_gauss_whole_row(row, w_x, w_y[k]); }
    } else {
        const int32_t to_x = (left + SUPPORT > width) ? width - left : SUPPORT;
        for (int32_t k = from_y; k < to_y; k++, row += width) {
            add_gauss_row(row, w_x + from_x, w_y[k], to_x - from_x);
        }
    }
}

static size_t add_shared(const evs_iwe_t *iwe, const evs_point_t *points, size_t n)
{
    const bool gaussian = iwe->cfg.vote == EVS_IWE_GAUSSIAN;
    size_t n_off = 0u;
    for (size_t i = 0u; i < n; i++) {
        const evs_point_t p = points[i];
        if ((nearest(p.x_q4) >= iwe->cfg.width_px) || (nearest(p.y_q4) >= iwe->cfg.height_px)) {
            n_off++;
        } else if (gaussian) {
            add_gaussian(iwe, p);
        } else {
            add_bilinear(iwe, p);
        }
    }
    return n_off;
}

void evs_iwe_add(evs_iwe_t *iwe, const evs_point_t *points, size_t n)
{
    EVS_ASSERT((iwe != NULL) && ((points != NULL) || (n == 0u)));
    const size_t n_off = (iwe->cfg.vote == EVS_IWE_NEAREST) ? add_nearest(iwe, points, n) : add_shared(iwe, points, n);
    evs_count_add(&iwe->n_votes, n - n_off);
    evs_count_add(&iwe->n_outside, n_off);
}
