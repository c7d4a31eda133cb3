/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/fixed.h
 * @brief Fixed-point arithmetic: rounding, saturation, roots, reciprocals, angles, exponentials.
 *
 * Model    "Qn" is an integer with n fractional bits, its width from the C type: int32_t a_q30 holds a * 2^30.
 *          Angles are binary angles: int32_t, 2^32 = one turn, so that wrap-around is the integer's own.
 * Memory   none; the functions are pure.
 * Cost     inline ones a few instructions; on a Cortex-M4F (counted in QEMU, -O2) reciprocal 41, reciprocal root 62,
 *          exponential 80, root 106, sine and cosine 119, atan2 156. No division.
 * Numeric  integers only, bit-exact on every target. "Rounds" means to nearest, halves towards plus infinity.
 *          Errors stated below are worst cases over the whole domain, tested in tests/unit/test_fixed.c.
 * Threads  no state.
 */
#ifndef EVS_FIXED_H
#define EVS_FIXED_H

#include "evs/types.h"

#ifdef __cplusplus
extern "C" {
#endif

EVS_STATIC_ASSERT((-1 >> 1) == -1, "the library needs an arithmetic right shift");

/* --- saturation ------------------------------------------------------------------------------------------------ */

/** Nearest int32_t. */
static inline int32_t evs_sat32(int64_t x)
{
    if (x > INT32_MAX) { return INT32_MAX; }
    return (x < INT32_MIN) ? INT32_MIN : (int32_t)x;
}

/** Nearest int16_t. */
static inline int16_t evs_sat16(int32_t x)
{
    if (x > INT16_MAX) { return INT16_MAX; }
    return (x < INT16_MIN) ? (int16_t)INT16_MIN : (int16_t)x;
}

/** Whether x lies in [lo, hi]: for settings. */
static inline bool evs_in_range(int64_t x, int64_t lo, int64_t hi) { return (x >= lo) && (x <= hi); }

/** x limited to [lo, hi]. */
static inline int32_t evs_clamp(int32_t x, int32_t lo, int32_t hi) { return (x < lo) ? lo : ((x > hi) ? hi : x); }

static inline int32_t evs_add_sat(int32_t a, int32_t b) { return evs_sat32((int64_t)a + b); }
static inline int32_t evs_sub_sat(int32_t a, int32_t b) { return evs_sat32((int64_t)a - b); }

/** |x| without the overflow of -INT32_MIN. */
static inline uint32_t evs_abs_u32(int32_t x) { return (x < 0) ? 0u - (uint32_t)x : (uint32_t)x; }

/* --- rounding shifts and products ------------------------------------------------------------------------------ */

/** x / 2^n rounded. n in [1, 31], x <= INT32_MAX - 2^(n-1). */
static inline int32_t evs_shr_r(int32_t x, unsigned n) { return (x + (int32_t)(UINT32_C(1) << (n - 1u))) >> n; }

/** x / 2^n rounded. n in [1, 62], x <= INT64_MAX - 2^(n-1). */
static inline int64_t evs_shr_r64(int64_t x, unsigned n) { return (x + (int64_t)(UINT64_C(1) << (n - 1u))) >> n; }

/** x * 2^n without the undefined left shift of a negative. n in [0, 62]; the result must fit. */
static inline int64_t evs_shl64(int64_t x, unsigned n) { return x * (int64_t)(UINT64_C(1) << n); }

/**
 * a * b / 2^n rounded: the product of two fixed-point numbers whose n fractional bits are too many.
 * n in [1, 62]. The result must fit 32 bits; evs_q_mul_sat() is for where it may not.
 */
static inline int32_t evs_q_mul(int32_t a, int32_t b, unsigned n) { return (int32_t)evs_shr_r64((int64_t)a * b, n); }

/** As evs_q_mul(), saturating. */
static inline int32_t evs_q_mul_sat(int32_t a, int32_t b, unsigned n)
{
    return evs_sat32(evs_shr_r64((int64_t)a * b, n));
}

/** Upper half of a 32 x 32 bit product, rounded down: one instruction (SMMUL) on cores with the DSP extension. */
static inline int32_t evs_mul_hi(int32_t a, int32_t b) { return (int32_t)(((int64_t)a * b) >> 32); }
static inline uint32_t evs_mul_hi_u(uint32_t a, uint32_t b) { return (uint32_t)(((uint64_t)a * b) >> 32); }

/** Number of leading zero bits; 32 (64) for 0. */
static inline unsigned evs_clz32(uint32_t x)
{
#if defined(__GNUC__)
    return (x == 0u) ? 32u : (unsigned)__builtin_clz(x);
#else
    unsigned n = 32u;
    while (x != 0u) {
        x >>= 1;
        n--;
    }
    return n;
#endif
}
static inline unsigned evs_clz64(uint64_t x)
{
    const uint32_t hi = (uint32_t)(x >> 32);
    return (hi != 0u) ? evs_clz32(hi) : 32u + evs_clz32((uint32_t)x);
}

/* --- roots and reciprocals ------------------------------------------------------------------------------------- */

/** floor(sqrt(x)), exact. */
uint32_t evs_sqrt_u64(uint64_t x);

/**
 * 1 / sqrt(x) = r * 2^-shift with r in [2^31, 2^32) and shift in [32, 63]; x > 0.
 * Relative error <= 2^-28. To scale v by it: (v * r) >> shift, formed in 64 bits.
 */
uint32_t evs_rsqrt_u64(uint64_t x, unsigned *shift);

/**
 * 1 / x = r * 2^-shift with r in [2^31, 2^32) and shift in [32, 63]; x > 0.
 * Relative error <= 2^-30.
 */
uint32_t evs_recip_u32(uint32_t x, unsigned *shift);

/* --- angles ---------------------------------------------------------------------------------------------------- */

#define EVS_ANGLE_QUARTER_TURN INT32_C(0x40000000)

/** Angle of the vector (x, y) of any common scale, as a binary angle; 0 for (0, 0). Error <= 4e-9 rad. */
int32_t evs_atan2(int32_t y, int32_t x);

/** Sine and cosine of a binary angle in Q30, 1.0 = 2^30 exact. Error <= 3 * 2^-30. */
void evs_sincos(int32_t angle, int32_t *sin_q30, int32_t *cos_q30);

/** Radians in Q28, [-8, 8), to a binary angle (whole turns drop out), and back to [-pi, pi). Error <= 6e-9 rad. */
static inline int32_t evs_angle_from_rad(int32_t rad_q28)
{
    return (int32_t)(uint32_t)evs_shr_r64((int64_t)rad_q28 * INT64_C(683565276), 28); /* 2^32 / (2 pi) */
}
static inline int32_t evs_rad_from_angle(int32_t angle)
{
    return (int32_t)evs_shr_r64((int64_t)angle * INT64_C(1686629713), 32); /* pi * 2^29 */
}

/* --- exponentials ---------------------------------------------------------------------------------------------- */

/**
 * 2^x and e^x in UQ16.16 for x in Q16. UINT32_MAX where the result would reach 2^16.
 * Error <= 1/2 LSB of the output (the rounding) + 2^-28 of its value.
 */
uint32_t evs_exp2_q16(int32_t x_q16);
uint32_t evs_exp_q16(int32_t x_q16);

#ifdef __cplusplus
}
#endif
#endif
