/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "../../lib/src/evs_scaled.h"
#include "model.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

static double value(evs_scaled_t a) { return ldexp((double)a.m, a.e); }

/* Any size from 2^-60 to 2^60, either sign. */
static evs_scaled_t any(void)
{
    return evs_scaled((int64_t)model_uniform(-1e15, 1e15), (int32_t)model_uniform(-110.0, 10.0));
}

static void assert_close(double expected, evs_scaled_t got, double relative)
{
    TEST_ASSERT_TRUE(fabs(value(got) - expected) <= relative * fabs(expected));
    TEST_ASSERT_TRUE((got.m == 0) ? (got.e == 0)
                                  : ((evs_abs_u32(got.m) >= (1u << 29)) && (evs_abs_u32(got.m) <= (1u << 30))));
}

static void test_integers_are_exact_to_30_bits(void)
{
    static const int64_t X[] = {
        0, 1, -1, 3, 1 << 29, (1 << 30) - 1, 1 << 30, INT64_MAX, INT64_MIN, -(INT64_C(5) << 40)};
    for (size_t i = 0; i < sizeof X / sizeof X[0]; i++) { assert_close((double)X[i], evs_scaled(X[i], 0), 1e-9); }
    assert_close(-12.0, evs_scaled(-3, 2), 0.0);
}

static void test_arithmetic(void)
{
    for (int i = 0; i < 5000; i++) {
        const evs_scaled_t a = any();
        const evs_scaled_t b = any();
        const double x = value(a);
        const double y = value(b);
        const double larger = fmax(fabs(x), fabs(y));
        TEST_ASSERT_TRUE(fabs(value(evs_scaled_add(a, b)) - (x + y)) <= 3e-9 * larger);
        TEST_ASSERT_TRUE(fabs(value(evs_scaled_sub(a, b)) - (x - y)) <= 3e-9 * larger);
        assert_close(x * y, evs_scaled_mul(a, b), 2e-9);
        if (b.m != 0) { assert_close(x / y, evs_scaled_div(a, b), 4e-9); }
        assert_close((x > 0.0) ? sqrt(x) : 0.0, evs_scaled_sqrt(a), 4e-9);
        TEST_ASSERT_EQUAL_INT(fabs(x - y) > 1e-8 * larger ? (x < y) : evs_scaled_less(a, b), evs_scaled_less(a, b));
    }
}

static void test_sums_of_unequal_size(void)
{
    for (int gap = 0; gap < 40; gap++) {
        const evs_scaled_t sum = evs_scaled_add(evs_scaled(INT64_C(1) << 29, 0), evs_scaled(3, 28 - gap));
        TEST_ASSERT_TRUE(fabs(value(sum) - (536870912.0 + ldexp(3.0, 28 - gap))) <= 1.0);
    }
}

static void test_to_fixed_point(void)
{
    TEST_ASSERT_EQUAL_INT32(3 << 20, evs_scaled_to_q(evs_scaled(3, 0), 20));
    TEST_ASSERT_EQUAL_INT32(-3, evs_scaled_to_q(evs_scaled(-3, -5), 5));
    TEST_ASSERT_EQUAL_INT32(1, evs_scaled_to_q(evs_scaled(1, -1), 0)); /* a half rounds up */
    TEST_ASSERT_EQUAL_INT32(0, evs_scaled_to_q(evs_scaled(1, -90), 30));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, evs_scaled_to_q(evs_scaled(1, 40), 0));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, evs_scaled_to_q(evs_scaled(-1, 40), 0));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, evs_scaled_to_q(evs_scaled(1, 0), 31));
    TEST_ASSERT_EQUAL_INT32(0, evs_scaled_to_q(evs_scaled(0, 0), 30));
}

static void test_solves(void)
{
    for (int i = 0; i < 200; i++) {
        const unsigned dim = 1u + (unsigned)i % EVS_SCALED_DIM_MAX;
        double j[8][5], x[5], h[5][5] = {{0}}, b_d[5] = {0};
        evs_scaled_t a[15], b[5];
        unsigned at = 0u;
        for (unsigned k = 0; k < dim; k++) { /* unknowns of very different size */
            const double size = ldexp(1.0, (int)(6u * k));
            x[k] = model_uniform(-1, 1) / size;
            for (unsigned row = 0; row < 8u; row++) { j[row][k] = model_uniform(-1, 1) * size; }
        }
        for (unsigned k = 0; k < dim; k++) {
            for (unsigned l = 0; l < dim; l++) {
                for (unsigned row = 0; row < 8u; row++) { h[k][l] += j[row][k] * j[row][l]; }
                b_d[k] += h[k][l] * x[l];
            }
        }
        for (unsigned k = 0; k < dim; k++) {
            b[k] = evs_scaled((int64_t)ldexp(b_d[k], 30), -30);
            for (unsigned l = 0; l <= k; l++) { a[at++] = evs_scaled((int64_t)ldexp(h[k][l], 12), -12); }
        }
        TEST_ASSERT_TRUE(evs_scaled_solve(a, b, dim));
        for (unsigned k = 0; k < dim; k++) {
            TEST_ASSERT_TRUE(fabs(value(b[k]) - x[k]) <= 0.01 * ldexp(1.0, -(int)(6u * k)));
        }
    }
}

static void test_refuses_what_is_singular(void)
{
    evs_scaled_t zero[1] = {{0, 0}};
    evs_scaled_t negative[1];
    evs_scaled_t equal[3];
    evs_scaled_t b[2];
    negative[0] = evs_scaled(-1, 0);
    for (int i = 0; i < 3; i++) { equal[i] = evs_scaled(7, 0); }
    b[0] = b[1] = evs_scaled(1, 0);
    TEST_ASSERT_FALSE(evs_scaled_solve(zero, b, 1u));
    TEST_ASSERT_FALSE(evs_scaled_solve(negative, b, 1u));
    TEST_ASSERT_FALSE(evs_scaled_solve(equal, b, 2u));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_integers_are_exact_to_30_bits);
    RUN_TEST(test_arithmetic);
    RUN_TEST(test_sums_of_unequal_size);
    RUN_TEST(test_to_fixed_point);
    RUN_TEST(test_solves);
    RUN_TEST(test_refuses_what_is_singular);
    return UNITY_END();
}
