/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/flow_grid.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { W = 240, H = 180, COLS = EVS_FLOW_GRID_COLS, ROWS = EVS_FLOW_GRID_ROWS, N_SAMPLES = 400 };

static evs_flow_grid_t grid;
static evs_flow_sample_t samples[N_SAMPLES];
static uint32_t seed;

void setUp(void)
{
    seed = 4711u;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_flow_grid_init(&grid, W, H, COLS, ROWS));
}
void tearDown(void) {}

static int32_t next_random(int32_t lo, int32_t hi)
{
    seed = seed * 1664525u + 1013904223u;
    return lo + (int32_t)((seed >> 4) % (uint32_t)(hi - lo + 1));
}

static evs_flow_velocity_t velocity(int32_t x_q3, int32_t y_q3)
{
    const evs_flow_velocity_t v = {(int16_t)x_q3, (int16_t)y_q3};
    return v;
}

static evs_point_t point(double x_px, double y_px)
{
    const evs_point_t p = {(int16_t)lround(16.0 * x_px), (int16_t)lround(16.0 * y_px)};
    return p;
}

static evs_flow_sample_t sample(double x_px, double y_px, int32_t vx_q3, int32_t vy_q3)
{
    const evs_flow_sample_t s = {point(x_px, y_px), velocity(vx_q3, vy_q3)};
    return s;
}

/* A sample in the middle of a tile of the 8 x 6 grid over 240 x 180: tiles of 30 px. */
static evs_flow_sample_t sample_in(int col, int row, int32_t vx_q3, int32_t vy_q3)
{
    return sample(30.0 * col + 14.5, 30.0 * row + 14.5, vx_q3, vy_q3);
}

static void check_velocity(int32_t x_q3, int32_t y_q3, evs_flow_velocity_t v)
{
    TEST_ASSERT_EQUAL_INT16(x_q3, v.x_px_s_q3);
    TEST_ASSERT_EQUAL_INT16(y_q3, v.y_px_s_q3);
}

static void randomize(evs_flow_grid_t *g, int32_t limit_q3)
{
    for (uint16_t r = 0u; r < g->n_rows; r++) {
        for (uint16_t c = 0u; c < g->n_cols; c++) {
            evs_flow_grid_set_tile(g, c, r,
                                   velocity(next_random(-limit_q3, limit_q3), next_random(-limit_q3, limit_q3)));
        }
    }
}

/* Bilinear interpolation in double precision, straight from the definition; component 0 is x. */
static double model_at(const evs_flow_grid_t *g, evs_point_t p, int component)
{
    double u = (p.x_q4 / 16.0 + 0.5) / g->width_px * g->n_cols - 0.5;
    double v = (p.y_q4 / 16.0 + 0.5) / g->height_px * g->n_rows - 0.5;
    u = fmin(fmax(u, 0.0), g->n_cols - 1.0);
    v = fmin(fmax(v, 0.0), g->n_rows - 1.0);
    double sum = 0.0;
    for (uint16_t r = 0u; r < g->n_rows; r++) {
        for (uint16_t c = 0u; c < g->n_cols; c++) {
            const double weight = fmax(0.0, 1.0 - fabs(u - c)) * fmax(0.0, 1.0 - fabs(v - r));
            const evs_flow_velocity_t tile = evs_flow_grid_tile(g, c, r);
            sum += weight * ((component == 0) ? tile.x_px_s_q3 : tile.y_px_s_q3);
        }
    }
    return sum;
}

static void test_init_names_the_fault_and_leaves_the_grid_alone(void)
{
    static const struct {
        uint16_t width, height, cols, rows;
        evs_status_t want;
    } CASES[] = {
        {240, 180, 8, 6, EVS_OK},       {2048, 2048, 64, 1, EVS_OK},    {1, 1, 1, 1, EVS_OK},
        {64, 64, 1, 64, EVS_OK},        {0, 180, 8, 6, EVS_ERR_ARG},    {240, 0, 8, 6, EVS_ERR_ARG},
        {2049, 180, 8, 6, EVS_ERR_ARG}, {240, 2049, 8, 6, EVS_ERR_ARG}, {240, 180, 0, 6, EVS_ERR_ARG},
        {240, 180, 8, 0, EVS_ERR_ARG},  {7, 180, 8, 6, EVS_ERR_ARG},    {240, 5, 8, 6, EVS_ERR_ARG},
        {240, 180, 13, 5, EVS_ERR_ARG}, {240, 180, 65, 1, EVS_ERR_ARG},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        evs_flow_grid_t fresh = {.width_px = 7u};
        fresh.tiles[0] = velocity(1, 1);
        TEST_ASSERT_EQUAL_INT(
            CASES[i].want, evs_flow_grid_init(&fresh, CASES[i].width, CASES[i].height, CASES[i].cols, CASES[i].rows));
        const bool ok = CASES[i].want == EVS_OK;
        TEST_ASSERT_EQUAL_UINT16(ok ? CASES[i].width : 7u, fresh.width_px);
        check_velocity(ok ? 0 : 1, ok ? 0 : 1, fresh.tiles[0]);
    }
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_flow_grid_init(NULL, W, H, COLS, ROWS));
}

static void test_lookup_agrees_with_the_model_on_grids_of_every_shape(void)
{
    static const uint16_t SHAPES[][4] = {{240, 180, 8, 6},   {346, 260, 8, 6},   {1280, 720, 10, 6},
                                         {2048, 2048, 8, 8}, {2047, 1999, 3, 7}, {64, 48, 1, 1},
                                         {128, 128, 64, 1},  {9, 7, 9, 7},       {640, 480, 1, 5}};
    for (size_t s = 0; s < sizeof SHAPES / sizeof SHAPES[0]; s++) {
        TEST_ASSERT_EQUAL_INT(EVS_OK,
                              evs_flow_grid_init(&grid, SHAPES[s][0], SHAPES[s][1], SHAPES[s][2], SHAPES[s][3]));
        for (int i = 0; i < 400; i++) {
            if (i % 100 == 0) { randomize(&grid, (i == 0) ? 32767 : 800); }
            const int32_t limit = (i < 100) ? 65534 : 1600; /* the largest difference of two tiles */
            const evs_point_t p = {(int16_t)next_random(-100, 16 * SHAPES[s][0] + 100),
                                   (int16_t)next_random(-100, 16 * SHAPES[s][1] + 100)};
            const evs_flow_velocity_t v = evs_flow_grid_at(&grid, p);
            const double bound = 1.0 + limit / 1024.0;
            TEST_ASSERT_TRUE(fabs(v.x_px_s_q3 - model_at(&grid, p, 0)) <= bound);
            TEST_ASSERT_TRUE(fabs(v.y_px_s_q3 - model_at(&grid, p, 1)) <= bound);
        }
    }
}

static void test_lookup_is_exact_at_the_centres_and_replicates_the_edge(void)
{
    randomize(&grid, 32767);
    for (uint16_t r = 0u; r < ROWS; r++) {
        for (uint16_t c = 0u; c < COLS; c++) {
            const evs_flow_velocity_t want = evs_flow_grid_tile(&grid, c, r);
            const evs_flow_velocity_t v = evs_flow_grid_at(&grid, point(30.0 * c + 14.5, 30.0 * r + 14.5));
            check_velocity(want.x_px_s_q3, want.y_px_s_q3, v);
        }
    }
    const evs_flow_velocity_t first = evs_flow_grid_tile(&grid, 0u, 0u);
    const evs_flow_velocity_t last = evs_flow_grid_tile(&grid, COLS - 1u, ROWS - 1u);
    check_velocity(first.x_px_s_q3, first.y_px_s_q3, evs_flow_grid_at(&grid, point(-2000.0, -2000.0)));
    check_velocity(first.x_px_s_q3, first.y_px_s_q3, evs_flow_grid_at(&grid, point(14.0, 14.0)));
    check_velocity(last.x_px_s_q3, last.y_px_s_q3, evs_flow_grid_at(&grid, point(2047.0, 2047.0)));
    check_velocity(last.x_px_s_q3, last.y_px_s_q3, evs_flow_grid_at(&grid, point(225.0, 165.0)));
    check_velocity(first.x_px_s_q3, first.y_px_s_q3, evs_flow_grid_at(&grid, evs_point_outside()));
    const evs_point_t largest = {INT16_MAX, INT16_MAX};
    check_velocity(last.x_px_s_q3, last.y_px_s_q3, evs_flow_grid_at(&grid, largest));
}

static void test_centres_lie_in_the_middle_of_their_tiles(void)
{
    static const uint16_t SHAPES[][4] = {{240, 180, 8, 6}, {346, 260, 8, 6}, {2048, 2048, 64, 1}, {17, 5, 3, 5}};
    for (size_t s = 0; s < sizeof SHAPES / sizeof SHAPES[0]; s++) {
        TEST_ASSERT_EQUAL_INT(EVS_OK,
                              evs_flow_grid_init(&grid, SHAPES[s][0], SHAPES[s][1], SHAPES[s][2], SHAPES[s][3]));
        for (uint16_t r = 0u; r < SHAPES[s][3]; r++) {
            for (uint16_t c = 0u; c < SHAPES[s][2]; c++) {
                const evs_point_t p = evs_flow_grid_centre(&grid, c, r);
                const double x_px = (c + 0.5) * SHAPES[s][0] / SHAPES[s][2] - 0.5;
                const double y_px = (r + 0.5) * SHAPES[s][1] / SHAPES[s][3] - 0.5;
                TEST_ASSERT_TRUE((fabs(p.x_q4 - 16.0 * x_px) < 1.0) && (fabs(p.y_q4 - 16.0 * y_px) < 1.0));
                TEST_ASSERT_EQUAL_UINT32((uint32_t)r * SHAPES[s][2] + c, evs_flow_grid_tile_of(&grid, p));
            }
        }
        TEST_ASSERT_EQUAL_UINT32(EVS_FLOW_GRID_TILES_MAX, evs_flow_grid_tile_of(&grid, evs_point_outside()));
        TEST_ASSERT_EQUAL_UINT32(EVS_FLOW_GRID_TILES_MAX, evs_flow_grid_tile_of(&grid, point(0.0, -0.5625)));
        TEST_ASSERT_EQUAL_UINT32(EVS_FLOW_GRID_TILES_MAX, evs_flow_grid_tile_of(&grid, point(-0.5625, 0.0)));
        TEST_ASSERT_EQUAL_UINT32(0u, evs_flow_grid_tile_of(&grid, point(-0.5, -0.5)));
    }
}

static void test_set_all_set_tile_and_clear(void)
{
    evs_flow_grid_set_all(&grid, velocity(800, -90));
    check_velocity(800, -90, evs_flow_grid_at(&grid, point(100.3, 77.7)));
    check_velocity(800, -90, evs_flow_grid_global(&grid));
    evs_flow_grid_set_tile(&grid, 7u, 0u, velocity(-5, 6));
    check_velocity(-5, 6, evs_flow_grid_tile(&grid, 7u, 0u));
    check_velocity(800, -90, evs_flow_grid_tile(&grid, 6u, 0u));
    check_velocity(800, -90, evs_flow_grid_tile(&grid, 7u, 1u));
    evs_flow_grid_clear(&grid);
    check_velocity(0, 0, evs_flow_grid_tile(&grid, 7u, 0u));
    check_velocity(0, 0, evs_flow_grid_global(&grid));
    TEST_ASSERT_EQUAL_UINT32(0u, evs_flow_grid_n_measured(&grid));
}

static void test_fill_takes_the_median_of_each_tile(void)
{
    size_t n = 0u;
    samples[n++] = sample_in(2, 3, 100, 7);
    samples[n++] = sample_in(2, 3, 30000, 5); /* a wild track */
    samples[n++] = sample_in(2, 3, 104, -20000);
    samples[n++] = sample_in(5, 1, 50, 10); /* even: the mean of the middle two */
    samples[n++] = sample_in(5, 1, -9000, 13);
    samples[n++] = sample_in(5, 1, 53, 9000);
    samples[n++] = sample_in(5, 1, 9000, -9000);
    samples[n++] = sample(-0.6, 20.0, 1, 1); /* off the image by a little more than the half pixel */
    samples[n++] = sample(20.0, 179.5, 1, 1);
    samples[n++] = (evs_flow_sample_t){evs_point_outside(), {1, 1}};
    TEST_ASSERT_EQUAL_UINT(7u, evs_flow_grid_fill(&grid, samples, n));
    TEST_ASSERT_EQUAL_UINT32(2u, evs_flow_grid_n_measured(&grid));
    check_velocity(104, 5, evs_flow_grid_tile(&grid, 2u, 3u));
    check_velocity(52, 12, evs_flow_grid_tile(&grid, 5u, 1u));
    check_velocity(100, 7, evs_flow_grid_global(&grid));
    TEST_ASSERT_EQUAL_UINT(0u, evs_flow_grid_fill(&grid, samples + 7, 3u)); /* nothing on the image: as it was */
    check_velocity(104, 5, evs_flow_grid_tile(&grid, 2u, 3u));
    TEST_ASSERT_EQUAL_UINT(0u, evs_flow_grid_fill(&grid, NULL, 0u));
}

static void test_samples_at_the_borders_of_tiles_and_of_the_image(void)
{
    samples[0] = sample(-0.5, -0.5, 10, 0);
    samples[1] = sample(29.4375, 0.0, 10, 0);
    samples[2] = sample(29.5, 0.0, 20, 0);
    samples[3] = sample(239.4375, 179.4375, 30, 0);
    TEST_ASSERT_EQUAL_UINT(4u, evs_flow_grid_fill(&grid, samples, 4u));
    TEST_ASSERT_EQUAL_UINT32(3u, evs_flow_grid_n_measured(&grid));
    check_velocity(10, 0, evs_flow_grid_tile(&grid, 0u, 0u));
    check_velocity(20, 0, evs_flow_grid_tile(&grid, 1u, 0u));
    check_velocity(30, 0, evs_flow_grid_tile(&grid, 7u, 5u));
}

static void test_the_last_pixel_of_any_image_is_on_the_last_tile(void)
{
    for (int i = 0; i < 3000; i++) {
        const uint16_t width = (uint16_t)next_random(8, 2048);
        const uint16_t height = (uint16_t)next_random(8, 2048);
        const uint16_t cols = (uint16_t)next_random(1, 8);
        const uint16_t rows = (uint16_t)next_random(1, 8);
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_flow_grid_init(&grid, width, height, cols, rows));
        samples[0] = sample(width - 9.0 / 16.0, height - 9.0 / 16.0, 5, 6);
        samples[1] = sample(-0.5, -0.5, 3, 4);
        TEST_ASSERT_EQUAL_UINT(2u, evs_flow_grid_fill(&grid, samples, 2u));
        const bool one = cols * rows == 1;
        check_velocity(one ? 4 : 5, one ? 5 : 6,
                       evs_flow_grid_tile(&grid, (uint16_t)(cols - 1u), (uint16_t)(rows - 1u)));
        check_velocity(one ? 4 : 3, one ? 5 : 4, evs_flow_grid_tile(&grid, 0u, 0u));
    }
}

static void test_of_many_samples_every_kth_is_used(void)
{
    for (int i = 0; i < 70; i++) { samples[i] = sample_in(0, 0, i, -i); } /* 3 a step: 0, 3 .. 69, 24 of them */
    TEST_ASSERT_EQUAL_UINT(70u, evs_flow_grid_fill(&grid, samples, 70u));
    check_velocity(35, -34, evs_flow_grid_tile(&grid, 0u, 0u)); /* of 33 and 36 */
    for (int i = 0; i < 32; i++) { samples[i] = sample_in(0, 0, 1000 * i, 0); }
    TEST_ASSERT_EQUAL_UINT(32u, evs_flow_grid_fill(&grid, samples, 32u));
    check_velocity(15500, 0, evs_flow_grid_tile(&grid, 0u, 0u));
}

/* A field of one sample per tile, vx = 80 col, vy = -40 row, but for one tile. */
static void fill_field(int odd_col, int odd_row, int32_t odd_q3, int n_odd)
{
    size_t n = 0u;
    for (int r = 0; r < ROWS; r++) {
        for (int c = 0; c < COLS; c++) {
            const bool odd = (c == odd_col) && (r == odd_row);
            for (int k = 0; k < (odd ? n_odd : 1); k++) {
                samples[n++] = sample_in(c, r, 80 * c + (odd ? odd_q3 : 0), -40 * r);
            }
        }
    }
    TEST_ASSERT_EQUAL_UINT(n, evs_flow_grid_fill(&grid, samples, n));
}

static void test_a_lone_outlier_is_replaced_by_its_neighbours(void)
{
    for (int n_odd = 1; n_odd <= 2; n_odd++) {
        fill_field(3, 2, 3000, n_odd);
        TEST_ASSERT_EQUAL_UINT32(47u, evs_flow_grid_n_measured(&grid));
        check_velocity(240, -80, evs_flow_grid_tile(&grid, 3u, 2u));
        fill_field(0, 0, -3000, n_odd); /* in the corner: three neighbours are enough */
        TEST_ASSERT_EQUAL_UINT32(47u, evs_flow_grid_n_measured(&grid));
        check_velocity(40, -20, evs_flow_grid_tile(&grid, 0u, 0u));
    }
    fill_field(3, 2, 3000, 3); /* three that agree are something near the camera */
    TEST_ASSERT_EQUAL_UINT32(48u, evs_flow_grid_n_measured(&grid));
    check_velocity(3240, -80, evs_flow_grid_tile(&grid, 3u, 2u));
    /* vx of the neighbours: 160 .. 320, median 240, median deviation 80 of -80, 0, 80: 2 (80 + 128) = 416 are allowed */
    fill_field(3, 2, 416, 1);
    TEST_ASSERT_EQUAL_UINT32(48u, evs_flow_grid_n_measured(&grid));
    fill_field(3, 2, 417, 1);
    TEST_ASSERT_EQUAL_UINT32(47u, evs_flow_grid_n_measured(&grid));
    fill_field(3, 2, -417, 1);
    TEST_ASSERT_EQUAL_UINT32(47u, evs_flow_grid_n_measured(&grid));
}

static void test_three_samples_must_agree_to_need_no_neighbours(void)
{
    /* Two of four tracks wild, the median half way between: the neighbours say no. */
    for (int spread_q3 = 256; spread_q3 <= 257; spread_q3++) {
        size_t n = 0u;
        for (int r = 0; r < ROWS; r++) {
            for (int c = 0; c < COLS; c++) {
                if ((c != 3) || (r != 2)) { samples[n++] = sample_in(c, r, 0, 0); }
            }
        }
        samples[n++] = sample_in(3, 2, 1000 - spread_q3, 0);
        samples[n++] = sample_in(3, 2, 1000, 0);
        samples[n++] = sample_in(3, 2, 1000 + spread_q3, 0);
        TEST_ASSERT_EQUAL_UINT(n, evs_flow_grid_fill(&grid, samples, n));
        check_velocity((spread_q3 == 256) ? 1000 : 0, 0, evs_flow_grid_tile(&grid, 3u, 2u));
        for (size_t i = 0u; i < n; i++) { samples[i].v = velocity(samples[i].v.y_px_s_q3, samples[i].v.x_px_s_q3); }
        TEST_ASSERT_EQUAL_UINT(n, evs_flow_grid_fill(&grid, samples, n));
        check_velocity(0, (spread_q3 == 256) ? 1000 : 0, evs_flow_grid_tile(&grid, 3u, 2u));
    }
}

static void test_y_is_tested_as_x_is(void)
{
    size_t n = 0u;
    for (int r = 0; r < ROWS; r++) {
        for (int c = 0; c < COLS; c++) { samples[n++] = sample_in(c, r, 8, ((c == 4) && (r == 4)) ? 900 : 16); }
    }
    TEST_ASSERT_EQUAL_UINT(48u, evs_flow_grid_fill(&grid, samples, n));
    TEST_ASSERT_EQUAL_UINT32(47u, evs_flow_grid_n_measured(&grid));
    check_velocity(8, 16, evs_flow_grid_tile(&grid, 4u, 4u));
}

static void test_two_neighbours_cannot_tell_an_outlier(void)
{
    samples[0] = sample_in(3, 3, 100, 0);
    samples[1] = sample_in(4, 3, 9000, 0);
    samples[2] = sample_in(5, 3, 100, 0);
    TEST_ASSERT_EQUAL_UINT(3u, evs_flow_grid_fill(&grid, samples, 3u));
    TEST_ASSERT_EQUAL_UINT32(3u, evs_flow_grid_n_measured(&grid));
    check_velocity(9000, 0, evs_flow_grid_tile(&grid, 4u, 3u));
}

static void test_when_all_contradict_one_another_the_median_is_left(void)
{
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_flow_grid_init(&grid, 60, 60, 2u, 2u));
    evs_flow_grid_set_all(&grid, velocity(7, 7));
    samples[0] = sample(14.5, 14.5, -20000, 0); /* each of the four is far from the median of the other three */
    samples[1] = sample(44.5, 14.5, 20000, 0);
    samples[2] = sample(14.5, 44.5, -20000, 20000);
    samples[3] = sample(44.5, 44.5, -20000, -20000);
    TEST_ASSERT_EQUAL_UINT(4u, evs_flow_grid_fill(&grid, samples, 4u));
    const uint32_t kept = evs_flow_grid_n_measured(&grid);
    TEST_ASSERT_EQUAL_UINT32(1u, kept); /* the first agrees with the medians */
    check_velocity(-20000, 0, evs_flow_grid_tile(&grid, 1u, 0u));
    check_velocity(-20000, 0, evs_flow_grid_tile(&grid, 1u, 1u));

    /* Each is far from the median of the other three in x or in y: nothing is left. */
    samples[0] = sample(14.5, 14.5, 0, 20000);
    samples[1] = sample(44.5, 14.5, 1000, -20000);
    samples[2] = sample(14.5, 44.5, 20000, 1000);
    samples[3] = sample(44.5, 44.5, -20000, 0);
    TEST_ASSERT_EQUAL_UINT(4u, evs_flow_grid_fill(&grid, samples, 4u));
    TEST_ASSERT_EQUAL_UINT32(0u, evs_flow_grid_n_measured(&grid));
    check_velocity(500, 500, evs_flow_grid_global(&grid));
    for (uint16_t t = 0u; t < 4u; t++) { check_velocity(500, 500, evs_flow_grid_tile(&grid, t % 2u, t / 2u)); }
}

/* Rings by the definition, on doubles rounded to the grid's unit as they come. */
static void model_spread(double *value, bool *known)
{
    for (int ring = 0; ring < COLS + ROWS; ring++) {
        double next[COLS * ROWS];
        bool next_known[COLS * ROWS];
        for (int t = 0; t < COLS * ROWS; t++) {
            const int c = t % COLS;
            const int r = t / COLS;
            double sum = 0.0;
            int n = 0;
            if ((c > 0) && known[t - 1]) { sum += value[t - 1], n++; }
            if ((c < COLS - 1) && known[t + 1]) { sum += value[t + 1], n++; }
            if ((r > 0) && known[t - COLS]) { sum += value[t - COLS], n++; }
            if ((r < ROWS - 1) && known[t + COLS]) { sum += value[t + COLS], n++; }
            next[t] = (known[t] || (n == 0)) ? value[t] : floor(sum / n + 0.5 + 1e-9);
            next_known[t] = known[t] || (n > 0);
        }
        memcpy(value, next, sizeof next);
        memcpy(known, next_known, sizeof next_known);
    }
}

static void test_tiles_without_samples_are_filled_ring_by_ring(void)
{
    for (int trial = 0; trial < 50; trial++) {
        double x[COLS * ROWS] = {0.0};
        double y[COLS * ROWS] = {0.0};
        bool known_x[COLS * ROWS] = {false};
        bool known_y[COLS * ROWS];
        size_t n = 0u;
        const int n_tiles = 1 + trial % 12;
        for (int k = 0; k < n_tiles; k++) {
            const int c = next_random(0, COLS - 1);
            const int r = next_random(0, ROWS - 1);
            if (known_x[r * COLS + c]) { continue; }
            known_x[r * COLS + c] = true;
            x[r * COLS + c] = next_random(-32768, 32767);
            y[r * COLS + c] = next_random(-100, 100);
            for (int i = 0; i < 3; i++) { /* three: no test against the neighbours */
                samples[n++] = sample_in(c, r, (int32_t)x[r * COLS + c], (int32_t)y[r * COLS + c]);
            }
        }
        memcpy(known_y, known_x, sizeof known_x);
        randomize(&grid, 32767); /* what was there must not matter */
        TEST_ASSERT_EQUAL_UINT(n, evs_flow_grid_fill(&grid, samples, n));
        model_spread(x, known_x);
        model_spread(y, known_y);
        for (int t = 0; t < COLS * ROWS; t++) {
            check_velocity((int32_t)x[t], (int32_t)y[t],
                           evs_flow_grid_tile(&grid, (uint16_t)(t % COLS), (uint16_t)(t / COLS)));
        }
    }
}

static void test_an_expanding_field_with_wild_tracks_is_recovered(void)
{
    /* What the velocity module gives it: 140 tracks, one in ten of them wrong. */
    size_t n = 0u;
    for (int y = 8; y < H; y += 16) {
        for (int x = 8; x < W; x += 16) {
            const bool wild = next_random(0, 9) == 0;
            const double px = x + next_random(-6, 6);
            const double py = y + next_random(-6, 6);
            const int32_t vx = wild ? next_random(-6000, 6000) : (int32_t)lround(8.0 * 0.5 * (px - 100.0));
            const int32_t vy = wild ? next_random(-6000, 6000) : (int32_t)lround(8.0 * 0.5 * (py - 90.0));
            samples[n++] = sample(px, py, vx, vy);
        }
    }
    TEST_ASSERT_EQUAL_UINT(n, evs_flow_grid_fill(&grid, samples, n));
    double worst = 0.0;
    int n_points = 0;
    int n_off = 0;
    for (int y = 10; y < H - 10; y += 7) {
        for (int x = 10; x < W - 10; x += 7) {
            const evs_flow_velocity_t v = evs_flow_grid_at(&grid, point(x, y));
            const double off = hypot(v.x_px_s_q3 / 8.0 - 0.5 * (x - 100.0), v.y_px_s_q3 / 8.0 - 0.5 * (y - 90.0));
            worst = fmax(worst, off);
            n_points++;
            n_off += (off > 10.0) ? 1 : 0;
        }
    }
    /* Wild tracks are off by up to 750 px/s. The test against the neighbours lets about 50 px/s pass. */
    TEST_ASSERT_TRUE_MESSAGE(worst < 50.0, "off by 50 px/s");
    TEST_ASSERT_LESS_THAN_INT(n_points / 10, n_off);
}

static void test_blend_moves_every_velocity_by_the_weight(void)
{
    evs_flow_grid_t other = grid;
    randomize(&grid, 32767);
    randomize(&other, 32767);
    grid.global = velocity(-32768, 100);
    other.global = velocity(32767, 100);
    const evs_flow_grid_t before = grid;
    static const uint16_t WEIGHTS[] = {0u, 64u, 256u};
    for (size_t w = 0; w < 3u; w++) {
        grid = before;
        evs_flow_grid_blend(&grid, &other, WEIGHTS[w]);
        for (uint16_t t = 0u; t < COLS * ROWS; t++) {
            const double a = before.tiles[t].x_px_s_q3;
            const double b = before.tiles[t].y_px_s_q3;
            const double f = WEIGHTS[w] / 256.0;
            check_velocity((int32_t)floor(a + f * (other.tiles[t].x_px_s_q3 - a) + 0.5),
                           (int32_t)floor(b + f * (other.tiles[t].y_px_s_q3 - b) + 0.5), grid.tiles[t]);
        }
        check_velocity((WEIGHTS[w] == 64u) ? -16384 : ((w == 0u) ? -32768 : 32767), 100, evs_flow_grid_global(&grid));
    }
}

static void test_velocity_of_a_displacement(void)
{
    for (int i = 0; i < 3000; i++) {
        const uint32_t dt = (uint32_t)next_random(1, (i % 2 == 0) ? 250000 : 2000);
        const int32_t dx = next_random(-10 * 256, 10 * 256);
        const int32_t dy = next_random(-600 * 256, 600 * 256);
        const evs_flow_velocity_t v = evs_flow_velocity_from(dx, dy, dt);
        const double want_x = fmin(fmax(dx * 31250.0 / dt, -32768.0), 32767.0);
        const double want_y = fmin(fmax(dy * 31250.0 / dt, -32768.0), 32767.0);
        TEST_ASSERT_TRUE(fabs(v.x_px_s_q3 - want_x) <= 0.51);
        TEST_ASSERT_TRUE(fabs(v.y_px_s_q3 - want_y) <= 0.51);
    }
    check_velocity(8, -16, evs_flow_velocity_from(256, -512, 1000000u));
    check_velocity(32767, -32768, evs_flow_velocity_from(INT32_MAX, INT32_MIN, 1u));
    check_velocity(8, 0, evs_flow_velocity_from(1 << 20, 1, UINT32_MAX)); /* 4096 px in 71 min */
}

static void test_displacement_of_a_velocity(void)
{
    for (int i = 0; i < 3000; i++) {
        const int16_t v = (int16_t)next_random(-32768, 32767);
        const int32_t dt = (i % 2 == 0) ? next_random(-300000, 300000) : next_random(-2000000, 2000000);
        const double px = v / 8.0 * dt * 1e-6;
        TEST_ASSERT_TRUE(fabs(evs_flow_displacement_q8(v, dt) - 256.0 * px) <= 0.5 + fabs(256.0 * px) * 1e-5);
        TEST_ASSERT_TRUE(fabs(evs_flow_displacement_q4(v, dt) - 16.0 * px) <= 0.5 + fabs(16.0 * px) * 1e-5);
    }
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, evs_flow_displacement_q8(INT16_MIN, INT32_MIN));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, evs_flow_displacement_q8(INT16_MAX, INT32_MIN));
    TEST_ASSERT_INT_WITHIN(2000, 140737488, evs_flow_displacement_q4(INT16_MIN, INT32_MIN));
    TEST_ASSERT_EQUAL_INT32(-256, evs_flow_displacement_q8(8, -1000000)); /* 1 px/s for a second back */
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_names_the_fault_and_leaves_the_grid_alone);
    RUN_TEST(test_lookup_agrees_with_the_model_on_grids_of_every_shape);
    RUN_TEST(test_lookup_is_exact_at_the_centres_and_replicates_the_edge);
    RUN_TEST(test_centres_lie_in_the_middle_of_their_tiles);
    RUN_TEST(test_set_all_set_tile_and_clear);
    RUN_TEST(test_fill_takes_the_median_of_each_tile);
    RUN_TEST(test_samples_at_the_borders_of_tiles_and_of_the_image);
    RUN_TEST(test_the_last_pixel_of_any_image_is_on_the_last_tile);
    RUN_TEST(test_of_many_samples_every_kth_is_used);
    RUN_TEST(test_a_lone_outlier_is_replaced_by_its_neighbours);
    RUN_TEST(test_three_samples_must_agree_to_need_no_neighbours);
    RUN_TEST(test_y_is_tested_as_x_is);
    RUN_TEST(test_two_neighbours_cannot_tell_an_outlier);
    RUN_TEST(test_when_all_contradict_one_another_the_median_is_left);
    RUN_TEST(test_tiles_without_samples_are_filled_ring_by_ring);
    RUN_TEST(test_an_expanding_field_with_wild_tracks_is_recovered);
    RUN_TEST(test_blend_moves_every_velocity_by_the_weight);
    RUN_TEST(test_velocity_of_a_displacement);
    RUN_TEST(test_displacement_of_a_velocity);
    return UNITY_END();
}
