/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "crc32.h"
#include "evs/fixed.h"
#include "evs/flow.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { W = 101, H = 79, LEVELS = 3, N_TRACKS = 40 };

static uint8_t first_px[W * H], second_px[W * H];
static uint8_t first_levels[EVS_PYRAMID_BYTES(W, H, EVS_FLOW_LEVELS_MAX)], second_levels[sizeof first_levels];
static evs_pyramid_t first, second;
static uint32_t memory[EVS_FLOW_BYTES(31, 1) / 4u + 2u];
static size_t n_memory; /* what the context was given */
static evs_flow_t flow;
static evs_flow_track_t tracks[N_TRACKS];
static uint32_t seed;

void setUp(void)
{
    seed = 815u;
    n_memory = sizeof memory;
}
void tearDown(void)
{
    for (size_t i = n_memory; i < sizeof memory; i++) {
        TEST_ASSERT_EQUAL_HEX8_MESSAGE(0xA5, ((const uint8_t *)memory)[i], "wrote past its memory");
    }
}

static uint32_t next_random(uint32_t below)
{
    seed = seed * 1664525u + 1013904223u;
    return (uint32_t)(((uint64_t)seed * below) >> 32);
}

/* --- scenes ------------------------------------------------------------------------------------------------------ */

/* A smooth texture without end, grey 128 +- 120: features some 12 px apart on broad ones. */
static double texture(double x, double y)
{
    return 128.0 +
           18.0 * (sin(0.31 * x + 0.12 * y) + sin(0.07 * x - 0.29 * y + 1.0) + cos(0.21 * x + 0.24 * y + 2.0) +
                   sin(0.45 * x - 0.33 * y) * cos(0.11 * x + 0.41 * y)) +
           24.0 * (sin(0.083 * x - 0.031 * y) + sin(0.029 * x + 0.077 * y));
}

static void render(uint8_t *px, double shift_x, double shift_y)
{
    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++) { px[y * W + x] = (uint8_t)lround(texture(x - shift_x, y - shift_y)); }
    }
}

/* Noise with features of some pixels, from integers only, so that it is the same on every target. */
static void render_noise(uint8_t *px, uint32_t scene)
{
    seed = scene;
    for (size_t i = 0u; i < W * H; i++) { px[i] = (uint8_t)(next_random(2u) * 255u); }
    for (size_t pass = 0u; pass < 5u; pass++) {
        for (size_t i = 0u; i + 1u < W * H; i++) { px[i] = (uint8_t)((px[i] + px[i + 1u] + 1) / 2); }
        for (size_t i = 0u; i + W < W * H; i++) { px[i] = (uint8_t)((px[i] + px[i + W] + 1) / 2); }
    }
    for (size_t i = 0u; i < W * H; i++) { px[i] = (uint8_t)evs_clamp(128 + 3 * (px[i] - 128), 0, 255); }
}

static void build(uint16_t n_levels)
{
    const evs_image_t a = {first_px, W, H}, b = {second_px, W, H};
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pyramid_build(&first, &a, n_levels, first_levels, sizeof first_levels));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pyramid_build(&second, &b, n_levels, second_levels, sizeof second_levels));
}

static void scene(double shift_x, double shift_y, uint16_t n_levels)
{
    render(first_px, 0.0, 0.0);
    render(second_px, shift_x, shift_y);
    build(n_levels);
}

/* --- tracks ------------------------------------------------------------------------------------------------------ */

/* Bind with exactly the memory that the macro asks for; tearDown() looks at what lies behind it. */
static void init(const evs_flow_config_t *cfg)
{
    n_memory = EVS_FLOW_BYTES(cfg->window_px, cfg->stride_px);
    TEST_ASSERT_TRUE(n_memory < sizeof memory);
    memset(memory, 0xA5, sizeof memory);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_flow_init(&flow, cfg, memory, n_memory));
}

static evs_flow_config_t config(uint16_t window_px, uint16_t stride_px, uint16_t n_iterations)
{
    evs_flow_config_t cfg = evs_flow_config_default();
    cfg.window_px = window_px;
    cfg.stride_px = stride_px;
    cfg.n_iterations = n_iterations;
    return cfg;
}

static evs_position_t position(double x, double y)
{
    const evs_position_t p = {(int32_t)lround(256.0 * x), (int32_t)lround(256.0 * y)};
    return p;
}

/* Points on a grid, `margin` px from the border, at all kinds of fractions. */
static size_t make_tracks(int margin)
{
    size_t n = 0u;
    for (int y = margin; (y < H - margin) && (n < N_TRACKS); y += 13) {
        for (int x = margin; (x < W - margin) && (n < N_TRACKS); x += 13) {
            const double dx = next_random(100u) / 100.0 - 0.5; /* One by one: their order must not be the compiler's. */
            const double dy = next_random(100u) / 100.0 - 0.5;
            tracks[n].from = position(x + dx, y + dy);
            tracks[n].to = tracks[n].from;
            n++;
        }
    }
    return n;
}

static double distance(evs_position_t p, double x, double y) { return hypot(p.x_q8 / 256.0 - x, p.y_q8 / 256.0 - y); }

static size_t count_near(size_t n, double shift_x, double shift_y, double bound_px)
{
    size_t n_near = 0u;
    for (size_t i = 0u; i < n; i++) {
        const double x = tracks[i].from.x_q8 / 256.0 + shift_x, y = tracks[i].from.y_q8 / 256.0 + shift_y;
        n_near += ((tracks[i].status == EVS_FLOW_OK) && (distance(tracks[i].to, x, y) < bound_px)) ? 1u : 0u;
    }
    return n_near;
}

static void track_one(double x, double y, double guess_x, double guess_y)
{
    tracks[0] = (evs_flow_track_t){.from = position(x, y), .to = position(guess_x, guess_y), .residual_q8 = 999u};
    evs_flow_track(&flow, &first, &second, tracks, 1u);
}

static void assert_tracked(evs_flow_track_t track, double shift_x, double shift_y, double bound_px)
{
    TEST_ASSERT_EQUAL_INT(EVS_FLOW_OK, track.status);
    const double x = track.from.x_q8 / 256.0 + shift_x, y = track.from.y_q8 / 256.0 + shift_y;
    TEST_ASSERT_DOUBLE_WITHIN(bound_px, 0.0, distance(track.to, x, y));
}

/* --- the method in double precision, iterated until it stands still ---------------------------------------------- */

static double model_pixel(const evs_image_t *image, int x, int y)
{
    return image->px[evs_clamp(y, 0, image->height_px - 1) * image->width_px + evs_clamp(x, 0, image->width_px - 1)];
}

static double model_grey(const evs_image_t *image, double x, double y)
{
    const int u = (int)floor(x), v = (int)floor(y);
    const double fx = x - u, fy = y - v;
    return (1 - fy) * ((1 - fx) * model_pixel(image, u, v) + fx * model_pixel(image, u + 1, v)) +
           fy * ((1 - fx) * model_pixel(image, u, v + 1) + fx * model_pixel(image, u + 1, v + 1));
}

/* Finest level only, from a start that is close. */
static void model_track(const evs_flow_config_t *cfg, evs_position_t from, double *to_x, double *to_y)
{
    const evs_image_t *const a = &first.level[0], *const b = &second.level[0];
    const int half = cfg->window_px / 2;
    const double x0 = from.x_q8 / 256.0, y0 = from.y_q8 / 256.0;
    for (int i = 0; i < 30; i++) {
        double xx = 0, xy = 0, yy = 0, bx = 0, by = 0;
        for (int v = -half; v <= half; v += cfg->stride_px) {
            for (int u = -half; u <= half; u += cfg->stride_px) {
                const double x = x0 + u, y = y0 + v;
                const double gx = 0.5 * (model_grey(a, x + 1, y) - model_grey(a, x - 1, y));
                const double gy = 0.5 * (model_grey(a, x, y + 1) - model_grey(a, x, y - 1));
                const double d = model_grey(b, *to_x + u, *to_y + v) - model_grey(a, x, y);
                xx += gx * gx;
                xy += gx * gy;
                yy += gy * gy;
                bx += gx * d;
                by += gy * d;
            }
        }
        const double det = xx * yy - xy * xy;
        const double step_x = (yy * bx - xy * by) / det, step_y = (xx * by - xy * bx) / det;
        *to_x -= step_x;
        *to_y -= step_y;
        if (hypot(step_x, step_y) < 1e-6) { return; }
    }
}

/* --- configuration, pyramid -------------------------------------------------------------------------------------- */

static void test_init_names_the_fault_and_leaves_the_context_alone(void)
{
    const evs_flow_config_t good = evs_flow_config_default();
    evs_flow_config_t bad[8];
    for (size_t i = 0u; i < 8u; i++) { bad[i] = good; }
    bad[0].window_px = EVS_FLOW_WINDOW_MIN_PX - 2u;
    bad[1].window_px = EVS_FLOW_WINDOW_MAX_PX + 2u;
    bad[2].window_px = 20u;
    bad[3].stride_px = 0u;
    bad[4].stride_px = 3u;
    bad[5].n_iterations = 0u;
    bad[6].epsilon_q8 = 257u;
    bad[7].min_eigen_q8 = 0u;
    flow = (evs_flow_t){.n_side = 77u};
    for (size_t i = 0u; i < 8u; i++) {
        TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_flow_init(&flow, &bad[i], memory, SIZE_MAX));
    }
    bad[5].n_iterations = EVS_FLOW_ITERATIONS_MAX + 1u;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_flow_init(&flow, &bad[5], memory, SIZE_MAX));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_flow_init(&flow, &good, (uint8_t *)memory + 1, SIZE_MAX));
    const size_t n_bytes = EVS_FLOW_BYTES(25, 2);
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_flow_init(&flow, &good, memory, n_bytes - 1u));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_flow_init(NULL, &good, memory, n_bytes));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_flow_init(&flow, NULL, memory, n_bytes));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_flow_init(&flow, &good, NULL, n_bytes));
    TEST_ASSERT_EQUAL_UINT16(77u, flow.n_side);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_flow_init(&flow, &good, memory, n_bytes));
    TEST_ASSERT_EQUAL_UINT16(13u, flow.n_side);
}

static void test_pyramid_is_the_image_halved_again_and_again(void)
{
    render_noise(first_px, 1u);
    const evs_image_t image = {first_px, W, H};
    static const size_t BYTES[] = {0u, 51u * 40u, 51u * 40u + 26u * 20u, 51u * 40u + 26u * 20u + 13u * 10u};
    for (uint16_t n_levels = 1u; n_levels <= EVS_FLOW_LEVELS_MAX; n_levels++) {
        const size_t n_bytes = BYTES[n_levels - 1u];
        TEST_ASSERT_EQUAL_UINT(n_bytes, EVS_PYRAMID_BYTES(W, H, n_levels));
        if (n_bytes > 0u) {
            TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE,
                                  evs_pyramid_build(&first, &image, n_levels, first_levels, n_bytes - 1u));
            TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_pyramid_build(&first, &image, n_levels, NULL, n_bytes));
        }
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pyramid_build(&first, &image, n_levels, first_levels, n_bytes));
        TEST_ASSERT_EQUAL_UINT16(n_levels, first.n_levels);
        TEST_ASSERT_EQUAL_PTR(first_px, first.level[0].px);
        for (uint16_t i = 1u; i < n_levels; i++) {
            evs_image_halve(&first.level[i - 1u], second_px);
            const size_t n = EVS_IMAGE_BYTES(first.level[i].width_px, first.level[i].height_px);
            TEST_ASSERT_EQUAL_MEMORY(second_px, first.level[i].px, n);
        }
    }
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pyramid_build(&first, &image, 1u, NULL, 0u));
    const evs_image_t bad[] = {{first_px, 0u, H}, {first_px, W, 0u}, {first_px, EVS_SENSOR_MAX_PX + 1u, H}};
    for (size_t i = 0u; i < 3u; i++) {
        TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_pyramid_build(&second, &bad[i], 2u, second_levels, SIZE_MAX));
    }
    const evs_image_t none = {NULL, W, H};
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_pyramid_build(&second, &image, 0u, second_levels, SIZE_MAX));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_pyramid_build(&second, &image, 5u, second_levels, SIZE_MAX));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_pyramid_build(&second, &none, 1u, second_levels, SIZE_MAX));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_pyramid_build(&second, NULL, 1u, second_levels, SIZE_MAX));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_pyramid_build(NULL, &image, 1u, second_levels, SIZE_MAX));
}

/* --- accuracy ---------------------------------------------------------------------------------------------------- */

static const uint16_t WINDOWS[][2] = {{31, 2}, {31, 1}, {21, 1}, {21, 2}, {15, 1}, {9, 1}, {7, 2}};
enum { N_WINDOWS = sizeof WINDOWS / sizeof WINDOWS[0] };

/* Against the truth, and against the same method in double precision; everywhere up to the border. */
static void test_shifts_are_found_to_a_hundredth_of_a_pixel(void)
{
    static const double SHIFTS[][2] = {{0.0, 0.0}, {0.37, -0.71}, {-1.5, 0.25}, {2.13, 1.87}};
    for (size_t s = 0u; s < 4u; s++) {
        scene(SHIFTS[s][0], SHIFTS[s][1], 2u);
        for (size_t k = 0u; k < N_WINDOWS; k++) {
            const evs_flow_config_t cfg = config(WINDOWS[k][0], WINDOWS[k][1], 10u);
            init(&cfg);
            const size_t n = make_tracks(cfg.window_px / 2 + 4);
            evs_flow_track(&flow, &first, &second, tracks, n);
            for (size_t i = 0u; i < n; i++) {
                assert_tracked(tracks[i], SHIFTS[s][0], SHIFTS[s][1], (cfg.window_px < 10u) ? 0.1 : 0.03);
                double x = tracks[i].to.x_q8 / 256.0, y = tracks[i].to.y_q8 / 256.0;
                if (i % 8u == 0u) {
                    model_track(&cfg, tracks[i].from, &x, &y);
                    TEST_ASSERT_DOUBLE_WITHIN(0.008, 0.0, distance(tracks[i].to, x, y));
                }
                TEST_ASSERT_TRUE(tracks[i].residual_q8 < 256u);
            }
        }
    }
}

/* Windows that reach over the border see it go on: with the same method in double precision, not with the truth. */
static void test_windows_over_the_border_are_tracked_as_if_it_went_on(void)
{
    scene(0.8, -0.6, 2u);
    for (size_t k = 0u; k < N_WINDOWS; k++) {
        evs_flow_config_t cfg = config(WINDOWS[k][0], WINDOWS[k][1], 30u);
        cfg.max_backward_q8 = 0u;
        init(&cfg);
        static const double AT[][2] = {{2, 40},         {5.5, 6.25},     {W - 3.0, 40.5},
                                       {50.2, H - 4.0}, {W - 6.0, 9.75}, {W - 4.5, H - 3.5}};
        for (size_t i = 0u; i < 6u; i++) {
            track_one(AT[i][0], AT[i][1], AT[i][0], AT[i][1]);
            TEST_ASSERT_EQUAL_INT(EVS_FLOW_OK, tracks[0].status);
            double x = tracks[0].to.x_q8 / 256.0, y = tracks[0].to.y_q8 / 256.0;
            model_track(&cfg, tracks[0].from, &x, &y);
            TEST_ASSERT_DOUBLE_WITHIN((cfg.window_px < 10u) ? 0.04 : 0.015, 0.0, distance(tracks[0].to, x, y));
            TEST_ASSERT_DOUBLE_WITHIN(0.5, 0.0, distance(tracks[0].to, AT[i][0] + 0.8, AT[i][1] - 0.6));
        }
    }
}

static void test_default_settings_are_accurate_without_a_prediction(void)
{
    scene(1.3, -2.4, 2u);
    const evs_flow_config_t cfg = evs_flow_config_default();
    init(&cfg);
    const size_t n = make_tracks(22);
    evs_flow_track(&flow, &first, &second, tracks, n);
    for (size_t i = 0u; i < n; i++) { assert_tracked(tracks[i], 1.3, -2.4, 0.06); }
}

static void test_a_coarse_level_or_a_prediction_reaches_farther(void)
{
    const double dx = 11.2, dy = -8.7;
    const evs_flow_config_t cfg = config(15u, 1u, 10u);
    scene(dx, dy, 1u);
    init(&cfg);
    const size_t n = make_tracks(24);
    evs_flow_track(&flow, &first, &second, tracks, n);
    TEST_ASSERT_TRUE_MESSAGE(count_near(n, dx, dy, 0.1) < n / 2u, "one level should not reach that far");
    for (size_t i = 0u; i < n; i++) {
        tracks[i].to = position(tracks[i].from.x_q8 / 256.0 + dx + 1.2, tracks[i].from.y_q8 / 256.0 + dy - 0.9);
    }
    evs_flow_track(&flow, &first, &second, tracks, n); /* predicted */
    TEST_ASSERT_EQUAL_UINT(n, count_near(n, dx, dy, 0.05));

    build(3u);
    for (size_t i = 0u; i < n; i++) { tracks[i].to = tracks[i].from; }
    evs_flow_track(&flow, &first, &second, tracks, n);
    TEST_ASSERT_TRUE_MESSAGE(count_near(n, dx, dy, 0.05) > n * 3u / 4u, "three levels should reach that far");
    second.n_levels = 1u; /* The smaller number of levels counts. */
    evs_flow_track_t with_one[N_TRACKS];
    for (size_t i = 0u; i < n; i++) { tracks[i].to = tracks[i].from; }
    evs_flow_track(&flow, &first, &second, tracks, n);
    memcpy(with_one, tracks, sizeof with_one);
    build(1u);
    for (size_t i = 0u; i < n; i++) { tracks[i].to = tracks[i].from; }
    evs_flow_track(&flow, &first, &second, tracks, n);
    for (size_t i = 0u; i < n; i++) {
        TEST_ASSERT_EQUAL_MEMORY(&with_one[i].to, &tracks[i].to, sizeof tracks[i].to);
        TEST_ASSERT_EQUAL_UINT8(with_one[i].status, tracks[i].status);
    }
}

/* A step that is short ends the search: with a coarse epsilon fewer are made. */
static void test_epsilon_ends_the_steps(void)
{
    scene(0.9, 0.9, 1u);
    evs_flow_config_t cfg = config(21u, 1u, 20u);
    cfg.max_backward_q8 = 0u;
    cfg.epsilon_q8 = 0u;
    init(&cfg);
    track_one(50.0, 40.0, 50.0, 40.0);
    assert_tracked(tracks[0], 0.9, 0.9, 0.03);
    const evs_position_t converged = tracks[0].to;
    cfg.epsilon_q8 = 256u;
    init(&cfg);
    track_one(50.0, 40.0, 50.0, 40.0);
    const evs_position_t coarse = tracks[0].to;
    cfg.epsilon_q8 = 0u;
    cfg.n_iterations = 1u;
    init(&cfg);
    track_one(50.0, 40.0, 50.0, 40.0);
    TEST_ASSERT_EQUAL_MEMORY(&tracks[0].to, &coarse, sizeof coarse);
    TEST_ASSERT_TRUE(memcmp(&converged, &coarse, sizeof coarse) != 0);
}

/* Mean absolute difference of the two windows of a track. */
static double model_residual(const evs_flow_config_t *cfg, const evs_flow_track_t *t)
{
    const int half = cfg->window_px / 2;
    double sum = 0.0, n = 0.0;
    for (int v = -half; v <= half; v += cfg->stride_px) {
        for (int u = -half; u <= half; u += cfg->stride_px) {
            sum += fabs(model_grey(&second.level[0], t->to.x_q8 / 256.0 + u, t->to.y_q8 / 256.0 + v) -
                        model_grey(&first.level[0], t->from.x_q8 / 256.0 + u, t->from.y_q8 / 256.0 + v));
            n += 1.0;
        }
    }
    return sum / n;
}

static void test_residual_is_the_mean_difference_of_grey(void)
{
    scene(0.3, 0.2, 1u);
    for (size_t i = 0u; i < W * H; i++) { second_px[i] = (uint8_t)(first_px[i] + 3); }
    for (size_t k = 0u; k < N_WINDOWS; k++) {
        const evs_flow_config_t cfg = config(WINDOWS[k][0], WINDOWS[k][1], 3u);
        init(&cfg);
        track_one(50.3, 40.2, 50.3, 40.2);
        TEST_ASSERT_EQUAL_INT(EVS_FLOW_OK, tracks[0].status);
        TEST_ASSERT_DOUBLE_WITHIN(0.03, model_residual(&cfg, &tracks[0]), tracks[0].residual_q8 / 256.0);
        TEST_ASSERT_TRUE(tracks[0].residual_q8 > 256u);
    }
}

/* --- tracks that end ---------------------------------------------------------------------------------------------- */

static void test_flat_images_and_stripes_have_no_texture(void)
{
    const evs_flow_config_t cfg = evs_flow_config_default();
    init(&cfg);
    for (int kind = 0; kind < 4; kind++) {
        for (int y = 0; y < H; y++) {
            for (int x = 0; x < W; x++) {
                const int grey[] = {200, (x / 5 % 2) * 255, (y / 5 % 2) * 255, x + y};
                first_px[y * W + x] = second_px[y * W + x] = (uint8_t)grey[kind];
            }
        }
        build(2u);
        track_one(50.5, 40.25, 50.0, 40.0);
        TEST_ASSERT_EQUAL_INT(EVS_FLOW_LOST_TEXTURE, tracks[0].status);
        TEST_ASSERT_EQUAL_UINT16(0u, tracks[0].residual_q8);
    }
}

/* The threshold is what the header says: the smaller eigenvalue of the mean product of the gradients. */
static void test_texture_counts_from_min_eigen_on(void)
{
    /* Two ramps meet along the diagonal: left of it the gradient is (2, 0), right of it (0, 2), on it (1, 1). Of n x n
     * samples n lie on it, so the mean product is [2 - 1/n, 1/n; 1/n, 2 - 1/n], its smaller eigenvalue 2 - 2/n. */
    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++) { first_px[y * W + x] = (uint8_t)(2 * ((x - 10 > y) ? y : x - 10) + 40); }
    }
    memcpy(second_px, first_px, sizeof second_px);
    build(1u);
    for (size_t k = 0u; k < N_WINDOWS; k++) {
        for (size_t i = 0u; i < 2u; i++) {
            evs_flow_config_t cfg = config(WINDOWS[k][0], WINDOWS[k][1], 3u);
            const int n = (WINDOWS[k][0] - 1) / WINDOWS[k][1] + 1;
            cfg.min_eigen_q8 = (uint16_t)(512 - 512 / n + ((i == 0u) ? -4 : 4));
            init(&cfg);
            track_one(50.0, 40.0, 50.0, 40.0);
            TEST_ASSERT_EQUAL_INT((i == 0u) ? EVS_FLOW_OK : EVS_FLOW_LOST_TEXTURE, tracks[0].status);
        }
    }
}

static void test_only_the_finest_level_must_have_texture(void)
{
    scene(0.4, -0.3, 2u);
    memset(first_levels, 99, sizeof first_levels);
    const evs_flow_config_t cfg = evs_flow_config_default();
    init(&cfg);
    track_one(50.0, 40.0, 50.0, 40.0);
    assert_tracked(tracks[0], 0.4, -0.3, 0.06);
    scene(0.4, -0.3, 2u);
    memset(first_px, 99, sizeof first_px);
    track_one(50.0, 40.0, 50.0, 40.0);
    TEST_ASSERT_EQUAL_INT(EVS_FLOW_LOST_TEXTURE, tracks[0].status);
}

/* Moved farther than one level reaches, most tracks end somewhere wrong. */
static void test_the_way_back_finds_wrong_tracks(void)
{
    const double dx = 11.2, dy = -8.7;
    static const uint16_t MOST_Q8[] = {0u, 65535u, 128u}; /* not asked; anywhere will do; default */
    size_t n_ok[3], n_right[3], n_lost[3] = {0u, 0u, 0u};
    scene(dx, dy, 1u);
    for (size_t k = 0u; k < 3u; k++) {
        evs_flow_config_t cfg = config(15u, 1u, 10u);
        cfg.max_backward_q8 = MOST_Q8[k];
        init(&cfg);
        seed = 815u;
        const size_t n = make_tracks(20);
        evs_flow_track(&flow, &first, &second, tracks, n);
        n_ok[k] = count_near(n, dx, dy, 1e9);
        n_right[k] = count_near(n, dx, dy, 0.1);
        for (size_t i = 0u; i < n; i++) {
            n_lost[k] += (tracks[i].status == EVS_FLOW_LOST_BACKWARD) ? 1u : 0u;
            TEST_ASSERT_TRUE((tracks[i].status == EVS_FLOW_OK) || (tracks[i].residual_q8 == 0u));
        }
    }
    TEST_ASSERT_EQUAL_UINT(0u, n_lost[0]);
    TEST_ASSERT_EQUAL_UINT(n_ok[0], n_ok[1]);
    TEST_ASSERT_EQUAL_UINT(n_ok[0], n_ok[2] + n_lost[2]);
    TEST_ASSERT_TRUE(n_right[0] >= 4u);
    TEST_ASSERT_TRUE(n_ok[0] >= 2u * n_right[0]);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(n_right[0], n_right[2], "a right track was dropped");
    TEST_ASSERT_TRUE_MESSAGE(n_ok[2] - n_right[2] < (n_ok[0] - n_right[0]) / 2u, "wrong tracks came back");
}

static void test_points_off_the_image_are_refused_and_not_moved(void)
{
    scene(0.0, 0.0, 2u);
    const evs_flow_config_t cfg = evs_flow_config_default();
    init(&cfg);
    static const int32_t BAD[][2] = {
        {-1, 40 * 256},         {(W - 1) * 256 + 1, 40 * 256}, {40 * 256, -1},        {40 * 256, (H - 1) * 256 + 1},
        {INT32_MIN, INT32_MIN}, {INT32_MAX, INT32_MAX},        {INT32_MIN, 40 * 256}, {40 * 256, INT32_MAX}};
    for (size_t i = 0u; i < 8u; i++) {
        const evs_position_t bad = {BAD[i][0], BAD[i][1]};
        tracks[0] = (evs_flow_track_t){.from = bad, .to = {7, 9}, .residual_q8 = 5u, .status = 9u};
        evs_flow_track(&flow, &first, &second, tracks, 1u);
        TEST_ASSERT_EQUAL_INT(EVS_FLOW_LOST_BORDER, tracks[0].status);
        TEST_ASSERT_EQUAL_INT32(7, tracks[0].to.x_q8);
        TEST_ASSERT_EQUAL_UINT16(0u, tracks[0].residual_q8);
    }
    /* A prediction may lie half a window outside, no more. */
    const int32_t half_q8 = 12 * 256;
    const int32_t starts[][2] = {{-half_q8, 40 * 256},
                                 {(W - 1) * 256 + half_q8, 40 * 256},
                                 {40 * 256, -half_q8},
                                 {40 * 256, (H - 1) * 256 + half_q8}};
    static const int OUT[][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
    for (size_t i = 0u; i < 4u; i++) {
        const evs_position_t start = {starts[i][0] + OUT[i][0], starts[i][1] + OUT[i][1]};
        tracks[0] = (evs_flow_track_t){.from = position(40, 40), .to = start};
        evs_flow_track(&flow, &first, &second, tracks, 1u);
        TEST_ASSERT_EQUAL_INT(EVS_FLOW_LOST_BORDER, tracks[0].status);
        TEST_ASSERT_EQUAL_INT32(start.x_q8, tracks[0].to.x_q8);
        TEST_ASSERT_EQUAL_INT32(start.y_q8, tracks[0].to.y_q8);
        tracks[0].to = (evs_position_t){starts[i][0], starts[i][1]};
        evs_flow_track(&flow, &first, &second, tracks, 1u); /* It is looked at, whatever comes of it. */
        TEST_ASSERT_TRUE((tracks[0].to.x_q8 != starts[i][0]) || (tracks[0].to.y_q8 != starts[i][1]));
    }
}

static void test_a_point_that_leaves_the_image_is_lost_at_the_border(void)
{
    evs_flow_config_t cfg = config(15u, 1u, 10u);
    cfg.max_backward_q8 = 0u;
    init(&cfg);
    static const double AT[][2] = {{2.5, 40}, {W - 3.5, 40}, {50, 2.5}, {50, H - 3.5}};
    static const double OUT[][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
    for (size_t i = 0u; i < 4u; i++) {
        scene(4.0 * OUT[i][0], 4.0 * OUT[i][1], 1u);
        track_one(AT[i][0], AT[i][1], AT[i][0] + 4.0 * OUT[i][0], AT[i][1] + 4.0 * OUT[i][1]);
        TEST_ASSERT_EQUAL_INT(EVS_FLOW_LOST_BORDER, tracks[0].status);
    }
}

/* --- any content -------------------------------------------------------------------------------------------------- */

/* The largest gradients and differences there are: sanitizers watch the sums. */
static void test_the_hardest_contrast_overflows_nothing(void)
{
    for (int side = 1; side <= 8; side++) {
        for (int kind = 0; kind < 3; kind++) {
            for (int y = 0; y < H; y++) {
                for (int x = 0; x < W; x++) {
                    const int on[] = {(x / side) ^ (y / side), x / side, (x + y) / side};
                    first_px[y * W + x] = (on[kind] & 1) ? 255u : 0u;
                    second_px[y * W + x] = (uint8_t)(255u - first_px[y * W + x]);
                }
            }
            build(3u);
            for (size_t k = 0u; k < N_WINDOWS; k++) {
                evs_flow_config_t cfg = config(WINDOWS[k][0], WINDOWS[k][1], 3u);
                cfg.min_eigen_q8 = 1u;
                init(&cfg);
                const size_t n = make_tracks(30);
                for (size_t i = 0u; i < n; i += 2u) {
                    tracks[i].from = tracks[i].to = position(33 + (int)i, 40 - (int)i);
                }
                evs_flow_track(&flow, &first, &second, tracks, n);
                for (size_t i = 0u; i < n; i++) {
                    TEST_ASSERT_TRUE(tracks[i].status <= EVS_FLOW_LOST_BACKWARD);
                    if (tracks[i].status == EVS_FLOW_OK) {
                        TEST_ASSERT_TRUE((tracks[i].to.x_q8 >= 0) && (tracks[i].to.x_q8 <= (W - 1) * 256));
                        TEST_ASSERT_TRUE((tracks[i].to.y_q8 >= 0) && (tracks[i].to.y_q8 <= (H - 1) * 256));
                    }
                }
            }
        }
    }
}

/* Blocks of 2 px in black and white have the steepest gradients everywhere; moved by 1 px the pull of a whole window is
 * beyond 32 bits, and must still pull the right way. */
static void test_the_strongest_pull_has_the_right_direction(void)
{
    for (int along = 0; along < 2; along++) {
        for (int y = 0; y < H; y++) {
            for (int x = 0; x < W; x++) {
                const int u = x + 2 - (1 - along), v = y + 2 - along;
                first_px[y * W + x] = (((x / 2) ^ (y / 2)) & 1) ? 255u : 0u;
                second_px[y * W + x] = (((u / 2 - 1) ^ (v / 2 - 1)) & 1) ? 255u : 0u;
            }
        }
        build(1u);
        const evs_flow_config_t cfg = config(31u, 1u, 10u);
        init(&cfg);
        track_one(50.0, 40.0, 50.0, 40.0);
        assert_tracked(tracks[0], 1 - along, along, 0.05);
    }
}

/* A faint template and an image of high contrast call for a step of many windows: it is cut to half of one. */
static void test_no_step_is_longer_than_half_a_window(void)
{
    memset(first_px, 100, sizeof first_px);
    for (int y = 39; y < 42; y++) { memset(&first_px[y * W + 49], 103, 3u); }
    for (size_t i = 0u; i < W * H; i++) { second_px[i] = (i % W < 50u) ? 0u : 255u; }
    build(1u);
    evs_flow_config_t cfg = config(15u, 1u, 1u);
    cfg.min_eigen_q8 = 1u;
    cfg.max_backward_q8 = 0u;
    init(&cfg);
    track_one(50.0, 40.0, 50.0, 40.0);
    TEST_ASSERT_EQUAL_INT(EVS_FLOW_OK, tracks[0].status);
    TEST_ASSERT_EQUAL_INT32(7 * 256, (int32_t)evs_abs_u32(tracks[0].to.x_q8 - 50 * 256));
}

static void test_images_smaller_than_a_window_are_tracked_or_lost(void)
{
    static const uint16_t SIZES[][2] = {{1, 1}, {2, 3}, {9, 40}, {40, 5}, {20, 20}};
    render_noise(first_px, 3u);
    for (size_t s = 0u; s < 5u; s++) {
        const evs_image_t image = {first_px, SIZES[s][0], SIZES[s][1]};
        for (uint16_t n_levels = 1u; n_levels <= EVS_FLOW_LEVELS_MAX; n_levels++) {
            TEST_ASSERT_EQUAL_INT(EVS_OK,
                                  evs_pyramid_build(&first, &image, n_levels, first_levels, sizeof first_levels));
            const evs_flow_config_t cfg = evs_flow_config_default();
            init(&cfg);
            second = first;
            track_one(SIZES[s][0] / 2, SIZES[s][1] / 2, SIZES[s][0] / 2, SIZES[s][1] / 2);
            TEST_ASSERT_EQUAL_INT((s == 0u) ? EVS_FLOW_LOST_TEXTURE : EVS_FLOW_OK, tracks[0].status);
        }
    }
}

/* An image alone gives the bits of the same image in the middle of a larger one that goes on as its border does. */
static void test_the_border_goes_on(void)
{
    enum { MARGIN = 20 }; /* A window of 15 px may lie 7 px outside, and sees 7 more and 2 for gradients. */
    static const uint16_t SIZES[][2] = {{1, 9}, {2, 9}, {3, 2}, {5, 30}, {6, 3}, {30, 5}, {40, 30}, {60, 38}};
    static uint8_t small_px[2][60 * 38];
    size_t n_compared = 0u;
    for (size_t s = 0u; s < 8u; s++) {
        const uint16_t w = SIZES[s][0], h = SIZES[s][1];
        evs_pyramid_t small[2], large[2];
        for (size_t k = 0u; k < 2u; k++) {
            uint8_t *const px = (k == 0u) ? first_px : second_px;
            for (size_t i = 0u; i < (size_t)w * h; i++) {
                const int32_t grey =
                    (k == 0u) ? (int32_t)next_random(256u) : small_px[0][i] + (int32_t)next_random(60u);
                small_px[k][i] = (uint8_t)evs_clamp(grey, 0, 255);
                if (s == 7u) { /* Steps of some pixels, past what the patch has to spare. */
                    const double x = (double)(int)(i % w), y = (double)(int)(i / w);
                    small_px[k][i] = (uint8_t)lround(texture(x - 3.0 * (int)k, y - 4.5 * (int)k));
                }
            }
            for (int y = 0; y < H; y++) {
                for (int x = 0; x < W; x++) {
                    px[y * W + x] = small_px[k][evs_clamp(y - MARGIN, 0, h - 1) * w + evs_clamp(x - MARGIN, 0, w - 1)];
                }
            }
            const evs_image_t image = {small_px[k], w, h};
            TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pyramid_build(&small[k], &image, 1u, NULL, 0u));
        }
        build(1u);
        large[0] = first;
        large[1] = second;
        for (uint16_t stride = 1u; stride <= 2u; stride++) {
            const evs_flow_config_t cfg = config(15u, stride, 5u);
            init(&cfg);
            for (size_t i = 0u; i < 20u; i++) {
                evs_flow_track_t here = {.status = 99u}, there;
                here.from.x_q8 = (int32_t)next_random((uint32_t)(w - 1) * 256u + 1u);
                here.from.y_q8 = (int32_t)next_random((uint32_t)(h - 1) * 256u + 1u);
                here.to = here.from;
                there = here;
                there.from.x_q8 = there.to.x_q8 = here.from.x_q8 + MARGIN * 256;
                there.from.y_q8 = there.to.y_q8 = here.from.y_q8 + MARGIN * 256;
                evs_flow_track(&flow, &small[0], &small[1], &here, 1u);
                evs_flow_track(&flow, &large[0], &large[1], &there, 1u);
                if (here.status == EVS_FLOW_LOST_BORDER) { continue; } /* It has left the one, but not the other. */
                TEST_ASSERT_EQUAL_UINT8(there.status, here.status);
                if (here.status != EVS_FLOW_OK) { continue; }
                TEST_ASSERT_EQUAL_INT32(there.to.x_q8 - MARGIN * 256, here.to.x_q8);
                TEST_ASSERT_EQUAL_INT32(there.to.y_q8 - MARGIN * 256, here.to.y_q8);
                TEST_ASSERT_EQUAL_UINT16(there.residual_q8, here.residual_q8);
                n_compared++;
            }
        }
    }
    TEST_ASSERT_TRUE(n_compared > 100u);
}

/* The same bits on every target and with every kernel, however the tracks are split. */
static void test_bits_are_those_of_every_other_target(void)
{
    uint32_t crc = 0u;
    render_noise(first_px, 5u);
    for (size_t i = 0u; i < W * H; i++) { /* Moved by (2, 1) px and made a little brighter, with some noise. */
        const size_t j = (i >= W + 2u) ? i - W - 2u : i;
        second_px[i] = (uint8_t)evs_clamp(first_px[j] + 2 + (int32_t)next_random(5u), 0, 255);
    }
    build(LEVELS);
    for (size_t k = 0u; k < N_WINDOWS; k++) {
        const evs_flow_config_t cfg = config(WINDOWS[k][0], WINDOWS[k][1], 4u);
        init(&cfg);
        seed = 77u;
        for (size_t i = 0u; i < N_TRACKS; i++) { /* Everywhere, borders included. */
            tracks[i].from.x_q8 = (int32_t)next_random((W - 1) * 256);
            tracks[i].from.y_q8 = (int32_t)next_random((H - 1) * 256);
            tracks[i].to = tracks[i].from;
        }
        evs_flow_track(&flow, &first, &second, tracks, 7u);
        evs_flow_track(&flow, &first, &second, tracks + 7, 0u);
        for (size_t i = 7u; i < N_TRACKS; i++) { evs_flow_track(&flow, &first, &second, &tracks[i], 1u); }
        for (size_t i = 0u; i < N_TRACKS; i++) {
            crc = crc32_u32(crc, (uint32_t)tracks[i].to.x_q8);
            crc = crc32_u32(crc, (uint32_t)tracks[i].to.y_q8);
            crc = crc32_u16(crc, tracks[i].residual_q8);
            crc = crc32_u16(crc, tracks[i].status);
        }
        evs_flow_track_t together[N_TRACKS];
        memcpy(together, tracks, sizeof together);
        for (size_t i = 0u; i < N_TRACKS; i++) { tracks[i].to = tracks[i].from; }
        evs_flow_track(&flow, &first, &second, tracks, N_TRACKS);
        for (size_t i = 0u; i < N_TRACKS; i++) {
            TEST_ASSERT_EQUAL_MEMORY(&together[i].to, &tracks[i].to, sizeof tracks[i].to);
            TEST_ASSERT_EQUAL_INT(together[i].status, tracks[i].status);
        }
    }
    TEST_ASSERT_EQUAL_HEX32(0xE36D9D8Au, crc);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_names_the_fault_and_leaves_the_context_alone);
    RUN_TEST(test_pyramid_is_the_image_halved_again_and_again);
    RUN_TEST(test_shifts_are_found_to_a_hundredth_of_a_pixel);
    RUN_TEST(test_windows_over_the_border_are_tracked_as_if_it_went_on);
    RUN_TEST(test_default_settings_are_accurate_without_a_prediction);
    RUN_TEST(test_a_coarse_level_or_a_prediction_reaches_farther);
    RUN_TEST(test_epsilon_ends_the_steps);
    RUN_TEST(test_residual_is_the_mean_difference_of_grey);
    RUN_TEST(test_flat_images_and_stripes_have_no_texture);
    RUN_TEST(test_texture_counts_from_min_eigen_on);
    RUN_TEST(test_only_the_finest_level_must_have_texture);
    RUN_TEST(test_the_way_back_finds_wrong_tracks);
    RUN_TEST(test_points_off_the_image_are_refused_and_not_moved);
    RUN_TEST(test_a_point_that_leaves_the_image_is_lost_at_the_border);
    RUN_TEST(test_the_hardest_contrast_overflows_nothing);
    RUN_TEST(test_the_strongest_pull_has_the_right_direction);
    RUN_TEST(test_no_step_is_longer_than_half_a_window);
    RUN_TEST(test_images_smaller_than_a_window_are_tracked_or_lost);
    RUN_TEST(test_the_border_goes_on);
    RUN_TEST(test_bits_are_those_of_every_other_target);
    return UNITY_END();
}
