/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/gyro_bias.h"
#include "flow_scene.h"
#include "unity.h"

#include <string.h>

enum { N = 90, INTERVAL_US = 120000, STEP_US = 50000 };

static evs_gyro_bias_t b;
static evs_egomotion_flow_t flow[N];

void setUp(void)
{
    evs_gyro_bias_reset(&b);
    scene_seed = 11u;
}
void tearDown(void) {}

/* The camera at the middle of the interval from the frame of the flow, of pair number k. */
static evs_quat_t camera_of(unsigned k)
{
    const evs_vec3_t r = {(int32_t)(k % 7u) * 9000000, -(int32_t)(k % 5u) * 12000000, (int32_t)(k % 3u) * 20000000};
    return evs_quat_from_rotvec(r);
}

/* --- the same in double precision, written from the formulas --------------------------------------------------- */

typedef struct {
    double bias[3], info[3][3], pull[3], prior, sigma;
} model_t;

static void solve3(double a[3][3], const double y[3], double x[3])
{
    const double det = a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) -
                       a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
                       a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
    for (int i = 0; i < 3; i++) {
        double m[3][3];
        memcpy(m, a, sizeof m);
        for (int k = 0; k < 3; k++) { m[k][i] = y[k]; }
        x[i] = (m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])) /
               det;
    }
}

static void model_learn(model_t *m, const evs_gyro_bias_pair_t *pair, double forget)
{
    const double dt = 1e-6 * pair->interval_us, noise = pair->noise_q24 / 16777216.0;
    const double v[3] = {evs_q_to_double(pair->v_q30.x, 30), evs_q_to_double(pair->v_q30.y, 30),
                         evs_q_to_double(pair->v_q30.z, 30)};
    const evs_mat3_t r_cr = evs_quat_to_mat3(pair->q_cr);
    double b0[3] = {v[1], -v[0], 0.0}; /* any two directions across v */
    const double length = sqrt(b0[0] * b0[0] + b0[1] * b0[1]);
    b0[0] /= length, b0[1] /= length;
    const double b1[3] = {v[1] * b0[2] - v[2] * b0[1], v[2] * b0[0] - v[0] * b0[2], v[0] * b0[1] - v[1] * b0[0]};
    double h[5][5] = {{0.0}}, g[5] = {0.0};
    for (size_t i = 0u; i < pair->n; i++) {
        const double x = pair->flow[i].x_q24 / 16777216.0, y = pair->flow[i].y_q24 / 16777216.0;
        const double fu = pair->flow[i].u_q24 / 16777216.0 / noise, fv = pair->flow[i].v_q24 / 16777216.0 / noise;
        const double ax = x * v[2] - v[0], ay = y * v[2] - v[1], a = hypot(ax, ay);
        const double r = (fu * ay - fv * ax) / a, along = (fu * ax + fv * ay) / a;
        if ((along <= 0.0) || (fabs(r) > 16.0) || (a < 1.0 / 32.0)) { continue; }
        const double share = 5.0625 / (5.0625 + r * r), w = share * share;
        const double p[3] = {ay, -ax, x * v[1] - y * v[0]};
        const double u_of_w[3] = {x * y, -1.0 - x * x, y}, v_of_w[3] = {1.0 + y * y, -x * y, -x};
        double j[5];
        j[0] = along / (a * a) * (p[0] * b0[0] + p[1] * b0[1] + p[2] * b0[2]);
        j[1] = along / (a * a) * (p[0] * b1[0] + p[1] * b1[1] + p[2] * b1[2]);
        for (int k = 0; k < 3; k++) { j[2 + k] = (v_of_w[k] * ax - u_of_w[k] * ay) / a; }
        for (int k = 0; k < 5; k++) {
            g[k] += w * r * j[k];
            for (int l = 0; l < 5; l++) { h[k][l] += w * j[k] * j[l]; }
        }
    }
    const double det = h[0][0] * h[1][1] - h[0][1] * h[0][1];
    double hs[3][3], gs[3], t[3][3];
    for (int k = 0; k < 3; k++) {
        const double c0 = (h[2 + k][0] * h[1][1] - h[2 + k][1] * h[0][1]) / det;
        const double c1 = (h[2 + k][1] * h[0][0] - h[2 + k][0] * h[0][1]) / det;
        gs[k] = g[2 + k] - c0 * g[0] - c1 * g[1];
        for (int l = 0; l < 3; l++) { hs[k][l] = h[2 + k][2 + l] - c0 * h[0][2 + l] - c1 * h[1][2 + l]; }
        for (int l = 0; l < 3; l++) {
            t[k][l] = -evs_q_to_double(r_cr.m[l][k], 30) * dt / noise;
        } /* of the rotation by the bias */
    }
    for (int i = 0; i < 3; i++) {
        m->pull[i] *= 1.0 - forget;
        for (int k = 0; k < 3; k++) { m->info[i][k] *= 1.0 - forget; }
    }
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            double sum = 0.0;
            for (int c = 0; c < 3; c++) {
                for (int d = 0; d < 3; d++) { sum += t[c][i] * hs[c][d] * t[d][k]; }
            }
            m->info[i][k] += sum / 20.0;
            m->pull[i] += sum / 20.0 * m->bias[k];
        }
        for (int c = 0; c < 3; c++) { m->pull[i] -= t[c][i] * gs[c] / 20.0; }
    }
    for (int round = 0; round < 4; round++) {
        double a[3][3], x[3], trace = 0.0;
        memcpy(a, m->info, sizeof a);
        for (int i = 0; i < 3; i++) { a[i][i] += 1.0 / (m->prior * m->prior); }
        for (int i = 0; i < 3; i++) {
            double e[3] = {0.0, 0.0, 0.0};
            e[i] = 1.0;
            solve3(a, e, x);
            trace += x[i];
        }
        solve3(a, m->pull, x);
        m->sigma = sqrt(trace / 3.0);
        memcpy(m->bias, x, sizeof x);
        if (round == 3) { break; }
        m->prior = sqrt((x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + trace + 2.0 * 0.008 * 0.008) / 5.0);
        m->prior = fmin(fmax(m->prior, 0.004), 0.05);
    }
}

/* --- flights ---------------------------------------------------------------------------------------------------- */

static double as_rate(int32_t q24) { return evs_q_to_double(q24, 24); }

static double apart(const double bias[3])
{
    return sqrt(pow(as_rate(b.bias_q24.x) - bias[0], 2) + pow(as_rate(b.bias_q24.y) - bias[1], 2) +
                pow(as_rate(b.bias_q24.z) - bias[2], 2));
}

/* One more pair of a flight with that bias, after what is known of it has been taken out. */
static evs_gyro_bias_pair_t fly(unsigned k, const double bias[3], double noise_px, double outliers)
{
    static uint32_t scratch[EVS_EGOMOTION_BYTES(N) / 4u + 1u];
    const double dt = 1e-6 * INTERVAL_US;
    const scene_settings_t s = scene_settings(noise_px, outliers);
    evs_gyro_bias_pair_t pair = {.flow = flow,
                                 .n = N,
                                 .q_cr = camera_of(k),
                                 .t_us = UINT32_C(0xFFF00000) + k * STEP_US,
                                 .interval_us = INTERVAL_US};
    /* A gyro that reads too much turns the images too far: what is left is the opposite. */
    const evs_vec3_t turn = evs_vec3_from_double(-bias[0] * dt, -bias[1] * dt, -bias[2] * dt, 28);
    const evs_vec3_t left = evs_quat_rotate(evs_quat_conj(pair.q_cr), turn);
    scene_truth_t truth = {{0.0, 0.0, 1.0},
                           {evs_q_to_double(left.x, 28), evs_q_to_double(left.y, 28), evs_q_to_double(left.z, 28)}};
    scene_direction(truth.v);
    scene_make(&s, &truth, flow, N);
    const evs_vec3_t known = evs_gyro_bias_left(&b, pair.q_cr, pair.interval_us);
    for (size_t i = 0u; i < N; i++) { flow[i] = evs_gyro_bias_take_out(flow[i], known); }
    const evs_egomotion_config_t cfg = evs_egomotion_config_default();
    evs_egomotion_result_t result;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_egomotion_solve(&cfg, flow, N, scratch, sizeof scratch, &result));
    pair.v_q30 = result.v_q30;
    pair.noise_q24 = result.noise_q24;
    return pair;
}

static const double BIAS[3] = {0.02, -0.03, 0.012};
static const double NONE[3] = {0.0, 0.0, 0.0};

static void test_nothing_is_known_at_first(void)
{
    const evs_vec3_t left = evs_gyro_bias_left(&b, camera_of(3u), INTERVAL_US);
    TEST_ASSERT_EQUAL_INT32(0, left.x | left.y | left.z);
    const evs_egomotion_flow_t f = {1000, -2000, 3000, -4000};
    const evs_egomotion_flow_t same = evs_gyro_bias_take_out(f, left);
    TEST_ASSERT_EQUAL_MEMORY(&f, &same, sizeof f);
}

static void test_a_rotation_is_taken_out_of_the_flow(void)
{
    const double still[3] = {0.0, 0.0, 0.0};
    const double w[3] = {0.02, -0.015, 0.03};
    for (int i = 0; i < 50; i++) {
        const double x = 1.6 * scene_uniform() - 0.8, y = 1.2 * scene_uniform() - 0.6;
        double uv[2];
        scene_flow(x, y, 1.0, still, w, uv);
        const evs_egomotion_flow_t f =
            evs_gyro_bias_take_out(scene_vector(x, y, uv[0], uv[1]), evs_vec3_from_double(w[0], w[1], w[2], 28));
        TEST_ASSERT_INT32_WITHIN(200, 0, f.u_q24); /* 1e-5 */
        TEST_ASSERT_INT32_WITHIN(200, 0, f.v_q24);
    }
}

static void test_a_bias_is_learnt(void)
{
    double after_10 = 0.0;
    for (unsigned k = 0u; k < 200u; k++) {
        const evs_gyro_bias_pair_t pair = fly(k, BIAS, 0.3, 0.1);
        evs_gyro_bias_learn(&b, &pair);
        if (k == 10u) { after_10 = apart(BIAS); }
    }
    TEST_ASSERT_TRUE_MESSAGE(after_10 < 0.03, "after half a second");
    TEST_ASSERT_TRUE_MESSAGE(apart(BIAS) < 0.005, "after ten seconds");
    TEST_ASSERT_TRUE_MESSAGE(apart(BIAS) < 3.0 * as_rate(b.sigma_q24), "and it knows how well");
    /* What it takes out is what is in there. */
    const evs_vec3_t left = evs_gyro_bias_left(&b, evs_quat_identity(), 1000000u);
    TEST_ASSERT_INT32_WITHIN(1000000, evs_q_from_double(-BIAS[0], 28), left.x);
    TEST_ASSERT_INT32_WITHIN(1000000, evs_q_from_double(-BIAS[1], 28), left.y);
    TEST_ASSERT_INT32_WITHIN(1000000, evs_q_from_double(-BIAS[2], 28), left.z);
}

static void test_where_there_is_none_none_is_found(void)
{
    double worst = 0.0;
    for (unsigned k = 0u; k < 100u; k++) {
        const evs_gyro_bias_pair_t pair = fly(k, NONE, 0.3, 0.1);
        evs_gyro_bias_learn(&b, &pair);
        worst = (apart(NONE) > worst) ? apart(NONE) : worst;
    }
    TEST_ASSERT_TRUE_MESSAGE(worst < 0.006, "on the way");
    TEST_ASSERT_TRUE_MESSAGE(apart(NONE) < 0.002, "in the end");
}

static void test_a_bias_that_changes_is_followed(void)
{
    const double other[3] = {-0.01, 0.01, 0.0};
    for (unsigned k = 0u; k < 1400u; k++) {
        const evs_gyro_bias_pair_t pair = fly(k, (k < 200u) ? BIAS : other, 0.3, 0.0);
        evs_gyro_bias_learn(&b, &pair);
    }
    TEST_ASSERT_TRUE(apart(other) < 0.008);
}

static void test_it_is_what_the_formulas_say(void)
{
    model_t model = {.prior = 0.008};
    double worst = 0.0;
    for (unsigned k = 0u; k < 60u; k++) {
        const evs_gyro_bias_pair_t pair = fly(k, BIAS, 0.3, 0.2);
        model.bias[0] = as_rate(b.bias_q24.x); /* each step from the same point */
        model.bias[1] = as_rate(b.bias_q24.y);
        model.bias[2] = as_rate(b.bias_q24.z);
        model_learn(&model, &pair, (k > 0u) ? STEP_US / 20e6 : 0.0);
        evs_gyro_bias_learn(&b, &pair);
        worst = (apart(model.bias) > worst) ? apart(model.bias) : worst;
        TEST_ASSERT_TRUE_MESSAGE(fabs(as_rate(b.sigma_q24) / model.sigma - 1.0) < 0.02, "sigma");
    }
    TEST_ASSERT_TRUE_MESSAGE(worst < 1e-4, "bias");
}

static void test_what_tells_nothing_changes_nothing(void)
{
    const evs_gyro_bias_t before = b;
    evs_gyro_bias_pair_t pair = fly(0u, BIAS, 0.3, 0.0);
    pair.n = 0u;
    evs_gyro_bias_learn(&b, &pair);
    TEST_ASSERT_EQUAL_MEMORY(&before, &b, sizeof b);
    for (size_t i = 0u; i < N; i++) { flow[i] = (evs_egomotion_flow_t){0, 0, 0, 0}; }
    pair.n = N;
    evs_gyro_bias_learn(&b, &pair);
    TEST_ASSERT_EQUAL_MEMORY(&before, &b, sizeof b);
}

static void test_no_input_overflows(void)
{
    static const int32_t EXTREME[] = {INT32_MIN, INT32_MAX, 0, -1, 1 << 26, -(1 << 26), 1 << 20};
    static const uint32_t INTERVALS[] = {0u, 1u, 120000u, UINT32_MAX};
    for (unsigned k = 0u; k < 400u; k++) {
        evs_gyro_bias_pair_t pair = fly(k, BIAS, 0.3, 0.0);
        for (size_t i = 0u; i < N; i++) {
            if (scene_uniform() < 0.5) { flow[i].x_q24 = EXTREME[(size_t)(7.0 * scene_uniform())]; }
            if (scene_uniform() < 0.5) { flow[i].y_q24 = EXTREME[(size_t)(7.0 * scene_uniform())]; }
            if (scene_uniform() < 0.5) { flow[i].u_q24 = EXTREME[(size_t)(7.0 * scene_uniform())]; }
            if (scene_uniform() < 0.5) { flow[i].v_q24 = EXTREME[(size_t)(7.0 * scene_uniform())]; }
        }
        pair.interval_us = INTERVALS[k % 4u];
        pair.noise_q24 = (k % 3u == 0u) ? 0u : ((k % 3u == 1u) ? UINT32_MAX : pair.noise_q24);
        pair.t_us = (uint32_t)(scene_uniform() * 4294967295.0);
        evs_gyro_bias_learn(&b, &pair);
        const evs_vec3_t left = evs_gyro_bias_left(&b, pair.q_cr, UINT32_MAX);
        const evs_vec3_t far = {INT32_MIN, INT32_MAX, INT32_MIN};
        (void)evs_gyro_bias_take_out(flow[0], left);
        (void)evs_gyro_bias_take_out(flow[1], far);
        TEST_ASSERT_TRUE((b.sigma_q24 >= 0) && (b.sigma_q24 <= 838861 + 1));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_nothing_is_known_at_first);
    RUN_TEST(test_a_rotation_is_taken_out_of_the_flow);
    RUN_TEST(test_a_bias_is_learnt);
    RUN_TEST(test_where_there_is_none_none_is_found);
    RUN_TEST(test_a_bias_that_changes_is_followed);
    RUN_TEST(test_it_is_what_the_formulas_say);
    RUN_TEST(test_what_tells_nothing_changes_nothing);
    RUN_TEST(test_no_input_overflows);
    return UNITY_END();
}
