/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/corners.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { W = 83, H = 61, SMALLEST_CELL = 4, N_CELLS = EVS_CORNERS_CELLS(W, H, SMALLEST_CELL) };

static uint8_t px[W * H];
static uint32_t memory[EVS_CORNERS_BYTES(W, H, SMALLEST_CELL) / 4u + 1u];
static evs_corner_t found[N_CELLS + 1], want[N_CELLS + 1];
static evs_corners_t corners;
static uint32_t seed;

void setUp(void) { seed = 4711u; }
void tearDown(void) {}

static uint32_t next_random(uint32_t below)
{
    seed = seed * 1664525u + 1013904223u;
    return (uint32_t)(((uint64_t)seed * below) >> 32);
}

static evs_image_t image_of(uint16_t width, uint16_t height)
{
    const evs_image_t image = {px, width, height};
    return image;
}

/* Bind with exactly the memory that the macro asks for, and a guard behind it. */
static void init(const evs_corners_config_t *cfg)
{
    const size_t n_bytes = EVS_CORNERS_BYTES(cfg->width_px, cfg->height_px, cfg->cell_px);
    TEST_ASSERT_TRUE(n_bytes < sizeof memory);
    memset(memory, 0xA5, sizeof memory);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_corners_init(&corners, cfg, memory, n_bytes));
}

static size_t find(const evs_corners_config_t *cfg, size_t max)
{
    const evs_image_t image = image_of(cfg->width_px, cfg->height_px);
    const size_t n_bytes = EVS_CORNERS_BYTES(cfg->width_px, cfg->height_px, cfg->cell_px);
    init(cfg);
    found[max].score = 12345u;
    const size_t n = evs_corners_find(&corners, &image, found, max);
    TEST_ASSERT_EQUAL_HEX8_MESSAGE(0xA5, ((const uint8_t *)memory)[n_bytes], "wrote past its memory");
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(12345u, found[max].score, "wrote past the corners");
    TEST_ASSERT_TRUE(n <= max);
    return n;
}

static void fill(uint8_t grey, uint16_t width, uint16_t height) { memset(px, grey, (size_t)width * height); }

static void fill_rectangle(int x0, int y0, int x1, int y1, uint8_t grey)
{
    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) { px[y * W + x] = grey; }
    }
}

/* Noise as it is, smoothed along and down, or faint and sparse: then many scores are small and equal, or next to it. */
typedef enum { ROUGH = 0, SMOOTH = 1, FAINT = 2 } noise_t;

static void fill_noise(uint16_t width, uint16_t height, noise_t noise)
{
    const size_t n = (size_t)width * height;
    for (size_t i = 0u; i < n; i++) {
        px[i] = (uint8_t)((noise == FAINT) ? 100u + ((next_random(12u) == 0u) ? 1u : 0u) : next_random(256u));
    }
    for (size_t pass = 0u; (noise == SMOOTH) && (pass < 3u); pass++) {
        for (size_t i = 0u; i + 1u < n; i++) { px[i] = (uint8_t)((px[i] + px[i + 1u] + 1) / 2); }
        for (size_t i = 0u; i + width < n; i++) { px[i] = (uint8_t)((px[i] + px[i + width] + 1) / 2); }
    }
}

/* --- the definition of the header, pixel by pixel ---------------------------------------------------------------- */

static int grey(const evs_image_t *image, int x, int y) { return image->px[y * image->width_px + x]; }

static uint32_t model_score(const evs_image_t *image, int x, int y)
{
    double xx = 0.0, xy = 0.0, yy = 0.0;
    for (int v = y - 2; v <= y + 2; v++) {
        for (int u = x - 2; u <= x + 2; u++) {
            int gx = 0, gy = 0;
            for (int k = -1; k <= 1; k++) {
                const int weight = (k == 0) ? 2 : 1;
                gx += weight * (grey(image, u + 1, v + k) - grey(image, u - 1, v + k));
                gy += weight * (grey(image, u + k, v + 1) - grey(image, u + k, v - 1));
            }
            xx += gx * gx;
            xy += gx * gy;
            yy += gy * gy;
        }
    }
    const double smaller = 0.5 * (xx + yy - sqrt((xx - yy) * (xx - yy) + 4.0 * xy * xy));
    return (uint32_t)floor(smaller + 1e-6);
}

static size_t model(const evs_corners_config_t *cfg, evs_corner_t *out)
{
    const evs_image_t image = image_of(cfg->width_px, cfg->height_px);
    const int margin = EVS_CORNERS_MARGIN_PX, cell = cfg->cell_px;
    size_t n = 0u;
    uint32_t highest = 0u;
    for (int top = 0; top < image.height_px; top += cell) {
        for (int left = 0; left < image.width_px; left += cell) {
            evs_corner_t best = {0u, 0u, 0u};
            for (int y = top; (y < top + cell) && (y < image.height_px - margin); y++) {
                for (int x = left; (x < left + cell) && (x < image.width_px - margin); x++) {
                    if ((x < margin) || (y < margin)) { continue; }
                    const uint32_t score = model_score(&image, x, y);
                    if (score > best.score) { best = (evs_corner_t){(uint16_t)x, (uint16_t)y, score}; }
                }
            }
            if (best.score > 0u) { out[n++] = best; }
            highest = (best.score > highest) ? best.score : highest;
        }
    }
    size_t n_kept = 0u;
    for (size_t i = 0u; i < n; i++) {
        if ((uint64_t)out[i].score * 1000u >= (uint64_t)highest * cfg->min_permille) { out[n_kept++] = out[i]; }
    }
    return n_kept;
}

static void assert_as_model(const evs_corners_config_t *cfg)
{
    const size_t n_want = model(cfg, want);
    TEST_ASSERT_EQUAL_UINT(n_want, find(cfg, N_CELLS));
    for (size_t i = 0u; i < n_want; i++) {
        TEST_ASSERT_EQUAL_UINT32(want[i].score, found[i].score);
        TEST_ASSERT_EQUAL_UINT16(want[i].x_px, found[i].x_px);
        TEST_ASSERT_EQUAL_UINT16(want[i].y_px, found[i].y_px);
    }
}

/* --- tests ------------------------------------------------------------------------------------------------------- */

static void test_init_names_the_fault_and_leaves_the_context_alone(void)
{
    const evs_corners_config_t good = evs_corners_config_default(W, H);
    TEST_ASSERT_EQUAL_UINT16(16u, good.cell_px);
    TEST_ASSERT_EQUAL_UINT16(10u, good.min_permille);
    evs_corners_config_t bad[8];
    for (size_t i = 0u; i < 8u; i++) { bad[i] = good; }
    bad[0].width_px = 0u;
    bad[1].width_px = EVS_SENSOR_MAX_PX + 1u;
    bad[2].height_px = 0u;
    bad[3].height_px = EVS_SENSOR_MAX_PX + 1u;
    bad[4].cell_px = EVS_CORNERS_CELL_MIN_PX - 1u;
    bad[5].cell_px = EVS_CORNERS_CELL_MAX_PX + 1u;
    bad[6].min_permille = 1001u;
    corners = (evs_corners_t){.n_rows = 77u};
    for (size_t i = 0u; i < 7u; i++) {
        TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_corners_init(&corners, &bad[i], memory, SIZE_MAX));
    }
    const size_t n_bytes = EVS_CORNERS_BYTES(W, H, 16u);
    uint8_t *const odd = (uint8_t *)memory + 2;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_corners_init(&corners, &good, odd, n_bytes));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_corners_init(&corners, &good, memory, n_bytes - 1u));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_corners_init(NULL, &good, memory, n_bytes));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_corners_init(&corners, NULL, memory, n_bytes));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_corners_init(&corners, &good, NULL, n_bytes));
    TEST_ASSERT_EQUAL_UINT16(77u, corners.n_rows);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_corners_init(&corners, &good, memory, n_bytes));
    bad[7].cell_px = EVS_CORNERS_CELL_MAX_PX;
    bad[7].min_permille = 1000u;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_corners_init(&corners, &bad[7], memory, n_bytes));
}

static void test_every_corner_is_that_of_the_definition(void)
{
    static const struct {
        uint16_t width, height, cell, permille;
    } CASES[] = {{W, H, 16, 10}, {W, H, 4, 0}, {W, H, 7, 100}, {64, 48, 16, 10}, {48, 61, 256, 0},
                 {7, 7, 16, 0},  {8, 9, 4, 0}, {W, 7, 16, 10}, {7, H, 5, 500},   {20, 20, 16, 1000}};
    for (size_t i = 0u; i < sizeof CASES / sizeof CASES[0]; i++) {
        for (int noise = ROUGH; noise <= FAINT; noise++) {
            evs_corners_config_t cfg = evs_corners_config_default(CASES[i].width, CASES[i].height);
            cfg.cell_px = CASES[i].cell;
            cfg.min_permille = CASES[i].permille;
            fill_noise(cfg.width_px, cfg.height_px, (noise_t)noise);
            assert_as_model(&cfg);
        }
    }
}

static void test_corners_of_a_square_are_found_and_its_edges_are_not(void)
{
    const evs_corners_config_t cfg = evs_corners_config_default(W, H);
    fill(40u, W, H);
    fill_rectangle(20, 20, 44, 44, 200u); /* Its corners lie in four cells, its edges in more. */
    TEST_ASSERT_EQUAL_UINT(4u, find(&cfg, N_CELLS));
    static const int X[] = {20, 43, 20, 43}, Y[] = {20, 20, 43, 43};
    for (size_t i = 0u; i < 4u; i++) {
        TEST_ASSERT_INT_WITHIN(1, X[i], found[i].x_px);
        TEST_ASSERT_INT_WITHIN(1, Y[i], found[i].y_px);
    }
    assert_as_model(&cfg);
}

static void test_images_without_corners_have_none(void)
{
    evs_corners_config_t cfg = evs_corners_config_default(W, H);
    cfg.min_permille = 0u;
    for (int kind = 0; kind < 4; kind++) {
        for (int y = 0; y < H; y++) {
            for (int x = 0; x < W; x++) {
                const int stripes[] = {255, (x / 3 % 2) * 255, (y / 4 % 2) * 255, x + y};
                px[y * W + x] = (uint8_t)stripes[kind];
            }
        }
        TEST_ASSERT_EQUAL_UINT(0u, find(&cfg, N_CELLS));
    }
    static const uint16_t SMALL[][2] = {{1, 1}, {6, 40}, {40, 6}};
    for (size_t i = 0u; i < 3u; i++) {
        cfg = evs_corners_config_default(SMALL[i][0], SMALL[i][1]);
        fill_noise(cfg.width_px, cfg.height_px, ROUGH);
        TEST_ASSERT_EQUAL_UINT(0u, find(&cfg, N_CELLS));
    }
}

/* Black and white at every scale: the largest gradients there are. */
static void test_the_hardest_contrast_stays_exact(void)
{
    uint32_t highest = 0u;
    for (int side = 1; side <= 8; side++) {
        evs_corners_config_t cfg = evs_corners_config_default(W, H);
        cfg.min_permille = 0u;
        for (int y = 0; y < H; y++) {
            for (int x = 0; x < W; x++) { px[y * W + x] = (((x / side) ^ (y / side)) & 1) ? 255u : 0u; }
        }
        assert_as_model(&cfg);
        for (size_t i = 0u; i < find(&cfg, N_CELLS); i++) {
            highest = (found[i].score > highest) ? found[i].score : highest;
        }
    }
    TEST_ASSERT_TRUE(highest > 4000000u);
}

static void test_fewer_are_the_best_ones_and_of_equals_the_first(void)
{
    const evs_corners_config_t cfg = evs_corners_config_default(W, H);
    fill_noise(W, H, SMOOTH);
    const size_t n_all = model(&cfg, want);
    TEST_ASSERT_TRUE(n_all > 10u);
    for (size_t max = 0u; max <= n_all; max++) {
        TEST_ASSERT_EQUAL_UINT(max, find(&cfg, max));
        size_t at = 0u; /* They keep their order, and whatever was left out scores no higher. */
        uint32_t lowest = UINT32_MAX, left_out = 0u;
        for (size_t i = 0u; i < n_all; i++) {
            if ((at < max) && (memcmp(&want[i], &found[at], sizeof want[i]) == 0)) {
                lowest = (want[i].score < lowest) ? want[i].score : lowest;
                at++;
            } else {
                left_out = (want[i].score > left_out) ? want[i].score : left_out;
            }
        }
        TEST_ASSERT_EQUAL_UINT(max, at);
        TEST_ASSERT_TRUE(left_out <= lowest);
    }

    fill(0u, W, H); /* The same spot in every cell. */
    for (int y = 8; y + 8 < H; y += 16) {
        for (int x = 8; x + 8 < W; x += 16) { fill_rectangle(x, y, x + 2, y + 2, 255u); }
    }
    const size_t n_spots = find(&cfg, N_CELLS);
    memcpy(want, found, sizeof want);
    TEST_ASSERT_EQUAL_UINT(15u, n_spots);
    TEST_ASSERT_EQUAL_UINT(4u, find(&cfg, 4u));
    TEST_ASSERT_EQUAL_MEMORY(want, found, 4u * sizeof want[0]);
}

static void test_pieces_of_any_size_find_the_same(void)
{
    static const uint16_t SIZES[][2] = {{W, H}, {7u, 7u}, {6u, 40u}, {40u, 1u}};
    static const size_t PIECES[] = {1u, 2u, 7u, 1000u};
    for (size_t size = 0u; size < 4u; size++) {
        const evs_corners_config_t cfg = evs_corners_config_default(SIZES[size][0], SIZES[size][1]);
        for (int i = 0; i < SIZES[size][0] * SIZES[size][1]; i++) { px[i] = (uint8_t)next_random(256u); }
        const size_t n_want = find(&cfg, N_CELLS);
        memcpy(want, found, sizeof want);
        for (size_t piece = 0u; piece < 4u; piece++) {
            const evs_image_t image = image_of(cfg.width_px, cfg.height_px);
            init(&cfg);
            evs_corners_begin(&corners, &image);
            size_t n_pieces = 1u;
            while (!evs_corners_scan(&corners, PIECES[piece])) { n_pieces++; }
            if (size == 0u) { TEST_ASSERT_EQUAL_UINT((H - 2u + PIECES[piece] - 1u) / PIECES[piece], n_pieces); }
            TEST_ASSERT_TRUE(evs_corners_scan(&corners, 5u)); /* and nothing more */
            TEST_ASSERT_EQUAL_UINT(n_want, evs_corners_take(&corners, found, N_CELLS));
            if (n_want > 0u) { TEST_ASSERT_EQUAL_MEMORY(want, found, n_want * sizeof want[0]); }
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_names_the_fault_and_leaves_the_context_alone);
    RUN_TEST(test_every_corner_is_that_of_the_definition);
    RUN_TEST(test_corners_of_a_square_are_found_and_its_edges_are_not);
    RUN_TEST(test_images_without_corners_have_none);
    RUN_TEST(test_the_hardest_contrast_stays_exact);
    RUN_TEST(test_pieces_of_any_size_find_the_same);
    RUN_TEST(test_fewer_are_the_best_ones_and_of_equals_the_first);
    return UNITY_END();
}
