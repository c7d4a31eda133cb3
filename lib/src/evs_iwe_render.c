/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * Votes to grey levels, a row at a time. A row of smoothed votes lies two to a word, the left one in the low half: plain
 * arithmetic on such words does for two pixels what it does for one. Both passes make the rows anew; a plane in between
 * would take twice the memory of the votes.
 */
#include "evs/fixed.h"
#include "evs/iwe.h"

#define LOW_BYTES  UINT32_C(0x00FF00FF)
#define LOW_HALF   UINT32_C(0x0000FFFF)
#define SHIFT_GAIN 23

/* Votes per pixel that a row holds as 1: NEAREST Q4 (the smoothing's 16), BILINEAR Q8, GAUSSIAN Q10. */
static unsigned row_q(evs_iwe_vote_t vote)
{
    return (vote == EVS_IWE_NEAREST) ? 4u : ((vote == EVS_IWE_BILINEAR) ? 8u : 10u);
}

/* The first pixel in the low byte, whatever the byte order of the core. */
static inline uint32_t load_four(const uint8_t *px)
{
    return px[0] | ((uint32_t)px[1] << 8) | ((uint32_t)px[2] << 16) | ((uint32_t)px[3] << 24);
}

static inline uint32_t column(const uint8_t *up, const uint8_t *mid, const uint8_t *down, size_t x)
{
    return (uint32_t)up[x] + 2u * mid[x] + down[x];
}

/* Of four columns the sums of the even or the odd ones, from bytes moved to the low ones of each half. At most 1020. */
static inline uint32_t two_columns(uint32_t up, uint32_t mid, uint32_t down)
{
    return (up & LOW_BYTES) + 2u * (mid & LOW_BYTES) + (down & LOW_BYTES);
}

typedef struct { /* sums over four columns, two to a word */
    uint32_t even;
    uint32_t odd;
} columns_t;

static inline columns_t four_columns(const uint8_t *up, const uint8_t *mid, const uint8_t *down, size_t x)
{
    const uint32_t u = load_four(up + x);
    const uint32_t m = load_four(mid + x);
    const uint32_t d = load_four(down + x);
    columns_t c = {0u, 0u};
    if ((u | m | d) != 0u) { /* most of an image is dark */
        c.even = two_columns(u, m, d);
        c.odd = two_columns(u >> 8, m >> 8, d >> 8);
    }
    return c;
}

static void smooth_bytes(const uint8_t *up, const uint8_t *mid, const uint8_t *down, size_t width, uint32_t *row)
{
    const size_t in_fours = width & ~(size_t)3u;
    const size_t last = width - 1u;
    uint32_t left = column(up, mid, down, 0u); /* the column left of the four */
    columns_t here = {0u, 0u};
    if (in_fours > 0u) { here = four_columns(up, mid, down, 0u); }
    for (size_t x = 4u; x <= in_fours; x += 4u) {
        columns_t next = {0u, 0u};
        if (x < in_fours) {
            next = four_columns(up, mid, down, x);
        } else {
            next.even = column(up, mid, down, (x < width) ? x : last);
        }
        if ((left | here.even | here.odd | next.even) != 0u) {
            const uint32_t even = 2u * here.even + here.odd + ((here.odd << 16) | left);
            const uint32_t odd = 2u * here.odd + here.even + ((here.even >> 16) | (next.even << 16));
            row[0] = (even & LOW_HALF) | (odd << 16);
            row[1] = (even >> 16) | (odd & ~LOW_HALF);
        } else {
            row[0] = 0u;
            row[1] = 0u;
        }
        row += 2;
        left = here.odd >> 16;
        here = next;
    }
    for (size_t x = in_fours; x < width; x++) {
        const uint32_t mine = column(up, mid, down, x);
        const uint32_t sum = left + 2u * mine + column(up, mid, down, (x < last) ? x + 1u : last);
        if ((x & 1u) == 0u) {
            *row = sum;
        } else {
            *row++ |= sum << 16;
        }
        left = mine;
    }
}

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

static void make_row(const evs_iwe_t *iwe, size_t y)
{
    const size_t width = iwe->cfg.width_px;
    const size_t above = ((iwe->cfg.smooth) && (y > 0u)) ? y - 1u : y;
    const size_t below = ((iwe->cfg.smooth) && (y + 1u < iwe->cfg.height_px)) ? y + 1u : y;
    if (iwe->cfg.vote == EVS_IWE_NEAREST) {
        const uint8_t *const votes = iwe->votes;
        const uint8_t *const mid = votes + y * width;
        if (iwe->cfg.smooth) {
            smooth_bytes(votes + above * width, mid, votes + below * width, width, iwe->row);
        } else {
            for (size_t x = 0u; x < width; x += 2u) {
                const uint32_t right = (x + 1u < width) ? mid[x + 1u] : 0u;
                iwe->row[x / 2u] = ((right << 16) | mid[x]) << 4;
            }
        }
    } else {
        const uint16_t *const votes = iwe->votes;
        const uint16_t *const mid = votes + y * width;
        if (iwe->cfg.smooth) {
            smooth_halves(votes + above * width, mid, votes + below * width, width, iwe->row);
        } else {
            for (size_t x = 0u; x < width; x += 2u) {
                const uint32_t right = (x + 1u < width) ? mid[x + 1u] : 0u;
                iwe->row[x / 2u] = (right << 16) | mid[x];
            }
        }
    }
}

typedef struct { /* of the values that are not zero */
    uint64_t sum;
    uint64_t sum_of_squares;
    uint32_t n;
} moments_t;

static void add_moments(moments_t *m, const uint32_t *row, size_t n_words)
{
    uint32_t sum = 0u; /* 2048 times 65535 at most */
    uint32_t n = 0u;
    for (size_t i = 0u; i < n_words; i++) {
        const uint32_t two = row[i];
        if (two != 0u) {
            const uint32_t low = two & LOW_HALF;
            const uint32_t high = two >> 16;
            sum += low + high;
            m->sum_of_squares += (uint64_t)low * low;
            m->sum_of_squares += (uint64_t)high * high;
            n += (uint32_t)(low != 0u) + (uint32_t)(high != 0u);
        }
    }
    m->sum += sum;
    m->n += n;
}

/* a / n in Q16, rounded down; the quotient must fit 48 bits. */
static uint64_t divide_q16(uint64_t a, uint32_t n) { return ((a / n) << 16) + (((a % n) << 16) / n); }

/* The value that becomes white, Q8; at least 1. */
static uint32_t white_q8(const evs_iwe_t *iwe)
{
    const evs_iwe_config_t *const cfg = &iwe->cfg;
    if (cfg->scale == EVS_IWE_SCALE_FIXED) { return (uint32_t)cfg->full_q4 << (row_q(cfg->vote) - 4u + 8u); }

    moments_t m = {0u, 0u, 0u};
    for (size_t y = 0u; y < cfg->height_px; y++) {
        make_row(iwe, y);
        add_moments(&m, iwe->row, ((size_t)cfg->width_px + 1u) / 2u);
    }
    if (m.n == 0u) { return 1u << 8; }
    const uint64_t mean_q16 = divide_q16(m.sum, m.n);
    const uint64_t mean_of_squares_q16 = divide_q16(m.sum_of_squares, m.n);
    const uint64_t square_of_mean_q16 = (mean_q16 * mean_q16) >> 16;
    const uint64_t variance_q16 =
        (mean_of_squares_q16 > square_of_mean_q16) ? mean_of_squares_q16 - square_of_mean_q16 : 0u;
    return (uint32_t)(mean_q16 >> 8) + ((cfg->n_sigma_q4 * evs_sqrt_u64(variance_q16)) >> 4);
}

/* A value up to white times the gain stays within 255 * 2^23. */
static inline uint32_t grey(uint32_t value, uint32_t white, uint32_t gain)
{
    return (value > white) ? 255u : (value * gain + (UINT32_C(1) << (SHIFT_GAIN - 1))) >> SHIFT_GAIN;
}

static void write_row(const uint32_t *row, size_t width, uint32_t white, uint32_t gain, uint8_t *px)
{
    const size_t pairs = width / 2u;
    for (size_t i = 0u; i < pairs; i++) {
        const uint32_t two = row[i];
        if (two == 0u) {
            px[2u * i] = 0u;
            px[2u * i + 1u] = 0u;
        } else {
            px[2u * i] = (uint8_t)grey(two & LOW_HALF, white, gain);
            px[2u * i + 1u] = (uint8_t)grey(two >> 16, white, gain);
        }
    }
    if ((width & 1u) != 0u) { px[2u * pairs] = (uint8_t)grey(row[pairs] & LOW_HALF, white, gain); }
}

void evs_iwe_render(const evs_iwe_t *iwe, uint8_t *px)
{
    EVS_ASSERT((iwe != NULL) && (px != NULL));
    const size_t width = iwe->cfg.width_px;
    const uint32_t full_q8 = white_q8(iwe);
    const uint32_t white = full_q8 >> 8;
    const uint32_t gain = (uint32_t)((UINT64_C(255) << (SHIFT_GAIN + 8)) / full_q8);
    for (size_t y = 0u; y < iwe->cfg.height_px; y++) {
        make_row(iwe, y);
        write_row(iwe->row, width, white, gain, px + y * width);
    }
}
