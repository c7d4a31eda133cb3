/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/egomotion.h"
#include "flow_scene.h"
#include "unity.h"

#include <string.h>

enum { N_MAX = 500 };

static evs_egomotion_flow_t flow[N_MAX];
static uint32_t scratch[EVS_EGOMOTION_BYTES(N_MAX) / 4u + 1u];
static evs_egomotion_result_t result;
static evs_egomotion_config_t cfg;

void setUp(void)
{
    cfg = evs_egomotion_config_default();
    scene_seed = 7u;
    memset(&result, 0x5A, sizeof result);
    scratch[EVS_EGOMOTION_BYTES(N_MAX) / 4u] = 0xA5A5A5A5u;
}
void tearDown(void)
{
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(0xA5A5A5A5u, scratch[EVS_EGOMOTION_BYTES(N_MAX) / 4u], "wrote past the scratch");
}

static void solve(size_t n)
{
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_egomotion_solve(&cfg, flow, n, scratch, EVS_EGOMOTION_BYTES(n), &result));
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
            const double angle = 2.0 * SCENE_PI * scene_uniform();
            flow[i] = scene_vector(scene_uniform() - 0.5, scene_uniform() - 0.5, 0.01 * cos(angle), 0.01 * sin(angle));
        }
        solve(N_MAX);
        assert_no_answer(EVS_EGOMOTION_CHANCE);
    }
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
    RUN_TEST(test_no_vector_and_no_motion);
    RUN_TEST(test_random_directions_are_chance);
    RUN_TEST(test_extreme_numbers);
    return UNITY_END();
}
