/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/warp.h"

#include "evs_warp_private.h"

#include <string.h>

#define PX_Q6 64 /* one pixel of displacement */

/* Standard deviation of the contrast of n events scattered at random over A cells: factor * n / sqrt(A). Theory gives
 * this form (random pairs of events that meet), simulation the factors, at 50 to 6000 events: within 5 %. Between two
 * displacements contrast changes by less, the closer they are: for each cell by about 0.2 of the deviation, gradients by a
 * quarter more. A search finds the largest of many such changes. */
#define NOISE_MEAN_SQUARE 22600u  /* 0.345 * 2^16 */
#define NOISE_GRADIENT    934000u /* 11.4 * 5/4 * 2^16 */

/* Displacements that differ by more than this are as good as independent; and none is closer than a quarter cell. */
#define NOISE_REACH_Q6   (5 * PX_Q6)
#define NOISE_CLOSEST_Q6 (PX_Q6 / 4)

/* Over many tiles chance averages out: noise gains less than 1/2 of what it may in one. */
#define TILES_NOISE_16THS 9u

/* The loss per px^2 away from the start of a tile's search, as a part of the contrast there: 0.002. */
#define HOLD_Q16 131u

/* Steps of the first level, each on an image whose cells are about as large, and of a tile. Steps below 1 px do not pay:
 * the contrast of a few thousand events is rough at that scale, and a parabola over a whole pixel averages it. */
#define FIRST_STEP_Q6 (8 * PX_Q6)
#define LAST_STEP_Q6  PX_Q6

/* Of tiles, the coarser levels only have to find where the next begins. They look at no more events than this per
 * search, and at cells of 2 px. */
#define FIRST_EVENTS  4000u
#define COARSE_EVENTS 2000u
#define COARSE_SHIFT  1u

/* Moves per step size. With the halving of steps it bounds the number of evaluations; four moves of 8 px are max_px. */
#define MAX_MOVES 4u

typedef struct { /* A displacement over the window, Q6 px. */
    int32_t x;
    int32_t y;
} offset_t;

static const offset_t ZERO = {0, 0};

/* Left, right, up, down: k ^ 1 is the opposite of k. */
static const offset_t DIRECTION[4] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};

typedef struct { /* Tiles next to each other, whose events are moved together; the ends excluded. */
    uint32_t col0, col1, row0, row1;
} block_t;

typedef struct { /* The search for the displacement of one block. */
    block_t block;
    evs_warp_view_t view;
    uint32_t stride; /* every how many of its events are looked at */
    offset_t held_at;
    uint64_t hold_q16; /* the contrast that a px^2 away from there costs; 0: nothing holds it */
    offset_t best;
    int64_t score;     /* at best: contrast without the cost */
    int64_t around[4]; /* the score one step away */
    bool at_top;       /* all four are known, and lower */
} search_t;

/* --- configuration --------------------------------------------------------------------------------------------- */

evs_warp_config_t evs_warp_config_default(evs_warp_kind_t kind, uint16_t width_px, uint16_t height_px)
{
    const bool global = kind == EVS_WARP_GLOBAL;
    const evs_warp_config_t cfg = {.kind = kind,
                                   .cost = EVS_WARP_MEAN_SQUARE,
                                   .width_px = width_px,
                                   .height_px = height_px,
                                   .n_cols = EVS_FLOW_GRID_COLS,
                                   .n_rows = EVS_FLOW_GRID_ROWS,
                                   .n_budget = global ? EVS_WARP_BUDGET_GLOBAL : EVS_WARP_BUDGET_TILED,
                                   .n_min = global ? 500u : 40u,
                                   .max_px = 32u,
                                   .shift = 1u,
                                   .noise_percent = 100u};
    return cfg;
}

size_t evs_warp_bytes(const evs_warp_config_t *cfg)
{
    EVS_ASSERT(cfg != NULL);
    if (cfg->kind == EVS_WARP_PREDICTED) { return 0u; }
    return EVS_WARP_BYTES(cfg->width_px, cfg->height_px, cfg->n_budget, cfg->max_px, cfg->shift);
}

static bool config_ok(const evs_warp_config_t *cfg)
{
    evs_flow_grid_t grid;
    return ((cfg->kind == EVS_WARP_PREDICTED) || (cfg->kind == EVS_WARP_GLOBAL) || (cfg->kind == EVS_WARP_TILED)) &&
           ((cfg->cost == EVS_WARP_MEAN_SQUARE) || (cfg->cost == EVS_WARP_GRADIENT)) &&
           evs_in_range(cfg->width_px, 16u, EVS_SENSOR_MAX_PX) &&
           evs_in_range(cfg->height_px, 16u, EVS_SENSOR_MAX_PX) &&
           (evs_flow_grid_init(&grid, cfg->width_px, cfg->height_px, cfg->n_cols, cfg->n_rows) == EVS_OK) &&
           evs_in_range(cfg->n_budget, 1u, EVS_WARP_BUDGET_MAX) && (cfg->n_min >= 2u) &&
           evs_in_range(cfg->max_px, 2u, EVS_WARP_MAX_PX) && evs_in_range(cfg->shift, 1u, EVS_WARP_SHIFT_MAX) &&
           (cfg->noise_percent <= EVS_WARP_NOISE_MAX_PERCENT);
}

evs_status_t evs_warp_init(evs_warp_t *warp, const evs_warp_config_t *cfg, void *memory, size_t n_bytes)
{
    if ((warp == NULL) || (cfg == NULL)) { return EVS_ERR_NULL; }
    if (!config_ok(cfg)) { return EVS_ERR_ARG; }
    const size_t needed = evs_warp_bytes(cfg);
    if ((memory == NULL) && (needed > 0u)) { return EVS_ERR_NULL; }
    if ((n_bytes < needed) || (((uintptr_t)memory & 1u) != 0u)) { return EVS_ERR_SIZE; }

    *warp = (evs_warp_t){.cfg = *cfg};
    if (needed > 0u) {
        warp->events = (evs_warp_event_t *)memory;
        warp->cells = (uint16_t *)(warp->events + cfg->n_budget);
        warp->n_cells = EVS_WARP_CELLS(cfg->width_px, cfg->height_px, cfg->max_px, cfg->shift);
    }
    return EVS_OK;
}

/* --- the events of a window ------------------------------------------------------------------------------------ */

static size_t count_on_image(const evs_flow_grid_t *grid, const evs_point_t *points, size_t n)
{
    size_t n_on = 0u;
    for (size_t i = 0u; i < n; i++) {
        if (evs_flow_grid_tile_of(grid, points[i]) != EVS_FLOW_GRID_TILES_MAX) { n_on++; }
    }
    return n_on;
}

/* Time from the middle of the window by its length, within +-1/2 even if times do not ascend. */
static int16_t window_time_q12(uint32_t t_us, uint32_t middle_us, uint32_t per_us, unsigned shift)
{
    const int64_t dt = evs_time_diff_us(t_us, middle_us);
    const int32_t dt_q12 = evs_sat32(evs_shr_r64(dt * (int64_t)(per_us >> 1), shift - 13u));
    return (int16_t)evs_clamp(dt_q12, -2048, 2048);
}

/* A place in [-1/2, 1/2) px from the upper bits of a hash. */
static int32_t within_pixel_q4(uint32_t hash) { return (int32_t)(hash >> 28) - 8; }

/* Take every k-th event on the image, sorted by the finest tiles; in a tile in order of time. Returns their number. */
static size_t take_events(evs_warp_t *warp, const evs_event_t *ev, const evs_point_t *points, size_t n,
                          uint32_t span_us)
{
    const evs_flow_grid_t *const grid = &warp->tiles;
    const size_t n_on = count_on_image(grid, points, n);
    const size_t stride = (n_on + warp->cfg.n_budget - 1u) / warp->cfg.n_budget;
    if (stride == 0u) { return 0u; }
    unsigned shift;
    const uint32_t per_us = evs_recip_u32(span_us, &shift);
    const uint32_t middle_us = ev[0].t_us + span_us / 2u;
    const uint32_t n_tiles = (uint32_t)grid->n_cols * grid->n_rows;

    /* Twice through the events: first to count those of each tile, then to put them in their places. */
    uint16_t *const first = warp->first;
    memset(first, 0, (n_tiles + 1u) * sizeof first[0]);
    size_t wait = 0u;
    for (size_t i = 0u; i < n; i++) {
        const uint32_t tile = evs_flow_grid_tile_of(grid, points[i]);
        if (tile == EVS_FLOW_GRID_TILES_MAX) { continue; }
        if (wait == 0u) {
            first[tile + 1u]++;
            wait = stride;
        }
        wait--;
    }
    for (uint32_t tile = 0u; tile < n_tiles; tile++) { first[tile + 1u] = (uint16_t)(first[tile + 1u] + first[tile]); }
    const size_t n_taken = first[n_tiles];
    uint32_t n_placed = 0u;
    wait = 0u;
    for (size_t i = 0u; i < n; i++) {
        const uint32_t tile = evs_flow_grid_tile_of(grid, points[i]);
        if (tile == EVS_FLOW_GRID_TILES_MAX) { continue; }
        if (wait == 0u) {
            /* An event is somewhere in its pixel. Left at the centre, events of a pixel would meet exactly when they
             * are not moved, and only then: zero would win over every true displacement of a pixel or two. */
            evs_warp_event_t *const to = &warp->events[first[tile]++];
            to->x_q4 = (int16_t)(points[i].x_q4 + within_pixel_q4(n_placed * UINT32_C(0x9E3779B9)));
            to->y_q4 = (int16_t)(points[i].y_q4 + within_pixel_q4(n_placed * UINT32_C(0x85EBCA6B)));
            to->dt_q12 = window_time_q12(ev[i].t_us, middle_us, per_us, shift);
            n_placed++;
            wait = stride;
        }
        wait--;
    }
    /* Each start has become the start of the next tile. */
    memmove(&first[1], &first[0], n_tiles * sizeof first[0]);
    first[0] = 0u;
    return n_taken;
}

/* --- the contrast of a block ----------------------------------------------------------------------------------- */

static uint32_t events_before(const evs_warp_t *warp, uint32_t row, uint32_t col)
{
    return warp->first[row * warp->tiles.n_cols + col];
}

static uint32_t count_events(const evs_warp_t *warp, const block_t *block)
{
    uint32_t n = 0u;
    for (uint32_t row = block->row0; row < block->row1; row++) {
        n += events_before(warp, row, block->col1) - events_before(warp, row, block->col0);
    }
    return n;
}

/* The part of the image in which the events of a block fall when moved by up to a reach, in cells of 2^shift px. */
static evs_warp_view_t view_of(const evs_warp_t *warp, const block_t *block, offset_t reach, unsigned shift)
{
    const evs_warp_config_t *const cfg = &warp->cfg;
    const uint32_t n_cols = warp->tiles.n_cols;
    const uint32_t n_rows = warp->tiles.n_rows;
    const uint32_t x0 = block->col0 * cfg->width_px / n_cols;
    const uint32_t y0 = block->row0 * cfg->height_px / n_rows;
    const uint32_t x1 = (block->col1 * cfg->width_px + n_cols - 1u) / n_cols;
    const uint32_t y1 = (block->row1 * cfg->height_px + n_rows - 1u) / n_rows;
    const uint32_t reach_x_px = ((uint32_t)reach.x + PX_Q6 - 1u) / PX_Q6;
    const uint32_t reach_y_px = ((uint32_t)reach.y + PX_Q6 - 1u) / PX_Q6;
    const evs_warp_view_t view = {.width = EVS_WARP_SIDE(x1 - x0, reach_x_px, shift),
                                  .height = EVS_WARP_SIDE(y1 - y0, reach_y_px, shift),
                                  .shift = shift,
                                  .x_px = (int32_t)x0 - (int32_t)EVS_WARP_MARGIN_PX(reach_x_px),
                                  .y_px = (int32_t)y0 - (int32_t)EVS_WARP_MARGIN_PX(reach_y_px)};
    return view;
}

/* The finest view of a block, from a shift on, that there is memory for: at the resolution of the whole image there is for every block. */
static evs_warp_view_t finest_view(const evs_warp_t *warp, const block_t *block, offset_t reach, unsigned shift)
{
    evs_warp_view_t view = view_of(warp, block, reach, shift);
    while (view.width * (view.height + 2u) > warp->n_cells) {
        shift++;
        view = view_of(warp, block, reach, shift);
    }
    return view;
}

/* Vote for all events of a block; false when a cell has wrapped. */
static bool vote(evs_warp_t *warp, const search_t *s, offset_t d, bool limited)
{
    memset(warp->cells, 0, (size_t)s->view.width * (s->view.height + 1u) * sizeof warp->cells[0]);
    for (uint32_t row = s->block.row0; row < s->block.row1; row++) {
        const evs_warp_event_t *const ev = warp->events + events_before(warp, row, s->block.col0);
        const uint32_t n = events_before(warp, row, s->block.col1) - events_before(warp, row, s->block.col0);
        if (limited) {
            evs_warp_vote_limited(&s->view, warp->cells, ev, n, s->stride, d.x, d.y);
        } else if (!evs_warp_vote(&s->view, warp->cells, ev, n, s->stride, d.x, d.y)) {
            return false;
        }
    }
    return true;
}

static uint64_t contrast(evs_warp_t *warp, const search_t *s, offset_t d)
{
    if (!vote(warp, s, d, false)) { (void)vote(warp, s, d, true); }
    warp->n_evaluations++;
    return evs_warp_contrast(&s->view, warp->cells, warp->cfg.cost);
}

/* --- the search of a block ------------------------------------------------------------------------------------- */

/* What a displacement costs. Votes of at most 2^16 events, 2^8 each, in cells below 2^16 keep the contrast below 2^40,
 * that of gradients below 2^46; 131 / 2^16 of it times 2^25 for the distance squared fits 64 bits. */
static int64_t cost_of(const search_t *s, offset_t d)
{
    const int64_t x = d.x - s->held_at.x;
    const int64_t y = d.y - s->held_at.y;
    return (int64_t)((s->hold_q16 * (uint64_t)(x * x + y * y)) >> 12); /* from Q6 squared */
}

static int64_t score_at(evs_warp_t *warp, const search_t *s, offset_t d)
{
    return (int64_t)contrast(warp, s, d) - cost_of(s, d);
}

/* Begin at a displacement; how strongly it holds is known only once its contrast is. */
static void search_begin(evs_warp_t *warp, search_t *s, offset_t d, bool hold)
{
    s->held_at = d;
    s->hold_q16 = 0u;
    s->best = d;
    s->score = score_at(warp, s, d);
    if (hold) { s->hold_q16 = ((uint64_t)s->score >> 16) * HOLD_Q16; }
}

/* A place whose score is known. */
static void search_take(search_t *s, offset_t d, int64_t score)
{
    if (score > s->score) {
        s->best = d;
        s->score = score;
    }
}

static void search_try(evs_warp_t *warp, search_t *s, offset_t d)
{
    if ((d.x != s->best.x) || (d.y != s->best.y)) { search_take(s, d, score_at(warp, s, d)); }
}

static bool within(const evs_warp_config_t *cfg, offset_t d)
{
    const uint32_t limit = cfg->max_px * (uint32_t)PX_Q6;
    return (evs_abs_u32(d.x) <= limit) && (evs_abs_u32(d.y) <= limit);
}

/* Go to the best of the four neighbours until none is better. */
static void search_step(evs_warp_t *warp, search_t *s, int32_t step_q6)
{
    uint32_t back = 4u; /* the neighbour that the last move came from */
    s->at_top = false;
    for (uint32_t move = 0u; move <= MAX_MOVES; move++) {
        bool known = true;
        uint32_t to = 4u;
        int64_t highest = s->score;
        for (uint32_t k = 0u; k < 4u; k++) {
            const offset_t d = {s->best.x + step_q6 * DIRECTION[k].x, s->best.y + step_q6 * DIRECTION[k].y};
            if (!within(&warp->cfg, d)) {
                known = false;
                continue;
            }
            if (k != back) { s->around[k] = score_at(warp, s, d); }
            if (s->around[k] > highest) {
                highest = s->around[k];
                to = k;
            }
        }
        if (to == 4u) {
            s->at_top = known;
            return;
        }
        back = to ^ 1u;
        s->around[back] = s->score;
        s->best.x += step_q6 * DIRECTION[to].x;
        s->best.y += step_q6 * DIRECTION[to].y;
        s->score = highest;
    }
}

/* Where the parabola through three scores, the middle one the highest, has its top: at most half a step away. */
static int32_t parabola_top(int64_t before, int64_t middle, int64_t after, int32_t step_q6)
{
    const uint64_t bend = (uint64_t)(middle - before) + (uint64_t)(middle - after);
    const int64_t tilt = after - before;
    const unsigned bits = 64u - evs_clz64(bend);
    const unsigned down = (bits > 22u) ? bits - 22u : 0u; /* |tilt| <= bend, and a step has 7 bits */
    const int32_t divisor = 2 * (int32_t)(bend >> down);
    return (divisor == 0) ? 0 : (step_q6 * (int32_t)(tilt >> down)) / divisor;
}

static void search_refine(evs_warp_t *warp, search_t *s, int32_t step_q6)
{
    if (!s->at_top) { return; }
    const offset_t top = {s->best.x + parabola_top(s->around[0], s->score, s->around[1], step_q6),
                          s->best.y + parabola_top(s->around[2], s->score, s->around[3], step_q6)};
    search_try(warp, s, top);
}

static void search_nearby(evs_warp_t *warp, search_t *s)
{
    search_step(warp, s, LAST_STEP_Q6);
    search_refine(warp, s, LAST_STEP_Q6);
}

/* What the search may gain on noise: in units of the standard deviation the distance in cells from where the gain is
 * counted. A gain of as much as that on real events is no accident. */
static uint64_t noise_gain(const evs_warp_t *warp, const search_t *s, offset_t from)
{
    const int64_t x = s->best.x - from.x;
    const int64_t y = s->best.y - from.y;
    const uint32_t apart_q6 = evs_sqrt_u64((uint64_t)(x * x + y * y)) >> s->view.shift;
    const uint32_t distance_q6 = (uint32_t)evs_clamp((int32_t)apart_q6, NOISE_CLOSEST_Q6, NOISE_REACH_Q6);
    const uint64_t n_tiles = (uint64_t)(s->block.col1 - s->block.col0) * (s->block.row1 - s->block.row0);
    const uint64_t area_px =
        n_tiles * warp->cfg.width_px * warp->cfg.height_px / ((uint32_t)warp->tiles.n_cols * warp->tiles.n_rows);
    const uint32_t side_q8 = evs_sqrt_u64(area_px << 16) >> s->view.shift;
    const uint64_t factor = (warp->cfg.cost == EVS_WARP_GRADIENT) ? NOISE_GRADIENT : NOISE_MEAN_SQUARE;
    /* 20 + 16 + 9 bits, and 2 to get from Q6 to Q8 */
    return ((factor * (count_events(warp, &s->block) / s->stride) * distance_q6) << 2) /
           ((side_q8 > 0u) ? side_q8 : 1u);
}

/* --- levels ---------------------------------------------------------------------------------------------------- */

/* Cells of the first level for a step: about its size, but never finer than there is memory for. */
static unsigned first_shift(const evs_warp_t *warp, int32_t step_q6)
{
    unsigned shift = 0u;
    while ((shift < 3u) && ((PX_Q6 << (shift + 1u)) <= step_q6)) { shift++; }
    return (shift < warp->cfg.shift) ? warp->cfg.shift : shift;
}

/* One displacement for all events. Leaves the view at the resolution of the last steps. */
static void search_all(evs_warp_t *warp, search_t *s, offset_t initial, uint32_t stride)
{
    const int32_t reach = warp->cfg.max_px * PX_Q6;
    s->stride = stride;
    s->block = (block_t){0u, warp->tiles.n_cols, 0u, warp->tiles.n_rows};
    s->view = (evs_warp_view_t){.shift = 0u};
    s->best = initial;
    for (int32_t step_q6 = FIRST_STEP_Q6; step_q6 >= LAST_STEP_Q6; step_q6 /= 2) {
        const unsigned shift = first_shift(warp, step_q6);
        if (shift != s->view.shift) { /* another image: what a coarser one has found must hold there, too */
            s->view = view_of(warp, &s->block, (offset_t){reach, reach}, shift);
            search_begin(warp, s, s->best, false);
            search_try(warp, s, initial);
            search_try(warp, s, ZERO);
        }
        search_step(warp, s, step_q6);
    }
    search_refine(warp, s, LAST_STEP_Q6);
}

static offset_t offset_of(evs_flow_velocity_t raw) { return (offset_t){raw.x_px_s_q3, raw.y_px_s_q3}; }

/* A grid that holds displacements Q6 in place of velocities. max_px is far below what 16 bits hold. */
static evs_flow_velocity_t raw_of(offset_t d) { return (evs_flow_velocity_t){(int16_t)d.x, (int16_t)d.y}; }

static offset_t offset_from_velocity(const evs_warp_config_t *cfg, evs_flow_velocity_t v, uint32_t span_us)
{
    const int32_t limit = cfg->max_px * PX_Q6;
    const offset_t d = {evs_clamp(evs_flow_displacement_q8(v.x_px_s_q3, (int32_t)span_us) / 4, -limit, limit),
                        evs_clamp(evs_flow_displacement_q8(v.y_px_s_q3, (int32_t)span_us) / 4, -limit, limit)};
    return d;
}

/* Mean of the tiles. */
static evs_flow_velocity_t mean_velocity(const evs_flow_grid_t *grid)
{
    int32_t x = 0;
    int32_t y = 0;
    const int32_t n = (int32_t)grid->n_cols * grid->n_rows;
    for (int32_t i = 0; i < n; i++) {
        x += grid->tiles[i].x_px_s_q3;
        y += grid->tiles[i].y_px_s_q3;
    }
    return (evs_flow_velocity_t){(int16_t)(x / n), (int16_t)(y / n)};
}

/* Where the caller would begin at a point, or zero. */
static offset_t initial_offset(const evs_warp_config_t *cfg, const evs_flow_grid_t *initial, evs_point_t at,
                               uint32_t span_us)
{
    return (initial == NULL) ? ZERO : offset_from_velocity(cfg, evs_flow_grid_at(initial, at), span_us);
}

static evs_flow_velocity_t velocity_from_offset(offset_t d, uint32_t span_us)
{
    return evs_flow_velocity_from(4 * d.x, 4 * d.y, span_us);
}

/* A grid over the image, not larger than that of the settings: cannot be refused. */
static void set_up(evs_flow_grid_t *grid, const evs_warp_config_t *cfg, uint32_t n_cols, uint32_t n_rows)
{
    const evs_status_t status =
        evs_flow_grid_init(grid, cfg->width_px, cfg->height_px, (uint16_t)n_cols, (uint16_t)n_rows);
    EVS_ASSERT(status == EVS_OK);
    (void)status;
}

static uint32_t ceil_shift(uint32_t n, uint32_t shift) { return (n + (UINT32_C(1) << shift) - 1u) >> shift; }

static int32_t max_abs(int32_t a, int32_t b)
{
    const int32_t x = (a < 0) ? -a : a;
    const int32_t y = (b < 0) ? -b : b;
    return (x > y) ? x : y;
}

/* How far a search from one of two places can get: the moves, and half a step by the parabola. */
static offset_t reach_around(const evs_warp_config_t *cfg, offset_t a, offset_t b)
{
    const int32_t search_q6 = (int32_t)(MAX_MOVES + 1u) * LAST_STEP_Q6 + LAST_STEP_Q6 / 2;
    const int32_t limit = cfg->max_px * PX_Q6;
    const offset_t reach = {evs_clamp(max_abs(a.x, b.x) + search_q6, 0, limit),
                            evs_clamp(max_abs(a.y, b.y) + search_q6, 0, limit)};
    return reach;
}

/* To look at no more than so many of n events. */
static uint32_t stride_for(uint32_t n, uint32_t most) { return (n + most - 1u) / most; }

/* What the last level adds up over its tiles. */
typedef struct {
    uint64_t unmoved;
    uint64_t as_one; /* all tiles moved by the same displacement */
    uint64_t tiled;
    uint64_t noise; /* what tiled may exceed as_one by without a reason */
} sums_t;

/* The displacement of one tile of the level at work. */
static offset_t search_tile(evs_warp_t *warp, uint32_t col, uint32_t row)
{
    const evs_flow_grid_t *const level = &warp->level;
    const evs_flow_grid_t *const tiles = &warp->tiles;
    const evs_point_t centre = evs_flow_grid_centre(level, (uint16_t)col, (uint16_t)row);
    search_t s = {.block = {col * tiles->n_cols / level->n_cols, (col + 1u) * tiles->n_cols / level->n_cols,
                            row * tiles->n_rows / level->n_rows, (row + 1u) * tiles->n_rows / level->n_rows},
                  .best = offset_of(evs_flow_grid_at(&warp->parent, centre))};
    const uint32_t n = count_events(warp, &s.block);
    if (n < warp->cfg.n_min) { return s.best; }
    s.stride = stride_for(n, COARSE_EVENTS);
    s.view = finest_view(warp, &s.block, reach_around(&warp->cfg, s.best, s.best), COARSE_SHIFT);
    search_begin(warp, &s, s.best, true);
    search_nearby(warp, &s);
    return s.best;
}

/* The same on the last level, which nothing corrects any more: zero and the initial grid are tried, too. */
static offset_t search_last_tile(evs_warp_t *warp, uint32_t col, uint32_t row, offset_t all, offset_t initial,
                                 sums_t *sums)
{
    const evs_point_t centre = evs_flow_grid_centre(&warp->level, (uint16_t)col, (uint16_t)row);
    search_t s = {.block = {col, col + 1u, row, row + 1u},
                  .stride = 1u,
                  .best = offset_of(evs_flow_grid_at(&warp->parent, centre))};
    if (count_events(warp, &s.block) < warp->cfg.n_min) { return s.best; }
    const offset_t others = {max_abs(all.x, initial.x), max_abs(all.y, initial.y)};
    s.view = finest_view(warp, &s.block, reach_around(&warp->cfg, s.best, others), 0u);
    search_begin(warp, &s, s.best, true);
    const int64_t unmoved = score_at(warp, &s, ZERO);
    const int64_t as_one = score_at(warp, &s, all);
    search_take(&s, ZERO, unmoved);
    search_take(&s, all, as_one);
    if ((initial.x != 0) || (initial.y != 0)) { search_try(warp, &s, initial); }
    search_nearby(warp, &s);
    sums->unmoved += (uint64_t)(unmoved + cost_of(&s, ZERO));
    sums->as_one += (uint64_t)(as_one + cost_of(&s, all));
    sums->tiled += (uint64_t)(s.score + cost_of(&s, s.best));
    sums->noise += noise_gain(warp, &s, all);
    return s.best;
}

/* All levels below the first, whose displacement is given. Leaves the last in warp->level. */
static sums_t search_levels(evs_warp_t *warp, offset_t all, const evs_flow_grid_t *initial, uint32_t span_us)
{
    const evs_warp_config_t *const cfg = &warp->cfg;
    sums_t sums = {0u, 0u, 0u, 0u};
    set_up(&warp->level, cfg, 1u, 1u);
    evs_flow_grid_set_all(&warp->level, raw_of(all));
    uint32_t halvings = 0u;
    while ((ceil_shift(cfg->n_cols, halvings) > 1u) || (ceil_shift(cfg->n_rows, halvings) > 1u)) { halvings++; }
    while (halvings > 0u) {
        halvings--;
        warp->parent = warp->level;
        set_up(&warp->level, cfg, ceil_shift(cfg->n_cols, halvings), ceil_shift(cfg->n_rows, halvings));
        for (uint16_t row = 0u; row < warp->level.n_rows; row++) {
            for (uint16_t col = 0u; col < warp->level.n_cols; col++) {
                offset_t d;
                if (halvings > 0u) {
                    d = search_tile(warp, col, row);
                } else {
                    const evs_point_t centre = evs_flow_grid_centre(&warp->level, col, row);
                    d = search_last_tile(warp, col, row, all, initial_offset(cfg, initial, centre, span_us), &sums);
                }
                evs_flow_grid_set_tile(&warp->level, col, row, raw_of(d));
            }
        }
    }
    return sums;
}

/* --- the estimate ---------------------------------------------------------------------------------------------- */

/* Without an estimate: what was given, or zero. */
static void fall_back(const evs_warp_t *warp, const evs_flow_grid_t *initial, evs_flow_grid_t *out,
                      evs_warp_result_t *result)
{
    if (initial == NULL) {
        set_up(out, &warp->cfg, warp->cfg.n_cols, warp->cfg.n_rows);
    } else if (out != initial) {
        *out = *initial;
    }
    result->global = mean_velocity(out);
}

/* Whether contrast rises by more than noise may make it rise. */
static bool is_believed(const evs_warp_config_t *cfg, uint64_t after, uint64_t before, uint64_t noise)
{
    return (after > before) && (after - before >= noise * cfg->noise_percent / 100u);
}

static uint32_t ratio_q16(uint64_t after, uint64_t before)
{
    /* 2^15 is more than any gain; before is 0 when no event fell into a view */
    const unsigned bits = 64u - evs_clz64(after | before);
    const unsigned down = (bits > 47u) ? bits - 47u : 0u;
    const uint64_t divisor = before >> down;
    if (divisor == 0u) { return 0u; }
    const uint64_t ratio = ((after >> down) << 16) / divisor;
    return (ratio > UINT32_MAX) ? UINT32_MAX : (uint32_t)ratio;
}

void evs_warp_estimate(evs_warp_t *warp, const evs_event_t *ev, const evs_point_t *points, size_t n,
                       const evs_flow_grid_t *initial, evs_flow_grid_t *out, evs_warp_result_t *result)
{
    EVS_ASSERT((warp != NULL) && (out != NULL) && (result != NULL));
    EVS_ASSERT(((ev != NULL) && (points != NULL)) || (n == 0u));
    const evs_warp_config_t *const cfg = &warp->cfg;
    EVS_ASSERT((initial == NULL) || ((initial->width_px == cfg->width_px) && (initial->height_px == cfg->height_px)));

    *result = (evs_warp_result_t){.flags = 0u};
    if (cfg->kind == EVS_WARP_PREDICTED) {
        fall_back(warp, initial, out, result);
        return;
    }
    const bool tiled = cfg->kind == EVS_WARP_TILED;
    const int32_t span_us = (n > 0u) ? evs_time_diff_us(ev[n - 1u].t_us, ev[0].t_us) : 0;
    if (span_us > 0) {
        set_up(&warp->tiles, cfg, tiled ? cfg->n_cols : 1u, tiled ? cfg->n_rows : 1u);
        result->n_events = (uint32_t)take_events(warp, ev, points, n, (uint32_t)span_us);
    }
    if (result->n_events < cfg->n_min) {
        result->flags = EVS_WARP_FEW;
        fall_back(warp, initial, out, result);
        return;
    }

    warp->n_evaluations = 0u;
    const offset_t begin =
        (initial == NULL) ? ZERO : offset_from_velocity(cfg, mean_velocity(initial), (uint32_t)span_us);
    search_t s;
    search_all(warp, &s, begin, tiled ? stride_for(result->n_events, FIRST_EVENTS) : 1u);
    const uint64_t unmoved = contrast(warp, &s, ZERO);
    const bool believe_one = is_believed(cfg, (uint64_t)s.score, unmoved, noise_gain(warp, &s, ZERO));
    const offset_t all = believe_one ? s.best : begin;
    bool believe_tiles = false;
    result->contrast_before = unmoved;
    result->contrast_after = (uint64_t)s.score;
    if (tiled) {
        const sums_t sums = search_levels(warp, all, initial, (uint32_t)span_us);
        believe_tiles = is_believed(cfg, sums.tiled, sums.as_one, sums.noise / 16u * TILES_NOISE_16THS) &&
                        (sums.tiled > sums.unmoved);
        result->contrast_before = sums.unmoved;
        result->contrast_after = believe_tiles ? sums.tiled : sums.as_one;
        if (!believe_tiles) { result->flags |= EVS_WARP_ONE; }
    }
    result->n_evaluations = warp->n_evaluations;
    if (!believe_tiles && (!believe_one || (result->contrast_after < result->contrast_before))) {
        result->flags |= EVS_WARP_FLAT;
        result->contrast_after = result->contrast_before;
        result->gain_q16 = UINT32_C(1) << 16;
        fall_back(warp, initial, out, result);
        return;
    }
    result->gain_q16 = ratio_q16(result->contrast_after, result->contrast_before);
    result->global = velocity_from_offset(all, (uint32_t)span_us);
    set_up(out, cfg, cfg->n_cols, cfg->n_rows);
    evs_flow_grid_set_all(out, result->global);
    if (believe_tiles) {
        for (uint32_t i = 0u; i < (uint32_t)cfg->n_cols * cfg->n_rows; i++) {
            out->tiles[i] = velocity_from_offset(offset_of(warp->level.tiles[i]), (uint32_t)span_us);
        }
    }
}

/* --- moving events --------------------------------------------------------------------------------------------- */

static bool on_range(int32_t q4) { return (q4 >= -EVS_POINT_MAX_Q4) && (q4 <= EVS_POINT_MAX_Q4); }

/* Times of a window, for which time * EVS_FLOW_PER_US fits 32 bits: the same product as any other's, but cheaper. */
#define NEAR_US (INT32_MAX / EVS_FLOW_PER_US)

static evs_point_t move(evs_point_t p, evs_flow_velocity_t v, int32_t dt_us)
{
    int32_t x_q4;
    int32_t y_q4;
    if ((dt_us >= -NEAR_US) && (dt_us <= NEAR_US)) {
        const int32_t factor = -dt_us * EVS_FLOW_PER_US;
        x_q4 = p.x_q4 + (int32_t)evs_shr_r64((int64_t)v.x_px_s_q3 * factor, 35u);
        y_q4 = p.y_q4 + (int32_t)evs_shr_r64((int64_t)v.y_px_s_q3 * factor, 35u);
    } else { /* the least time has no negative */
        const int32_t back_us = (dt_us == INT32_MIN) ? INT32_MAX : -dt_us;
        x_q4 = p.x_q4 + evs_flow_displacement_q4(v.x_px_s_q3, back_us);
        y_q4 = p.y_q4 + evs_flow_displacement_q4(v.y_px_s_q3, back_us);
    }
    if (!on_range(x_q4) || !on_range(y_q4)) { return evs_point_outside(); }
    p.x_q4 = (int16_t)x_q4;
    p.y_q4 = (int16_t)y_q4;
    return p;
}

void evs_warp_map(const evs_flow_grid_t *grid, const evs_event_t *ev, const evs_point_t *in, size_t n,
                  uint32_t t_ref_us, evs_point_t *out)
{
    EVS_ASSERT((grid != NULL) && (((ev != NULL) && (in != NULL) && (out != NULL)) || (n == 0u)));
    for (size_t i = 0u; i < n; i++) {
        const evs_point_t p = in[i];
        if (evs_point_is_outside(p)) {
            out[i] = p;
            continue;
        }
        out[i] = move(p, evs_flow_grid_at(grid, p), evs_time_diff_us(ev[i].t_us, t_ref_us));
    }
}
