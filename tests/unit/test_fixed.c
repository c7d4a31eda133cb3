/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/fixed.h"
#include "evs/float.h"
#include "unity.h"

#include <math.h>

#define PI 3.14159265358979323846

void setUp(void) {}
void tearDown(void) {}

static uint64_t next_random(void)
{
    static uint64_t state = UINT64_C(0x9E3779B97F4A7C15);
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return state;
}

/* Numbers of every size: a random width first, then random bits. */
static uint64_t next_u64(void)
{
    const unsigned down = (unsigned)(next_random() % 64u);
    return next_random() >> down;
}

static void test_saturation_keeps_what_fits_and_clips_the_rest(void)
{
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, evs_sat32((int64_t)INT32_MAX + 1));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, evs_sat32((int64_t)INT32_MIN - 1));
    TEST_ASSERT_EQUAL_INT32(-7, evs_sat32(-7));
    TEST_ASSERT_EQUAL_INT16(INT16_MAX, evs_sat16(40000));
    TEST_ASSERT_EQUAL_INT16(INT16_MIN, evs_sat16(-40000));
    TEST_ASSERT_EQUAL_INT16(-5, evs_sat16(-5));
    TEST_ASSERT_EQUAL_INT32(3, evs_clamp(9, -3, 3));
    TEST_ASSERT_EQUAL_INT32(-3, evs_clamp(-9, -3, 3));
    TEST_ASSERT_EQUAL_INT32(1, evs_clamp(1, -3, 3));
    TEST_ASSERT_TRUE(evs_in_range(-3, -3, 3) && evs_in_range(3, -3, 3));
    TEST_ASSERT_FALSE(evs_in_range(-4, -3, 3) || evs_in_range(4, -3, 3));
    TEST_ASSERT_FALSE(evs_in_range(UINT32_MAX, -3, 3)); /* not the -1 of its bits */
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, evs_add_sat(INT32_MAX, 1));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, evs_sub_sat(0, INT32_MIN));
    TEST_ASSERT_EQUAL_UINT32(UINT32_C(0x80000000), evs_abs_u32(INT32_MIN));
}

static void test_rounding_takes_halves_upwards(void)
{
    static const struct {
        int32_t x;
        int32_t want;
    } CASES[] = {{0, 0}, {1, 0}, {2, 1}, {3, 1}, {5, 1}, {6, 2}, {-1, 0}, {-2, 0}, {-3, -1}, {-6, -1}, {-7, -2}};
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        TEST_ASSERT_EQUAL_INT32(CASES[i].want, evs_shr_r(CASES[i].x, 2));
        TEST_ASSERT_TRUE(evs_shr_r64(CASES[i].x, 2) == CASES[i].want);
    }
    TEST_ASSERT_TRUE(evs_shl64(-3, 40) == INT64_C(-3298534883328));
}

static void test_product_is_within_half_an_lsb(void)
{
    for (int i = 0; i < 20000; i++) {
        const int32_t a = (int32_t)next_random();
        const int32_t b = (int32_t)next_random();
        const double exact = (double)a * (double)b / 1073741824.0;
        const double got = evs_q_mul_sat(a, b, 30);
        const double want = fmin(fmax(exact, -2147483648.0), 2147483647.0);
        TEST_ASSERT_DOUBLE_WITHIN(0.500001, want, got);
        TEST_ASSERT_EQUAL_INT32(evs_q_mul_sat(a, b, 31), evs_q_mul(a, b, 31));
        TEST_ASSERT_EQUAL_INT32((int32_t)floor((double)a * (double)b / 4294967296.0), evs_mul_hi(a, b));
        TEST_ASSERT_EQUAL_UINT32((uint32_t)(((uint64_t)(uint32_t)a * (uint32_t)b) >> 32),
                                 evs_mul_hi_u((uint32_t)a, (uint32_t)b));
    }
}

static void test_leading_zeros_at_every_width(void)
{
    TEST_ASSERT_EQUAL_UINT(32u, evs_clz32(0u));
    TEST_ASSERT_EQUAL_UINT(64u, evs_clz64(0u));
    for (unsigned n = 0; n < 32u; n++) { TEST_ASSERT_EQUAL_UINT(31u - n, evs_clz32(UINT32_C(1) << n)); }
    for (unsigned n = 0; n < 64u; n++) { TEST_ASSERT_EQUAL_UINT(63u - n, evs_clz64(UINT64_C(1) << n)); }
}

static void assert_root(uint64_t x)
{
    const uint64_t root = evs_sqrt_u64(x);
    TEST_ASSERT_TRUE_MESSAGE(root * root <= x, "root too large");
    TEST_ASSERT_TRUE_MESSAGE((root == UINT32_MAX) || ((root + 1u) * (root + 1u) > x), "root too small");
}

static void test_square_root_is_exact_floor(void)
{
    for (uint64_t x = 0; x < 20000u; x++) { assert_root(x); }
    for (uint32_t i = 0; i < 20000u; i++) {
        const uint64_t root = (uint32_t)next_u64();
        const uint64_t square = root * root; /* the numbers where a floor is easily missed by one */
        assert_root(square);
        assert_root(square - (square > 0u));
        assert_root(square + 1u);
        assert_root(next_u64());
    }
    assert_root(UINT64_MAX);
    assert_root(UINT64_C(0xFFFFFFFE00000001)); /* (2^32 - 1)^2 */
}

static void assert_rsqrt(uint64_t x)
{
    unsigned shift;
    const uint32_t r = evs_rsqrt_u64(x, &shift);
    TEST_ASSERT_TRUE(r >= UINT32_C(0x80000000));
    TEST_ASSERT_TRUE((shift >= 32u) && (shift <= 63u));
    const double relative = ldexp((double)r, -(int)shift) * sqrt((double)x) - 1.0;
    TEST_ASSERT_DOUBLE_WITHIN(ldexp(1.0, -28), 0.0, relative);
}

static void test_reciprocal_square_root_is_within_its_bound_over_the_whole_domain(void)
{
    for (uint64_t x = 1; x < 5000u; x++) { assert_rsqrt(x); }
    for (unsigned n = 0; n < 64u; n++) {
        assert_rsqrt(UINT64_C(1) << n);
        assert_rsqrt(UINT64_MAX >> n);
    }
    for (uint64_t step = 0; step < 60000u; step++) { /* the mantissa's two octaves, evenly */
        assert_rsqrt((UINT64_C(1) << 62) + step * UINT64_C(230584300921369));
    }
}

static void assert_recip(uint32_t x)
{
    unsigned shift;
    const uint32_t r = evs_recip_u32(x, &shift);
    TEST_ASSERT_TRUE(r >= UINT32_C(0x80000000));
    TEST_ASSERT_TRUE((shift >= 32u) && (shift <= 63u));
    TEST_ASSERT_DOUBLE_WITHIN(ldexp(1.0, -30), 0.0, ldexp((double)r, -(int)shift) * (double)x - 1.0);
}

static void test_reciprocal_is_within_its_bound_over_the_whole_domain(void)
{
    for (uint32_t x = 1; x < 5000u; x++) { assert_recip(x); }
    for (unsigned n = 0; n < 32u; n++) {
        assert_recip(UINT32_C(1) << n);
        assert_recip(UINT32_MAX >> n);
    }
    for (uint32_t step = 0; step < 60000u; step++) { assert_recip(UINT32_C(0x80000000) + step * 35791u); }
}

static double turn_error_rad(int32_t angle, double want_rad)
{
    return remainder((double)angle / 4294967296.0 * 2.0 * PI - want_rad, 2.0 * PI);
}

static void test_atan2_is_within_4e_9_rad_in_every_direction_and_size(void)
{
    for (int i = 0; i < 40000; i++) {
        const int32_t x = (int32_t)next_u64() * ((i & 1) ? -1 : 1);
        const int32_t y = (int32_t)next_u64() * ((i & 2) ? -1 : 1);
        if ((x == 0) && (y == 0)) { continue; }
        TEST_ASSERT_DOUBLE_WITHIN(4e-9, 0.0, turn_error_rad(evs_atan2(y, x), atan2((double)y, (double)x)));
    }
    for (int i = 0; i < 40000; i++) { /* evenly round the circle, at full scale */
        const double a = 2.0 * PI * i / 40000.0;
        const int32_t x = (int32_t)lround(2147483647.0 * cos(a));
        const int32_t y = (int32_t)lround(2147483647.0 * sin(a));
        TEST_ASSERT_DOUBLE_WITHIN(4e-9, 0.0, turn_error_rad(evs_atan2(y, x), atan2((double)y, (double)x)));
    }
}

static void test_atan2_on_the_axes_and_at_the_extremes(void)
{
    TEST_ASSERT_EQUAL_INT32(0, evs_atan2(0, 0));
    TEST_ASSERT_EQUAL_INT32(0, evs_atan2(0, 5));
    TEST_ASSERT_EQUAL_INT32(EVS_ANGLE_QUARTER_TURN, evs_atan2(5, 0));
    TEST_ASSERT_EQUAL_INT32(-EVS_ANGLE_QUARTER_TURN, evs_atan2(-5, 0));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, evs_atan2(0, -5));
    TEST_ASSERT_DOUBLE_WITHIN(4e-9, 0.0, turn_error_rad(evs_atan2(INT32_MIN, INT32_MIN), -0.75 * PI));
    TEST_ASSERT_DOUBLE_WITHIN(4e-9, 0.0, turn_error_rad(evs_atan2(1, INT32_MIN), PI));
    TEST_ASSERT_DOUBLE_WITHIN(4e-9, 0.0, turn_error_rad(evs_atan2(INT32_MAX, 1), PI / 2));
}

static void test_sine_and_cosine_are_within_3_lsb_all_round(void)
{
    for (uint32_t i = 0; i < 100000u; i++) {
        const int32_t angle = (int32_t)(i * 42949u + (i >> 4));
        int32_t s_q30;
        int32_t c_q30;
        evs_sincos(angle, &s_q30, &c_q30);
        const double a = (double)angle / 4294967296.0 * 2.0 * PI;
        TEST_ASSERT_DOUBLE_WITHIN(3.0, sin(a) * 1073741824.0, (double)s_q30);
        TEST_ASSERT_DOUBLE_WITHIN(3.0, cos(a) * 1073741824.0, (double)c_q30);
    }
    static const int32_t QUARTER[5][3] = {{0, 0, 1}, {1, 1, 0}, {2, 0, -1}, {3, -1, 0}, {4, 0, 1}};
    for (size_t i = 0; i < 5u; i++) {
        int32_t s_q30;
        int32_t c_q30;
        evs_sincos((int32_t)((uint32_t)QUARTER[i][0] << 30), &s_q30, &c_q30);
        TEST_ASSERT_EQUAL_INT32(QUARTER[i][1] * 1073741824, s_q30);
        TEST_ASSERT_EQUAL_INT32(QUARTER[i][2] * 1073741824, c_q30);
    }
}

static void test_angles_convert_to_radians_and_back(void)
{
    TEST_ASSERT_INT32_WITHIN(4, 1 << 28, evs_angle_from_rad((int32_t)lround(PI / 8.0 * 268435456.0)));
    TEST_ASSERT_INT32_WITHIN(1, (int32_t)lround(PI / 2.0 * 268435456.0), evs_rad_from_angle(EVS_ANGLE_QUARTER_TURN));
    for (int i = 0; i < 10000; i++) {
        const int32_t rad_q28 = (int32_t)next_random();
        const double rad = rad_q28 / 268435456.0;
        TEST_ASSERT_DOUBLE_WITHIN(6e-9, 0.0, turn_error_rad(evs_angle_from_rad(rad_q28), rad));
        const int32_t angle = (int32_t)next_random();
        TEST_ASSERT_DOUBLE_WITHIN(1.0, angle / 4294967296.0 * 2.0 * PI * 268435456.0, evs_rad_from_angle(angle));
    }
}

static void assert_exponential(uint32_t got, double want_q16)
{
    if (want_q16 >= 4294967295.0) {
        TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, got);
    } else {
        TEST_ASSERT_DOUBLE_WITHIN(0.5 + want_q16 * ldexp(1.0, -28), want_q16, (double)got);
    }
}

static void test_exponentials_are_within_their_bound_over_the_whole_domain(void)
{
    for (int32_t x_q16 = -20 * 65536; x_q16 < 17 * 65536; x_q16 += 31) {
        assert_exponential(evs_exp2_q16(x_q16), exp2(x_q16 / 65536.0) * 65536.0);
        assert_exponential(evs_exp_q16(x_q16), exp(x_q16 / 65536.0) * 65536.0);
    }
    TEST_ASSERT_EQUAL_UINT32(65536u, evs_exp2_q16(0));
    TEST_ASSERT_EQUAL_UINT32(65536u, evs_exp_q16(0));
    TEST_ASSERT_EQUAL_UINT32(0u, evs_exp2_q16(INT32_MIN));
    TEST_ASSERT_EQUAL_UINT32(0u, evs_exp_q16(INT32_MIN));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, evs_exp2_q16(INT32_MAX));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, evs_exp_q16(INT32_MAX));
}

static void test_float_conversions_round_saturate_and_survive_nan(void)
{
    TEST_ASSERT_EQUAL_INT32(-9830, evs_q_from_double(-0.3, 15));
    TEST_ASSERT_EQUAL_INT32(9830, evs_q_from_float(0.3f, 15));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, evs_q_from_double(1e9, 24));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, evs_q_from_float(-1e9f, 24));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, evs_q_from_float(128.0f, 24));
    TEST_ASSERT_EQUAL_INT32(0, evs_q_from_double((double)NAN, 24));
    TEST_ASSERT_EQUAL_INT32(0, evs_q_from_float(NAN, 24));
    TEST_ASSERT_FALSE(evs_q_fits((double)NAN, 24));
    TEST_ASSERT_FALSE(evs_q_fits(128.0, 24));
    TEST_ASSERT_TRUE(evs_q_fits(-128.0, 24));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.5, evs_q_to_double(3 << 20, 21));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1.5, (double)evs_q_to_float(3 << 20, 21));
    const evs_point_t p = {24, -8};
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1.5, (double)evs_point_x_px(p));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, -0.5, (double)evs_point_y_px(p));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_saturation_keeps_what_fits_and_clips_the_rest);
    RUN_TEST(test_rounding_takes_halves_upwards);
    RUN_TEST(test_product_is_within_half_an_lsb);
    RUN_TEST(test_leading_zeros_at_every_width);
    RUN_TEST(test_square_root_is_exact_floor);
    RUN_TEST(test_reciprocal_square_root_is_within_its_bound_over_the_whole_domain);
    RUN_TEST(test_reciprocal_is_within_its_bound_over_the_whole_domain);
    RUN_TEST(test_atan2_is_within_4e_9_rad_in_every_direction_and_size);
    RUN_TEST(test_atan2_on_the_axes_and_at_the_extremes);
    RUN_TEST(test_sine_and_cosine_are_within_3_lsb_all_round);
    RUN_TEST(test_angles_convert_to_radians_and_back);
    RUN_TEST(test_exponentials_are_within_their_bound_over_the_whole_domain);
    RUN_TEST(test_float_conversions_round_saturate_and_survive_nan);
    return UNITY_END();
}
