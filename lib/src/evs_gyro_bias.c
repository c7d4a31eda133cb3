/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/gyro_bias.h"

#include "evs_scaled.h"

enum {
    MEMORY_MS = 20000,
    FACTOR = 20, /* errors that neighbouring vectors and successive pairs have in common: measured */
    NOISE_MIN_Q24 = 4096,
    X_MAX_Q14 = 4 << 14,
    A_MIN_Q14 = 512,   /* nearer to the focus of expansion a vector says nothing */
    FAR_Q8 = 16 * 256, /* sigmas: weight zero from there */
    RATE_MAX_Q24 = 8388608,
    ROUNDS = 3
};

#define S2_Q16       UINT32_C(331776) /* (9/4 sigma)^2, the kernel of the solver */
#define PRIOR_MIN    67109            /* 0.004 rad/s */
#define PRIOR_MAX    838861           /* 0.05 */
#define PRIOR_FIRST  134218           /* 0.008, worth two more axes */
#define PRIOR_WEIGHT 2

typedef struct {
    int64_t hvv_q16[3];
    int64_t hvw_q22[2][3];
    int64_t hww_q28[6];
    int64_t gv_q20[2];
    int64_t gw_q26[3];
} sums_t;

static const unsigned AT[3][3] = {{0u, 1u, 3u}, {1u, 2u, 4u}, {3u, 4u, 5u}};

void evs_gyro_bias_reset(evs_gyro_bias_t *b)
{
    EVS_ASSERT(b != NULL);
    *b = (evs_gyro_bias_t){.t_us = 0u};
}

/* The angle, at most a radian. 2^28 / (2^24 10^6) = 1 / 62500. */
static int32_t turned_q28(int32_t rate_q24, uint32_t interval_us)
{
    return evs_clamp(evs_sat32((int64_t)rate_q24 * interval_us / 62500), -(INT32_C(1) << 28), INT32_C(1) << 28);
}

evs_vec3_t evs_gyro_bias_left(const evs_gyro_bias_t *b, evs_quat_t q_cr, uint32_t interval_us)
{
    EVS_ASSERT(b != NULL);
    const evs_vec3_t c = {-turned_q28(b->bias_q24.x, interval_us), -turned_q28(b->bias_q24.y, interval_us),
                          -turned_q28(b->bias_q24.z, interval_us)};
    return evs_quat_rotate(evs_quat_conj(q_cr), c);
}

/* Flow per radian, Q14, of a camera that turns: rows of u and of v. */
static void slopes(int32_t x_q14, int32_t y_q14, int32_t bu[3], int32_t bv[3])
{
    const int32_t one = INT32_C(1) << 14;
    const int32_t xy = (int32_t)(((int64_t)x_q14 * y_q14) >> 14);
    bu[0] = xy;
    bu[1] = -one - (int32_t)(((int64_t)x_q14 * x_q14) >> 14);
    bu[2] = y_q14;
    bv[0] = one + (int32_t)(((int64_t)y_q14 * y_q14) >> 14);
    bv[1] = -xy;
    bv[2] = -x_q14;
}

evs_egomotion_flow_t evs_gyro_bias_take_out(evs_egomotion_flow_t flow, evs_vec3_t rotation_rad_q28)
{
    int32_t bu[3];
    int32_t bv[3];
    const int32_t w[3] = {rotation_rad_q28.x, rotation_rad_q28.y, rotation_rad_q28.z};
    int64_t u = 0;
    int64_t v = 0;
    slopes(evs_clamp(flow.x_q24 >> 10, -8 * X_MAX_Q14, 8 * X_MAX_Q14),
           evs_clamp(flow.y_q24 >> 10, -8 * X_MAX_Q14, 8 * X_MAX_Q14), bu, bv);
    for (unsigned k = 0u; k < 3u; k++) {
        u += (int64_t)bu[k] * w[k];
        v += (int64_t)bv[k] * w[k];
    }
    flow.u_q24 = evs_sat32((int64_t)flow.u_q24 - evs_shr_r64(u, 18u));
    flow.v_q24 = evs_sat32((int64_t)flow.v_q24 - evs_shr_r64(v, 18u));
    return flow;
}

static int32_t dot_q14(const int32_t a[3], const int32_t b[3])
{
    return (int32_t)(((int64_t)a[0] * b[0] + (int64_t)a[1] * b[1] + (int64_t)a[2] * b[2]) >> 14);
}

/* Two unit vectors, Q14, across v. */
static void across_v(evs_vec3_t v, int32_t b0[3], int32_t b1[3])
{
    const uint32_t x = evs_abs_u32(v.x), y = evs_abs_u32(v.y), z = evs_abs_u32(v.z);
    const bool x_least = (x <= y) && (x <= z);
    const bool y_least = !x_least && (y <= z);
    const evs_vec3_t axis = {x_least ? EVS_ONE_Q30 : 0, y_least ? EVS_ONE_Q30 : 0,
                             (!x_least && !y_least) ? EVS_ONE_Q30 : 0};
    evs_vec3_t p = axis;
    if (evs_vec3_normalize(evs_vec3_cross(v, axis, 30u), &p) != EVS_OK) { p = axis; }
    const evs_vec3_t q = evs_vec3_cross(v, p, 30u);
    b0[0] = p.x >> 16, b0[1] = p.y >> 16, b0[2] = p.z >> 16;
    b1[0] = q.x >> 16, b1[1] = q.y >> 16, b1[2] = q.z >> 16;
}

static void add_up(const evs_gyro_bias_pair_t *pair, uint32_t noise_q24, sums_t *s)
{
    const uint64_t per_noise = (UINT64_C(1) << 40) / noise_q24;
    const int32_t v[3] = {pair->v_q30.x >> 16, pair->v_q30.y >> 16, pair->v_q30.z >> 16};
    int32_t b0[3];
    int32_t b1[3];
    across_v(pair->v_q30, b0, b1);
    for (size_t i = 0u; i < pair->n; i++) {
        const evs_egomotion_flow_t *const f = &pair->flow[i];
        const int32_t x = f->x_q24 >> 10, y = f->y_q24 >> 10;
        if ((x < -X_MAX_Q14) || (x > X_MAX_Q14) || (y < -X_MAX_Q14) || (y > X_MAX_Q14)) { continue; }
        const int32_t ax = (int32_t)(((int64_t)x * v[2]) >> 14) - v[0];
        const int32_t ay = (int32_t)(((int64_t)y * v[2]) >> 14) - v[1];
        const uint32_t a = evs_sqrt_u64((uint64_t)((int64_t)ax * ax + (int64_t)ay * ay));
        if (a < A_MIN_Q14) { continue; }
        const int64_t per_a = (int64_t)((UINT32_C(1) << 30) / a);
        const int32_t ex = (int32_t)((ax * per_a) >> 16), ey = (int32_t)((ay * per_a) >> 16); /* Q14 */
        const int64_t u = evs_clamp(evs_sat32(((int64_t)f->u_q24 * (int64_t)per_noise) >> 32), -(1 << 22), 1 << 22);
        const int64_t w = evs_clamp(evs_sat32(((int64_t)f->v_q24 * (int64_t)per_noise) >> 32), -(1 << 22), 1 << 22);
        const int32_t r = (int32_t)((u * ey - w * ex) >> 14);     /* sigmas, Q8 */
        const int32_t along = (int32_t)((u * ex + w * ey) >> 14); /* the same */
        if ((along <= 0) || (r > FAR_Q8) || (r < -FAR_Q8)) { continue; }
        const uint32_t share = (S2_Q16 << 12) / ((S2_Q16 + (uint32_t)(r * r)) >> 3);
        const int64_t weight = (int64_t)((share * share) >> 15); /* Q15 */
        /* slopes of r */
        int32_t bu[3];
        int32_t bv[3];
        slopes(x, y, bu, bv);
        int64_t jw[3];
        for (unsigned k = 0u; k < 3u; k++) { jw[k] = ((int64_t)bv[k] * ex - (int64_t)bu[k] * ey) >> 14; }
        const int32_t g[3] = {ay, -ax, (int32_t)(((int64_t)x * v[1] - (int64_t)y * v[0]) >> 14)};
        const int64_t depth = (((along * per_a) >> 16) * per_a) >> 16;
        const int64_t jv[2] = {evs_clamp(evs_sat32((depth * dot_q14(g, b0)) >> 14), -(1 << 21), 1 << 21),
                               evs_clamp(evs_sat32((depth * dot_q14(g, b1)) >> 14), -(1 << 21), 1 << 21)};
        const int64_t wr = (weight * r) >> 11; /* Q12 */
        unsigned at = 0u;
        for (unsigned k = 0u; k < 3u; k++) {
            const int64_t wj = (weight * jw[k]) >> 15;
            for (unsigned l = 0u; l <= k; l++) { s->hww_q28[at++] += wj * jw[l]; }
            s->hvw_q22[0][k] += wj * jv[0];
            s->hvw_q22[1][k] += wj * jv[1];
            s->gw_q26[k] += wr * jw[k];
        }
        const int64_t wj0 = (weight * jv[0]) >> 15, wj1 = (weight * jv[1]) >> 15;
        s->hvv_q16[0] += wj0 * jv[0];
        s->hvv_q16[1] += wj1 * jv[0];
        s->hvv_q16[2] += wj1 * jv[1];
        s->gv_q20[0] += wr * jv[0];
        s->gv_q20[1] += wr * jv[1];
    }
}

/* What is left of the information on the rotation, and of the slope, when v is unknown; in units of the noise. */
static bool eliminate_v(const sums_t *s, evs_scaled_t h[6], evs_scaled_t g[3])
{
    evs_scaled_t hvw[2][3];
    for (unsigned k = 0u; k < 3u; k++) {
        hvw[0][k] = evs_scaled(s->hvw_q22[0][k], -22);
        hvw[1][k] = evs_scaled(s->hvw_q22[1][k], -22);
    }
    for (unsigned column = 0u; column < 4u; column++) {
        evs_scaled_t a[3] = {evs_scaled(s->hvv_q16[0], -16), evs_scaled(s->hvv_q16[1], -16),
                             evs_scaled(s->hvv_q16[2], -16)};
        evs_scaled_t x[2];
        for (unsigned i = 0u; i < 2u; i++) { x[i] = (column < 3u) ? hvw[i][column] : evs_scaled(s->gv_q20[i], -20); }
        if (!evs_scaled_solve(a, x, 2u)) { return false; }
        for (unsigned k = 0u; k < 3u; k++) {
            const evs_scaled_t off = evs_scaled_add(evs_scaled_mul(hvw[0][k], x[0]), evs_scaled_mul(hvw[1][k], x[1]));
            if (column == 3u) {
                g[k] = evs_scaled_sub(evs_scaled(s->gw_q26[k], -26), off);
            } else if (column <= k) {
                h[AT[k][column]] = evs_scaled_sub(evs_scaled(s->hww_q28[AT[k][column]], -28), off);
            }
        }
    }
    return true;
}

/* The bias for a width of the prior, and the trace of its covariance. */
static bool estimate(const evs_gyro_bias_t *b, int32_t prior_q24, evs_scaled_t x[3], evs_scaled_t *trace)
{
    const evs_scaled_t one = evs_scaled(1, 0);
    const evs_scaled_t width = evs_scaled(prior_q24, -24);
    const evs_scaled_t prior = evs_scaled_div(one, evs_scaled_mul(width, width));
    *trace = evs_scaled(0, 0);
    for (unsigned column = 0u; column < 4u; column++) {
        evs_scaled_t a[6];
        evs_scaled_t y[3] = {{0, 0}, {0, 0}, {0, 0}};
        for (unsigned i = 0u; i < 6u; i++) { a[i] = evs_scaled(b->info_q4[i], -4); }
        for (unsigned k = 0u; k < 3u; k++) {
            a[AT[k][k]] = evs_scaled_add(a[AT[k][k]], prior);
            if (column == 3u) { y[k] = evs_scaled(b->pull_q8[k], -8); }
        }
        if (column < 3u) { y[column] = one; }
        if (!evs_scaled_solve(a, y, 3u)) { return false; }
        if (column < 3u) {
            *trace = evs_scaled_add(*trace, y[column]);
        } else {
            x[0] = y[0], x[1] = y[1], x[2] = y[2];
        }
    }
    return true;
}

static void update(evs_gyro_bias_t *b)
{
    evs_scaled_t x[3];
    evs_scaled_t trace;
    if (b->prior_q24 == 0) { b->prior_q24 = PRIOR_FIRST; }
    const evs_scaled_t first = evs_scaled(PRIOR_FIRST, -24);
    const evs_scaled_t base = evs_scaled_mul(evs_scaled_mul(first, first), evs_scaled(PRIOR_WEIGHT, 0));
    for (unsigned round = 0u; round <= ROUNDS; round++) {
        if (!estimate(b, b->prior_q24, x, &trace)) { return; }
        if (round == ROUNDS) { break; }
        evs_scaled_t sum = evs_scaled_add(base, trace);
        for (unsigned k = 0u; k < 3u; k++) { sum = evs_scaled_add(sum, evs_scaled_mul(x[k], x[k])); }
        const evs_scaled_t width = evs_scaled_sqrt(evs_scaled_div(sum, evs_scaled(3 + PRIOR_WEIGHT, 0)));
        b->prior_q24 = evs_clamp(evs_scaled_to_q(width, 24), PRIOR_MIN, PRIOR_MAX);
    }
    b->bias_q24 = (evs_vec3_t){evs_clamp(evs_scaled_to_q(x[0], 24), -RATE_MAX_Q24, RATE_MAX_Q24),
                               evs_clamp(evs_scaled_to_q(x[1], 24), -RATE_MAX_Q24, RATE_MAX_Q24),
                               evs_clamp(evs_scaled_to_q(x[2], 24), -RATE_MAX_Q24, RATE_MAX_Q24)};
    b->sigma_q24 = evs_scaled_to_q(evs_scaled_sqrt(evs_scaled_div(trace, evs_scaled(3, 0))), 24);
}

/* What was learnt long ago counts less. */
static void forget(evs_gyro_bias_t *b, uint32_t t_us)
{
    const int32_t since_us = evs_time_diff_us(t_us, b->t_us);
    const bool first = b->prior_q24 == 0;
    b->t_us = t_us;
    if (first || (since_us <= 0)) { return; }
    const int64_t most = (int64_t)MEMORY_MS * 1000;
    const int64_t part_q16 = ((since_us < most) ? since_us : most) * 65536 / most;
    for (unsigned i = 0u; i < 6u; i++) { b->info_q4[i] -= (int32_t)((b->info_q4[i] * part_q16) >> 16); }
    for (unsigned i = 0u; i < 3u; i++) { b->pull_q8[i] -= (int32_t)((b->pull_q8[i] * part_q16) >> 16); }
}

void evs_gyro_bias_learn(evs_gyro_bias_t *b, const evs_gyro_bias_pair_t *pair)
{
    EVS_ASSERT((b != NULL) && (pair != NULL));
    const uint32_t noise_q24 = (pair->noise_q24 > NOISE_MIN_Q24) ? pair->noise_q24 : NOISE_MIN_Q24;
    sums_t sums = {.hvv_q16 = {0}};
    evs_scaled_t h[6];
    evs_scaled_t g[3];
    add_up(pair, noise_q24, &sums);
    if (!eliminate_v(&sums, h, g)) { return; }
    forget(b, pair->t_us);

    /* The rotation is -dt R_rc b: from the frame of the flow, and from rad, to rates in the camera's. */
    const evs_scaled_t dt = evs_scaled_div(evs_scaled(pair->interval_us, 0), evs_scaled(1000000, 0));
    const evs_scaled_t unit = evs_scaled_div(dt, evs_scaled(noise_q24, -24));
    const evs_scaled_t factor = evs_scaled(FACTOR, 0);
    const evs_mat3_t r_cr = evs_quat_to_mat3(pair->q_cr);
    evs_scaled_t r[3][3];
    for (unsigned i = 0u; i < 3u; i++) {
        for (unsigned j = 0u; j < 3u; j++) { r[i][j] = evs_scaled_mul(evs_scaled(r_cr.m[i][j], -30), unit); }
    }
    const int32_t bias[3] = {b->bias_q24.x, b->bias_q24.y, b->bias_q24.z};
    evs_scaled_t info[3][3];
    for (unsigned i = 0u; i < 3u; i++) {
        for (unsigned j = 0u; j <= i; j++) {
            evs_scaled_t sum = {0, 0};
            for (unsigned k = 0u; k < 3u; k++) {
                for (unsigned l = 0u; l < 3u; l++) {
                    sum = evs_scaled_add(sum, evs_scaled_mul(evs_scaled_mul(r[i][k], r[j][l]), h[AT[k][l]]));
                }
            }
            info[i][j] = evs_scaled_div(sum, factor);
            info[j][i] = info[i][j];
            b->info_q4[AT[i][j]] = evs_add_sat(b->info_q4[AT[i][j]], evs_scaled_to_q(info[i][j], 4));
        }
    }
    for (unsigned i = 0u; i < 3u; i++) {
        evs_scaled_t down = {0, 0};
        evs_scaled_t pull = {0, 0};
        for (unsigned k = 0u; k < 3u; k++) {
            down = evs_scaled_add(down, evs_scaled_mul(r[i][k], g[k]));
            pull = evs_scaled_add(pull, evs_scaled_mul(info[i][k], evs_scaled(bias[k], -24)));
        }
        pull = evs_scaled_add(pull, evs_scaled_div(down, factor)); /* the slope in b is minus that in the rotation */
        b->pull_q8[i] = evs_add_sat(b->pull_q8[i], evs_scaled_to_q(pull, 8));
    }
    update(b);
}
