/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Random lenses: what the inverse returns leads back, and what lies in the domain is found again. */
#include <math.h>

#include "evs/camera.h"
#include "evs/undistort.h"
#include "unity.h"

enum { N_LENSES = 150, N_SAMPLES = 40 };

static uint64_t state;

void setUp(void) { state = 2026u; }
void tearDown(void) {}

static double uniform(double lo, double hi)
{
    state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return lo + (hi - lo) * ((double)(state >> 11) / 9007199254740992.0);
}

static int32_t q16(double x) { return (int32_t)floor(x * 65536.0 + 0.5); }

/* Lenses as calibrations find them, and a good deal worse. */
static bool random_camera(evs_camera_t *cam, evs_camera_model_t model)
{
    const uint16_t width_px = (uint16_t)uniform(64.0, 1281.0);
    const uint16_t height_px = (uint16_t)uniform(64.0, 801.0);
    evs_camera_config_t cfg = evs_camera_config_ideal(width_px, height_px, 0);
    cfg.model = model;
    cfg.fx_q16 = q16(uniform(0.4, 2.5) * width_px);
    cfg.fy_q16 = q16(uniform(0.9, 1.1) * cfg.fx_q16 / 65536.0);
    cfg.cx_q16 += q16(uniform(-0.1, 0.1) * width_px);
    cfg.cy_q16 += q16(uniform(-0.1, 0.1) * height_px);
    const double size = (model == EVS_CAMERA_FISHEYE) ? 0.1 : 0.5;
    for (unsigned i = 0; i < EVS_CAMERA_N_DIST; i++) {
        const bool tangential = (model == EVS_CAMERA_PINHOLE) && ((i == 2u) || (i == 3u));
        cfg.dist_q32[i] = (int64_t)(uniform(-1.0, 1.0) * (tangential ? 0.01 : size) * 4294967296.0);
    }
    if (model == EVS_CAMERA_FISHEYE) { cfg.dist_q32[4] = 0; }
    return evs_camera_init(cam, &cfg) == EVS_OK;
}

static double distance_px(evs_camera_px_t a, evs_camera_px_t b)
{
    const double dx = ((double)a.x_q16 - b.x_q16) / 65536.0;
    const double dy = ((double)a.y_q16 - b.y_q16) / 65536.0;
    return sqrt(dx * dx + dy * dy);
}

/* How far the image moves when the ideal pixel moves by the rounding of evs_camera_px_t, and a little more. */
static double tolerance_px(const evs_camera_t *cam, evs_camera_px_t ideal, evs_camera_px_t there)
{
    evs_camera_px_t moved = ideal;
    evs_camera_px_t far;
    double most = 0.0;
    for (int k = 0; k < 4; k++) {
        moved.x_q16 = ideal.x_q16 + ((k == 0) ? 64 : 0) - ((k == 1) ? 64 : 0);
        moved.y_q16 = ideal.y_q16 + ((k == 2) ? 64 : 0) - ((k == 3) ? 64 : 0);
        if (evs_camera_distort(cam, moved, &far) == EVS_OK) { most = fmax(most, distance_px(there, far) / 64.0); }
    }
    return 2.0 * most + 1.0 / 16384.0;
}

static void check_pixels_lead_back(evs_camera_model_t model)
{
    int n_answers = 0;
    for (int i = 0; i < N_LENSES; i++) {
        evs_camera_t cam;
        if (!random_camera(&cam, model)) { continue; }
        for (int k = 0; k < N_SAMPLES; k++) {
            const evs_camera_px_t px = {q16(uniform(-0.2, 1.2) * cam.cfg.width_px),
                                        q16(uniform(-0.2, 1.2) * cam.cfg.height_px)};
            evs_camera_px_t ideal;
            evs_camera_px_t there;
            int32_t ray_q30[3];
            const evs_status_t has_ray = evs_camera_ray(&cam, px, ray_q30);
            if (has_ray == EVS_OK) {
                if (evs_camera_project(&cam, ray_q30, &there) == EVS_OK) { /* else rounded across the edge */
                    /* A ray holds 2^-30; a wide pinhole magnifies that by 1 / z^2. */
                    const double z = ray_q30[2] / 1073741824.0;
                    const double steep = (model == EVS_CAMERA_PINHOLE) ? 1.0 / (z * z) : 1.0;
                    TEST_ASSERT_TRUE(distance_px(px, there) < 1.0 / 8192.0 * steep);
                }
            }
            if (evs_camera_undistort(&cam, px, &ideal) != EVS_OK) { continue; }
            TEST_ASSERT_EQUAL_INT(EVS_OK, has_ray);
            n_answers++;
            if (evs_camera_distort(&cam, ideal, &there) != EVS_OK) { continue; }
            TEST_ASSERT_TRUE(distance_px(px, there) <= tolerance_px(&cam, ideal, there));
        }
    }
    TEST_ASSERT_TRUE(n_answers > N_LENSES * N_SAMPLES / 2);
}

static void test_every_answer_of_a_random_pinhole_leads_back_to_its_pixel(void)
{
    check_pixels_lead_back(EVS_CAMERA_PINHOLE);
}

static void test_every_answer_of_a_random_fisheye_leads_back_to_its_pixel(void)
{
    check_pixels_lead_back(EVS_CAMERA_FISHEYE);
}

static void test_every_ideal_pixel_well_inside_the_domain_is_found_again(void)
{
    int n_found = 0;
    for (int i = 0; i < 2 * N_LENSES; i++) {
        evs_camera_t cam;
        if (!random_camera(&cam, ((i & 1) != 0) ? EVS_CAMERA_FISHEYE : EVS_CAMERA_PINHOLE)) { continue; }
        double limit = (double)evs_camera_domain_q32(&cam) / 4294967296.0;
        if (cam.cfg.model == EVS_CAMERA_FISHEYE) { limit = tan(fmin(limit, 1.3)); }
        for (int k = 0; k < N_SAMPLES; k++) {
            const double r = uniform(0.0, 0.9) * limit;
            const double a = uniform(0.0, 6.2831853);
            const double x_px = cam.cfg.cx_q16 / 65536.0 + r * cos(a) * cam.cfg.fx_q16 / 65536.0;
            const double y_px = cam.cfg.cy_q16 / 65536.0 + r * sin(a) * cam.cfg.fy_q16 / 65536.0;
            if ((fabs(x_px) > 2046.0) || (fabs(y_px) > 2046.0)) { continue; }
            const evs_camera_px_t ideal = {q16(x_px), q16(y_px)};
            evs_camera_px_t there;
            evs_camera_px_t found;
            if (evs_camera_distort(&cam, ideal, &there) != EVS_OK) { continue; } /* beyond 32767 px */
            TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_undistort(&cam, there, &found));
            n_found++;
            /* At 90 % of the domain the slope is at least about a tenth: rounding grows tenfold, with the fisheye's
             * tangent up to 1 + 3.6^2 times more. */
            const double steep = 20.0 * ((cam.cfg.model == EVS_CAMERA_FISHEYE) ? 1.0 + r * r : 1.0);
            TEST_ASSERT_TRUE(distance_px(ideal, found) < steep / 65536.0 + 1e-4);
        }
    }
    TEST_ASSERT_TRUE(n_found > N_LENSES * N_SAMPLES);
}

static void test_grids_of_random_lenses_invent_no_position(void)
{
    static evs_point_t table[EVS_UNDISTORT_POINTS(64, 48, 4)];
    for (int i = 0; i < 40; i++) {
        evs_camera_t cam;
        if (!random_camera(&cam, ((i & 1) != 0) ? EVS_CAMERA_FISHEYE : EVS_CAMERA_PINHOLE)) { continue; }
        evs_camera_config_t cfg = cam.cfg;
        cfg.width_px = 64;
        cfg.height_px = 48;
        cfg.cx_q16 = q16(uniform(20.0, 44.0));
        cfg.cy_q16 = q16(uniform(15.0, 33.0));
        cfg.fx_q16 = q16(uniform(15.0, 80.0));
        cfg.fy_q16 = cfg.fx_q16;
        if (evs_camera_init(&cam, &cfg) != EVS_OK) { continue; }
        evs_undistort_t u;
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_undistort_build(&u, &cam, 4, table, sizeof table / sizeof table[0]));
        for (uint16_t y = 0; y < 48; y++) {
            for (uint16_t x = 0; x < 64; x++) {
                const evs_camera_px_t px = {x * 65536, y * 65536};
                if (evs_point_is_outside(evs_camera_undistort_point(&cam, px))) {
                    TEST_ASSERT_TRUE(evs_point_is_outside(evs_undistort_pixel(&u, x, y)));
                }
            }
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_every_answer_of_a_random_pinhole_leads_back_to_its_pixel);
    RUN_TEST(test_every_answer_of_a_random_fisheye_leads_back_to_its_pixel);
    RUN_TEST(test_every_ideal_pixel_well_inside_the_domain_is_found_again);
    RUN_TEST(test_grids_of_random_lenses_invent_no_position);
    return UNITY_END();
}
