/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/warp.h
 * @brief Contrast maximization: finds the image velocity that makes the events of a window sharp, and moves them by it.
 *
 * Model    An edge that moves leaves a trail of events; moved back by x' = x - (t - t_ref) v(x) with the right v, they
 *          meet on a sharp edge [1]. The contrast of the image of moved events (bilinear votes, smoothed by a 3 x 3
 *          binomial) measures how well: the sum of its squares, or of its squared gradient (Sobel, border left out).
 *          GLOBAL     one velocity for the image: pattern search with halving steps down to 1 px over the window, at
 *                     first on a coarser image, then the top of a parabola.
 *          TILED      a grid of them, coarse to fine [2]: 1, 2 x 2, 4 x 3 and 8 x 6 tiles for the usual grid. A tile
 *                     begins at the bilinear value of the coarser level and searches nearby, in steps of 1 px and by a
 *                     parabola, held by a loss of 0.2 % of contrast per px^2. Each tile moves its events as a whole:
 *                     such a warp cannot collapse them into a point, as free-form ones can.
 *          PREDICTED  estimates nothing: the grid given, such as that of the flow of the window before, is the answer.
 *          Shifting all events together leaves the contrast as it is, so the estimate has no reference time.
 *          Contrast rises a little for noise as well, by chance. An estimate is believed only if it rises by more than
 *          that; else the answer is the initial grid or zero, and the result says so. Tiles are believed only if they
 *          are sharper by more than that than one velocity for all.
 * Memory   one evs_warp_t and EVS_WARP_BYTES() of caller memory: 6 bytes per event of the budget and an image of 16-bit
 *          cells at half resolution.
 * Cost     the number of evaluations is bounded; docs/performance.md has instructions per estimate.
 *          evs_warp_map() about 155 instructions per event.
 * Numeric  integers only, bit-exact on every target. Displacements over the window in 1/64 px, within max_px.
 * Time     wraps; the events of a window must span less than 2^31 us.
 * Threads  no shared state; one context must not be entered from two threads or ISRs at once.
 *
 * [1] G. Gallego, H. Rebecq, D. Scaramuzza, "A Unifying Contrast Maximization Framework for Event Cameras, with
 *     Applications to Motion, Depth, and Optical Flow Estimation", CVPR 2018. doi:10.1109/CVPR.2018.00407
 * [2] S. Shiba, Y. Aoki, G. Gallego, "Secrets of Event-Based Optical Flow", ECCV 2022.
 *     doi:10.1007/978-3-031-19797-0_36
 */
#ifndef EVS_WARP_H
#define EVS_WARP_H

#include "evs/flow_grid.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_WARP_MAX_PX        32u    /**< Largest setting of max_px. */
#define EVS_WARP_BUDGET_MAX    65535u /**< Largest setting of n_budget. */
#define EVS_WARP_BUDGET_GLOBAL 6000u  /**< Defaults of n_budget. */
#define EVS_WARP_BUDGET_TILED  16000u
#define EVS_WARP_SHIFT_MAX     4u

#define EVS_WARP_NOISE_MAX_PERCENT 1000u

typedef enum { EVS_WARP_PREDICTED = 0, EVS_WARP_GLOBAL = 1, EVS_WARP_TILED = 2 } evs_warp_kind_t;

/** What is made large. */
typedef enum {
    EVS_WARP_MEAN_SQUARE =
        0,                /**< Sum of squares: the variance, but for a mean that only events at the border change. */
    EVS_WARP_GRADIENT = 1 /**< Sum of the squared gradient. */
} evs_warp_cost_t;

typedef struct {          /** Settings; copied by evs_warp_init(). */
    evs_warp_kind_t kind; /**< PREDICTED needs no memory. */
    evs_warp_cost_t cost; /**< Default MEAN_SQUARE. */
    uint16_t width_px;    /**< Image of the points, [16, EVS_SENSOR_MAX_PX]. */
    uint16_t height_px;
    uint16_t n_cols; /**< Tiles of the grids, as for evs_flow_grid_init(). Default 8 x 6. */
    uint16_t n_rows;
    uint32_t n_budget;      /**< Events that are looked at, [1, 65535]: of more, every k-th. */
    uint16_t n_min;         /**< Events that a tile (GLOBAL: the image) must have to be estimated. [2, 65535].
                                    Default 40 (GLOBAL: 500). */
    uint16_t max_px;        /**< Displacement over the window that is searched, [2, 32]. Default 32. */
    uint16_t shift;         /**< The image of all events has 1 / 2^shift of the resolution. [1, 4], default 1. */
    uint16_t noise_percent; /**< How far contrast must rise to be believed, in per cent of the most that it does for
                                 noise; 0: at all. [0, 1000], default 100. */
} evs_warp_config_t;

/** @name What an estimate lacks. */
/** @{ */
#define EVS_WARP_FEW  0x1u /**< Too few events, or all at one time. No estimate. */
#define EVS_WARP_FLAT 0x2u /**< Contrast does not rise by more than noise may make it. No estimate. */
#define EVS_WARP_ONE  0x4u /**< TILED: tiles of their own velocity are not clearly sharper than one velocity for all. */
/** @} */

typedef struct {
    uint32_t flags;           /**< EVS_WARP_FEW or _FLAT: no estimate. EVS_WARP_ONE: the same velocity everywhere. */
    uint32_t n_events;        /**< Looked at. */
    uint32_t n_evaluations;   /**< Images of warped events formed. */
    uint64_t contrast_before; /**< Of the events unmoved, in units of its own. TILED: sum over the tiles of the grid. */
    uint64_t contrast_after;  /**< Of the events moved by the estimate; never below contrast_before. */
    uint32_t gain_q16;        /**< After by before, 1.0 = 65536; 0 with EVS_WARP_FEW. */
    evs_flow_velocity_t
        global; /**< The one velocity that suits all events best; without an estimate the mean of @p out. */
} evs_warp_result_t;

/* An event as the search sees it. */
typedef struct {
    int16_t x_q4;
    int16_t y_q4;
    int16_t dt_q12; /* time from the middle of the window, by its length: within +-1/2 */
} evs_warp_event_t;

EVS_STATIC_ASSERT(sizeof(evs_warp_event_t) == 6u, "an event of the search is 6 bytes");

/* What decides how many bytes are needed: a search moves events by half its displacement to either side, and one cell more receives votes. */
#define EVS_WARP_MARGIN_PX(max_px)         ((max_px) / 2u + 1u)
#define EVS_WARP_SIDE(n_px, max_px, shift) ((((n_px) + 2u * EVS_WARP_MARGIN_PX(max_px)) >> (shift)) + 2u)
#define EVS_WARP_CELLS(w_px, h_px, max_px, shift)                                                                      \
    ((size_t)EVS_WARP_SIDE(w_px, max_px, shift) * (EVS_WARP_SIDE(h_px, max_px, shift) + 2u))

/** Bytes of memory for GLOBAL and TILED. A constant expression. */
#define EVS_WARP_BYTES(width_px, height_px, n_budget, max_px, shift)                                                   \
    ((size_t)(n_budget) * sizeof(evs_warp_event_t) +                                                                   \
     EVS_WARP_CELLS(width_px, height_px, max_px, shift) * sizeof(uint16_t))

typedef struct { /** Context. A complete type only so that you can place it: every member is private. */
    evs_warp_config_t cfg;
    evs_warp_event_t *events; /* sorted by tile, n_budget places */
    uint16_t *cells;          /* the image, and behind it the row above while smoothing */
    size_t n_cells;
    evs_flow_grid_t tiles; /* by which the events are sorted: the finest, or one for GLOBAL */
    evs_flow_grid_t level; /* displacements Q6 of the level at work and of the one before */
    evs_flow_grid_t parent;
    uint16_t first[EVS_FLOW_GRID_TILES_MAX + 1u]; /* of the events of a tile */
    uint32_t n_evaluations;
} evs_warp_t;

/** Defaults for a kind of estimate and an image size. */
evs_warp_config_t evs_warp_config_default(evs_warp_kind_t kind, uint16_t width_px, uint16_t height_px);

/** Bytes of memory that settings need: EVS_WARP_BYTES(), or 0 for PREDICTED. */
size_t evs_warp_bytes(const evs_warp_config_t *cfg);

/**
 * Bind a context to caller memory.
 * @param[out] warp    Untouched on error.
 * @param      memory  Kept by reference, aligned to 2 bytes; contents on entry do not matter. PREDICTED: may be NULL.
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (a setting is out of range) or EVS_ERR_SIZE (too little memory, or misaligned).
 */
EVS_NODISCARD evs_status_t evs_warp_init(evs_warp_t *warp, const evs_warp_config_t *cfg, void *memory, size_t n_bytes);

/**
 * Estimate the image velocities of a window.
 * @param      ev       n events, t_us ascending modulo 2^32. Only their times are read.
 * @param      points   Where each lies in the image. Those off the image do not take part.
 * @param      initial  Where the search begins, or NULL for zero; a grid over an image of the same size.
 * @param[out] out      Set up and filled; may be @p initial. Without an estimate a copy of @p initial, or zero.
 */
void evs_warp_estimate(evs_warp_t *warp, const evs_event_t *ev, const evs_point_t *points, size_t n,
                       const evs_flow_grid_t *initial, evs_flow_grid_t *out, evs_warp_result_t *result);

/**
 * Move n points to where they were, or will be, at @p t_ref_us: x' = x - (t - t_ref) v(x).
 * EVS_POINT_OUTSIDE remains, and is the result beyond 2047 px.
 * @param[out] out  May be @p in itself.
 */
void evs_warp_map(const evs_flow_grid_t *grid, const evs_event_t *ev, const evs_point_t *in, size_t n,
                  uint32_t t_ref_us, evs_point_t *out);

#ifdef __cplusplus
}
#endif
#endif
