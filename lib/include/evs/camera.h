/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/camera.h
 * @brief The lens: from a pixel to a ray and back, with and without distortion.
 *
 * Model    [1] as OpenCV defines it. With x = X/Z, y = Y/Z, r^2 = x^2 + y^2:
 *          pinhole (Brown-Conrady [2]): x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2),
 *                                       y_d = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y;
 *          equidistant fisheye [3]:     a = angle to the axis, a_d = a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8),
 *                                       (x_d, y_d) = a_d / r (x, y), which goes on past 90 degrees;
 *          pixel = (fx x_d + cx, fy y_d + cy). An ideal or undistorted pixel is (fx x + cx, fy y + cy), the same K.
 * Domain   A polynomial may fold over: beyond some radius it maps two rays onto one pixel. evs_camera_init() finds the
 *          radius up to which the model is invertible; nothing beyond it is used, and a pixel that no ray inside it
 *          reaches has no preimage: EVS_ERR_NUMERIC.
 * Memory   one evs_camera_t. No heap, no globals.
 * Cost     not for the hot path. On a Cortex-M7 evs_camera_undistort() takes about 11,000 instructions (fisheye 5,000),
 *          evs_camera_init() up to a million. Make a table of it once: evs/undistort.h.
 * Numeric  integers only, bit-exact on every target. Inside 64-bit with 32 fractional bits. Against exact arithmetic on
 *          the calibration as stored here: at most 1e-4 px for sensors up to 2048 px within 80 degrees of the axis.
 * Threads  no shared state; every call but evs_camera_init() only reads the context.
 *
 * [1] OpenCV 4, modules calib3d: "Camera Calibration and 3D Reconstruction" and "Fisheye camera model".
 * [2] D. C. Brown, "Close-Range Camera Calibration", Photogrammetric Engineering 37(8), 1971.
 * [3] J. Kannala, S. S. Brandt, "A Generic Camera Model and Calibration Method for Conventional, Wide-Angle, and
 *     Fish-Eye Lenses", IEEE TPAMI 28(8), 2006. doi:10.1109/TPAMI.2006.153
 */
#ifndef EVS_CAMERA_H
#define EVS_CAMERA_H

#include "evs/types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_CAMERA_N_DIST         5u                      /**< Distortion coefficients in a configuration. */
#define EVS_CAMERA_FOCAL_MIN_Q16  INT32_C(0x10000)        /**< 1 px. */
#define EVS_CAMERA_FOCAL_MAX_Q16  INT32_C(0x40000000)     /**< 16384 px. */
#define EVS_CAMERA_CENTRE_MAX_Q16 INT32_C(0x20000000)     /**< 8192 px to either side. */
#define EVS_CAMERA_DIST_MAX_Q32   (INT64_C(0x4000) << 32) /**< 16384: beyond it a coefficient is a mistake. */

typedef enum {
    EVS_CAMERA_PINHOLE = 0, /**< dist = k1, k2, p1, p2, k3; all 0 is a lens without distortion. */
    EVS_CAMERA_FISHEYE = 1  /**< dist = k1, k2, k3, k4, and 0. */
} evs_camera_model_t;

/** A calibration; copied by evs_camera_init(). evs/float.h makes it from floating-point numbers. */
typedef struct {
    evs_camera_model_t model;
    uint16_t width_px;  /**< [1, EVS_SENSOR_MAX_PX] */
    uint16_t height_px; /**< [1, EVS_SENSOR_MAX_PX] */
    int32_t fx_q16;     /**< Focal lengths in px, [EVS_CAMERA_FOCAL_MIN_Q16, EVS_CAMERA_FOCAL_MAX_Q16] */
    int32_t fy_q16;
    int32_t cx_q16; /**< Principal point in px, [-EVS_CAMERA_CENTRE_MAX_Q16, EVS_CAMERA_CENTRE_MAX_Q16] */
    int32_t cy_q16;
    int64_t dist_q32[EVS_CAMERA_N_DIST]; /**< [-EVS_CAMERA_DIST_MAX_Q32, EVS_CAMERA_DIST_MAX_Q32], in OpenCV's order. */
} evs_camera_config_t;

typedef struct { /** Context. A complete type only so that you can place it: every member is private. */
    evs_camera_config_t cfg;
    int64_t poly_q32[4];    /**< Radial polynomial 1 + c0 t^2 + c1 t^4 + c2 t^6 + c3 t^8. */
    int64_t tangential_q32; /**< |(p1, p2)|; 0 for a fisheye. */
    int64_t domain_q32;     /**< Largest t: a radius (pinhole) or an angle (fisheye). */
    int64_t domain_d_q32;   /**< Distorted radius there. */
    int64_t reach_q32;      /**< No pixel farther out than this has a preimage. */
} evs_camera_t;

/** A position on the image in px, 16 fractional bits. */
typedef struct {
    int32_t x_q16;
    int32_t y_q16;
} evs_camera_px_t;

/** A camera without distortion, the optical axis in the middle of the sensor: for one that was never calibrated. */
evs_camera_config_t evs_camera_config_ideal(uint16_t width_px, uint16_t height_px, int32_t focal_q16);

/**
 * Check a calibration and find the radius up to which it can be inverted.
 * @param[out] cam  Untouched on error.
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (a field is out of range) or EVS_ERR_NUMERIC (the model folds over so close
 *         to the optical axis that no pixel can be inverted).
 */
EVS_NODISCARD evs_status_t evs_camera_init(evs_camera_t *cam, const evs_camera_config_t *cfg);

/**
 * The radius up to which the model is used: sqrt(x^2 + y^2) of the ray (pinhole) or its angle to the axis in rad
 * (fisheye), 32 fractional bits. Pinhole rays stop at 64 (89.1 degrees) and at an ideal pixel of 2048 px, fisheye rays
 * at pi, or all of them earlier, where the model folds over.
 */
int64_t evs_camera_domain_q32(const evs_camera_t *cam);

/**
 * Where the lens puts an ideal pixel. Error at most 2^-15 px.
 * @param      ideal  May lie off the sensor.
 * @param[out] out    May be off the sensor too. Untouched on error.
 * @return EVS_OK, EVS_ERR_NULL, or EVS_ERR_NUMERIC (beyond the domain, or the answer beyond 32767 px).
 */
EVS_NODISCARD evs_status_t evs_camera_distort(const evs_camera_t *cam, evs_camera_px_t ideal, evs_camera_px_t *out);

/**
 * The ideal pixel of what the lens shows at @p px: inverse of evs_camera_distort(), by iteration to convergence.
 * @param[out] out  Untouched on error.
 * @return EVS_OK, EVS_ERR_NULL, or EVS_ERR_NUMERIC (no preimage; 90 degrees and more from the axis; or the answer
 *         beyond 2047 px, the range of evs_point_t).
 */
EVS_NODISCARD evs_status_t evs_camera_undistort(const evs_camera_t *cam, evs_camera_px_t px, evs_camera_px_t *out);

/** evs_camera_undistort() rounded once, half up, to 1/16 px; EVS_POINT_OUTSIDE where it has no answer. */
evs_point_t evs_camera_undistort_point(const evs_camera_t *cam, evs_camera_px_t px);

/**
 * The unit vector (x right, y down, z forward) that the lens shows at @p px; works past 90 degrees for a fisheye.
 * @param[out] ray_q30  Error at most 4 LSB in each component. Untouched on error.
 * @return EVS_OK, EVS_ERR_NULL, or EVS_ERR_NUMERIC (no preimage).
 */
EVS_NODISCARD evs_status_t evs_camera_ray(const evs_camera_t *cam, evs_camera_px_t px, int32_t ray_q30[3]);

/**
 * Where the lens shows a direction.
 * @param      ray  Of any length but 0: only the direction counts. Long vectors carry more digits.
 * @param[out] out  Untouched on error.
 * @return EVS_OK, EVS_ERR_NULL, or EVS_ERR_NUMERIC (zero vector, beyond the domain, pinhole and z <= 0, or the answer
 *         beyond 32767 px).
 */
EVS_NODISCARD evs_status_t evs_camera_project(const evs_camera_t *cam, const int32_t ray[3], evs_camera_px_t *out);

#ifdef __cplusplus
}
#endif
#endif
