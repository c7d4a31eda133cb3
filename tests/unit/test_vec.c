/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/float.h"
#include "evs/vec.h"
#include "unity.h"

#include <math.h>

#define PI    3.14159265358979323846
#define Q(x)  evs_q_from_double((x), 30)
#define D(x)  evs_q_to_double((x), 30)
#define LSB30 (1.0 / 1073741824.0)

void setUp(void) {}
void tearDown(void) {}

/* The double-precision model. */
typedef struct {
    double w, x, y, z;
} model_quat_t;

static uint32_t seed = 1u;

static double uniform(double lo, double hi)
{
    seed = seed * 1664525u + 1013904223u;
    return lo + (hi - lo) * (double)(seed >> 8) / 16777216.0;
}

static model_quat_t model_random(void)
{
    model_quat_t q = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
    const double n = sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
    return (model_quat_t){q.w / n, q.x / n, q.y / n, q.z / n};
}

static evs_quat_t fixed(model_quat_t q) { return evs_quat_from_double(q.w, q.x, q.y, q.z); }

static model_quat_t model_mul(model_quat_t a, model_quat_t b)
{
    return (model_quat_t){a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                          a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}

static void model_rotate(model_quat_t q, const double v[3], double out[3])
{
    const model_quat_t p = {0.0, v[0], v[1], v[2]};
    const model_quat_t c = {q.w, -q.x, -q.y, -q.z};
    const model_quat_t r = model_mul(model_mul(q, p), c);
    out[0] = r.x;
    out[1] = r.y;
    out[2] = r.z;
}

static void assert_quat(model_quat_t want, evs_quat_t got, double tolerance)
{
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, want.w, D(got.w));
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, want.x, D(got.x));
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, want.y, D(got.y));
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, want.z, D(got.z));
}

static void test_vector_sums_saturate_and_scale_rounds(void)
{
    const evs_vec3_t a = {INT32_MAX, -5, 7};
    const evs_vec3_t b = {1, 2, INT32_MIN};
    const evs_vec3_t sum = evs_vec3_add(a, b);
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, sum.x);
    TEST_ASSERT_EQUAL_INT32(-3, sum.y);
    const evs_vec3_t diff = evs_vec3_sub(a, b);
    TEST_ASSERT_EQUAL_INT32(INT32_MAX - 1, diff.x);
    TEST_ASSERT_EQUAL_INT32(-7, diff.y);
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, diff.z);
    const evs_vec3_t half = evs_vec3_scale((evs_vec3_t){3, -3, INT32_MAX}, 1 << 29, 30);
    TEST_ASSERT_EQUAL_INT32(2, half.x);
    TEST_ASSERT_EQUAL_INT32(-1, half.y);
    TEST_ASSERT_EQUAL_INT32(1 << 30, half.z);
}

static void test_cross_product_follows_the_right_hand(void)
{
    const evs_vec3_t x = {EVS_ONE_Q30, 0, 0};
    const evs_vec3_t y = {0, EVS_ONE_Q30, 0};
    const evs_vec3_t z = evs_vec3_cross(x, y, 30);
    TEST_ASSERT_EQUAL_INT32(0, z.x);
    TEST_ASSERT_EQUAL_INT32(0, z.y);
    TEST_ASSERT_EQUAL_INT32(EVS_ONE_Q30, z.z);
}

static void test_unit_vector_of_any_length_is_within_4_lsb(void)
{
    for (int i = 0; i < 20000; i++) {
        const double size = exp2(uniform(0.0, 30.9));
        const evs_vec3_t v = {(int32_t)(uniform(-1, 1) * size), (int32_t)(uniform(-1, 1) * size),
                              (int32_t)(uniform(-1, 1) * size)};
        evs_vec3_t unit = {1, 2, 3};
        const double n = sqrt((double)v.x * v.x + (double)v.y * v.y + (double)v.z * v.z);
        if (n == 0.0) { continue; }
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_vec3_normalize(v, &unit));
        TEST_ASSERT_DOUBLE_WITHIN(4 * LSB30, v.x / n, D(unit.x));
        TEST_ASSERT_DOUBLE_WITHIN(4 * LSB30, v.y / n, D(unit.y));
        TEST_ASSERT_DOUBLE_WITHIN(4 * LSB30, v.z / n, D(unit.z));
    }
    evs_vec3_t unit = {1, 2, 3};
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_vec3_normalize((evs_vec3_t){0, 0, 0}, &unit));
    TEST_ASSERT_EQUAL_INT32(2, unit.y);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_vec3_normalize((evs_vec3_t){INT32_MIN, INT32_MIN, INT32_MIN}, &unit));
    TEST_ASSERT_DOUBLE_WITHIN(4 * LSB30, -1.0 / sqrt(3.0), D(unit.x));
}

static void test_product_and_conjugate_follow_hamilton(void)
{
    for (int i = 0; i < 5000; i++) {
        const model_quat_t a = model_random();
        const model_quat_t b = model_random();
        assert_quat(model_mul(a, b), evs_quat_mul(fixed(a), fixed(b)), 3 * LSB30);
    }
    const evs_quat_t q = fixed(model_random());
    const evs_quat_t one = evs_quat_mul(q, evs_quat_conj(q));
    assert_quat((model_quat_t){1, 0, 0, 0}, one, 3 * LSB30);
    assert_quat((model_quat_t){1, 0, 0, 0}, evs_quat_identity(), 0.0);
}

static void test_normalize_brings_any_length_to_one(void)
{
    for (int i = 0; i < 5000; i++) {
        const model_quat_t q = model_random();
        const double size = exp2(uniform(3.0, 30.9));
        const evs_quat_t scaled = {(int32_t)(q.w * size), (int32_t)(q.x * size), (int32_t)(q.y * size),
                                   (int32_t)(q.z * size)};
        const double n = sqrt((double)scaled.w * scaled.w + (double)scaled.x * scaled.x + (double)scaled.y * scaled.y +
                              (double)scaled.z * scaled.z);
        evs_quat_t unit;
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_quat_normalize(scaled, &unit));
        assert_quat((model_quat_t){scaled.w / n, scaled.x / n, scaled.y / n, scaled.z / n}, unit, 4 * LSB30);
    }
    evs_quat_t unit = {5, 6, 7, 8};
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_quat_normalize((evs_quat_t){0, 0, 0, 0}, &unit));
    TEST_ASSERT_EQUAL_INT32(5, unit.w);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_quat_normalize((evs_quat_t){INT32_MIN, INT32_MIN, INT32_MIN, INT32_MIN}, &unit));
    assert_quat((model_quat_t){-0.5, -0.5, -0.5, -0.5}, unit, 4 * LSB30);
}

static void test_rotation_of_vectors_agrees_with_the_model_and_with_the_matrix(void)
{
    for (int i = 0; i < 5000; i++) {
        const model_quat_t q = model_random();
        const double v[3] = {uniform(-0.5, 0.5), uniform(-0.5, 0.5), uniform(-0.5, 0.5)};
        double want[3];
        model_rotate(q, v, want);
        const evs_vec3_t got = evs_quat_rotate(fixed(q), evs_vec3_from_double(v[0], v[1], v[2], 30));
        TEST_ASSERT_DOUBLE_WITHIN(5 * LSB30, want[0], D(got.x));
        TEST_ASSERT_DOUBLE_WITHIN(5 * LSB30, want[1], D(got.y));
        TEST_ASSERT_DOUBLE_WITHIN(5 * LSB30, want[2], D(got.z));
        const evs_mat3_t m = evs_quat_to_mat3(fixed(q));
        const evs_vec3_t via = evs_mat3_apply(&m, evs_vec3_from_double(v[0], v[1], v[2], 30));
        TEST_ASSERT_DOUBLE_WITHIN(6 * LSB30, want[0], D(via.x));
        TEST_ASSERT_DOUBLE_WITHIN(6 * LSB30, want[1], D(via.y));
        TEST_ASSERT_DOUBLE_WITHIN(6 * LSB30, want[2], D(via.z));
    }
}

static void test_matrix_of_half_a_turn_is_exact(void)
{
    static const evs_quat_t HALF[] = {{0, EVS_ONE_Q30, 0, 0}, {0, 0, -EVS_ONE_Q30, 0}, {0, 0, 0, EVS_ONE_Q30}};
    for (int axis = 0; axis < 3; axis++) {
        const evs_mat3_t m = evs_quat_to_mat3(HALF[axis]);
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                const int32_t one = (i == axis) ? EVS_ONE_Q30 : -EVS_ONE_Q30;
                TEST_ASSERT_EQUAL_INT32((i == j) ? one : 0, m.m[i][j]);
            }
        }
    }
}

static model_quat_t model_exp(double x, double y, double z)
{
    const double a = sqrt(x * x + y * y + z * z);
    const double s = (a > 1e-12) ? sin(a / 2) / a : 0.5;
    return (model_quat_t){cos(a / 2), x * s, y * s, z * s};
}

static void test_exponential_is_within_its_bound_for_small_and_for_whole_turns(void)
{
    static const double SIZE[] = {1e-6, 1e-3, 0.1, 0.9, 1.1, 3.0, 7.9};
    static const double BOUND_LSB[] = {2, 2, 3, 4, 8, 20, 60}; /* squaring doubles the error */
    for (size_t k = 0; k < sizeof SIZE / sizeof SIZE[0]; k++) {
        for (int i = 0; i < 2000; i++) {
            const evs_vec3_t r = evs_vec3_from_double(uniform(-SIZE[k], SIZE[k]), uniform(-SIZE[k], SIZE[k]),
                                                      uniform(-SIZE[k], SIZE[k]), 28);
            const model_quat_t want =
                model_exp(evs_q_to_double(r.x, 28), evs_q_to_double(r.y, 28), evs_q_to_double(r.z, 28));
            assert_quat(want, evs_quat_from_rotvec(r), BOUND_LSB[k] * LSB30);
        }
    }
    assert_quat((model_quat_t){1, 0, 0, 0}, evs_quat_from_rotvec((evs_vec3_t){0, 0, 0}), 0.0);
}

static void test_logarithm_inverts_the_exponential_up_to_half_a_turn(void)
{
    static const double SIZE[] = {1e-6, 1e-3, 0.0021, 0.1, 1.0, 1.8};
    for (size_t k = 0; k < sizeof SIZE / sizeof SIZE[0]; k++) {
        for (int i = 0; i < 2000; i++) {
            const double r[3] = {uniform(-SIZE[k], SIZE[k]), uniform(-SIZE[k], SIZE[k]), uniform(-SIZE[k], SIZE[k])};
            if (sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]) > PI - 1e-3) { continue; }
            const model_quat_t q = model_exp(r[0], r[1], r[2]);
            const evs_vec3_t got = evs_quat_to_rotvec(fixed(q));
            const evs_vec3_t other = evs_quat_to_rotvec(fixed((model_quat_t){-q.w, -q.x, -q.y, -q.z}));
            TEST_ASSERT_DOUBLE_WITHIN(2e-8, r[0], evs_q_to_double(got.x, 28));
            TEST_ASSERT_DOUBLE_WITHIN(2e-8, r[1], evs_q_to_double(got.y, 28));
            TEST_ASSERT_DOUBLE_WITHIN(2e-8, r[2], evs_q_to_double(got.z, 28));
            TEST_ASSERT_DOUBLE_WITHIN(2e-8, r[0], evs_q_to_double(other.x, 28));
        }
    }
}

static void test_rate_leads_from_one_orientation_to_the_other(void)
{
    const model_quat_t a = model_random();
    const double rate[3] = {3.0, -20.0, 0.5};
    const model_quat_t b = model_mul(a, model_exp(rate[0] * 0.005, rate[1] * 0.005, rate[2] * 0.005));
    evs_vec3_t got = {1, 2, 3};
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_quat_rate(fixed(a), fixed(b), 5000, &got));
    TEST_ASSERT_DOUBLE_WITHIN(5e-6, rate[0], evs_q_to_double(got.x, 24));
    TEST_ASSERT_DOUBLE_WITHIN(5e-6, rate[1], evs_q_to_double(got.y, 24));
    TEST_ASSERT_DOUBLE_WITHIN(5e-6, rate[2], evs_q_to_double(got.z, 24));

    evs_vec3_t untouched = {1, 2, 3};
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_quat_rate(fixed(a), fixed(b), 0, &untouched));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_quat_rate(fixed(a), fixed(b), 10000001, &untouched));
    TEST_ASSERT_EQUAL_INT32(2, untouched.y);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_quat_rate(fixed(a), fixed(model_mul(a, model_exp(2, 0, 0))), 1, &got));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, got.x);
}

static void test_rate_held_for_a_time_is_a_rotation_vector(void)
{
    for (int i = 0; i < 2000; i++) {
        const evs_vec3_t rate = evs_vec3_from_double(uniform(-100, 100), uniform(-7, 7), uniform(-0.01, 0.01), 24);
        const int32_t t_us = (int32_t)uniform(0, 70000);
        const evs_vec3_t r = evs_rotvec_of_rate(rate, t_us);
        TEST_ASSERT_DOUBLE_WITHIN(2e-7, evs_q_to_double(rate.x, 24) * t_us * 1e-6, evs_q_to_double(r.x, 28));
        TEST_ASSERT_DOUBLE_WITHIN(2e-8, evs_q_to_double(rate.y, 24) * t_us * 1e-6, evs_q_to_double(r.y, 28));
        TEST_ASSERT_DOUBLE_WITHIN(1e-8, evs_q_to_double(rate.z, 24) * t_us * 1e-6, evs_q_to_double(r.z, 28));
    }
    const evs_vec3_t far = evs_rotvec_of_rate((evs_vec3_t){INT32_MAX, INT32_MIN, 0}, 1000000);
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, far.x);
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, far.y);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_vector_sums_saturate_and_scale_rounds);
    RUN_TEST(test_cross_product_follows_the_right_hand);
    RUN_TEST(test_unit_vector_of_any_length_is_within_4_lsb);
    RUN_TEST(test_product_and_conjugate_follow_hamilton);
    RUN_TEST(test_normalize_brings_any_length_to_one);
    RUN_TEST(test_rotation_of_vectors_agrees_with_the_model_and_with_the_matrix);
    RUN_TEST(test_matrix_of_half_a_turn_is_exact);
    RUN_TEST(test_exponential_is_within_its_bound_for_small_and_for_whole_turns);
    RUN_TEST(test_logarithm_inverts_the_exponential_up_to_half_a_turn);
    RUN_TEST(test_rate_leads_from_one_orientation_to_the_other);
    RUN_TEST(test_rate_held_for_a_time_is_a_rotation_vector);
    return UNITY_END();
}
