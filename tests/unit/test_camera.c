/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/camera.h"

#include <float.h>
#include <string.h>

#include "../support/camera_model.h"
#include "unity.h"

#define PI         3.14159265358979323846
#define ONE_Q32    (INT64_C(1) << 32)
#define BOUND_PX   1e-4 /* of every mapping against the double model, as evs/camera.h states */
#define DISTORT_PX (1.0 / 32768.0)
#define CANARY_Q16 0x5A5A5A5A

static evs_camera_px_t out;

void setUp(void) { out = (evs_camera_px_t){CANARY_Q16, CANARY_Q16}; }
void tearDown(void) {}

static void assert_out_untouched(void)
{
    TEST_ASSERT_EQUAL_HEX32(CANARY_Q16, out.x_q16);
    TEST_ASSERT_EQUAL_HEX32(CANARY_Q16, out.y_q16);
}

static evs_camera_config_t plain(void) { return evs_camera_config_ideal(240, 180, 200 * 65536); }

static evs_camera_t camera_with(evs_camera_model_t model, double d0, double d1, double d2, double d3, double d4)
{
    const calibration_t c = {"", model, 240, 180, {200.0, 200.0, 119.5, 89.5}, {d0, d1, d2, d3, d4}};
    const evs_camera_t cam = camera_of(&c);
    TEST_ASSERT_TRUE(cam.domain_q32 > 0);
    return cam;
}

/* ---- Set-up ---- */

static void test_init_refuses_each_field_out_of_range_and_leaves_the_context_alone(void)
{
    static const struct {
        int field;
        int64_t value;
        evs_status_t want;
    } CASES[] = {
        {0, 2, EVS_ERR_ARG},
        {1, 0, EVS_ERR_ARG},
        {1, EVS_SENSOR_MAX_PX, EVS_OK},
        {1, EVS_SENSOR_MAX_PX + 1, EVS_ERR_ARG},
        {2, 0, EVS_ERR_ARG},
        {2, EVS_SENSOR_MAX_PX + 1, EVS_ERR_ARG},
        {3, 0, EVS_ERR_ARG},
        {3, -200 * 65536, EVS_ERR_ARG},
        {3, EVS_CAMERA_FOCAL_MIN_Q16 - 1, EVS_ERR_ARG},
        {3, EVS_CAMERA_FOCAL_MIN_Q16, EVS_OK},
        {3, EVS_CAMERA_FOCAL_MAX_Q16, EVS_OK},
        {3, EVS_CAMERA_FOCAL_MAX_Q16 + 1, EVS_ERR_ARG},
        {4, 0, EVS_ERR_ARG},
        {4, EVS_CAMERA_FOCAL_MAX_Q16 + 1, EVS_ERR_ARG},
        {5, EVS_CAMERA_CENTRE_MAX_Q16, EVS_OK},
        {5, EVS_CAMERA_CENTRE_MAX_Q16 + 1, EVS_ERR_ARG},
        {6, -EVS_CAMERA_CENTRE_MAX_Q16 - 1, EVS_ERR_ARG},
        {7, EVS_CAMERA_DIST_MAX_Q32 + 1, EVS_ERR_ARG},
        {11, -EVS_CAMERA_DIST_MAX_Q32 - 1, EVS_ERR_ARG},
        {11, EVS_CAMERA_DIST_MAX_Q32, EVS_OK},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        evs_camera_config_t cfg = plain();
        const int64_t v = CASES[i].value;
        switch (CASES[i].field) {
        case 0:
            cfg.model = (evs_camera_model_t)v;
            break;
        case 1:
            cfg.width_px = (uint16_t)v;
            break;
        case 2:
            cfg.height_px = (uint16_t)v;
            break;
        case 3:
            cfg.fx_q16 = (int32_t)v;
            break;
        case 4:
            cfg.fy_q16 = (int32_t)v;
            break;
        case 5:
            cfg.cx_q16 = (int32_t)v;
            break;
        case 6:
            cfg.cy_q16 = (int32_t)v;
            break;
        default:
            cfg.dist_q32[CASES[i].field - 7] = v;
            break;
        }
        evs_camera_t cam = {.domain_q32 = 7};
        TEST_ASSERT_EQUAL_INT(CASES[i].want, evs_camera_init(&cam, &cfg));
        if (CASES[i].want != EVS_OK) { TEST_ASSERT_EQUAL_INT64(7, cam.domain_q32); }
    }
}

static void test_init_refuses_a_fifth_coefficient_of_a_fisheye(void)
{
    evs_camera_config_t cfg = plain();
    cfg.model = EVS_CAMERA_FISHEYE;
    cfg.dist_q32[4] = 1;
    evs_camera_t cam = {.domain_q32 = 7};
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_camera_init(&cam, &cfg));
    TEST_ASSERT_EQUAL_INT64(7, cam.domain_q32);
}

static void test_init_refuses_a_model_that_folds_over_at_the_axis(void)
{
    evs_camera_config_t cfg = plain();
    cfg.dist_q32[2] = EVS_CAMERA_DIST_MAX_Q32;
    evs_camera_t cam = {.domain_q32 = 7};
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_init(&cam, &cfg));
    TEST_ASSERT_EQUAL_INT64(7, cam.domain_q32);
}

static void test_null_pointers_are_refused(void)
{
    const evs_camera_config_t cfg = plain();
    const int32_t ray[3] = {0, 0, 1};
    int32_t ray_q30[3];
    evs_camera_t cam;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_camera_init(NULL, &cfg));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_camera_init(&cam, NULL));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_init(&cam, &cfg));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_camera_distort(NULL, out, &out));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_camera_distort(&cam, out, NULL));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_camera_undistort(NULL, out, &out));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_camera_undistort(&cam, out, NULL));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_camera_ray(NULL, out, ray_q30));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_camera_ray(&cam, out, NULL));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_camera_project(NULL, ray, &out));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_camera_project(&cam, NULL, &out));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_camera_project(&cam, ray, NULL));
}

static void test_numbers_that_no_calibration_holds_are_refused_at_the_conversion(void)
{
    const double k_px[4] = {200.0, 200.0, 119.5, 89.5};
    const double dist[5] = {0.1, 0.0, 0.0, 0.0, 0.0};
    evs_camera_config_t cfg = {.width_px = 7};
    static const double BAD[] = {1e9, -1e9, DBL_MAX, (double)INFINITY, (double)NAN};
    for (size_t i = 0; i < sizeof BAD / sizeof BAD[0]; i++) {
        for (int at = 0; at < 9; at++) {
            double k[4];
            double d[5];
            memcpy(k, k_px, sizeof k);
            memcpy(d, dist, sizeof d);
            if (at < 4) {
                k[at] = BAD[i];
            } else {
                d[at - 4] = BAD[i];
            }
            TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_camera_config_from_double(&cfg, EVS_CAMERA_PINHOLE, 240, 180, k, d));
            TEST_ASSERT_EQUAL_UINT16(7, cfg.width_px);
        }
    }
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_config_from_double(&cfg, EVS_CAMERA_PINHOLE, 240, 180, k_px, dist));
    TEST_ASSERT_EQUAL_INT32(119 * 65536 + 32768, cfg.cx_q16);
    TEST_ASSERT_EQUAL_INT64(429496730, cfg.dist_q32[0]);
}

/* ---- A lens without distortion ---- */

static void test_lens_without_distortion_gives_each_pixel_back_exactly(void)
{
    evs_camera_config_t cfg = plain();
    cfg.fx_q16 = 13000001; /* an odd focal length: its reciprocal is no round number */
    evs_camera_t cam;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_init(&cam, &cfg));
    for (int32_t y = -2000; y <= 2000; y += 173) {
        for (int32_t x = -2000; x <= 2000; x += 173) {
            const evs_camera_px_t px = {x * 65536 + y, y * 65536 - x};
            TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_undistort(&cam, px, &out));
            TEST_ASSERT_EQUAL_INT32(px.x_q16, out.x_q16);
            TEST_ASSERT_EQUAL_INT32(px.y_q16, out.y_q16);
            TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_distort(&cam, px, &out));
            TEST_ASSERT_EQUAL_INT32(px.x_q16, out.x_q16);
            TEST_ASSERT_EQUAL_INT32(px.y_q16, out.y_q16);
        }
    }
}

static void test_pinhole_domain_ends_at_64_or_at_the_farthest_pixel_that_can_be_asked_for(void)
{
    evs_camera_config_t cfg = evs_camera_config_ideal(240, 180, EVS_CAMERA_FOCAL_MIN_Q16);
    evs_camera_t cam;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_init(&cam, &cfg));
    TEST_ASSERT_EQUAL_INT64(64 * ONE_Q32, evs_camera_domain_q32(&cam));
    cfg = plain();
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_init(&cam, &cfg));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6,
                              sqrt((2048.0 + 119.5) * (2048.0 + 119.5) + (2048.0 + 89.5) * (2048.0 + 89.5)) / 200.0,
                              (double)evs_camera_domain_q32(&cam) / 4294967296.0);
}

static void test_ideal_camera_looks_along_the_middle_of_its_sensor(void)
{
    const evs_camera_config_t cfg = plain();
    TEST_ASSERT_EQUAL_INT32(119 * 65536 + 32768, cfg.cx_q16);
    TEST_ASSERT_EQUAL_INT32(89 * 65536 + 32768, cfg.cy_q16);
    evs_camera_t cam;
    int32_t ray_q30[3];
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_init(&cam, &cfg));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_ray(&cam, (evs_camera_px_t){cfg.cx_q16, cfg.cy_q16}, ray_q30));
    TEST_ASSERT_EQUAL_INT32(0, ray_q30[0]);
    TEST_ASSERT_EQUAL_INT32(0, ray_q30[1]);
    TEST_ASSERT_EQUAL_INT32(1 << 30, ray_q30[2]);
}

/* ---- Against the double model ---- */

static void test_undistort_is_within_its_bound_of_the_double_model_for_the_cameras_of_the_paper(void)
{
    for (int k = 0; k < N_PAPER_CAMERAS; k++) {
        const calibration_t *const c = &PAPER_CAMERAS[k];
        const evs_camera_t cam = camera_of(c);
        for (int y = -8; y < c->height_px + 8; y += 11) { /* a margin: grids look there */
            for (int x = -8; x < c->width_px + 8; x += 11) {
                double want[2];
                model_undistort(c, x, y, want);
                TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_undistort(&cam, px_of(x, y), &out));
                TEST_ASSERT_DOUBLE_WITHIN(BOUND_PX, want[0], px_x(out));
                TEST_ASSERT_DOUBLE_WITHIN(BOUND_PX, want[1], px_y(out));
            }
        }
    }
}

static void test_rounded_point_agrees_with_the_double_model_except_within_the_bound_of_a_tie(void)
{
    for (int k = 0; k < N_PAPER_CAMERAS; k++) {
        const calibration_t *const c = &PAPER_CAMERAS[k];
        const evs_camera_t cam = camera_of(c);
        for (int y = 0; y < c->height_px; y += 9) {
            for (int x = 0; x < c->width_px; x += 9) {
                double want[2];
                model_undistort(c, x, y, want);
                const evs_point_t p = evs_camera_undistort_point(&cam, px_of(x, y));
                TEST_ASSERT_DOUBLE_WITHIN(0.5 + 16.0 * BOUND_PX, 16.0 * want[0], p.x_q4);
                TEST_ASSERT_DOUBLE_WITHIN(0.5 + 16.0 * BOUND_PX, 16.0 * want[1], p.y_q4);
            }
        }
    }
}

static void test_distort_is_within_its_bound_of_the_double_model(void)
{
    for (int k = 0; k < N_PAPER_CAMERAS; k++) {
        const calibration_t *const c = &PAPER_CAMERAS[k];
        const evs_camera_t cam = camera_of(c);
        for (int y = -100; y < c->height_px + 100; y += 17) {
            for (int x = -100; x < c->width_px + 100; x += 17) {
                double want[2];
                model_distort(c, x, y, want);
                TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_distort(&cam, px_of(x, y), &out));
                TEST_ASSERT_DOUBLE_WITHIN(DISTORT_PX, want[0], px_x(out));
                TEST_ASSERT_DOUBLE_WITHIN(DISTORT_PX, want[1], px_y(out));
            }
        }
    }
}

static void test_ray_is_a_unit_vector_along_the_undistorted_pixel_and_projects_back(void)
{
    for (int k = 0; k < N_PAPER_CAMERAS; k++) {
        const calibration_t *const c = &PAPER_CAMERAS[k];
        const evs_camera_t cam = camera_of(c);
        for (int y = 0; y < c->height_px; y += 19) {
            for (int x = 0; x < c->width_px; x += 19) {
                double u[2];
                int32_t ray_q30[3];
                model_undistort(c, x, y, u);
                const double vx = (u[0] - c->k_px[2]) / c->k_px[0];
                const double vy = (u[1] - c->k_px[3]) / c->k_px[1];
                const double scale = 1073741824.0 / sqrt(vx * vx + vy * vy + 1.0);
                TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_ray(&cam, px_of(x, y), ray_q30));
                /* 4 LSB of our own; rounding the calibration to 2^-17 px turns the ray by up to another 2^-24. */
                TEST_ASSERT_DOUBLE_WITHIN(4.0 + 80.0, vx * scale, ray_q30[0]);
                TEST_ASSERT_DOUBLE_WITHIN(4.0 + 80.0, vy * scale, ray_q30[1]);
                TEST_ASSERT_DOUBLE_WITHIN(4.0 + 80.0, scale, ray_q30[2]);
                const double norm2 = ((double)ray_q30[0] * ray_q30[0] + (double)ray_q30[1] * ray_q30[1] +
                                      (double)ray_q30[2] * ray_q30[2]);
                TEST_ASSERT_DOUBLE_WITHIN(4.0, 1073741824.0, sqrt(norm2));
                TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_project(&cam, ray_q30, &out));
                TEST_ASSERT_DOUBLE_WITHIN(DISTORT_PX, x, px_x(out));
                TEST_ASSERT_DOUBLE_WITHIN(DISTORT_PX, y, px_y(out));
            }
        }
    }
}

static void test_projection_depends_on_the_direction_only(void)
{
    for (int k = 0; k < N_PAPER_CAMERAS; k++) {
        const evs_camera_t cam = camera_of(&PAPER_CAMERAS[k]);
        const int32_t short_ray[3] = {-2, 3, 7};
        const int32_t long_ray[3] = {-2 * 300000000, 3 * 300000000, 7 * 300000000};
        evs_camera_px_t other;
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_project(&cam, short_ray, &out));
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_project(&cam, long_ray, &other));
        TEST_ASSERT_INT32_WITHIN(1, other.x_q16, out.x_q16);
        TEST_ASSERT_INT32_WITHIN(1, other.y_q16, out.y_q16);
    }
}

/* ---- Where there is no answer ---- */

static void test_barrel_that_folds_over_is_used_up_to_the_fold_and_no_further(void)
{
    /* r (1 - 0.4 r^2) rises up to r^2 = 1 / 1.2, where it is 2/3 r. */
    const evs_camera_t cam = camera_with(EVS_CAMERA_PINHOLE, -0.4, 0.0, 0.0, 0.0, 0.0);
    const double fold = sqrt(1.0 / 1.2);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, fold, (double)evs_camera_domain_q32(&cam) / 4294967296.0);

    const double edge_px = 119.5 + 200.0 * fold * 2.0 / 3.0;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_undistort(&cam, px_of(edge_px + 0.01, 89.5), &out));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_undistort(&cam, px_of(0.0, 0.0), &out)); /* the corner */
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_distort(&cam, px_of(119.5 + 200.0 * 0.95, 89.5), &out));
    assert_out_untouched();
    TEST_ASSERT_TRUE(evs_point_is_outside(evs_camera_undistort_point(&cam, px_of(0.0, 0.0))));
    int32_t ray_q30[3] = {CANARY_Q16, 0, 0};
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_ray(&cam, px_of(0.0, 0.0), ray_q30));
    TEST_ASSERT_EQUAL_HEX32(CANARY_Q16, ray_q30[0]);

    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_undistort(&cam, px_of(edge_px - 0.01, 89.5), &out));
    TEST_ASSERT_DOUBLE_WITHIN(3.0, 119.5 + 200.0 * fold, px_x(out)); /* the steep side: dr = sqrt(2 d / |g''|) */
    TEST_ASSERT_TRUE(px_x(out) < 119.5 + 200.0 * fold);
}

static void test_no_pixel_is_given_an_answer_that_does_not_lead_back_to_it(void)
{
    static const double LENSES[][5] = {
        {-0.4, 0.0, 0.0, 0.0, 0.0},     {-0.6, 0.1, 0.01, -0.02, 0.0}, {-0.3, -0.3, 0.05, 0.05, 0.0},
        {0.5, -1.5, 0.001, 0.002, 0.1}, {-1.0, 0.5, 0.0, 0.03, -0.1},  {0.3, 0.2, -0.03, 0.01, 0.0},
    };
    for (size_t i = 0; i < sizeof LENSES / sizeof LENSES[0]; i++) {
        const double *const d = LENSES[i];
        const evs_camera_t cam = camera_with(EVS_CAMERA_PINHOLE, d[0], d[1], d[2], d[3], d[4]);
        const double domain = (double)evs_camera_domain_q32(&cam) / 4294967296.0;
        int n_answers = 0;
        int n_refused = 0;
        for (int y = -150; y < 330; y += 15) {
            for (int x = -150; x < 390; x += 15) {
                out = (evs_camera_px_t){CANARY_Q16, CANARY_Q16};
                if (evs_camera_undistort(&cam, px_of(x, y), &out) != EVS_OK) {
                    assert_out_untouched();
                    n_refused++;
                    continue;
                }
                n_answers++;
                const double vx = (px_x(out) - 119.5) / 200.0;
                const double vy = (px_y(out) - 89.5) / 200.0;
                TEST_ASSERT_TRUE(sqrt(vx * vx + vy * vy) <= domain + 1e-6);
                evs_camera_px_t back;
                if (evs_camera_distort(&cam, out, &back) != EVS_OK) { continue; } /* rounded across the edge */
                TEST_ASSERT_DOUBLE_WITHIN(1e-3, x, px_x(back));
                TEST_ASSERT_DOUBLE_WITHIN(1e-3, y, px_y(back));
            }
        }
        TEST_ASSERT_TRUE(n_answers > 100);
        TEST_ASSERT_TRUE((n_refused > 0) || (i == 5u)); /* the last one is a pincushion: all answers exist */
    }
}

static void test_every_ray_inside_the_domain_is_found_again(void)
{
    static const double LENSES[][5] = {
        {-0.4, 0.0, 0.0, 0.0, 0.0}, {-0.6, 0.1, 0.01, -0.02, 0.0}, {0.5, -1.5, 0.001, 0.002, 0.1}};
    for (size_t i = 0; i < sizeof LENSES / sizeof LENSES[0]; i++) {
        const double *const d = LENSES[i];
        const evs_camera_t cam = camera_with(EVS_CAMERA_PINHOLE, d[0], d[1], d[2], d[3], d[4]);
        const double domain = (double)evs_camera_domain_q32(&cam) / 4294967296.0;
        for (int a = 0; a < 12; a++) {
            for (int k = 0; k <= 19; k++) { /* up to 95 % of the domain */
                const double r = domain * 0.05 * k;
                const evs_camera_px_t ideal =
                    px_of(119.5 + 200.0 * r * cos(a * PI / 6), 89.5 + 200.0 * r * sin(a * PI / 6));
                evs_camera_px_t there;
                TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_distort(&cam, ideal, &there));
                TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_undistort(&cam, there, &out));
                TEST_ASSERT_DOUBLE_WITHIN(1e-3, px_x(ideal), px_x(out));
                TEST_ASSERT_DOUBLE_WITHIN(1e-3, px_y(ideal), px_y(out));
            }
        }
    }
}

static void test_iteration_does_not_cycle_on_a_lens_that_bends_both_ways(void)
{
    /* Found by the property test: plain Newton jumps to and fro between two sides of an inflection. */
    const evs_camera_t fisheye = camera_with(EVS_CAMERA_FISHEYE, -0.00019, 0.00551, 0.09793, -0.04152, 0.0);
    const evs_camera_t pinhole = camera_with(EVS_CAMERA_PINHOLE, 0.13359, 0.41831, -0.00028, 0.00351, -0.16802);
    const evs_camera_t steep = camera_with(EVS_CAMERA_PINHOLE, 0.35835, 0.44667, -0.00435, -0.00209, -0.02171);
    const evs_camera_t *const lenses[] = {&fisheye, &pinhole, &steep};
    for (int k = 0; k < 3; k++) {
        const double domain = fmin((double)evs_camera_domain_q32(lenses[k]) / 4294967296.0, (k == 0) ? 1.4 : 3.5);
        for (int i = 1; i <= 950; i++) {
            const double t = domain * i / 1000.0;
            const double r = (k == 0) ? tan(t) : t;
            const evs_camera_px_t ideal = px_of(119.5 + 120.0 * r, 89.5 - 160.0 * r);
            evs_camera_px_t there;
            TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_distort(lenses[k], ideal, &there));
            TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_undistort(lenses[k], there, &out));
            TEST_ASSERT_DOUBLE_WITHIN(0.01, px_x(ideal), px_x(out));
            TEST_ASSERT_DOUBLE_WITHIN(0.01, px_y(ideal), px_y(out));
        }
    }
}

static void test_answer_beyond_2047_px_is_outside_though_its_ray_exists(void)
{
    const evs_camera_t cam = camera_with(EVS_CAMERA_FISHEYE, 0.0, 0.0, 0.0, 0.0, 0.0);
    const double angle = atan(2050.0 / 200.0);
    const evs_camera_px_t px = px_of(119.5 + 200.0 * angle, 89.5);
    int32_t ray_q30[3];
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_undistort(&cam, px, &out));
    assert_out_untouched();
    TEST_ASSERT_TRUE(evs_point_is_outside(evs_camera_undistort_point(&cam, px)));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_ray(&cam, px, ray_q30));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, sin(angle), ray_q30[0] / 1073741824.0);

    const evs_camera_t ideal = camera_with(EVS_CAMERA_PINHOLE, 0.0, 0.0, 0.0, 0.0, 0.0);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_undistort(&ideal, px_of(2047.0, -2047.0), &out));
    const evs_point_t p = evs_camera_undistort_point(&ideal, px_of(2047.0, -2047.0));
    TEST_ASSERT_EQUAL_INT16(EVS_POINT_MAX_Q4, p.x_q4);
    TEST_ASSERT_EQUAL_INT16(-EVS_POINT_MAX_Q4, p.y_q4);
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_undistort(&ideal, px_of(2047.001, 0.0), &out));
    TEST_ASSERT_TRUE(evs_point_is_outside(evs_camera_undistort_point(&ideal, px_of(0.0, -2047.001))));
}

static void test_fisheye_sees_past_90_degrees(void)
{
    const evs_camera_t cam = camera_with(EVS_CAMERA_FISHEYE, 0.01, -0.002, 0.0, 0.0, 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, PI, (double)evs_camera_domain_q32(&cam) / 4294967296.0);
    const double d[5] = {0.01, -0.002, 0.0, 0.0, 0.0};
    for (int degrees = 80; degrees <= 175; degrees += 5) {
        const double a = degrees * PI / 180.0;
        const evs_camera_px_t px =
            px_of(119.5 - 200.0 * fisheye_radius(d, a) * 0.6, 89.5 + 200.0 * fisheye_radius(d, a) * 0.8);
        int32_t ray_q30[3];
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_ray(&cam, px, ray_q30));
        /* The pixel is rounded to 2^-17 px, 4e-8 rad here, and at 175 degrees the lens has a slope of only 0.2. */
        TEST_ASSERT_DOUBLE_WITHIN(2e-7, -0.6 * sin(a), ray_q30[0] / 1073741824.0);
        TEST_ASSERT_DOUBLE_WITHIN(2e-7, 0.8 * sin(a), ray_q30[1] / 1073741824.0);
        TEST_ASSERT_DOUBLE_WITHIN(2e-7, cos(a), ray_q30[2] / 1073741824.0);
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_project(&cam, ray_q30, &out));
        TEST_ASSERT_DOUBLE_WITHIN(BOUND_PX, px_x(px), px_x(out));
        TEST_ASSERT_DOUBLE_WITHIN(BOUND_PX, px_y(px), px_y(out));
        if (degrees >= 90) {
            TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_undistort(&cam, px, &out));
            TEST_ASSERT_TRUE(evs_point_is_outside(evs_camera_undistort_point(&cam, px)));
        }
    }
}

static void test_fisheye_that_folds_over_is_used_up_to_the_fold_and_no_further(void)
{
    const evs_camera_t cam = camera_with(EVS_CAMERA_FISHEYE, -0.1, 0.0, 0.0, 0.0, 0.0);
    const double fold = sqrt(1.0 / 0.3); /* 104.6 degrees */
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, fold, (double)evs_camera_domain_q32(&cam) / 4294967296.0);
    int32_t ray_q30[3];
    const double edge_px = 119.5 + 200.0 * fold * 2.0 / 3.0;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_ray(&cam, px_of(edge_px - 0.01, 89.5), ray_q30));
    TEST_ASSERT_TRUE(ray_q30[2] < 0);
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_ray(&cam, px_of(edge_px + 0.01, 89.5), ray_q30));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_undistort(&cam, px_of(edge_px + 0.01, 89.5), &out));
    const int32_t behind[3] = {1, 0, -1}; /* 135 degrees */
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_project(&cam, behind, &out));
    assert_out_untouched();
}

static void test_directions_that_no_lens_shows_are_refused(void)
{
    static const int32_t ZERO[3] = {0, 0, 0};
    static const int32_t BEHIND[3] = {0, 0, -5};
    static const int32_t SIDEWAYS[3] = {5, 0, 0};
    static const int32_t EXTREME[3] = {INT32_MIN, INT32_MIN, 1};
    const evs_camera_t pinhole = camera_with(EVS_CAMERA_PINHOLE, -0.1, 0.0, 0.0, 0.0, 0.0);
    const evs_camera_t fisheye = camera_with(EVS_CAMERA_FISHEYE, 0.0, 0.0, 0.0, 0.0, 0.0);
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_project(&pinhole, ZERO, &out));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_project(&pinhole, BEHIND, &out));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_project(&pinhole, SIDEWAYS, &out));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_project(&pinhole, EXTREME, &out));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_project(&fisheye, ZERO, &out));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NUMERIC, evs_camera_project(&fisheye, BEHIND, &out));
    assert_out_untouched();
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_project(&fisheye, SIDEWAYS, &out));
    TEST_ASSERT_DOUBLE_WITHIN(DISTORT_PX, 119.5 + 100.0 * PI, px_x(out));
}

static void test_no_calibration_and_no_pixel_upsets_the_arithmetic(void)
{
    /* Run under the undefined-behaviour sanitizer. Every value is legal, most are absurd. */
    uint64_t state = 1u;
    for (int i = 0; i < 300; i++) {
        int64_t r[16];
        for (int k = 0; k < 16; k++) {
            state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
            r[k] = (int64_t)(state >> 8) - (INT64_C(1) << 55);
        }
        evs_camera_config_t cfg = plain();
        const unsigned shrink = (unsigned)i % 40u; /* from the full range down to plausible lenses */
        cfg.model = ((i & 1) != 0) ? EVS_CAMERA_FISHEYE : EVS_CAMERA_PINHOLE;
        cfg.fx_q16 = EVS_CAMERA_FOCAL_MIN_Q16 + (int32_t)(((uint64_t)r[0] & 0x3FFFFFFFu) >> (i % 15)) / 2;
        cfg.fy_q16 = EVS_CAMERA_FOCAL_MIN_Q16 + (int32_t)(((uint64_t)r[1] & 0x3FFFFFFFu) >> (i % 15)) / 2;
        cfg.cx_q16 = (int32_t)(r[2] >> 26);
        cfg.cy_q16 = (int32_t)(r[3] >> 26);
        for (int k = 0; k < 5; k++) { cfg.dist_q32[k] = (r[4 + k] >> 9) >> shrink; }
        if (cfg.model == EVS_CAMERA_FISHEYE) { cfg.dist_q32[4] = 0; }
        evs_camera_t cam;
        const evs_status_t status = evs_camera_init(&cam, &cfg);
        TEST_ASSERT_TRUE((status == EVS_OK) || (status == EVS_ERR_NUMERIC));
        if (status != EVS_OK) { continue; }
        TEST_ASSERT_TRUE((evs_camera_domain_q32(&cam) > 0) && (evs_camera_domain_q32(&cam) <= 64 * ONE_Q32));
        for (int k = 9; k < 14; k++) {
            const int down = (k - 9) * 5;
            const evs_camera_px_t px = {(int32_t)((r[k] >> 24) >> down), (int32_t)((r[k + 1] >> 24) >> down)};
            const int32_t ray[3] = {(int32_t)(r[k] >> 24), (int32_t)(r[k + 1] >> 24), (int32_t)(r[k + 2] >> 24)};
            int32_t ray_q30[3];
            evs_camera_px_t u;
            (void)!evs_camera_project(&cam, ray, &u);
            (void)!evs_camera_distort(&cam, px, &u);
            if (evs_camera_ray(&cam, px, ray_q30) == EVS_OK) {
                const double norm2 = ((double)ray_q30[0] * ray_q30[0] + (double)ray_q30[1] * ray_q30[1] +
                                      (double)ray_q30[2] * ray_q30[2]);
                TEST_ASSERT_DOUBLE_WITHIN(8.0, 1073741824.0, sqrt(norm2));
            }
            const evs_point_t p = evs_camera_undistort_point(&cam, px);
            TEST_ASSERT_EQUAL(evs_point_is_outside(p), evs_camera_undistort(&cam, px, &u) != EVS_OK);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_refuses_each_field_out_of_range_and_leaves_the_context_alone);
    RUN_TEST(test_init_refuses_a_fifth_coefficient_of_a_fisheye);
    RUN_TEST(test_init_refuses_a_model_that_folds_over_at_the_axis);
    RUN_TEST(test_null_pointers_are_refused);
    RUN_TEST(test_numbers_that_no_calibration_holds_are_refused_at_the_conversion);
    RUN_TEST(test_lens_without_distortion_gives_each_pixel_back_exactly);
    RUN_TEST(test_pinhole_domain_ends_at_64_or_at_the_farthest_pixel_that_can_be_asked_for);
    RUN_TEST(test_ideal_camera_looks_along_the_middle_of_its_sensor);
    RUN_TEST(test_undistort_is_within_its_bound_of_the_double_model_for_the_cameras_of_the_paper);
    RUN_TEST(test_rounded_point_agrees_with_the_double_model_except_within_the_bound_of_a_tie);
    RUN_TEST(test_distort_is_within_its_bound_of_the_double_model);
    RUN_TEST(test_ray_is_a_unit_vector_along_the_undistorted_pixel_and_projects_back);
    RUN_TEST(test_projection_depends_on_the_direction_only);
    RUN_TEST(test_barrel_that_folds_over_is_used_up_to_the_fold_and_no_further);
    RUN_TEST(test_no_pixel_is_given_an_answer_that_does_not_lead_back_to_it);
    RUN_TEST(test_every_ray_inside_the_domain_is_found_again);
    RUN_TEST(test_iteration_does_not_cycle_on_a_lens_that_bends_both_ways);
    RUN_TEST(test_answer_beyond_2047_px_is_outside_though_its_ray_exists);
    RUN_TEST(test_fisheye_sees_past_90_degrees);
    RUN_TEST(test_fisheye_that_folds_over_is_used_up_to_the_fold_and_no_further);
    RUN_TEST(test_directions_that_no_lens_shows_are_refused);
    RUN_TEST(test_no_calibration_and_no_pixel_upsets_the_arithmetic);
    return UNITY_END();
}
