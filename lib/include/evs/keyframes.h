/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/keyframes.h
 * @brief Which older image to compare the newest one with: a few stored stabilized images, and how far back to look.
 *
 * Model    Flow over a longer time is longer, and its direction more certain, until the patches no longer look alike.
 *          So the time between the two images of a pair, the baseline, adapts: target_px over the running mean of the
 *          image speed, within its limits. Images are stored half a baseline apart; the partner is the stored one whose
 *          age is nearest to the baseline. A stored image remembers the reference orientation that it was stabilized
 *          to. When the newest image has another (after a saccade), the partner is turned to it by the homography of
 *          the rotation between them; what it did not show becomes 0.
 * Memory   one evs_keyframes_t and n_stored + 1 planes of caller memory: the extra one is for the newest image, which
 *          changes places with the oldest stored one instead of being copied.
 * Cost     choose, store, learn: a few dozen instructions. turn: one homography and a copy of the plane.
 * Numeric  integers only, bit-exact on every target. Turned images take the nearest pixel (evs/homography.h: 3/64 px).
 * Time     wraps. An image older than age_max_us, or newer than the newest, is dropped; after more than 71 min without
 *          an image call evs_keyframes_clear().
 * Threads  no shared state; one context must not be entered from two threads or ISRs at once.
 */
#ifndef EVS_KEYFRAMES_H
#define EVS_KEYFRAMES_H

#include "evs/homography.h"
#include "evs/image.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_KEYFRAMES_MAX        4u                 /**< Most images that can be stored. */
#define EVS_KEYFRAMES_AGE_MAX_US UINT32_C(10000000) /**< Largest age_max_us. */
#define EVS_KEYFRAMES_NONE       SIZE_MAX

typedef struct {                /** Settings; copied by evs_keyframes_init(). */
    evs_pinhole_t pinhole;      /**< The camera of the images. */
    uint16_t n_stored;          /**< [1, EVS_KEYFRAMES_MAX], default 3. */
    uint16_t target_px_q4;      /**< Displacement to aim at, 1/16 px. [1, 4096], default 80 (5 px). */
    uint32_t baseline_min_us;   /**< [1, baseline_first_us], default 10000. */
    uint32_t baseline_max_us;   /**< [baseline_min_us, age_max_us], default 250000. */
    uint32_t baseline_first_us; /**< Until the image speed is known: [min, max], default 70000. */
    uint32_t age_max_us;        /**< Older images are dropped. [1, 10^7], default 400000. */
} evs_keyframes_config_t;

typedef struct { /** A stored image. */
    uint8_t *px;
    uint32_t t_us;
    evs_quat_t q_wr; /**< World from the reference that the image is stabilized to. */
} evs_keyframe_t;

typedef struct { /** Context. A complete type only so that you can place it: every member is private. */
    evs_keyframes_config_t cfg;
    evs_keyframe_t stored[EVS_KEYFRAMES_MAX + 1u]; /* oldest first; behind them the unused planes */
    size_t n_used;
    uint32_t speed_px_s_q4; /* running mean */
    uint32_t baseline_us;
    bool speed_known;
} evs_keyframes_t;

/** Bytes of memory for the planes; a constant expression. */
#define EVS_KEYFRAMES_BYTES(width_px, height_px, n_stored)                                                             \
    ((size_t)(width_px) * (size_t)(height_px) * ((size_t)(n_stored) + 1u))

/** Defaults for a camera. */
evs_keyframes_config_t evs_keyframes_config_default(const evs_pinhole_t *pinhole);

/**
 * Bind a context to caller memory, empty.
 * @param[out] k       Untouched on error.
 * @param      memory  Kept by reference; contents on entry do not matter.
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (a setting is out of range) or EVS_ERR_SIZE.
 */
EVS_NODISCARD evs_status_t evs_keyframes_init(evs_keyframes_t *k, const evs_keyframes_config_t *cfg, void *memory,
                                              size_t n_bytes);

/** Forget the images; what is known of the image speed stays. */
void evs_keyframes_clear(evs_keyframes_t *k);

/** The plane for the newest image, width_px * height_px bytes. Yours until evs_keyframes_store() takes it. */
static inline uint8_t *evs_keyframes_plane(const evs_keyframes_t *k) { return k->stored[k->n_used].px; }

/**
 * Drop images that are too old for time @p t_us, and choose the partner of an image of that time.
 * @return its index for evs_keyframes_get(), or EVS_KEYFRAMES_NONE when no image is at least baseline_min_us / 2 and at
 *         most three baselines older.
 */
size_t evs_keyframes_choose(evs_keyframes_t *k, uint32_t t_us);

/** A stored image: 0 is the oldest. Valid until the next call that changes the context. */
static inline const evs_keyframe_t *evs_keyframes_get(const evs_keyframes_t *k, size_t index)
{
    EVS_ASSERT(index < k->n_used);
    return &k->stored[index];
}

/**
 * Turn a stored image to another reference; nothing to do when it has that reference already.
 * @param scratch  A plane of the same size; its contents are lost.
 * @return whether it was turned.
 */
bool evs_keyframes_turn(evs_keyframes_t *k, size_t index, evs_quat_t q_wr, uint8_t *scratch);

/**
 * Store the image in evs_keyframes_plane() if it is half a baseline newer than the newest stored one, or the first.
 * @return whether it was stored; then evs_keyframes_plane() is another plane.
 */
bool evs_keyframes_store(evs_keyframes_t *k, uint32_t t_us, evs_quat_t q_wr);

/** Adapt the baseline to the image speed that a pair has shown. */
void evs_keyframes_learn(evs_keyframes_t *k, uint32_t speed_px_s_q4);

/** Adapt the baseline to a pair that showed no speed: the patches were lost. It becomes shorter. */
void evs_keyframes_shorten(evs_keyframes_t *k);

/** The baseline aimed at now. */
static inline uint32_t evs_keyframes_baseline_us(const evs_keyframes_t *k) { return k->baseline_us; }

#ifdef __cplusplus
}
#endif
#endif
