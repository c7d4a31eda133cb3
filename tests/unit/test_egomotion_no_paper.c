/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Ego-motion without the published estimators: this file's own copy of that part takes the place of the library's. */
#define EVS_NO_PAPER 1
#include "../../lib/src/evs_egomotion.c"
#include "flow_scene.h"
#include "unity.h"

enum { N = 60 };

static evs_egomotion_flow_t flow[N];
static uint32_t scratch[EVS_EGOMOTION_PAPER_BYTES(N) / 4u];
static evs_egomotion_result_t result;
static evs_egomotion_config_t cfg;

void setUp(void) { cfg = evs_egomotion_config_default(); }
void tearDown(void) {}

static void test_the_published_methods_are_refused(void)
{
    cfg.method = EVS_EGOMOTION_PAPER;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_egomotion_solve(&cfg, flow, N, scratch, sizeof scratch, &result));
    cfg.method = EVS_EGOMOTION_ERL;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_egomotion_solve(&cfg, flow, N, scratch, sizeof scratch, &result));
}

static void test_the_default_works_as_ever(void)
{
    const scene_settings_t s = scene_settings(0.1, 0.0);
    const scene_truth_t truth = {{0.6, 0.0, 0.8}, {0, 0, 0}};
    scene_make(&s, &truth, flow, N);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_egomotion_solve(&cfg, flow, N, scratch, sizeof scratch, &result));
    TEST_ASSERT_EQUAL_HEX32(EVS_EGOMOTION_VALID, result.flags);
    TEST_ASSERT_TRUE(scene_error_deg(&result, truth.v) < 2.0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_published_methods_are_refused);
    RUN_TEST(test_the_default_works_as_ever);
    return UNITY_END();
}
