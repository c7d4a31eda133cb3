/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * The complementary filter of Valenti, Dryanovski and Xiao, Sensors 15(8), 2015, doi:10.3390/s150819302: each
 * accelerometer sample, normalized, and each magnetometer sample gives a correcting quaternion, of which a part is
 * applied (equations 25 to 37, 44 to 47 there, in our frames: q_wi, z up, y north). The part is dt / tau here, not a
 * constant per sample. It is kept for comparison; docs/accuracy.md shows why it is not the default.
 */
#include "evs_attitude_private.h"

#define GRAVITY_Q18       INT32_C(2571633)   /* 9.81 m/s^2 */
#define INV_TENTH_G_Q18   INT32_C(267218)    /* 1 / 0.981 */
#define STEADY_Q18        UINT32_C(26214)    /* 0.1 m/s^2 off g, */
#define STEADY_CHANGE_Q24 UINT32_C(167772)   /* 0.01 rad/s from one sample to the next */
#define STEADY_RATE_Q24   UINT32_C(3355443)  /* and 0.2 rad/s are taken for rest, as published. */
#define LERP_MIN_Q30      INT32_C(966367642) /* 0.9: cosine of half the angle up to which interpolation is linear */

/* The part `gain` (Q31) of a correction: linear for a small one, spherical for a large one. */
static evs_quat_t part_of(evs_quat_t whole, int32_t gain)
{
    if (whole.w > LERP_MIN_Q30) {
        const evs_quat_t part = {EVS_ONE_Q30 + evs_q_mul(whole.w - EVS_ONE_Q30, gain, 31), evs_q_mul(whole.x, gain, 31),
                                 evs_q_mul(whole.y, gain, 31), evs_q_mul(whole.z, gain, 31)};
        return evs_attitude_renormalized(part);
    }
    return evs_quat_from_rotvec(evs_vec3_scale(evs_quat_to_rotvec(whole), gain, 31));
}

void evs_attitude_valenti_accel(evs_attitude_t *att, evs_vec3_t accel_q18, uint32_t dt_us)
{
    const int32_t norm_q18 = (int32_t)evs_sqrt_u64(evs_vec3_norm_sq(accel_q18));
    const int32_t off_q18 = (int32_t)evs_abs_u32(norm_q18 - GRAVITY_Q18);
    set_flag(att, VALENTI_STEADY, (uint32_t)off_q18 <= STEADY_Q18);

    int32_t gain = gain_q31(per_second_q24(att->cfg.tau_accel_ms), dt_us);
    if (att->cfg.valenti_adaptive) { /* all of it up to 10 % off g, nothing from 20 % */
        const int32_t left_q18 = evs_clamp(GRAVITY_Q18 / 5 - off_q18, 0, GRAVITY_Q18 / 10);
        gain = evs_q_mul(gain, evs_q_mul(left_q18, INV_TENTH_G_Q18, 18), 18);
    }
    evs_vec3_t up;
    if (evs_vec3_normalize(evs_quat_rotate(att->q, accel_q18), &up) != EVS_OK) { return; }
    att->q = evs_attitude_renormalized(evs_quat_mul(part_of(evs_attitude_levelling(up), gain), att->q));
}

void evs_attitude_valenti_mag(evs_attitude_t *att, evs_vec3_t world_q16, uint32_t dt_us)
{
    const int32_t off = (int32_t)((uint32_t)evs_atan2(world_q16.x, world_q16.y) - (uint32_t)att->cfg.declination);
    const int32_t gain = gain_q31(per_second_q24(att->cfg.tau_mag_ms), dt_us);
    att->q = evs_attitude_renormalized(evs_quat_mul(part_of(evs_attitude_about_vertical(off), gain), att->q));
}

void evs_attitude_valenti_bias(evs_attitude_t *att, evs_vec3_t rate_q24, uint32_t dt_us)
{
    const evs_vec3_t change = evs_vec3_sub(rate_q24, att->rate_q24);
    if (!has_flag(att, VALENTI_STEADY) || (largest(change) > STEADY_CHANGE_Q24) ||
        (largest(rate_q24) > STEADY_RATE_Q24)) {
        return;
    }
    const int32_t gain = gain_q31(per_second_q24(att->cfg.tau_accel_ms), dt_us);
    att->bias_q30.x = evs_add_sat(att->bias_q30.x, evs_q_mul(rate_q24.x, gain, 25));
    att->bias_q30.y = evs_add_sat(att->bias_q30.y, evs_q_mul(rate_q24.y, gain, 25));
    att->bias_q30.z = evs_add_sat(att->bias_q30.z, evs_q_mul(rate_q24.z, gain, 25));
    set_flag(att, EVS_ATTITUDE_BIAS_KNOWN, true);
}
