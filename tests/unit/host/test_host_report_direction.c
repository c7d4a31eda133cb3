/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "direction.h"

#include <math.h>
#include <string.h>

#include "unity.h"

enum { W = 6, H = 4 };

static evr_flight_t f;
static evr_angles_t angles;

void setUp(void)
{
    memset(&angles, 0, sizeof angles);
    TEST_ASSERT_TRUE(evr_flight_open(&f, W, H));
}
void tearDown(void) { evr_flight_close(&f); }

static void test_a_median_is_within_half_a_step_and_none_is_nan(void)
{
    TEST_ASSERT_TRUE(isnan(evr_angles_median(&angles)));
    for (int i = 0; i < 101; i++) { evr_angles_add(&angles, 0.13 * i); }
    TEST_ASSERT_DOUBLE_WITHIN(EVR_ANGLE_STEP_DEG / 2 + 1e-9, 6.5, evr_angles_median(&angles));
    evr_angles_add(&angles, (double)NAN);
    evr_angles_add(&angles, -1.0);
    TEST_ASSERT_EQUAL_UINT64(101u, angles.total);
    for (int i = 0; i < 300; i++) { evr_angles_add(&angles, 1e9); }
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 180.0, evr_angles_median(&angles));
}

static void test_the_band_is_what_an_axis_sees_of_the_uncertainty(void)
{
    evr_direction_t d = {.t_us = 1005000, .v = {1.0, 0.0, 0.0}, .sigma_rad = 0.1};
    evr_sample_t out[2];
    evr_flight_add(&f, &d, 1000000);
    TEST_ASSERT_EQUAL_size_t(1u, evr_series_samples(&f.component[0].bin[5000 / EVR_SERIES_WIDTH_US], out));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.0, out[0].value);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0, out[0].spread); /* Along the direction nothing changes to first order. */
    TEST_ASSERT_EQUAL_size_t(1u, evr_series_samples(&f.component[1].bin[5000 / EVR_SERIES_WIDTH_US], out));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.1 / sqrt(2.0), out[0].spread);
    TEST_ASSERT_EQUAL_size_t(0u, evr_series_samples(&f.truth[0].bin[5000 / EVR_SERIES_WIDTH_US], out));
    TEST_ASSERT_EQUAL_UINT64(0u, f.error_deg.total);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 0.1 * 57.2958, evr_angles_median(&f.sigma_deg));
}

static void test_a_truth_of_any_length_is_a_direction(void)
{
    evr_direction_t d = {.t_us = 5000, .v = {1.0, 0.0, 0.0}, .sigma_rad = 0.1, .truth = {3.0, 3.0, 0.0}};
    evr_sample_t out[2];
    evr_flight_add(&f, &d, 0);
    TEST_ASSERT_EQUAL_size_t(1u, evr_series_samples(&f.truth[1].bin[5000 / EVR_SERIES_WIDTH_US], out));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, sqrt(0.5), out[0].value);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 45.0, evr_angles_median(&f.error_deg));
}

static void test_the_surest_pair_is_kept_with_its_own_picture(void)
{
    static const double SIGMA_RAD[] = {0.05, 0.02, 0.02, 0.1};
    for (size_t i = 0u; i < 4u; i++) {
        uint8_t px[W * H];
        evr_arrow_t arrows[2] = {{(double)i, 0.0, 1.0, 0.0, true}, {0.0, 0.0, 0.0, 0.0, false}};
        const evr_flow_t flow = {.px = px, .t_us = (int64_t)i, .arrows = arrows, .n = 2u, .sigma_rad = SIGMA_RAD[i]};
        memset(px, (int)i, sizeof px);
        evr_flight_add_flow(&f, &flow, sizeof px);
    }
    TEST_ASSERT_TRUE(f.has_best);
    TEST_ASSERT_EQUAL_INT64(1, f.best.t_us); /* The first of equals. */
    TEST_ASSERT_EACH_EQUAL_UINT8(1, f.best.px, W * H);
    TEST_ASSERT_EQUAL_size_t(2u, f.best.n);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, f.best.arrows[0].x);
}

static void test_too_many_arrows_are_cut(void)
{
    static evr_arrow_t arrows[EVR_ARROWS_MAX + 10u];
    uint8_t px[W * H] = {0};
    const evr_flow_t flow = {.px = px, .arrows = arrows, .n = EVR_ARROWS_MAX + 10u};
    evr_flight_add_flow(&f, &flow, sizeof px);
    TEST_ASSERT_EQUAL_size_t(EVR_ARROWS_MAX, f.best.n);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_median_is_within_half_a_step_and_none_is_nan);
    RUN_TEST(test_the_band_is_what_an_axis_sees_of_the_uncertainty);
    RUN_TEST(test_a_truth_of_any_length_is_a_direction);
    RUN_TEST(test_the_surest_pair_is_kept_with_its_own_picture);
    RUN_TEST(test_too_many_arrows_are_cut);
    return UNITY_END();
}
