/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_attitude_private.h"

/* --- constants ------------------------------------------------------------------------------------------------- */

#define TRIM_STEP_US    100000u   /* Longest step of a correction: a slower sensor is treated as if at this rate. */
#define STALE_US        500000    /* A correction older than this is not applied any more. */
#define RELEARN_US      60000000u /* Stillness after which even a bias far from the old one is believed. */
#define FIELD_FIRST_US  3000000u  /* The undisturbed field is the first one that lasts so long; */
#define FIELD_SETTLE_US 500000u   /* it must be back for so long before it is believed again; */
#define FIELD_REJECT_US 60000000u /* another is ignored for no longer than this */
#define FIELD_NEW_US    20000000u /* and becomes the undisturbed one after so long in motion. */
#define RUN_OF_EQUALS   3u        /* As many equal samples at the largest rate seen are a clipped gyro. */
#define TIME_BACK_MAX   8u        /* As many samples of a time that runs back are a restarted clock. */

#define RATE_MAX_Q24   INT32_C(2130706432) /* 127 rad/s: room for the bias */
#define ONE_Q60        (INT64_C(1) << 60)
#define INV_6_Q32      INT32_C(715827883)
#define INV_24_Q32     INT32_C(178956971)
#define INV_120_Q32    INT32_C(35791394)
#define INV_720_Q32    INT32_C(5965232)
#define NORM_DONE_Q32  UINT32_C(65536)    /* 1.5e-5: the step of Newton that follows it leaves 3e-10 */
#define SMALL_TURN     UINT32_C(1124)     /* 2^32 rad us in Q24: 0.288 rad, and 1/4 rad of half the rotation */
#define BIAS_LIMIT_Q24 UINT32_C(8388608)  /* 0.5 rad/s: no bias is larger */
#define CLIP_MIN_Q24   UINT32_C(72142029) /* 4.3 rad/s: no gyro has a smaller full scale */
#define SPIKE_Q23      UINT32_C(83886080) /* 10 rad/s from one sample to the next */
#define FAST_Q24       UINT32_C(75497472) /* 4.5 rad/s: below half of that, whatever the bias */
#define MOTION_MIN_Q24 UINT32_C(5856276)  /* 20 deg/s: a new field is only judged while the carrier turns */
#define SHOCK_Q20      UINT32_C(62914560) /* 60 m/s^2 in a single sample */
#define ACCEL_DRIFT_Q7 UINT32_C(6)        /* 0.05 m/s^2: how far gravity may wander in the IMU while it rests */
#define GRAVITY_Q24    INT32_C(164528285) /* 9.80665 m/s^2 */
#define GRAVITY_MIN_Q24                                                                                                \
    INT32_C(33554432) /* 2 m/s^2: less counts as this much, so that the horizon is found from anywhere */
#define FIELD_MAX_Q16    (UINT32_C(4096) << 16) /* uT; keeps the rotation within 32 bits */
#define GAIN_MAX_Q24     INT32_C(2130706432)    /* 127 1/s */
#define CORRECT_MAX_Q24  INT32_C(268435456)     /* 16 rad/s: 0.16 rad of half a rotation in the longest step */
#define FIRST_MAG_Q24    INT32_C(134217728)     /* 8 1/s: how quickly the heading follows at first */
#define REST_GAIN_Q32    12271u                 /* per us: running means of the rest detector, 0.35 s */
#define BIAS_PERIOD_LOG2 14                     /* us: the bias is learnt every 16 ms, */
#define BIAS_REST_Q31    INT32_C(8796093)       /* and follows with 4 s */
#define BIAS_MOTION_Q31  43u                    /* per us: 0.02 of the correction is put down to bias before any rest */
#define BIAS_STEP_Q31    INT32_C(4294967)       /* 2 mrad/s: a rate further off the bias is a slow turn; */
#define BIAS_DRIFT_Q20   78812u                 /* per us: 35 urad/s^2 of drift are allowed in between */
#define MAG_GAIN_Q32     21474u                 /* per us: mean of the field, 0.2 s */
#define FIELD_GAIN_Q32   215u                   /* per us: the undisturbed field, 20 s */

/* --- time ------------------------------------------------------------------------------------------------------ */

/* Time since the last sample of this sensor; 0 for the first one and for one that has to be left out. */
static uint32_t advance(evs_attitude_t *att, uint32_t *last_us, uint8_t *n_back, uint32_t now_us, uint32_t seen)
{
    const int32_t dt_us = evs_time_diff_us(now_us, *last_us);
    if (!has_flag(att, seen)) {
        set_flag(att, seen, true);
        *last_us = now_us;
        return 0u;
    }
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

/* --- rotations ------------------------------------------------------------------------------------------------- */

/* A small rotation as half its vector, Q32; a wide one (beyond half a radian) as its vector, Q28. */
typedef struct {
    evs_vec3_t v;
    int32_t scale; /* of the time it took: what takes rad/s in Q24 to rad in Q28 */
    bool wide;
} rotation_t;

/* 16 dt / 10^6 in Q32, dt <= STEP_MAX_US: what takes rad/s in Q24 to rad in Q28. 2^32 16 / 10^6 = 68719 + 31243 / 2^16.
 */
static int32_t rotation_scale(uint32_t dt_us) { return (int32_t)(dt_us * 68719u + ((dt_us * 31243u) >> 16)); }

static int32_t half_angle_q32(int32_t rate_q24, int32_t scale) { return upper29(mac(0, rate_q24, scale)); }

/* The rotation by a constant rate for dt <= STEP_MAX_US; size = largest component. */
static rotation_t rotation_of(evs_vec3_t rate_q24, uint32_t size, uint32_t dt_us)
{
    const int32_t scale = rotation_scale(dt_us);
    rotation_t r;
    r.scale = scale;
    r.wide = (((uint64_t)size * dt_us) >> 32) > SMALL_TURN;
    if (r.wide) {
        r.v.x = fraction(rate_q24.x, scale);
        r.v.y = fraction(rate_q24.y, scale);
        r.v.z = fraction(rate_q24.z, scale);
    } else {
        r.v.x = half_angle_q32(rate_q24.x, scale);
        r.v.y = half_angle_q32(rate_q24.y, scale);
        r.v.z = half_angle_q32(rate_q24.z, scale);
    }
    return r;
}

/* (1 - |q|^2) / 2 in Q32, to the nearest 2^-29. |q| within 0.5 of 1. */
static int32_t norm_defect(evs_quat_t q)
{
    return upper(mac(mac(mac(mac(ONE_Q60 + HALF_Q32, q.w, -q.w), q.x, -q.x), q.y, -q.y), q.z, -q.z)) * 8;
}

/* One step of Newton: what is left is 1.5 e^2. */
static evs_quat_t plus_fraction(evs_quat_t q, int32_t e_q32)
{
    const evs_quat_t r = {q.w + fraction(q.w, e_q32), q.x + fraction(q.x, e_q32), q.y + fraction(q.y, e_q32),
                          q.z + fraction(q.z, e_q32)};
    return r;
}

evs_quat_t evs_attitude_renormalized(evs_quat_t q)
{
    int32_t e_q32 = norm_defect(q);
    q = plus_fraction(q, e_q32);
    for (int step = 0; (step < 3) && (evs_abs_u32(e_q32) >= NORM_DONE_Q32); step++) {
        e_q32 = norm_defect(q);
        q = plus_fraction(q, e_q32);
    }
    return q;
}

/* q in Q62, so that its upper word is q, and half an LSB of it. */
static int64_t wide_half(int32_t q) { return (int64_t)(((uint64_t)(uint32_t)q << 32) | (uint64_t)HALF_Q32); }

/*
 * Turn the estimate by r, seen in the IMU, and by the correction due meanwhile, seen in the world:
 * q' = q + q d + c q with d = exp(r) - 1 and c half the correction's vector, |c| <= 0.16; the product of the two
 * small ones is left out. The series of d reach 2^-32 for |r| / 2 <= 1/4 rad, up to 2^-26 at its end.
 */
static void turn(evs_attitude_t *att, const rotation_t *r)
{
    evs_vec3_t h = r->v;
    if (r->wide) {
        att->q = evs_quat_mul(att->q, evs_quat_from_rotvec(r->v));
        h = (evs_vec3_t){0, 0, 0};
    }
    const evs_quat_t q = att->q;
    const int32_t u = upper(mac(mac(mac(0, h.x, h.x), h.y, h.y), h.z, h.z)); /* Q32, at most 1/16 */
    const int32_t u2 = fraction_down(u, u);
    const int32_t dw = fraction_down(u2, INV_24_Q32) - fraction_down(fraction_down(u2, u), INV_720_Q32) - (u >> 1);
    const int32_t s = fraction_down(u2, INV_120_Q32) - fraction_down(u, INV_6_Q32); /* sin(x) / x - 1 */
    const int32_t dx = h.x + fraction_down(h.x, s), dy = h.y + fraction_down(h.y, s), dz = h.z + fraction_down(h.z, s);

    const int32_t scale = r->scale;
    const int32_t cx = half_angle_q32(att->correct_q24.x, scale);
    const int32_t cy = half_angle_q32(att->correct_q24.y, scale);
    const int32_t cz = half_angle_q32(att->correct_q24.z, scale);
    const int32_t px = dx + cx, py = dy + cy, pz = dz + cz;
    const int32_t mx = dx - cx, my = dy - cy, mz = dz - cz;

    const int64_t w = mac(mac(mac(mac(wide_half(q.w), q.w, dw), q.x, -px), q.y, -py), q.z, -pz);
    const int64_t x = mac(mac(mac(mac(wide_half(q.x), q.x, dw), q.w, px), q.y, mz), q.z, -my);
    const int64_t y = mac(mac(mac(mac(wide_half(q.y), q.y, dw), q.w, py), q.z, mx), q.x, -mz);
    const int64_t z = mac(mac(mac(mac(wide_half(q.z), q.z, dw), q.w, pz), q.x, my), q.y, -mx);
    const evs_quat_t next = {upper(w), upper(x), upper(y), upper(z)};
    const int32_t e_q32 = norm_defect(next);
    att->q = plus_fraction(next, e_q32);
    if (evs_abs_u32(e_q32) >= NORM_DONE_Q32) { att->q = evs_attitude_renormalized(att->q); }
}

/* v, of any size, seen from the world: with two fractional bits less, so that it always fits. */
static evs_vec3_t seen_from_world(evs_quat_t q, evs_vec3_t v)
{
    /* v + 2 w t + 2 u x t with t = u x v and u the vector part. */
    const int32_t tx = upper(mac(mac(HALF_Q32, q.y, v.z), -q.z, v.y));
    const int32_t ty = upper(mac(mac(HALF_Q32, q.z, v.x), -q.x, v.z));
    const int32_t tz = upper(mac(mac(HALF_Q32, q.x, v.y), -q.y, v.x));
    const evs_vec3_t r = {(v.x >> 2) + upper29(mac(mac(mac(0, q.w, tx), q.y, tz), -q.z, ty)),
                          (v.y >> 2) + upper29(mac(mac(mac(0, q.w, ty), q.z, tx), -q.x, tz)),
                          (v.z >> 2) + upper29(mac(mac(mac(0, q.w, tz), q.x, ty), -q.y, tx))};
    return r;
}

evs_quat_t evs_attitude_levelling(evs_vec3_t up)
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

evs_quat_t evs_attitude_about_vertical(int32_t angle)
{
    int32_t sin_q30, cos_q30;
    evs_sincos(angle / 2, &sin_q30, &cos_q30);
    const evs_quat_t turn = {cos_q30, 0, 0, sin_q30};
    return turn;
}

/* --- time constants that shorten and grow back ----------------------------------------------------------------- */

/* Towards `target` by dt / 2^log2_us, at most all the way. */
static int32_t raised(int32_t w_q24, int32_t target_q24, uint32_t dt_us, unsigned log2_us)
{
    if (w_q24 >= target_q24) { return w_q24; }
    const int64_t next = w_q24 + ((((int64_t)target_q24 - w_q24) * (int64_t)dt_us) >> log2_us);
    return (next > target_q24) ? target_q24 : (int32_t)next;
}

static void recover(evs_attitude_t *att, uint32_t dt_us, unsigned log2_us)
{
    if (att->cfg.mode != EVS_ATTITUDE_FILTER) { return; }
    const int32_t target_q24 = per_second_q24(att->cfg.tau_recover_ms);
    if (!has_flag(att, EVS_ATTITUDE_SETTLING)) {
        att->w_accel_q24 = raised(att->w_accel_q24, target_q24, dt_us, log2_us);
    }
    att->w_mag_q24 = raised(att->w_mag_q24, target_q24, dt_us, log2_us);
    set_flag(att, EVS_ATTITUDE_RECOVERING, true);
}

/* tau grows by dt / 2^halvings: d(1 / tau) = -(1 / tau)^2 dt / 2^halvings. */
static int32_t relaxed(int32_t w_q24, int32_t final_q24, uint32_t dt_us, unsigned halvings)
{
    if (w_q24 <= final_q24) { return final_q24; }
    const int32_t next_q24 = w_q24 - (int32_t)(((int64_t)w_q24 * gain_q31(w_q24, dt_us)) >> (31u + halvings)) - 1;
    return (next_q24 < final_q24) ? final_q24 : next_q24;
}

static void relax(evs_attitude_t *att, uint32_t dt_us)
{
    const int32_t accel_q24 = per_second_q24(att->cfg.tau_accel_ms);
    const int32_t mag_q24 = per_second_q24(att->cfg.tau_mag_ms);
    if (!has_flag(att, EVS_ATTITUDE_SETTLING)) { att->w_accel_q24 = relaxed(att->w_accel_q24, accel_q24, dt_us, 0u); }
    att->w_mag_q24 = relaxed(att->w_mag_q24, mag_q24, dt_us, 1u); /* slower than 1 / t: newer headings weigh more */
    if ((att->w_accel_q24 == accel_q24) && (att->w_mag_q24 == mag_q24)) {
        set_flag(att, EVS_ATTITUDE_RECOVERING, false);
    }
}

/* --- gyro: rest and bias --------------------------------------------------------------------------------------- */

/* Called every 2^BIAS_PERIOD_LOG2 us of rest. */
static void learn_bias_at_rest(evs_attitude_t *att)
{
    const evs_vec3_t off_q24 = {att->gyro_lp_q24.x - (att->bias_q30.x >> 6),
                                att->gyro_lp_q24.y - (att->bias_q30.y >> 6),
                                att->gyro_lp_q24.z - (att->bias_q30.z >> 6)};
    const bool known = has_flag(att, EVS_ATTITUDE_BIAS_KNOWN);
    const uint32_t off = largest(off_q24);
    if (known && (off > (uint32_t)att->bias_step_q31 >> 7) && (att->rest_us < RELEARN_US)) { return; }

    /* The running mean as it is where it is news, refined where it is not. */
    const int32_t gain = (known && (off <= (uint32_t)BIAS_STEP_Q31 >> 7)) ? BIAS_REST_Q31 : INT32_MAX;
    att->bias_q30.x += fraction(off_q24.x * 128, gain);
    att->bias_q30.y += fraction(off_q24.y * 128, gain);
    att->bias_q30.z += fraction(off_q24.z * 128, gain);
    att->bias_step_q31 = BIAS_STEP_Q31;
    set_flag(att, EVS_ATTITUDE_BIAS_KNOWN, true);
}

static int32_t follow(int32_t *mean, int32_t x, int32_t gain_q32)
{
    const int32_t off = x - *mean;
    *mean += fraction(off, gain_q32);
    return off;
}

static void watch_gyro(evs_attitude_t *att, evs_vec3_t raw_q24, uint32_t size, uint32_t dt_us)
{
    const uint32_t still_q24 = att->cfg.rest_gyro_mrad_s * UINT32_C(16777);
    const uint32_t bias_max_q24 = att->cfg.bias_max_mrad_s * UINT32_C(16777);
    const bool moving = size > still_q24 + bias_max_q24;
    bool still = false;
    if (!moving && has_flag(att, MOVING)) { att->gyro_lp_q24 = raw_q24; } /* quiet again: start from here */
    if (!moving) {
        const int32_t gain_q32 = (int32_t)(dt_us * REST_GAIN_Q32);
        const evs_vec3_t off = {follow(&att->gyro_lp_q24.x, raw_q24.x, gain_q32),
                                follow(&att->gyro_lp_q24.y, raw_q24.y, gain_q32),
                                follow(&att->gyro_lp_q24.z, raw_q24.z, gain_q32)};
        still = all_within(off, still_q24) && all_within(att->gyro_lp_q24, bias_max_q24) && has_flag(att, ACCEL_STEADY);
    }
    const uint32_t before_us = att->rest_us;
    att->rest_us = still ? add_sat_u32(before_us, dt_us) : 0u;
    const bool rest = att->rest_us >= att->cfg.rest_time_ms * UINT32_C(1000);
    att->flags &= ~(MOVING | EVS_ATTITUDE_AT_REST);
    if (moving) { att->flags |= MOVING; }
    if (rest) {
        att->flags |= EVS_ATTITUDE_AT_REST;
        const bool due = ((att->rest_us ^ before_us) >> BIAS_PERIOD_LOG2) != 0u;
        if (due && att->cfg.learn_bias && (att->cfg.mode != EVS_ATTITUDE_VALENTI)) { learn_bias_at_rest(att); }
    } else if (att->bias_step_q31 < (INT32_C(1) << 30)) {
        att->bias_step_q31 += (int32_t)((dt_us * BIAS_DRIFT_Q20) >> 20);
    }
}

/* --- gyro: integration ----------------------------------------------------------------------------------------- */

/* Is this sample clipped? Either the limit is given, or it shows as the largest value seen, repeating unchanged. */
static bool is_clipped(evs_attitude_t *att, uint32_t size)
{
    if (att->cfg.gyro_limit_rad_s_q24 != 0) { return size >= (uint32_t)att->cfg.gyro_limit_rad_s_q24; }
    if (size > att->gyro_max_q24) {
        att->gyro_max_q24 = size;
        att->n_repeats = 1u;
        return false;
    }
    if ((size < att->gyro_max_q24) || (size < CLIP_MIN_Q24)) {
        if (att->n_repeats < RUN_OF_EQUALS) { att->n_repeats = 0u; } /* once found, the limit stays found */
        return false;
    }
    if (att->n_repeats < RUN_OF_EQUALS) { att->n_repeats++; }
    return att->n_repeats >= RUN_OF_EQUALS;
}

static evs_vec3_t mean_of(evs_vec3_t a, evs_vec3_t b)
{
    const evs_vec3_t m = {(a.x >> 1) + (b.x >> 1), (a.y >> 1) + (b.y >> 1), (a.z >> 1) + (b.z >> 1)};
    return m;
}

/* Half the difference, which always fits. */
static evs_vec3_t half_diff(evs_vec3_t a, evs_vec3_t b)
{
    const evs_vec3_t d = {(a.x >> 1) - (b.x >> 1), (a.y >> 1) - (b.y >> 1), (a.z >> 1) - (b.z >> 1)};
    return d;
}

/* Constant rate over any time: full steps, then the rest. */
static void bridge(evs_attitude_t *att, evs_vec3_t rate_q24, uint32_t dt_us)
{
    while (dt_us > 0u) {
        const uint32_t step_us = min_u32(dt_us, STEP_MAX_US);
        const rotation_t r = rotation_of(rate_q24, largest(rate_q24), step_us);
        turn(att, &r);
        dt_us -= step_us;
    }
}

/*
 * A lone sample far off both neighbours is a glitch: replace what it turned by the mean of the neighbours. The sample
 * on trial is att->rate_q24. Returns whether it was one.
 */
static bool take_back_spike(evs_attitude_t *att, evs_vec3_t rate_q24)
{
    const evs_vec3_t before_q24 = {att->rate_before_q8[0] * 65536, att->rate_before_q8[1] * 65536,
                                   att->rate_before_q8[2] * 65536};
    const uint32_t jump = largest(half_diff(att->rate_q24, before_q24));
    if (largest(half_diff(rate_q24, before_q24)) > jump / 4u) { return false; }
    const evs_vec3_t spike_q24 = {-att->rate_q24.x, -att->rate_q24.y, -att->rate_q24.z};
    const evs_vec3_t mean_q24 = mean_of(before_q24, rate_q24);
    const evs_vec3_t correct_q24 = att->correct_q24;
    att->correct_q24 = (evs_vec3_t){0, 0, 0};
    bridge(att, spike_q24, att->dt_newest_us);
    bridge(att, mean_q24, att->dt_newest_us);
    att->correct_q24 = correct_q24;
    evs_count(&att->faults.n_gyro_spikes);
    return true;
}

static void look_for_spike(evs_attitude_t *att, evs_vec3_t rate_q24, uint32_t size)
{
    if (has_flag(att, SPIKE_SUSPECT)) {
        set_flag(att, SPIKE_SUSPECT, false);
        if (take_back_spike(att, rate_q24)) {
            att->rate_q24 = rate_q24; /* as the rate before the newest */
            set_flag(att, FAST, size > FAST_Q24);
            return;
        }
    }
    const bool was_fast = has_flag(att, FAST); /* two slow samples cannot be far apart */
    set_flag(att, FAST, size > FAST_Q24);
    if ((was_fast || (size > FAST_Q24)) && (largest(half_diff(rate_q24, att->rate_q24)) > SPIKE_Q23)) {
        set_flag(att, SPIKE_SUSPECT, true);
        att->rate_before_q8[0] = (int16_t)(att->rate_q24.x >> 16);
        att->rate_before_q8[1] = (int16_t)(att->rate_q24.y >> 16);
        att->rate_before_q8[2] = (int16_t)(att->rate_q24.z >> 16);
    }
}

/* A sensor that fell silent must not go on turning the estimate. */
static void drop_stale_corrections(evs_attitude_t *att)
{
    if (evs_time_diff_us(att->t_gyro_us, att->t_accel_us) > STALE_US) {
        att->correct_q24.x = 0;
        att->correct_q24.y = 0;
        att->flags &= ~ACCEL_STEADY;
    }
    if (evs_time_diff_us(att->t_gyro_us, att->t_mag_us) > STALE_US) { att->correct_q24.z = 0; }
}

/* One gyro sample of either kind. */
typedef struct {
    evs_vec3_t raw_q24;  /* rate as measured, rad/s */
    evs_vec3_t rate_q24; /* less bias */
    rotation_t r;        /* what it tells: the rotation of the last dt_us, less bias */
    uint32_t size;       /* largest component of raw_q24 */
    uint32_t dt_us;      /* at most STEP_MAX_US */
    uint32_t since_us;   /* gone by since the sample before: what lies between is bridged by the mean of both rates */
} gyro_sample_t;

static void gyro_step(evs_attitude_t *att, const gyro_sample_t *g)
{
    const uint32_t trim_us = min_u32(g->since_us, STEP_MAX_US);
    const bool clipped = is_clipped(att, g->size);
    set_flag(att, EVS_ATTITUDE_GYRO_SATURATED, clipped);
    if (clipped) {
        evs_count(&att->faults.n_gyro_saturated);
        recover(att, trim_us, 15); /* within about 33 ms */
    }
    look_for_spike(att, g->rate_q24, g->size);
    drop_stale_corrections(att);

    if (g->since_us > att->cfg.gap_max_ms * UINT32_C(1000)) {
        evs_count(&att->faults.n_gyro_gaps);
        recover(att, 1u, 0);
        att->rest_us = 0u;
    } else {
        if (g->since_us > g->dt_us) { bridge(att, mean_of(att->rate_q24, g->rate_q24), g->since_us - g->dt_us); }
        turn(att, &g->r);
        watch_gyro(att, g->raw_q24, g->size, trim_us);
        if (att->cfg.learn_bias && (att->cfg.mode == EVS_ATTITUDE_VALENTI)) {
            evs_attitude_valenti_bias(att, g->rate_q24, trim_us);
        }
    }
    att->rate_q24 = g->rate_q24;
    att->dt_newest_us = (uint16_t)g->dt_us;
    if (has_flag(att, EVS_ATTITUDE_RECOVERING)) { relax(att, trim_us); }
}

/* The rate with room for the bias, and less it. */
static void set_rate(gyro_sample_t *g, const evs_attitude_t *att, evs_vec3_t rate_q24)
{
    g->size = largest(rate_q24);
    if (g->size > (uint32_t)RATE_MAX_Q24) {
        rate_q24.x = evs_clamp(rate_q24.x, -RATE_MAX_Q24, RATE_MAX_Q24);
        rate_q24.y = evs_clamp(rate_q24.y, -RATE_MAX_Q24, RATE_MAX_Q24);
        rate_q24.z = evs_clamp(rate_q24.z, -RATE_MAX_Q24, RATE_MAX_Q24);
    }
    g->raw_q24 = rate_q24;
    g->rate_q24.x = rate_q24.x - (att->bias_q30.x >> 6);
    g->rate_q24.y = rate_q24.y - (att->bias_q30.y >> 6);
    g->rate_q24.z = rate_q24.z - (att->bias_q30.z >> 6);
}

void evs_attitude_push_gyro(evs_attitude_t *att, uint32_t t_us, evs_vec3_t rate_rad_s_q24)
{
    EVS_ASSERT(att != NULL);
    const bool first = !has_flag(att, SEEN_GYRO);
    gyro_sample_t g;
    set_rate(&g, att, rate_rad_s_q24);
    g.since_us = advance(att, &att->t_gyro_us, &att->n_time_back[0], t_us, SEEN_GYRO);
    if (first) { att->rate_q24 = g.rate_q24; }
    if (g.since_us == 0u) { return; }

    /* The usual interval follows slowly, upwards very slowly: a longer one is taken as a loss of samples. */
    uint32_t usual_us = att->dt_gyro_us;
    g.dt_us = g.since_us;
    if (usual_us == 0u) {
        usual_us = g.since_us;
    } else if (g.since_us <= usual_us + usual_us / 2u) {
        usual_us += (g.since_us + 4u) / 8u - usual_us / 8u;
    } else {
        g.dt_us = usual_us;
        usual_us += usual_us / 32u + 1u;
    }
    att->dt_gyro_us = (uint16_t)min_u32(usual_us, STEP_MAX_US);
    g.dt_us = min_u32(g.dt_us, STEP_MAX_US);
    g.r = rotation_of(g.rate_q24, g.size + BIAS_LIMIT_Q24, g.dt_us);
    gyro_step(att, &g);
}

void evs_attitude_push_delta_angle(evs_attitude_t *att, uint32_t t_us, evs_vec3_t angle_rad_q30, uint32_t dt_us)
{
    EVS_ASSERT(att != NULL);
    if ((dt_us < EVS_ATTITUDE_DELTA_MIN_US) || (dt_us > EVS_ATTITUDE_DELTA_MAX_US)) {
        evs_count(&att->faults.n_time_bad);
        return;
    }
    /* The rate is the angle over the time: 10^6 / 2^6 / dt in Q24, by the reciprocal. */
    unsigned shift;
    const uint32_t inverse = evs_recip_u32(dt_us, &shift);
    const int64_t per_us_q20 = (int64_t)(((uint64_t)inverse * 15625u) >> (shift - 20u));
    const evs_vec3_t rate_q24 = {evs_sat32(evs_shr_r64(angle_rad_q30.x * per_us_q20, 20)),
                                 evs_sat32(evs_shr_r64(angle_rad_q30.y * per_us_q20, 20)),
                                 evs_sat32(evs_shr_r64(angle_rad_q30.z * per_us_q20, 20))};
    const bool first = !has_flag(att, SEEN_GYRO);
    gyro_sample_t g;
    set_rate(&g, att, rate_q24);
    g.dt_us = dt_us;
    g.since_us = advance(att, &att->t_gyro_us, &att->n_time_back[0], t_us, SEEN_GYRO);
    if (first) {
        att->rate_q24 = g.rate_q24;
        g.since_us = dt_us; /* an increment knows its own length */
    }
    if (g.since_us == 0u) { return; }
    if (g.since_us < dt_us + dt_us / 4u) { g.since_us = dt_us; } /* jitter of the time stamps */

    const int32_t scale = rotation_scale(dt_us);
    g.r.scale = scale;
    g.r.wide = largest(angle_rad_q30) > UINT32_C(300000000); /* 0.28 rad */
    if (g.r.wide) {
        g.r.v.x = evs_shr_r(angle_rad_q30.x >> 1, 1) - fraction(att->bias_q30.x >> 6, scale);
        g.r.v.y = evs_shr_r(angle_rad_q30.y >> 1, 1) - fraction(att->bias_q30.y >> 6, scale);
        g.r.v.z = evs_shr_r(angle_rad_q30.z >> 1, 1) - fraction(att->bias_q30.z >> 6, scale);
    } else { /* half of it in Q32 is twice it in Q30 */
        g.r.v.x = angle_rad_q30.x * 2 - half_angle_q32(att->bias_q30.x >> 6, scale);
        g.r.v.y = angle_rad_q30.y * 2 - half_angle_q32(att->bias_q30.y >> 6, scale);
        g.r.v.z = angle_rad_q30.z * 2 - half_angle_q32(att->bias_q30.z >> 6, scale);
    }
    gyro_step(att, &g);
}

/* --- accelerometer --------------------------------------------------------------------------------------------- */

static void watch_accel(evs_attitude_t *att, evs_vec3_t a_q20, uint32_t dt_us)
{
    evs_vec3_t *const mean = &att->accel_lp_q20;
    if (has_flag(att, MOVING)) {
        *mean = a_q20;
        att->flags &= ~ACCEL_STEADY;
        return;
    }
    const int32_t gain_q32 = (int32_t)(min_u32(dt_us, STEP_MAX_US) * REST_GAIN_Q32);
    const evs_vec3_t half_off = half_diff(a_q20, *mean);
    mean->x += fraction(half_off.x, 2 * gain_q32);
    mean->y += fraction(half_off.y, 2 * gain_q32);
    mean->z += fraction(half_off.z, 2 * gain_q32);

    /* Gravity must also keep its direction: a slow turn has a constant rate, but it carries gravity along. */
    bool steady = all_within(half_off, (att->cfg.rest_accel_mm_s2 * UINT32_C(1049)) / 2u);
    if (steady) {
        const evs_vec3_t wander_q7 = {(mean->x >> 13) - att->accel_ref_q7[0], (mean->y >> 13) - att->accel_ref_q7[1],
                                      (mean->z >> 13) - att->accel_ref_q7[2]};
        steady = all_within(wander_q7, ACCEL_DRIFT_Q7);
    }
    set_flag(att, ACCEL_STEADY, steady);
    if (!steady) {
        att->rest_us = 0u;
        att->accel_ref_q7[0] = evs_sat16(mean->x >> 13);
        att->accel_ref_q7[1] = evs_sat16(mean->y >> 13);
        att->accel_ref_q7[2] = evs_sat16(mean->z >> 13);
    }
}

static void start_tilt(evs_attitude_t *att, evs_vec3_t world_q18)
{
    evs_vec3_t up;
    if (evs_vec3_normalize(world_q18, &up) != EVS_OK) { return; } /* too small to have a direction */
    att->q = evs_attitude_renormalized(evs_quat_mul(evs_attitude_levelling(up), att->q));
    att->gravity_q24 = evs_sat32((int64_t)evs_sqrt_u64(evs_vec3_norm_sq(world_q18)) * 64);
    set_flag(att, EVS_ATTITUDE_TILT_KNOWN, true);
    if (att->cfg.mode == EVS_ATTITUDE_FILTER) {
        att->w_accel_q24 = GAIN_MAX_Q24;
        set_flag(att, EVS_ATTITUDE_SETTLING, true);
    }
}

/* The mean acceleration points down: half a turn puts it right at once, which a rate could not. */
static void turn_over(evs_attitude_t *att)
{
    const evs_quat_t over = {0, EVS_ONE_Q30, 0, 0};
    att->q = evs_attitude_renormalized(evs_quat_mul(over, att->q));
    att->gravity_q24 = evs_sub_sat(0, att->gravity_q24);
    att->slope_q24.y = evs_sub_sat(0, att->slope_q24.y);
    att->slope_q24.z = evs_sub_sat(0, att->slope_q24.z);
    att->mag_lp_q16.y = evs_sub_sat(0, att->mag_lp_q16.y);
    att->mag_lp_q16.z = evs_sub_sat(0, att->mag_lp_q16.z);
}

/* x + dx without overflow; quick where there is none. */
static int32_t plus_sat(int32_t x, int64_t dx)
{
    const int64_t sum = x + dx;
    if (sum == (int32_t)sum) { return (int32_t)sum; }
    return (sum < 0) ? INT32_MIN : INT32_MAX;
}

/*
 * Second-order low-pass of the acceleration a in the world, in state-variable form: tau mean' = slope,
 * tau slope' = 2 (a - mean - slope), a Butterworth with its corner at sqrt(2) / tau. The world is turned so that the
 * mean stays vertical, which leaves its length as the state; the rate of that turn is mean' / length.
 */
static void low_pass(evs_attitude_t *att, evs_vec3_t a_q18, uint32_t dt_us)
{
    evs_vec3_t *const s = &att->slope_q24;
    const int32_t g_q31 = gain_q31(att->w_accel_q24, dt_us);
    const int32_t ex_q18 = a_q18.x - (s->x >> 6);
    const int32_t ey_q18 = a_q18.y - (s->y >> 6);
    const int32_t ez_q18 = a_q18.z - (s->z >> 6) - (att->gravity_q24 >> 6);
    s->x = plus_sat(s->x, mac(INT64_C(1) << 23, ex_q18, g_q31) >> 24);
    s->y = plus_sat(s->y, mac(INT64_C(1) << 23, ey_q18, g_q31) >> 24);
    s->z = plus_sat(s->z, mac(INT64_C(1) << 23, ez_q18, g_q31) >> 24);
    att->gravity_q24 = plus_sat(att->gravity_q24, mac(INT64_C(1) << 30, s->z, g_q31) >> 31);
}

/* While settling: the plain mean of all accelerations so far, by a gain of 1 / elapsed time. */
static void average(evs_attitude_t *att, evs_vec3_t a_q18, uint32_t dt_us)
{
    const int32_t g_q31 = gain_q31(att->w_accel_q24, dt_us);
    const int64_t up_q18 = (int64_t)a_q18.z - (att->gravity_q24 >> 6);
    att->gravity_q24 = plus_sat(att->gravity_q24, (up_q18 * g_q31) >> 25);
    att->slope_q24.x = evs_sat32((int64_t)a_q18.x * 64);
    att->slope_q24.y = evs_sat32((int64_t)a_q18.y * 64);

    const int32_t final_q24 = per_second_q24(att->cfg.tau_accel_ms);
    att->w_accel_q24 = relaxed(att->w_accel_q24, final_q24, dt_us, 0u);
    if (att->w_accel_q24 == final_q24) {
        att->slope_q24.x = 0;
        att->slope_q24.y = 0;
        set_flag(att, EVS_ATTITUDE_SETTLING, false);
    }
}

/*
 * A lone acceleration far off, while the next one is near gravity, is a glitch: take its part out of the slope again.
 * Real shocks last, or swing back; and clipped samples must stay in.
 */
static void look_for_shock(evs_attitude_t *att, evs_vec3_t a_q18, uint32_t size_q20, uint32_t dt_us)
{
    int16_t *const shock = att->shock_q4;
    const evs_vec3_t trial_q4 = {shock[0], shock[1], shock[2]};
    const uint32_t trial = largest(trial_q4);
    if ((trial == 0u) && (size_q20 <= SHOCK_Q20)) { return; }

    const evs_vec3_t off_q4 = {a_q18.x >> 14, a_q18.y >> 14, (a_q18.z >> 14) - (att->gravity_q24 >> 20)};
    if ((trial != 0u) && (largest(off_q4) <= trial / 4u)) {
        const int32_t g_q31 = gain_q31(att->w_accel_q24, dt_us);
        att->slope_q24.x = plus_sat(att->slope_q24.x, -(((int64_t)trial_q4.x * g_q31) >> 10));
        att->slope_q24.y = plus_sat(att->slope_q24.y, -(((int64_t)trial_q4.y * g_q31) >> 10));
        att->slope_q24.z = plus_sat(att->slope_q24.z, -(((int64_t)trial_q4.z * g_q31) >> 10));
        evs_count(&att->faults.n_accel_bad);
    }
    const bool lone = (trial == 0u) && (size_q20 > SHOCK_Q20); /* a second one in a row is none */
    shock[0] = lone ? evs_sat16(off_q4.x) : 0;
    shock[1] = lone ? evs_sat16(off_q4.y) : 0;
    shock[2] = lone ? evs_sat16(off_q4.z) : 0;
}

/* 1 / gravity in Q32: within 2 % of 9.81 m/s^2 by its series to the second order, beyond 25 % by the reciprocal. */
static int32_t inverse_of(int32_t gravity_q24)
{
    const int32_t off_q24 = gravity_q24 - GRAVITY_Q24;
    if (evs_abs_u32(off_q24) < (uint32_t)GRAVITY_Q24 / 4u) {
        const int32_t x_q32 = (int32_t)(((int64_t)off_q24 * INT32_C(437964779)) >> 24); /* off / 9.80665, below 1/4 */
        return INT32_C(437964779) - fraction(INT32_C(437964779), x_q32 - fraction(x_q32, x_q32));
    }
    unsigned shift;
    const uint32_t r = evs_recip_u32((uint32_t)gravity_q24, &shift); /* gravity >= 2^25, so shift >= 57 */
    return (int32_t)(r >> (shift - 56u));
}

static void correct_tilt(evs_attitude_t *att)
{
    if (att->gravity_q24 < -GRAVITY_MIN_Q24) { turn_over(att); }
    const int32_t gravity_q24 = (att->gravity_q24 > GRAVITY_MIN_Q24) ? att->gravity_q24 : GRAVITY_MIN_Q24;
    const int32_t k_q24 = fraction(att->w_accel_q24, inverse_of(gravity_q24));
    const int32_t limit = CORRECT_MAX_Q24;
    att->correct_q24.x = evs_clamp(plus_sat(0, mac(INT64_C(1) << 23, att->slope_q24.y, k_q24) >> 24), -limit, limit);
    att->correct_q24.y = evs_clamp(plus_sat(0, -(mac(INT64_C(1) << 23, att->slope_q24.x, k_q24) >> 24)), -limit, limit);
}

/*
 * A bias keeps the correction busy: its mean is the bias, seen from the world. That is a poor measure while the carrier
 * accelerates, so it is only used until the first rest, and by a small part.
 */
static void learn_bias_in_motion(evs_attitude_t *att, uint32_t dt_us)
{
    evs_vec3_t world_q24 = att->correct_q24;
    if (has_flag(att, EVS_ATTITUDE_RECOVERING)) { world_q24.z = 0; } /* a heading that still converges tells nothing */
    const evs_vec3_t c_q24 = evs_quat_rotate(evs_quat_conj(att->q), world_q24);
    const int32_t gain = (int32_t)(dt_us * BIAS_MOTION_Q31);
    const int32_t max_q30 = (int32_t)(att->cfg.bias_max_mrad_s * UINT32_C(1073742));
    att->bias_q30.x = evs_clamp(att->bias_q30.x - evs_q_mul(c_q24.x, gain, 25), -max_q30, max_q30);
    att->bias_q30.y = evs_clamp(att->bias_q30.y - evs_q_mul(c_q24.y, gain, 25), -max_q30, max_q30);
    att->bias_q30.z = evs_clamp(att->bias_q30.z - evs_q_mul(c_q24.z, gain, 25), -max_q30, max_q30);
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
    const uint32_t since_us = advance(att, &att->t_accel_us, &att->n_time_back[1], t_us, SEEN_ACCEL);
    if (first) { att->accel_lp_q20 = accel_m_s2_q20; }
    if (!first && (since_us == 0u)) { return; }
    const uint32_t dt_us = min_u32(since_us, TRIM_STEP_US);

    const evs_vec3_t world_q18 = seen_from_world(att->q, accel_m_s2_q20);
    if (!has_flag(att, EVS_ATTITUDE_TILT_KNOWN) && (att->cfg.mode != EVS_ATTITUDE_GYRO_ONLY)) {
        start_tilt(att, world_q18);
        return;
    }
    if (dt_us == 0u) { return; }
    watch_accel(att, accel_m_s2_q20, dt_us);
    if (att->cfg.mode == EVS_ATTITUDE_FILTER) {
        if (has_flag(att, EVS_ATTITUDE_SETTLING)) {
            average(att, world_q18, dt_us);
        } else {
            look_for_shock(att, world_q18, size_q20, dt_us);
            low_pass(att, world_q18, dt_us);
            if (att->cfg.learn_bias && !has_flag(att, EVS_ATTITUDE_BIAS_KNOWN)) { learn_bias_in_motion(att, dt_us); }
        }
        correct_tilt(att);
    } else if (att->cfg.mode == EVS_ATTITUDE_VALENTI) {
        const evs_vec3_t a_q18 = {accel_m_s2_q20.x >> 2, accel_m_s2_q20.y >> 2, accel_m_s2_q20.z >> 2};
        evs_attitude_valenti_accel(att, a_q18, dt_us);
    }
}

/* --- magnetometer ---------------------------------------------------------------------------------------------- */

/* Whether (h, v) is the reference, within the tolerance of its size. */
static bool field_fits(const evs_attitude_t *att, int32_t h_q16, int32_t v_q16, int32_t ref_h_q16, int32_t ref_v_q16)
{
    const int64_t dh = (int64_t)h_q16 - ref_h_q16;
    const int64_t dv = (int64_t)v_q16 - ref_v_q16;
    const uint64_t off_q32 = (uint64_t)(dh * dh) + (uint64_t)(dv * dv);
    const uint64_t size_q32 = (uint64_t)((int64_t)ref_h_q16 * ref_h_q16) + (uint64_t)((int64_t)ref_v_q16 * ref_v_q16);
    const uint32_t tolerance = att->cfg.mag_tolerance_permille;
    return off_q32 <= (size_q32 >> 20) * ((tolerance * tolerance * 537u) >> 9); /* 10^-6 = 1.0488 / 2^20 */
}

static void track_field(int32_t *h, int32_t *v, int32_t h_q16, int32_t v_q16, uint32_t dt_us)
{
    const int32_t gain_q32 = (int32_t)(dt_us * FIELD_GAIN_Q32);
    *h += fraction(h_q16 - *h, gain_q32);
    *v += fraction(v_q16 - *v, gain_q32);
}

/* Another field than the undisturbed one: has it lasted long enough to be the new normal? */
static bool other_field_has_lasted(evs_attitude_t *att, bool known, int32_t h_q16, int32_t v_q16, uint32_t dt_us)
{
    if (!field_fits(att, h_q16, v_q16, att->other_h_q16, att->other_v_q16)) {
        att->other_us = 0u;
        att->other_h_q16 = h_q16;
        att->other_v_q16 = v_q16;
        return false;
    }
    track_field(&att->other_h_q16, &att->other_v_q16, h_q16, v_q16, dt_us);
    if (!known || (largest(att->rate_q24) > MOTION_MIN_Q24)) { att->other_us = add_sat_u32(att->other_us, dt_us); }
    return att->other_us >= (known ? FIELD_NEW_US : FIELD_FIRST_US);
}

/* How much of the heading's gain the field deserves; keeps account of it. */
static int32_t trusted_gain(evs_attitude_t *att, int32_t h_q16, int32_t v_q16, uint32_t dt_us)
{
    const bool known = (att->field_h_q16 | att->field_v_q16) != 0;
    const bool fits = known && field_fits(att, h_q16, v_q16, att->field_h_q16, att->field_v_q16);
    set_flag(att, EVS_ATTITUDE_MAG_DISTURBED, known && !fits);
    if (fits) {
        att->other_us = 0u;
        att->field_ok_us += (att->field_ok_us < FIELD_SETTLE_US) ? dt_us : 0u;
        if (att->field_ok_us >= FIELD_SETTLE_US) {
            track_field(&att->field_h_q16, &att->field_v_q16, h_q16, v_q16, dt_us);
            /* trust comes back twice as fast as it went */
            att->field_bad_us = (att->field_bad_us > 2u * dt_us) ? att->field_bad_us - 2u * dt_us : 0u;
            return att->w_mag_q24;
        }
    } else {
        att->field_ok_us = 0u;
        if (other_field_has_lasted(att, known, h_q16, v_q16, dt_us)) {
            att->field_h_q16 = att->other_h_q16;
            att->field_v_q16 = att->other_v_q16;
            att->field_ok_us = FIELD_SETTLE_US;
            att->other_us = 0u;
        }
        if (!known) { return att->w_mag_q24; } /* nothing to compare with yet */
    }
    if (att->field_bad_us < FIELD_REJECT_US) {
        att->field_bad_us += dt_us;
        return 0;
    }
    return att->w_mag_q24 / 2;
}

/* Angle of the field from north towards east, as a binary angle, and its horizontal part. */
static int32_t heading_of(evs_vec3_t m_q16, int32_t *h_q16)
{
    if ((m_q16.y > 0) && (evs_abs_u32(m_q16.x) < (uint32_t)m_q16.y / 4u)) { /* the usual: a small angle */
        unsigned shift;
        const uint32_t r = evs_recip_u32((uint32_t)m_q16.y, &shift);
        const int32_t t_q32 = (int32_t)(((int64_t)m_q16.x * r) >> (shift - 32u)); /* tangent */
        const int32_t tt_q32 = fraction(t_q32, t_q32);
        const int32_t tttt_q32 = fraction(tt_q32, tt_q32);
        *h_q16 = m_q16.y + fraction(m_q16.y, (tt_q32 >> 1) - (tttt_q32 >> 3)); /* to 2e-5 of it */
        const int32_t atan_q32 = t_q32 - fraction(t_q32, fraction(tt_q32, INT32_C(1431655765)) -
                                                             fraction(tttt_q32, INT32_C(858993459))); /* to 1e-5 rad */
        return fraction(atan_q32, INT32_C(683565276));                                                /* 1 / (2 pi) */
    }
    *h_q16 = (int32_t)evs_sqrt_u64((uint64_t)((int64_t)m_q16.x * m_q16.x) + (uint64_t)((int64_t)m_q16.y * m_q16.y));
    return evs_atan2(m_q16.x, m_q16.y);
}

static void correct_heading(evs_attitude_t *att, uint32_t dt_us)
{
    int32_t h_q16;
    const int32_t heading = heading_of(att->mag_lp_q16, &h_q16);
    const int32_t off = (int32_t)((uint32_t)heading - (uint32_t)att->cfg.declination);
    const int32_t gain_q24 = att->cfg.reject_mag ? trusted_gain(att, h_q16, att->mag_lp_q16.z, dt_us) : att->w_mag_q24;
    const int32_t turns_q24 = fraction_down(off, gain_q24); /* per second; at most 8 / 2 */
    const int32_t rate_q24 = (int32_t)(((int64_t)turns_q24 * INT32_C(1686629713)) >> 28); /* 2 pi in Q28 */
    att->correct_q24.z = evs_clamp(rate_q24, -CORRECT_MAX_Q24, CORRECT_MAX_Q24);
}

/* The first field: turn the whole estimate to north at once. */
static void start_heading(evs_attitude_t *att, evs_vec3_t world_q16)
{
    const int32_t off = (int32_t)((uint32_t)evs_atan2(world_q16.x, world_q16.y) - (uint32_t)att->cfg.declination);
    const evs_quat_t turn = evs_attitude_about_vertical(off);
    att->q = evs_attitude_renormalized(evs_quat_mul(turn, att->q));
    const evs_vec3_t slope_q22 = seen_from_world(turn, att->slope_q24);
    att->slope_q24.x = evs_sat32((int64_t)slope_q22.x * 4);
    att->slope_q24.y = evs_sat32((int64_t)slope_q22.y * 4);
    att->mag_lp_q16 = evs_quat_rotate(turn, world_q16);
    set_flag(att, EVS_ATTITUDE_HEADING_KNOWN, true);
    if (att->cfg.mode == EVS_ATTITUDE_FILTER) {
        att->w_mag_q24 = FIRST_MAG_Q24;
        set_flag(att, EVS_ATTITUDE_RECOVERING, true);
    }
}

/* Running mean; a sample moves it by no more than a part of its own size, so that a lone wild one hardly shows. */
static void average_field(evs_attitude_t *att, evs_vec3_t world_q16, uint32_t dt_us)
{
    evs_vec3_t *const mean = &att->mag_lp_q16;
    const int32_t gain_q32 = (int32_t)(dt_us * MAG_GAIN_Q32);
    const int32_t limit = (int32_t)(evs_abs_u32(mean->x) + evs_abs_u32(mean->y) + evs_abs_u32(mean->z));
    mean->x += fraction(evs_clamp(world_q16.x - mean->x, -limit, limit), gain_q32);
    mean->y += fraction(evs_clamp(world_q16.y - mean->y, -limit, limit), gain_q32);
    mean->z += fraction(evs_clamp(world_q16.z - mean->z, -limit, limit), gain_q32);
}

void evs_attitude_push_mag(evs_attitude_t *att, uint32_t t_us, evs_vec3_t field_ut_q16)
{
    EVS_ASSERT(att != NULL);
    const uint32_t size_q16 = largest(field_ut_q16);
    const uint32_t usual_q16 = (uint32_t)att->field_h_q16 + evs_abs_u32(att->field_v_q16); /* 0: none yet */
    const bool bad =
        (size_q16 == 0u) || (size_q16 > FIELD_MAX_Q16) || ((usual_q16 != 0u) && (size_q16 / 4u > usual_q16));
    set_flag(att, EVS_ATTITUDE_MAG_BAD, bad);
    if (bad) {
        evs_count(&att->faults.n_mag_bad);
        return;
    }
    const bool first = !has_flag(att, SEEN_MAG);
    const uint32_t since_us = advance(att, &att->t_mag_us, &att->n_time_back[2], t_us, SEEN_MAG);
    if (!first && (since_us == 0u)) { return; }
    if ((att->cfg.mode == EVS_ATTITUDE_GYRO_ONLY) || !has_flag(att, EVS_ATTITUDE_TILT_KNOWN)) { return; }

    const uint32_t dt_us = min_u32(since_us, TRIM_STEP_US);
    const evs_vec3_t field_q18 = {field_ut_q16.x * 4, field_ut_q16.y * 4, field_ut_q16.z * 4};
    const evs_vec3_t world_q16 = seen_from_world(att->q, field_q18);
    if (!has_flag(att, EVS_ATTITUDE_HEADING_KNOWN)) {
        start_heading(att, world_q16);
    } else if (att->cfg.mode == EVS_ATTITUDE_VALENTI) {
        evs_attitude_valenti_mag(att, world_q16, dt_us);
    } else if ((att->mag_lp_q16.x | att->mag_lp_q16.y | att->mag_lp_q16.z) == 0) { /* the orientation was given */
        att->mag_lp_q16 = world_q16;
    } else {
        average_field(att, world_q16, dt_us);
        correct_heading(att, dt_us);
    }
}

/* --- set up, and the rest of the interface ---------------------------------------------------------------------- */

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
                            .flags = MOVING, /* so that the running means start with the first sample */
                            .q = evs_quat_identity(),
                            .gravity_q24 = GRAVITY_Q24,
                            .w_accel_q24 = per_second_q24(cfg.tau_accel_ms),
                            .w_mag_q24 = per_second_q24(cfg.tau_mag_ms)};
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
    att->w_accel_q24 = per_second_q24(att->cfg.tau_accel_ms);
    att->w_mag_q24 = per_second_q24(att->cfg.tau_mag_ms);
    set_flag(att, EVS_ATTITUDE_SETTLING | EVS_ATTITUDE_RECOVERING, false);
    att->field_bad_us = 0u;
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
