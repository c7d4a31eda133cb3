/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/stabilize.h"
#include "model.h"
#include "unity.h"

static evs_stabilize_t st;
static evs_pinhole_t davis;

void setUp(void)
{
    davis = (evs_pinhole_t){240u,
                            180u,
                            evs_q_from_double(199.0, 16),
                            evs_q_from_double(198.8, 16),
                            evs_q_from_double(132.2, 16),
                            evs_q_from_double(110.7, 16)};
    const evs_stabilize_config_t cfg = evs_stabilize_config_default(&davis);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_stabilize_init(&st, &cfg));
}
void tearDown(void) {}

static evs_quat_t turn(double x, double y, double z) { return model_to_fixed(model_exp(x, y, z)); }

/* Displacement of the image centre, px, when the camera turns by `angle` about its y axis. */
static double centre_shift(double angle)
{
    const double x = (119.5 - 132.2) / 199.0;
    return fabs(132.2 + 199.0 * (x * cos(angle) + sin(angle)) / (cos(angle) - x * sin(angle)) - 119.5);
}

static void test_init_names_the_fault_and_leaves_the_context_alone(void)
{
    const evs_stabilize_config_t good = evs_stabilize_config_default(&davis);
    TEST_ASSERT_EQUAL_UINT16(640u, good.saccade_px_q4); /* 240 / 6 = 40 px */
    evs_stabilize_config_t bad[7] = {good, good, good, good, good, good, good};
    bad[0].pinhole.fx_q16 = 0;
    bad[1].rotation = (evs_rotation_t)2;
    bad[2].saccade_px_q4 = EVS_POINT_MAX_Q4 + 1;
    bad[3].slice_max_us = 49u;
    bad[4].slice_max_us = 10001u;
    bad[5].slice_blur_q4 = 0u;
    bad[6].slice_blur_q4 = 161u;
    for (size_t i = 0; i < 7u; i++) {
        st.has_reference = true;
        TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_stabilize_init(&st, &bad[i]));
        TEST_ASSERT_TRUE(st.has_reference);
    }
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_stabilize_init(NULL, &good));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_stabilize_init(&st, NULL));
}

static void test_first_window_sets_the_reference_and_does_not_move(void)
{
    TEST_ASSERT_FALSE(evs_stabilize_begin_window(&st, turn(0.4, -1.0, 2.0)));
    const model_quat_t q = model_from_fixed(evs_stabilize_rotation(&st));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 0.0, model_angle(q, (model_quat_t){1, 0, 0, 0}));
    const evs_point_t p = {800, 600};
    evs_point_t out;
    evs_stabilize_map(&st, &p, 1u, &out);
    TEST_ASSERT_EQUAL_INT16(800, out.x_q4);
    TEST_ASSERT_EQUAL_INT16(600, out.y_q4);
}

static void test_points_follow_the_rotation_to_the_reference(void)
{
    const model_quat_t q0 = model_random_rotation(3.0);
    const model_quat_t step = model_exp(0.05, -0.08, 0.11);
    (void)evs_stabilize_begin_window(&st, model_to_fixed(q0));
    evs_stabilize_set_orientation(&st, model_to_fixed(model_mul(q0, step)));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 0.0, model_angle(step, model_from_fixed(evs_stabilize_rotation(&st))));

    const evs_point_t p = {16 * 50, 16 * 140};
    const double ray[3] = {(50.0 - 132.2) / 199.0, (140.0 - 110.7) / 198.8, 1.0};
    double r[3];
    model_rotate(step, ray, r);
    evs_point_t out;
    evs_stabilize_map(&st, &p, 1u, &out);
    TEST_ASSERT_DOUBLE_WITHIN(3.0 / 64.0, 132.2 + 199.0 * r[0] / r[2], out.x_q4 / 16.0);
    TEST_ASSERT_DOUBLE_WITHIN(3.0 / 64.0, 110.7 + 198.8 * r[1] / r[2], out.y_q4 / 16.0);

    evs_homography_t inverse;
    evs_stabilize_inverse(&st, &inverse);
    evs_point_t back;
    evs_homography_map(&inverse, &out, 1u, &back);
    TEST_ASSERT_INT16_WITHIN(1, p.x_q4, back.x_q4);
    TEST_ASSERT_INT16_WITHIN(1, p.y_q4, back.y_q4);
}

static void test_saccade_moves_the_reference_when_the_centre_has_left_a_sixth_of_the_width(void)
{
    double limit = 0.1;
    while (centre_shift(limit) < 40.0) { limit += 1e-5; }
    (void)evs_stabilize_begin_window(&st, turn(0, 0, 0));
    TEST_ASSERT_FALSE(evs_stabilize_begin_window(&st, turn(0, limit - 0.001, 0)));
    TEST_ASSERT_TRUE(evs_stabilize_begin_window(&st, turn(0, limit + 0.001, 0)));
    const model_quat_t q = model_from_fixed(evs_stabilize_rotation(&st));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 0.0, model_angle(q, (model_quat_t){1, 0, 0, 0}));
    TEST_ASSERT_FALSE(evs_stabilize_begin_window(&st, turn(0, limit + 0.1, 0))); /* counts from the new reference */
}

static void test_saccade_notices_a_centre_that_is_out_of_sight(void)
{
    (void)evs_stabilize_begin_window(&st, turn(0, 0, 0));
    TEST_ASSERT_TRUE(evs_stabilize_begin_window(&st, turn(0, 3.0, 0)));
}

static void test_roll_about_the_image_centre_is_no_saccade(void)
{
    /* The axis through the image centre: its ray, normalized. */
    const double x = (119.5 - 132.2) / 199.0, y = (89.5 - 110.7) / 198.8, n = sqrt(x * x + y * y + 1.0);
    (void)evs_stabilize_begin_window(&st, turn(0, 0, 0));
    TEST_ASSERT_FALSE(evs_stabilize_begin_window(&st, turn(2.5 * x / n, 2.5 * y / n, 2.5 / n)));
}

static void test_saccades_can_be_turned_off(void)
{
    evs_stabilize_config_t cfg = evs_stabilize_config_default(&davis);
    cfg.saccade_px_q4 = EVS_STABILIZE_SACCADE_OFF;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_stabilize_init(&st, &cfg));
    (void)evs_stabilize_begin_window(&st, turn(0, 0, 0));
    TEST_ASSERT_FALSE(evs_stabilize_begin_window(&st, turn(0, 1.5, 0)));
    TEST_ASSERT_FALSE(evs_stabilize_begin_window(&st, turn(0, 3.0, 0)));
}

static void test_reset_forgets_the_reference(void)
{
    (void)evs_stabilize_begin_window(&st, turn(0, 0, 0));
    evs_stabilize_reset(&st);
    TEST_ASSERT_FALSE(evs_stabilize_begin_window(&st, turn(0, 1.0, 0)));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 1.0, evs_q_to_double(evs_stabilize_rotation(&st).w, 30));
}

static void test_slice_shrinks_so_that_no_point_smears_more_than_allowed(void)
{
    static const double RATES[] = {0.0, 0.5, 2.0, 2.6, 5.0, 35.0, 120.0};
    for (size_t i = 0; i < sizeof RATES / sizeof RATES[0]; i++) {
        const uint32_t slice_us = evs_stabilize_slice_us(&st, evs_vec3_from_double(0, RATES[i], 0, 24));
        TEST_ASSERT_TRUE((slice_us >= 50u) && (slice_us <= 1000u));
        if (slice_us > 50u) { TEST_ASSERT_TRUE(RATES[i] * 199.0 * slice_us * 1e-6 / 2.0 <= 0.25 * 1.01); }
    }
    TEST_ASSERT_EQUAL_UINT32(1000u, evs_stabilize_slice_us(&st, evs_vec3_from_double(0, 0, 0, 24)));
    TEST_ASSERT_UINT32_WITHIN(8u, 502u, evs_stabilize_slice_us(&st, evs_vec3_from_double(3, 0, 4, 24)));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_names_the_fault_and_leaves_the_context_alone);
    RUN_TEST(test_first_window_sets_the_reference_and_does_not_move);
    RUN_TEST(test_points_follow_the_rotation_to_the_reference);
    RUN_TEST(test_saccade_moves_the_reference_when_the_centre_has_left_a_sixth_of_the_width);
    RUN_TEST(test_saccade_notices_a_centre_that_is_out_of_sight);
    RUN_TEST(test_roll_about_the_image_centre_is_no_saccade);
    RUN_TEST(test_saccades_can_be_turned_off);
    RUN_TEST(test_reset_forgets_the_reference);
    RUN_TEST(test_slice_shrinks_so_that_no_point_smears_more_than_allowed);
    return UNITY_END();
}
