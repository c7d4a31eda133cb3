/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/attitude.h"
#include "evs/axis_map.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define PI      3.14159265358979323846
#define DEG     (PI / 180.0)
#define G       9.80665
#define FIELD_H 20.0 /* uT, a mid-latitude field */
#define FIELD_V (-40.0)
#define STEP_US 5000

static evs_attitude_t att;
static uint32_t now_us;

/* --- real numbers and back ------------------------------------------------------------------------------------- */

typedef struct {
    double w, x, y, z;
} quat_d;

static int32_t to_q(double x, int n)
{
    const double v = floor(ldexp(x, n) + 0.5);
    if (v >= 2147483647.0) { return INT32_MAX; }
    return (v <= -2147483648.0) ? INT32_MIN : (int32_t)v;
}
static evs_vec3_t vec(double x, double y, double z, int n)
{
    const evs_vec3_t v = {to_q(x, n), to_q(y, n), to_q(z, n)};
    return v;
}
static quat_d quat(double w, double x, double y, double z)
{
    const quat_d q = {w, x, y, z};
    return q;
}
static quat_d conj_d(quat_d q) { return quat(q.w, -q.x, -q.y, -q.z); }
static quat_d mul_d(quat_d a, quat_d b)
{
    return quat(a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w);
}
static quat_d turn_d(double x, double y, double z)
{
    const double angle = sqrt(x * x + y * y + z * z);
    const double s = (angle > 0.0) ? sin(angle / 2.0) / angle : 0.5;
    return quat(cos(angle / 2.0), s * x, s * y, s * z);
}
static evs_quat_t quat_q30(quat_d q)
{
    const evs_quat_t r = {to_q(q.w, 30), to_q(q.x, 30), to_q(q.y, 30), to_q(q.z, 30)};
    return r;
}
static quat_d orientation(void)
{
    const evs_quat_t q = evs_attitude_orientation(&att);
    return quat(ldexp(q.w, -30), ldexp(q.x, -30), ldexp(q.y, -30), ldexp(q.z, -30));
}
/* v of the world, as seen by the IMU at orientation q. */
static evs_vec3_t seen(quat_d q, double x, double y, double z, int n)
{
    const quat_d v = mul_d(mul_d(conj_d(q), quat(0.0, x, y, z)), q);
    return vec(v.x, v.y, v.z, n);
}
static double error_deg(quat_d truth)
{
    const quat_d e = mul_d(orientation(), conj_d(truth));
    return 2.0 * asin(fmin(1.0, sqrt(e.x * e.x + e.y * e.y + e.z * e.z))) / DEG;
}
static double tilt_error_deg(quat_d truth)
{
    const quat_d e = mul_d(orientation(), conj_d(truth));
    return 2.0 * acos(fmin(1.0, sqrt(e.w * e.w + e.z * e.z))) / DEG;
}
static double norm_error(void)
{
    const quat_d q = orientation();
    return fabs(sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z) - 1.0);
}

/* --- driving the filter ---------------------------------------------------------------------------------------- */

static void start(const evs_attitude_config_t *cfg)
{
    const evs_attitude_config_t standard = evs_attitude_config_default();
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_init(&att, (cfg != NULL) ? cfg : &standard));
}
static bool flag(uint32_t bit) { return (evs_attitude_flags(&att) & bit) != 0u; }

/* One step of all sensors of a carrier that turns at a constant body rate (rad/s) and is not accelerated. */
static quat_d step(quat_d truth, double wx, double wy, double wz, bool with_mag)
{
    const double dt = STEP_US * 1e-6;
    truth = mul_d(truth, turn_d(wx * dt, wy * dt, wz * dt));
    now_us += STEP_US;
    evs_attitude_push_gyro(&att, now_us, vec(wx, wy, wz, 24));
    evs_attitude_push_accel(&att, now_us, seen(truth, 0.0, 0.0, G, 20));
    if (with_mag) { evs_attitude_push_mag(&att, now_us, seen(truth, 0.0, FIELD_H, FIELD_V, 16)); }
    return truth;
}
static void rest_for(double seconds, quat_d truth, double bias, bool with_mag)
{
    for (int i = 0; i < (int)(seconds * 1e6 / STEP_US); i++) {
        now_us += STEP_US;
        evs_attitude_push_gyro(&att, now_us, vec(bias, -bias, bias / 2.0, 24));
        evs_attitude_push_accel(&att, now_us, seen(truth, 0.0, 0.0, G, 20));
        if (with_mag) { evs_attitude_push_mag(&att, now_us, seen(truth, 0.0, FIELD_H, FIELD_V, 16)); }
    }
}

void setUp(void)
{
    now_us = UINT32_MAX - 100000u; /* every test crosses the wrap of the clock */
    start(NULL);
}
void tearDown(void) { TEST_ASSERT_DOUBLE_WITHIN(4e-9, 0.0, norm_error()); }

/* --- set up ---------------------------------------------------------------------------------------------------- */

static void test_init_names_the_fault_and_leaves_the_context_alone(void)
{
    evs_attitude_config_t bad[14];
    for (int i = 0; i < 14; i++) { bad[i] = evs_attitude_config_default(); }
    bad[0].mode = (evs_attitude_mode_t)3;
    bad[1].gyro_limit_rad_s_q24 = 100;
    bad[2].gyro_limit_rad_s_q24 = -1;
    bad[3].tau_accel_ms = 99u;
    bad[4].tau_accel_ms = 60001u;
    bad[5].tau_mag_ms = 99u;
    bad[6].tau_recover_ms = 49u;
    bad[7].gap_max_ms = 1001u;
    bad[8].accel_max_m_s2 = 19u;
    bad[9].rest_time_ms = 199u;
    bad[10].rest_gyro_mrad_s = 0u;
    bad[11].rest_accel_mm_s2 = 9u;
    bad[12].bias_max_mrad_s = 501u;
    bad[13].mag_tolerance_permille = 9u;
    evs_attitude_t before;
    memcpy(&before, &att, sizeof before);
    for (int i = 0; i < 14; i++) {
        TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_attitude_init(&att, &bad[i]));
        TEST_ASSERT_EQUAL_MEMORY(&before, &att, sizeof att);
    }
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_attitude_init(NULL, &bad[0]));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_attitude_init(&att, NULL));
}

static void test_before_any_sample_the_orientation_is_identity_and_nothing_is_known(void)
{
    TEST_ASSERT_EQUAL_DOUBLE(0.0, error_deg(quat(1.0, 0.0, 0.0, 0.0)));
    TEST_ASSERT_EQUAL_UINT32(0u, evs_attitude_flags(&att));
}

static void test_reset_forgets_everything_but_the_settings(void)
{
    evs_attitude_config_t cfg = evs_attitude_config_default();
    cfg.tau_accel_ms = 1234u;
    start(&cfg);
    evs_attitude_t fresh;
    memcpy(&fresh, &att, sizeof fresh);
    rest_for(5.0, turn_d(0.3, 0.2, 0.1), 0.01, true);
    TEST_ASSERT_TRUE(memcmp(&fresh, &att, sizeof att) != 0);
    evs_attitude_reset(&att);
    TEST_ASSERT_EQUAL_MEMORY(&fresh, &att, sizeof att);
}

/* --- the start ------------------------------------------------------------------------------------------------- */

static void test_first_acceleration_levels_at_once_and_keeps_the_heading(void)
{
    for (int i = 0; i < 36; i++) {
        start(NULL);
        const double direction = i * 10.0 * DEG;
        const double tilt = (i * 5.0 + 2.0) * DEG; /* up to 177 deg */
        const quat_d truth = turn_d(tilt * cos(direction), tilt * sin(direction), 0.0);
        evs_attitude_push_accel(&att, now_us, seen(truth, 0.0, 0.0, G, 20));
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.0, error_deg(truth)); /* the shortest way up: no heading of its own */
        TEST_ASSERT_TRUE(flag(EVS_ATTITUDE_TILT_KNOWN));
        TEST_ASSERT_FALSE(flag(EVS_ATTITUDE_HEADING_KNOWN));
    }
}

static void test_first_acceleration_exactly_upside_down_is_answered(void)
{
    evs_attitude_push_accel(&att, now_us, vec(0.0, 0.0, -G, 20));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.0, tilt_error_deg(quat(0.0, 1.0, 0.0, 0.0)));
}

static void test_first_field_turns_to_north_at_once(void)
{
    for (int i = 0; i < 36; i++) {
        start(NULL);
        const quat_d truth = mul_d(turn_d(0.0, 0.0, i * 10.0 * DEG), turn_d(0.5, -0.7, 0.0));
        evs_attitude_push_accel(&att, now_us, seen(truth, 0.0, 0.0, G, 20));
        evs_attitude_push_mag(&att, now_us, seen(truth, 0.0, FIELD_H, FIELD_V, 16));
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.0, error_deg(truth));
        TEST_ASSERT_TRUE(flag(EVS_ATTITUDE_HEADING_KNOWN));
    }
}

static void test_declination_turns_magnetic_into_true_north(void)
{
    evs_attitude_config_t cfg = evs_attitude_config_default();
    cfg.declination = to_q(10.0 / 360.0, 32); /* the needle points 10 deg east of north */
    start(&cfg);
    evs_attitude_push_accel(&att, now_us, vec(0.0, 0.0, G, 20));
    evs_attitude_push_mag(&att, now_us, vec(FIELD_H * sin(10.0 * DEG), FIELD_H * cos(10.0 * DEG), FIELD_V, 16));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.0, error_deg(quat(1.0, 0.0, 0.0, 0.0)));
}

static void test_given_orientation_is_taken_as_it_is(void)
{
    const quat_d truth = mul_d(turn_d(0.0, 0.0, 2.0), turn_d(0.4, -0.3, 0.0));
    const evs_quat_t half = {to_q(truth.w, 29), to_q(truth.x, 29), to_q(truth.y, 29), to_q(truth.z, 29)};
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_set_orientation(&att, half)); /* of any length */
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.0, error_deg(truth));
    TEST_ASSERT_TRUE(flag(EVS_ATTITUDE_TILT_KNOWN));
    TEST_ASSERT_TRUE(flag(EVS_ATTITUDE_HEADING_KNOWN));
    TEST_ASSERT_FALSE(flag(EVS_ATTITUDE_SETTLING));
    rest_for(20.0, truth, 0.0, false);
    TEST_ASSERT_DOUBLE_WITHIN(0.001, 0.0, error_deg(truth)); /* nothing pulls it away */

    const evs_quat_t none = {0, 0, 0, 0};
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_attitude_set_orientation(&att, none));
    TEST_ASSERT_DOUBLE_WITHIN(0.001, 0.0, error_deg(truth));
}

static void test_given_orientation_that_is_wrong_is_corrected_in_time(void)
{
    const quat_d wrong = mul_d(turn_d(0.0, 0.0, 20.0 * DEG), turn_d(25.0 * DEG, 0.0, 0.0));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_set_orientation(&att, quat_q30(wrong)));
    rest_for(200.0, quat(1.0, 0.0, 0.0, 0.0), 0.0, true);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 0.0, error_deg(quat(1.0, 0.0, 0.0, 0.0)));
}

static void test_given_orientation_that_is_upside_down_is_turned_over(void)
{
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_set_orientation(&att, quat_q30(quat(0.0, 1.0, 0.0, 0.0))));
    rest_for(30.0, quat(1.0, 0.0, 0.0, 0.0), 0.0, false);
    TEST_ASSERT_TRUE(tilt_error_deg(quat(1.0, 0.0, 0.0, 0.0)) < 0.5);
}

/* --- integration ----------------------------------------------------------------------------------------------- */

static void test_gyro_alone_integrates_any_rate_to_the_true_angle(void)
{
    static const double RATES[][3] = {{0.01, 0, 0}, {0.5, -0.3, 0.2}, {0, 0, 6.0}, {-20.0, 15.0, 3.0}, {60, 60, 60}};
    evs_attitude_config_t cfg = evs_attitude_config_default();
    cfg.mode = EVS_ATTITUDE_GYRO_ONLY;
    for (size_t r = 0; r < sizeof RATES / sizeof RATES[0]; r++) {
        start(&cfg);
        quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
        evs_attitude_push_gyro(&att, now_us, vec(RATES[r][0], RATES[r][1], RATES[r][2], 24));
        for (int i = 0; i < 2000; i++) {
            now_us += STEP_US;
            evs_attitude_push_gyro(&att, now_us, vec(RATES[r][0], RATES[r][1], RATES[r][2], 24));
        }
        truth = turn_d(RATES[r][0] * 10.0, RATES[r][1] * 10.0, RATES[r][2] * 10.0);
        TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.0, error_deg(truth)); /* 1000 rad may be turned in these 10 s */
    }
}

static void test_delta_angles_and_rates_give_the_same_orientation(void)
{
    evs_attitude_config_t cfg = evs_attitude_config_default();
    cfg.mode = EVS_ATTITUDE_GYRO_ONLY;
    start(&cfg);
    quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
    for (int i = 0; i < 1000; i++) {
        const double x = 2.0 * sin(i * 0.02), y = cos(i * 0.03), z = 0.5;
        const double dt = STEP_US * 1e-6;
        now_us += STEP_US;
        evs_attitude_push_delta_angle(&att, now_us, vec(x * dt, y * dt, z * dt, 30), STEP_US);
        truth = mul_d(truth, turn_d(x * dt, y * dt, z * dt));
        const evs_vec3_t rate = evs_attitude_rate(&att);
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, x, ldexp(rate.x, -24));
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, z, ldexp(rate.z, -24));
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.0, error_deg(truth)); /* 1000 roundings to Q30 */

    evs_attitude_push_delta_angle(&att, now_us + 1000u, vec(1.0, 0.0, 0.0, 30), 0u);
    TEST_ASSERT_EQUAL_UINT32(1u, evs_attitude_faults(&att).n_time_bad);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.0, error_deg(truth));
}

static void test_jitter_of_time_stamps_does_not_stretch_delta_angles(void)
{
    evs_attitude_config_t cfg = evs_attitude_config_default();
    cfg.mode = EVS_ATTITUDE_GYRO_ONLY;
    start(&cfg);
    for (int i = 1; i <= 1000; i++) {
        const uint32_t jitter_us = (i % 2 == 0) ? 500u : 0u;
        evs_attitude_push_delta_angle(&att, now_us + (uint32_t)(i * STEP_US) + jitter_us, vec(0.0, 0.0, 0.01, 30),
                                      STEP_US);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.0, error_deg(turn_d(0.0, 0.0, 10.0)));
}

static void test_lost_delta_angles_are_bridged_too(void)
{
    evs_attitude_config_t cfg = evs_attitude_config_default();
    cfg.mode = EVS_ATTITUDE_GYRO_ONLY;
    start(&cfg);
    for (int i = 1; i <= 1000; i++) {
        if ((i % 10 == 3) || (i % 10 == 4)) { continue; }
        evs_attitude_push_delta_angle(&att, now_us + (uint32_t)(i * STEP_US), vec(0.0, 0.0, 0.01, 30), STEP_US);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.0, error_deg(turn_d(0.0, 0.0, 10.0)));
}

static void test_lost_samples_are_bridged_by_the_mean_rate(void)
{
    evs_attitude_config_t cfg = evs_attitude_config_default();
    cfg.mode = EVS_ATTITUDE_GYRO_ONLY;
    double worst = 0.0;
    start(&cfg);
    /* rate rises linearly; every fourth stretch of 5 samples is lost */
    for (int i = 0; i < 1000; i++) {
        now_us += STEP_US;
        if (i % 20 >= 15) { continue; }
        evs_attitude_push_gyro(&att, now_us, vec(0.0, 0.0, 0.005 * i, 24));
        if (i % 20 == 14) {
            const double t = i * STEP_US * 1e-6;
            const quat_d truth = turn_d(0.0, 0.0, 0.5 * t * t + 0.5 * t * STEP_US * 1e-6); /* sum of the samples */
            worst = fmax(worst, error_deg(truth));
        }
    }
    TEST_ASSERT_TRUE(worst < 0.05); /* of 716 deg; holding the rate before the loss would give 9 deg */
    TEST_ASSERT_EQUAL_UINT32(0u, evs_attitude_faults(&att).n_gyro_gaps);
}

static void test_gap_too_long_to_bridge_is_counted_and_recovered_from(void)
{
    quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
    rest_for(10.0, truth, 0.0, false);
    truth = turn_d(0.3, 0.0, 0.0); /* turned while nobody looked */
    now_us += 400000u;
    rest_for(0.1, truth, 0.0, false);
    TEST_ASSERT_EQUAL_UINT32(1u, evs_attitude_faults(&att).n_gyro_gaps);
    TEST_ASSERT_TRUE(flag(EVS_ATTITUDE_RECOVERING));
    TEST_ASSERT_TRUE(tilt_error_deg(truth) > 10.0);
    rest_for(3.0, truth, 0.0, false);
    TEST_ASSERT_TRUE(tilt_error_deg(truth) < 3.0);
    rest_for(60.0, truth, 0.0, false);
    TEST_ASSERT_FALSE(flag(EVS_ATTITUDE_RECOVERING));
    TEST_ASSERT_TRUE(tilt_error_deg(truth) < 0.02);
}

static void test_time_that_runs_back_is_counted_and_a_restarted_clock_is_adopted(void)
{
    quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
    rest_for(1.0, truth, 0.0, false);
    const uint32_t was_us = now_us;
    evs_attitude_push_gyro(&att, was_us - 1000u, vec(50.0, 0.0, 0.0, 24));
    evs_attitude_push_gyro(&att, was_us, vec(50.0, 0.0, 0.0, 24));
    evs_attitude_push_accel(&att, was_us - 1000u, vec(G, 0.0, 0.0, 20));
    evs_attitude_push_mag(&att, was_us, vec(FIELD_H, 0.0, FIELD_V, 16));
    evs_attitude_push_mag(&att, was_us - 1u, vec(FIELD_H, 0.0, FIELD_V, 16));
    TEST_ASSERT_EQUAL_UINT32(4u, evs_attitude_faults(&att).n_time_bad);

    now_us = was_us - 1000000000u;
    rest_for(1.0, truth, 0.0, false);
    const uint32_t n_bad = evs_attitude_faults(&att).n_time_bad;
    TEST_ASSERT_TRUE((n_bad > 4u) && (n_bad < 30u));
    for (int i = 0; i < 200; i++) { truth = step(truth, 0.0, 0.0, 1.0, false); }
    TEST_ASSERT_EQUAL_UINT32(n_bad, evs_attitude_faults(&att).n_time_bad);
    TEST_ASSERT_TRUE(tilt_error_deg(truth) < 0.01);
}

/* --- bias and rest --------------------------------------------------------------------------------------------- */

static void test_bias_is_learnt_at_rest(void)
{
    rest_for(1.0, turn_d(0.3, 0.0, 0.0), 0.05, false);
    TEST_ASSERT_FALSE(evs_attitude_at_rest(&att));
    TEST_ASSERT_FALSE(flag(EVS_ATTITUDE_BIAS_KNOWN));
    rest_for(5.0, turn_d(0.3, 0.0, 0.0), 0.05, false);
    TEST_ASSERT_TRUE(evs_attitude_at_rest(&att));
    TEST_ASSERT_TRUE(flag(EVS_ATTITUDE_BIAS_KNOWN));
    const evs_vec3_t bias = evs_attitude_bias(&att);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.05, ldexp(bias.x, -24));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, -0.05, ldexp(bias.y, -24));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.025, ldexp(bias.z, -24));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.0, ldexp(evs_attitude_rate(&att).x, -24));
}

static void test_slow_turn_is_not_learnt_as_bias(void)
{
    static const double RATES_DEG[] = {0.5, 2.0, 25.0};
    for (size_t r = 0; r < sizeof RATES_DEG / sizeof RATES_DEG[0]; r++) {
        start(NULL);
        quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
        rest_for(5.0, truth, 0.0, false);
        for (int i = 0; i < 6000; i++) { truth = step(truth, 0.0, 0.0, RATES_DEG[r] * DEG, false); } /* 30 s, level */
        char what[32];
        (void)snprintf(what, sizeof what, "%g deg/s", RATES_DEG[r]);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.15, 0.0, error_deg(truth), what);
        for (int i = 0; i < 6000; i++) { truth = step(truth, RATES_DEG[r] * DEG, 0.0, 0.0, false); } /* rolling */
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.15, 0.0, error_deg(truth), what);
    }
}

static void test_bias_can_be_saved_and_restored(void)
{
    const evs_vec3_t bias = vec(0.03, -0.02, 0.01, 24);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_set_bias(&att, bias));
    const evs_vec3_t back = evs_attitude_bias(&att);
    TEST_ASSERT_EQUAL_MEMORY(&bias, &back, sizeof bias);
    TEST_ASSERT_TRUE(flag(EVS_ATTITUDE_BIAS_KNOWN));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_attitude_set_bias(&att, vec(0.0, 0.2, 0.0, 24)));
    const evs_vec3_t still = evs_attitude_bias(&att);
    TEST_ASSERT_EQUAL_MEMORY(&bias, &still, sizeof bias);

    evs_attitude_push_gyro(&att, now_us, vec(1.0, 0.0, 0.0, 24));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.97, ldexp(evs_attitude_rate(&att).x, -24));
}

static void test_large_bias_tilts_less_and_less_even_if_the_carrier_never_rests(void)
{
    const double bias = 3.0 * DEG; /* held in a hand: tau times that is 9 deg */
    quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
    double early = 0.0, late = 0.0;
    for (int i = 0; i < 16000; i++) { /* 80 s of swaying about all axes */
        const double t = i * STEP_US * 1e-6;
        const double w[3] = {0.8 * sin(3.0 * t), 0.8 * cos(2.3 * t), 0.5 * sin(1.7 * t)};
        truth = mul_d(truth, turn_d(w[0] * 0.005, w[1] * 0.005, w[2] * 0.005));
        now_us += STEP_US;
        evs_attitude_push_gyro(&att, now_us, vec(w[0] + bias, w[1], w[2], 24));
        evs_attitude_push_accel(&att, now_us, seen(truth, 0.0, 0.0, G, 20));
        if (i < 4000) { early = fmax(early, tilt_error_deg(truth)); }
        if (i > 14000) { late = fmax(late, tilt_error_deg(truth)); }
    }
    TEST_ASSERT_FALSE(flag(EVS_ATTITUDE_BIAS_KNOWN));
    TEST_ASSERT_TRUE(early > 6.0);
    TEST_ASSERT_TRUE(late < early / 3.0);
}

static double bias_error(double x) { return fabs(ldexp(evs_attitude_bias(&att).x, -24) - x); }

static void test_bias_given_may_be_a_little_off_and_is_refined_at_rest(void)
{
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_set_bias(&att, vec(0.0, 0.0, 0.0, 24)));
    rest_for(30.0, quat(1.0, 0.0, 0.0, 0.0), 0.005, false);
    TEST_ASSERT_TRUE(bias_error(0.005) < 1e-4);
}

static void test_bias_far_from_the_known_one_is_believed_after_a_minute_of_stillness(void)
{
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_set_bias(&att, vec(0.0, 0.0, 0.0, 24)));
    rest_for(50.0, quat(1.0, 0.0, 0.0, 0.0), 0.03, false);
    TEST_ASSERT_TRUE(bias_error(0.0) < 1e-6);
    rest_for(20.0, quat(1.0, 0.0, 0.0, 0.0), 0.03, false);
    TEST_ASSERT_TRUE(bias_error(0.03) < 1e-4);
}

static void test_bias_may_drift_while_nobody_can_see_it(void)
{
    quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
    rest_for(10.0, truth, 0.0, false);
    for (int i = 0; i < 20000; i++) { truth = step(truth, 0.0, 0.0, (i % 400 < 200) ? 1.0 : -1.0, false); } /* 100 s */
    rest_for(30.0, truth, 0.0045, false);
    TEST_ASSERT_TRUE(bias_error(0.0045) < 1e-4);
}

/* --- bad data -------------------------------------------------------------------------------------------------- */

static void test_one_bad_sample_does_no_lasting_harm(void)
{
    const evs_vec3_t all_max = {INT32_MAX, INT32_MAX, INT32_MAX};
    const evs_vec3_t all_min = {INT32_MIN, INT32_MIN, INT32_MIN};
    const evs_vec3_t zero = {0, 0, 0};
    for (int fault = 0; fault < 11; fault++) {
        start(NULL);
        quat_d truth = turn_d(0.2, -0.1, 0.0);
        rest_for(10.0, truth, 0.0, true);
        truth = orientation();
        now_us += STEP_US / 2;
        switch (fault) {
        case 0:
            evs_attitude_push_accel(&att, now_us, zero);
            break;
        case 1:
            evs_attitude_push_accel(&att, now_us, all_max);
            break;
        case 2:
            evs_attitude_push_accel(&att, now_us, all_min);
            break;
        case 3:
            evs_attitude_push_accel(&att, now_us, seen(truth, 0.0, 0.0, -G, 20));
            break;
        case 4:
            evs_attitude_push_accel(&att, now_us, seen(truth, G, 0.0, 0.0, 20));
            break;
        case 5:
            evs_attitude_push_mag(&att, now_us, zero);
            break;
        case 6:
            evs_attitude_push_mag(&att, now_us, all_max);
            break;
        case 7:
            evs_attitude_push_mag(&att, now_us, all_min);
            break;
        case 8:
            evs_attitude_push_mag(&att, now_us, seen(truth, 0.0, -FIELD_H, -FIELD_V, 16));
            break;
        case 9:
            evs_attitude_push_gyro(&att, now_us, all_max);
            break;
        default:
            evs_attitude_push_gyro(&att, now_us, all_min);
            break;
        }
        TEST_ASSERT_DOUBLE_WITHIN(4e-9, 0.0, norm_error());
        now_us -= STEP_US / 2;
        rest_for(2.0, truth, 0.0, true);
        char what[32];
        (void)snprintf(what, sizeof what, "fault %d", fault);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.15, 0.0, error_deg(truth), what);
    }
}

static void test_bad_samples_are_counted_by_cause(void)
{
    const evs_vec3_t zero = {0, 0, 0};
    rest_for(1.0, quat(1.0, 0.0, 0.0, 0.0), 0.0, true);
    evs_attitude_push_accel(&att, now_us + 1u, zero);
    TEST_ASSERT_TRUE(flag(EVS_ATTITUDE_ACCEL_BAD));
    evs_attitude_push_accel(&att, now_us + 1u, vec(0.0, 401.0, 0.0, 20));
    evs_attitude_push_mag(&att, now_us + 1u, zero);
    TEST_ASSERT_TRUE(flag(EVS_ATTITUDE_MAG_BAD));
    const evs_attitude_faults_t faults = evs_attitude_faults(&att);
    TEST_ASSERT_EQUAL_UINT32(2u, faults.n_accel_bad);
    TEST_ASSERT_EQUAL_UINT32(1u, faults.n_mag_bad);
    TEST_ASSERT_EQUAL_UINT32(0u, faults.n_time_bad);
    rest_for(0.1, quat(1.0, 0.0, 0.0, 0.0), 0.0, true);
    TEST_ASSERT_FALSE(flag(EVS_ATTITUDE_ACCEL_BAD));
    TEST_ASSERT_FALSE(flag(EVS_ATTITUDE_MAG_BAD));
}

static void test_lone_gyro_spike_is_taken_back_by_the_next_sample(void)
{
    static const double SPIKES[][3] = {{35.0, -35.0, 35.0}, {0.0, 128.0, 0.0}, {-128.0, -128.0, 127.0}};
    for (size_t k = 0; k < sizeof SPIKES / sizeof SPIKES[0]; k++) {
        start(NULL);
        quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
        for (int i = 0; i < 2000; i++) { truth = step(truth, 0.3, -0.2, 1.0, false); }
        const double before = error_deg(truth);
        now_us += STEP_US;
        evs_attitude_push_gyro(&att, now_us, vec(SPIKES[k][0], SPIKES[k][1], SPIKES[k][2], 24));
        truth = mul_d(truth, turn_d(0.3 * 0.005, -0.2 * 0.005, 1.0 * 0.005));
        TEST_ASSERT_TRUE(error_deg(truth) > 10.0);
        truth = step(truth, 0.3, -0.2, 1.0, false);
        TEST_ASSERT_TRUE(error_deg(truth) < before + 0.01);
        TEST_ASSERT_EQUAL_UINT32(1u, evs_attitude_faults(&att).n_gyro_spikes);
    }
}

static void test_sudden_turn_that_lasts_is_no_spike(void)
{
    quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
    rest_for(2.0, truth, 0.0, false);
    for (int i = 0; i < 20; i++) { truth = step(truth, 0.0, 0.0, 20.0, false); }
    for (int i = 0; i < 20; i++) { truth = step(truth, 0.0, 0.0, 0.0, false); }
    TEST_ASSERT_EQUAL_UINT32(0u, evs_attitude_faults(&att).n_gyro_spikes);
    TEST_ASSERT_TRUE(error_deg(truth) < 0.01);
}

/* A lone shock is a glitch; one that swings back, as an impact does, is left in and balances. */
static void test_lone_acceleration_spike_is_taken_back_and_an_impact_is_not(void)
{
    const quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
    double worst[2] = {0.0, 0.0};
    for (int impact = 0; impact < 2; impact++) {
        start(NULL);
        rest_for(8.0, truth, 0.0, false);
        for (int i = 0; i < 2 + impact; i++) {
            static const double SHOCK[] = {150.0, -150.0, 0.0};
            now_us += STEP_US;
            evs_attitude_push_gyro(&att, now_us, vec(0.0, 0.0, 0.0, 24));
            evs_attitude_push_accel(&att, now_us, vec((impact != 0) ? SHOCK[i] : 150.0 * (i == 0), 0.0, G, 20));
        }
        TEST_ASSERT_EQUAL_UINT32((impact != 0) ? 0u : 1u, evs_attitude_faults(&att).n_accel_bad);
        for (int i = 0; i < 1000; i++) {
            rest_for(0.005, truth, 0.0, false);
            worst[impact] = fmax(worst[impact], tilt_error_deg(truth));
        }
        TEST_ASSERT_TRUE(worst[impact] < 0.03); /* 0.9 deg if nothing were done */
    }
}

static void test_sensor_that_falls_silent_stops_correcting(void)
{
    const quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
    rest_for(30.0, truth, 0.0, true);
    for (int i = 0; i < 40; i++) { /* both point elsewhere, then stop */
        now_us += STEP_US;
        evs_attitude_push_gyro(&att, now_us, vec(0.0, 0.0, 0.0, 24));
        evs_attitude_push_accel(&att, now_us, vec(5.0, 0.0, G, 20));
        evs_attitude_push_mag(&att, now_us, vec(3.0, FIELD_H, FIELD_V, 16));
    }
    double after = 0.0;
    for (int i = 0; i < 12000; i++) {
        now_us += STEP_US;
        evs_attitude_push_gyro(&att, now_us, vec(0.0, 0.0, 0.0, 24));
        if (i == 200) { after = error_deg(truth); }
    }
    TEST_ASSERT_TRUE(after > 0.5);
    TEST_ASSERT_DOUBLE_WITHIN(0.001, after, error_deg(truth));
}

/* 1 s at up to 12 rad/s, clipped at 8.7, then 4 s of rest: the tilt that is left. */
static double tilt_left_after_clipping(const evs_attitude_config_t *cfg)
{
    start(cfg);
    quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
    rest_for(5.0, truth, 0.0, false);
    for (int i = 0; i < 200; i++) {
        const double dt = STEP_US * 1e-6;
        const double rate = 12.0 * sin(i * dt * PI);
        truth = mul_d(truth, turn_d(0.0, rate * dt, 0.0));
        now_us += STEP_US;
        evs_attitude_push_gyro(&att, now_us, vec(0.0, fmin(rate, 8.7), 0.0, 24));
        evs_attitude_push_accel(&att, now_us, seen(truth, 0.0, 0.0, G, 20));
        if (i == 100) { TEST_ASSERT_TRUE(flag(EVS_ATTITUDE_GYRO_SATURATED)); }
    }
    TEST_ASSERT_TRUE(evs_attitude_faults(&att).n_gyro_saturated > 60u);
    TEST_ASSERT_TRUE(tilt_error_deg(truth) > 10.0);
    rest_for(4.0, truth, 0.0, false);
    return tilt_error_deg(truth);
}

static void test_clipped_gyro_is_recovered_from_with_the_limit_given_or_found(void)
{
    evs_attitude_config_t cfg = evs_attitude_config_default();
    const double found = tilt_left_after_clipping(&cfg);
    cfg.gyro_limit_rad_s_q24 = to_q(8.7, 24);
    const double given = tilt_left_after_clipping(&cfg);
    cfg.tau_recover_ms = cfg.tau_accel_ms; /* as if it were not noticed */
    const double unaware = tilt_left_after_clipping(&cfg);
    TEST_ASSERT_TRUE(unaware > 5.0);
    TEST_ASSERT_TRUE(found < unaware / 3.0);
    TEST_ASSERT_TRUE(given < unaware / 3.0);
}

static void test_disturbed_field_is_flagged_and_not_followed(void)
{
    quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
    rest_for(70.0, truth, 0.0, true);
    TEST_ASSERT_FALSE(flag(EVS_ATTITUDE_MAG_DISTURBED));
    for (int i = 0; i < 4000; i++) { /* 20 s beside a magnet */
        now_us += STEP_US;
        evs_attitude_push_gyro(&att, now_us, vec(0.0, 0.0, 0.0, 24));
        evs_attitude_push_accel(&att, now_us, vec(0.0, 0.0, G, 20));
        evs_attitude_push_mag(&att, now_us, vec(30.0, FIELD_H, FIELD_V, 16));
    }
    TEST_ASSERT_TRUE(flag(EVS_ATTITUDE_MAG_DISTURBED));
    TEST_ASSERT_TRUE(error_deg(truth) < 0.5);
    rest_for(2.0, truth, 0.0, true);
    TEST_ASSERT_FALSE(flag(EVS_ATTITUDE_MAG_DISTURBED));
}

static void test_field_that_stays_changed_becomes_the_new_normal(void)
{
    quat_d truth = quat(1.0, 0.0, 0.0, 0.0);
    rest_for(70.0, truth, 0.0, true);
    for (int i = 0; i < 10000; i++) { /* 50 s elsewhere, turning to and fro: a weaker field, still north */
        const double rate = (i % 400 < 200) ? 0.8 : -0.8;
        truth = mul_d(truth, turn_d(0.0, 0.0, rate * 0.005));
        now_us += STEP_US;
        evs_attitude_push_gyro(&att, now_us, vec(0.0, 0.0, rate, 24));
        evs_attitude_push_accel(&att, now_us, vec(0.0, 0.0, G, 20));
        evs_attitude_push_mag(&att, now_us, seen(truth, 0.0, 0.6 * FIELD_H, 0.6 * FIELD_V, 16));
        if (i == 1000) { TEST_ASSERT_TRUE(flag(EVS_ATTITUDE_MAG_DISTURBED)); }
    }
    TEST_ASSERT_FALSE(flag(EVS_ATTITUDE_MAG_DISTURBED));
    TEST_ASSERT_TRUE(error_deg(truth) < 0.2);
}

/* Lying still in a field that points `east_ut` off north. */
static void lie_beside_a_magnet(int seconds, double east_ut)
{
    for (int i = 0; i < seconds * 200; i++) {
        now_us += STEP_US;
        evs_attitude_push_gyro(&att, now_us, vec(0.0, 0.0, 0.0, 24));
        evs_attitude_push_accel(&att, now_us, vec(0.0, 0.0, G, 20));
        evs_attitude_push_mag(&att, now_us, vec(east_ut, FIELD_H, FIELD_V, 16));
    }
}

static void test_disturbed_field_is_half_believed_after_a_minute_but_is_no_normal_at_rest(void)
{
    const quat_d north = quat(1.0, 0.0, 0.0, 0.0);
    const double magnet_deg = atan2(20.0, FIELD_H) / DEG;
    rest_for(70.0, north, 0.0, true);
    lie_beside_a_magnet(55, 20.0);
    TEST_ASSERT_TRUE(error_deg(north) < 1.0); /* what it took to notice */
    lie_beside_a_magnet(35, 20.0);            /* 30 s of it with a time constant of 30 s */
    TEST_ASSERT_DOUBLE_WITHIN(0.1 * magnet_deg, 0.63 * magnet_deg, error_deg(north));
    TEST_ASSERT_TRUE(flag(EVS_ATTITUDE_MAG_DISTURBED));
}

static void test_wild_field_is_counted_once_the_usual_one_is_known(void)
{
    rest_for(10.0, quat(1.0, 0.0, 0.0, 0.0), 0.0, true);
    evs_attitude_push_mag(&att, now_us + 1u, vec(0.0, 10.0 * FIELD_H, 10.0 * FIELD_V, 16));
    TEST_ASSERT_EQUAL_UINT32(1u, evs_attitude_faults(&att).n_mag_bad);
}

/* --- rates and intervals --------------------------------------------------------------------------------------- */

/* The carrier swings about all axes and surges; its motion is known in closed form. */
static double swing(double t, int axis, double *rate_d)
{
    static const double AMPLITUDE[] = {0.5, 0.4, 0.7};
    static const double OMEGA[] = {3.1, 4.3, 2.3};
    *rate_d = AMPLITUDE[axis] * OMEGA[axis] * cos(OMEGA[axis] * t);
    return AMPLITUDE[axis] * sin(OMEGA[axis] * t);
}
/* Orientation z y x, and body rates. */
static quat_d flight(double t, double w[3])
{
    double rd, pd, yd;
    const double r = swing(t, 0, &rd), p = swing(t, 1, &pd), y = swing(t, 2, &yd);
    w[0] = rd - yd * sin(p);
    w[1] = pd * cos(r) + yd * sin(r) * cos(p);
    w[2] = -pd * sin(r) + yd * cos(r) * cos(p);
    return mul_d(mul_d(turn_d(0.0, 0.0, y), turn_d(0.0, p, 0.0)), turn_d(r, 0.0, 0.0));
}
/* Mean rate between two times, as an IMU that filters before it samples gives it: the rotation over the time. */
static evs_vec3_t mean_rate(double t0, double t1, int n_bits)
{
    double w[3];
    const quat_d d = mul_d(conj_d(flight(t0, w)), flight(t1, w));
    const double s = sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
    const double k = (s > 0.0) ? 2.0 * atan2(s, d.w) / s : 2.0;
    return vec(k * d.x / (t1 - t0), k * d.y / (t1 - t0), k * d.z / (t1 - t0), n_bits);
}

static void test_rates_may_differ_between_sensors_and_change_within_one(void)
{
    /* gyro interval us, accelerometer and magnetometer every so many gyro samples; 0: random in [100, 20000] */
    static const int CASES[][3] = {{5000, 1, 1},  {1000, 10, 20}, {100, 10, 100},
                                   {20000, 1, 1}, {5000, 3, 7},   {0, 1, 1}};
    for (size_t c = 0; c < sizeof CASES / sizeof CASES[0]; c++) {
        start(NULL);
        double w[3], t = 0.0, worst = 0.0;
        uint32_t random = 1u;
        const uint32_t t0_us = now_us;
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_set_orientation(&att, quat_q30(flight(0.0, w))));
        evs_attitude_push_gyro(&att, now_us, vec(0.0, 0.0, 0.0, 24));
        for (int i = 0; t < ((CASES[c][0] == 100) ? 3.0 : 12.0); i++) {
            random = random * 1664525u + 1013904223u;
            const uint32_t dt_us = (CASES[c][0] != 0) ? (uint32_t)CASES[c][0] : 100u + (random >> 16) % 19901u;
            const double t_before = t;
            now_us += dt_us;
            t = (now_us - t0_us) * 1e-6;
            const quat_d truth = flight(t, w);
            const double surge = 3.0 * sin(7.0 * t);
            evs_attitude_push_gyro(&att, now_us, mean_rate(t_before, t, 24));
            if (i % CASES[c][1] == 0) { evs_attitude_push_accel(&att, now_us, seen(truth, surge, 0.0, G, 20)); }
            if (i % CASES[c][2] == 0) { evs_attitude_push_mag(&att, now_us, seen(truth, 0.0, FIELD_H, FIELD_V, 16)); }
            worst = fmax(worst, error_deg(truth));
        }
        char what[32];
        (void)snprintf(what, sizeof what, "case %u", (unsigned)c);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE((CASES[c][0] != 0) ? 1.0 : 1.6, 0.0, worst, what);
        TEST_ASSERT_EQUAL_UINT32(0u, evs_attitude_faults(&att).n_time_bad);
    }
}

/* --- the other modes ------------------------------------------------------------------------------------------- */

static void test_valenti_mode_converges_from_any_start_with_its_time_constant(void)
{
    evs_attitude_config_t cfg = evs_attitude_config_default();
    cfg.mode = EVS_ATTITUDE_VALENTI;
    cfg.tau_accel_ms = 350u;
    cfg.tau_mag_ms = 350u;
    for (int adaptive = 0; adaptive < 2; adaptive++) {
        cfg.valenti_adaptive = adaptive != 0;
        start(&cfg);
        const quat_d wrong = mul_d(turn_d(0.0, 0.0, 2.5), turn_d(0.0, 2.0, 0.0)); /* 2.5 rad: the spherical branch */
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_set_orientation(&att, quat_q30(wrong)));
        const double before = tilt_error_deg(quat(1.0, 0.0, 0.0, 0.0));
        rest_for(0.35, quat(1.0, 0.0, 0.0, 0.0), 0.0, true);
        TEST_ASSERT_DOUBLE_WITHIN(0.06 * before, before / 2.718281828, tilt_error_deg(quat(1.0, 0.0, 0.0, 0.0)));
        rest_for(6.0, quat(1.0, 0.0, 0.0, 0.0), 0.0, true);
        TEST_ASSERT_TRUE(error_deg(quat(1.0, 0.0, 0.0, 0.0)) < 0.01);
    }
}

static void test_valenti_mode_learns_bias_in_steady_state(void)
{
    evs_attitude_config_t cfg = evs_attitude_config_default();
    cfg.mode = EVS_ATTITUDE_VALENTI;
    start(&cfg);
    rest_for(30.0, quat(1.0, 0.0, 0.0, 0.0), 0.05, true);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.05, ldexp(evs_attitude_bias(&att).x, -24));
}

/* --- axis map -------------------------------------------------------------------------------------------------- */

static void test_axis_map_swaps_mirrors_scales_and_takes_the_offset_away(void)
{
    evs_axis_map_t map = evs_axis_map_identity();
    const evs_vec3_t v = vec(1.0, -2.0, 3.0, 20);
    const evs_vec3_t same = evs_axis_map_apply(&map, v);
    TEST_ASSERT_EQUAL_MEMORY(&v, &same, sizeof v);

    const evs_axis_map_t mounted = {{{0, to_q(-1.0, 28), 0}, {to_q(1.02, 28), 0, 0}, {0, 0, to_q(-1.0, 28)}},
                                    vec(0.5, 0.0, 1.0, 20)};
    const evs_vec3_t out = evs_axis_map_apply(&mounted, v);
    const evs_vec3_t want = vec(2.0, 0.51, -2.0, 20);
    TEST_ASSERT_INT32_WITHIN(1, want.x, out.x);
    TEST_ASSERT_INT32_WITHIN(1, want.y, out.y);
    TEST_ASSERT_INT32_WITHIN(1, want.z, out.z);
}

static void test_axis_map_of_a_quaternion_rotates_as_it_does(void)
{
    const quat_d q = turn_d(0.7, -1.1, 2.0);
    const evs_axis_map_t map = evs_axis_map_from_quat(quat_q30(q));
    const evs_vec3_t out = evs_axis_map_apply(&map, vec(1.0, -2.0, 3.0, 20));
    const quat_d want = mul_d(mul_d(q, quat(0.0, 1.0, -2.0, 3.0)), conj_d(q));
    TEST_ASSERT_INT32_WITHIN(2, to_q(want.x, 20), out.x);
    TEST_ASSERT_INT32_WITHIN(2, to_q(want.y, 20), out.y);
    TEST_ASSERT_INT32_WITHIN(2, to_q(want.z, 20), out.z);
}

static void test_axis_map_saturates(void)
{
    evs_axis_map_t map = evs_axis_map_identity();
    map.m_q28[0][0] = map.m_q28[0][1] = map.m_q28[0][2] = INT32_MAX;
    map.m_q28[1][0] = map.m_q28[1][1] = map.m_q28[1][2] = INT32_MIN;
    const evs_vec3_t top = {INT32_MAX, INT32_MAX, INT32_MAX};
    const evs_vec3_t bottom = {INT32_MIN, INT32_MIN, INT32_MIN};
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, evs_axis_map_apply(&map, top).x);
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, evs_axis_map_apply(&map, top).y);
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, evs_axis_map_apply(&map, bottom).x);
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, evs_axis_map_apply(&map, bottom).y);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_names_the_fault_and_leaves_the_context_alone);
    RUN_TEST(test_before_any_sample_the_orientation_is_identity_and_nothing_is_known);
    RUN_TEST(test_reset_forgets_everything_but_the_settings);
    RUN_TEST(test_first_acceleration_levels_at_once_and_keeps_the_heading);
    RUN_TEST(test_first_acceleration_exactly_upside_down_is_answered);
    RUN_TEST(test_first_field_turns_to_north_at_once);
    RUN_TEST(test_declination_turns_magnetic_into_true_north);
    RUN_TEST(test_given_orientation_is_taken_as_it_is);
    RUN_TEST(test_given_orientation_that_is_wrong_is_corrected_in_time);
    RUN_TEST(test_given_orientation_that_is_upside_down_is_turned_over);
    RUN_TEST(test_gyro_alone_integrates_any_rate_to_the_true_angle);
    RUN_TEST(test_delta_angles_and_rates_give_the_same_orientation);
    RUN_TEST(test_jitter_of_time_stamps_does_not_stretch_delta_angles);
    RUN_TEST(test_lost_delta_angles_are_bridged_too);
    RUN_TEST(test_lost_samples_are_bridged_by_the_mean_rate);
    RUN_TEST(test_gap_too_long_to_bridge_is_counted_and_recovered_from);
    RUN_TEST(test_time_that_runs_back_is_counted_and_a_restarted_clock_is_adopted);
    RUN_TEST(test_bias_is_learnt_at_rest);
    RUN_TEST(test_slow_turn_is_not_learnt_as_bias);
    RUN_TEST(test_bias_can_be_saved_and_restored);
    RUN_TEST(test_large_bias_tilts_less_and_less_even_if_the_carrier_never_rests);
    RUN_TEST(test_bias_given_may_be_a_little_off_and_is_refined_at_rest);
    RUN_TEST(test_bias_far_from_the_known_one_is_believed_after_a_minute_of_stillness);
    RUN_TEST(test_bias_may_drift_while_nobody_can_see_it);
    RUN_TEST(test_one_bad_sample_does_no_lasting_harm);
    RUN_TEST(test_bad_samples_are_counted_by_cause);
    RUN_TEST(test_lone_gyro_spike_is_taken_back_by_the_next_sample);
    RUN_TEST(test_sudden_turn_that_lasts_is_no_spike);
    RUN_TEST(test_lone_acceleration_spike_is_taken_back_and_an_impact_is_not);
    RUN_TEST(test_sensor_that_falls_silent_stops_correcting);
    RUN_TEST(test_clipped_gyro_is_recovered_from_with_the_limit_given_or_found);
    RUN_TEST(test_disturbed_field_is_flagged_and_not_followed);
    RUN_TEST(test_field_that_stays_changed_becomes_the_new_normal);
    RUN_TEST(test_disturbed_field_is_half_believed_after_a_minute_but_is_no_normal_at_rest);
    RUN_TEST(test_wild_field_is_counted_once_the_usual_one_is_known);
    RUN_TEST(test_rates_may_differ_between_sensors_and_change_within_one);
    RUN_TEST(test_valenti_mode_converges_from_any_start_with_its_time_constant);
    RUN_TEST(test_valenti_mode_learns_bias_in_steady_state);
    RUN_TEST(test_axis_map_swaps_mirrors_scales_and_takes_the_offset_away);
    RUN_TEST(test_axis_map_of_a_quaternion_rotates_as_it_does);
    RUN_TEST(test_axis_map_saturates);
    return UNITY_END();
}
