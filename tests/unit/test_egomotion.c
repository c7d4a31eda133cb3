/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/egomotion.h"
#include "flow_scene.h"
#include "unity.h"

#include <string.h>

enum { N_MAX = 500 };

static evs_egomotion_flow_t flow[N_MAX];
static uint32_t scratch[EVS_EGOMOTION_PAPER_BYTES(N_MAX) / 4u + 1u];
static evs_egomotion_result_t result;
static evs_egomotion_config_t cfg;

void setUp(void)
{
    cfg = evs_egomotion_config_default();
    scene_seed = 7u;
    memset(&result, 0x5A, sizeof result);
    memset(scratch, 0xA5, sizeof scratch);
}
void tearDown(void) {}

static void solve(size_t n)
{
    const bool robust = cfg.method == EVS_EGOMOTION_ROBUST;
    const size_t bytes = robust ? EVS_EGOMOTION_BYTES(n) : EVS_EGOMOTION_PAPER_BYTES(n);
    memset((unsigned char *)scratch + bytes, 0xA5, 4u);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_egomotion_solve(&cfg, flow, n, scratch, bytes, &result));
    TEST_ASSERT_EACH_EQUAL_HEX8_MESSAGE(0xA5, (unsigned char *)scratch + bytes, 4u, "wrote past the scratch");
}

static scene_truth_t random_truth(void)
{
    scene_truth_t truth = {{0, 0, 1}, {0, 0, 0}};
    scene_direction(truth.v);
    return truth;
}

/* What a flagged result promises. */
static void assert_no_answer(uint32_t flag)
{
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(flag, result.flags & flag, "the cause");
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(0u, result.flags & (uint32_t)EVS_EGOMOTION_VALID, "valid");
    TEST_ASSERT_INT32_WITHIN(2, 843314857, result.sigma_rad_q28);
    for (size_t i = 0; i < 6u; i++) { TEST_ASSERT_EQUAL_INT32(0, result.covariance_rad2_q30[i]); }
    const double length = sqrt((double)evs_vec3_norm_sq(result.v_q30)) / 1073741824.0;
    TEST_ASSERT_TRUE_MESSAGE(fabs(length - 1.0) < 1e-6, "v is no unit vector");
}

static void test_default_settings(void)
{
    TEST_ASSERT_EQUAL_INT(EVS_EGOMOTION_ROBUST, cfg.method);
    TEST_ASSERT_EQUAL_INT(EVS_EGOMOTION_FULL_FLOW, cfg.flow_kind);
    TEST_ASSERT_EQUAL_INT32(0, cfg.rotation_sigma_rad_q28);
    TEST_ASSERT_EQUAL_UINT16(256u, cfg.variance_factor_q8);
}

static evs_status_t try_config(evs_egomotion_config_t c, size_t n, size_t n_scratch)
{
    const evs_egomotion_result_t before = result;
    const evs_status_t status = evs_egomotion_solve(&c, flow, n, scratch, n_scratch, &result);
    if (status != EVS_OK) { TEST_ASSERT_EQUAL_MEMORY(&before, &result, sizeof result); }
    return status;
}

static void test_refuses_bad_settings_and_leaves_the_result(void)
{
    const size_t bytes = EVS_EGOMOTION_BYTES(10);
    evs_egomotion_config_t c = cfg;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_egomotion_solve(NULL, flow, 10, scratch, bytes, &result));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_egomotion_solve(&cfg, NULL, 10, scratch, bytes, &result));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_egomotion_solve(&cfg, flow, 10, NULL, bytes, &result));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_egomotion_solve(&cfg, flow, 10, scratch, bytes, NULL));
    c.flow_kind = EVS_EGOMOTION_NORMAL_FLOW; /* never normal flow */
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, try_config(c, 10, bytes));
    c = cfg;
    c.method = (evs_egomotion_method_t)3;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, try_config(c, 10, bytes));
    c = cfg;
    c.rotation_sigma_rad_q28 = -1;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, try_config(c, 10, bytes));
    c.rotation_sigma_rad_q28 = (INT32_C(1) << 28) + 1;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, try_config(c, 10, bytes));
    c = cfg;
    c.variance_factor_q8 = 255u;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, try_config(c, 10, bytes));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, try_config(cfg, 10, bytes - 1u));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, try_config(cfg, EVS_EGOMOTION_N_MAX + 1u, SIZE_MAX));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE,
                          evs_egomotion_solve(&cfg, flow, 1, (char *)scratch + 2, sizeof scratch - 2u, &result));
}

static void test_exact_flow_gives_the_direction(void)
{
    for (int i = 0; i < 20; i++) {
        const scene_settings_t s = scene_settings(0.0, 0.0);
        const scene_truth_t truth = random_truth();
        scene_make(&s, &truth, flow, N_MAX);
        solve(N_MAX);
        TEST_ASSERT_EQUAL_HEX32(EVS_EGOMOTION_VALID, result.flags);
        TEST_ASSERT_TRUE(scene_error_deg(&result, truth.v) < 0.02);
        TEST_ASSERT_EQUAL_UINT32(N_MAX, result.n_flow);
        TEST_ASSERT_EQUAL_UINT32(0u, result.n_rejected);
    }
}

static void test_noise_and_outliers(void)
{
    double sum = 0.0;
    for (int i = 0; i < 12; i++) {
        const scene_settings_t s = scene_settings(0.5, 0.3);
        const scene_truth_t truth = random_truth();
        scene_make(&s, &truth, flow, N_MAX);
        solve(N_MAX);
        const double error = scene_error_deg(&result, truth.v);
        TEST_ASSERT_EQUAL_HEX32(EVS_EGOMOTION_VALID, result.flags);
        TEST_ASSERT_TRUE(error < 4.0 * scene_sigma_deg(&result));
        TEST_ASSERT_TRUE(result.n_inliers > 300u && result.n_inliers < 420u);
        sum += error;
    }
    TEST_ASSERT_TRUE(sum / 12.0 < 1.3);
}

static void test_inliers_are_those_counted(void)
{
    const scene_settings_t s = scene_settings(0.5, 0.3);
    const scene_truth_t truth = random_truth();
    scene_make(&s, &truth, flow, N_MAX);
    solve(N_MAX);
    uint32_t n = 0u;
    for (size_t i = 0; i < N_MAX; i++) { n += evs_egomotion_is_inlier(&result, &flow[i]) ? 1u : 0u; }
    TEST_ASSERT_EQUAL_UINT32(result.n_inliers, n);
}

static void test_inliers_lie_within_two_and_a_half_sigma(void)
{
    uint32_t n = 0u;
    for (int i = 0; i < 8; i++) {
        const scene_settings_t s = scene_settings(0.3, 0.0);
        const scene_truth_t truth = random_truth();
        scene_make(&s, &truth, flow, N_MAX);
        solve(N_MAX);
        n += result.n_inliers;
    }
    TEST_ASSERT_UINT32_WITHIN(6u * 8u, 490u * 8u, n); /* 98.8 % of a normal distribution; the noise is an estimate */
}

static void test_a_long_vector_keeps_its_direction(void)
{
    const scene_settings_t s = scene_settings(0.05, 0.0);
    const scene_truth_t truth = random_truth();
    scene_make(&s, &truth, flow, 200);
    for (size_t i = 0; i < 20; i++) { /* very close to the camera, up to 200 times as long as the others */
        double uv[2];
        const double way[3] = {0.05 * truth.v[0], 0.05 * truth.v[1], 0.05 * truth.v[2]};
        const double x = scene_uniform() - 0.5;
        const double y = scene_uniform() - 0.5;
        scene_flow(x, y, 0.01 + 0.01 * (double)i, way, truth.w, uv);
        flow[i] = scene_vector(x, y, uv[0], uv[1]);
    }
    solve(200);
    TEST_ASSERT_EQUAL_HEX32(EVS_EGOMOTION_VALID, result.flags);
    for (size_t i = 0; i < 20; i++) { TEST_ASSERT_TRUE(evs_egomotion_is_inlier(&result, &flow[i])); }
    TEST_ASSERT_TRUE(scene_error_deg(&result, truth.v) < 0.2);
}

static void test_no_vector_and_no_motion(void)
{
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_egomotion_solve(&cfg, NULL, 0, NULL, 0, &result));
    assert_no_answer(EVS_EGOMOTION_STILL | EVS_EGOMOTION_FEW);
    memset(flow, 0, sizeof flow);
    solve(N_MAX);
    assert_no_answer(EVS_EGOMOTION_STILL | EVS_EGOMOTION_FEW);
    TEST_ASSERT_EQUAL_UINT32(0u, result.n_flow);
}

static void test_random_directions_are_chance(void)
{
    for (int k = 0; k < 20; k++) {
        for (size_t i = 0; i < N_MAX; i++) {
            const double angle = 2.0 * MODEL_PI * scene_uniform();
            flow[i] = scene_vector(scene_uniform() - 0.5, scene_uniform() - 0.5, 0.01 * cos(angle), 0.01 * sin(angle));
        }
        solve(N_MAX);
        assert_no_answer(EVS_EGOMOTION_CHANCE);
    }
}

/* An answer, and not a confident wrong one. */
static void assert_honest(const double v[3], int *n_valid)
{
    if ((result.flags & (uint32_t)EVS_EGOMOTION_VALID) == 0u) {
        TEST_ASSERT_INT32_WITHIN(2, 843314857, result.sigma_rad_q28);
        return;
    }
    TEST_ASSERT_EQUAL_HEX32(EVS_EGOMOTION_VALID, result.flags);
    TEST_ASSERT_TRUE(scene_error_deg(&result, v) < 5.0 * scene_sigma_deg(&result) + 0.05);
    *n_valid += 1;
}

static void test_five_vectors_are_few(void)
{
    for (int i = 0; i < 20; i++) {
        const scene_settings_t s = scene_settings(0.2, 0.0);
        const scene_truth_t truth = random_truth();
        scene_make(&s, &truth, flow, 5);
        solve(5);
        assert_no_answer(EVS_EGOMOTION_FEW);
    }
}

static void test_equal_flow_is_a_lateral_motion(void)
{
    /* what a plane at constant depth shows to a camera that moves to the left */
    for (size_t i = 0; i < N_MAX; i++) {
        flow[i] = scene_vector(scene_uniform() - 0.5, scene_uniform() - 0.5, 0.01, 0.0);
    }
    solve(N_MAX);
    const double v[3] = {-1.0, 0.0, 0.0};
    int n_valid = 0;
    assert_honest(v, &n_valid);
    TEST_ASSERT_EQUAL_INT(1, n_valid);
    TEST_ASSERT_TRUE(scene_error_deg(&result, v) < 0.1);
    TEST_ASSERT_TRUE(scene_sigma_deg(&result) > 0.01); /* equal vectors are rounded alike: sigma is not nothing */
}

static void test_pure_rotation_is_flagged(void)
{
    for (int i = 0; i < 30; i++) {
        scene_settings_t s = scene_settings((i % 3 == 0) ? 0.0 : 0.3 * (double)(i % 3), 0.1 * (double)(i % 4));
        scene_truth_t truth = {{0, 0, 1}, {0, 0, 0}};
        s.way_m = 0.0;
        scene_direction(truth.w);
        for (int k = 0; k < 3; k++) { truth.w[k] *= 0.0175; } /* 1 degree */
        scene_make(&s, &truth, flow, N_MAX);
        solve(N_MAX);
        TEST_ASSERT_EQUAL_HEX32(0u, result.flags & (uint32_t)EVS_EGOMOTION_VALID);
        TEST_ASSERT_TRUE((result.flags & (uint32_t)(EVS_EGOMOTION_ROTATION | EVS_EGOMOTION_CHANCE)) != 0u);
    }
}

static void test_planes(void)
{
    int n_valid = 0;
    for (int i = 0; i < 20; i++) {
        scene_settings_t s = scene_settings(0.3, 0.1);
        const scene_truth_t truth = random_truth();
        s.depth_low_m = s.depth_high_m = 2.5;
        scene_make(&s, &truth, flow, N_MAX);
        solve(N_MAX);
        assert_honest(truth.v, &n_valid);
    }
    TEST_ASSERT_TRUE(n_valid >= 19);
}

static void test_an_object_that_moves_by_itself(void)
{
    int n_valid = 0;
    for (int i = 0; i < 20; i++) {
        scene_settings_t s = scene_settings(0.2, 0.05);
        const scene_truth_t truth = random_truth();
        s.object_share = 0.3;
        scene_make(&s, &truth, flow, N_MAX);
        solve(N_MAX);
        assert_honest(truth.v, &n_valid);
    }
    TEST_ASSERT_TRUE(n_valid >= 17);
}

static void test_points_behind_give_the_other_sign(void)
{
    /* A scene behind the camera, seen through negative depths: V cannot be told from -V seen in front. */
    const scene_settings_t s = scene_settings(0.0, 0.0);
    const scene_truth_t truth = random_truth();
    scene_make(&s, &truth, flow, 400);
    for (size_t i = 0; i < 200; i++) { /* half of them: then no sign is right */
        flow[i].u_q24 = -flow[i].u_q24;
        flow[i].v_q24 = -flow[i].v_q24;
    }
    solve(400);
    assert_no_answer(EVS_EGOMOTION_SIGN_UNSURE);
}

static void test_positions_out_of_range_are_counted(void)
{
    const scene_settings_t s = scene_settings(0.0, 0.0);
    const scene_truth_t truth = random_truth();
    scene_make(&s, &truth, flow, 200);
    flow[3].x_q24 = INT32_C(8) << 24;
    flow[50].y_q24 = INT32_MIN;
    solve(200);
    TEST_ASSERT_EQUAL_UINT32(2u, result.n_rejected);
    TEST_ASSERT_EQUAL_UINT32(198u, result.n_flow);
    TEST_ASSERT_TRUE(scene_error_deg(&result, truth.v) < 0.05);
}

static void test_wide_views(void)
{
    static const double REACH[] = {1.9, 3.5, 7.5};
    for (size_t k = 0; k < 3u; k++) {
        const scene_truth_t truth = random_truth();
        for (size_t i = 0; i < N_MAX; i++) {
            const double x = REACH[k] * (2.0 * scene_uniform() - 1.0);
            const double y = REACH[k] * (2.0 * scene_uniform() - 1.0);
            double uv[2];
            scene_flow(x, y, 20.0 + 80.0 * scene_uniform(), truth.v, truth.w, uv);
            flow[i] = scene_vector(x, y, uv[0], uv[1]);
        }
        solve(N_MAX);
        TEST_ASSERT_EQUAL_HEX32(EVS_EGOMOTION_VALID, result.flags);
        TEST_ASSERT_EQUAL_UINT32(0u, result.n_rejected);
        TEST_ASSERT_TRUE(scene_error_deg(&result, truth.v) < 0.1);
    }
}

static void test_any_scale_of_flow(void)
{
    const scene_settings_t s = scene_settings(0.2, 0.1);
    const scene_truth_t truth = random_truth();
    scene_make(&s, &truth, flow, N_MAX);
    solve(N_MAX);
    const evs_egomotion_result_t once = result;
    for (size_t i = 0; i < N_MAX; i++) { /* the same flow over an interval 16 times as long */
        flow[i].u_q24 *= 16;
        flow[i].v_q24 *= 16;
    }
    solve(N_MAX);
    TEST_ASSERT_INT32_WITHIN(200000, once.v_q30.x, result.v_q30.x); /* 0.01 degree */
    TEST_ASSERT_INT32_WITHIN(200000, once.v_q30.y, result.v_q30.y);
    TEST_ASSERT_INT32_WITHIN(200000, once.v_q30.z, result.v_q30.z);
    TEST_ASSERT_UINT32_WITHIN(16u, 16u * once.median_flow_q24, result.median_flow_q24);
    TEST_ASSERT_UINT32_WITHIN(result.noise_q24 / 20u, 16u * once.noise_q24, result.noise_q24);
}

static void test_noise_and_median_in_units(void)
{
    const scene_settings_t s = scene_settings(0.5, 0.0);
    const scene_truth_t truth = {{1, 0, 0}, {0, 0, 0}};
    scene_make(&s, &truth, flow, N_MAX);
    solve(N_MAX);
    const double px = 16777216.0 / SCENE_F;
    TEST_ASSERT_TRUE(fabs((double)result.noise_q24 / px - 0.5) < 0.1);
    TEST_ASSERT_TRUE(fabs((double)result.median_flow_q24 / px - 9.95 / 3.0) < 0.3); /* 199 * 0.05 / 3 m */
}

static void test_variance_factor_scales_sigma(void)
{
    const scene_settings_t s = scene_settings(0.5, 0.1);
    const scene_truth_t truth = random_truth();
    scene_make(&s, &truth, flow, N_MAX);
    solve(N_MAX);
    const double once = scene_sigma_deg(&result);
    cfg.variance_factor_q8 = 16u * 256u;
    solve(N_MAX);
    const double before = scene_sigma_deg(&result);
    const int32_t xx = result.covariance_rad2_q30[0];
    TEST_ASSERT_TRUE((before > 2.0 * once) && (before < 4.001 * once)); /* less where other bounds count before */
    cfg.variance_factor_q8 = 4u * 16u * 256u;
    solve(N_MAX);
    TEST_ASSERT_TRUE(fabs(scene_sigma_deg(&result) / before - 2.0) < 0.001);
    TEST_ASSERT_INT32_WITHIN(4 * 64 + 8, 4 * xx, result.covariance_rad2_q30[0]);
}

static void test_covariance_is_of_the_camera_axes(void)
{
    const scene_settings_t s = scene_settings(0.5, 0.1);
    const scene_truth_t truth = random_truth();
    scene_make(&s, &truth, flow, N_MAX);
    solve(N_MAX);
    const int32_t *const c = result.covariance_rad2_q30;
    const double sigma = evs_q_to_double(result.sigma_rad_q28, 28);
    const double trace = ((double)c[0] + (double)c[3] + (double)c[5]) / 1073741824.0;
    TEST_ASSERT_TRUE(fabs(trace / (sigma * sigma) - 1.0) < 0.01);
    const double v[3] = {result.v_q30.x / 1073741824.0, result.v_q30.y / 1073741824.0, result.v_q30.z / 1073741824.0};
    const double along[3] = {c[0] * v[0] + c[1] * v[1] + c[2] * v[2], c[1] * v[0] + c[3] * v[1] + c[4] * v[2],
                             c[2] * v[0] + c[4] * v[1] + c[5] * v[2]};
    for (int k = 0; k < 3; k++) { TEST_ASSERT_TRUE(fabs(along[k]) < 4.0); } /* no spread along v */
}

static void test_rotation_prior(void)
{
    double plain = 0.0;
    double with_prior = 0.0;
    for (int i = 0; i < 10; i++) {
        const scene_settings_t s = scene_settings(0.3, 0.1);
        scene_truth_t truth = random_truth();
        scene_direction(truth.w);
        for (int k = 0; k < 3; k++) { truth.w[k] *= 0.00175; } /* 2 deg/s over 50 ms */
        scene_make(&s, &truth, flow, N_MAX);
        cfg.rotation_sigma_rad_q28 = 0;
        solve(N_MAX);
        TEST_ASSERT_EQUAL_INT32(0, result.rotation_rad_q28.x);
        plain += scene_error_deg(&result, truth.v);
        cfg.rotation_sigma_rad_q28 = evs_q_from_double(0.00175, 28);
        solve(N_MAX);
        TEST_ASSERT_EQUAL_HEX32(EVS_EGOMOTION_VALID, result.flags);
        const double error = scene_error_deg(&result, truth.v);
        with_prior += error;
        TEST_ASSERT_TRUE(error < 4.0 * scene_sigma_deg(&result));
        TEST_ASSERT_TRUE(fabs(evs_q_to_double(result.rotation_rad_q28.x, 28) - truth.w[0]) < 0.0015);
        TEST_ASSERT_TRUE(fabs(evs_q_to_double(result.rotation_rad_q28.y, 28) - truth.w[1]) < 0.0015);
        TEST_ASSERT_TRUE(fabs(evs_q_to_double(result.rotation_rad_q28.z, 28) - truth.w[2]) < 0.0015);
        uint32_t n = 0u;
        for (size_t k = 0; k < N_MAX; k++) { n += evs_egomotion_is_inlier(&result, &flow[k]) ? 1u : 0u; }
        TEST_ASSERT_EQUAL_UINT32(result.n_inliers, n);
    }
    TEST_ASSERT_TRUE(with_prior < 0.6 * plain);
}

static void test_published_estimators(void)
{
    enum { N = 60 };
    const scene_settings_t s = scene_settings(0.02, 0.0);
    scene_truth_t truth = random_truth();
    scene_make(&s, &truth, flow, N);
    cfg.method = EVS_EGOMOTION_PAPER;
    solve(N);
    TEST_ASSERT_EQUAL_HEX32(EVS_EGOMOTION_VALID, result.flags);
    TEST_ASSERT_TRUE(scene_error_deg(&result, truth.v) < 3.0);
    TEST_ASSERT_EQUAL_INT32(0, result.rotation_rad_q28.y);

    truth.w[0] = 0.01;
    truth.w[1] = -0.02;
    truth.w[2] = 0.015;
    scene_make(&s, &truth, flow, N);
    cfg.method = EVS_EGOMOTION_ERL;
    solve(N);
    TEST_ASSERT_EQUAL_HEX32(EVS_EGOMOTION_VALID, result.flags);
    TEST_ASSERT_TRUE(scene_error_deg(&result, truth.v) < 5.0);
    TEST_ASSERT_TRUE(fabs(evs_q_to_double(result.rotation_rad_q28.x, 28) - truth.w[0]) < 0.002);
    TEST_ASSERT_TRUE(fabs(evs_q_to_double(result.rotation_rad_q28.y, 28) - truth.w[1]) < 0.002);
    TEST_ASSERT_TRUE(fabs(evs_q_to_double(result.rotation_rad_q28.z, 28) - truth.w[2]) < 0.002);
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, try_config(cfg, N, EVS_EGOMOTION_PAPER_BYTES(N) - 1u));
}

static void test_extreme_numbers(void)
{
    static const int32_t EXTREME[] = {INT32_MIN,
                                      INT32_MAX,
                                      0,
                                      1,
                                      -1,
                                      INT32_C(8) << 24,
                                      (INT32_C(8) << 24) - 1,
                                      -(INT32_C(8) << 24),
                                      -(INT32_C(8) << 24) - 1,
                                      1 << 20};
    const size_t n = sizeof EXTREME / sizeof EXTREME[0];
    for (int round = 0; round < 20; round++) {
        for (size_t i = 0; i < N_MAX; i++) {
            const evs_egomotion_flow_t f = {
                EXTREME[(size_t)(scene_uniform() * (double)n)], EXTREME[(size_t)(scene_uniform() * (double)n)],
                EXTREME[(size_t)(scene_uniform() * (double)n)], EXTREME[(size_t)(scene_uniform() * (double)n)]};
            flow[i] = f;
        }
        solve(N_MAX);
        TEST_ASSERT_EQUAL_HEX32(0u, result.flags & (uint32_t)EVS_EGOMOTION_VALID);
        TEST_ASSERT_TRUE(result.n_rejected > 0u);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_default_settings);
    RUN_TEST(test_refuses_bad_settings_and_leaves_the_result);
    RUN_TEST(test_exact_flow_gives_the_direction);
    RUN_TEST(test_noise_and_outliers);
    RUN_TEST(test_inliers_are_those_counted);
    RUN_TEST(test_inliers_lie_within_two_and_a_half_sigma);
    RUN_TEST(test_a_long_vector_keeps_its_direction);
    RUN_TEST(test_no_vector_and_no_motion);
    RUN_TEST(test_random_directions_are_chance);
    RUN_TEST(test_five_vectors_are_few);
    RUN_TEST(test_equal_flow_is_a_lateral_motion);
    RUN_TEST(test_pure_rotation_is_flagged);
    RUN_TEST(test_planes);
    RUN_TEST(test_an_object_that_moves_by_itself);
    RUN_TEST(test_points_behind_give_the_other_sign);
    RUN_TEST(test_positions_out_of_range_are_counted);
    RUN_TEST(test_wide_views);
    RUN_TEST(test_any_scale_of_flow);
    RUN_TEST(test_noise_and_median_in_units);
    RUN_TEST(test_variance_factor_scales_sigma);
    RUN_TEST(test_covariance_is_of_the_camera_axes);
    RUN_TEST(test_rotation_prior);
    RUN_TEST(test_published_estimators);
    RUN_TEST(test_extreme_numbers);
    return UNITY_END();
}
