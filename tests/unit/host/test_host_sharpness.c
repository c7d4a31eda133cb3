/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "sharpness.h"

#include <math.h>

#include "unity.h"

#include "evs/types.h"

enum { W = 24, H = 18 };

static evl_sharpness_t s;

void setUp(void) { TEST_ASSERT_TRUE(evl_sharpness_open(&s, W, H)); }
void tearDown(void) { evl_sharpness_close(&s); }

static void add(int x_q4, int y_q4, int times)
{
    const evs_point_t p = {(int16_t)x_q4, (int16_t)y_q4};
    for (int i = 0; i < times; i++) { evl_sharpness_add(&s, &p, 1u); }
}

static double gauss(int i)
{
    double sum = 0.0;
    for (int k = -4; k <= 4; k++) { sum += exp(-0.5 * k * k); }
    return ((i < -4) || (i > 4)) ? 0.0 : exp(-0.5 * i * i) / sum;
}

static void test_one_point_gives_the_variance_of_the_kernel(void)
{
    double squares = 0.0;
    for (int y = -4; y <= 4; y++) {
        for (int x = -4; x <= 4; x++) { squares += pow(gauss(x) * gauss(y), 2.0); }
    }
    add(12 * 16, 9 * 16, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, squares / (W * H) - pow(1.0 / (W * H), 2.0), evl_sharpness_value(&s));
    TEST_ASSERT_EQUAL_UINT64(1u, s.n_inside);
}

static void test_a_corner_mirrors_the_kernel(void)
{
    double squares = 0.0;
    for (int y = 0; y <= 4; y++) {
        for (int x = 0; x <= 4; x++) { squares += pow((gauss(x) + gauss(-1 - x)) * (gauss(y) + gauss(-1 - y)), 2.0); }
    }
    add(0, 0, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, squares / (W * H) - pow(1.0 / (W * H), 2.0), evl_sharpness_value(&s));
}

static void test_points_count_at_the_nearest_pixel_halves_up(void)
{
    static const struct {
        int q4;
        int pixel;
    } CASES[] = {{-9, -1}, {-8, 0}, {0, 0}, {7, 0}, {8, 1}, {16 * W - 9, W - 1}, {16 * W - 8, W}};
    for (size_t i = 0u; i < sizeof CASES / sizeof CASES[0]; i++) {
        const bool inside = (CASES[i].pixel >= 0) && (CASES[i].pixel < W);
        evl_sharpness_clear(&s);
        add(CASES[i].q4, 0, 1);
        TEST_ASSERT_EQUAL_UINT64(inside ? 1u : 0u, s.n_inside);
        TEST_ASSERT_EQUAL_UINT64(inside ? 0u : 1u, s.n_off);
        if (inside) { TEST_ASSERT_EQUAL_DOUBLE(1.0, s.count[CASES[i].pixel]); }
    }
}

static void test_a_missing_position_is_not_counted(void)
{
    const evs_point_t none = evs_point_outside();
    evl_sharpness_add(&s, &none, 1u);
    TEST_ASSERT_EQUAL_UINT64(1u, s.n_off);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, evl_sharpness_value(&s));
}

static void test_an_even_picture_has_no_contrast_and_a_pile_has_more_than_a_smear(void)
{
    double smear;
    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++) { add(16 * x, 16 * y, 3); }
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0, evl_sharpness_value(&s));
    evl_sharpness_clear(&s);
    for (int x = 4; x < 14; x++) { add(16 * x, 16 * 9, 1); }
    smear = evl_sharpness_value(&s);
    evl_sharpness_clear(&s);
    add(16 * 9, 16 * 9, 10);
    TEST_ASSERT_TRUE(evl_sharpness_value(&s) > 2.0 * smear);
}

static void test_a_sensor_smaller_than_the_kernel_works(void)
{
    evl_sharpness_t tiny;
    const evs_point_t p = {0, 0};
    TEST_ASSERT_TRUE(evl_sharpness_open(&tiny, 2, 1));
    evl_sharpness_add(&tiny, &p, 1u);
    TEST_ASSERT_TRUE(evl_sharpness_value(&tiny) > 0.0);
    TEST_ASSERT_TRUE(evl_sharpness_value(&tiny) < 0.25);
    evl_sharpness_close(&tiny);
    TEST_ASSERT_FALSE(evl_sharpness_open(&tiny, 0, 5));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_one_point_gives_the_variance_of_the_kernel);
    RUN_TEST(test_a_corner_mirrors_the_kernel);
    RUN_TEST(test_points_count_at_the_nearest_pixel_halves_up);
    RUN_TEST(test_a_missing_position_is_not_counted);
    RUN_TEST(test_an_even_picture_has_no_contrast_and_a_pile_has_more_than_a_smear);
    RUN_TEST(test_a_sensor_smaller_than_the_kernel_works);
    return UNITY_END();
}
