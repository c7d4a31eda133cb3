/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/homography.h
 * @brief Rotates image points: x' ~ K R K^-1 x, the hot path of stabilization.
 *
 * Model    the view of a pinhole camera after a rotation about its centre. q = q_ba takes rays of frame a into frame b;
 *          the points of the image seen from a are mapped to where b sees them.
 * Memory   one evs_homography_t. No heap, no globals; a constant table of 2 KB.
 * Cost     set: about 650 instructions. map, per point near the image (depth ratio within 1/2..3/2 of that at the
 *          image centre: every rotation up to a saccade): 20 on Cortex-M4, M7 and M33, 10 on M55, 61 on RV32IMAC. A
 *          point elsewhere takes two 64-bit divisions. On Cortex-M4, M7 and M33 let arrays start at multiples of 4.
 * Numeric  points 1/16 px in and out; integers only; same bits with and without SIMD. The exact quotient rounded half
 *          up, with an error before rounding <= 1/64 px: in all <= 3/64 px of the real map of the given point.
 *          Nothing wraps: a point behind the camera, beyond 2047 px, or EVS_POINT_OUTSIDE maps to EVS_POINT_OUTSIDE.
 * Threads  map() only reads the context.
 */
#ifndef EVS_HOMOGRAPHY_H
#define EVS_HOMOGRAPHY_H

#include "evs/vec.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_PINHOLE_FOCAL_MIN_Q16  (INT32_C(8) << 16)
#define EVS_PINHOLE_FOCAL_MAX_Q16  (INT32_C(8192) << 16)
#define EVS_PINHOLE_CENTRE_MAX_Q16 (INT32_C(4096) << 16)

typedef struct {        /** An ideal camera: focal lengths and principal point in px. */
    uint16_t width_px;  /**< [1, EVS_SENSOR_MAX_PX] */
    uint16_t height_px; /**< [1, EVS_SENSOR_MAX_PX] */
    int32_t fx_q16;     /**< [8, 8192] px; fx / fy in (1/2, 2). */
    int32_t fy_q16;
    int32_t cx_q16; /**< [-4096, 4096] px */
    int32_t cy_q16;
} evs_pinhole_t;

/** @return EVS_OK, EVS_ERR_NULL, or EVS_ERR_ARG: a field is out of range. */
EVS_NODISCARD evs_status_t evs_pinhole_check(const evs_pinhole_t *k);

typedef struct { /** Context. A complete type only so that you can place it: every member is private. */
    /* Exact path: rows of diag(fx, fy, fx) R K^-1 without its shift, Q30; see evs_homography.c. */
    int32_t row_q30[3][3];
    int32_t fx_q16;
    int32_t fy_q16;
    int32_t cx_q16;
    int32_t cy_q16;
    /* Fast path: numerators (Q28, Q16 px) and depth ratio (Q35, Q23), divided by the ratio at the image centre. */
    int32_t ax_q28, ay_q28, a0_q16;
    int32_t bx_q28, by_q28, b0_q16;
    int32_t wx_q35, wy_q35, w0_q23;
    int32_t cx_q13, cy_q13;
    bool fast;
} evs_homography_t;

/**
 * Prepare the map of the image of frame a to that of frame b, both seen through the pinhole @p k.
 * @param k  Passed evs_pinhole_check().
 * @param q_ba  Unit.
 */
void evs_homography_set(evs_homography_t *h, const evs_pinhole_t *k, evs_quat_t q_ba);

/** Map n points. @p out may be @p in itself, but must not overlap it otherwise. */
void evs_homography_map(const evs_homography_t *h, const evs_point_t *in, size_t n, evs_point_t *out);

#ifdef __cplusplus
}
#endif
#endif
