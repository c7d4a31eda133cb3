/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "calib.h"
#include "config_yaml.h"
#include "temp_file.h"
#include "unity.h"

static evh_config_t config;
static evh_error_t err;

void setUp(void)
{
    memset(&err, 0, sizeof err);
    evh_set_quiet(true);
}
void tearDown(void) { temp_file_remove(); }

static bool parse(const char *text) { return evh_config_parse(&config, text, strlen(text), "test.yaml", &err); }

static void test_the_papers_parameter_names_are_understood(void)
{
    TEST_ASSERT_TRUE_MESSAGE(
        parse("image_width: 640\nimage_height: 480\n"
              "K: [327.5, 0.0, 305, 0, 327.25, 235, 0, 0, 1]\nD: [-0.03, 0.04, -0.0005, -0.001, 0.0]\n"
              "fisheye_distortion: False\nget_orientation_from_imu: True\n"
              "use_external_extrinsic_rotation: True\nq_external : [0.6, 0.0, 0.0, 0.8] # xyzw\n"
              "accumulation_type: area\nroi_threshold: 250\nnumber_of_columns: 34\nnumber_of_rows: 26\n"
              "enable_saccades: True\ncanvas_gain: 2.0\n"),
        err.text);
    TEST_ASSERT_TRUE(config.has_calib);
    TEST_ASSERT_FALSE(config.calib.fisheye);
    TEST_ASSERT_EQUAL_DOUBLE(327.5, config.calib.fx_px);
    TEST_ASSERT_EQUAL_DOUBLE(327.25, config.calib.fy_px);
    TEST_ASSERT_EQUAL_DOUBLE(305.0, config.calib.cx_px);
    TEST_ASSERT_EQUAL_DOUBLE(235.0, config.calib.cy_px);
    TEST_ASSERT_EQUAL_DOUBLE(-0.001, config.calib.dist[3]);
    TEST_ASSERT_EQUAL_UINT16(640, config.calib.width_px);
    TEST_ASSERT_EQUAL_UINT16(480, config.calib.height_px);
    TEST_ASSERT_TRUE(config.has_q_ci);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.8, config.q_ci_wxyz[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.6, config.q_ci_wxyz[1]);
    TEST_ASSERT_EQUAL_INT(EVH_WINDOW_AREA, config.window_kind);
    TEST_ASSERT_EQUAL_INT64(250, config.roi_threshold);
    TEST_ASSERT_EQUAL_INT64(34, config.n_columns);
    TEST_ASSERT_EQUAL_INT64(26, config.n_rows);
    TEST_ASSERT_TRUE(config.has_saccades && config.saccades);
    TEST_ASSERT_TRUE(config.has_from_imu && config.from_imu);
}

static void test_a_gyro_bias_can_be_told(void)
{
    static const char *const BAD[] = {"gyro_bias: 0.1\n", "gyro_bias: [0, 0, 0.51]\n", "gyro_bias: [0, -0.51, 0]\n",
                                      "gyro_bias: [0, 0, 0, 0]\n"};
    TEST_ASSERT_TRUE_MESSAGE(parse("imu:\n  gyro_bias: [0.5, -0.02, 1e-3]\n"), err.text);
    TEST_ASSERT_TRUE(config.has_gyro_bias);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5, config.gyro_bias_rad_s[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.02, config.gyro_bias_rad_s[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.001, config.gyro_bias_rad_s[2]);
    TEST_ASSERT_TRUE(parse("image: iwe\n"));
    TEST_ASSERT_FALSE(config.has_gyro_bias);
    for (size_t i = 0u; i < sizeof BAD / sizeof BAD[0]; i++) {
        memset(&err, 0, sizeof err);
        TEST_ASSERT_FALSE_MESSAGE(parse(BAD[i]), BAD[i]);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(err.text, "test.yaml: line 1: gyro_bias"), err.text);
    }
}

static void test_what_becomes_of_a_window_can_be_told_too(void)
{
    static const char *const BAD[] = {
        "image: iw\n",  "image: iwe,\n", "image: iwe, surface\n", "image: ''\n",         "image: [iwe]\n",
        "warp: tile\n", "warp: off\n",   "velocity: maybe\n",     "method: erlv-pape\n", "method: erl-v\n"};
    TEST_ASSERT_TRUE_MESSAGE(parse("node:\n  image: surface\n  warp: predicted\n  velocity: off\n  method: erl\n"),
                             err.text);
    TEST_ASSERT_EQUAL_STRING("surface", config.image);
    TEST_ASSERT_EQUAL_STRING("predicted", config.warp);
    TEST_ASSERT_EQUAL_STRING("erl", config.method);
    TEST_ASSERT_TRUE(config.has_velocity && !config.velocity);
    TEST_ASSERT_TRUE_MESSAGE(parse("image: count\nwarp: none\nvelocity: True\nmethod: erlv-paper\n"), err.text);
    TEST_ASSERT_EQUAL_STRING("count", config.image);
    TEST_ASSERT_EQUAL_STRING("erlv-paper", config.method);
    TEST_ASSERT_TRUE(parse("K: [200, 0, 120, 0, 200, 90, 0, 0, 1]\n"));
    TEST_ASSERT_EQUAL_STRING("", config.image);
    TEST_ASSERT_FALSE(config.has_velocity);
    for (size_t i = 0u; i < sizeof BAD / sizeof BAD[0]; i++) {
        memset(&err, 0, sizeof err);
        TEST_ASSERT_FALSE_MESSAGE(parse(BAD[i]), BAD[i]);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(err.text, "test.yaml: line 1: "), err.text);
    }
}

static void test_keys_nested_under_a_node_name_are_found(void)
{
    TEST_ASSERT_TRUE_MESSAGE(
        parse("event_stabilization_node:\n  ros__parameters:\n    accumulation_type: time\n"
              "    accumulation_time: 0.025\n    fisheye_distortion: true\n"
              "    camera_matrix:\n      rows: 3\n      cols: 3\n      data: [200, 0, 120, 0, 201, 90, 0, 0, 1]\n"
              "    D: [0.1, 0.2, 0.3, 0.4, 0.0]\n"),
        err.text);
    TEST_ASSERT_EQUAL_INT(EVH_WINDOW_TIME, config.window_kind);
    TEST_ASSERT_EQUAL_INT64(25000, config.window_time_us);
    TEST_ASSERT_TRUE(config.calib.fisheye);
    TEST_ASSERT_EQUAL_DOUBLE(201.0, config.calib.fy_px);
    TEST_ASSERT_EQUAL_DOUBLE(0.4, config.calib.dist[3]);
}

static void test_an_external_rotation_that_is_switched_off_is_not_used(void)
{
    TEST_ASSERT_TRUE(parse("q_external: [0.5, 0.5, 0.5, 0.5]\nuse_external_extrinsic_rotation: False\n"));
    TEST_ASSERT_FALSE(config.has_q_ci);
}

static void test_euroc_sensor_file_gives_the_camera_and_its_rotation(void)
{
    /* The camera looks along the body's x axis: body from camera has columns (0 -1 0), (0 0 -1), (1 0 0). */
    TEST_ASSERT_TRUE_MESSAGE(
        parse("%YAML:1.0\n# comment\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n"
              "  data: [0, 0, 1, 0.1,\n -1, 0, 0, 0.2,\n 0, -1, 0, 0.3,\n 0, 0, 0, 1]\n"
              "resolution: [752, 480]\nintrinsics: [458.654, 457.296, 367.215, 248.375]\n"
              "distortion_model: radial-tangential\ndistortion_coefficients: [-0.28, 0.07, 0.0002, 0.00002]\n"),
        err.text);
    TEST_ASSERT_EQUAL_UINT16(752, config.calib.width_px);
    TEST_ASSERT_EQUAL_DOUBLE(457.296, config.calib.fy_px);
    TEST_ASSERT_EQUAL_DOUBLE(0.00002, config.calib.dist[3]);
    TEST_ASSERT_TRUE(config.has_q_ci);
    /* q_bc = (0.5, -0.5, 0.5, -0.5), so q_cb is its conjugate. */
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5, fabs(config.q_ci_wxyz[0]));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.25, config.q_ci_wxyz[0] * config.q_ci_wxyz[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.25, config.q_ci_wxyz[0] * config.q_ci_wxyz[2]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.25, config.q_ci_wxyz[0] * config.q_ci_wxyz[3]);
}

static void test_bad_values_name_line_key_and_expectation(void)
{
    static const struct {
        const char *text;
        const char *want;
    } CASES[] = {
        {"K: [1, 2, 3]\n", "test.yaml: line 1: K has 3 numbers; expected 9 or more"},
        {"a: 1\nroi_threshold: many\n",
         "test.yaml: line 2: roi_threshold is 'many'; expected a number of 1 .. 1000000"},
        {"enable_saccades: maybe\n", "test.yaml: line 1: enable_saccades is 'maybe'; expected True or False"},
        {"accumulation_type: aera\n",
         "test.yaml: line 1: accumulation_type is 'aera'; expected area, number_of_events or time"},
        {"K: [0, 0, 120, 0, 200, 90, 0, 0, 1]\n",
         "test.yaml: focal length fx 0, fy 200; it is given in pixels and must lie in 8 .. 8192"},
        {"K: [200, 0, nan, 0, 200, 90, 0, 0, 1]\n", "test.yaml: line 1: K is 'nan'; expected numbers"},
        {"q_external: [0, 0, 0, 0]\n",
         "test.yaml: line 1: q_external has length 0; expected a unit quaternion [qx, qy, qz, qw]"},
        {"", "test.yaml: the file is empty"},
        {"- 1\n- 2\n", "test.yaml: expected \"key: value\" lines"},
        {"a: [1\n", NULL},
        {"\x80\x81", NULL},
        {"a: &a [x,x,x,x,x,x,x,x,x,x]\nb: &b [*a,*a,*a,*a,*a,*a,*a,*a,*a,*a]\nc: &c [*b,*b,*b,*b,*b,*b,*b,*b,*b,*b]\n"
         "d: &d {e: [*c,*c,*c,*c,*c,*c,*c,*c,*c,*c], f: {g: [[],[]]}}\nh: {i: *d, j: *d, k: {l: *d}}\nD: [*c,*c]\n",
         NULL},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        memset(&err, 0, sizeof err);
        TEST_ASSERT_FALSE_MESSAGE(parse(CASES[i].text), CASES[i].text);
        if (CASES[i].want != NULL) {
            TEST_ASSERT_EQUAL_STRING(CASES[i].want, err.text);
        } else {
            TEST_ASSERT_TRUE_MESSAGE(strncmp(err.text, "test.yaml: ", 11) == 0, CASES[i].text);
        }
    }
}

static void test_ecd_calibration_text(void)
{
    evh_calib_t calib;
    TEST_ASSERT_TRUE(
        evh_calib_text_read(&calib, temp_text("199.09 198.82 132.19 110.71 -0.36 0.15 -0.0003 -0.0007 0.1\r\n"), &err));
    TEST_ASSERT_EQUAL_DOUBLE(198.82, calib.fy_px);
    TEST_ASSERT_EQUAL_DOUBLE(-0.0007, calib.dist[3]);
    TEST_ASSERT_EQUAL_DOUBLE(0.1, calib.dist[4]);
    TEST_ASSERT_TRUE(evh_calib_text_read(&calib, temp_text("200 201\n120 90"), &err));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, calib.dist[0]);
    TEST_ASSERT_EQUAL_DOUBLE(90.0, calib.cy_px);
}

static void test_bad_calibration_text_is_refused_with_a_reason(void)
{
    static const struct {
        const char *text;
        const char *want;
    } CASES[] = {
        {"", "holds 0 numbers"},
        {"1 2 3\n", "holds 3 numbers"},
        {"0 200 120 90\n", "focal length fx 0"},
        {"-200 200 120 90\n", "focal length fx -200"},
        {"nan 200 120 90\n", "focal length fx"},
        {"200 200 120 1e9\n", "principal point"},
        {"200 200 120 90 1e9 0 0 0 0\n", "distortion coefficient 1"},
        {"200 200 120 ninety\n", "line 1"},
        {"200 200 120 90 0 0 0 0 0 0\n", "line 1"},
        {"\x01\x02\x03", "line 1"},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        evh_calib_t calib;
        memset(&err, 0, sizeof err);
        TEST_ASSERT_FALSE_MESSAGE(evh_calib_text_read(&calib, temp_text(CASES[i].text), &err), CASES[i].text);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(err.text, CASES[i].want), err.text);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_papers_parameter_names_are_understood);
    RUN_TEST(test_a_gyro_bias_can_be_told);
    RUN_TEST(test_what_becomes_of_a_window_can_be_told_too);
    RUN_TEST(test_keys_nested_under_a_node_name_are_found);
    RUN_TEST(test_an_external_rotation_that_is_switched_off_is_not_used);
    RUN_TEST(test_euroc_sensor_file_gives_the_camera_and_its_rotation);
    RUN_TEST(test_bad_values_name_line_key_and_expectation);
    RUN_TEST(test_ecd_calibration_text);
    RUN_TEST(test_bad_calibration_text_is_refused_with_a_reason);
    return UNITY_END();
}
