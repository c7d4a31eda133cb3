/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/iwe.h
 * @brief Image of warped events: every stabilized event votes for its place, and the votes become a grey image.
 *
 * Model    I(x) = sum over the events of N(x; x_e, sigma^2), polarity ignored (the paper [1]; sigma = 1 px). Three votes:
 *          NEAREST   one count in the nearest pixel; with the 3 x 3 binomial smoothing (sigma 0.71 px) at rendering.
 *                    For velocity as good as the others, one byte per pixel, and by far the fastest.
 *          BILINEAR  shared among the four pixels around the point.
 *          GAUSSIAN  the equation itself at the point's 1/16 px, cut off at 7 x 7 px: the reference.
 *          Rendering: smoothing unless it is off, then 255 at mean + 3 sigma of the non-zero pixels, or at a fixed number
 *          of votes. Borders are replicated. The votes of a window need no buffer of its events.
 *          "Counts" are NEAREST with smoothing off.
 * Memory   one evs_iwe_t and EVS_IWE_BYTES() of the caller: 44.6 KB at 240 x 180 with NEAREST, 87.8 KB otherwise.
 * Cost     see docs/performance.md. Rendering reads the votes twice, row by row.
 * Numeric  integers only, bit-exact on every target. Votes saturate: NEAREST at 255, BILINEAR (Q8) at 255.99 and GAUSSIAN
 *          (Q10) at 63.99 votes per pixel, which is 402 events at one place. They do not depend on the events' order.
 *          Against the equation in double precision: NEAREST and BILINEAR exact at the given points, GAUSSIAN within
 *          2^-11 (the rounding) or 0.0004 (what is cut off) per event and pixel. Grey levels within 1.
 * Threads  no shared state; one context must not be entered from two threads or ISRs at once.
 *
 * [1] J. P. Rodriguez-Gomez, J. R. Martinez-de Dios, A. Ollero, G. Gallego, "On the Benefits of Visual Stabilization
 *     for Frame- and Event-based Perception", IEEE RA-L 2024. doi:10.1109/LRA.2024.3450290
 */
#ifndef EVS_IWE_H
#define EVS_IWE_H

#include "evs/image.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum { EVS_IWE_NEAREST = 0, EVS_IWE_BILINEAR = 1, EVS_IWE_GAUSSIAN = 2 } evs_iwe_vote_t;

/** What becomes white. */
typedef enum {
    EVS_IWE_SCALE_SIGMA = 0, /**< mean + n sigma of the smoothed pixels that are not zero. */
    EVS_IWE_SCALE_FIXED = 1  /**< A number of votes: images of different windows then compare. */
} evs_iwe_scale_t;

#define EVS_IWE_N_SIGMA_MAX_Q4 256u /**< 16 sigma. */

typedef struct {           /** Settings; copied by evs_iwe_init(). */
    uint16_t width_px;     /**< [1, EVS_SENSOR_MAX_PX]. */
    uint16_t height_px;    /**< [1, EVS_SENSOR_MAX_PX]. */
    evs_iwe_vote_t vote;   /**< Default NEAREST. */
    bool smooth;           /**< 3 x 3 binomial at rendering. Default true; the Gaussian needs none. */
    evs_iwe_scale_t scale; /**< Default SIGMA. */
    uint16_t n_sigma_q4;   /**< SIGMA: [0, EVS_IWE_N_SIGMA_MAX_Q4]. Default 3 sigma, 48. */
    uint16_t full_q4;      /**< FIXED: votes per pixel that are white, at least 1. Default 8 votes, 128. */
} evs_iwe_config_t;

/* A vote takes one byte or two. After the votes, in whole words: three rows of 16-bit values for rendering. */
#define EVS_IWE_VOTES_BYTES_(width_px, height_px, vote)                                                                \
    ((EVS_IMAGE_BYTES(width_px, height_px) * (((vote) == EVS_IWE_NEAREST) ? 1u : 2u) + 3u) / 4u * 4u)

/** Bytes of memory, a constant expression. */
#define EVS_IWE_BYTES(width_px, height_px, vote)                                                                       \
    (EVS_IWE_VOTES_BYTES_(width_px, height_px, vote) + ((size_t)(width_px) + 3u) / 4u * 24u)

typedef struct { /** Context. A complete type only so that you can place it: every member is private. */
    evs_iwe_config_t cfg;
    void *votes;
    uint32_t *rows;
    uint32_t n_votes;
    uint32_t n_outside;
} evs_iwe_t;

evs_iwe_config_t evs_iwe_config_default(uint16_t width_px, uint16_t height_px);

/**
 * Bind a context to caller memory and clear it.
 * @param[out] iwe      Untouched on error.
 * @param      memory   Kept by reference, aligned for uint32_t; contents on entry do not matter. It begins with the votes,
 *                      width_px * height_px, row by row: uint8_t counts (NEAREST), uint16_t Q8 (BILINEAR) or Q10 (GAUSSIAN).
 *                      You may read them, and use the memory for something else until the next evs_iwe_clear().
 * @param      n_bytes  At least EVS_IWE_BYTES(width_px, height_px, vote).
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (a setting is out of range) or EVS_ERR_SIZE (too little memory, or misaligned).
 */
EVS_NODISCARD evs_status_t evs_iwe_init(evs_iwe_t *iwe, const evs_iwe_config_t *cfg, void *memory, size_t n_bytes);

/** Take all votes back: the next image begins. */
void evs_iwe_clear(evs_iwe_t *iwe);

/**
 * Let events vote. Those whose nearest pixel is off the image, or that have no position, are counted and ignored; of the
 * others' votes, what would fall off the image is lost.
 */
void evs_iwe_add(evs_iwe_t *iwe, const evs_point_t *points, size_t n);

/**
 * The image of the votes so far; it does not change them. All 0 before the first vote.
 * @param[out] px  width_px * height_px bytes, none of them of the memory of @p iwe.
 */
void evs_iwe_render(const evs_iwe_t *iwe, uint8_t *px);

/** Events that have voted since the last clear. */
static inline uint32_t evs_iwe_n_votes(const evs_iwe_t *iwe) { return iwe->n_votes; }

/** Events that were ignored, since the start. */
static inline uint32_t evs_iwe_n_outside(const evs_iwe_t *iwe) { return iwe->n_outside; }

#ifdef __cplusplus
}
#endif
#endif
