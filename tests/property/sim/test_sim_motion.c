/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The truth must be self-consistent: what is written as velocity, rate and specific force is compared with numerical
 * derivatives of position and attitude. */
#include <stdio.h>

#include "motion.h"
#include "unity.h"

#define H_S 1e-5 /* (130 Hz * 2 pi * H)^4 / 30 = 1.5e-10 */

static evsim_settings_t settings;
static evsim_motion_t motion;

void setUp(void) {}
void tearDown(void) {}

static void choose(unsigned scene, unsigned kind, uint64_t seed)
{
    evsim_settings_default(&settings, (evsim_scene_kind_t)scene);
    settings.motion = (evsim_motion_kind_t)kind;
    settings.seed = seed;
    evsim_motion_init(&motion, &settings);
}

static evsim_vec_t position(double t_s)
{
    evsim_state_t s;
    evsim_motion_at(&motion, t_s, &s);
    return s.p_w_m;
}

static evsim_vec_t velocity(double t_s)
{
    evsim_state_t s;
    evsim_motion_at(&motion, t_s, &s);
    return s.v_w_m_s;
}

/* Five-point derivative. */
static evsim_vec_t derivative(evsim_vec_t (*f)(double), double t_s)
{
    const evsim_vec_t near = evsim_sub(f(t_s + H_S), f(t_s - H_S));
    const evsim_vec_t far = evsim_sub(f(t_s + 2.0 * H_S), f(t_s - 2.0 * H_S));
    return evsim_scale(1.0 / (12.0 * H_S), evsim_sub(evsim_scale(8.0, near), far));
}

/* The rotation vector from one attitude to the next, in the axes of the first. */
static evsim_vec_t turn(const evsim_quat_t *from, const evsim_quat_t *to)
{
    const evsim_quat_t back = {{from->q[0], -from->q[1], -from->q[2], -from->q[3]}};
    const evsim_quat_t d = evsim_quat_mul(back, *to);
    const double sign = (d.q[0] < 0.0) ? -1.0 : 1.0;
    const evsim_vec_t v = evsim_vec(sign * d.q[1], sign * d.q[2], sign * d.q[3]);
    const double n = evsim_norm(v);
    return (n < 1e-15) ? evsim_vec(0.0, 0.0, 0.0) : evsim_scale(2.0 * atan2(n, sign * d.q[0]) / n, v);
}

static evsim_quat_t rotation(evsim_vec_t v)
{
    const double angle = evsim_norm(v);
    const double scale = (angle < 1e-12) ? 0.5 : sin(0.5 * angle) / angle;
    return (evsim_quat_t){{cos(0.5 * angle), scale * v.v[0], scale * v.v[1], scale * v.v[2]}};
}

static void near_vec(evsim_vec_t want, evsim_vec_t have, double relative, double floor_, const char *what, double t_s)
{
    char text[128];
    const double error = evsim_norm(evsim_sub(want, have));
    (void)snprintf(text, sizeof text, "%s, %s, t = %g", what, evsim_motion_names[settings.motion], t_s);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(relative * evsim_norm(want) + floor_, 0.0, error, text);
}

static void for_every_motion(void (*check)(double t_s))
{
    for (unsigned scene = 0u; scene < EVSIM_SCENES; scene++) {
        for (unsigned kind = 0u; kind < EVSIM_MOTIONS; kind++) {
            for (uint64_t seed = 1u; seed <= 3u; seed++) {
                choose(scene, kind, seed);
                for (int i = -2; i < 40; i++) { check(0.173 * i); }
            }
        }
    }
}

static void check_velocity(double t_s)
{
    evsim_state_t s;
    evsim_motion_at(&motion, t_s, &s);
    near_vec(derivative(position, t_s), s.v_w_m_s, 1e-6, 1e-9, "velocity", t_s);
    near_vec(s.v_w_m_s, evsim_rotate(&s.r_wc, s.v_c_m_s), 1e-12, 1e-12, "velocity in camera axes", t_s);
}

static void check_accelerometer(double t_s)
{
    evsim_state_t s;
    evsim_vec_t force;
    evsim_motion_at(&motion, t_s, &s);
    force = evsim_sub(derivative(velocity, t_s), evsim_vec(0.0, 0.0, -EVSIM_GRAVITY_M_S2));
    near_vec(evsim_rotate_back(&s.r_wc, force), s.f_c_m_s2, 1e-6, 1e-7, "specific force", t_s);
}

static void check_rate(double t_s)
{
    evsim_state_t s;
    evsim_state_t before;
    evsim_state_t after;
    const double h_s = 1e-6;
    evsim_motion_at(&motion, t_s, &s);
    evsim_motion_at(&motion, t_s - h_s, &before);
    evsim_motion_at(&motion, t_s + h_s, &after);
    near_vec(evsim_scale(0.5 / h_s, turn(&before.q_wc, &after.q_wc)), s.w_c_rad_s, 1e-6, 2e-9, "rate", t_s);
}

static void test_position_differentiates_to_velocity(void) { for_every_motion(check_velocity); }
static void test_accelerometer_reads_acceleration_minus_gravity(void) { for_every_motion(check_accelerometer); }
static void test_attitude_differentiates_to_rate(void) { for_every_motion(check_rate); }

static void test_rate_integrates_to_attitude_over_seconds(void)
{
    for (unsigned kind = 0u; kind < EVSIM_MOTIONS; kind++) {
        const double h_s = 1e-4;
        evsim_state_t s;
        evsim_quat_t q;
        choose(EVSIM_SCENE_ROOM, kind, 5u);
        evsim_motion_at(&motion, 0.0, &s);
        q = s.q_wc;
        for (int i = 0; i < 30000; i++) {
            evsim_motion_at(&motion, (i + 0.5) * h_s, &s);
            q = evsim_quat_mul(q, rotation(evsim_scale(h_s, s.w_c_rad_s)));
        }
        evsim_motion_at(&motion, 3.0, &s);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(2e-5, 0.0, evsim_norm(turn(&q, &s.q_wc)), evsim_motion_names[kind]);
    }
}

static void test_motions_are_what_their_names_say(void)
{
    double rate_max = 0.0;
    evsim_state_t s;
    choose(EVSIM_SCENE_ROOM, EVSIM_MOTION_STATIC, 1u);
    evsim_motion_at(&motion, 1.0, &s);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, evsim_norm(s.v_c_m_s));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, evsim_norm(s.w_c_rad_s));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -9.81, s.f_c_m_s2.v[1]); /* y down: the support pushes up. */
    choose(EVSIM_SCENE_PANORAMA, EVSIM_MOTION_SWEEP, 1u);
    evsim_motion_at(&motion, 1.0, &s);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, evsim_norm(s.v_c_m_s));
    TEST_ASSERT_TRUE(evsim_norm(s.w_c_rad_s) > 0.1);
    choose(EVSIM_SCENE_ROOM, EVSIM_MOTION_FLAP, 1u);
    for (int i = 0; i < 1000; i++) { /* Forward flight, pitching at +-6 degrees 5 Hz. */
        evsim_motion_at(&motion, 0.005 * i, &s);
        TEST_ASSERT_TRUE(s.v_c_m_s.v[2] > 0.3);
        rate_max = fmax(rate_max, fabs(s.w_c_rad_s.v[0]));
    }
    TEST_ASSERT_TRUE((rate_max > 3.2) && (rate_max < 4.6)); /* 6 deg * 2 pi 5 Hz = 3.3 rad/s */
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_position_differentiates_to_velocity);
    RUN_TEST(test_accelerometer_reads_acceleration_minus_gravity);
    RUN_TEST(test_attitude_differentiates_to_rate);
    RUN_TEST(test_rate_integrates_to_attitude_over_seconds);
    RUN_TEST(test_motions_are_what_their_names_say);
    return UNITY_END();
}
