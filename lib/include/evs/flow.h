/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/flow.h
 * @brief Where points of one image have gone in another: pyramidal Lucas-Kanade.
 *
 * Model    Around each point a square window of the first image, sampled every stride_px, is the template. Gauss-Newton
 *          steps move it over the second image until the squared differences are least [1][2], first on the coarsest
 *          level of a pyramid, then on the finer ones. Gradients are central differences of the interpolated template;
 *          interpolation is bilinear. Beyond its border an image goes on as its border pixels, so that windows may
 *          reach over it. A track that ends well is repeated on the finest level from the second image to the first,
 *          started at its own reverse; it is kept if that comes back.
 * Memory   one evs_flow_t, EVS_FLOW_BYTES() of caller memory, and EVS_PYRAMID_BYTES() for each image of more than one level.
 * Cost     independent of the size of the image; docs/performance.md counts it. Bounded: n_levels * n_iterations steps,
 *          and n_iterations for the way back.
 * Numeric  integers only, bit-exact on every target. Positions are Q8 px, grey values Q7 and gradients Q1 where they are
 *          multiplied, sums exact. No image content overflows; evs_flow_kernel.h and
 *          evs_flow.c have the bounds.
 * Threads  no shared state; one context must not be entered from two threads or ISRs at once.
 *
 * [1] B. D. Lucas, T. Kanade, "An Iterative Image Registration Technique with an Application to Stereo Vision",
 *     IJCAI 1981.
 * [2] J.-Y. Bouguet, "Pyramidal Implementation of the Affine Lucas Kanade Feature Tracker", Intel Corporation, 2001.
 */
#ifndef EVS_FLOW_H
#define EVS_FLOW_H

#include "evs/image.h"

#ifdef __cplusplus
extern "C" {
#endif

/* --- pyramid ---------------------------------------------------------------------------------------------------- */

#define EVS_FLOW_LEVELS_MAX 4u /**< Most levels, the image itself included. */

typedef struct { /** An image and smaller ones of the same view. */
    evs_image_t level[EVS_FLOW_LEVELS_MAX];
    uint16_t n_levels;
} evs_pyramid_t;

/* Bytes of one level; half, quarter and eighth of an image, one by one as evs_image_halve() rounds them. */
#define EVS_PYRAMID_H1(n)           EVS_IMAGE_HALF((size_t)(n))
#define EVS_PYRAMID_H2(n)           EVS_IMAGE_HALF(EVS_PYRAMID_H1(n))
#define EVS_PYRAMID_H3(n)           EVS_IMAGE_HALF(EVS_PYRAMID_H2(n))
#define EVS_PYRAMID_LEVEL(on, w, h) ((on) ? (w) * (h) : (size_t)0)

/** Bytes for the levels of a pyramid beside the image itself: 0 for n_levels 1. A constant expression. */
#define EVS_PYRAMID_BYTES(width_px, height_px, n_levels)                                                               \
    (EVS_PYRAMID_LEVEL((n_levels) > 1u, EVS_PYRAMID_H1(width_px), EVS_PYRAMID_H1(height_px)) +                         \
     EVS_PYRAMID_LEVEL((n_levels) > 2u, EVS_PYRAMID_H2(width_px), EVS_PYRAMID_H2(height_px)) +                         \
     EVS_PYRAMID_LEVEL((n_levels) > 3u, EVS_PYRAMID_H3(width_px), EVS_PYRAMID_H3(height_px)))

/**
 * Make the smaller images of a pyramid by evs_image_halve().
 * @param[out] pyramid   Untouched on error.
 * @param      image     Kept by reference as level 0.
 * @param      n_levels  [1, EVS_FLOW_LEVELS_MAX]
 * @param[out] memory    Kept by reference: the other levels. NULL is fine for n_levels 1.
 * @param      n_bytes   At least EVS_PYRAMID_BYTES(image->width_px, image->height_px, n_levels).
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (the size of the image or n_levels is out of range) or EVS_ERR_SIZE.
 */
EVS_NODISCARD evs_status_t evs_pyramid_build(evs_pyramid_t *pyramid, const evs_image_t *image, uint16_t n_levels,
                                             uint8_t *memory, size_t n_bytes);

/* --- flow ------------------------------------------------------------------------------------------------------- */

#define EVS_FLOW_WINDOW_MIN_PX  7u  /**< Smallest window_px. */
#define EVS_FLOW_WINDOW_MAX_PX  31u /**< Largest window_px. */
#define EVS_FLOW_ITERATIONS_MAX 100u

/** An image position in 1/256 px; pixel centres lie at integers. */
typedef struct {
    int32_t x_q8;
    int32_t y_q8;
} evs_position_t;

typedef struct {           /** Settings; copied by evs_flow_init(). */
    uint16_t window_px;    /**< Side of the window: odd, [7, 31], default 25. */
    uint16_t stride_px;    /**< Every how many px it is sampled: 1 or 2, default 2. */
    uint16_t n_iterations; /**< Most steps per level. [1, 100], default 5. */
    uint16_t epsilon_q8; /**< Steps of at most that many 1/256 px along both axes are the last. [0, 256], default 3. */
    uint16_t min_eigen_q8;    /**< Least texture: smaller eigenvalue of the mean product of the gradients of the
                                   template, (grey levels/px)^2 Q8. [1, 65535], default 26 (0.1). */
    uint16_t max_backward_q8; /**< Farthest from its start that the way back may end, px Q8; 0: do not go back.
                                   [0, 65535], default 128 (0.5 px). */
} evs_flow_config_t;

/** What became of a track. */
typedef enum {
    EVS_FLOW_OK = 0,
    EVS_FLOW_LOST_BORDER = 1,  /**< It starts or ends off the image, or was predicted farther off than half a window. */
    EVS_FLOW_LOST_TEXTURE = 2, /**< Nothing there to track: flat, or an edge that may have slid along itself. */
    EVS_FLOW_LOST_BACKWARD = 3 /**< The way back ends elsewhere. */
} evs_flow_status_t;

typedef struct {         /** A point to track. */
    evs_position_t from; /**< In: where it is in the first image. */
    /** In: where to start looking in the second image; `from` if nothing is known. Out: where it is; of no use unless the
     * status is EVS_FLOW_OK. */
    evs_position_t to;
    uint16_t residual_q8; /**< Out: mean |difference| of the windows, grey levels Q8; 0 unless EVS_FLOW_OK. */
    uint8_t status;       /**< Out: an evs_flow_status_t. */
} evs_flow_track_t;

typedef struct { /** Context. A complete type only so that you can place it: every member is private. */
    evs_flow_config_t cfg;
    uint16_t n_side;  /* samples along a side of the window */
    uint16_t n_pitch; /* the same, rounded up to whole vectors */
    int16_t *samples; /* the template: see evs_flow_kernel.h */
    int16_t *rows;    /* three rows of the interpolated template */
    uint8_t *patch;   /* what a window near the border sees */
    uint16_t patch_columns;
    uint16_t patch_rows;
} evs_flow_t;

/* Sizes of the parts of the memory. */
#define EVS_FLOW_SIDE(window, stride)  (((size_t)(window)-1u) / (stride) + 1u)
#define EVS_FLOW_PITCH(window, stride) ((EVS_FLOW_SIDE(window, stride) + 7u) / 8u * 8u)
#define EVS_FLOW_SPARE_PX              2u /* The patch reaches farther on each side, so that a small step needs no new one. */
#define EVS_FLOW_PATCH_COLUMNS(window, stride)                                                                         \
    ((EVS_FLOW_PITCH(window, stride) * (stride) + 3u + 2u * EVS_FLOW_SPARE_PX + 3u) / 4u * 4u)
#define EVS_FLOW_PATCH_ROWS(window) ((size_t)(window) + 3u + 2u * EVS_FLOW_SPARE_PX)
#define EVS_FLOW_ROW(window)        (((size_t)(window) + 2u + 1u) / 2u * 2u)

/** Bytes of memory for a window. A constant expression. */
#define EVS_FLOW_BYTES(window_px, stride_px)                                                                           \
    (6u * EVS_FLOW_SIDE(window_px, stride_px) * EVS_FLOW_PITCH(window_px, stride_px) + 6u * EVS_FLOW_ROW(window_px) +  \
     EVS_FLOW_PATCH_COLUMNS(window_px, stride_px) * EVS_FLOW_PATCH_ROWS(window_px))

evs_flow_config_t evs_flow_config_default(void);

/**
 * Bind a context to caller memory.
 * @param[out] flow     Untouched on error.
 * @param      memory   Kept by reference, aligned to 4; contents do not matter, neither now nor between two calls.
 * @param      n_bytes  At least EVS_FLOW_BYTES(cfg->window_px, cfg->stride_px).
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (a setting is out of range) or EVS_ERR_SIZE (too little memory, or misaligned).
 */
EVS_NODISCARD evs_status_t evs_flow_init(evs_flow_t *flow, const evs_flow_config_t *cfg, void *memory, size_t n_bytes);

/**
 * Track points from one image to another. Each track is on its own: how they are split into calls does not matter.
 * @param         from    The pyramid of the first image. Where the two have different numbers of levels, the smaller counts.
 * @param         to      The pyramid of the second image, of the same size.
 * @param[in,out] tracks  n tracks.
 */
void evs_flow_track(evs_flow_t *flow, const evs_pyramid_t *from, const evs_pyramid_t *to, evs_flow_track_t *tracks,
                    size_t n);

#ifdef __cplusplus
}
#endif
#endif
