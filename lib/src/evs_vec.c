/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/vec.h"

evs_vec3_t evs_vec3_cross(evs_vec3_t a, evs_vec3_t b, unsigned n)
{
    const evs_vec3_t c = {evs_sat32(evs_shr_r64((int64_t)a.y * b.z - (int64_t)a.z * b.y, n)),
                          evs_sat32(evs_shr_r64((int64_t)a.z * b.x - (int64_t)a.x * b.z, n)),
                          evs_sat32(evs_shr_r64((int64_t)a.x * b.y - (int64_t)a.y * b.x, n))};
    return c;
}

/* v * r / 2^shift in Q30, where r / 2^shift = 1 / length and |v| <= length. */
static int32_t unit_component(int32_t v, uint32_t r, unsigned shift)
{
    return evs_sat32(evs_shr_r64((int64_t)v * (int64_t)(r >> 1), shift - 31u));
}

evs_status_t evs_vec3_normalize(evs_vec3_t v, evs_vec3_t *unit_q30)
{
    const uint64_t norm_sq = evs_vec3_norm_sq(v);
    if (norm_sq == 0u) { return EVS_ERR_NUMERIC; }
    unsigned shift;
    const uint32_t r = evs_rsqrt_u64(norm_sq, &shift);
    unit_q30->x = unit_component(v.x, r, shift);
    unit_q30->y = unit_component(v.y, r, shift);
    unit_q30->z = unit_component(v.z, r, shift);
    return EVS_OK;
}

evs_quat_t evs_quat_mul(evs_quat_t a, evs_quat_t b)
{
    /* Each product is at most 2^60 for unit quaternions, so that four of them fit with two bits to spare. */
    const evs_quat_t c = {
        evs_sat32(evs_shr_r64((int64_t)a.w * b.w - (int64_t)a.x * b.x - (int64_t)a.y * b.y - (int64_t)a.z * b.z, 30)),
        evs_sat32(evs_shr_r64((int64_t)a.w * b.x + (int64_t)a.x * b.w + (int64_t)a.y * b.z - (int64_t)a.z * b.y, 30)),
        evs_sat32(evs_shr_r64((int64_t)a.w * b.y - (int64_t)a.x * b.z + (int64_t)a.y * b.w + (int64_t)a.z * b.x, 30)),
        evs_sat32(evs_shr_r64((int64_t)a.w * b.z + (int64_t)a.x * b.y - (int64_t)a.y * b.x + (int64_t)a.z * b.w, 30))};
    return c;
}

evs_status_t evs_quat_normalize(evs_quat_t q, evs_quat_t *unit)
{
    evs_vec3_t v = {q.x, q.y, q.z};
    uint64_t norm_sq = evs_vec3_norm_sq(v) + (uint64_t)((int64_t)q.w * q.w);
    if (norm_sq == 0u) {
        if (q.w != INT32_MIN) { return EVS_ERR_NUMERIC; } /* four times (-2^31)^2 is 2^64, which wrapped */
        norm_sq = UINT64_MAX;
    }
    unsigned shift;
    const uint32_t r = evs_rsqrt_u64(norm_sq, &shift);
    unit->w = unit_component(q.w, r, shift);
    unit->x = unit_component(q.x, r, shift);
    unit->y = unit_component(q.y, r, shift);
    unit->z = unit_component(q.z, r, shift);
    return EVS_OK;
}

evs_vec3_t evs_quat_rotate(evs_quat_t q, evs_vec3_t v)
{
    /* v + w t + u x t with t = 2 u x v and u the vector part. */
    const evs_vec3_t u = {q.x, q.y, q.z};
    const evs_vec3_t t = evs_vec3_cross(u, v, 29);
    const evs_vec3_t ut = evs_vec3_cross(u, t, 30);
    const evs_vec3_t rotated = {evs_sat32((int64_t)v.x + evs_q_mul(q.w, t.x, 30) + ut.x),
                                evs_sat32((int64_t)v.y + evs_q_mul(q.w, t.y, 30) + ut.y),
                                evs_sat32((int64_t)v.z + evs_q_mul(q.w, t.z, 30) + ut.z)};
    return rotated;
}

evs_quat_t evs_quat_from_rotvec(evs_vec3_t r_rad_q28)
{
    /*
     * The series of cos(a/2) and sin(a/2)/a in a^2 reach 2^-31 for a <= 1 rad. A longer rotation is a power of a
     * shorter one: halve until it fits, then square as often (4 times at most, since |r| < 8 sqrt(3) < 2^4).
     */
    static const int32_t C_Q30[] = {1073741824, -134217728, 2796203, -23302, 104}; /* 1, -1/8, 1/384, -1/46080, ... */
    static const int32_t S_Q30[] = {536870912, -22369621, 279620, -1664, 6};       /* 1/2, -1/48, 1/3840, ... */

    const uint64_t one_q56 = UINT64_C(1) << 56;
    uint64_t aa_q56 = evs_vec3_norm_sq(r_rad_q28);
    unsigned halvings = 0u;
    while (aa_q56 > one_q56) {
        aa_q56 >>= 2;
        halvings++;
    }
    const int32_t aa_q30 = (int32_t)(aa_q56 >> 26);

    int32_t c_q30 = C_Q30[4];
    int32_t s_q30 = S_Q30[4];
    for (int k = 3; k >= 0; k--) {
        c_q30 = C_Q30[k] + evs_q_mul(c_q30, aa_q30, 30);
        s_q30 = S_Q30[k] + evs_q_mul(s_q30, aa_q30, 30);
    }
    evs_quat_t q = {c_q30, evs_q_mul(r_rad_q28.x, s_q30, 28u + halvings), evs_q_mul(r_rad_q28.y, s_q30, 28u + halvings),
                    evs_q_mul(r_rad_q28.z, s_q30, 28u + halvings)};
    for (unsigned i = 0u; i < halvings; i++) { q = evs_quat_mul(q, q); }
    return q;
}

evs_vec3_t evs_quat_to_rotvec(evs_quat_t q)
{
    if (q.w < 0) { /* the shorter of the two ways round */
        q = (evs_quat_t){evs_sub_sat(0, q.w), evs_sub_sat(0, q.x), evs_sub_sat(0, q.y), evs_sub_sat(0, q.z)};
    }
    const evs_vec3_t u = {q.x, q.y, q.z};
    const uint64_t sin_sq_q60 = evs_vec3_norm_sq(u);

    /*
     * sin(a/2) below 1/8, which is a turn below 14 degrees: between two samples of a gyro it always is. The factor
     * 2 asin(s) / s by its series in s^2 to s^6; the next term is below 2 * 10^-9.
     */
    if (sin_sq_q60 < (UINT64_C(1) << 54)) {
        const int32_t ss_q30 = (int32_t)(sin_sq_q60 >> 30);
        int32_t f_q28 = 23967451;                         /* 2 * 5/112 */
        f_q28 = 40265318 + evs_q_mul(f_q28, ss_q30, 30);  /* 2 * 3/40 */
        f_q28 = 89478485 + evs_q_mul(f_q28, ss_q30, 30);  /* 2 * 1/6 */
        f_q28 = 536870912 + evs_q_mul(f_q28, ss_q30, 30); /* 2 */
        return evs_vec3_scale(u, f_q28, 30);
    }
    const int32_t sin_q30 = (int32_t)evs_sqrt_u64(sin_sq_q60);
    const int32_t half_angle_q28 = evs_rad_from_angle(evs_atan2(sin_q30, q.w)); /* in [0, pi/2] */
    unsigned shift;
    const uint32_t r = evs_recip_u32((uint32_t)sin_q30, &shift);
    /* 2 * half / sin in Q28: in [2, pi]. shift is in [58, 62]. */
    const int32_t factor_q28 = (int32_t)evs_shr_r64((int64_t)half_angle_q28 * (int64_t)(r >> 1), shift - 32u);
    return evs_vec3_scale(u, factor_q28, 30);
}

/* rad in Q28 over dt to rad/s in Q24: times 10^6 / 2^4 / dt, rounded away from zero at halves. */
static int32_t per_second(int32_t r_rad_q28, int32_t dt_us)
{
    const int64_t num = (int64_t)r_rad_q28 * 62500;
    const int64_t half = dt_us / 2;
    return evs_sat32((num >= 0) ? (num + half) / dt_us : (num - half) / dt_us);
}

evs_status_t evs_quat_rate(evs_quat_t q_a, evs_quat_t q_b, int32_t dt_us, evs_vec3_t *rate_rad_s_q24)
{
    if ((dt_us < 1) || (dt_us > 10000000)) { return EVS_ERR_ARG; }
    const evs_vec3_t r_q28 = evs_quat_to_rotvec(evs_quat_mul(evs_quat_conj(q_a), q_b));
    rate_rad_s_q24->x = per_second(r_q28.x, dt_us);
    rate_rad_s_q24->y = per_second(r_q28.y, dt_us);
    rate_rad_s_q24->z = per_second(r_q28.z, dt_us);
    return EVS_OK;
}

evs_vec3_t evs_rotvec_of_rate(evs_vec3_t rate_rad_s_q24, int32_t t_us)
{
    const int32_t t_s_q30 = (int32_t)evs_shr_r64((int64_t)t_us * INT64_C(1125899907), 20); /* 2^50 / 10^6 */
    return evs_vec3_scale(rate_rad_s_q24, t_s_q30, 26);
}

/* Twice a product, in Q30. 64 bits: at half a turn it is 2.0, which 32 cannot hold. */
static inline int64_t doubled(int32_t a, int32_t b) { return evs_shr_r64((int64_t)a * b, 29); }

evs_mat3_t evs_quat_to_mat3(evs_quat_t q)
{
    const int64_t xx = doubled(q.x, q.x), yy = doubled(q.y, q.y), zz = doubled(q.z, q.z);
    const int64_t xy = doubled(q.x, q.y), xz = doubled(q.x, q.z), yz = doubled(q.y, q.z);
    const int64_t wx = doubled(q.w, q.x), wy = doubled(q.w, q.y), wz = doubled(q.w, q.z);
    const evs_mat3_t m = {{{(int32_t)(EVS_ONE_Q30 - yy - zz), (int32_t)(xy - wz), (int32_t)(xz + wy)},
                           {(int32_t)(xy + wz), (int32_t)(EVS_ONE_Q30 - xx - zz), (int32_t)(yz - wx)},
                           {(int32_t)(xz - wy), (int32_t)(yz + wx), (int32_t)(EVS_ONE_Q30 - xx - yy)}}};
    return m;
}

static int32_t row_times(const int32_t row[3], evs_vec3_t v)
{
    return evs_sat32(evs_shr_r64((int64_t)row[0] * v.x + (int64_t)row[1] * v.y + (int64_t)row[2] * v.z, 30));
}

evs_vec3_t evs_mat3_apply(const evs_mat3_t *m, evs_vec3_t v)
{
    const evs_vec3_t r = {row_times(m->m[0], v), row_times(m->m[1], v), row_times(m->m[2], v)};
    return r;
}
