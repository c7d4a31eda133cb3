/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/homography.h"
#include "model.h"
#include "unity.h"

enum { N = 256 };

static evs_point_t in[N];
static evs_point_t out[N + 1];

void setUp(void) { out[N] = (evs_point_t){0x5A5A, 0x5A5A}; }
void tearDown(void) { TEST_ASSERT_EQUAL_HEX16_MESSAGE(0x5A5A, out[N].x_q4, "wrote past the output"); }

static evs_pinhole_t pinhole(uint16_t w, uint16_t h, double fx, double fy, double cx, double cy)
{
    const evs_pinhole_t k = {w,
                             h,
                             evs_q_from_double(fx, 16),
                             evs_q_from_double(fy, 16),
                             evs_q_from_double(cx, 16),
                             evs_q_from_double(cy, 16)};
    return k;
}

#define N_CAMERAS 5
static evs_pinhole_t camera(size_t i)
{
    switch (i) {
    case 0:
        return pinhole(240, 180, 199.092366542, 198.82882047, 132.192071378, 110.712660011);
    case 1:
        return pinhole(346, 260, 226.38, 226.15, 173.65, 133.73);
    case 2:
        return pinhole(640, 480, 327.32, 327.46, 304.97, 235.41);
    case 3:
        return pinhole(1280, 720, 1060.0, 1062.0, 630.0, 370.0);
    default:
        return pinhole(128, 128, 70.0, 75.0, 60.0, 66.0);
    }
}

/* Depth ratio and mapped position of a point in double precision. */
static double model_map(const evs_pinhole_t *k, model_quat_t q, evs_point_t p, double *x_px, double *y_px)
{
    const double fx = evs_q_to_double(k->fx_q16, 16), fy = evs_q_to_double(k->fy_q16, 16);
    const double cx = evs_q_to_double(k->cx_q16, 16), cy = evs_q_to_double(k->cy_q16, 16);
    const double ray[3] = {(p.x_q4 / 16.0 - cx) / fx, (p.y_q4 / 16.0 - cy) / fy, 1.0};
    double r[3];
    model_rotate(q, ray, r);
    *x_px = cx + fx * r[0] / r[2];
    *y_px = cy + fy * r[1] / r[2];
    return r[2];
}

static evs_point_t random_point(double half_range_px, double cx, double cy)
{
    const evs_point_t p = {(int16_t)(16.0 * (cx + model_uniform(-half_range_px, half_range_px))),
                           (int16_t)(16.0 * (cy + model_uniform(-half_range_px, half_range_px)))};
    return p;
}

static void assert_point(const evs_pinhole_t *k, model_quat_t q, evs_point_t p, evs_point_t got)
{
    double x, y;
    const double depth = model_map(k, q, p, &x, &y);
    /* At the edge of what a point can hold, or of what lies in front, either answer is right. */
    const double edge = 2047.0;
    const bool surely_out = (depth < -1e-6) || (fabs(x) > edge + 0.1) || (fabs(y) > edge + 0.1);
    const bool surely_in = (depth > 1e-6) && (fabs(x) < edge - 0.1) && (fabs(y) < edge - 0.1);
    if (surely_out) { TEST_ASSERT_TRUE_MESSAGE(evs_point_is_outside(got), "an invented point"); }
    if (surely_in) {
        TEST_ASSERT_FALSE_MESSAGE(evs_point_is_outside(got), "a lost point");
        TEST_ASSERT_DOUBLE_WITHIN(3.0 / 64.0, x, got.x_q4 / 16.0);
        TEST_ASSERT_DOUBLE_WITHIN(3.0 / 64.0, y, got.y_q4 / 16.0);
    }
    if (evs_point_is_outside(got)) { TEST_ASSERT_EQUAL_INT16(EVS_POINT_OUTSIDE_Q4, got.y_q4); }
}

static void check_rotations(double max_rad, double range_factor)
{
    for (size_t c = 0; c < N_CAMERAS; c++) {
        const evs_pinhole_t k = camera(c);
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pinhole_check(&k));
        for (int rotation = 0; rotation < 60; rotation++) {
            const evs_quat_t q_fixed = model_to_fixed(model_random_rotation(max_rad));
            const model_quat_t q = model_normalize(model_from_fixed(q_fixed));
            evs_homography_t h;
            evs_homography_set(&h, &k, q_fixed);
            for (int i = 0; i < N; i++) {
                in[i] = random_point(k.width_px * range_factor, k.width_px / 2.0, k.height_px / 2.0);
            }
            in[100] = evs_point_outside();
            evs_homography_map(&h, in, N, out);
            TEST_ASSERT_TRUE(evs_point_is_outside(out[100]));
            for (int i = 0; i < N; i++) {
                if (i != 100) { assert_point(&k, q, in[i], out[i]); }
            }
        }
    }
}

static void test_rotations_up_to_the_saccade_limit_are_within_3_64_px(void) { check_rotations(0.4, 0.55); }
static void test_points_far_off_the_sensor_are_no_worse(void) { check_rotations(0.4, 0.75); }
static void test_any_rotation_gives_the_right_point_or_the_marker(void) { check_rotations(9.0, 0.7); }

static void test_batch_gives_the_bits_of_one_point_at_a_time(void)
{
    for (size_t c = 0; c < N_CAMERAS; c++) {
        const evs_pinhole_t k = camera(c);
        for (int rotation = 0; rotation < 40; rotation++) {
            evs_homography_t h;
            evs_homography_set(&h, &k, model_to_fixed(model_random_rotation((rotation % 2) ? 0.3 : 2.0)));
            for (int i = 0; i < N; i++) { in[i] = random_point(k.width_px, k.width_px / 2.0, k.height_px / 2.0); }
            for (int i = 0; i < N; i += 37) { in[i] = evs_point_outside(); }
            in[1] = (evs_point_t){EVS_POINT_MAX_Q4, -EVS_POINT_MAX_Q4};
            in[2] = (evs_point_t){-EVS_POINT_MAX_Q4, EVS_POINT_MAX_Q4};
            evs_homography_map(&h, in, N, out);
            for (int i = 0; i < N; i++) {
                evs_point_t one;
                evs_homography_map(&h, &in[i], 1u, &one);
                TEST_ASSERT_EQUAL_INT16(one.x_q4, out[i].x_q4);
                TEST_ASSERT_EQUAL_INT16(one.y_q4, out[i].y_q4);
            }
            evs_homography_map(&h, in, N, in); /* in place */
            TEST_ASSERT_EQUAL_MEMORY(out, in, sizeof in);
        }
    }
}

static void test_identity_leaves_every_point_where_it_is(void)
{
    for (size_t c = 0; c < N_CAMERAS; c++) {
        const evs_pinhole_t k = camera(c);
        evs_homography_t h;
        evs_homography_set(&h, &k, evs_quat_identity());
        for (int32_t x = -EVS_POINT_MAX_Q4; x <= EVS_POINT_MAX_Q4; x += 13) {
            const evs_point_t p = {(int16_t)x, (int16_t)((x * 7) % EVS_POINT_MAX_Q4)};
            evs_point_t same;
            evs_homography_map(&h, &p, 1u, &same);
            TEST_ASSERT_EQUAL_INT16(p.x_q4, same.x_q4);
            TEST_ASSERT_EQUAL_INT16(p.y_q4, same.y_q4);
        }
    }
}

static void test_pinhole_check_refuses_each_field_out_of_range(void)
{
    evs_pinhole_t bad[9];
    for (size_t i = 0; i < 9u; i++) { bad[i] = camera(0); }
    bad[0].width_px = 0u;
    bad[1].height_px = EVS_SENSOR_MAX_PX + 1u;
    bad[2].fx_q16 = 0;
    bad[3].fy_q16 = EVS_PINHOLE_FOCAL_MAX_Q16 + 1;
    bad[4].fx_q16 = -bad[4].fx_q16;
    bad[5].cx_q16 = EVS_PINHOLE_CENTRE_MAX_Q16 + 1;
    bad[6].cy_q16 = -EVS_PINHOLE_CENTRE_MAX_Q16 - 1;
    bad[7].fx_q16 = bad[7].fy_q16 * 2 + 2;
    bad[8].fy_q16 = bad[8].fx_q16 * 2 + 2;
    for (size_t i = 0; i < 9u; i++) { TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_pinhole_check(&bad[i])); }
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_pinhole_check(NULL));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_rotations_up_to_the_saccade_limit_are_within_3_64_px);
    RUN_TEST(test_points_far_off_the_sensor_are_no_worse);
    RUN_TEST(test_any_rotation_gives_the_right_point_or_the_marker);
    RUN_TEST(test_batch_gives_the_bits_of_one_point_at_a_time);
    RUN_TEST(test_identity_leaves_every_point_where_it_is);
    RUN_TEST(test_pinhole_check_refuses_each_field_out_of_range);
    return UNITY_END();
}
