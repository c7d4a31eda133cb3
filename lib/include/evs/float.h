/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/float.h
 * @brief Conversions between floating point and the library's formats, for users who think in floats.
 *
 * Header-only; the library itself never includes it. NaN becomes 0, values out of range saturate, and
 * evs_q_fits() tells beforehand, so that a bad sensor value can be counted instead of passed on.
 */
#ifndef EVS_FLOAT_H
#define EVS_FLOAT_H

#include "evs/camera.h"
#include "evs/vec.h"

#ifdef __cplusplus
extern "C" {
#endif

/** 2^n as a double; n in [0, 62]. */
static inline double evs_q_one(unsigned n) { return (double)(UINT64_C(1) << n); }

/** Whether x is a number that Qn holds in 32 bits. */
static inline bool evs_q_fits(double x, unsigned n)
{
    const double scaled = x * evs_q_one(n);
    return (scaled >= -2147483648.0) && (scaled < 2147483647.5);
}

/** x in Qn, rounded half away from zero, saturating; 0 for NaN. */
static inline int32_t evs_q_from_double(double x, unsigned n)
{
    const double scaled = x * evs_q_one(n);
    if (scaled != scaled) { return 0; }
    if (scaled >= 2147483647.0) { return INT32_MAX; }
    if (scaled <= -2147483648.0) { return INT32_MIN; }
    return (int32_t)(scaled + ((scaled < 0.0) ? -0.5 : 0.5));
}
static inline double evs_q_to_double(int32_t x, unsigned n) { return (double)x / evs_q_one(n); }

/** The same in single precision, for cores whose FPU has no more. */
static inline int32_t evs_q_from_float(float x, unsigned n)
{
    const float scaled = x * (float)(UINT64_C(1) << n);
    if (scaled != scaled) { return 0; }
    if (scaled >= 2147483648.0f) { return INT32_MAX; }
    if (scaled <= -2147483648.0f) { return INT32_MIN; }
    return (int32_t)(scaled + ((scaled < 0.0f) ? -0.5f : 0.5f));
}
static inline float evs_q_to_float(int32_t x, unsigned n) { return (float)x / (float)(UINT64_C(1) << n); }

/** A vector in Qn from three numbers. */
static inline evs_vec3_t evs_vec3_from_double(double x, double y, double z, unsigned n)
{
    const evs_vec3_t v = {evs_q_from_double(x, n), evs_q_from_double(y, n), evs_q_from_double(z, n)};
    return v;
}

/** A unit quaternion from four numbers; the caller normalizes (evs_quat_normalize) what is not of unit length. */
static inline evs_quat_t evs_quat_from_double(double w, double x, double y, double z)
{
    const evs_quat_t q = {evs_q_from_double(w, 30), evs_q_from_double(x, 30), evs_q_from_double(y, 30),
                          evs_q_from_double(z, 30)};
    return q;
}

/**
 * A calibration from the numbers that calibration tools print.
 * @param[out] cfg   Untouched on error.
 * @param      k_px  fx, fy, cx, cy.
 * @param      dist  As OpenCV orders them: k1, k2, p1, p2, k3 (pinhole) or k1, k2, k3, k4, 0 (fisheye).
 * @return EVS_OK, or EVS_ERR_ARG when a number is not finite or beyond the range in evs/camera.h; evs_camera_init() checks
 *         the rest.
 */
EVS_NODISCARD static inline evs_status_t evs_camera_config_from_double(evs_camera_config_t *cfg,
                                                                       evs_camera_model_t model, uint16_t width_px,
                                                                       uint16_t height_px, const double k_px[4],
                                                                       const double dist[EVS_CAMERA_N_DIST])
{
    evs_camera_config_t c = {model, width_px, height_px, 0, 0, 0, 0, {0, 0, 0, 0, 0}};
    for (unsigned i = 0u; i < 4u; i++) {
        if (!evs_q_fits(k_px[i], 16)) { return EVS_ERR_ARG; }
    }
    c.fx_q16 = evs_q_from_double(k_px[0], 16);
    c.fy_q16 = evs_q_from_double(k_px[1], 16);
    c.cx_q16 = evs_q_from_double(k_px[2], 16);
    c.cy_q16 = evs_q_from_double(k_px[3], 16);
    for (unsigned i = 0u; i < EVS_CAMERA_N_DIST; i++) {
        const double scaled = dist[i] * evs_q_one(32);
        if (!((scaled >= -(double)EVS_CAMERA_DIST_MAX_Q32) && (scaled <= (double)EVS_CAMERA_DIST_MAX_Q32))) {
            return EVS_ERR_ARG;
        }
        c.dist_q32[i] = (int64_t)(scaled + ((scaled < 0.0) ? -0.5 : 0.5));
    }
    *cfg = c;
    return EVS_OK;
}

/** Coordinates of a point in px. */
static inline float evs_point_x_px(evs_point_t p) { return (float)p.x_q4 / 16.0f; }
static inline float evs_point_y_px(evs_point_t p) { return (float)p.y_q4 / 16.0f; }

#ifdef __cplusplus
}
#endif
#endif
