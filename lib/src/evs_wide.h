/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs_wide.h
 * @brief Private: the few operations on 64-bit fixed point that the camera model needs, for set-up code, not hot paths.
 *
 * A calibration has to be inverted to about 1e-9 so that rounding to 1/16 px agrees with a double model at every pixel;
 * 32-bit arithmetic does not reach that, and a 128-bit type is missing on 32-bit targets.
 */
#ifndef EVS_WIDE_H
#define EVS_WIDE_H

#include <stdint.h>

#define EVS_WIDE_MAX     (INT64_C(1) << 60) /* Results saturate here, so that a sum of a few never overflows. */
#define EVS_WIDE_ONE_Q32 (INT64_C(1) << 32)
#define EVS_WIDE_PI_Q32  INT64_C(13493037705)

/* a * b / 2^shift, rounded half up, saturated. shift in [8, 56]. */
int64_t evs_wide_mul(int64_t a, int64_t b, unsigned shift);

/* num / den with 32 fractional bits, saturated; relative error at most 2^-30. den is not 0; both within 2^62. */
int64_t evs_wide_div_q32(int64_t num, int64_t den);

/* sqrt(x^2 + y^2) in the format of x and y, which lie within 2^61; relative error at most 2^-30. */
int64_t evs_wide_hypot(int64_t x, int64_t y);

/* Sine and cosine with 56 fractional bits of an angle in [0, pi] with 32; error at most 2^-40. */
void evs_wide_sincos(int64_t angle_q32, int64_t *sin_q56, int64_t *cos_q56);

/* Angle in [0, pi], 32 fractional bits, between (z, r) and the z axis; error at most 2^-29. r in [0, 2^61), |z| < 2^61,
 * not both 0. */
int64_t evs_wide_angle_q32(int64_t r, int64_t z);

#endif
