/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "../../lib/src/evs_warp_private.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "unity.h"

enum { W = 120, H = 90, MAX_EVENTS = 8000, BUDGET = 6000, SPAN_US = 20000 };

static evs_event_t events[MAX_EVENTS];
static evs_point_t points[MAX_EVENTS];
static evs_point_t moved[MAX_EVENTS];
static uint16_t memory[EVS_WARP_BYTES(W, H, BUDGET, EVS_WARP_MAX_PX, 1u) / 2u + 4u];
static uint16_t cells[(W + 40) * (H + 40)];
static evs_warp_t warp;
static evs_flow_grid_t flow;
static evs_warp_result_t result;
static uint32_t seed;

void setUp(void) { seed = 2026u; }
void tearDown(void) {}

static uint32_t next_random(void)
{
    seed = seed * 1664525u + 1013904223u;
    return seed >> 8;
}

/* In [0, limit). */
static double uniform(double limit) { return limit * next_random() / 16777216.0; }

/* --- scenes ---------------------------------------------------------------------------------------------------- */

typedef void (*motion_t)(double x, double y, double *vx, double *vy); /* displacement over the window, px */

static double one_x, one_y; /* of one_motion */

static void one_motion(double x, double y, double *vx, double *vy)
{
    (void)x;
    (void)y;
    *vx = one_x;
    *vy = one_y;
}

static void two_halves(double x, double y, double *vx, double *vy)
{
    (void)y;
    *vx = (x < W / 2) ? 2.5 : -2.5;
    *vy = 1.0;
}

static void far_apart(double x, double y, double *vx, double *vy)
{
    (void)y;
    *vx = (x < W / 2) ? -8.0 : 8.0;
    *vy = 0.0;
}

static void right_part_still(double x, double y, double *vx, double *vy)
{
    (void)y;
    *vx = (x < 0.75 * W) ? 13.0 : 0.0;
    *vy = (x < 0.75 * W) ? 9.0 : 0.0;
}

static void diverging(double x, double y, double *vx, double *vy)
{
    *vx = 0.07 * (x - W / 2);
    *vy = 0.07 * (y - H / 2);
}

/* A sensor sees n_dots dots that move, each of its events in the middle of a pixel; the rest of n are noise. t0 is the
 * first event's time. Where a dot is at mid-window decides how it moves. */
static void make_scene(size_t n, size_t n_dots, unsigned noise_percent, motion_t motion, uint32_t t0_us)
{
    static double dot_x[800], dot_y[800];
    TEST_ASSERT_TRUE((n <= MAX_EVENTS) && (n_dots <= 800u));
    for (size_t i = 0u; i < n_dots; i++) {
        dot_x[i] = uniform(W);
        dot_y[i] = uniform(H);
    }
    for (size_t i = 0u; i < n; i++) {
        const double phase = (double)i / (double)(n - 1u) - 0.5;
        events[i] = evs_event_make(t0_us + (uint32_t)lround((phase + 0.5) * SPAN_US), 0u, 0u, false);
        double x = uniform(W - 1);
        double y = uniform(H - 1);
        if ((n_dots > 0u) && (next_random() % 100u >= noise_percent)) {
            const size_t dot = next_random() % n_dots;
            double vx;
            double vy;
            motion(dot_x[dot], dot_y[dot], &vx, &vy);
            x = dot_x[dot] + phase * vx;
            y = dot_y[dot] + phase * vy;
        }
        if ((x < -0.5) || (y < -0.5) || (x >= W - 0.5) || (y >= H - 0.5)) { /* off the sensor */
            x = uniform(W - 1);
            y = uniform(H - 1);
        }
        points[i].x_q4 = (int16_t)(16.0 * floor(x + 0.5));
        points[i].y_q4 = (int16_t)(16.0 * floor(y + 0.5));
    }
}

static evs_warp_config_t config(evs_warp_kind_t kind, evs_warp_cost_t cost)
{
    evs_warp_config_t cfg = evs_warp_config_default(kind, W, H);
    cfg.cost = cost;
    cfg.n_budget = BUDGET;
    cfg.max_px = 16u;
    cfg.n_cols = 4u; /* tiles of 30 px, as 8 x 6 over 240 x 180 */
    cfg.n_rows = 3u;
    return cfg;
}

static void init(const evs_warp_config_t *cfg)
{
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_warp_init(&warp, cfg, memory, sizeof memory));
}

static void estimate(size_t n) { evs_warp_estimate(&warp, events, points, n, NULL, &flow, &result); }

/* px over the window */
static double over_window(int16_t px_s_q3) { return px_s_q3 / 8.0 * SPAN_US * 1e-6; }

/* Mean distance between the estimate and the truth at the tile centres. */
static double mean_error(motion_t motion)
{
    double sum = 0.0;
    for (uint16_t row = 0u; row < flow.n_rows; row++) {
        for (uint16_t col = 0u; col < flow.n_cols; col++) {
            const evs_point_t centre = evs_flow_grid_centre(&flow, col, row);
            const evs_flow_velocity_t v = evs_flow_grid_tile(&flow, col, row);
            double vx;
            double vy;
            motion(centre.x_q4 / 16.0, centre.y_q4 / 16.0, &vx, &vy);
            sum += hypot(over_window(v.x_px_s_q3) - vx, over_window(v.y_px_s_q3) - vy);
        }
    }
    return sum / (flow.n_cols * flow.n_rows);
}

/* --- contrast: a model in double precision ---------------------------------------------------------------------- */

enum { MODEL_MAX = 200 };

/* Votes, smoothing and cost as the header defines them, votes of 1. */
static double model_contrast(const evs_warp_view_t *view, const evs_warp_event_t *ev, size_t n, double dx_px,
                             double dy_px, evs_warp_cost_t cost)
{
    static double image[MODEL_MAX][MODEL_MAX];
    static double smooth[MODEL_MAX][MODEL_MAX];
    const int w = (int)view->width;
    const int h = (int)view->height;
    const double size = (double)(1u << view->shift);
    memset(image, 0, sizeof image);
    memset(smooth, 0, sizeof smooth);
    for (size_t i = 0u; i < n; i++) {
        const double t = ev[i].dt_q12 / 4096.0;
        const double x = (ev[i].x_q4 / 16.0 - t * dx_px - view->x_px) / size;
        const double y = (ev[i].y_q4 / 16.0 - t * dy_px - view->y_px) / size;
        const int ix = (int)floor(x);
        const int iy = (int)floor(y);
        if ((ix < 0) || (iy < 0) || (ix >= w - 1) || (iy >= h - 1)) { continue; }
        for (int k = 0; k < 4; k++) {
            image[iy + k / 2][ix + k % 2] += (1.0 - fabs(x - ix - k % 2)) * (1.0 - fabs(y - iy - k / 2));
        }
    }
    double sum = 0.0;
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++) {
            for (int k = 0; k < 9; k++) {
                const int sx = x + k % 3 - 1;
                const int sy = y + k / 3 - 1;
                if ((sx < 0) || (sy < 0) || (sx >= w) || (sy >= h)) { continue; }
                smooth[y][x] += image[sy][sx] * (2 - abs(k % 3 - 1)) * (2 - abs(k / 3 - 1)) / 16.0;
            }
            sum += smooth[y][x] * smooth[y][x];
        }
    }
    if (cost == EVS_WARP_MEAN_SQUARE) { return sum; }
    sum = 0.0;
    for (int y = 1; y < h - 1; y++) {
        for (int x = 1; x < w - 1; x++) {
            double gx = 0.0;
            double gy = 0.0;
            for (int k = -1; k <= 1; k++) {
                gx += (2 - abs(k)) * (smooth[y + k][x + 1] - smooth[y + k][x - 1]);
                gy += (2 - abs(k)) * (smooth[y + 1][x + k] - smooth[y - 1][x + k]);
            }
            sum += gx * gx + gy * gy;
        }
    }
    return sum;
}

static uint64_t contrast_of(const evs_warp_view_t *view, const evs_warp_event_t *ev, size_t n, int32_t dx_q6,
                            int32_t dy_q6, evs_warp_cost_t cost)
{
    memset(cells, 0x77, sizeof cells); /* what is behind the image must not matter */
    memset(cells, 0, view->width * (view->height + 1u) * sizeof cells[0]);
    TEST_ASSERT_TRUE(evs_warp_vote(view, cells, ev, n, 1u, dx_q6, dy_q6));
    return evs_warp_contrast(view, cells, cost);
}

static void test_contrast_agrees_with_the_model(void)
{
    static evs_warp_event_t ev[600];
    for (unsigned trial = 0u; trial < 24u; trial++) {
        const evs_warp_cost_t cost = (trial % 2u == 0u) ? EVS_WARP_MEAN_SQUARE : EVS_WARP_GRADIENT;
        const evs_warp_view_t view = {.width = 20u + next_random() % 60u,
                                      .height = 20u + next_random() % 40u,
                                      .shift = trial / 2u % 4u,
                                      .x_px = (int32_t)(next_random() % 40u) - 20,
                                      .y_px = (int32_t)(next_random() % 40u) - 20};
        const double size = (double)(1u << view.shift);
        for (size_t i = 0u; i < 600u; i++) { /* some off the view */
            ev[i].x_q4 = (int16_t)(16.0 * (view.x_px - 4.0 + uniform(size * view.width + 8.0)));
            ev[i].y_q4 = (int16_t)(16.0 * (view.y_px - 4.0 + uniform(size * view.height + 8.0)));
            ev[i].dt_q12 = (int16_t)(next_random() % 4097u - 2048u);
        }
        const int32_t dx_q6 = (int32_t)(next_random() % 2048u) - 1024;
        const int32_t dy_q6 = (int32_t)(next_random() % 2048u) - 1024;
        const double want = model_contrast(&view, ev, 600u, dx_q6 / 64.0, dy_q6 / 64.0, cost);
        const double is = (double)contrast_of(&view, ev, 600u, dx_q6, dy_q6, cost) / 65536.0;
        TEST_ASSERT_TRUE_MESSAGE(fabs(is - want) < 0.02 * want, "contrast is off by 2 %");
    }
}

static void test_one_event_is_shared_by_four_cells(void)
{
    const evs_warp_view_t view = {.width = 8u, .height = 6u, .shift = 0u, .x_px = -1, .y_px = -2};
    const evs_warp_event_t ev = {.x_q4 = 16 * 2 + 4, .y_q4 = 16 * 1 + 10, .dt_q12 = 0};
    memset(cells, 0, sizeof cells);
    TEST_ASSERT_TRUE(evs_warp_vote(&view, cells, &ev, 1u, 1u, 999, -999));
    uint32_t sum = 0u;
    for (size_t i = 0u; i < 8u * 6u; i++) { sum += cells[i]; }
    TEST_ASSERT_EQUAL_UINT32(256u, sum);
    TEST_ASSERT_EQUAL_UINT16(12 * 6, cells[3 * 8 + 3]);
    TEST_ASSERT_EQUAL_UINT16(4 * 6, cells[3 * 8 + 4]);
    TEST_ASSERT_EQUAL_UINT16(12 * 10, cells[4 * 8 + 3]);
    TEST_ASSERT_EQUAL_UINT16(4 * 10, cells[4 * 8 + 4]);
    /* Half a window later and 3 px: moved back by 1.5 px. */
    const evs_warp_event_t late = {.x_q4 = 16 * 2 + 8, .y_q4 = 16, .dt_q12 = 2048};
    memset(cells, 0, sizeof cells);
    TEST_ASSERT_TRUE(evs_warp_vote(&view, cells, &late, 1u, 1u, 3 * 64, -2 * 64));
    TEST_ASSERT_EQUAL_UINT16(256u, cells[4 * 8 + 2]);
}

static void test_positions_are_rounded_to_a_sixteenth_of_a_cell(void)
{
    const evs_warp_view_t view = {.width = 8u, .height = 6u, .shift = 2u, .x_px = 0, .y_px = 0};
    const evs_warp_event_t ev = {.x_q4 = 64 + 6, .y_q4 = 64 + 5, .dt_q12 = 0}; /* 1.5 and 1.25 sixteenths of 4 px */
    memset(cells, 0, sizeof cells);
    TEST_ASSERT_TRUE(evs_warp_vote(&view, cells, &ev, 1u, 1u, 0, 0));
    TEST_ASSERT_EQUAL_UINT16(14u * 15u, cells[8 + 1]);
    TEST_ASSERT_EQUAL_UINT16(2u * 1u, cells[16 + 2]);
}

static void test_a_hot_pixel_is_noticed_and_limited(void)
{
    static evs_warp_event_t ev[300];
    const evs_warp_view_t view = {.width = 8u, .height = 6u, .shift = 0u, .x_px = 0, .y_px = 0};
    for (int i = 0; i < 300; i++) { ev[i] = (evs_warp_event_t){.x_q4 = 32, .y_q4 = 32, .dt_q12 = 0}; }
    memset(cells, 0, sizeof cells);
    TEST_ASSERT_TRUE(evs_warp_vote(&view, cells, ev, 255u, 1u, 0, 0));
    TEST_ASSERT_EQUAL_UINT16(255u * 256u, cells[2 * 8 + 2]);
    TEST_ASSERT_FALSE(evs_warp_vote(&view, cells, ev, 1u, 1u, 0, 0));
    memset(cells, 0, sizeof cells);
    evs_warp_vote_limited(&view, cells, ev, 300u, 1u, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(65535u, cells[2 * 8 + 2]);
    TEST_ASSERT_EQUAL_UINT16(0u, cells[2 * 8 + 3]);
    memset(cells, 0, sizeof cells);
    TEST_ASSERT_TRUE(evs_warp_vote(&view, cells, ev, 300u, 7u, 0, 0));
    TEST_ASSERT_EQUAL_UINT16(43u * 256u, cells[2 * 8 + 2]);
}

static void test_events_off_the_view_are_not_written(void)
{
    const evs_warp_view_t view = {.width = 10u, .height = 10u, .shift = 0u, .x_px = 0, .y_px = 0};
    memset(cells, 0, sizeof cells);
    static const int16_t OFF[][2] = {{-1, 50}, {50, -1}, {9 * 16, 50}, {50, 9 * 16}, {-32752, 32752}, {32752, -32752}};
    for (size_t i = 0; i < 6u; i++) {
        const evs_warp_event_t ev = {.x_q4 = OFF[i][0], .y_q4 = OFF[i][1], .dt_q12 = 0};
        (void)evs_warp_vote(&view, cells, &ev, 1u, 1u, 0, 0);
    }
    for (size_t i = 0u; i < 200u; i++) { TEST_ASSERT_EQUAL_UINT16(0u, cells[i]); }
    const evs_warp_event_t last = {.x_q4 = 9 * 16 - 1, .y_q4 = 9 * 16 - 1, .dt_q12 = 0};
    (void)evs_warp_vote(&view, cells, &last, 1u, 1u, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(225u, cells[9 * 10 + 9]);
}

/* --- settings --------------------------------------------------------------------------------------------------- */

static void test_init_names_the_fault_and_leaves_the_context_alone(void)
{
    evs_warp_config_t cfg[24];
    evs_status_t want[24];
    for (size_t i = 0; i < 24u; i++) {
        cfg[i] = config(EVS_WARP_TILED, EVS_WARP_GRADIENT);
        want[i] = EVS_ERR_ARG;
    }
    cfg[0].kind = (evs_warp_kind_t)3;
    cfg[1].cost = (evs_warp_cost_t)2;
    cfg[2].width_px = 15u;
    cfg[3].height_px = 15u;
    cfg[4].width_px = 2049u;
    cfg[5].height_px = 2049u;
    cfg[6].n_cols = 0u;
    cfg[7].n_rows = 0u;
    cfg[8].n_cols = 64u;
    cfg[9].n_budget = 0u;
    cfg[10].n_budget = 65536u;
    cfg[11].n_min = 1u;
    cfg[12].max_px = 1u;
    cfg[13].max_px = 33u;
    cfg[14].shift = 0u;
    cfg[15].shift = 5u;
    cfg[16].noise_percent = 1001u;
    cfg[17].max_px = 32u;
    cfg[17].n_min = 65535u;
    cfg[17].noise_percent = 1000u;
    want[17] = EVS_OK;
    cfg[18].shift = 4u;
    cfg[18].max_px = 2u;
    cfg[18].n_min = 2u;
    cfg[18].noise_percent = 0u;
    want[18] = EVS_OK;
    cfg[19].kind = EVS_WARP_PREDICTED;
    want[19] = EVS_OK;
    cfg[20].kind = EVS_WARP_GLOBAL;
    want[20] = EVS_OK;
    cfg[21].width_px = 16u;
    cfg[21].height_px = 16u;
    want[21] = EVS_OK;
    cfg[22].n_cols = 64u;
    cfg[22].n_rows = 1u;
    want[22] = EVS_OK;
    cfg[23].n_budget = 1u;
    want[23] = EVS_OK;
    for (size_t i = 0; i < 24u; i++) {
        evs_warp_t fresh = {.n_cells = 7u};
        TEST_ASSERT_EQUAL_INT(want[i], evs_warp_init(&fresh, &cfg[i], memory, sizeof memory));
        TEST_ASSERT_EQUAL_INT(want[i] == EVS_OK, fresh.n_cells != 7u);
    }
    evs_warp_config_t good = config(EVS_WARP_GLOBAL, EVS_WARP_MEAN_SQUARE);
    const size_t needed = EVS_WARP_BYTES(W, H, BUDGET, 16u, 1u);
    TEST_ASSERT_EQUAL_UINT(needed, evs_warp_bytes(&good));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_warp_init(NULL, &good, memory, sizeof memory));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_warp_init(&warp, NULL, memory, sizeof memory));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_warp_init(&warp, &good, NULL, sizeof memory));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_warp_init(&warp, &good, (uint8_t *)memory + 1, sizeof memory));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_warp_init(&warp, &good, memory, needed - 1u));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_warp_init(&warp, &good, memory, needed));
    good.kind = EVS_WARP_PREDICTED;
    TEST_ASSERT_EQUAL_UINT(0u, evs_warp_bytes(&good));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_warp_init(&warp, &good, NULL, 0u));
}

static void test_defaults_fit_what_the_header_says(void)
{
    const evs_warp_config_t one = evs_warp_config_default(EVS_WARP_GLOBAL, 240, 180);
    const evs_warp_config_t tiled = evs_warp_config_default(EVS_WARP_TILED, 240, 180);
    TEST_ASSERT_EQUAL_UINT32(6000u, one.n_budget);
    TEST_ASSERT_EQUAL_UINT32(16000u, tiled.n_budget);
    TEST_ASSERT_EQUAL_UINT16(500u, one.n_min);
    TEST_ASSERT_EQUAL_UINT16(40u, tiled.n_min);
    TEST_ASSERT_EQUAL_INT(EVS_WARP_MEAN_SQUARE, tiled.cost);
    TEST_ASSERT_EQUAL_UINT16(32u, tiled.max_px);
    TEST_ASSERT_EQUAL_UINT16(8u, tiled.n_cols);
    TEST_ASSERT_EQUAL_UINT16(6u, tiled.n_rows);
    TEST_ASSERT_TRUE(evs_warp_bytes(&one) < 67000u);
    TEST_ASSERT_TRUE(evs_warp_bytes(&tiled) < 127000u);
}

/* --- one velocity ------------------------------------------------------------------------------------------------ */

static void test_one_velocity_is_recovered(void)
{
    static const double MOTIONS[][2] = {{1.2, 0.6}, {-3.0, 2.0}, {0.3, -5.5}, {9.0, 7.0}, {-13.5, 3.0}};
    double sum = 0.0;
    for (size_t m = 0; m < sizeof MOTIONS / sizeof MOTIONS[0]; m++) {
        for (int cost = 0; cost < 2; cost++) {
            const evs_warp_config_t cfg = config(EVS_WARP_GLOBAL, (evs_warp_cost_t)cost);
            init(&cfg);
            one_x = MOTIONS[m][0];
            one_y = MOTIONS[m][1];
            make_scene(4000u, 150u, 20u, one_motion, 5000u);
            estimate(4000u);
            TEST_ASSERT_EQUAL_HEX32(0u, result.flags);
            TEST_ASSERT_TRUE_MESSAGE(mean_error(one_motion) < 0.4, "off by 0.4 px over the window");
            sum += mean_error(one_motion);
            TEST_ASSERT_EQUAL_INT16(result.global.x_px_s_q3, evs_flow_grid_tile(&flow, 3u, 2u).x_px_s_q3);
            TEST_ASSERT_EQUAL_INT16(result.global.x_px_s_q3, evs_flow_grid_global(&flow).x_px_s_q3);
            TEST_ASSERT_TRUE(result.gain_q16 > 65536u);
            const double ratio = 65536.0 * (double)result.contrast_after / (double)result.contrast_before;
            TEST_ASSERT_TRUE(fabs(result.gain_q16 - ratio) < 2.0);
        }
    }
    TEST_ASSERT_TRUE_MESSAGE(sum < 10.0 * 0.15, "off by 0.15 px on average");
}

static void test_the_search_finds_what_brute_force_finds(void)
{
    const evs_warp_config_t cfg = config(EVS_WARP_GLOBAL, EVS_WARP_MEAN_SQUARE);
    init(&cfg);
    one_x = 4.3;
    one_y = -2.1;
    make_scene(2000u, 60u, 30u, one_motion, 0u);
    estimate(2000u);
    TEST_ASSERT_EQUAL_UINT32(2000u, result.n_events);
    const evs_warp_view_t view = {
        .width = EVS_WARP_SIDE(W, 16u, 1u), .height = EVS_WARP_SIDE(H, 16u, 1u), .shift = 1u, .x_px = -9, .y_px = -9};
    double best = 0.0;
    for (int dy = -7; dy <= 3; dy++) { /* every half pixel around the truth, and a coarse look at the rest */
        for (int dx = 5; dx <= 12; dx++) {
            best = fmax(best, model_contrast(&view, warp.events, 2000u, dx / 2.0, dy / 2.0, EVS_WARP_MEAN_SQUARE));
        }
    }
    for (int dy = -16; dy <= 16; dy += 4) {
        for (int dx = -16; dx <= 16; dx += 4) {
            best = fmax(best, model_contrast(&view, warp.events, 2000u, dx, dy, EVS_WARP_MEAN_SQUARE));
        }
    }
    const double before = model_contrast(&view, warp.events, 2000u, 0.0, 0.0, EVS_WARP_MEAN_SQUARE);
    TEST_ASSERT_TRUE((double)result.contrast_after / 65536.0 > 0.995 * best);
    TEST_ASSERT_TRUE(fabs((double)result.contrast_before / 65536.0 - before) < 0.005 * before);
    TEST_ASSERT_TRUE(result.n_evaluations <= 30u);
}

static void test_a_still_scene_gives_no_velocity(void)
{
    one_x = 0.0;
    one_y = 0.0;
    for (int kind = EVS_WARP_GLOBAL; kind <= EVS_WARP_TILED; kind++) {
        for (int cost = 0; cost < 2; cost++) {
            const evs_warp_config_t cfg = config((evs_warp_kind_t)kind, (evs_warp_cost_t)cost);
            init(&cfg);
            make_scene(4000u, 150u, 20u, one_motion, 0u);
            estimate(4000u);
            TEST_ASSERT_TRUE(mean_error(one_motion) < 0.2);
            TEST_ASSERT_TRUE(result.contrast_after >= result.contrast_before);
        }
    }
}

static void test_noise_gives_no_velocity(void)
{
    static const size_t N[] = {600u, 1500u, 6000u};
    for (size_t k = 0u; k < 3u; k++) {
        for (int trial = 0; trial < 6; trial++) {
            const int kind = 1 + trial % 2;
            evs_warp_config_t cfg = config((evs_warp_kind_t)kind, (evs_warp_cost_t)(trial / 2 % 2));
            init(&cfg);
            make_scene(N[k], 0u, 100u, one_motion, 0u);
            estimate(N[k]);
            TEST_ASSERT_EQUAL_HEX32(EVS_WARP_FLAT | ((kind == EVS_WARP_TILED) ? EVS_WARP_ONE : 0u), result.flags);
            TEST_ASSERT_EQUAL_UINT32(65536u, result.gain_q16);
            TEST_ASSERT_EQUAL_UINT64(result.contrast_before, result.contrast_after);
            one_x = 0.0;
            one_y = 0.0;
            TEST_ASSERT_TRUE(mean_error(one_motion) == 0.0);
            cfg.noise_percent = 0u; /* asked for, the rise by chance is an answer */
            init(&cfg);
            estimate(N[k]);
            TEST_ASSERT_EQUAL_HEX32(0u, result.flags);
            TEST_ASSERT_TRUE(result.gain_q16 > 65536u);
        }
    }
}

static void test_few_events_are_no_estimate(void)
{
    for (int kind = EVS_WARP_GLOBAL; kind <= EVS_WARP_TILED; kind++) {
        evs_warp_config_t cfg = config((evs_warp_kind_t)kind, EVS_WARP_MEAN_SQUARE);
        cfg.n_min = 300u;
        init(&cfg);
        one_x = 3.0;
        make_scene(300u, 20u, 0u, one_motion, 0u);
        points[5] = evs_point_outside();
        estimate(300u);
        TEST_ASSERT_EQUAL_HEX32(EVS_WARP_FEW, result.flags);
        TEST_ASSERT_EQUAL_UINT32(299u, result.n_events);
        TEST_ASSERT_EQUAL_UINT32(0u, result.gain_q16);
        TEST_ASSERT_EQUAL_INT16(0, evs_flow_grid_at(&flow, points[0]).x_px_s_q3);
        estimate(0u);
        TEST_ASSERT_EQUAL_HEX32(EVS_WARP_FEW, result.flags);
        TEST_ASSERT_EQUAL_UINT32(0u, result.n_events);
        make_scene(3000u, 20u, 0u, one_motion, 0u);
        for (size_t i = 0u; i < 3000u; i++) { events[i].t_us = 77u; } /* all at once */
        estimate(3000u);
        TEST_ASSERT_EQUAL_HEX32(EVS_WARP_FEW, result.flags);
        events[0].t_us = 78u; /* the clock has run back */
        estimate(3000u);
        TEST_ASSERT_EQUAL_HEX32(EVS_WARP_FEW, result.flags);
    }
}

static void test_times_that_wrap_or_leave_the_window_do_no_harm(void)
{
    const evs_warp_config_t cfg = config(EVS_WARP_GLOBAL, EVS_WARP_MEAN_SQUARE);
    init(&cfg);
    one_x = -3.3;
    one_y = 1.4;
    make_scene(3000u, 100u, 20u, one_motion, 0u);
    estimate(3000u);
    const evs_flow_velocity_t want = result.global;
    TEST_ASSERT_TRUE(mean_error(one_motion) < 0.25);
    for (size_t i = 0u; i < 3000u; i++) { events[i].t_us += UINT32_C(0xFFFFD000); }
    estimate(3000u);
    TEST_ASSERT_EQUAL_INT16(want.x_px_s_q3, result.global.x_px_s_q3);
    TEST_ASSERT_EQUAL_INT16(want.y_px_s_q3, result.global.y_px_s_q3);
    events[100].t_us += UINT32_C(0x70000000);
    events[200].t_us -= UINT32_C(0x70000000);
    estimate(3000u);
    for (size_t i = 0u; i < 3000u; i++) { TEST_ASSERT_INT_WITHIN(2048, 0, warp.events[i].dt_q12); }
    TEST_ASSERT_TRUE(mean_error(one_motion) < 0.25);
}

static void test_of_more_events_than_the_budget_every_kth_is_looked_at(void)
{
    evs_warp_config_t cfg = config(EVS_WARP_GLOBAL, EVS_WARP_MEAN_SQUARE);
    cfg.n_budget = 2000u;
    init(&cfg);
    memory[EVS_WARP_BYTES(W, H, 2000u, 16u, 1u) / 2u] = 0x5A5Au;
    one_x = 5.0;
    one_y = 0.0;
    make_scene(6500u, 120u, 20u, one_motion, 0u);
    estimate(6500u);
    TEST_ASSERT_EQUAL_UINT32(1625u, result.n_events); /* every fourth */
    TEST_ASSERT_TRUE(mean_error(one_motion) < 0.25);
    TEST_ASSERT_EQUAL_HEX16_MESSAGE(0x5A5A, memory[EVS_WARP_BYTES(W, H, 2000u, 16u, 1u) / 2u], "wrote past memory");
    const evs_warp_result_t kept = result;
    for (size_t i = 0u; i < 1625u; i++) { /* these alone give the same */
        events[i] = events[4u * i];
        points[i] = points[4u * i];
    }
    events[1624].t_us = SPAN_US; /* its own time is a little before the end of the window */
    estimate(1625u);
    TEST_ASSERT_EQUAL_UINT32(1625u, result.n_events);
    TEST_ASSERT_TRUE(abs(kept.global.x_px_s_q3 - result.global.x_px_s_q3) < 16);
}

static void test_points_off_the_image_do_not_take_part(void)
{
    const evs_warp_config_t cfg = config(EVS_WARP_TILED, EVS_WARP_MEAN_SQUARE);
    init(&cfg);
    make_scene(3000u, 150u, 20u, two_halves, 0u);
    estimate(3000u);
    TEST_ASSERT_TRUE(result.n_events <= 3000u);
    const evs_warp_result_t kept = result;
    const evs_flow_grid_t kept_flow = flow;
    size_t n = 6000u; /* every second one is off the image */
    for (size_t i = 3000u; i-- > 0u;) {
        events[2u * i + 1u] = events[i];
        points[2u * i + 1u] = points[i];
        events[2u * i] = events[2u * i + 1u];
        points[2u * i] = evs_point_outside();
        if (i % 3u == 0u) { points[2u * i].x_q4 = -9, points[2u * i].y_q4 = 100; }
        if (i % 3u == 1u) { points[2u * i].x_q4 = 100, points[2u * i].y_q4 = 16 * H - 8; }
    }
    estimate(n);
    TEST_ASSERT_EQUAL_MEMORY(&kept_flow, &flow, sizeof flow);
    TEST_ASSERT_EQUAL_UINT64(kept.contrast_after, result.contrast_after);
    TEST_ASSERT_EQUAL_UINT32(kept.n_evaluations, result.n_evaluations);
}

static void test_events_are_spread_over_their_pixels(void)
{
    const evs_warp_config_t cfg = config(EVS_WARP_GLOBAL, EVS_WARP_MEAN_SQUARE);
    init(&cfg);
    make_scene(4000u, 100u, 20u, one_motion, 0u);
    estimate(4000u);
    uint32_t count[4][4] = {{0}};
    for (size_t i = 0u; i < 4000u; i++) {
        const int32_t dx_q4 = warp.events[i].x_q4 - points[i].x_q4 + 8;
        const int32_t dy_q4 = warp.events[i].y_q4 - points[i].y_q4 + 8;
        TEST_ASSERT_TRUE((dx_q4 >= 0) && (dx_q4 < 16) && (dy_q4 >= 0) && (dy_q4 < 16));
        count[dy_q4 / 4][dx_q4 / 4]++;
    }
    for (int k = 0; k < 16; k++) { TEST_ASSERT_UINT32_WITHIN(60u, 250u, count[k / 4][k % 4]); }
}

static void test_a_hot_pixel_does_not_wrap_the_contrast(void)
{
    const evs_warp_config_t cfg = config(EVS_WARP_GLOBAL, EVS_WARP_MEAN_SQUARE);
    init(&cfg);
    one_x = 4.0;
    one_y = 2.0;
    make_scene(6000u, 100u, 20u, one_motion, 0u);
    for (size_t i = 0u; i < 6000u; i += 3u) { points[i] = (evs_point_t){16 * 50, 16 * 40}; }
    estimate(6000u);
    const evs_warp_view_t view = {.width = EVS_WARP_SIDE(W, 16u, 1u),
                                  .height = EVS_WARP_SIDE(H, 16u, 1u),
                                  .shift = 1u,
                                  .x_px = -(int32_t)EVS_WARP_MARGIN_PX(16u),
                                  .y_px = -(int32_t)EVS_WARP_MARGIN_PX(16u)};
    memset(cells, 0, sizeof cells);
    TEST_ASSERT_FALSE(evs_warp_vote(&view, cells, warp.events, 6000u, 1u, 0, 0));
    memset(cells, 0, sizeof cells);
    evs_warp_vote_limited(&view, cells, warp.events, 6000u, 1u, 0, 0);
    TEST_ASSERT_EQUAL_UINT64(evs_warp_contrast(&view, cells, EVS_WARP_MEAN_SQUARE), result.contrast_before);
}

/* --- tiles ------------------------------------------------------------------------------------------------------- */

static void test_tiles_recover_what_one_velocity_cannot(void)
{
    static const motion_t MOTIONS[] = {two_halves, diverging};
    for (int m = 0; m < 2; m++) {
        for (int cost = 0; cost < 2; cost++) {
            evs_warp_config_t cfg = config(EVS_WARP_TILED, (evs_warp_cost_t)cost);
            init(&cfg);
            make_scene(6000u, 300u, 20u, MOTIONS[m], 123u);
            estimate(6000u);
            TEST_ASSERT_EQUAL_HEX32(0u, result.flags);
            TEST_ASSERT_TRUE_MESSAGE(mean_error(MOTIONS[m]) < 0.45, "tiles off by 0.45 px over the window");
            TEST_ASSERT_TRUE(result.gain_q16 > 65536u + 65536u / 10u);
            const double tiled_error = mean_error(MOTIONS[m]);
            const evs_flow_velocity_t all = result.global;
            cfg.kind = EVS_WARP_GLOBAL;
            init(&cfg);
            estimate(6000u);
            if (result.flags == EVS_WARP_FLAT) { /* what tiles begin with is not to be believed either */
                TEST_ASSERT_EQUAL_INT16(0, all.x_px_s_q3);
                TEST_ASSERT_EQUAL_INT16(0, all.y_px_s_q3);
            }
            TEST_ASSERT_TRUE(mean_error(MOTIONS[m]) > 4.0 * tiled_error);
        }
    }
}

static void test_tiles_of_one_motion_agree(void)
{
    one_x = 6.0;
    one_y = -4.0;
    for (int cost = 0; cost < 2; cost++) {
        const evs_warp_config_t cfg = config(EVS_WARP_TILED, (evs_warp_cost_t)cost);
        init(&cfg);
        make_scene(6000u, 300u, 20u, one_motion, 123u);
        estimate(6000u);
        TEST_ASSERT_EQUAL_HEX32(0u, result.flags & ~EVS_WARP_ONE);
        TEST_ASSERT_TRUE(mean_error(one_motion) < 0.3);
    }
}

/* The sum over the tiles of the contrast of their events, moved by the flow or not. Views reach further than they need. */
static double contrast_of_tiles(evs_warp_cost_t cost, bool is_moved)
{
    double sum = 0.0;
    for (int32_t t = 0; t < 12; t++) {
        const evs_warp_view_t view = {
            .width = 70u, .height = 70u, .shift = 0u, .x_px = 30 * (t % 4) - 20, .y_px = 30 * (t / 4) - 20};
        const evs_warp_event_t *const ev = warp.events + warp.first[t];
        const size_t n = (size_t)(warp.first[t + 1] - warp.first[t]);
        if (n < warp.cfg.n_min) { continue; }
        for (size_t i = 0u; i < n; i++) { /* of this tile, but for half a pixel */
            TEST_ASSERT_INT_WITHIN(16 * 15 + 8, 16 * (30 * (t % 4) + 15) - 8, ev[i].x_q4);
            TEST_ASSERT_INT_WITHIN(16 * 15 + 8, 16 * (30 * (t / 4) + 15) - 8, ev[i].y_q4);
        }
        const evs_flow_velocity_t v = evs_flow_grid_tile(&flow, (uint16_t)(t % 4), (uint16_t)(t / 4));
        const int32_t dx_q6 = is_moved ? (int32_t)lround(64.0 * over_window(v.x_px_s_q3)) : 0;
        const int32_t dy_q6 = is_moved ? (int32_t)lround(64.0 * over_window(v.y_px_s_q3)) : 0;
        sum += (double)contrast_of(&view, ev, n, dx_q6, dy_q6, cost);
    }
    return sum;
}

static void test_contrast_of_tiles_is_that_of_their_events(void)
{
    for (int cost = 0; cost < 2; cost++) {
        const evs_warp_config_t cfg = config(EVS_WARP_TILED, (evs_warp_cost_t)cost);
        init(&cfg);
        make_scene(6000u, 300u, 20u, diverging, 0u);
        estimate(6000u);
        TEST_ASSERT_EQUAL_HEX32(0u, result.flags);
        const double after = contrast_of_tiles(cfg.cost, true);
        TEST_ASSERT_EQUAL_UINT64((uint64_t)contrast_of_tiles(cfg.cost, false), result.contrast_before);
        TEST_ASSERT_TRUE(fabs(after - (double)result.contrast_after) < 0.002 * after);
    }
}

static void test_tiles_of_too_few_events_move_as_one(void)
{
    const evs_warp_config_t cfg = config(EVS_WARP_TILED, EVS_WARP_MEAN_SQUARE);
    init(&cfg);
    one_x = 3.0;
    one_y = -2.0;
    int n_one = 0;
    for (int trial = 0; trial < 12; trial++) {
        make_scene(800u, 60u, 60u, one_motion, 0u);
        estimate(800u);
        if (result.flags != EVS_WARP_ONE) { continue; }
        n_one++;
        for (uint16_t t = 0u; t < 12u; t++) {
            TEST_ASSERT_EQUAL_MEMORY(&result.global, &flow.tiles[t], sizeof result.global);
        }
        TEST_ASSERT_TRUE(mean_error(one_motion) < 0.8);
        const double after = contrast_of_tiles(cfg.cost, true);
        TEST_ASSERT_TRUE(fabs(after - (double)result.contrast_after) < 0.002 * after);
        TEST_ASSERT_TRUE(result.gain_q16 > 65536u);
    }
    TEST_ASSERT_TRUE(n_one >= 3);
}

static void test_noise_moves_tiles_by_little(void)
{
    evs_warp_config_t cfg = config(EVS_WARP_TILED, EVS_WARP_MEAN_SQUARE);
    cfg.noise_percent = 0u;
    init(&cfg);
    double sum = 0.0;
    for (int trial = 0; trial < 5; trial++) {
        make_scene(6000u, 0u, 100u, one_motion, 0u);
        estimate(6000u);
        one_x = over_window(result.global.x_px_s_q3);
        one_y = over_window(result.global.y_px_s_q3);
        sum += mean_error(one_motion);
    }
    TEST_ASSERT_TRUE_MESSAGE(sum < 5.0 * 1.6, "nothing holds a tile: 1.1 px with what holds it, 2.5 px without");
}

static void test_tiles_with_few_events_follow_their_parents(void)
{
    evs_warp_config_t cfg = config(EVS_WARP_TILED, EVS_WARP_MEAN_SQUARE);
    cfg.noise_percent = 0u;
    init(&cfg);
    one_x = 4.0;
    one_y = 1.0;
    make_scene(4000u, 150u, 0u, one_motion, 0u);
    size_t n = 0u; /* nothing in the right quarter */
    for (size_t i = 0u; i < 4000u; i++) {
        if (points[i].x_q4 >= 16 * 88) { continue; }
        events[n] = events[i];
        points[n++] = points[i];
    }
    estimate(n);
    TEST_ASSERT_EQUAL_HEX32(0u, result.flags);
    TEST_ASSERT_TRUE(mean_error(one_motion) < 0.4);
}

static void test_a_part_that_stands_still_is_left_alone(void)
{
    for (int cost = 0; cost < 2; cost++) {
        const evs_warp_config_t cfg = config(EVS_WARP_TILED, (evs_warp_cost_t)cost);
        init(&cfg);
        make_scene(6000u, 300u, 20u, right_part_still, 0u);
        estimate(6000u);
        TEST_ASSERT_EQUAL_HEX32(0u, result.flags);
        for (uint16_t row = 0u; row < 3u; row++) {
            const evs_flow_velocity_t v = evs_flow_grid_tile(&flow, 3u, row);
            TEST_ASSERT_TRUE(hypot(over_window(v.x_px_s_q3), over_window(v.y_px_s_q3)) < 0.5);
        }
    }
}

static void test_contrast_never_falls(void)
{
    static const motion_t MOTIONS[] = {two_halves, diverging, one_motion};
    one_x = 14.0;
    one_y = 14.0;
    for (int trial = 0; trial < 12; trial++) {
        evs_warp_config_t cfg = config((evs_warp_kind_t)(1 + trial % 2), (evs_warp_cost_t)(trial / 2 % 2));
        cfg.noise_percent = (trial % 3 == 0) ? 0u : 100u;
        cfg.max_px = (trial % 4 == 0) ? 3u : 16u;
        init(&cfg);
        make_scene(1500u, 100u, 50u, MOTIONS[trial % 3], 0u);
        estimate(1500u);
        TEST_ASSERT_TRUE(result.contrast_after >= result.contrast_before);
        const uint32_t limit = (uint32_t)(cfg.max_px * 8.0 / SPAN_US * 1e6 + 1.0);
        for (uint16_t t = 0u; t < 12u; t++) {
            const evs_flow_velocity_t v = evs_flow_grid_tile(&flow, t % 4u, t / 4u);
            TEST_ASSERT_INT_WITHIN(limit, 0, v.x_px_s_q3);
            TEST_ASSERT_INT_WITHIN(limit, 0, v.y_px_s_q3);
        }
    }
}

/* Contrast of n points, each anywhere in its pixel: in the middle they would be sharpest where they are. */
static double image_contrast(const evs_point_t *at, size_t n)
{
    static evs_warp_event_t ev[MAX_EVENTS];
    const evs_warp_view_t view = {.width = W + 20u, .height = H + 20u, .shift = 0u, .x_px = -10, .y_px = -10};
    size_t k = 0u;
    seed = 7u; /* the same places in every image */
    for (size_t i = 0u; i < n; i++) {
        const int32_t dx_q4 = (int32_t)(next_random() % 16u) - 8;
        const int32_t dy_q4 = (int32_t)(next_random() % 16u) - 8;
        if (evs_point_is_outside(at[i])) { continue; }
        ev[k++] = (evs_warp_event_t){.x_q4 = (int16_t)(at[i].x_q4 + dx_q4), .y_q4 = (int16_t)(at[i].y_q4 + dy_q4)};
    }
    return model_contrast(&view, ev, k, 0.0, 0.0, EVS_WARP_MEAN_SQUARE);
}

static void test_moving_events_by_the_estimate_sharpens_the_image(void)
{
    static const motion_t MOTIONS[] = {two_halves, diverging, one_motion};
    one_x = 3.0;
    one_y = 5.0;
    for (int m = 0; m < 3; m++) {
        const evs_warp_config_t cfg = config(EVS_WARP_TILED, EVS_WARP_MEAN_SQUARE);
        init(&cfg);
        make_scene(6000u, 200u, 10u, MOTIONS[m], UINT32_MAX - 9000u);
        estimate(6000u);
        TEST_ASSERT_EQUAL_HEX32(0u, result.flags & ~EVS_WARP_ONE);
        evs_warp_map(&flow, events, points, 6000u, events[3000].t_us, moved);
        TEST_ASSERT_TRUE(image_contrast(moved, 6000u) > 1.15 * image_contrast(points, 6000u));
    }
}

/* --- the initial grid -------------------------------------------------------------------------------------------- */

static void test_the_initial_grid_is_where_the_search_begins_and_what_is_left_without_an_estimate(void)
{
    evs_flow_grid_t initial;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_flow_grid_init(&initial, W, H, 2u, 1u));
    evs_flow_grid_set_tile(&initial, 0u, 0u, (evs_flow_velocity_t){400, -100});
    evs_flow_grid_set_tile(&initial, 1u, 0u, (evs_flow_velocity_t){600, 100});
    evs_warp_config_t cfg = config(EVS_WARP_TILED, EVS_WARP_MEAN_SQUARE);
    init(&cfg);
    make_scene(2000u, 0u, 100u, one_motion, 0u);
    evs_warp_estimate(&warp, events, points, 2000u, &initial, &flow, &result);
    TEST_ASSERT_EQUAL_HEX32(EVS_WARP_FLAT | EVS_WARP_ONE, result.flags);
    TEST_ASSERT_EQUAL_MEMORY(&initial, &flow, sizeof flow);
    TEST_ASSERT_EQUAL_INT16(500, result.global.x_px_s_q3);
    TEST_ASSERT_EQUAL_INT16(0, result.global.y_px_s_q3);
    evs_warp_estimate(&warp, events, points, 0u, &initial, &flow, &result);
    TEST_ASSERT_EQUAL_HEX32(EVS_WARP_FEW, result.flags);
    TEST_ASSERT_EQUAL_MEMORY(&initial, &flow, sizeof flow);

    /* Velocities too different for the tiles to get there from a common one. */
    make_scene(6000u, 300u, 20u, far_apart, 0u);
    estimate(6000u);
    TEST_ASSERT_TRUE(mean_error(far_apart) > 1.2);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_flow_grid_init(&flow, W, H, 4u, 1u));
    for (uint16_t t = 0u; t < 4u; t++) { /* 1 px short */
        evs_flow_grid_set_tile(&flow, t, 0u, (evs_flow_velocity_t){(t < 2u) ? -2800 : 2800, 0});
    }
    evs_warp_estimate(&warp, events, points, 6000u, &flow, &flow, &result);
    TEST_ASSERT_EQUAL_HEX32(0u, result.flags);
    TEST_ASSERT_EQUAL_UINT8(3u, flow.n_rows);
    TEST_ASSERT_TRUE(mean_error(far_apart) < 0.6);
}

static void test_predicted_passes_the_initial_grid_on(void)
{
    const evs_warp_config_t cfg = config(EVS_WARP_PREDICTED, EVS_WARP_MEAN_SQUARE);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_warp_init(&warp, &cfg, NULL, 0u));
    evs_flow_grid_t initial;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_flow_grid_init(&initial, W, H, 3u, 3u));
    evs_flow_grid_set_all(&initial, (evs_flow_velocity_t){-88, 99});
    evs_warp_estimate(&warp, events, points, 100u, &initial, &flow, &result);
    TEST_ASSERT_EQUAL_MEMORY(&initial, &flow, sizeof flow);
    TEST_ASSERT_EQUAL_HEX32(0u, result.flags);
    TEST_ASSERT_EQUAL_INT16(-88, result.global.x_px_s_q3);
    TEST_ASSERT_EQUAL_INT16(99, result.global.y_px_s_q3);
    evs_warp_estimate(&warp, NULL, NULL, 0u, NULL, &flow, &result);
    TEST_ASSERT_EQUAL_UINT8(4u, flow.n_cols);
    TEST_ASSERT_EQUAL_INT16(0, evs_flow_grid_at(&flow, points[0]).x_px_s_q3);
}

/* --- moving events ----------------------------------------------------------------------------------------------- */

static void test_map_moves_points_by_flow_and_time(void)
{
    evs_flow_grid_t grid;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_flow_grid_init(&grid, W, H, 3u, 2u));
    for (uint16_t t = 0u; t < 6u; t++) {
        evs_flow_grid_set_tile(&grid, t % 3u, t / 3u,
                               (evs_flow_velocity_t){(int16_t)(next_random() % 16000u - 8000u),
                                                     (int16_t)(next_random() % 16000u - 8000u)});
    }
    evs_flow_grid_set_tile(&grid, 0u, 0u, (evs_flow_velocity_t){3000, 3000}); /* where EVS_POINT_OUTSIDE would lie */
    const uint32_t t_ref = 5000u;
    for (size_t i = 0u; i < 1000u; i++) {
        events[i] = evs_event_make(t_ref - 60000u + next_random() % 120000u, 0u, 0u, false); /* across the wrap */
        points[i].x_q4 = (int16_t)(next_random() % (16u * W));
        points[i].y_q4 = (int16_t)(next_random() % (16u * H));
    }
    for (size_t i = 0u; i < 1000u; i += 50u) { points[i] = evs_point_outside(); } /* wherever the flow goes */
    evs_warp_map(&grid, events, points, 1000u, t_ref, moved);
    for (size_t i = 0u; i < 1000u; i++) {
        if (i % 50u == 0u) {
            TEST_ASSERT_TRUE(evs_point_is_outside(moved[i]));
            continue;
        }
        const evs_flow_velocity_t v = evs_flow_grid_at(&grid, points[i]);
        const double dt_s = evs_time_diff_us(events[i].t_us, t_ref) * 1e-6;
        TEST_ASSERT_TRUE(fabs(points[i].x_q4 - dt_s * 16.0 * v.x_px_s_q3 / 8.0 - moved[i].x_q4) <= 0.51);
        TEST_ASSERT_TRUE(fabs(points[i].y_q4 - dt_s * 16.0 * v.y_px_s_q3 / 8.0 - moved[i].y_q4) <= 0.51);
    }
    evs_point_t in_place[1000];
    memcpy(in_place, points, sizeof in_place);
    evs_warp_map(&grid, events, in_place, 1000u, t_ref, in_place);
    TEST_ASSERT_EQUAL_MEMORY(moved, in_place, sizeof in_place);
    evs_warp_map(&grid, NULL, NULL, 0u, t_ref, NULL);
}

static void test_map_out_of_range_becomes_outside(void)
{
    evs_flow_grid_t grid;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_flow_grid_init(&grid, 2048u, 2048u, 1u, 1u));
    evs_flow_grid_set_all(&grid, (evs_flow_velocity_t){8, 0}); /* 1 px/s */
    const evs_point_t at = {EVS_POINT_MAX_Q4 - 16, 0};
    static const int32_t DT_S[] = {-1, -2, 0, 2000, 2147, -2147};
    static const bool OUTSIDE[] = {false, true, false, false, false, true};
    for (size_t axis = 0u; axis < 2u; axis++) {
        for (size_t i = 0u; i < 6u; i++) {
            events[i] = evs_event_make((uint32_t)(DT_S[i] * 1000000), 0u, 0u, false);
            points[i] = at;
            if (axis == 1u) { points[i] = (evs_point_t){0, EVS_POINT_MAX_Q4 - 16}; }
        }
        evs_warp_map(&grid, events, points, 6u, 0u, moved);
        for (size_t i = 0u; i < 6u; i++) {
            TEST_ASSERT_EQUAL_INT(OUTSIDE[i], evs_point_is_outside(moved[i]));
            TEST_ASSERT_EQUAL_INT(OUTSIDE[i], moved[i].y_q4 == EVS_POINT_OUTSIDE_Q4);
        }
        TEST_ASSERT_EQUAL_INT16(EVS_POINT_MAX_Q4, (axis == 0u) ? moved[0].x_q4 : moved[0].y_q4);
        evs_flow_grid_set_all(&grid, (evs_flow_velocity_t){0, 8});
    }
}

/* --- shapes ------------------------------------------------------------------------------------------------------ */

static void test_images_and_tiles_of_any_shape_stay_within_memory(void)
{
    static const uint16_t SHAPES[][6] = {/* width, height, columns, rows, max_px, shift */
                                         {16, 16, 1, 1, 32, 1},  {16, 16, 8, 8, 32, 4},  {120, 16, 64, 1, 2, 1},
                                         {17, 90, 1, 64, 31, 2}, {119, 89, 7, 5, 16, 3}, {33, 47, 3, 2, 8, 1}};
    static uint16_t exact[EVS_WARP_BYTES(W, H, 500u, EVS_WARP_MAX_PX, 1u) / 2u + 1u];
    for (size_t s = 0u; s < sizeof SHAPES / sizeof SHAPES[0]; s++) {
        for (int cost = 0; cost < 2; cost++) {
            evs_warp_config_t cfg = evs_warp_config_default(EVS_WARP_TILED, SHAPES[s][0], SHAPES[s][1]);
            cfg.cost = (evs_warp_cost_t)cost;
            cfg.n_cols = SHAPES[s][2];
            cfg.n_rows = SHAPES[s][3];
            cfg.max_px = SHAPES[s][4];
            cfg.shift = SHAPES[s][5];
            cfg.n_budget = 500u;
            cfg.n_min = 2u;
            cfg.noise_percent = 0u;
            const size_t n_bytes = evs_warp_bytes(&cfg);
            TEST_ASSERT_TRUE(n_bytes + 2u <= sizeof exact);
            exact[n_bytes / 2u] = 0x1234u;
            TEST_ASSERT_EQUAL_INT(EVS_OK, evs_warp_init(&warp, &cfg, exact, n_bytes));
            for (size_t i = 0u; i < 500u; i++) {
                events[i] = evs_event_make((uint32_t)(10u * i), 0u, 0u, false);
                points[i].x_q4 = (int16_t)((int32_t)(next_random() % (16u * SHAPES[s][0])) - 8);
                points[i].y_q4 = (int16_t)((int32_t)(next_random() % (16u * SHAPES[s][1])) - 8);
            }
            estimate(500u);
            TEST_ASSERT_EQUAL_UINT32(500u, result.n_events);
            TEST_ASSERT_TRUE(result.contrast_after >= result.contrast_before);
            TEST_ASSERT_EQUAL_HEX16_MESSAGE(0x1234, exact[n_bytes / 2u], "wrote past memory");
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_contrast_agrees_with_the_model);
    RUN_TEST(test_one_event_is_shared_by_four_cells);
    RUN_TEST(test_positions_are_rounded_to_a_sixteenth_of_a_cell);
    RUN_TEST(test_a_hot_pixel_is_noticed_and_limited);
    RUN_TEST(test_events_off_the_view_are_not_written);
    RUN_TEST(test_init_names_the_fault_and_leaves_the_context_alone);
    RUN_TEST(test_defaults_fit_what_the_header_says);
    RUN_TEST(test_one_velocity_is_recovered);
    RUN_TEST(test_the_search_finds_what_brute_force_finds);
    RUN_TEST(test_a_still_scene_gives_no_velocity);
    RUN_TEST(test_noise_gives_no_velocity);
    RUN_TEST(test_few_events_are_no_estimate);
    RUN_TEST(test_times_that_wrap_or_leave_the_window_do_no_harm);
    RUN_TEST(test_of_more_events_than_the_budget_every_kth_is_looked_at);
    RUN_TEST(test_points_off_the_image_do_not_take_part);
    RUN_TEST(test_events_are_spread_over_their_pixels);
    RUN_TEST(test_a_hot_pixel_does_not_wrap_the_contrast);
    RUN_TEST(test_tiles_recover_what_one_velocity_cannot);
    RUN_TEST(test_tiles_of_one_motion_agree);
    RUN_TEST(test_tiles_of_too_few_events_move_as_one);
    RUN_TEST(test_noise_moves_tiles_by_little);
    RUN_TEST(test_tiles_with_few_events_follow_their_parents);
    RUN_TEST(test_contrast_of_tiles_is_that_of_their_events);
    RUN_TEST(test_a_part_that_stands_still_is_left_alone);
    RUN_TEST(test_contrast_never_falls);
    RUN_TEST(test_moving_events_by_the_estimate_sharpens_the_image);
    RUN_TEST(test_the_initial_grid_is_where_the_search_begins_and_what_is_left_without_an_estimate);
    RUN_TEST(test_predicted_passes_the_initial_grid_on);
    RUN_TEST(test_map_moves_points_by_flow_and_time);
    RUN_TEST(test_map_out_of_range_becomes_outside);
    RUN_TEST(test_images_and_tiles_of_any_shape_stay_within_memory);
    return UNITY_END();
}
