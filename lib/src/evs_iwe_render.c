/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * Votes to grey levels, a row at a time, in two passes: what is white, and the image. Both smooth the votes anew; a plane in
 * between would take twice the memory of the votes. Smoothed votes lie two to a word, one in each half: plain arithmetic on
 * such words does for two pixels what it does for one.
 */
#include "evs/fixed.h"
#include "evs/iwe.h"

#define LOW_BYTES  UINT32_C(0x00FF00FF)
#define LOW_HALF   UINT32_C(0x0000FFFF)
#define SHIFT_GAIN 23

/* Votes per pixel that a smoothed 1 stands for: NEAREST Q4 (the smoothing's 16), BILINEAR Q8, GAUSSIAN Q10. */
static unsigned smoothed_q(evs_iwe_vote_t vote)
{
    return (vote == EVS_IWE_NEAREST) ? 4u : ((vote == EVS_IWE_BILINEAR) ? 8u : 10u);
}

typedef struct { /* of the smoothed votes that are not zero */
    uint64_t sum;
    uint64_t sum_of_squares;
    uint32_t n;
} moments_t;

static inline void add_two(moments_t *m, uint32_t two)
{
    const uint32_t low = two & LOW_HALF;
    const uint32_t high = two >> 16;
    m->sum += low + high;
    m->sum_of_squares += (uint64_t)low * low;
    m->sum_of_squares += (uint64_t)high * high;
    m->n += (uint32_t)(low != 0u) + (uint32_t)(high != 0u);
}

typedef struct {
    uint32_t white; /* what is more is white, too */
    uint32_t gain;  /* grey levels of a smoothed 1; times `white` at most 255 * 2^SHIFT_GAIN */
} scale_t;

static inline uint8_t grey(scale_t scale, uint32_t value)
{
    return (uint8_t)((value > scale.white) ? 255u
                                           : (value * scale.gain + (UINT32_C(1) << (SHIFT_GAIN - 1))) >> SHIFT_GAIN);
}

/* --- votes of a byte, smoothed --------------------------------------------------------------------------------- */

/*
 * Four pixels are two words, the even pixels and the odd ones, the left one of each in the low half. A row of sums over
 * three neighbours, at most 1020; three such rows above each other make the smoothed one, at most 4080.
 */
static size_t n_fours(size_t width) { return (width + 3u) / 4u; }

/* Up to four pixels in the bytes of a word, the first in the lowest; behind the last one of a row that one again. */
static uint32_t load_last(const uint8_t *px, size_t n)
{
    uint32_t four = 0u;
    for (size_t i = 0u; i < 4u; i++) { four |= (uint32_t)px[(i < n) ? i : n - 1u] << (8u * i); }
    return four;
}
static inline uint32_t load_four(const uint8_t *px)
{
    return px[0] | ((uint32_t)px[1] << 8) | ((uint32_t)px[2] << 16) | ((uint32_t)px[3] << 24);
}

static void sum_row(const uint8_t *px, size_t width, uint32_t *sums)
{
    const size_t last = (width - 1u) & ~(size_t)3u; /* where the last four begin, of which there may be fewer */
    uint32_t left = px[0];
    uint32_t four = (last > 0u) ? load_four(px) : load_last(px, width);
    for (size_t x = 0u; x <= last; x += 4u) {
        const size_t next_x = x + 4u;
        const uint32_t next = (next_x < last)    ? load_four(px + next_x)
                              : (next_x == last) ? load_last(px + next_x, width - next_x)
                                                 : four >> 24;
        if ((left | four | (next & 0xFFu)) == 0u) { /* most of an image is dark */
            sums[0] = 0u;
            sums[1] = 0u;
        } else {
            const uint32_t even = four & LOW_BYTES;
            const uint32_t odd = (four >> 8) & LOW_BYTES;
            sums[0] = 2u * even + odd + ((odd << 16) | left);
            sums[1] = 2u * odd + even + ((even >> 16) | (next << 16 & 0xFF0000u));
        }
        sums += 2;
        left = four >> 24;
        four = next;
    }
    /* Nothing lies behind the last pixel. */
    const size_t n = width - last;
    if (n < 4u) {
        sums[-1] &= (n < 2u) ? 0u : LOW_HALF;
        sums[-2] &= (n < 3u) ? LOW_HALF : UINT32_MAX;
    }
}

typedef struct {
    const uint32_t *up;
    const uint32_t *mid;
    const uint32_t *down;
} sums_t;

/* The sums around row y. Rows are asked for in order: each is made once and stays for the next two. */
static sums_t sums_around(const evs_iwe_t *iwe, size_t y)
{
    const size_t width = iwe->cfg.width_px;
    const size_t last = iwe->cfg.height_px - 1u;
    const size_t n_words = 2u * n_fours(width);
    const uint8_t *const votes = iwe->votes;
    if (y == 0u) { sum_row(votes, width, iwe->rows); }
    if (y < last) { sum_row(votes + (y + 1u) * width, width, iwe->rows + (y + 1u) % 3u * n_words); }
    const sums_t around = {iwe->rows + ((y > 0u) ? y - 1u : 0u) % 3u * n_words, iwe->rows + y % 3u * n_words,
                           iwe->rows + ((y < last) ? y + 1u : last) % 3u * n_words};
    return around;
}

static inline uint32_t smoothed_two(sums_t s, size_t i) { return s.up[i] + 2u * s.mid[i] + s.down[i]; }

static moments_t measure_smoothed_bytes(const evs_iwe_t *iwe)
{
    moments_t m = {0u, 0u, 0u};
    const size_t n_words = 2u * n_fours(iwe->cfg.width_px);
    for (size_t y = 0u; y < iwe->cfg.height_px; y++) {
        const sums_t sums = sums_around(iwe, y);
        for (size_t i = 0u; i < n_words; i++) {
            const uint32_t two = smoothed_two(sums, i);
            if (two != 0u) { add_two(&m, two); }
        }
    }
    return m;
}

static void write_smoothed_bytes(const evs_iwe_t *iwe, scale_t scale, uint8_t *px)
{
    const size_t width = iwe->cfg.width_px;
    for (size_t y = 0u; y < iwe->cfg.height_px; y++) {
        const sums_t sums = sums_around(iwe, y);
        size_t x = 0u;
        for (; x + 4u <= width; x += 4u, px += 4) {
            const uint32_t even = smoothed_two(sums, x / 2u);
            const uint32_t odd = smoothed_two(sums, x / 2u + 1u);
            if ((even | odd) == 0u) {
                px[0] = px[1] = px[2] = px[3] = 0u;
            } else {
                px[0] = grey(scale, even & LOW_HALF);
                px[1] = grey(scale, odd & LOW_HALF);
                px[2] = grey(scale, even >> 16);
                px[3] = grey(scale, odd >> 16);
            }
        }
        for (; x < width; x++) {
            const uint32_t two = smoothed_two(sums, x / 4u * 2u + (x & 1u));
            *px++ = grey(scale, ((x & 2u) == 0u) ? two & LOW_HALF : two >> 16);
        }
    }
}

/* --- other votes, smoothed or not ------------------------------------------------------------------------------ */

static inline uint32_t column_wide(const uint16_t *up, const uint16_t *mid, const uint16_t *down, size_t x)
{
    return (uint32_t)up[x] + 2u * mid[x] + down[x];
}

/* Sums to 16 times 65535, rounded back to 16 bits. */
static void smooth_halves(const uint16_t *up, const uint16_t *mid, const uint16_t *down, size_t width, uint32_t *row)
{
    uint32_t here = column_wide(up, mid, down, 0u);
    uint32_t left = here;
    for (size_t x = 0u; x < width; x++) {
        const uint32_t right = (x + 1u < width) ? column_wide(up, mid, down, x + 1u) : here;
        const uint32_t sum = (left + 2u * here + right + 8u) >> 4;
        if ((x & 1u) == 0u) {
            *row = sum;
        } else {
            *row++ |= sum << 16;
        }
        left = here;
        here = right;
    }
}

/* A row of values, two to a word, the left one in the low half. */
static void make_row(const evs_iwe_t *iwe, size_t y)
{
    const size_t width = iwe->cfg.width_px;
    uint32_t *const row = iwe->rows;
    if (iwe->cfg.vote == EVS_IWE_NEAREST) {
        const uint8_t *const votes = (const uint8_t *)iwe->votes + y * width;
        for (size_t x = 0u; x < width; x += 2u) {
            const uint32_t right = (x + 1u < width) ? votes[x + 1u] : 0u;
            row[x / 2u] = ((right << 16) | votes[x]) << 4;
        }
    } else {
        const uint16_t *const votes = (const uint16_t *)iwe->votes + y * width;
        if (iwe->cfg.smooth) {
            smooth_halves((y > 0u) ? votes - width : votes, votes,
                          (y + 1u < iwe->cfg.height_px) ? votes + width : votes, width, row);
        } else {
            for (size_t x = 0u; x < width; x += 2u) {
                const uint32_t right = (x + 1u < width) ? votes[x + 1u] : 0u;
                row[x / 2u] = (right << 16) | votes[x];
            }
        }
    }
}

static moments_t measure_rows(const evs_iwe_t *iwe)
{
    moments_t m = {0u, 0u, 0u};
    const size_t n_words = ((size_t)iwe->cfg.width_px + 1u) / 2u;
    for (size_t y = 0u; y < iwe->cfg.height_px; y++) {
        make_row(iwe, y);
        for (size_t i = 0u; i < n_words; i++) {
            if (iwe->rows[i] != 0u) { add_two(&m, iwe->rows[i]); }
        }
    }
    return m;
}

static void write_rows(const evs_iwe_t *iwe, scale_t scale, uint8_t *px)
{
    const size_t width = iwe->cfg.width_px;
    for (size_t y = 0u; y < iwe->cfg.height_px; y++) {
        make_row(iwe, y);
        for (size_t i = 0u; i < width / 2u; i++, px += 2) {
            const uint32_t two = iwe->rows[i];
            if (two == 0u) {
                px[0] = px[1] = 0u;
            } else {
                px[0] = grey(scale, two & LOW_HALF);
                px[1] = grey(scale, two >> 16);
            }
        }
        if ((width & 1u) != 0u) { *px++ = grey(scale, iwe->rows[width / 2u] & LOW_HALF); }
    }
}

/* --- either ---------------------------------------------------------------------------------------------------- */

static bool smooths_bytes(const evs_iwe_t *iwe) { return (iwe->cfg.vote == EVS_IWE_NEAREST) && iwe->cfg.smooth; }

/* a / n in Q16, rounded down; the quotient must fit 48 bits. */
static uint64_t divide_q16(uint64_t a, uint32_t n) { return ((a / n) << 16) + (((a % n) << 16) / n); }

/* The value that becomes white, Q8; at least 1. */
static uint32_t white_q8(const evs_iwe_t *iwe)
{
    const evs_iwe_config_t *const cfg = &iwe->cfg;
    if (cfg->scale == EVS_IWE_SCALE_FIXED) { return (uint32_t)cfg->full_q4 << (smoothed_q(cfg->vote) - 4u + 8u); }

    const moments_t m = smooths_bytes(iwe) ? measure_smoothed_bytes(iwe) : measure_rows(iwe);
    if (m.n == 0u) { return 1u << 8; }
    const uint64_t mean_q16 = divide_q16(m.sum, m.n);
    const uint64_t mean_of_squares_q16 = divide_q16(m.sum_of_squares, m.n);
    const uint64_t square_of_mean_q16 = (mean_q16 * mean_q16) >> 16;
    const uint64_t variance_q16 =
        (mean_of_squares_q16 > square_of_mean_q16) ? mean_of_squares_q16 - square_of_mean_q16 : 0u;
    return (uint32_t)(mean_q16 >> 8) + ((cfg->n_sigma_q4 * evs_sqrt_u64(variance_q16)) >> 4);
}

void evs_iwe_render(const evs_iwe_t *iwe, uint8_t *px)
{
    EVS_ASSERT((iwe != NULL) && (px != NULL));
    const uint32_t full_q8 = white_q8(iwe);
    const scale_t scale = {.white = full_q8 >> 8, .gain = (uint32_t)((UINT64_C(255) << (SHIFT_GAIN + 8)) / full_q8)};
    if (smooths_bytes(iwe)) {
        write_smoothed_bytes(iwe, scale, px);
    } else {
        write_rows(iwe, scale, px);
    }
}
