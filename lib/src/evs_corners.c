/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/corners.h"

#include "evs/fixed.h"
#include "evs_simd.h"

#include <string.h>

enum { BLOCK = 5, MARGIN = EVS_CORNERS_MARGIN_PX };

/* |Sobel| <= 4 * 255, so a sum of 25 products is below 2^25, and the products of two such sums below 2^50. */
#define SOBEL_MAX 1020
EVS_STATIC_ASSERT(BLOCK *BLOCK *SOBEL_MAX *SOBEL_MAX < (1 << 25), "sums of products are int32_t");

/*
 * Hosts go through a row in several loops over separate arrays, which their compilers turn into vectors. Microcontrollers go
 * through it once: less to load and store.
 */
#define BY_ARRAYS (UINTPTR_MAX > UINT32_MAX)

/* Sums of products of gradients. */
typedef struct {
    int32_t xx, xy, yy;
} sums_t;

/* The caller's memory. Rows are as long as the image is wide. */
typedef struct {
    evs_corner_t *cells;
#if BY_ARRAYS
    int32_t *sum_xx; /* of the products of the last BLOCK rows, per column */
    int32_t *sum_xy;
    int32_t *sum_yy;
    int16_t *gx; /* a ring of BLOCK rows */
    int16_t *gy;
    int16_t *smooth; /* 1 2 1 down a column */
    int16_t *step;   /* -1 0 1 down a column */
#else
    sums_t *sums;        /* of the products of the last BLOCK rows, per column */
    uint32_t *gradients; /* a ring of BLOCK rows: gx in the low, gy in the high half */
#endif
} parts_t;

evs_corners_config_t evs_corners_config_default(uint16_t width_px, uint16_t height_px)
{
    const evs_corners_config_t cfg = {
        .width_px = width_px, .height_px = height_px, .cell_px = 16u, .min_permille = 10u};
    return cfg;
}

evs_status_t evs_corners_init(evs_corners_t *corners, const evs_corners_config_t *cfg, void *memory, size_t n_bytes)
{
    if ((corners == NULL) || (cfg == NULL) || (memory == NULL)) { return EVS_ERR_NULL; }
    if (!evs_in_range(cfg->width_px, 1u, EVS_SENSOR_MAX_PX) || !evs_in_range(cfg->height_px, 1u, EVS_SENSOR_MAX_PX) ||
        !evs_in_range(cfg->cell_px, EVS_CORNERS_CELL_MIN_PX, EVS_CORNERS_CELL_MAX_PX) || (cfg->min_permille > 1000u)) {
        return EVS_ERR_ARG;
    }
    const size_t needed = EVS_CORNERS_BYTES(cfg->width_px, cfg->height_px, cfg->cell_px);
    if ((n_bytes < needed) || (((uintptr_t)memory & 3u) != 0u)) { return EVS_ERR_SIZE; }

    const uint32_t cell_px = cfg->cell_px;
    *corners = (evs_corners_t){.cfg = *cfg,
                               .n_columns = (uint16_t)((cfg->width_px + cell_px - 1u) / cell_px),
                               .n_rows = (uint16_t)((cfg->height_px + cell_px - 1u) / cell_px),
                               .memory = memory};
    return EVS_OK;
}

static parts_t divide_memory(const evs_corners_t *corners)
{
    const size_t w = corners->cfg.width_px;
    parts_t p;
    p.cells = corners->memory;
    void *const rows = p.cells + (size_t)corners->n_columns * corners->n_rows;
#if BY_ARRAYS
    p.sum_xx = rows;
    p.sum_xy = p.sum_xx + w;
    p.sum_yy = p.sum_xy + w;
    p.gx = (int16_t *)(void *)(p.sum_yy + w);
    p.gy = p.gx + BLOCK * w;
    p.smooth = p.gy + BLOCK * w;
    p.step = p.smooth + w;
#else
    p.sums = rows;
    p.gradients = (uint32_t *)(void *)(p.sums + w);
#endif
    return p;
}

#if BY_ARRAYS

/* Gradients of row y, and the sums of products moved down to end with it. */
static void add_row(const parts_t *p, const evs_image_t *image, size_t y)
{
    const size_t w = image->width_px;
    const uint8_t *const above = image->px + (y - 1u) * w;
    const uint8_t *const here = above + w;
    const uint8_t *const below = here + w;
    for (size_t x = 0u; x < w; x++) {
        p->smooth[x] = (int16_t)(above[x] + 2 * here[x] + below[x]);
        p->step[x] = (int16_t)(below[x] - above[x]);
    }
    int16_t *const gx = p->gx + (y % BLOCK) * w;
    int16_t *const gy = p->gy + (y % BLOCK) * w;
    for (size_t x = 1u; x + 1u < w; x++) {
        const int32_t old_x = gx[x];
        const int32_t old_y = gy[x];
        const int32_t new_x = p->smooth[x + 1u] - p->smooth[x - 1u];
        const int32_t new_y = p->step[x - 1u] + 2 * p->step[x] + p->step[x + 1u];
        p->sum_xx[x] += new_x * new_x - old_x * old_x;
        p->sum_xy[x] += new_x * new_y - old_x * old_y;
        p->sum_yy[x] += new_y * new_y - old_y * old_y;
        gx[x] = (int16_t)new_x;
        gy[x] = (int16_t)new_y;
    }
}

static inline void add_column(sums_t *sums, const parts_t *p, size_t x)
{
    sums->xx += p->sum_xx[x];
    sums->xy += p->sum_xy[x];
    sums->yy += p->sum_yy[x];
}
static inline void subtract_column(sums_t *sums, const parts_t *p, size_t x)
{
    sums->xx -= p->sum_xx[x];
    sums->xy -= p->sum_xy[x];
    sums->yy -= p->sum_yy[x];
}

#else

/* Exchange one gradient of a column for another. */
#if EVS_SIMD_DSP
static inline int32_t add_difference(int32_t acc, uint32_t a, uint32_t b)
{
    __asm__("smlsd %0, %1, %2, %3" : "=r"(acc) : "r"(a), "r"(b), "r"(acc));
    return acc;
}
static inline uint32_t exchange(sums_t *sums, uint32_t old, int32_t gx, int32_t gy)
{
    uint32_t both_x, both_y, new; /* the new one in the low half, the old one in the high half */
    __asm__("pkhbt %0, %1, %2, lsl #16" : "=r"(both_x) : "r"(gx), "r"(old));
    __asm__("pkhbt %0, %1, %2" : "=r"(both_y) : "r"(gy), "r"(old));
    __asm__("pkhbt %0, %1, %2, lsl #16" : "=r"(new) : "r"(gx), "r"(gy));
    sums->xx = add_difference(sums->xx, both_x, both_x);
    sums->xy = add_difference(sums->xy, both_x, both_y);
    sums->yy = add_difference(sums->yy, both_y, both_y);
    return new;
}
#else
static inline uint32_t exchange(sums_t *sums, uint32_t old, int32_t gx, int32_t gy)
{
    const int32_t old_x = (int16_t)(old & 0xFFFFu);
    const int32_t old_y = (int32_t)old >> 16;
    sums->xx += gx * gx - old_x * old_x;
    sums->xy += gx * gy - old_x * old_y;
    sums->yy += gy * gy - old_y * old_y;
    return ((uint32_t)gx & 0xFFFFu) | ((uint32_t)gy << 16);
}
#endif

/* Gradients of row y, and the sums of products moved down to end with it. */
static void add_row(const parts_t *p, const evs_image_t *image, size_t y)
{
    const size_t w = image->width_px;
    const uint8_t *px = image->px + y * w;
    const uint8_t *const end = px + w;
    uint32_t *gradient = p->gradients + (y % BLOCK) * w + 1u;
    sums_t *sums = p->sums + 1u;
    int32_t smooth[2], step[2]; /* 1 2 1 and -1 0 1 down the last two columns */
    for (size_t k = 0u; k < 2u; k++) {
        const int32_t above = *(px - w), below = px[w];
        smooth[k] = above + 2 * *px + below;
        step[k] = below - above;
        px++;
    }
    while (px != end) {
        const int32_t above = *(px - w), below = px[w];
        const int32_t next_smooth = above + 2 * *px + below;
        const int32_t next_step = below - above;
        px++;
        *gradient = exchange(sums++, *gradient, next_smooth - smooth[0], step[0] + 2 * step[1] + next_step);
        gradient++;
        smooth[0] = smooth[1];
        smooth[1] = next_smooth;
        step[0] = step[1];
        step[1] = next_step;
    }
}

static inline void add_column(sums_t *sums, const parts_t *p, size_t x)
{
    sums->xx += p->sums[x].xx;
    sums->xy += p->sums[x].xy;
    sums->yy += p->sums[x].yy;
}
static inline void subtract_column(sums_t *sums, const parts_t *p, size_t x)
{
    sums->xx -= p->sums[x].xx;
    sums->xy -= p->sums[x].xy;
    sums->yy -= p->sums[x].yy;
}

#endif

/* Is the smaller eigenvalue of [xx xy; xy yy] at least s? It is when [xx-s xy; xy yy-s] has no negative one. */
static inline bool reaches(int32_t xx, int32_t xy, int32_t yy, int32_t s)
{
    return (xx >= s) && (yy >= s) && ((int64_t)(xx - s) * (yy - s) >= (int64_t)xy * xy);
}

/* Smaller eigenvalue, rounded down: (xx + yy - sqrt((xx - yy)^2 + 4 xy^2)) / 2 with the root rounded up. */
static int32_t smaller_eigenvalue(int32_t xx, int32_t xy, int32_t yy)
{
    const int64_t across = xx - yy;
    const uint64_t square = (uint64_t)(across * across + 4 * (int64_t)xy * xy);
    uint32_t root = evs_sqrt_u64(square);
    if ((uint64_t)root * root < square) { root++; }
    return (xx + yy - (int32_t)root) >> 1;
}

/* Highest score that is too low beside `highest`, or 0. */
static uint32_t too_low(uint32_t highest, uint32_t min_permille)
{
    const uint64_t limit = (uint64_t)highest * min_permille;
    return (limit == 0u) ? 0u : (uint32_t)((limit + 999u) / 1000u) - 1u;
}

/* Pixels [x, end) of row y against the best one so far of their cell. What is too low beside the highest score so far
 * is too low beside the final one, so it need not be looked at closely. */
static void score_row_of_cell(const parts_t *p, size_t x, size_t end, size_t y, evs_corner_t *cell, uint32_t *floor,
                              uint32_t *highest, uint32_t min_permille)
{
    sums_t sums = {0, 0, 0};
    for (size_t k = x - 2u; k < x + 2u; k++) { add_column(&sums, p, k); }
    int32_t beat = (int32_t)((cell->score > *floor) ? cell->score : *floor) + 1;
    for (; x < end; x++) {
        add_column(&sums, p, x + 2u);
        if (reaches(sums.xx, sums.xy, sums.yy, beat)) {
            const uint32_t score = (uint32_t)smaller_eigenvalue(sums.xx, sums.xy, sums.yy);
            cell->x_px = (uint16_t)x;
            cell->y_px = (uint16_t)y;
            cell->score = score;
            if (score > *highest) {
                *highest = score;
                *floor = too_low(score, min_permille);
            }
            beat = (int32_t)score + 1;
        }
        subtract_column(&sums, p, x - 2u);
    }
}

/* How many cells have a score above `floor`. */
static size_t count_above(const evs_corner_t *cells, size_t n, uint32_t floor)
{
    size_t count = 0u;
    for (size_t i = 0u; i < n; i++) { count += (cells[i].score > floor) ? 1u : 0u; }
    return count;
}

/* Copy the best `max` corners with scores above `floor`, in their order. */
static size_t pick(const evs_corner_t *cells, size_t n, uint32_t floor, evs_corner_t *out, size_t max)
{
    size_t n_equal = 0u; /* of those that score exactly `floor`, how many are taken */
    if (count_above(cells, n, floor) > max) {
        uint32_t low = floor; /* more than max are above it; not more are above `high` */
        uint32_t high = UINT32_MAX;
        while (high - low > 1u) {
            const uint32_t middle = low + (high - low) / 2u;
            if (count_above(cells, n, middle) > max) {
                low = middle;
            } else {
                high = middle;
            }
        }
        floor = high;
        n_equal = max - count_above(cells, n, floor);
    }
    size_t n_out = 0u;
    for (size_t i = 0u; i < n; i++) {
        if (cells[i].score > floor) {
            out[n_out++] = cells[i];
        } else if ((n_equal > 0u) && (cells[i].score == floor)) {
            out[n_out++] = cells[i];
            n_equal--;
        }
    }
    return n_out;
}

void evs_corners_begin(evs_corners_t *corners, const evs_image_t *image)
{
    EVS_ASSERT((corners != NULL) && (image != NULL) && (image->px != NULL));
    EVS_ASSERT((image->width_px == corners->cfg.width_px) && (image->height_px == corners->cfg.height_px));
    const evs_corners_config_t *const cfg = &corners->cfg;
    const bool has_blocks = (cfg->width_px > 2u * MARGIN) && (cfg->height_px > 2u * MARGIN);
    corners->image = *image;
    corners->y_next = has_blocks ? 1u : cfg->height_px;
    corners->highest = 0u;
    corners->floor = 0u;
    memset(corners->memory, 0, EVS_CORNERS_BYTES(cfg->width_px, cfg->height_px, cfg->cell_px));
}

bool evs_corners_scan(evs_corners_t *corners, size_t n_rows)
{
    EVS_ASSERT(corners != NULL);
    const size_t w = corners->cfg.width_px;
    const size_t cell_px = corners->cfg.cell_px;
    const size_t y_end = corners->cfg.height_px - 1u; /* the last row has no gradient */
    if (corners->y_next >= y_end) { return true; }
    const size_t y_stop = (n_rows < y_end - corners->y_next) ? corners->y_next + n_rows : y_end;
    const parts_t p = divide_memory(corners);
    for (size_t y = corners->y_next; y < y_stop; y++) {
        add_row(&p, &corners->image, y);
        if (y < MARGIN + 2u) { continue; }
        const size_t y_centre = y - 2u;
        evs_corner_t *cell = p.cells + y_centre / cell_px * corners->n_columns;
        for (size_t left = 0u; left < w; left += cell_px) {
            const size_t right = left + cell_px;
            const size_t begin = (left < MARGIN) ? MARGIN : left;
            const size_t end = (right < w - MARGIN) ? right : w - MARGIN;
            if (begin < end) {
                score_row_of_cell(&p, begin, end, y_centre, cell, &corners->floor, &corners->highest,
                                  corners->cfg.min_permille);
            }
            cell++;
        }
    }
    corners->y_next = (uint16_t)y_stop;
    return y_stop == y_end;
}

size_t evs_corners_take(const evs_corners_t *corners, evs_corner_t *out, size_t max)
{
    EVS_ASSERT((corners != NULL) && ((out != NULL) || (max == 0u)));
    if (max == 0u) { return 0u; }
    return pick(corners->memory, (size_t)corners->n_columns * corners->n_rows, corners->floor, out, max);
}

size_t evs_corners_find(evs_corners_t *corners, const evs_image_t *image, evs_corner_t *out, size_t max)
{
    evs_corners_begin(corners, image);
    (void)evs_corners_scan(corners, corners->cfg.height_px);
    return evs_corners_take(corners, out, max);
}
