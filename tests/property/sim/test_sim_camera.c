/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <math.h>
#include <string.h>

#include "camera.h"
#include "settings.h"
#include "unity.h"

static evsim_camera_t camera;
static evh_calib_t calib;
static evh_error_t err;

void setUp(void)
{
    memset(&camera, 0, sizeof camera);
    err.text[0] = '\0';
}

void tearDown(void) { evsim_camera_free(&camera); }

static void check_round_trip(void)
{
    TEST_ASSERT_TRUE_MESSAGE(evsim_camera_init(&camera, &calib, &err), err.text);
    for (unsigned y = 0u; y < calib.height_px; y++) {
        for (unsigned x = 0u; x < calib.width_px; x++) {
            const size_t i = (size_t)y * calib.width_px + x;
            double out[2];
            evsim_distort(&calib, (double)camera.ray_x[i], (double)camera.ray_y[i], out, NULL);
            TEST_ASSERT_DOUBLE_WITHIN(2e-4, (double)x, calib.fx_px * out[0] + calib.cx_px); /* Rays are floats. */
            TEST_ASSERT_DOUBLE_WITHIN(2e-4, (double)y, calib.fy_px * out[1] + calib.cy_px);
        }
    }
}

static void test_every_pixel_of_the_default_lens_projects_back_on_itself(void)
{
    static const uint16_t SIZES[][2] = {{240, 180}, {346, 260}, {97, 203}, {640, 480}, {1, 1}, {5, 1}};
    for (size_t k = 0; k < sizeof SIZES / sizeof SIZES[0]; k++) {
        evsim_default_calib(&calib, SIZES[k][0], SIZES[k][1]);
        check_round_trip();
        evsim_camera_free(&camera);
    }
}

static void test_all_five_coefficients_take_part(void)
{
    evsim_default_calib(&calib, 240, 180);
    calib.cx_px = 132.2;
    calib.cy_px = 110.7;
    memcpy(calib.dist, (const double[5]){-0.3684, 0.1509, -0.003, 0.002, -0.01}, sizeof calib.dist);
    check_round_trip();
}

static void test_jacobian_is_the_derivative(void)
{
    const double h = 1e-6;
    evsim_default_calib(&calib, 240, 180);
    memcpy(calib.dist, (const double[5]){-0.3684, 0.1509, -0.003, 0.002, -0.01}, sizeof calib.dist);
    for (double x = -0.6; x < 0.7; x += 0.3) {
        for (double y = -0.5; y < 0.6; y += 0.25) {
            double out[2];
            double j[4];
            double plus[2];
            double minus[2];
            evsim_distort(&calib, x, y, out, j);
            evsim_distort(&calib, x + h, y, plus, NULL);
            evsim_distort(&calib, x - h, y, minus, NULL);
            TEST_ASSERT_DOUBLE_WITHIN(1e-8, (plus[0] - minus[0]) / (2.0 * h), j[0]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-8, (plus[1] - minus[1]) / (2.0 * h), j[2]);
            evsim_distort(&calib, x, y + h, plus, NULL);
            evsim_distort(&calib, x, y - h, minus, NULL);
            TEST_ASSERT_DOUBLE_WITHIN(1e-8, (plus[0] - minus[0]) / (2.0 * h), j[1]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-8, (plus[1] - minus[1]) / (2.0 * h), j[3]);
        }
    }
}

static void test_a_lens_that_folds_over_on_the_sensor_is_refused(void)
{
    evsim_default_calib(&calib, 240, 180);
    calib.dist[0] = -1.0;
    calib.dist[1] = 0.0;
    TEST_ASSERT_FALSE(evsim_camera_init(&camera, &calib, &err));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(err.text, "no inverse"), err.text);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_every_pixel_of_the_default_lens_projects_back_on_itself);
    RUN_TEST(test_all_five_coefficients_take_part);
    RUN_TEST(test_jacobian_is_the_derivative);
    RUN_TEST(test_a_lens_that_folds_over_on_the_sensor_is_refused);
    return UNITY_END();
}
