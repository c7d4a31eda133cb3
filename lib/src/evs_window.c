/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/window.h"

#include <string.h>

evs_window_config_t evs_window_config_default(void)
{
    const evs_window_config_t cfg = {.kind = EVS_WINDOW_AREA,
                                     .threshold = 200u,
                                     .duration_us = 10000u,
                                     .min_duration_us = 0u,
                                     .max_duration_us = EVS_WINDOW_DURATION_MAX_US};
    return cfg;
}

static bool config_ok(const evs_window_config_t *cfg)
{
    if (cfg->kind == EVS_WINDOW_DURATION) {
        return (cfg->duration_us >= 1u) && (cfg->duration_us <= EVS_WINDOW_DURATION_MAX_US);
    }
    const uint32_t threshold_max = (cfg->kind == EVS_WINDOW_AREA) ? EVS_WINDOW_AREA_MAX : EVS_WINDOW_COUNT_MAX;
    return ((cfg->kind == EVS_WINDOW_AREA) || (cfg->kind == EVS_WINDOW_COUNT)) && (cfg->threshold >= 1u) &&
           (cfg->threshold <= threshold_max) && (cfg->max_duration_us >= 1u) &&
           (cfg->max_duration_us <= EVS_WINDOW_DURATION_MAX_US) && (cfg->min_duration_us <= cfg->max_duration_us);
}

evs_status_t evs_window_init(evs_window_t *win, const evs_window_config_t *cfg, uint16_t *tile_counts, size_t n_tiles)
{
    if ((win == NULL) || (cfg == NULL)) { return EVS_ERR_NULL; }
    if (!config_ok(cfg)) { return EVS_ERR_ARG; }
    const bool area = cfg->kind == EVS_WINDOW_AREA;
    if (area && (tile_counts == NULL)) { return EVS_ERR_NULL; }
    if (area && ((n_tiles < 1u) || (n_tiles > EVS_TILES_MAX))) { return EVS_ERR_SIZE; }

    *win = (evs_window_t){.cfg = *cfg, .tile_counts = area ? tile_counts : NULL, .n_tiles = area ? n_tiles : 0u};
    if (area) { memset(tile_counts, 0, n_tiles * sizeof tile_counts[0]); }
    return EVS_OK;
}

static void close_window(evs_window_t *win, evs_window_reason_t reason, evs_window_end_t *end)
{
    *end = (evs_window_end_t){.index = win->index,
                              .n_events = win->n_events,
                              .t_first_us = win->t_first_us,
                              .t_last_us = win->t_last_us,
                              .reason = reason};
    win->index++;
    win->n_events = 0u;
    win->due = false;
    if (win->n_tiles > 0u) { memset(win->tile_counts, 0, win->n_tiles * sizeof win->tile_counts[0]); }
}

bool evs_window_close(evs_window_t *win, evs_window_reason_t reason, evs_window_end_t *end)
{
    EVS_ASSERT((win != NULL) && (end != NULL));
    win->cell_set = false;
    if (win->n_events == 0u) { return false; }
    close_window(win, reason, end);
    return true;
}

/* Move the duration grid to the cell of time t, the first of a new window. */
static void enter_cell(evs_window_t *win, uint32_t t_us)
{
    if (!win->cell_set) {
        win->cell_us = t_us;
        win->cell_set = true;
    } else {
        win->cell_us += (t_us - win->cell_us) / win->cfg.duration_us * win->cfg.duration_us;
    }
}

/* How many of the events lie before limit_us after since_us. Times ascend, so that most batches need one look. */
static size_t count_before(const evs_event_t *ev, size_t n, uint32_t since_us, uint32_t limit_us)
{
    if (ev[n - 1u].t_us - since_us < limit_us) { return n; }
    size_t k = 0u;
    while (ev[k].t_us - since_us < limit_us) { k++; }
    return k;
}

#define N_SPARE 4u

#if UINTPTR_MAX > UINT32_MAX
/*
 * Count one event; true when its tile now exceeds the threshold. Processors of 64 bits foretell branches, and whether the
 * next event has a tile is beyond foretelling: one that has none adds nothing to tile `spare`, 0 .. N_SPARE - 1. These
 * take turns, because a count cannot be read before it has been written.
 */
static inline bool count_one(uint16_t *counts, uint32_t tile, uint32_t spare, uint32_t threshold)
{
    const uint32_t has_tile = 0u - (uint32_t)(tile < EVS_TILE_NONE); /* 0 or all ones */
    const uint32_t at = tile & (has_tile | spare);
    const uint32_t count = counts[at] - has_tile;
    counts[at] = (uint16_t)count;
    return count > threshold;
}
#else
/* Count one event; true when its tile now exceeds the threshold. On small cores a branch costs less than arithmetic. */
static inline bool count_one(uint16_t *counts, uint32_t tile, uint32_t spare, uint32_t threshold)
{
    (void)spare;
    if (tile == EVS_TILE_NONE) { return false; }
    const uint32_t count = counts[tile] + 1u;
    counts[tile] = (uint16_t)count;
    return count > threshold;
}
#endif

/* Count events into tiles up to and with the one that exceeds the threshold; returns how many were counted. */
static size_t count_tiles(evs_window_t *win, const uint16_t *tiles, size_t n)
{
    const uint32_t threshold = win->cfg.threshold;
    const uint32_t spare = (win->n_tiles >= N_SPARE) ? N_SPARE - 1u : 0u;
    uint16_t *const counts = win->tile_counts;
    const uint16_t *tile = tiles;
    const uint16_t *const end = tiles + n;
    const uint16_t *const end_of_fours = tiles + (n & ~(size_t)3u);
    win->due = true;
    while (tile != end_of_fours) {
        EVS_ASSERT(((tile[0] < win->n_tiles) || (tile[0] == EVS_TILE_NONE)) &&
                   ((tile[1] < win->n_tiles) || (tile[1] == EVS_TILE_NONE)) &&
                   ((tile[2] < win->n_tiles) || (tile[2] == EVS_TILE_NONE)) &&
                   ((tile[3] < win->n_tiles) || (tile[3] == EVS_TILE_NONE)));
        if (count_one(counts, *tile++, 0u, threshold) || count_one(counts, *tile++, 1u & spare, threshold) ||
            count_one(counts, *tile++, 2u & spare, threshold) || count_one(counts, *tile++, spare, threshold)) {
            return (size_t)(tile - tiles);
        }
    }
    while (tile != end) {
        EVS_ASSERT((*tile < win->n_tiles) || (*tile == EVS_TILE_NONE));
        if (count_one(counts, *tile++, 0u, threshold)) { return (size_t)(tile - tiles); }
    }
    win->due = false;
    return n;
}

/* Take the events until the window is due; after that until it is old enough. `fit` of them are not too late. */
static size_t take(evs_window_t *win, const evs_event_t *ev, const uint16_t *tiles, size_t fit, bool *closes)
{
    size_t taken = 0u;
    if (!win->due) {
        if (win->cfg.kind == EVS_WINDOW_AREA) {
            taken = count_tiles(win, tiles, fit);
        } else {
            const uint32_t missing = win->cfg.threshold - win->n_events;
            taken = (missing < fit) ? missing : fit;
            win->due = taken == missing;
        }
        if (!win->due) { return taken; }
        if (ev[taken - 1u].t_us - win->t_first_us >= win->cfg.min_duration_us) {
            *closes = true;
            return taken;
        }
    }
    while (taken < fit) {
        taken++;
        if (ev[taken - 1u].t_us - win->t_first_us >= win->cfg.min_duration_us) {
            *closes = true;
            break;
        }
    }
    return taken;
}

/* Where the open window must end: limit_us after since_us. */
static void time_limit(const evs_window_t *win, uint32_t *since_us, uint32_t *limit_us)
{
    const bool by_duration = win->cfg.kind == EVS_WINDOW_DURATION;
    *since_us = by_duration ? win->cell_us : win->t_first_us;
    *limit_us = by_duration ? win->cfg.duration_us : win->cfg.max_duration_us;
}

static evs_window_reason_t time_reason(const evs_window_t *win)
{
    return (win->cfg.kind == EVS_WINDOW_DURATION) ? EVS_WINDOW_BY_DURATION : EVS_WINDOW_BY_MAX_DURATION;
}

bool evs_window_expire(evs_window_t *win, uint32_t t_us, evs_window_end_t *end)
{
    EVS_ASSERT((win != NULL) && (end != NULL));
    uint32_t since_us;
    uint32_t limit_us;
    time_limit(win, &since_us, &limit_us);
    if ((win->n_events == 0u) || (t_us - since_us < limit_us)) { return false; }
    close_window(win, time_reason(win), end);
    return true;
}

size_t evs_window_push(evs_window_t *win, const evs_event_t *ev, const uint16_t *tiles, size_t n, evs_window_end_t *end)
{
    EVS_ASSERT((win != NULL) && (end != NULL) && ((ev != NULL) || (n == 0u)));
    end->reason = EVS_WINDOW_OPEN;
    if (n == 0u) { return 0u; }

    const bool by_duration = win->cfg.kind == EVS_WINDOW_DURATION;
    if (win->n_events == 0u) {
        win->t_first_us = ev[0].t_us;
        if (by_duration) { enter_cell(win, ev[0].t_us); }
    }
    uint32_t since_us;
    uint32_t limit_us;
    time_limit(win, &since_us, &limit_us);
    const size_t fit = count_before(ev, n, since_us, limit_us);
    bool closes = false;
    size_t taken = fit;
    if (!by_duration && (fit > 0u)) { taken = take(win, ev, tiles, fit, &closes); }
    if (taken > 0u) {
        win->n_events += (uint32_t)taken;
        win->t_last_us = ev[taken - 1u].t_us;
    }
    if (closes) {
        close_window(win, (win->cfg.kind == EVS_WINDOW_AREA) ? EVS_WINDOW_BY_AREA : EVS_WINDOW_BY_COUNT, end);
    } else if ((taken == fit) && (fit < n)) {
        close_window(win, time_reason(win), end);
    }
    return taken;
}
