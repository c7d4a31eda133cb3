/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/window.h
 * @brief Cuts a stream of events into windows: by area count, by event count or by duration.
 *
 * Model    AREA      closes with the event that makes some tile's count exceed the threshold: busy texture anywhere in
 *                    the image closes the window, an evenly quiet scene does not (the paper's windows [1]). Events with
 *                    no tile (off the sensor) belong to the window but are not counted.
 *          COUNT     closes with the threshold-th event.
 *          DURATION  windows of duration_us on a fixed grid that starts at the first event; grid cells without an event
 *                    give no window. The event at or after a cell's end opens the next window.
 *          Guards for AREA and COUNT: a window that is due stays open until it spans min_duration_us, and an event
 *          max_duration_us or more after a window's first event opens the next one.
 * Memory   one evs_window_t and, for AREA, one uint16_t per tile of caller memory.
 * Cost     8 instructions per event by AREA; one memset of the tile counts per window.
 * Numeric  integers only, bit-exact on every target; independent of how the stream is split into batches.
 * Time     wraps; a window must span less than 2^31 us (35 min), which max_duration_us ensures.
 * Threads  no shared state; one context must not be entered from two threads or ISRs at once.
 *
 * [1] J. P. Rodriguez-Gomez, J. R. Martinez-de Dios, A. Ollero, G. Gallego, "On the Benefits of Visual Stabilization
 *     for Frame- and Event-based Perception", IEEE RA-L 2024. doi:10.1109/LRA.2024.3450290
 */
#ifndef EVS_WINDOW_H
#define EVS_WINDOW_H

#include "evs/tiles.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_WINDOW_DURATION_MAX_US UINT32_C(1000000000) /**< 1000 s. */
#define EVS_WINDOW_COUNT_MAX       UINT32_C(1000000000)
#define EVS_WINDOW_AREA_MAX        UINT32_C(65534)

typedef enum { EVS_WINDOW_AREA = 0, EVS_WINDOW_COUNT = 1, EVS_WINDOW_DURATION = 2 } evs_window_kind_t;

/** Why a window closed. */
typedef enum {
    EVS_WINDOW_OPEN = 0, /**< It did not. */
    EVS_WINDOW_BY_AREA = 1,
    EVS_WINDOW_BY_COUNT = 2,
    EVS_WINDOW_BY_DURATION = 3,
    EVS_WINDOW_BY_MAX_DURATION = 4,
    EVS_WINDOW_BY_FLUSH = 5,  /**< The caller ended the stream. */
    EVS_WINDOW_BY_RESTART = 6 /**< The clock of the events restarted. */
} evs_window_reason_t;

typedef struct {              /** Settings; copied by evs_window_init(). */
    evs_window_kind_t kind;   /**< Default AREA. */
    uint32_t threshold;       /**< AREA: events in a tile, [1, 65534], default 200. COUNT: events, [1, 10^9]. */
    uint32_t duration_us;     /**< DURATION: [1, 10^9]. Default 10000. */
    uint32_t min_duration_us; /**< AREA, COUNT: [0, max_duration_us]. Default 0. */
    uint32_t max_duration_us; /**< AREA, COUNT: [1, 10^9]. Default 10^9. */
} evs_window_config_t;

/** A window that has closed. */
typedef struct {
    uint32_t index;    /**< Counts from 0. */
    uint32_t n_events; /**< At least 1. */
    uint32_t t_first_us;
    uint32_t t_last_us;
    evs_window_reason_t reason;
} evs_window_end_t;

typedef struct { /** Context. A complete type only so that you can place it: every member is private. */
    evs_window_config_t cfg;
    uint16_t *tile_counts;
    size_t n_tiles;
    uint32_t index;
    uint32_t n_events; /* in the open window */
    uint32_t t_first_us;
    uint32_t t_last_us;
    uint32_t cell_us; /* DURATION: start of the current grid cell */
    bool cell_set;
    bool due; /* AREA, COUNT: only min_duration_us keeps the window open */
} evs_window_t;

evs_window_config_t evs_window_config_default(void);

/**
 * Bind a context to caller memory and open the first window.
 * @param[out] win          Untouched on error.
 * @param      tile_counts  AREA: one count per tile, kept by reference; contents on entry do not matter. Else NULL.
 * @param      n_tiles      Number of tiles, the n_tiles of the evs_tile_grid_t that gives the indices; 0 unless AREA.
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (a setting is out of range) or EVS_ERR_SIZE (AREA without a tile).
 */
EVS_NODISCARD evs_status_t evs_window_init(evs_window_t *win, const evs_window_config_t *cfg, uint16_t *tile_counts,
                                           size_t n_tiles);

/**
 * Take events into the open window until it closes or the batch ends.
 * @param      ev     n events, t_us ascending modulo 2^32.
 * @param      tiles  Tile of each event or EVS_TILE_NONE; not read unless AREA (NULL is fine then).
 * @param[out] end    Written only when the window closes; reason EVS_WINDOW_OPEN means that it did not.
 * @return how many events, from the first on, belong to the window. When it closed, push the rest again: they belong to
 *         the next. 0 is possible: the first event is already too late for the open window.
 */
size_t evs_window_push(evs_window_t *win, const evs_event_t *ev, const uint16_t *tiles, size_t n,
                       evs_window_end_t *end);

/**
 * Close the open window if an event at @p t_us would be too late for it. For a loop that hears of time passing without
 * events, or wants to know where the next event belongs.
 * @return true when it closed; only then is @p end written.
 */
bool evs_window_expire(evs_window_t *win, uint32_t t_us, evs_window_end_t *end);

/**
 * Close the open window, for the end of a stream or the restart of its clock; the duration grid starts anew.
 * @return true when the window held an event; only then is @p end written.
 */
bool evs_window_close(evs_window_t *win, evs_window_reason_t reason, evs_window_end_t *end);

/** Whether no event has been taken into the open window yet. */
static inline bool evs_window_is_empty(const evs_window_t *win) { return win->n_events == 0u; }

/** Index of the open window: how many have closed before it. */
static inline uint32_t evs_window_index(const evs_window_t *win) { return win->index; }

#ifdef __cplusplus
}
#endif
#endif
