/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* What the files of the attitude filter share. Not part of the interface. */
#ifndef EVS_ATTITUDE_PRIVATE_H
#define EVS_ATTITUDE_PRIVATE_H

#include "evs/attitude.h"

/* Private flags, above the public ones in the same word. */
#define PUBLIC_FLAGS   UINT32_C(0x0000FFFF)
#define SEEN_GYRO      UINT32_C(0x00010000)
#define SEEN_ACCEL     UINT32_C(0x00020000)
#define SEEN_MAG       UINT32_C(0x00040000)
#define MOVING         UINT32_C(0x00080000) /* the newest rate rules out rest */
#define ACCEL_STEADY   UINT32_C(0x00100000)
#define SPIKE_SUSPECT  UINT32_C(0x00200000) /* the newest rate jumped */
#define VALENTI_STEADY UINT32_C(0x00400000)
#define FAST           UINT32_C(0x00800000) /* the newest rate is large enough for a spike */

#define STEP_MAX_US 20000u /* Longest single integration step. */

static inline void set_flag(evs_attitude_t *att, uint32_t flag, bool on)
{
    att->flags = on ? (att->flags | flag) : (att->flags & ~flag);
}
static inline bool has_flag(const evs_attitude_t *att, uint32_t flag) { return (att->flags & flag) != 0u; }

static inline uint32_t min_u32(uint32_t a, uint32_t b) { return (a < b) ? a : b; }
static inline uint32_t max_u32(uint32_t a, uint32_t b) { return (a > b) ? a : b; }
static inline uint32_t add_sat_u32(uint32_t a, uint32_t b) { return (a > UINT32_MAX - b) ? UINT32_MAX : a + b; }

/* Size of the largest component. */
static inline uint32_t largest(evs_vec3_t v)
{
    return max_u32(max_u32(evs_abs_u32(v.x), evs_abs_u32(v.y)), evs_abs_u32(v.z));
}

/* Whether no component is larger than limit < 2^30: one comparison each. */
static inline bool all_within(evs_vec3_t v, uint32_t limit)
{
    return ((uint32_t)v.x + limit <= 2u * limit) && ((uint32_t)v.y + limit <= 2u * limit) &&
           ((uint32_t)v.z + limit <= 2u * limit);
}

/*
 * sum + a b and the upper word of it: one instruction each (SMLAL, nothing) where they are written like this, with a
 * product to be subtracted as that of -b. As signed shifts, compilers keep the upper word in 64 bits and multiply
 * those. A sum that starts at HALF_Q32 rounds.
 */
#define HALF_Q32 (INT64_C(1) << 31)
static inline int64_t mac(int64_t sum, int32_t a, int32_t b) { return sum + (int64_t)a * b; }
static inline int32_t upper(int64_t x) { return (int32_t)(uint32_t)((uint64_t)x >> 32); }
static inline int32_t upper29(int64_t x) { return (int32_t)(uint32_t)((uint64_t)x >> 29); } /* x below 2^60 */

/* a b / 2^32: a fraction b in Q32 of a; rounded, and rounded down. */
static inline int32_t fraction(int32_t a, int32_t b_q32) { return upper(mac(HALF_Q32, a, b_q32)); }
static inline int32_t fraction_down(int32_t a, int32_t b_q32) { return upper(mac(0, a, b_q32)); }

/* 1000 / ms in Q24; a 32-bit division, so only where things change. */
static inline int32_t per_second_q24(uint32_t tau_ms) { return (int32_t)((UINT32_C(16777216) * 125u) / tau_ms * 8u); }

/* rate (1/s, Q24, below 128) times dt (at most 0.1 s) in Q31, at most one quarter. 2^32 / 10^6 = 4294 +
   31696 / 2^15. */
static inline int32_t gain_q31(int32_t rate_q24, uint32_t dt_us)
{
    const int32_t dt_q32 = (int32_t)(dt_us * 4294u + ((dt_us * 31696u) >> 15));
    const int64_t gain = ((int64_t)rate_q24 * dt_q32) >> 25;
    return (gain > (INT64_C(1) << 29)) ? (INT32_C(1) << 29) : (int32_t)gain;
}

/* Back to unit length, within a few LSB, from anywhere near it. */
evs_quat_t evs_attitude_renormalized(evs_quat_t q);

/* The smallest turn that takes the unit vector `up` (Q30) to the vertical. */
evs_quat_t evs_attitude_levelling(evs_vec3_t up);

/* The turn by a binary angle about the vertical. */
evs_quat_t evs_attitude_about_vertical(int32_t angle);

/* The steps of EVS_ATTITUDE_VALENTI, in evs_attitude_valenti.c. */
void evs_attitude_valenti_accel(evs_attitude_t *att, evs_vec3_t accel_q18, uint32_t dt_us);
void evs_attitude_valenti_mag(evs_attitude_t *att, evs_vec3_t world_q16, uint32_t dt_us);
void evs_attitude_valenti_bias(evs_attitude_t *att, evs_vec3_t rate_q24, uint32_t dt_us);

#endif
