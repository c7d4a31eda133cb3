/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/attitude.h"

#define STEP_MAX_US     20000u  /* Longest single integration step: 128 rad/s turn 2.56 rad in it, half of it in Q30. */
#define TRIM_STEP_US    100000u /* Longest step of the corrections: a slower sensor is treated as if at this rate. */
#define REST_TAU_US     350000  /* Running means of the rest detector. */
#define RELEARN_US      60000000u /* Stillness after which even a bias far from the old one is believed. */
#define FIELD_SETTLE_US 500000u   /* An undisturbed field must last so long before it is believed again, */
#define FIELD_REJECT_US 60000000u /* a disturbed one is ignored for no longer than this, */
#define FIELD_NEW_US    20000000u /* and becomes the new normal after so long in motion. */
#define RUN_OF_EQUALS   3u        /* As many equal samples at the largest rate seen are a clipped gyro. */
#define TIME_BACK_MAX   8u        /* As many samples of a time that runs back are a restarted clock. */

/* Private flags share the word with the public ones. */
#define SEEN_GYRO      (1u << 12)
#define SEEN_ACCEL     (1u << 13)
#define SEEN_MAG       (1u << 14)
#define ACCEL_STEADY   (1u << 15)
#define VALENTI_STEADY (1u << 11)
#define PUBLIC_FLAGS   0x03FFu

#define INV_6_Q32       INT32_C(715827883)
#define INV_24_Q32      INT32_C(178956971)
#define INV_120_Q32     INT32_C(35791394)
#define INV_720_Q32     INT32_C(5965232)
#define INV_5040_Q32    INT32_C(852176)
#define GRAVITY_Q24     INT32_C(164528285) /* 9.80665 m/s^2 */
#define SQRT2_Q30       INT32_C(1518500250)
#define MOTION_MIN_Q24  INT32_C(5856276)    /* 20 deg/s: a new field is only judged while the carrier turns. */
#define SPIKE_Q8        INT32_C(2560)       /* 10 rad/s from one sample to the next, and back with the one after. */
#define CLIP_MIN_Q24    INT32_C(72142029)   /* 4.3 rad/s: no gyro has a smaller full scale. */
#define GRAVITY_MIN_Q24 INT32_C(16777216)   /* 1 m/s^2: below it the mean of the acceleration has no direction. */
#define ACCEL_DRIFT_Q7  6                   /* 0.05 m/s^2: how far gravity may wander in the IMU while it rests. */
#define GAIN_MAX_Q24    INT32_C(2130706432) /* 127 1/s */
#define BIAS_GAIN_0_Q24 INT32_C(50331648)   /* 3 1/s: the first rest replaces the bias, */
#define BIAS_GAIN_Q24   INT32_C(4194304)    /* 0.25 1/s: later ones refine it. */
#define BIAS_STEP_Q31   INT32_C(4294967)    /* 2 mrad/s: a rate further off what was learnt is a slow turn, */
#define BIAS_DRIFT_Q20  UINT32_C(78812)     /* with 35 urad/s^2 of drift allowed in between (Q31 per us, Q20). */

/* ---- time ---- */

/* Seconds in Q32 from microseconds up to 1 s: 2^32 / 10^6 = 4294 + 63380 / 2^16. */
static int64_t seconds_q32(uint32_t dt_us) { return (int64_t)dt_us * 4294 + (((int64_t)dt_us * 63380) >> 16); }

/* rate (1/s, Q24) times dt in Q31, at most one half: a correction never overshoots. */
static int32_t gain_q31(int32_t rate_q24, uint32_t dt_us)
{
    const int64_t gain = ((int64_t)rate_q24 * seconds_q32(dt_us)) >> 25;
    return (gain > (INT64_C(1) << 30)) ? (INT32_C(1) << 30) : (int32_t)gain;
}

/* 1000 / ms in Q24; a 32-bit division, so only where things change. */
static int32_t per_second_q24(uint32_t tau_ms) { return (int32_t)((UINT32_C(16777216) * 125u) / tau_ms * 8u); }
static int32_t corner_q24(uint32_t tau_ms) { return evs_q_mul(per_second_q24(tau_ms), SQRT2_Q30, 30); }

/* Time since the last sample of this sensor; 0 for the first one and for one that has to be left out. */
static uint32_t advance(evs_attitude_t *att, uint32_t *last_us, uint8_t *n_back, uint32_t now_us, uint32_t seen)
{
    if ((att->flags & seen) == 0u) {
        att->flags = (uint16_t)(att->flags | seen);
        *last_us = now_us;
        return 0u;
    }
    const int32_t dt_us = evs_time_diff_us(now_us, *last_us);
    if (dt_us > 0) {
        *last_us = now_us;
        *n_back = 0u;
        return (uint32_t)dt_us;
    }
    evs_count(&att->faults.n_time_bad);
    (*n_back)++;
    if (*n_back >= TIME_BACK_MAX) {
        *n_back = 0u;
        *last_us = now_us;
    }
    return 0u;
}

static void set_flag(evs_attitude_t *att, uint32_t flag, bool on)
{
    att->flags = (uint16_t)(on ? (att->flags | flag) : (att->flags & ~flag));
}
static bool has_flag(const evs_attitude_t *att, uint32_t flag) { return (att->flags & flag) != 0u; }

static uint32_t max_u32(uint32_t a, uint32_t b) { return (a > b) ? a : b; }
static uint32_t largest(evs_vec3_t v) { return max_u32(max_u32(evs_abs_u32(v.x), evs_abs_u32(v.y)), evs_abs_u32(v.z)); }
static uint32_t add_sat_u32(uint32_t a, uint32_t b) { return (a > UINT32_MAX - b) ? UINT32_MAX : a + b; }

/* ---- quaternion steps ---- */

/* One Newton step to unit length; the input is within a few percent of it. */
static evs_quat_t renormalized(evs_quat_t q)
{
    const int64_t norm_sq_q60 = (int64_t)q.w * q.w + (int64_t)q.x * q.x + (int64_t)q.y * q.y + (int64_t)q.z * q.z;
    const int32_t scale_q30 = (int32_t)((INT64_C(3) << 29) - (norm_sq_q60 >> 31)); /* (3 - |q|^2) / 2 */
    const evs_quat_t unit = {evs_q_mul(q.w, scale_q30, 30), evs_q_mul(q.x, scale_q30, 30),
                             evs_q_mul(q.y, scale_q30, 30), evs_q_mul(q.z, scale_q30, 30)};
    return unit;
}

/* exp of half the rotation vector; components of h (Q30) below 1.3. */
static evs_quat_t exp_half(evs_vec3_t h_q30)
{
    const uint64_t hh_q60 = evs_vec3_norm_sq(h_q30);
    if (hh_q60 >= (UINT64_C(1) << 56)) { /* beyond 1/4 rad: the full series, in Q28 of the whole angle */
        const evs_vec3_t r_q28 = {evs_shr_r(h_q30.x, 1), evs_shr_r(h_q30.y, 1), evs_shr_r(h_q30.z, 1)};
        return evs_quat_from_rotvec(r_q28);
    }
    /* cos and sin(x) / x by their series to x^6: the next terms are below 2^-31 for x < 1/4. */
    const int32_t u_q34 = (int32_t)(hh_q60 >> 26);
    const int32_t u2 = evs_mul_hi(u_q34, u_q34); /* x^4, Q36 */
    const int32_t u3 = evs_mul_hi(u2, u_q34);    /* x^6, Q38 */
    const int32_t c =
        EVS_ONE_Q30 - (u_q34 >> 5) + (evs_mul_hi(u2, INV_24_Q32) >> 6) - (evs_mul_hi(u3, INV_720_Q32) >> 8);
    const int32_t s = EVS_ONE_Q30 - (evs_mul_hi(u_q34, INV_6_Q32) >> 4) + (evs_mul_hi(u2, INV_120_Q32) >> 6) -
                      (evs_mul_hi(u3, INV_5040_Q32) >> 8);
    const evs_quat_t q = {c, evs_q_mul(h_q30.x, s, 30), evs_q_mul(h_q30.y, s, 30), evs_q_mul(h_q30.z, s, 30)};
    return q;
}

/* (1, h) q: a small rotation in the world, to first order; renormalized() makes it one of atan instead. */
static evs_quat_t turned_by(evs_quat_t q, evs_vec3_t h_q30)
{
    const int64_t x = h_q30.x, y = h_q30.y, z = h_q30.z;
    const evs_quat_t r = {evs_sat32(q.w - evs_shr_r64(x * q.x + y * q.y + z * q.z, 30)),
                          evs_sat32(q.x + evs_shr_r64(x * q.w + y * q.z - z * q.y, 30)),
                          evs_sat32(q.y + evs_shr_r64(y * q.w + z * q.x - x * q.z, 30)),
                          evs_sat32(q.z + evs_shr_r64(z * q.w + x * q.y - y * q.x, 30))};
    return r;
}

/* rate (Q24) times dt, halved, in Q30: rate * dt_us * 2^5 / 10^6; 2^37 / 10^6 = 137438 + 62495 / 2^16. */
static evs_vec3_t half_angle_q30(evs_vec3_t rate_q24, uint32_t dt_us)
{
    const int64_t k_q32 = (int64_t)dt_us * 137438 + (((int64_t)dt_us * 62495) >> 16);
    const evs_vec3_t h = {(int32_t)evs_shr_r64(rate_q24.x * k_q32, 32), (int32_t)evs_shr_r64(rate_q24.y * k_q32, 32),
                          (int32_t)evs_shr_r64(rate_q24.z * k_q32, 32)};
    return h;
}

/* The smallest turn that takes the unit vector `up` (Q30) to the vertical. */
static evs_quat_t levelling(evs_vec3_t up)
{
    /*
     * (1 + z, y, -x, 0) / length, halved to keep within Q30. Pointing down, 1 + z is all rounding error; there
     * (x^2 + y^2) / (1 - z) is the same number, and falls to 0 with x and y.
     */
    int32_t w_q30 = (up.z >> 1) + EVS_ONE_Q30 / 2;
    if (up.z < 0) {
        unsigned shift;
        const uint32_t r = evs_recip_u32((uint32_t)EVS_ONE_Q30 + evs_abs_u32(up.z), &shift);
        const uint64_t xy_q60 = (uint64_t)((int64_t)up.x * up.x) + (uint64_t)((int64_t)up.y * up.y);
        w_q30 = (int32_t)(((xy_q60 >> 30) * r) >> (shift - 29u));
    }
    const evs_quat_t turn = {w_q30, up.y >> 1, -(up.x >> 1), 0};
    evs_quat_t unit;
    if (evs_quat_normalize(turn, &unit) == EVS_OK) { return unit; }
    const evs_quat_t over = {0, EVS_ONE_Q30, 0, 0}; /* exactly upside down: any horizontal axis will do */
    return over;
}

/* The turn by a binary angle about the vertical. */
static evs_quat_t about_vertical(int32_t angle)
{
    int32_t sin_q30, cos_q30;
    evs_sincos(angle / 2, &sin_q30, &cos_q30);
    const evs_quat_t turn = {cos_q30, 0, 0, sin_q30};
    return turn;
}

/* ---- the filter of [2] ---- */

#define VALENTI_GRAVITY_Q18 INT32_C(2571633)   /* 9.81 m/s^2 */
#define VALENTI_STEADY_Q18  UINT32_C(26214)    /* 0.1 m/s^2 */
#define VALENTI_CHANGE_Q24  UINT32_C(167772)   /* 0.01 rad/s from one sample to the next */
#define VALENTI_RATE_Q24    UINT32_C(3355443)  /* 0.2 rad/s */
#define VALENTI_LERP_Q30    INT32_C(966367642) /* 0.9: above it, interpolate linearly */

/* The part `gain` (Q31) of a correction: linear for a small one, spherical for a large one. */
static evs_quat_t part_of(evs_quat_t whole, int32_t gain)
{
    if (whole.w > VALENTI_LERP_Q30) {
        const evs_quat_t part = {EVS_ONE_Q30 + evs_q_mul(whole.w - EVS_ONE_Q30, gain, 31), evs_q_mul(whole.x, gain, 31),
                                 evs_q_mul(whole.y, gain, 31), evs_q_mul(whole.z, gain, 31)};
        return renormalized(renormalized(part)); /* linear: short by up to 5 %, so twice */
    }
    const evs_vec3_t r_q28 = evs_vec3_scale(evs_quat_to_rotvec(whole), gain, 31);
    return evs_quat_from_rotvec(r_q28);
}

static void valenti_accel(evs_attitude_t *att, evs_vec3_t a_q18, uint32_t dt_us)
{
    const int32_t norm_q18 = (int32_t)evs_sqrt_u64(evs_vec3_norm_sq(a_q18));
    const uint32_t off_q18 = evs_abs_u32(norm_q18 - VALENTI_GRAVITY_Q18);
    set_flag(att, VALENTI_STEADY, off_q18 <= VALENTI_STEADY_Q18);

    int32_t gain = gain_q31(per_second_q24(att->cfg.tau_accel_ms), dt_us);
    if (att->cfg.valenti_adaptive) { /* full up to 10 % off g, none from 20 % */
        const int32_t tenths_q18 =
            (int32_t)((VALENTI_GRAVITY_Q18 / 5u > off_q18) ? VALENTI_GRAVITY_Q18 / 5u - off_q18 : 0u);
        const int32_t factor_q18 = evs_q_mul(tenths_q18, INT32_C(267217), 18); /* over g / 10 */
        gain = evs_q_mul(gain, evs_clamp(factor_q18, 0, INT32_C(1) << 18), 18);
    }
    evs_vec3_t up;
    if (evs_vec3_normalize(evs_quat_rotate(att->q, a_q18), &up) != EVS_OK) { return; }
    att->q = renormalized(evs_quat_mul(part_of(levelling(up), gain), att->q));
}

static void valenti_mag(evs_attitude_t *att, evs_vec3_t world_q16, uint32_t dt_us)
{
    const int32_t off = (int32_t)((uint32_t)evs_atan2(world_q16.x, world_q16.y) - (uint32_t)att->cfg.declination);
    const int32_t gain = gain_q31(per_second_q24(att->cfg.tau_mag_ms), dt_us);
    att->q = renormalized(evs_quat_mul(part_of(about_vertical(off), gain), att->q));
}

static void valenti_bias(evs_attitude_t *att, evs_vec3_t rate_q24, uint32_t dt_us)
{
    const evs_vec3_t change = evs_vec3_sub(rate_q24, att->rate_q24);
    if (!has_flag(att, VALENTI_STEADY) || (largest(change) > VALENTI_CHANGE_Q24) ||
        (largest(rate_q24) > VALENTI_RATE_Q24)) {
        return;
    }
    const int32_t gain = gain_q31(per_second_q24(att->cfg.tau_accel_ms), dt_us);
    att->bias_q30.x = evs_add_sat(att->bias_q30.x, evs_q_mul(rate_q24.x, gain, 25));
    att->bias_q30.y = evs_add_sat(att->bias_q30.y, evs_q_mul(rate_q24.y, gain, 25));
    att->bias_q30.z = evs_add_sat(att->bias_q30.z, evs_q_mul(rate_q24.z, gain, 25));
    set_flag(att, EVS_ATTITUDE_BIAS_KNOWN, true);
}

/* ---- gyro ---- */

static void shorten(evs_attitude_t *att, int32_t *w_q24, int32_t target_q24, uint32_t dt_us, uint32_t tau_us_log2)
{
    if (*w_q24 < target_q24) {
        const int64_t step = (((int64_t)target_q24 - *w_q24) * (int64_t)dt_us) >> tau_us_log2;
        const int64_t next = *w_q24 + step;
        *w_q24 = (next > target_q24) ? target_q24 : (int32_t)next;
        set_flag(att, EVS_ATTITUDE_RECOVERING, true);
    }
}

static void recover(evs_attitude_t *att, uint32_t dt_us, uint32_t tau_us_log2)
{
    if (att->cfg.mode != EVS_ATTITUDE_FILTER) { return; }
    if (!has_flag(att, EVS_ATTITUDE_SETTLING)) {
        shorten(att, &att->w_accel_q24, corner_q24(att->cfg.tau_recover_ms), dt_us, tau_us_log2);
    }
    shorten(att, &att->w_mag_q24, per_second_q24(att->cfg.tau_recover_ms), dt_us, tau_us_log2);
}

/* Is this sample clipped? Either the limit is given, or it shows as the largest value seen, repeating unchanged. */
static bool is_clipped(evs_attitude_t *att, uint32_t rate)
{
    if (att->cfg.gyro_limit_rad_s_q24 != 0) { return rate >= (uint32_t)att->cfg.gyro_limit_rad_s_q24; }
    if (rate > (uint32_t)att->gyro_max_q24) {
        att->gyro_max_q24 = (int32_t)((rate > (uint32_t)INT32_MAX) ? (uint32_t)INT32_MAX : rate);
        att->n_repeats = 1u;
        return false;
    }
    if ((rate < (uint32_t)att->gyro_max_q24) || (rate < (uint32_t)CLIP_MIN_Q24)) {
        if (att->n_repeats < RUN_OF_EQUALS) { att->n_repeats = 0u; } /* once found, the limit stays found */
        return false;
    }
    if (att->n_repeats < RUN_OF_EQUALS) { att->n_repeats++; }
    return att->n_repeats >= RUN_OF_EQUALS;
}

static void learn_bias(evs_attitude_t *att, uint32_t dt_us)
{
    const evs_vec3_t off_q28 = {att->gyro_lp_q28.x - (att->bias_q30.x >> 2),
                                att->gyro_lp_q28.y - (att->bias_q30.y >> 2),
                                att->gyro_lp_q28.z - (att->bias_q30.z >> 2)};
    int32_t gain = gain_q31(att->bias_gain_q24, dt_us);
    if (!has_flag(att, EVS_ATTITUDE_BIAS_KNOWN)) {
        gain = INT32_MAX; /* the running mean as it is; refined from here */
    } else if (largest(off_q28) > (uint32_t)att->bias_step_q31 >> 3) {
        if (att->rest_us < RELEARN_US) { return; }
        att->bias_gain_q24 = BIAS_GAIN_0_Q24;
        gain = INT32_MAX;
    }
    att->bias_q30.x += evs_q_mul(off_q28.x, gain, 29);
    att->bias_q30.y += evs_q_mul(off_q28.y, gain, 29);
    att->bias_q30.z += evs_q_mul(off_q28.z, gain, 29);
    if (att->bias_gain_q24 > BIAS_GAIN_Q24) { /* 1 / (t + 1/3 s): the plain mean since rest began */
        att->bias_gain_q24 -= evs_q_mul(att->bias_gain_q24, gain_q31(att->bias_gain_q24, dt_us), 31) + 1;
    }
    att->bias_step_q31 = BIAS_STEP_Q31;
    set_flag(att, EVS_ATTITUDE_BIAS_KNOWN, true);
}

static int32_t follow(int32_t *mean_q28, int32_t rate_q24, int32_t gain)
{
    const int32_t x_q28 = evs_clamp(rate_q24, -(INT32_C(1) << 26), INT32_C(1) << 26) * 16; /* +-4 rad/s */
    const int32_t off = x_q28 - *mean_q28;
    *mean_q28 += evs_q_mul(off, gain, 31);
    return off;
}

static void watch_gyro(evs_attitude_t *att, evs_vec3_t rate_q24, uint32_t dt_us)
{
    const int32_t gain = (int32_t)dt_us * 6136; /* Q31 of dt / REST_TAU_US; dt <= STEP_MAX_US */
    const evs_vec3_t off = {follow(&att->gyro_lp_q28.x, rate_q24.x, gain),
                            follow(&att->gyro_lp_q28.y, rate_q24.y, gain),
                            follow(&att->gyro_lp_q28.z, rate_q24.z, gain)};
    const uint32_t limit_q28 = att->cfg.rest_gyro_mrad_s * UINT32_C(268435);
    const uint32_t bias_max_q28 = att->cfg.bias_max_mrad_s * UINT32_C(268435);
    const bool still =
        (largest(off) <= limit_q28) && (largest(att->gyro_lp_q28) <= bias_max_q28) && has_flag(att, ACCEL_STEADY);
    att->rest_us = still ? add_sat_u32(att->rest_us, dt_us) : 0u;
    const bool rest = att->rest_us >= att->cfg.rest_time_ms * UINT32_C(1000);
    set_flag(att, EVS_ATTITUDE_AT_REST, rest);
    if (rest) {
        if (att->cfg.learn_bias && (att->cfg.mode != EVS_ATTITUDE_VALENTI)) { learn_bias(att, dt_us); }
    } else {
        att->bias_step_q31 = evs_add_sat(att->bias_step_q31, (int32_t)((dt_us * BIAS_DRIFT_Q20) >> 20));
    }
}

/* Let a shortened time constant grow back by `growth_q16` seconds a second: d(1/tau) = -(1/tau)^2 growth dt. */
static int32_t relaxed(int32_t w_q24, int32_t final_q24, uint32_t dt_us, int32_t growth_q16)
{
    if (w_q24 <= final_q24) { return final_q24; }
    const int32_t gain = gain_q31(w_q24, dt_us);
    const int32_t next = w_q24 - evs_q_mul(evs_q_mul(w_q24, gain, 31), growth_q16, 16) - 1;
    return (next < final_q24) ? final_q24 : next;
}

/* Turn by the rotation vector 2 h in the IMU's frame and by the correction due for dt, in steps that the series bear.
 */
static void turn(evs_attitude_t *att, evs_vec3_t h_q30, uint32_t dt_us)
{
    evs_quat_t q = evs_quat_mul(att->q, exp_half(h_q30));
    if (att->cfg.mode == EVS_ATTITUDE_FILTER) { q = turned_by(q, half_angle_q30(att->correct_q24, dt_us)); }
    att->q = renormalized(q);
}

static evs_vec3_t mean_of(evs_vec3_t a, evs_vec3_t b)
{
    const evs_vec3_t m = {(int32_t)(((int64_t)a.x + b.x) >> 1), (int32_t)(((int64_t)a.y + b.y) >> 1),
                          (int32_t)(((int64_t)a.z + b.z) >> 1)};
    return m;
}

/* Constant rate over any time: full steps, then the rest. */
static void bridge(evs_attitude_t *att, evs_vec3_t rate_q24, uint32_t dt_us)
{
    while (dt_us > 0u) {
        const uint32_t step_us = (dt_us > STEP_MAX_US) ? STEP_MAX_US : dt_us;
        turn(att, half_angle_q30(rate_q24, step_us), step_us);
        dt_us -= step_us;
    }
}

/* A lone sample far off both neighbours is a glitch: replace what it turned by the mean of the neighbours. */
static bool take_back_spike(evs_attitude_t *att, evs_vec3_t rate_q24)
{
    const evs_vec3_t jump_q8 = {(att->rate_q24.x >> 16) - att->rate_before_q8[0],
                                (att->rate_q24.y >> 16) - att->rate_before_q8[1],
                                (att->rate_q24.z >> 16) - att->rate_before_q8[2]};
    const uint32_t jump = largest(jump_q8);
    if (jump <= (uint32_t)SPIKE_Q8) { return false; }
    const evs_vec3_t across_q8 = {(rate_q24.x >> 16) - att->rate_before_q8[0],
                                  (rate_q24.y >> 16) - att->rate_before_q8[1],
                                  (rate_q24.z >> 16) - att->rate_before_q8[2]};
    if (largest(across_q8) > jump / 4u) { return false; }
    const evs_vec3_t before_q24 = {att->rate_before_q8[0] * 65536, att->rate_before_q8[1] * 65536,
                                   att->rate_before_q8[2] * 65536};
    const evs_vec3_t undo = evs_vec3_sub(mean_of(before_q24, rate_q24), att->rate_q24);
    att->q = renormalized(evs_quat_mul(att->q, exp_half(half_angle_q30(undo, att->dt_newest_us))));
    evs_count(&att->faults.n_gyro_spikes);
    return true;
}

static evs_vec3_t less_bias(const evs_attitude_t *att, evs_vec3_t rate_q24)
{
    const evs_vec3_t bias_q24 = {evs_shr_r(att->bias_q30.x, 6), evs_shr_r(att->bias_q30.y, 6),
                                 evs_shr_r(att->bias_q30.z, 6)};
    return evs_vec3_sub(rate_q24, bias_q24);
}

static void remember(evs_attitude_t *att, evs_vec3_t before_q24, evs_vec3_t rate_q24)
{
    att->rate_before_q8[0] = (int16_t)(before_q24.x >> 16);
    att->rate_before_q8[1] = (int16_t)(before_q24.y >> 16);
    att->rate_before_q8[2] = (int16_t)(before_q24.z >> 16);
    att->rate_q24 = rate_q24;
}

/* Grow the shortened time constants back, and lower the flag when both have arrived. */
static void relax(evs_attitude_t *att, uint32_t dt_us)
{
    const int32_t accel_q24 = corner_q24(att->cfg.tau_accel_ms);
    const int32_t mag_q24 = per_second_q24(att->cfg.tau_mag_ms);
    if (!has_flag(att, EVS_ATTITUDE_SETTLING)) {
        att->w_accel_q24 = relaxed(att->w_accel_q24, accel_q24, dt_us, 46341); /* corner = sqrt(2) / tau; tau + 1 s/s */
    }
    att->w_mag_q24 = relaxed(att->w_mag_q24, mag_q24, dt_us, 19661); /* 0.3 s/s: newer headings weigh more */
    if ((att->w_accel_q24 == accel_q24) && (att->w_mag_q24 == mag_q24)) {
        set_flag(att, EVS_ATTITUDE_RECOVERING, false);
    }
}

/*
 * What both kinds of gyro sample share. The sample tells the rotation of the last dt_us, as half a rotation vector;
 * since_us have gone by since the sample before, and what lies between is bridged by the mean of both rates.
 */
static void gyro_step(evs_attitude_t *att, evs_vec3_t raw_q24, evs_vec3_t rate_q24, evs_vec3_t h_q30, uint32_t dt_us,
                      uint32_t since_us)
{
    const uint32_t trim_us = (since_us > STEP_MAX_US) ? STEP_MAX_US : since_us;
    const bool clipped = is_clipped(att, largest(raw_q24));
    set_flag(att, EVS_ATTITUDE_GYRO_SATURATED, clipped);
    if (clipped) {
        evs_count(&att->faults.n_gyro_saturated);
        recover(att, trim_us, 15); /* within about 33 ms */
    }
    const evs_vec3_t before_q24 = take_back_spike(att, rate_q24) ? rate_q24 : att->rate_q24;

    if (since_us > att->cfg.gap_max_ms * UINT32_C(1000)) {
        evs_count(&att->faults.n_gyro_gaps);
        recover(att, 1u, 0);
        att->rest_us = 0u;
    } else {
        if (since_us > dt_us) { bridge(att, mean_of(before_q24, rate_q24), since_us - dt_us); }
        turn(att, h_q30, dt_us);
        watch_gyro(att, raw_q24, trim_us);
        if (att->cfg.learn_bias && (att->cfg.mode == EVS_ATTITUDE_VALENTI)) { valenti_bias(att, rate_q24, trim_us); }
    }
    remember(att, before_q24, rate_q24);
    att->dt_newest_us = dt_us;
    if (has_flag(att, EVS_ATTITUDE_RECOVERING)) { relax(att, trim_us); }
}

void evs_attitude_push_gyro(evs_attitude_t *att, uint32_t t_us, evs_vec3_t rate_rad_s_q24)
{
    EVS_ASSERT(att != NULL);
    const evs_vec3_t rate_q24 = less_bias(att, rate_rad_s_q24);
    const bool first = !has_flag(att, SEEN_GYRO);
    const uint32_t since_us = advance(att, &att->t_gyro_us, &att->n_time_back[0], t_us, SEEN_GYRO);
    if (first) { remember(att, rate_q24, rate_q24); }
    if (since_us == 0u) { return; }

    /* The usual interval follows slowly, upwards very slowly: a longer one is taken as a loss of samples. */
    const uint32_t usual_us = att->dt_gyro_us;
    uint32_t dt_us = since_us;
    if (usual_us == 0u) {
        att->dt_gyro_us = (since_us > STEP_MAX_US) ? STEP_MAX_US : since_us;
    } else if (since_us <= usual_us + usual_us / 2u) {
        att->dt_gyro_us = usual_us - usual_us / 8u + (since_us + 4u) / 8u;
    } else {
        att->dt_gyro_us = (usual_us >= STEP_MAX_US) ? STEP_MAX_US : usual_us + usual_us / 32u + 1u;
        dt_us = usual_us;
    }
    if (dt_us > STEP_MAX_US) { dt_us = STEP_MAX_US; }
    gyro_step(att, rate_rad_s_q24, rate_q24, half_angle_q30(rate_q24, dt_us), dt_us, since_us);
}

void evs_attitude_push_delta_angle(evs_attitude_t *att, uint32_t t_us, evs_vec3_t angle_rad_q30, uint32_t dt_us)
{
    EVS_ASSERT(att != NULL);
    if ((dt_us == 0u) || (dt_us > 1000000u)) {
        evs_count(&att->faults.n_time_bad);
        return;
    }
    /* The rate is the angle over the time: 10^6 / 2^6 / dt in Q24, by the reciprocal. */
    unsigned shift;
    const uint32_t r = evs_recip_u32(dt_us, &shift);
    const int64_t per_us_q20 = (int64_t)(((uint64_t)r * 15625u) >> (shift - 20u));
    const evs_vec3_t raw_q24 = {evs_sat32(evs_shr_r64(angle_rad_q30.x * per_us_q20, 20)),
                                evs_sat32(evs_shr_r64(angle_rad_q30.y * per_us_q20, 20)),
                                evs_sat32(evs_shr_r64(angle_rad_q30.z * per_us_q20, 20))};
    const evs_vec3_t rate_q24 = less_bias(att, raw_q24);

    const bool first = !has_flag(att, SEEN_GYRO);
    uint32_t since_us = advance(att, &att->t_gyro_us, &att->n_time_back[0], t_us, SEEN_GYRO);
    if (first) {
        remember(att, rate_q24, rate_q24);
        since_us = dt_us; /* an increment knows its own length */
    }
    if (since_us == 0u) { return; }
    if ((since_us < dt_us) || (since_us - dt_us < dt_us / 4u)) { since_us = dt_us; } /* jitter of the time stamps */
    att->dt_gyro_us = (dt_us > STEP_MAX_US) ? STEP_MAX_US : dt_us;

    const evs_vec3_t bias_q24 = evs_vec3_sub(raw_q24, rate_q24);
    const evs_vec3_t drift = half_angle_q30(bias_q24, dt_us); /* below 1/2 rad/s for 1 s */
    const evs_vec3_t h_q30 = {(int32_t)(((int64_t)angle_rad_q30.x + 1) >> 1) - drift.x,
                              (int32_t)(((int64_t)angle_rad_q30.y + 1) >> 1) - drift.y,
                              (int32_t)(((int64_t)angle_rad_q30.z + 1) >> 1) - drift.z};
    gyro_step(att, raw_q24, rate_q24, h_q30, dt_us, since_us);
}

/* ---- accelerometer ---- */

static void watch_accel(evs_attitude_t *att, evs_vec3_t a_q20, uint32_t dt_us)
{
    const int32_t gain = (int32_t)((dt_us > STEP_MAX_US) ? STEP_MAX_US : dt_us) * 6136; /* Q31 of dt / REST_TAU_US */
    evs_vec3_t *mean = &att->accel_lp_q20;
    const evs_vec3_t off = {evs_sub_sat(a_q20.x, mean->x), evs_sub_sat(a_q20.y, mean->y),
                            evs_sub_sat(a_q20.z, mean->z)};
    mean->x += evs_q_mul(off.x, gain, 31);
    mean->y += evs_q_mul(off.y, gain, 31);
    mean->z += evs_q_mul(off.z, gain, 31);
    const evs_vec3_t wander_q7 = {(mean->x >> 13) - att->accel_ref_q7[0], (mean->y >> 13) - att->accel_ref_q7[1],
                                  (mean->z >> 13) - att->accel_ref_q7[2]};

    /* Gravity must also keep its direction: a slow turn has a constant rate, but it carries gravity along. */
    const bool steady = (largest(off) <= att->cfg.rest_accel_mm_s2 * UINT32_C(1049)) &&
                        (largest(wander_q7) <= (uint32_t)ACCEL_DRIFT_Q7);
    set_flag(att, ACCEL_STEADY, steady);
    if (!steady) {
        att->rest_us = 0u;
        att->accel_ref_q7[0] = evs_sat16(mean->x >> 13);
        att->accel_ref_q7[1] = evs_sat16(mean->y >> 13);
        att->accel_ref_q7[2] = evs_sat16(mean->z >> 13);
    }
}

static void start_tilt(evs_attitude_t *att, evs_vec3_t a_q18)
{
    evs_vec3_t up;
    if (evs_vec3_normalize(evs_quat_rotate(att->q, a_q18), &up) != EVS_OK) { return; } /* not a zero vector: checked */
    att->q = renormalized(evs_quat_mul(levelling(up), att->q));
    att->gravity_q24 = evs_sat32((int64_t)evs_sqrt_u64(evs_vec3_norm_sq(a_q18)) * 64);
    att->w_accel_q24 = GAIN_MAX_Q24;
    set_flag(att, EVS_ATTITUDE_TILT_KNOWN, true);
    set_flag(att, EVS_ATTITUDE_SETTLING, att->cfg.mode == EVS_ATTITUDE_FILTER);
}

/* The mean acceleration points down: half a turn puts it right at once, which a rate could not. */
static void turn_over(evs_attitude_t *att)
{
    const evs_quat_t over = {0, EVS_ONE_Q30, 0, 0};
    att->q = evs_quat_mul(over, att->q);
    att->gravity_q24 = evs_sub_sat(0, att->gravity_q24);
    att->slope_q24.y = evs_sub_sat(0, att->slope_q24.y);
    att->slope_q24.z = evs_sub_sat(0, att->slope_q24.z);
    att->mag_lp_q16.y = evs_sub_sat(0, att->mag_lp_q16.y);
    att->mag_lp_q16.z = evs_sub_sat(0, att->mag_lp_q16.z);
}

/* While settling: the plain mean of all accelerations so far, by a gain of 1 / elapsed time. */
static void settle(evs_attitude_t *att, evs_vec3_t a_q18, uint32_t dt_us)
{
    const int32_t gain = gain_q31(att->w_accel_q24, dt_us);
    const int64_t up_q18 = (int64_t)a_q18.z - (att->gravity_q24 >> 6);
    att->gravity_q24 = evs_sat32(att->gravity_q24 + evs_shr_r64(up_q18 * gain, 25));
    att->slope_q24.x = evs_sat32((int64_t)a_q18.x * 64);
    att->slope_q24.y = evs_sat32((int64_t)a_q18.y * 64);

    att->w_accel_q24 -= evs_q_mul(att->w_accel_q24, gain, 31);
    if (att->w_accel_q24 <= per_second_q24(att->cfg.tau_accel_ms)) {
        att->w_accel_q24 = corner_q24(att->cfg.tau_accel_ms);
        att->slope_q24.x = 0;
        att->slope_q24.y = 0;
        set_flag(att, EVS_ATTITUDE_SETTLING, false);
    }
}

/*
 * Second-order low-pass of the acceleration in the world, in state-variable form: slope' = w (a - mean - sqrt(2)
 * slope), mean' = w slope. The world is turned so that the mean stays vertical, which leaves its length as the state
 * and makes w slope / length the rate of that turn; the slope, a world vector too, is turned with it.
 */
static void filter(evs_attitude_t *att, evs_vec3_t a_q18, uint32_t dt_us)
{
    const evs_vec3_t c_q30 = half_angle_q30(att->correct_q24, dt_us); /* half the turn of this interval */
    const evs_vec3_t s = att->slope_q24;
    const int64_t sx = s.x + evs_shr_r64((int64_t)c_q30.y * s.z - (int64_t)c_q30.z * s.y, 29);
    const int64_t sy = s.y + evs_shr_r64((int64_t)c_q30.z * s.x - (int64_t)c_q30.x * s.z, 29);
    const int64_t sz = s.z + evs_shr_r64((int64_t)c_q30.x * s.y - (int64_t)c_q30.y * s.x, 29);

    const int32_t h_q31 = gain_q31(att->w_accel_q24, dt_us);
    const int64_t ex_q18 = a_q18.x - evs_shr_r64((int64_t)s.x * SQRT2_Q30, 36);
    const int64_t ey_q18 = a_q18.y - evs_shr_r64((int64_t)s.y * SQRT2_Q30, 36);
    const int64_t ez_q18 = a_q18.z - evs_shr_r64((int64_t)s.z * SQRT2_Q30, 36) - (att->gravity_q24 >> 6);
    att->slope_q24.x = evs_sat32(sx + evs_shr_r64(ex_q18 * h_q31, 25));
    att->slope_q24.y = evs_sat32(sy + evs_shr_r64(ey_q18 * h_q31, 25));
    att->slope_q24.z = evs_sat32(sz + evs_shr_r64(ez_q18 * h_q31, 25));
    att->gravity_q24 = evs_add_sat(att->gravity_q24, evs_q_mul(att->slope_q24.z, h_q31, 31));
}

static void correct_tilt(evs_attitude_t *att)
{
    if (att->gravity_q24 < -GRAVITY_MIN_Q24) { turn_over(att); }
    if (att->gravity_q24 < GRAVITY_MIN_Q24) {
        att->correct_q24.x = 0;
        att->correct_q24.y = 0;
        return;
    }
    unsigned shift;
    const uint32_t r = evs_recip_u32((uint32_t)att->gravity_q24, &shift);
    const int64_t w_over_g_q24 = (int64_t)(((uint64_t)(uint32_t)att->w_accel_q24 * r) >> (shift - 24u));
    att->correct_q24.x = evs_sat32(evs_shr_r64(att->slope_q24.y * w_over_g_q24, 24));
    att->correct_q24.y = evs_sat32(-evs_shr_r64(att->slope_q24.x * w_over_g_q24, 24));
}

void evs_attitude_push_accel(evs_attitude_t *att, uint32_t t_us, evs_vec3_t accel_m_s2_q20)
{
    EVS_ASSERT(att != NULL);
    const uint32_t size_q20 = largest(accel_m_s2_q20);
    const bool bad = (size_q20 == 0u) || (size_q20 > (uint32_t)att->cfg.accel_max_m_s2 << 20);
    set_flag(att, EVS_ATTITUDE_ACCEL_BAD, bad);
    if (bad) {
        evs_count(&att->faults.n_accel_bad);
        return;
    }
    const bool first = !has_flag(att, SEEN_ACCEL);
    uint32_t dt_us = advance(att, &att->t_accel_us, &att->n_time_back[1], t_us, SEEN_ACCEL);
    if (first) { att->accel_lp_q20 = accel_m_s2_q20; }
    if (dt_us > TRIM_STEP_US) { dt_us = TRIM_STEP_US; }

    const evs_vec3_t a_q18 = {accel_m_s2_q20.x >> 2, accel_m_s2_q20.y >> 2, accel_m_s2_q20.z >> 2};
    if (!has_flag(att, EVS_ATTITUDE_TILT_KNOWN) && (att->cfg.mode != EVS_ATTITUDE_GYRO_ONLY)) {
        start_tilt(att, a_q18);
    }
    if (dt_us == 0u) { return; }
    watch_accel(att, accel_m_s2_q20, dt_us);
    if (att->cfg.mode == EVS_ATTITUDE_FILTER) {
        const evs_vec3_t world_q18 = evs_quat_rotate(att->q, a_q18);
        if (has_flag(att, EVS_ATTITUDE_SETTLING)) {
            settle(att, world_q18, dt_us);
        } else {
            filter(att, world_q18, dt_us);
        }
        correct_tilt(att);
    } else if (att->cfg.mode == EVS_ATTITUDE_VALENTI) {
        valenti_accel(att, a_q18, dt_us);
    }
}

/* ---- magnetometer ---- */

/* Turn the whole estimate about the vertical. */
static void turn_heading(evs_attitude_t *att, int32_t angle)
{
    const evs_quat_t turn = about_vertical(angle);
    att->q = renormalized(evs_quat_mul(turn, att->q));
    att->slope_q24 = evs_quat_rotate(turn, att->slope_q24);
}

/* How far (h, v) lies from a reference, squared, against the squared tolerance. */
static bool field_fits(const evs_attitude_t *att, int32_t h_q16, int32_t v_q16, int32_t ref_h_q16, int32_t ref_v_q16)
{
    const int64_t dh = (int64_t)h_q16 - ref_h_q16;
    const int64_t dv = (int64_t)v_q16 - ref_v_q16;
    const uint64_t off_q32 = (uint64_t)(dh * dh) + (uint64_t)(dv * dv); /* below 2^60 */
    const uint64_t size_q32 = (uint64_t)((int64_t)ref_h_q16 * ref_h_q16) + (uint64_t)((int64_t)ref_v_q16 * ref_v_q16);
    const uint32_t tolerance = att->cfg.mag_tolerance_permille;
    return off_q32 <= (size_q32 >> 20) * ((tolerance * tolerance * 537u) >> 9); /* 10^-6 = 1.0488 / 2^20 */
}

static void track_field(int32_t *h, int32_t *v, int32_t h_q16, int32_t v_q16, uint32_t dt_us)
{
    const int32_t gain = (int32_t)(dt_us * 107u); /* Q31 of dt / 20 s */
    *h += evs_q_mul(h_q16 - *h, gain, 31);
    *v += evs_q_mul(v_q16 - *v, gain, 31);
}

/* Whether the field is as it was; and if not, whether the new one has lasted long enough to be the new normal. */
static bool field_is_disturbed(evs_attitude_t *att, int32_t h_q16, int32_t v_q16, uint32_t dt_us)
{
    const bool known = (att->field_h_q16 != 0) || (att->field_v_q16 != 0);
    const bool fits = known && field_fits(att, h_q16, v_q16, att->field_h_q16, att->field_v_q16);
    if (fits) {
        att->field_ok_us = add_sat_u32(att->field_ok_us, dt_us);
        if (att->field_ok_us >= FIELD_SETTLE_US) {
            track_field(&att->field_h_q16, &att->field_v_q16, h_q16, v_q16, dt_us);
        }
    } else {
        att->field_ok_us = 0u;
    }

    if (field_fits(att, h_q16, v_q16, att->other_h_q16, att->other_v_q16)) {
        track_field(&att->other_h_q16, &att->other_v_q16, h_q16, v_q16, dt_us);
        if (largest(att->rate_q24) > (uint32_t)MOTION_MIN_Q24) { att->other_us = add_sat_u32(att->other_us, dt_us); }
        if (!fits && (!known || (att->other_us >= FIELD_NEW_US))) {
            att->field_h_q16 = att->other_h_q16;
            att->field_v_q16 = att->other_v_q16;
            att->field_ok_us = FIELD_SETTLE_US;
        }
    } else {
        att->other_us = 0u;
        att->other_h_q16 = h_q16;
        att->other_v_q16 = v_q16;
    }
    return !fits && known;
}

static void correct_heading(evs_attitude_t *att, uint32_t dt_us)
{
    const evs_vec3_t m = att->mag_lp_q16;
    const uint64_t hh_q32 = (uint64_t)((int64_t)m.x * m.x) + (uint64_t)((int64_t)m.y * m.y);
    int32_t gain_q24 = att->w_mag_q24;
    if (att->cfg.reject_mag) {
        const bool disturbed = field_is_disturbed(att, (int32_t)evs_sqrt_u64(hh_q32), m.z, dt_us);
        set_flag(att, EVS_ATTITUDE_MAG_DISTURBED, disturbed);
        if (att->field_ok_us >= FIELD_SETTLE_US) { /* trust comes back twice as fast as it went */
            att->field_bad_us = (att->field_bad_us > 2u * dt_us) ? att->field_bad_us - 2u * dt_us : 0u;
        } else if (att->field_bad_us < FIELD_REJECT_US) {
            att->field_bad_us += dt_us;
            gain_q24 = 0;
        } else {
            gain_q24 /= 2;
        }
    }
    const int32_t off = (int32_t)((uint32_t)evs_atan2(m.x, m.y) - (uint32_t)att->cfg.declination);
    const int32_t turns_q24 = evs_mul_hi(off, gain_q24);                              /* turns per second */
    att->correct_q24.z = evs_sat32(evs_shr_r64((int64_t)turns_q24 * 1686629713, 28)); /* 2 pi in Q28 */
}

void evs_attitude_push_mag(evs_attitude_t *att, uint32_t t_us, evs_vec3_t field_ut_q16)
{
    EVS_ASSERT(att != NULL);
    const uint32_t size_q16 = largest(field_ut_q16);
    const bool bad = (size_q16 == 0u) || (size_q16 > UINT32_C(4096) << 16);
    set_flag(att, EVS_ATTITUDE_MAG_BAD, bad);
    if (bad) {
        evs_count(&att->faults.n_mag_bad);
        return;
    }
    uint32_t dt_us = advance(att, &att->t_mag_us, &att->n_time_back[2], t_us, SEEN_MAG);
    if (dt_us > TRIM_STEP_US) { dt_us = TRIM_STEP_US; }
    if ((att->cfg.mode == EVS_ATTITUDE_GYRO_ONLY) || !has_flag(att, EVS_ATTITUDE_TILT_KNOWN)) { return; }

    const evs_vec3_t world_q16 = evs_quat_rotate(att->q, field_ut_q16);
    if (!has_flag(att, EVS_ATTITUDE_HEADING_KNOWN)) {
        turn_heading(att, (int32_t)((uint32_t)evs_atan2(world_q16.x, world_q16.y) - (uint32_t)att->cfg.declination));
        att->mag_lp_q16 = evs_quat_rotate(att->q, field_ut_q16);
        att->field_bad_us = FIELD_REJECT_US; /* nothing to compare with yet: half a gain rather than none */
        set_flag(att, EVS_ATTITUDE_HEADING_KNOWN, true);
        if (att->cfg.mode == EVS_ATTITUDE_FILTER) {
            att->w_mag_q24 = GAIN_MAX_Q24 / 16; /* 8 1/s: relaxes from there */
            set_flag(att, EVS_ATTITUDE_RECOVERING, true);
        }
        return;
    }
    if ((att->mag_lp_q16.x | att->mag_lp_q16.y | att->mag_lp_q16.z) == 0) { /* the orientation was given */
        att->mag_lp_q16 = world_q16;
        att->field_bad_us = FIELD_REJECT_US;
    }
    if (dt_us == 0u) { return; }
    if (att->cfg.mode == EVS_ATTITUDE_VALENTI) {
        valenti_mag(att, world_q16, dt_us);
        return;
    }
    const int32_t gain = (int32_t)(dt_us * 10737u); /* Q31 of dt / 0.2 s: at most one half */
    att->mag_lp_q16.x += evs_q_mul(world_q16.x - att->mag_lp_q16.x, gain, 31);
    att->mag_lp_q16.y += evs_q_mul(world_q16.y - att->mag_lp_q16.y, gain, 31);
    att->mag_lp_q16.z += evs_q_mul(world_q16.z - att->mag_lp_q16.z, gain, 31);
    correct_heading(att, dt_us);
}

/* ---- set up, and the rest of the interface ---- */

evs_attitude_config_t evs_attitude_config_default(void)
{
    const evs_attitude_config_t cfg = {.mode = EVS_ATTITUDE_FILTER,
                                       .tau_accel_ms = 3000u,
                                       .tau_mag_ms = 15000u,
                                       .tau_recover_ms = 600u,
                                       .gap_max_ms = 250u,
                                       .accel_max_m_s2 = 400u,
                                       .rest_time_ms = 1500u,
                                       .rest_gyro_mrad_s = 35u,
                                       .rest_accel_mm_s2 = 500u,
                                       .bias_max_mrad_s = 100u,
                                       .mag_tolerance_permille = 120u,
                                       .learn_bias = true,
                                       .reject_mag = true};
    return cfg;
}

static bool within(uint32_t v, uint32_t lo, uint32_t hi) { return (v >= lo) && (v <= hi); }

static bool config_is_valid(const evs_attitude_config_t *cfg)
{
    const bool mode_ok = (cfg->mode == EVS_ATTITUDE_FILTER) || (cfg->mode == EVS_ATTITUDE_GYRO_ONLY) ||
                         (cfg->mode == EVS_ATTITUDE_VALENTI);
    const bool limit_ok = (cfg->gyro_limit_rad_s_q24 == 0) || (cfg->gyro_limit_rad_s_q24 >= (INT32_C(1) << 24));
    return mode_ok && limit_ok && within(cfg->tau_accel_ms, 100u, 60000u) && within(cfg->tau_mag_ms, 100u, 60000u) &&
           within(cfg->tau_recover_ms, 50u, 10000u) && within(cfg->gap_max_ms, 20u, 1000u) &&
           within(cfg->accel_max_m_s2, 20u, 2000u) && within(cfg->rest_time_ms, 200u, 30000u) &&
           within(cfg->rest_gyro_mrad_s, 1u, 1000u) && within(cfg->rest_accel_mm_s2, 10u, 10000u) &&
           within(cfg->bias_max_mrad_s, 1u, 500u) && within(cfg->mag_tolerance_permille, 10u, 1000u);
}

evs_status_t evs_attitude_init(evs_attitude_t *att, const evs_attitude_config_t *cfg)
{
    if ((att == NULL) || (cfg == NULL)) { return EVS_ERR_NULL; }
    if (!config_is_valid(cfg)) { return EVS_ERR_ARG; }
    att->cfg = *cfg;
    evs_attitude_reset(att);
    return EVS_OK;
}

void evs_attitude_reset(evs_attitude_t *att)
{
    EVS_ASSERT(att != NULL);
    const evs_attitude_config_t cfg = att->cfg;
    *att = (evs_attitude_t){.cfg = cfg,
                            .q = evs_quat_identity(),
                            .gravity_q24 = GRAVITY_Q24,
                            .w_accel_q24 = corner_q24(cfg.tau_accel_ms),
                            .w_mag_q24 = per_second_q24(cfg.tau_mag_ms),
                            .bias_gain_q24 = BIAS_GAIN_0_Q24};
}

evs_status_t evs_attitude_set_orientation(evs_attitude_t *att, evs_quat_t q_wi)
{
    EVS_ASSERT(att != NULL);
    evs_quat_t unit;
    if (evs_quat_normalize(q_wi, &unit) != EVS_OK) { return EVS_ERR_NUMERIC; }
    att->q = unit;
    att->correct_q24 = (evs_vec3_t){0, 0, 0};
    att->slope_q24 = (evs_vec3_t){0, 0, 0};
    att->mag_lp_q16 = (evs_vec3_t){0, 0, 0};
    att->gravity_q24 = GRAVITY_Q24;
    att->w_accel_q24 = corner_q24(att->cfg.tau_accel_ms);
    att->w_mag_q24 = per_second_q24(att->cfg.tau_mag_ms);
    set_flag(att, EVS_ATTITUDE_SETTLING | EVS_ATTITUDE_RECOVERING, false);
    set_flag(att, EVS_ATTITUDE_TILT_KNOWN | EVS_ATTITUDE_HEADING_KNOWN, true);
    return EVS_OK;
}

evs_quat_t evs_attitude_orientation(const evs_attitude_t *att) { return att->q; }

evs_vec3_t evs_attitude_rate(const evs_attitude_t *att) { return att->rate_q24; }

evs_vec3_t evs_attitude_bias(const evs_attitude_t *att)
{
    const evs_vec3_t bias_q24 = {evs_shr_r(att->bias_q30.x, 6), evs_shr_r(att->bias_q30.y, 6),
                                 evs_shr_r(att->bias_q30.z, 6)};
    return bias_q24;
}

evs_status_t evs_attitude_set_bias(evs_attitude_t *att, evs_vec3_t bias_rad_s_q24)
{
    EVS_ASSERT(att != NULL);
    if (largest(bias_rad_s_q24) > att->cfg.bias_max_mrad_s * UINT32_C(16778)) { return EVS_ERR_ARG; }
    att->bias_q30 = (evs_vec3_t){bias_rad_s_q24.x * 64, bias_rad_s_q24.y * 64, bias_rad_s_q24.z * 64};
    att->bias_step_q31 = 3 * BIAS_STEP_Q31; /* it may have been another day */
    set_flag(att, EVS_ATTITUDE_BIAS_KNOWN, true);
    return EVS_OK;
}

uint32_t evs_attitude_flags(const evs_attitude_t *att) { return att->flags & PUBLIC_FLAGS; }

bool evs_attitude_at_rest(const evs_attitude_t *att) { return has_flag(att, EVS_ATTITUDE_AT_REST); }

evs_attitude_faults_t evs_attitude_faults(const evs_attitude_t *att) { return att->faults; }
