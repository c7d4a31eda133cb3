/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <stdio.h>
#include <string.h>

#include "imu_text.h"
#include "poses_text.h"
#include "temp_file.h"
#include "unity.h"

static evh_error_t err;
static evh_imu_sample_t sample[64];
static size_t n_samples;
static evh_tally_t tally;

void setUp(void)
{
    memset(&err, 0, sizeof err);
    evh_set_quiet(true);
}
void tearDown(void) { temp_file_remove(); }

static bool read_imu(const char *path, const evh_imu_order_t *order)
{
    evh_imu_t imu;
    n_samples = 0;
    if (!evh_imu_open(&imu, path, order, &err)) { return false; }
    while ((n_samples < 64) && evh_imu_next(&imu, &sample[n_samples], &err)) { n_samples++; }
    tally = imu.rows.tally;
    evh_imu_close(&imu);
    return err.text[0] == '\0';
}

static void expect(size_t i, int64_t t_us, double gx, double az)
{
    TEST_ASSERT_TRUE(i < n_samples);
    TEST_ASSERT_EQUAL_INT64(t_us, sample[i].t_us);
    TEST_ASSERT_EQUAL_DOUBLE(gx, sample[i].gyro_rad_s[0]);
    TEST_ASSERT_EQUAL_DOUBLE(az, sample[i].accel_m_s2[2]);
}

static void test_ecd_order_is_accelerometer_first(void)
{
    TEST_ASSERT_TRUE(read_imu(temp_text("0.001 0.1 0.2 9.8 1 2 3\n0.002 0.1 0.2 9.7 4 5 6\n"), NULL));
    TEST_ASSERT_EQUAL_UINT(2, n_samples);
    expect(0, 1000, 1.0, 9.8);
    expect(1, 2000, 4.0, 9.7);
}

static void test_gyro_first_is_noticed_from_the_numbers(void)
{
    TEST_ASSERT_TRUE(
        read_imu(temp_text("0.001 1 2 3 0.1 0.2 9.8\n0.002 1 2 3 0.1 0.2 9.8\n0.003 1 2 3 0 0 9.8\n"), NULL));
    expect(0, 1000, 1.0, 9.8);
}

static void test_an_order_that_the_user_gives_wins(void)
{
    evh_imu_order_t order;
    TEST_ASSERT_TRUE(evh_imu_order_parse("accel-first", &order));
    TEST_ASSERT_TRUE(read_imu(temp_text("0.001 1 2 3 0.1 0.2 9.8\n0.002 1 2 3 0.1 0.2 9.8\n"), &order));
    expect(0, 1000, 0.1, 3.0);
    TEST_ASSERT_TRUE(evh_imu_order_parse("_,t,gx,gy,gz,ax,ay,az", &order));
    TEST_ASSERT_TRUE(read_imu(temp_text("7 0.001 1 2 3 0.1 0.2 9.8\n8 0.002 1 2 3 0.1 0.2 9.8\n"), &order));
    expect(1, 2000, 1.0, 9.8);
}

static void test_orders_that_make_no_sense_are_refused(void)
{
    static const char *const CASES[] = {"",
                                        "accel",
                                        "t,ax,ay,az,gx,gy",
                                        "t,t,ax,ay,az,gx,gy,gz",
                                        "t;ax;ay;az;gx;gy;gz",
                                        "t,ax,ay,az,gx,gy,foo",
                                        "t,ax,ay,az,gx,gy,gz,"};
    evh_imu_order_t order;
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(evh_imu_order_parse(CASES[i], &order), CASES[i]);
    }
}

static void test_euroc_header_names_columns_and_nanoseconds(void)
{
    TEST_ASSERT_TRUE(read_imu(
        temp_text("#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m "
                  "s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\r\n"
                  "1403715273262142976,-0.5,0,0,9.08,0.13,-3.69\r\n1403715273267142912,0,0,0,9.08,0.12,-3.5\r\n"),
        NULL));
    TEST_ASSERT_EQUAL_UINT(2, n_samples);
    expect(0, 1403715273262143, -0.5, -3.69);
    expect(1, 1403715273267143, 0.0, -3.5);
}

static void test_a_csv_header_gives_any_order_and_further_columns_are_ignored(void)
{
    evh_imu_t imu;
    evh_imu_sample_t s;
    TEST_ASSERT_TRUE(
        evh_imu_open_named(&imu,
                           temp_text("az_m_s2,moving,gx_rad_s,gy_rad_s,gz_rad_s,t_s,ax_m_s2,ay_m_s2,mx_ut,my_ut,mz_ut\n"
                                     "9.8,yes,1,2,3,0.5,4,5,20,21,22\n9.8,no,1,2,3,0.6,4,5,,,\n"),
                           &err));
    TEST_ASSERT_TRUE(evh_imu_next(&imu, &s, &err));
    TEST_ASSERT_EQUAL_INT64(500000, s.t_us);
    TEST_ASSERT_EQUAL_DOUBLE(3.0, s.gyro_rad_s[2]);
    TEST_ASSERT_EQUAL_DOUBLE(4.0, s.accel_m_s2[0]);
    TEST_ASSERT_TRUE(s.has_mag);
    TEST_ASSERT_EQUAL_DOUBLE(22.0, s.mag_ut[2]);
    TEST_ASSERT_TRUE(evh_imu_next(&imu, &s, &err));
    TEST_ASSERT_FALSE(s.has_mag);
    TEST_ASSERT_FALSE(evh_imu_next(&imu, &s, &err));
    evh_imu_close(&imu);
}

static void test_a_missing_column_is_named(void)
{
    evh_imu_t imu;
    TEST_ASSERT_FALSE(
        evh_imu_open_named(&imu, temp_text("t_s,gx_rad_s,gy_rad_s,ax_m_s2,ay_m_s2,az_m_s2\n0,0,0,0,0,0\n"), &err));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(err.text, "line 1"), err.text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(err.text, "gz_rad_s"), err.text);
    memset(&err, 0, sizeof err);
    TEST_ASSERT_FALSE(evh_imu_open_named(&imu, temp_text("0,0,0,0,0,0,0\n"), &err));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(err.text, "no header"), err.text);
}

static void test_bad_samples_are_counted_and_skipped(void)
{
    TEST_ASSERT_TRUE(read_imu(temp_text("0.001 0 0 9.8 1 2 3\n"
                                        "0.002 0 nan 9.8 1 2 3\n" /* 2 */
                                        "0.003 0 0 9.8 1e9 2 3\n" /* 3 */
                                        "0.004 0 0 9.8 1 2\n"     /* 4 */
                                        "0.001 0 0 9.8 1 2 3\n"   /* 5: back */
                                        "1e9 0 0 9.8 1 2 3\n"     /* 6: jump */
                                        "0.005 0 0 9.8 1 x 3\n"   /* 7 */
                                        "0.006 0 0 9.8 1 2 3"),
                              NULL));
    TEST_ASSERT_EQUAL_UINT(2, n_samples);
    expect(1, 6000, 1.0, 9.8);
    TEST_ASSERT_EQUAL_UINT64(2, tally.first_line[EVH_FAULT_NOT_FINITE]);
    TEST_ASSERT_EQUAL_UINT64(3, tally.first_line[EVH_FAULT_RANGE]);
    TEST_ASSERT_EQUAL_UINT64(4, tally.first_line[EVH_FAULT_MALFORMED]);
    TEST_ASSERT_EQUAL_UINT64(2, tally.n_fault[EVH_FAULT_MALFORMED]);
    TEST_ASSERT_EQUAL_UINT64(5, tally.first_line[EVH_FAULT_TIME_BACK]);
    TEST_ASSERT_EQUAL_UINT64(6, tally.first_line[EVH_FAULT_TIME_JUMP]);
}

static void test_rows_with_faults_are_kept_for_outputs_of_one_row_per_row(void)
{
    evh_imu_t imu;
    evh_imu_sample_t s;
    TEST_ASSERT_TRUE(
        evh_imu_open(&imu, temp_text("0.001 0 0 9.8 1 2 3\n0.002 0 0 inf 1 2 3\n\n0.003 0 0 9.8 1 2 3\n"), NULL, &err));
    TEST_ASSERT_TRUE(evh_imu_next_any(&imu, &s, &err));
    TEST_ASSERT_TRUE(evh_imu_next_any(&imu, &s, &err));
    TEST_ASSERT_EQUAL_INT(EVH_FAULT_NOT_FINITE, s.fault);
    TEST_ASSERT_TRUE(s.has_time);
    TEST_ASSERT_EQUAL_INT64(2000, s.t_us);
    TEST_ASSERT_TRUE(evh_imu_next_any(&imu, &s, &err));
    TEST_ASSERT_EQUAL_INT(EVH_FAULT_NONE, s.fault);
    TEST_ASSERT_FALSE(evh_imu_next_any(&imu, &s, &err));
    evh_imu_close(&imu);
}

static void test_poses_of_each_data_set_are_read_and_bad_quaternions_counted(void)
{
    evh_poses_t poses;
    TEST_ASSERT_TRUE(
        evh_poses_read(&poses,
                       temp_text("# timestamp(s) tx ty tz qx qy qz qw\n1403715274.30214 1 2 3 0.6 0 0 0.8\n"
                                 "1403715274.40214 1 2 3 0 0 0 0\n1403715274.50214 1 2 3 0 0 1 0\n"),
                       &err));
    TEST_ASSERT_EQUAL_UINT(2, poses.n);
    TEST_ASSERT_EQUAL_INT64(1403715274302140, poses.pose[0].t_us);
    TEST_ASSERT_EQUAL_DOUBLE(3.0, poses.pose[0].p_m[2]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.8, poses.pose[0].q_wxyz[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.6, poses.pose[0].q_wxyz[1]);
    TEST_ASSERT_EQUAL_UINT64(1, poses.tally.n_fault[EVH_FAULT_RANGE]);
    TEST_ASSERT_EQUAL_UINT64(3, poses.tally.first_line[EVH_FAULT_RANGE]);
    TEST_ASSERT_EQUAL_UINT64(2, poses.tally.n_good);
    evh_poses_free(&poses);

    TEST_ASSERT_TRUE(
        evh_poses_read(&poses,
                       temp_text("#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], "
                                 "q_RS_y [], q_RS_z []\n1520530308189679351,1,2,3,1,0,0,0\n"
                                 "1520530308199679351,1,2,3,0,1,0,0\n"),
                       &err));
    TEST_ASSERT_EQUAL_UINT(2, poses.n);
    TEST_ASSERT_EQUAL_INT64(1520530308189679, poses.pose[0].t_us);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, poses.pose[0].q_wxyz[0]);
    evh_poses_free(&poses);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_ecd_order_is_accelerometer_first);
    RUN_TEST(test_gyro_first_is_noticed_from_the_numbers);
    RUN_TEST(test_an_order_that_the_user_gives_wins);
    RUN_TEST(test_orders_that_make_no_sense_are_refused);
    RUN_TEST(test_euroc_header_names_columns_and_nanoseconds);
    RUN_TEST(test_a_csv_header_gives_any_order_and_further_columns_are_ignored);
    RUN_TEST(test_a_missing_column_is_named);
    RUN_TEST(test_bad_samples_are_counted_and_skipped);
    RUN_TEST(test_rows_with_faults_are_kept_for_outputs_of_one_row_per_row);
    RUN_TEST(test_poses_of_each_data_set_are_read_and_bad_quaternions_counted);
    return UNITY_END();
}
