/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The measures of evstab eval on cases whose answer can be told by hand. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "attitude_error.h"
#include "eigen.h"
#include "temp_file.h"
#include "unity.h"
#include "velocity_error.h"

#define RAD (1.0 / EVL_DEG_PER_RAD)

enum { N_MAX = 4000 };

static evh_error_t err;
static evh_pose_t est_pose[N_MAX];
static evh_pose_t ref_pose[N_MAX];
static evl_pair_t pair[N_MAX];
static evl_attitude_result_t result;

void setUp(void)
{
    memset(&err, 0, sizeof err);
    memset(&result, 0, sizeof result);
    evh_set_quiet(true);
}
void tearDown(void) { temp_file_remove(); }

static evl_quat_t turn(double x_deg, double y_deg, double z_deg)
{
    const evl_vec3_t r = {x_deg * RAD, y_deg * RAD, z_deg * RAD};
    return evl_quat_exp(r);
}

static void set_pose(evh_pose_t *pose, int64_t t_us, evl_quat_t q)
{
    memset(pose, 0, sizeof *pose);
    pose->t_us = t_us;
    pose->q_wxyz[0] = q.w;
    pose->q_wxyz[1] = q.x;
    pose->q_wxyz[2] = q.y;
    pose->q_wxyz[3] = q.z;
}

static evh_poses_t track(evh_pose_t *pose, size_t n)
{
    evh_poses_t t;
    memset(&t, 0, sizeof t);
    t.pose = pose;
    t.n = n;
    return t;
}

static void expect_error(evl_quat_t est, evl_quat_t ref, double total, double inclination, double heading)
{
    const evl_attitude_error_t e = evl_attitude_error(est, ref);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, total, e.total_rad * EVL_DEG_PER_RAD);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, inclination, e.inclination_rad * EVL_DEG_PER_RAD);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, heading, e.heading_rad * EVL_DEG_PER_RAD);
}

static void test_an_error_is_parted_into_heading_and_inclination(void)
{
    expect_error(turn(0, 0, 0), turn(0, 0, 0), 0, 0, 0);
    expect_error(turn(0, 0, 30), turn(0, 0, 0), 30, 0, 30);
    expect_error(turn(0, 0, 0), turn(0, 0, 30), 30, 0, 30);
    expect_error(turn(40, 0, 0), turn(0, 0, 0), 40, 40, 0);
    /* cos(total / 2) = cos 15 cos 20. */
    expect_error(evl_quat_mul(turn(0, 0, 30), turn(40, 0, 0)), turn(0, 0, 0), 49.628433809184536, 40, 30);
    /* In the earth's frame: what counts is est ref^-1, wherever ref looks. */
    expect_error(evl_quat_mul(turn(0, 0, 12), turn(70, -50, 20)), turn(70, -50, 20), 12, 0, 12);
    /* q and -q are one rotation. */
    expect_error(turn(0, 0, 350), turn(0, 0, 0), 10, 0, 10);
}

static void test_a_small_error_does_not_drown_in_rounding(void)
{
    expect_error(turn(1e-7, 0, 0), turn(0, 0, 0), 1e-7, 1e-7, 0);
}

static void test_truth_is_interpolated_where_samples_are_close_and_nowhere_else(void)
{
    evl_quat_t q;
    evh_poses_t t;
    set_pose(&ref_pose[0], 1000000, turn(0, 0, 0));
    set_pose(&ref_pose[1], 1100000, turn(0, 0, 20));
    set_pose(&ref_pose[2], 1200001, turn(0, 0, 40));
    t = track(ref_pose, 3u);
    TEST_ASSERT_TRUE(evl_track_orientation(&t, 1025000, &q));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 5.0 * RAD, evl_quat_angle(q));
    TEST_ASSERT_TRUE(evl_track_orientation(&t, 1000000, &q));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0, evl_quat_angle(q));
    TEST_ASSERT_TRUE(evl_track_orientation(&t, 1200001, &q));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 40.0 * RAD, evl_quat_angle(q));
    TEST_ASSERT_FALSE(evl_track_orientation(&t, 1150000, &q)); /* A gap of 100.001 ms. */
    TEST_ASSERT_FALSE(evl_track_orientation(&t, 999999, &q));
    TEST_ASSERT_FALSE(evl_track_orientation(&t, 1200002, &q));
    t.n = 0u;
    TEST_ASSERT_FALSE(evl_track_orientation(&t, 1000000, &q));
}

static void test_statistics_are_those_of_the_textbook(void)
{
    static const double VALUES[] = {3.0, 1.0, 4.0, 2.0};
    evl_list_t list = {NULL, 0u, 0u};
    evl_stats_t s = evl_list_stats(&list);
    TEST_ASSERT_EQUAL_UINT(0u, s.n);
    for (int i = 0; i < 4; i++) { TEST_ASSERT_TRUE(evl_list_add(&list, VALUES[i])); }
    s = evl_list_stats(&list);
    evl_list_free(&list);
    TEST_ASSERT_EQUAL_UINT(4u, s.n);
    TEST_ASSERT_EQUAL_DOUBLE(2.5, s.mean);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, sqrt(7.5), s.rmse);
    TEST_ASSERT_EQUAL_DOUBLE(2.5, s.median);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 3.85, s.p95);
    TEST_ASSERT_EQUAL_DOUBLE(4.0, s.max);
}

static void test_eigenvectors_are_found_in_order(void)
{
    /* Eigenvalues 4, 2, 1 with vectors (1 1 0), (1 -1 0), z. */
    double m[9] = {3.0, 1.0, 0.0, 1.0, 3.0, 0.0, 0.0, 0.0, 1.0};
    double values[3];
    double v[9];
    evl_eigen_symmetric(m, 3, values, v);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 4.0, values[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 2.0, values[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 1.0, values[2]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, sqrt(0.5), fabs(v[0]));
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, v[0], v[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, v[3], -v[4]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 1.0, fabs(v[8]));
}

/* At rest until `rest` samples of 10 ms have passed, then turning about all axes. */
static evl_quat_t motion(int i, int rest)
{
    const double t = (i < rest) ? 0.0 : 0.01 * (i - rest);
    return evl_quat_mul(turn(25.0 * sin(2.0 * t), 0, 0), turn(0, 30.0 * sin(3.1 * t), 50.0 * sin(0.7 * t)));
}

static void make_pairs(int n, int rest, evl_quat_t left, evl_quat_t right)
{
    for (int i = 0; i < n; i++) {
        pair[i].t_us = 10000 * i;
        pair[i].ref = motion(i, rest);
        pair[i].est = evl_quat_mul(evl_quat_mul(left, pair[i].ref), right);
    }
}

static void expect_same_rotation(evl_quat_t want, evl_quat_t got, double deg)
{
    TEST_ASSERT_DOUBLE_WITHIN(deg * RAD, 0.0, evl_quat_angle(evl_quat_mul(evl_quat_conj(want), got)));
}

static void test_a_heading_is_taken_over_the_first_second_of_motion(void)
{
    evl_align_t a;
    make_pairs(500, 0, turn(0, 0, -170), turn(0, 0, 0));
    for (int i = 101; i < 500; i++) { pair[i].est = evl_quat_mul(turn(0, 0, 5), pair[i].est); } /* Later: drift. */
    a = evl_align(EVL_ALIGN_HEADING, pair, 500u);
    TEST_ASSERT_FALSE(a.at_rest);
    TEST_ASSERT_EQUAL_INT64(0, a.from_us);
    TEST_ASSERT_EQUAL_INT64(1000000, a.to_us);
    expect_same_rotation(turn(0, 0, -170), a.left, 1e-9);
    expect_same_rotation(turn(0, 0, 0), a.right, 1e-12);
}

static void test_after_a_rest_its_last_second_counts(void)
{
    evl_align_t a;
    make_pairs(900, 500, turn(0, 0, 80), turn(0, 0, 0));
    for (int i = 0; i < 300; i++) { pair[i].est = turn(0, 0, 3); } /* Not yet settled. */
    a = evl_align(EVL_ALIGN_HEADING, pair, 900u);
    TEST_ASSERT_TRUE(a.at_rest);
    TEST_ASSERT_TRUE((a.to_us <= 5000000) && (a.to_us >= 4800000));
    TEST_ASSERT_EQUAL_INT64(1000000, a.to_us - a.from_us);
    expect_same_rotation(turn(0, 0, 80), a.left, 1e-9);
}

static void test_worlds_are_aligned_whatever_lies_between_them(void)
{
    make_pairs(300, 0, turn(100, 20, -60), turn(0, 0, 0));
    expect_same_rotation(turn(100, 20, -60), evl_align(EVL_ALIGN_WORLD, pair, 300u).left, 1e-6);
}

static void test_a_full_alignment_finds_worlds_and_mounting(void)
{
    static const double CASES[][6] = {{0, 0, 0, 0, 0, 0},
                                      {10, -20, 130, 3, 2, -1},
                                      {0, 0, 175, 90, 0, 0},
                                      {-40, 30, 20, 0, 170, 0},
                                      {5, 5, 5, 100, 100, -70}};
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        const double *const c = CASES[i];
        evl_align_t a;
        make_pairs(1000, 0, turn(c[0], c[1], c[2]), turn(c[3], c[4], c[5]));
        a = evl_align(EVL_ALIGN_FULL, pair, 1000u);
        expect_same_rotation(turn(c[0], c[1], c[2]), a.left, 1e-8);
        expect_same_rotation(turn(c[3], c[4], c[5]), a.right, 1e-8);
        TEST_ASSERT_TRUE(a.spread_rad > 10.0 * RAD);
        TEST_ASSERT_TRUE(evl_align_is_told(&a, 2.0 * RAD));
        TEST_ASSERT_FALSE(evl_align_is_told(&a, a.spread_rad / 2.0));
    }
}

static void test_a_full_alignment_of_a_camera_that_hardly_turns_says_so(void)
{
    evl_align_t a;
    for (int i = 0; i < 500; i++) {
        pair[i].t_us = 10000 * i;
        pair[i].ref = turn(0, 0, 20.0 * sin(0.05 * i)); /* About one axis only. */
        pair[i].est = evl_quat_mul(pair[i].ref, turn(0, 0, 15));
    }
    a = evl_align(EVL_ALIGN_FULL, pair, 500u);
    TEST_ASSERT_FALSE(evl_align_is_told(&a, 0.0));
    /* Which of the two takes the 15 degrees cannot be told; together they must. */
    expect_same_rotation(pair[77].est, evl_align_apply(&a, pair[77].ref), 1e-6);
}

static void test_the_error_over_a_time_ignores_what_is_constant(void)
{
    evh_poses_t est;
    evh_poses_t ref;
    for (int i = 0; i < 400; i++) {
        const evl_quat_t q = motion(i, 0);
        set_pose(&ref_pose[i], 10000 * i, q);
        /* The estimate drifts by 2 deg/s about the vertical, on top of a constant error. */
        set_pose(&est_pose[i], 10000 * i, evl_quat_mul(turn(0, 0, 33 + 0.02 * i), q));
    }
    est = track(est_pose, 400u);
    ref = track(ref_pose, 400u);
    TEST_ASSERT_TRUE(evl_attitude_compare(&est, &ref, INT64_MIN, INT64_MAX, EVL_ALIGN_NONE, &result));
    TEST_ASSERT_EQUAL_UINT(400u, result.total_deg.n);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 33 + 0.02 * 399, result.total_deg.max);
    TEST_ASSERT_EQUAL_UINT(390u, result.over_100ms_deg.n);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.2, result.over_100ms_deg.rmse);
    TEST_ASSERT_EQUAL_UINT(300u, result.over_1s_deg.n);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 2.0, result.over_1s_deg.max);
    /* One heading, of the first second: 33 + mean of 0 .. 100 samples. */
    TEST_ASSERT_TRUE(evl_attitude_compare(&est, &ref, INT64_MIN, INT64_MAX, EVL_ALIGN_HEADING, &result));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.02 * 399 - 1.0, result.heading_deg.max);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, result.inclination_deg.max);
    /* Only what was asked for. */
    TEST_ASSERT_TRUE(evl_attitude_compare(&est, &ref, 1000000, 1100000, EVL_ALIGN_NONE, &result));
    TEST_ASSERT_EQUAL_UINT(10u, result.total_deg.n);
    TEST_ASSERT_TRUE(evl_attitude_compare(&est, &ref, 9000000, INT64_MAX, EVL_ALIGN_NONE, &result));
    TEST_ASSERT_EQUAL_UINT(0u, result.total_deg.n);
}

static void test_velocity_comes_from_positions_into_the_frame_of_the_camera(void)
{
    evl_velocity_truth_t truth;
    evh_poses_t ref;
    evl_vec3_t v;
    for (int i = 0; i < 200; i++) {
        set_pose(&ref_pose[i], 5000 * i, turn(0, 0, 90)); /* The camera's x looks along the world's y. */
        ref_pose[i].p_m[0] = 0.005 * i * 2.0;             /* 2 m/s along the world's x: the camera's -y. */
        ref_pose[i].p_m[2] = 0.005 * i;
    }
    ref = track(ref_pose, 200u);
    memset(&truth, 0, sizeof truth);
    truth.poses = &ref;
    truth.baseline_us = 20000;
    truth.q_bc = evl_quat_identity();
    TEST_ASSERT_TRUE(evl_velocity_at(&truth, 502500, &v));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, v.x);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -2.0, v.y);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.0, v.z);
    truth.q_bc = turn(180, 0, 0); /* Mounted upside down. */
    TEST_ASSERT_TRUE(evl_velocity_at(&truth, 502500, &v));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 2.0, v.y);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -1.0, v.z);
    TEST_ASSERT_FALSE(evl_velocity_at(&truth, 5000, &v)); /* Half a baseline before is before the truth. */
    TEST_ASSERT_TRUE(evl_velocity_at(&truth, 10000, &v));
}

static void test_velocity_is_the_slope_of_the_parabola_through_noisy_positions(void)
{
    evl_velocity_truth_t truth;
    evh_poses_t ref;
    evl_vec3_t v;
    double worst = 0.0;
    for (int i = 0; i < 200; i++) {
        const double s = 0.005 * i;
        set_pose(&ref_pose[i], 5000 * i, turn(0, 0, 0));
        ref_pose[i].p_m[0] = 100.0 + 0.5 * s + 2.0 * s * s; /* Far away: digits must not get lost. */
        ref_pose[i].p_m[1] = ((i % 4) < 2) ? 0.001 : -0.001;
    }
    ref = track(ref_pose, 200u);
    memset(&truth, 0, sizeof truth);
    truth.poses = &ref;
    truth.baseline_us = 40000;
    truth.q_bc = evl_quat_identity();
    for (int t_us = 500000; t_us < 520000; t_us += 5000) {
        TEST_ASSERT_TRUE(evl_velocity_at(&truth, t_us, &v));
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 + 4.0 * 1e-6 * t_us, v.x);
        worst = (fabs(v.y) > worst) ? fabs(v.y) : worst;
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.0134, 0.0, worst); /* 4 mm / (60 * 5 ms); of two samples 10 ms apart: 0.2 m/s. */
    TEST_ASSERT_TRUE(evl_velocity_at(&truth, 501000, &v)); /* Between samples: off the middle, yet right. */
    TEST_ASSERT_DOUBLE_WITHIN(0.005, 0.5 + 4.0 * 0.501, v.x);
    truth.baseline_us = 4000; /* No sample within: the line through the ends. */
    TEST_ASSERT_TRUE(evl_velocity_at(&truth, 502500, &v));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 + 4.0 * 0.5025, v.x);
}

static void test_flow_over_an_interval_is_held_to_the_mean_velocity_over_it(void)
{
    evl_velocities_t est;
    evl_velocity_truth_t truth;
    evl_velocity_result_t r;
    evh_poses_t ref;
    evl_vec3_t v;
    for (int i = 0; i < 200; i++) { /* Along x, and from 0.5 s on along y. */
        set_pose(&ref_pose[i], 5000 * i, turn(0, 0, 0));
        ref_pose[i].p_m[0] = (i <= 100) ? 0.005 * i : 0.5;
        ref_pose[i].p_m[1] = (i <= 100) ? 0.0 : 0.005 * (i - 100);
    }
    ref = track(ref_pose, 200u);
    TEST_ASSERT_TRUE(evl_velocity_over(&ref, evl_quat_identity(), 480000, 200000, &v));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.12 / 0.2, v.x);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.08 / 0.2, v.y);
    TEST_ASSERT_TRUE(evl_velocity_over(&ref, turn(0, 0, 90), 480000, 200000, &v)); /* The camera's x is the body's y. */
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.08 / 0.2, v.x);
    TEST_ASSERT_FALSE(evl_velocity_over(&ref, evl_quat_identity(), 480000, 0, &v));
    TEST_ASSERT_FALSE(evl_velocity_over(&ref, evl_quat_identity(), 50000, 200000, &v));

    TEST_ASSERT_TRUE(evl_velocities_read(
        &est, temp_text("#t_s,vx,vy,vz,sigma_deg\n0.30,1,0,0,1\n0.48,1,0,0,25\n0.60,1,0,0,20\n"), &err));
    temp_file_remove();
    TEST_ASSERT_TRUE(evl_velocities_read_intervals(&est,
                                                   temp_text("#t_s,interval_s,result,flow_px\n0.10,0.07,few,0\n"
                                                             "0.48,0.2,valid,4\n0.50,0.2,still,0\n0.60,0.1,valid,4\n"),
                                                   &err));
    TEST_ASSERT_EQUAL_INT64(0, est.at[0].interval_us);
    TEST_ASSERT_EQUAL_INT64(200000, est.at[1].interval_us);
    TEST_ASSERT_EQUAL_INT64(100000, est.at[2].interval_us);
    memset(&truth, 0, sizeof truth);
    truth.poses = &ref;
    truth.baseline_us = 20000;
    truth.q_bc = evl_quat_identity();
    TEST_ASSERT_TRUE(evl_velocity_compare(&est, &truth, INT64_MIN, INT64_MAX, &r));
    TEST_ASSERT_EQUAL_UINT(3u, r.error_deg.n);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 30.0, r.error_deg.mean); /* 0, 0, 90 */
    TEST_ASSERT_EQUAL_UINT(2u, r.interval_error_deg.n);
    TEST_ASSERT_EQUAL_UINT(3u, r.n_sigma);
    TEST_ASSERT_EQUAL_UINT(1u, r.n_within_sigma);   /* 0 of 1 */
    TEST_ASSERT_EQUAL_UINT(2u, r.n_within_2_sigma); /* and 33.7 of 25, over its interval; 90 of 20 is not */
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.5 * (EVL_DEG_PER_RAD * atan2(2.0, 3.0) + 90.0), r.interval_error_deg.mean);
    evl_velocities_free(&est);
}

static void test_an_estimate_covers_the_time_after_it(void)
{
    evl_velocities_t est;
    TEST_ASSERT_TRUE(
        evl_velocities_read(&est, temp_text("0.10 1 0 0\n0.15 1 0 0\n0.20 0 0 0\n0.60 0 0 1\n0.98 1 0 0\n"), &err));
    /* 0.10 .. 0.25, 0.60 .. 0.70, 0.98 .. 1 of 1 s. The zero vector is no estimate. */
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.27, evl_velocity_coverage(&est, 0, 1000000));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.05 / 0.4, evl_velocity_coverage(&est, 200000, 600000));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.0, evl_velocity_coverage(&est, 120000, 220000));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0, evl_velocity_coverage(&est, 5000000, 6000000));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0, evl_velocity_coverage(&est, 100000, 100000));
    evl_velocities_free(&est);
}

static void test_an_estimate_is_held_to_the_uncertainty_that_it_tells(void)
{
    evl_velocities_t est;
    evl_velocities_t table;
    evl_velocity_truth_t truth;
    evl_velocity_result_t r;
    memset(&truth, 0, sizeof truth);
    TEST_ASSERT_TRUE(
        evl_velocities_read(&table, temp_text("0.00 1 0 0\n0.05 1 0 0\n0.10 1 0 0\n0.15 0.01 0 0\n"), &err));
    temp_file_remove();
    TEST_ASSERT_TRUE(isnan(table.at[0].sigma_deg));
    TEST_ASSERT_TRUE(evl_velocities_read(&est,
                                         temp_text("#t_s,vx,vy,vz,sigma_deg,n_flow,n_inliers\n"
                                                   "0.00,1,1,0,46,9,9\n"   /* 45 degrees: within */
                                                   "0.03,1,1,0,23,9,9\n"   /* within 2 */
                                                   "0.05,1,1,0,22,9,9\n"   /* beyond */
                                                   "0.10,1,1,0,,9,9\n"     /* does not tell */
                                                   "0.15,1,1,0,90,9,9\n"), /* slow */
                                         &err));
    truth.table = &table;
    TEST_ASSERT_TRUE(evl_velocity_compare(&est, &truth, INT64_MIN, INT64_MAX, &r));
    TEST_ASSERT_EQUAL_UINT(4u, r.error_deg.n);
    TEST_ASSERT_EQUAL_UINT(3u, r.n_sigma);
    TEST_ASSERT_EQUAL_UINT(1u, r.n_within_sigma);
    TEST_ASSERT_EQUAL_UINT(2u, r.n_within_2_sigma);
    evl_velocities_free(&est);
    evl_velocities_free(&table);
}

static void test_slow_samples_zero_vectors_and_missing_truth_are_counted_and_left_out(void)
{
    evl_velocities_t est;
    evl_velocities_t table;
    evl_velocity_truth_t truth;
    evl_velocity_result_t r;
    memset(&truth, 0, sizeof truth);
    TEST_ASSERT_TRUE(evl_velocities_read(
        &table, temp_text("0.00 1 0 0 9 9 9\n0.05 1 0 0 9 9 9\n0.10 0.1 0 0 9 9 9\n0.15 0 0 1 9 9 9\n"), &err));
    TEST_ASSERT_EQUAL_UINT(4u, table.n);
    temp_file_remove();
    TEST_ASSERT_TRUE(evl_velocities_read(&est,
                                         temp_text("#t_s,vx,vy,vz,sigma_deg,n_flow,n_inliers\n"
                                                   "0.00,1,0,0,1,9,9\n"         /* 0 degrees */
                                                   "0.05,0,2,0,1,9,9\n"         /* 90; the length does not matter */
                                                   "0.10,0,1,0,1,9,9\n"         /* slow: 0.1 < 0.25 * 0.775 */
                                                   "0.12,nan,nan,nan,nan,9,0\n" /* no estimate */
                                                   "0.13,0,0,0,1,9,9\n"         /* no direction */
                                                   "0.15,0,0,-1,1,9,9\n"        /* 180 */
                                                   "0.20,0,0,1,1,9,9\n"),       /* no truth */
                                         &err));
    TEST_ASSERT_EQUAL_UINT64(1u, est.tally.n_fault[EVH_FAULT_NOT_FINITE]);
    truth.table = &table;
    TEST_ASSERT_TRUE(evl_velocity_compare(&est, &truth, INT64_MIN, INT64_MAX, &r));
    TEST_ASSERT_EQUAL_UINT(5u, r.n_estimates);
    TEST_ASSERT_EQUAL_UINT(1u, r.n_zero);
    TEST_ASSERT_EQUAL_UINT(1u, r.n_no_truth);
    TEST_ASSERT_EQUAL_UINT(1u, r.n_slow);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.775, r.mean_speed_m_s);
    TEST_ASSERT_EQUAL_UINT(3u, r.error_deg.n);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 90.0, r.error_deg.mean);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 90.0, r.error_deg.median);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 171.0, r.error_deg.p95);
    evl_velocities_free(&est);
    evl_velocities_free(&table);
}

static void test_a_velocity_file_without_the_columns_is_refused(void)
{
    evl_velocities_t v;
    TEST_ASSERT_FALSE(evl_velocities_read(&v, temp_text("t_s,qw,qx\n0,1,2\n"), &err));
    TEST_ASSERT_NOT_NULL(strstr(err.text, "vx"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_an_error_is_parted_into_heading_and_inclination);
    RUN_TEST(test_a_small_error_does_not_drown_in_rounding);
    RUN_TEST(test_truth_is_interpolated_where_samples_are_close_and_nowhere_else);
    RUN_TEST(test_statistics_are_those_of_the_textbook);
    RUN_TEST(test_eigenvectors_are_found_in_order);
    RUN_TEST(test_a_heading_is_taken_over_the_first_second_of_motion);
    RUN_TEST(test_after_a_rest_its_last_second_counts);
    RUN_TEST(test_worlds_are_aligned_whatever_lies_between_them);
    RUN_TEST(test_a_full_alignment_finds_worlds_and_mounting);
    RUN_TEST(test_a_full_alignment_of_a_camera_that_hardly_turns_says_so);
    RUN_TEST(test_the_error_over_a_time_ignores_what_is_constant);
    RUN_TEST(test_velocity_comes_from_positions_into_the_frame_of_the_camera);
    RUN_TEST(test_velocity_is_the_slope_of_the_parabola_through_noisy_positions);
    RUN_TEST(test_flow_over_an_interval_is_held_to_the_mean_velocity_over_it);
    RUN_TEST(test_an_estimate_covers_the_time_after_it);
    RUN_TEST(test_an_estimate_is_held_to_the_uncertainty_that_it_tells);
    RUN_TEST(test_slow_samples_zero_vectors_and_missing_truth_are_counted_and_left_out);
    RUN_TEST(test_a_velocity_file_without_the_columns_is_refused);
    return UNITY_END();
}
