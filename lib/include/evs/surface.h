/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/surface.h
 * @brief Time surface: how long ago the last event was, in every pixel of the stabilized view.
 *
 * Model    T(x, t) = exp(-(t - t_last(x)) / tau) [1], and after a window of duration D_j tau follows it as in the paper [2]:
 *          tau_j = (1 - alpha) D_j + alpha tau_(j-1), limited to the range of the settings. An event belongs to the
 *          pixel nearest to its stabilized point.
 *          MERGED  both polarities alike: 255 T.
 *          SIGNED  128 + 127 T where the last event was brighter, 128 - 127 T where it was darker.
 * Memory   one evs_surface_t and two bytes per pixel of the caller: 15 bits of time in ticks of 64 us, and the polarity.
 * Cost     see docs/performance.md. Besides the events, a fraction of the pixels per tick of time that passes: a pixel that
 *          has been dark for long is moved up before its 15 bits come round and make it look young. A gap of more than
 *          0.13 s takes one pass over the pixels.
 * Numeric  integers only, bit-exact on every target. Grey levels within 1 of the equation for times in whole ticks.
 * Time     wraps; gaps of any length up to 2^31 us (35 min) are correct. Events that run back to an earlier tick are
 *          counted and ignored. After a restart of the clock call evs_surface_clear().
 * Threads  no shared state; one context must not be entered from two threads or ISRs at once.
 *
 * [1] X. Lagorce, G. Orchard, F. Galluppi, B. E. Shi, R. B. Benosman, "HOTS: A Hierarchy of Event-Based Time-Surfaces for
 *     Pattern Recognition", IEEE TPAMI 2017. doi:10.1109/TPAMI.2016.2574707
 * [2] J. P. Rodriguez-Gomez, J. R. Martinez-de Dios, A. Ollero, G. Gallego, "On the Benefits of Visual Stabilization
 *     for Frame- and Event-based Perception", IEEE RA-L 2024. doi:10.1109/LRA.2024.3450290
 */
#ifndef EVS_SURFACE_H
#define EVS_SURFACE_H

#include "evs/image.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum { EVS_SURFACE_MERGED = 0, EVS_SURFACE_SIGNED = 1 } evs_surface_polarity_t;

#define EVS_SURFACE_TICK_US    64u
#define EVS_SURFACE_TAU_MIN_US UINT32_C(100)
#define EVS_SURFACE_TAU_MAX_US UINT32_C(250000) /**< So that pixels that are moved up are dark. */

typedef struct {                     /** Settings; copied by evs_surface_init(). */
    uint16_t width_px;               /**< [1, EVS_SENSOR_MAX_PX]. */
    uint16_t height_px;              /**< [1, EVS_SENSOR_MAX_PX]. */
    evs_surface_polarity_t polarity; /**< Default MERGED. */
    uint16_t alpha_q15;    /**< Share of the old tau: [0, 32768]; 32768 keeps tau as it is. Default 0.3, 9830. */
    uint32_t tau_min_us;   /**< [EVS_SURFACE_TAU_MIN_US, tau_max_us]. Default 1000. */
    uint32_t tau_max_us;   /**< [tau_min_us, EVS_SURFACE_TAU_MAX_US]. Default EVS_SURFACE_TAU_MAX_US. */
    uint32_t tau_start_us; /**< Before the first window: [tau_min_us, tau_max_us]. Default 20000. */
} evs_surface_config_t;

/** Bytes of memory, a constant expression. */
#define EVS_SURFACE_BYTES(width_px, height_px) (EVS_IMAGE_BYTES(width_px, height_px) * 2u)

typedef struct { /** Context. A complete type only so that you can place it: every member is private. */
    evs_surface_config_t cfg;
    uint16_t *stamps;      /* ticks times 2, plus 1 for brighter */
    uint32_t tick_us;      /* start of the newest tick */
    uint32_t sweep_ticks;  /* since the sweep over the pixels began */
    uint32_t n_swept_rows; /* by this sweep */
    uint32_t tau_us;
    uint32_t n_outside;
    uint32_t n_time_back;
    bool started; /* there was an event: tick_us and the stamps are valid */
} evs_surface_t;

evs_surface_config_t evs_surface_config_default(uint16_t width_px, uint16_t height_px);

/**
 * Bind a context to caller memory; it is clear then.
 * @param[out] surface  Untouched on error.
 * @param      memory   Kept by reference, aligned for uint16_t; contents on entry do not matter.
 * @param      n_bytes  At least EVS_SURFACE_BYTES(width_px, height_px).
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (a setting is out of range) or EVS_ERR_SIZE (too little memory, or misaligned).
 */
EVS_NODISCARD evs_status_t evs_surface_init(evs_surface_t *surface, const evs_surface_config_t *cfg, void *memory,
                                            size_t n_bytes);

/** Forget all events and the time, as when a saccade changes the view or the clock restarts; tau stays. */
void evs_surface_clear(evs_surface_t *surface);

/**
 * Take events in.
 * @param ev      n events, t_us ascending modulo 2^32: time and polarity.
 * @param points  Where each one lies in the stabilized view. Those off it are counted; only their time is taken.
 */
void evs_surface_add(evs_surface_t *surface, const evs_event_t *ev, const evs_point_t *points, size_t n);

/** A window has ended that took duration_us: adapt tau. Before the image of that window is rendered. */
void evs_surface_end_window(evs_surface_t *surface, uint32_t duration_us);

/**
 * The image at a time; it changes nothing.
 * @param      t_us  At or after the last event, less than 2^31 us; an earlier time stands for the last event's.
 * @param[out] px    width_px * height_px bytes.
 */
void evs_surface_render(const evs_surface_t *surface, uint32_t t_us, uint8_t *px);

static inline uint32_t evs_surface_tau_us(const evs_surface_t *surface) { return surface->tau_us; }

/** Events off the image or without a position; and events that ran back in time. Since the start. */
static inline uint32_t evs_surface_n_outside(const evs_surface_t *surface) { return surface->n_outside; }
static inline uint32_t evs_surface_n_time_back(const evs_surface_t *surface) { return surface->n_time_back; }

#ifdef __cplusplus
}
#endif
#endif
