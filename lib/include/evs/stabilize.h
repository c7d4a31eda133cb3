/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/stabilize.h
 * @brief Holds the view still: rotates undistorted points from the camera's orientation to a reference orientation.
 *
 * Model    x' ~ K R(q_C*) K^-1 x with q_C* = q_C0^-1 q_C (reference from camera) [1]. The reference is the orientation
 *          at the first event. A saccade moves it to the current orientation when, at the start of a window, the
 *          mapped image centre lies further than saccade_px_q4 from the image centre.
 *          Rotation  WINDOW  one rotation per window, that of its first event, as the released code of [1];
 *                    SLICE   the rotation follows the attitude in time slices. A slice lasts slice_max_us, or less
 *                            when the camera turns so fast that it would smear a point by more than slice_blur_q4 to
 *                            either side of its middle, whose orientation serves the whole slice.
 * Memory   one evs_stabilize_t.
 * Cost     per event evs_homography_map(); per slice evs_homography_set() and a quaternion product.
 * Numeric  integers only, bit-exact on every target. Points 1/16 px; error of the rotation of a given point <= 3/64 px.
 *          Points behind the camera or beyond 2047 px become EVS_POINT_OUTSIDE at any rotation; nothing wraps.
 * Threads  no shared state; one context must not be entered from two threads or ISRs at once.
 *
 * [1] J. P. Rodriguez-Gomez, J. R. Martinez-de Dios, A. Ollero, G. Gallego, "On the Benefits of Visual Stabilization
 *     for Frame- and Event-based Perception", IEEE RA-L 2024. doi:10.1109/LRA.2024.3450290
 */
#ifndef EVS_STABILIZE_H
#define EVS_STABILIZE_H

#include "evs/homography.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_STABILIZE_SACCADE_OFF 0u

typedef enum { EVS_ROTATION_SLICE = 0, EVS_ROTATION_WINDOW = 1 } evs_rotation_t;

typedef struct {             /** Settings; copied by evs_stabilize_init(). */
    evs_pinhole_t pinhole;   /**< The camera after undistortion. */
    evs_rotation_t rotation; /**< Default SLICE. */
    uint16_t saccade_px_q4;  /**< Displacement of the image centre that moves the reference, 1/16 px.
                                  [1, 32752], or EVS_STABILIZE_SACCADE_OFF. Default width / 6. */
    uint16_t slice_max_us;   /**< Longest slice. [50, 10000], default 1000. */
    uint16_t slice_blur_q4;  /**< Smear within a slice at the image centre, 1/16 px. [1, 160], default 4. */
} evs_stabilize_config_t;

typedef struct { /** Context. A complete type only so that you can place it: every member is private. */
    evs_stabilize_config_t cfg;
    evs_quat_t q_rw; /* reference from world */
    evs_quat_t q_rc; /* reference from camera, of the current rotation */
    evs_homography_t forward;
    bool has_reference;
} evs_stabilize_t;

/** Defaults for a camera: slice rotation, saccade at width / 6. */
evs_stabilize_config_t evs_stabilize_config_default(const evs_pinhole_t *pinhole);

/** @return EVS_OK, EVS_ERR_NULL or EVS_ERR_ARG (a setting is out of range). @p st is untouched on error. */
EVS_NODISCARD evs_status_t evs_stabilize_init(evs_stabilize_t *st, const evs_stabilize_config_t *cfg);

/** Forget the reference: the next window sets it anew. */
void evs_stabilize_reset(evs_stabilize_t *st);

/**
 * Begin a window with the orientation of its first event: set the first reference, or test for a saccade; then rotate
 * by this orientation.
 * @param q_wc  World from camera, unit.
 * @return true when a saccade has just moved the reference to @p q_wc.
 */
bool evs_stabilize_begin_window(evs_stabilize_t *st, evs_quat_t q_wc);

/** Rotate by this orientation from now on: the middle of the next slice. Needs a reference. */
void evs_stabilize_set_orientation(evs_stabilize_t *st, evs_quat_t q_wc);

/** How long a slice may last while the camera turns at this rate; in [50, slice_max_us]. */
uint32_t evs_stabilize_slice_us(const evs_stabilize_t *st, evs_vec3_t rate_rad_s_q24);

/** Rotate n undistorted points to the reference. @p out may be @p in itself. Needs a reference. */
void evs_stabilize_map(const evs_stabilize_t *st, const evs_point_t *in, size_t n, evs_point_t *out);

/** The opposite map, from the reference image to the current one, for use with evs_homography_map(). */
void evs_stabilize_inverse(const evs_stabilize_t *st, evs_homography_t *inverse);

/** q_C*, reference from camera, of the current rotation; identity before the first window. */
static inline evs_quat_t evs_stabilize_rotation(const evs_stabilize_t *st) { return st->q_rc; }

/** World from reference: the same bits until a saccade. Meaningless before the first window. */
static inline evs_quat_t evs_stabilize_reference(const evs_stabilize_t *st) { return evs_quat_conj(st->q_rw); }

#ifdef __cplusplus
}
#endif
#endif
