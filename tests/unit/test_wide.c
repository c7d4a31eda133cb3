/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "../../lib/src/evs_wide.h"

#include <math.h>
#include <stddef.h>

#include "unity.h"

#define PI 3.14159265358979323846

static uint64_t state;

void setUp(void) { state = 1u; }
void tearDown(void) {}

/* A random number other than 0, of either sign and any magnitude within 2^bits. */
static int64_t random_within(unsigned bits)
{
    state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    const uint64_t r = state ^ (state >> 33);
    const int64_t magnitude = (int64_t)((r & ((UINT64_C(1) << bits) - 1u)) >> ((state >> 57) % bits)) + 1;
    return (((state >> 40) & 1u) != 0u) ? -magnitude : magnitude;
}

static void test_mul_rounds_half_up_for_both_signs(void)
{
    TEST_ASSERT_EQUAL_INT64(2, evs_wide_mul(3, 128, 8));
    TEST_ASSERT_EQUAL_INT64(-1, evs_wide_mul(-3, 128, 8));
    TEST_ASSERT_EQUAL_INT64(-1, evs_wide_mul(3, -128, 8));
    TEST_ASSERT_EQUAL_INT64(2, evs_wide_mul(-3, -128, 8));
    TEST_ASSERT_EQUAL_INT64(INT64_C(1) << 59, evs_wide_mul(INT64_C(1) << 57, INT64_C(1) << 58, 56));
}

static void test_mul_saturates_instead_of_wrapping(void)
{
    TEST_ASSERT_EQUAL_INT64(EVS_WIDE_MAX, evs_wide_mul(INT64_MAX, INT64_MAX, 8));
    TEST_ASSERT_EQUAL_INT64(-EVS_WIDE_MAX, evs_wide_mul(INT64_MIN, INT64_MAX, 56));
    TEST_ASSERT_EQUAL_INT64(EVS_WIDE_MAX, evs_wide_mul(INT64_MIN, INT64_MIN, 32));
    TEST_ASSERT_EQUAL_INT64(EVS_WIDE_MAX, evs_wide_mul(INT64_C(1) << 46, INT64_C(1) << 46, 32));
    TEST_ASSERT_EQUAL_INT64(EVS_WIDE_MAX - (INT64_C(1) << 28), /* just below the limit: exact */
                            evs_wide_mul((INT64_C(1) << 32) - 1, INT64_C(1) << 60, 32));
}

static void test_mul_is_within_half_an_lsb_of_the_real_product(void)
{
    for (int i = 0; i < 20000; i++) {
        const int64_t a = random_within(40);
        const int64_t b = random_within(40);
        const double want = (double)a * (double)b / 4294967296.0; /* 80 bits: the double rounds to 2^-53 of it */
        TEST_ASSERT_DOUBLE_WITHIN(0.5 + fabs(want) * 3e-16, want, (double)evs_wide_mul(a, b, 32));
    }
}

static void test_division_holds_its_relative_error_over_all_magnitudes(void)
{
    for (int i = 0; i < 20000; i++) {
        const int64_t num = random_within(61);
        const int64_t den = random_within(61);
        const double want = (double)num / (double)den * 4294967296.0;
        if (fabs(want) > 5e17) { continue; }
        TEST_ASSERT_DOUBLE_WITHIN(0.5 + fabs(want) / 1073741824.0, want, (double)evs_wide_div_q32(num, den));
    }
    TEST_ASSERT_EQUAL_INT64(0, evs_wide_div_q32(0, -5));
    TEST_ASSERT_EQUAL_INT64(EVS_WIDE_MAX, evs_wide_div_q32(INT64_C(1) << 61, 1));
    TEST_ASSERT_EQUAL_INT64(-EVS_WIDE_MAX, evs_wide_div_q32(INT64_C(1) << 61, -1));
    TEST_ASSERT_EQUAL_INT64(0, evs_wide_div_q32(1, INT64_C(1) << 61));
}

static void test_hypot_holds_its_relative_error_over_all_magnitudes(void)
{
    for (int i = 0; i < 20000; i++) {
        const int64_t x = random_within(60);
        const int64_t y = random_within(60);
        const double want = sqrt((double)x * (double)x + (double)y * (double)y);
        TEST_ASSERT_DOUBLE_WITHIN(1.0 + want / 1073741824.0, want, (double)evs_wide_hypot(x, y));
    }
    TEST_ASSERT_EQUAL_INT64(0, evs_wide_hypot(0, 0));
    TEST_ASSERT_EQUAL_INT64(5, evs_wide_hypot(3, -4));
    TEST_ASSERT_EQUAL_INT64(5 * (INT64_C(1) << 50), evs_wide_hypot(-3 * (INT64_C(1) << 50), 4 * (INT64_C(1) << 50)));
}

static void test_sine_and_cosine_hold_their_error_from_0_to_pi(void)
{
    for (int i = 0; i <= 4096; i++) {
        const int64_t a = EVS_WIDE_PI_Q32 / 4096 * i;
        int64_t s;
        int64_t c;
        evs_wide_sincos(a, &s, &c);
        const double rad = (double)a / 4294967296.0;
        TEST_ASSERT_DOUBLE_WITHIN(9e-13, sin(rad), (double)s / 72057594037927936.0);
        TEST_ASSERT_DOUBLE_WITHIN(9e-13, cos(rad), (double)c / 72057594037927936.0);
    }
}

static void test_angle_holds_its_error_for_long_and_short_vectors(void)
{
    static const int64_t LENGTHS[] = {1000, INT64_C(1) << 20, INT64_C(1) << 40, (INT64_C(1) << 61) - 1};
    for (size_t k = 0; k < sizeof LENGTHS / sizeof LENGTHS[0]; k++) {
        for (int i = 0; i <= 1000; i++) {
            const int64_t r = (int64_t)((double)LENGTHS[k] * sin(PI * i / 1000.0));
            const int64_t z = (int64_t)((double)LENGTHS[k] * cos(PI * i / 1000.0));
            const double want = atan2((double)r, (double)z);
            TEST_ASSERT_DOUBLE_WITHIN(1.8e-9, want, (double)evs_wide_angle_q32(r, z) / 4294967296.0);
        }
    }
    TEST_ASSERT_INT64_WITHIN(8, 0, evs_wide_angle_q32(0, 1));
    TEST_ASSERT_INT64_WITHIN(8, EVS_WIDE_PI_Q32, evs_wide_angle_q32(0, -1));
    TEST_ASSERT_INT64_WITHIN(8, EVS_WIDE_PI_Q32 / 2, evs_wide_angle_q32(1, 0));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_mul_rounds_half_up_for_both_signs);
    RUN_TEST(test_mul_saturates_instead_of_wrapping);
    RUN_TEST(test_mul_is_within_half_an_lsb_of_the_real_product);
    RUN_TEST(test_division_holds_its_relative_error_over_all_magnitudes);
    RUN_TEST(test_hypot_holds_its_relative_error_over_all_magnitudes);
    RUN_TEST(test_sine_and_cosine_hold_their_error_from_0_to_pi);
    RUN_TEST(test_angle_holds_its_error_for_long_and_short_vectors);
    return UNITY_END();
}
