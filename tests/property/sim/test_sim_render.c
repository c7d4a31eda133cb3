/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The renderer against ray casting in double precision, written from the definition of the planes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "render.h"
#include "schedule.h"
#include "unity.h"

static evsim_settings_t settings;
static evsim_camera_t camera;
static evsim_scene_t *scene;
static evsim_motion_t motion;
static evsim_view_t view;
static evsim_pool_t *pool;
static evh_error_t err;

void setUp(void)
{
    err.text[0] = '\0';
    pool = evsim_pool_start(1u);
    scene = malloc(sizeof *scene);
    TEST_ASSERT_NOT_NULL(scene);
    memset(&camera, 0, sizeof camera);
}

void tearDown(void)
{
    evsim_camera_free(&camera);
    evsim_scene_free(scene);
    free(scene);
    evsim_pool_stop(pool);
}

static void build(evsim_scene_kind_t kind, uint64_t seed)
{
    evsim_settings_default(&settings, kind);
    settings.motion = EVSIM_MOTION_SWEEP;
    settings.seed = seed;
    evsim_default_calib(&settings.calib, 64u, 48u);
    TEST_ASSERT_TRUE_MESSAGE(evsim_camera_init(&camera, &settings.calib, &err), err.text);
    TEST_ASSERT_TRUE_MESSAGE(evsim_scene_init(scene, &settings, pool, &err), err.text);
    evsim_motion_init(&motion, &settings);
}

/* Depth along the camera's axis of what the ray meets first, and the intensity there without any filter. */
static double cast(const evsim_state_t *state, double x, double y, double *margin_m)
{
    const evsim_vec_t d = evsim_rotate(&state->r_wc, evsim_vec(x, y, 1.0));
    double nearest = HUGE_VAL;
    *margin_m = HUGE_VAL; /* How near the ray passes an edge: there the two may differ. */
    for (unsigned i = 0u; i < scene->n_surfaces; i++) {
        const evsim_surface_t *const s = &scene->surface[i];
        const evsim_vec_t n = evsim_cross(s->u, s->v);
        const double t = evsim_dot(n, evsim_sub(s->centre_m, state->p_w_m)) / evsim_dot(n, d);
        const evsim_vec_t hit = evsim_sub(evsim_add(state->p_w_m, evsim_scale(t, d)), s->centre_m);
        if (!(t > 0.0)) { continue; }
        if (s->bounded) {
            const double inside =
                fmin(s->half_u_m - fabs(evsim_dot(hit, s->u)), s->half_v_m - fabs(evsim_dot(hit, s->v)));
            *margin_m = fmin(*margin_m, fabs(inside));
            if (inside < 0.0) { continue; }
        }
        nearest = fmin(nearest, t);
    }
    return nearest;
}

static void test_depth_is_that_of_the_nearest_plane(void)
{
    unsigned n_checked = 0u;
    build(EVSIM_SCENE_ROOM, 3u);
    for (int k = 0; k < 20; k++) {
        evsim_state_t state;
        evsim_motion_at(&motion, 0.11 * k, &state);
        evsim_view_init(&view, scene, &state);
        for (double x = -0.6; x <= 0.6; x += 0.05) {
            for (double y = -0.45; y <= 0.45; y += 0.05) {
                double margin_m;
                const double want = cast(&state, x, y, &margin_m);
                if (margin_m < 1e-4) { continue; }
                TEST_ASSERT_DOUBLE_WITHIN(1e-5, 1.0 / want, evsim_view_inverse_depth(&view, x, y));
                n_checked++;
            }
        }
    }
    TEST_ASSERT_TRUE(n_checked > 8000u);
}

/* A poster whose texture is a slope along u: its intensity tells where the ray met it. */
static void test_a_pixel_shows_the_point_of_the_texture_that_its_ray_meets(void)
{
    float row[EVSIM_TILE_H * 64u];
    unsigned n_checked = 0u;
    build(EVSIM_SCENE_POSTER, 1u);
    {
        evsim_texture_t *const t = &scene->texture[0];
        const unsigned side = 1u << t->log2_size;
        for (unsigned v = 0u; v < side; v++) {
            for (unsigned u = 0u; u < side; u++) { t->level[0][v * side + u] = ((float)u + 0.5f) / (float)side; }
        }
        evsim_texture_finish(t);
    }
    for (int k = 0; k < 10; k++) {
        evsim_state_t state;
        evsim_motion_at(&motion, 0.21 * k, &state);
        evsim_view_init(&view, scene, &state);
        for (unsigned band = 0u; band < camera.n_bands; band++) {
            evsim_render_band(&view, &camera, band, row);
            for (unsigned i = 0u; i < EVSIM_TILE_H * 64u; i++) {
                const size_t pixel = (size_t)band * EVSIM_TILE_H * 64u + i;
                const evsim_surface_t *const s = &scene->surface[0];
                const evsim_vec_t d =
                    evsim_rotate(&state.r_wc, evsim_vec((double)camera.ray_x[pixel], (double)camera.ray_y[pixel], 1.0));
                const double t = (s->centre_m.v[0] - state.p_w_m.v[0]) / d.v[0];
                const double u = -(state.p_w_m.v[1] + t * d.v[1]) / 2.6 + 0.5; /* To the right is -y; 2.6 m a tile. */
                if ((u < 0.1) || (u > 0.9)) { continue; }                      /* The slope starts anew at 1. */
                TEST_ASSERT_FLOAT_WITHIN(0.003f, (float)u, row[i]);
                n_checked++;
            }
        }
    }
    TEST_ASSERT_TRUE(n_checked > 10000u);
}

/* Where the point that a ray meets is a moment later: how far its image has moved, in pixels. */
static double moved_px(const evsim_state_t *from, const evsim_state_t *to, double x, double y)
{
    double margin_m;
    const double z = cast(from, x, y, &margin_m);
    const evsim_vec_t p = evsim_add(from->p_w_m, evsim_rotate(&from->r_wc, evsim_vec(x * z, y * z, z)));
    const evsim_vec_t q = evsim_rotate_back(&to->r_wc, evsim_sub(p, to->p_w_m));
    double a[2];
    double b[2];
    evsim_distort(&settings.calib, x, y, a, NULL);
    evsim_distort(&settings.calib, q.v[0] / q.v[2], q.v[1] / q.v[2], b, NULL);
    return settings.calib.fx_px * hypot(a[0] - b[0], a[1] - b[1]);
}

static double fastest_px_s(double t_s)
{
    const double h_s = 1e-5;
    evsim_state_t from;
    evsim_state_t to;
    double fastest = 0.0;
    evsim_motion_at(&motion, t_s, &from);
    evsim_motion_at(&motion, t_s + h_s, &to);
    for (unsigned i = 0u; i < camera.n_probes; i++) {
        fastest = fmax(fastest, moved_px(&from, &to, camera.probe[i].x, camera.probe[i].y) / h_s);
    }
    return fastest;
}

static void test_image_speed_is_that_of_the_points_seen(void)
{
    evsim_schedule_t schedule;
    evsim_batch_t *const batch = malloc(sizeof *batch);
    TEST_ASSERT_NOT_NULL(batch);
    build(EVSIM_SCENE_ROOM, 2u);
    settings.duration_us = 1000000;
    settings.fps_hz = 500.0; /* A batch ends with a frame: many looks. */
    settings.exposure_us = 1000;
    evsim_schedule_init(&schedule, &settings, &motion, scene, &camera);
    TEST_ASSERT_TRUE_MESSAGE(evsim_schedule_start(&schedule, &view, &err), err.text);
    do {
        const double want = fastest_px_s((double)schedule.t_ns * 1e-9);
        TEST_ASSERT_DOUBLE_WITHIN(0.002 * want, want, schedule.speed_px_s);
        TEST_ASSERT_TRUE_MESSAGE(evsim_schedule_next(&schedule, batch, &err), err.text);
    } while (batch->n > 0u);
    free(batch);
}

static void test_renders_are_no_further_apart_than_half_a_pixel(void)
{
    evsim_schedule_t schedule;
    evsim_batch_t *const batch = malloc(sizeof *batch);
    int64_t last_ns = 0;
    double worst = 0.0;
    TEST_ASSERT_NOT_NULL(batch);
    build(EVSIM_SCENE_ROOM, 2u);
    settings.duration_us = 500000;
    evsim_schedule_init(&schedule, &settings, &motion, scene, &camera);
    TEST_ASSERT_TRUE_MESSAGE(evsim_schedule_start(&schedule, &view, &err), err.text);
    for (;;) {
        TEST_ASSERT_TRUE_MESSAGE(evsim_schedule_next(&schedule, batch, &err), err.text);
        if (batch->n == 0u) { break; }
        for (unsigned k = 0u; k < batch->n; k++) {
            evsim_state_t from;
            evsim_state_t to;
            TEST_ASSERT_EQUAL_INT64(last_ns, batch->render[k].t0_ns);
            TEST_ASSERT_TRUE(batch->render[k].t1_ns > last_ns);
            last_ns = batch->render[k].t1_ns;
            evsim_motion_at(&motion, (double)batch->render[k].t0_ns * 1e-9, &from);
            evsim_motion_at(&motion, (double)last_ns * 1e-9, &to);
            for (unsigned i = 0u; i < camera.n_probes; i += 7u) {
                worst = fmax(worst, moved_px(&from, &to, camera.probe[i].x, camera.probe[i].y));
            }
        }
    }
    free(batch);
    TEST_ASSERT_EQUAL_INT64(500000000, last_ns);
    TEST_ASSERT_TRUE((worst > 0.4) && (worst < 0.58)); /* A step may be an eighth too long. */
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_depth_is_that_of_the_nearest_plane);
    RUN_TEST(test_a_pixel_shows_the_point_of_the_texture_that_its_ray_meets);
    RUN_TEST(test_image_speed_is_that_of_the_points_seen);
    RUN_TEST(test_renders_are_no_further_apart_than_half_a_pixel);
    return UNITY_END();
}
