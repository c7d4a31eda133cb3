/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/tiles.h"
#include "unity.h"

static evs_tile_grid_t grid;

void setUp(void) { TEST_ASSERT_EQUAL_INT(EVS_OK, evs_tile_grid_init(&grid, 240, 180, 34, 26)); }
void tearDown(void) {}

static void test_init_names_the_fault_and_leaves_the_grid_alone(void)
{
    static const struct {
        uint16_t w, h, cols, rows;
        evs_status_t want;
    } CASES[] = {
        {0, 180, 1, 1, EVS_ERR_ARG},           {240, 0, 1, 1, EVS_ERR_ARG},     {2049, 180, 1, 1, EVS_ERR_ARG},
        {240, 2049, 1, 1, EVS_ERR_ARG},        {240, 180, 0, 1, EVS_ERR_ARG},   {240, 180, 1, 0, EVS_ERR_ARG},
        {240, 180, 241, 1, EVS_ERR_ARG},       {240, 180, 1, 181, EVS_ERR_ARG}, {2048, 2048, 256, 256, EVS_ERR_ARG},
        {2048, 2048, 255, 257, EVS_OK},        {240, 180, 240, 180, EVS_OK},    {1, 1, 1, 1, EVS_OK},
        {65535, 65535, 65535, 1, EVS_ERR_ARG},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        evs_tile_grid_t fresh = {.n_tiles = 7u};
        TEST_ASSERT_EQUAL_INT(CASES[i].want,
                              evs_tile_grid_init(&fresh, CASES[i].w, CASES[i].h, CASES[i].cols, CASES[i].rows));
        const uint32_t n = (CASES[i].want == EVS_OK) ? (uint32_t)CASES[i].cols * CASES[i].rows : 7u;
        TEST_ASSERT_EQUAL_UINT32(n, fresh.n_tiles);
    }
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_tile_grid_init(NULL, 240, 180, 1, 1));
}

/* The result depends on the tile size, the number of tiles and the coordinate only; the sensor size enters as the
 * bound. So the widest sensor of every pair of tile size and count covers every case there is. */
static void test_reciprocal_equals_division_for_every_tile_size_and_every_coordinate(void)
{
    for (uint32_t tile = 1; tile <= EVS_SENSOR_MAX_PX; tile++) {
        for (uint32_t n = 1; n * tile <= EVS_SENSOR_MAX_PX; n++) {
            uint32_t length = n * tile + n - 1u;
            if (length > EVS_SENSOR_MAX_PX) { length = EVS_SENSOR_MAX_PX; }
            evs_tile_grid_t g;
            TEST_ASSERT_EQUAL_INT(EVS_OK, evs_tile_grid_init(&g, (uint16_t)length, 1, (uint16_t)n, 1));
            uint32_t want = 0;
            uint32_t left = tile;
            for (uint32_t x = 0; x < length; x++) { /* division by counting: quick where it is emulated */
                if (left == 0u) {
                    left = tile;
                    if (want < n - 1u) { want++; }
                }
                left--;
                if (evs_tile_of_pixel(&g, (int32_t)x, 0) != want) {
                    TEST_ASSERT_EQUAL_UINT32_MESSAGE(tile, 0, "tile size with a wrong quotient");
                }
            }
        }
    }
}

static void test_rows_use_the_same_arithmetic_as_columns(void)
{
    evs_tile_grid_t columns;
    evs_tile_grid_t rows;
    for (uint16_t n = 1; n <= 180; n++) {
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_tile_grid_init(&columns, 180, 1, n, 1));
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_tile_grid_init(&rows, 1, 180, 1, n));
        for (int32_t at = 0; at < 180; at++) {
            TEST_ASSERT_EQUAL_UINT16(evs_tile_of_pixel(&columns, at, 0), evs_tile_of_pixel(&rows, 0, at));
        }
    }
}

static void test_tiles_count_row_by_row_and_the_last_ones_absorb_the_remainder(void)
{
    /* 240 / 34 = 7 rest 2, 180 / 26 = 6 rest 24: the last column is 9 px wide, the last row 30 px high. */
    TEST_ASSERT_EQUAL_UINT16(0, evs_tile_of_pixel(&grid, 6, 5));
    TEST_ASSERT_EQUAL_UINT16(1, evs_tile_of_pixel(&grid, 7, 5));
    TEST_ASSERT_EQUAL_UINT16(34, evs_tile_of_pixel(&grid, 6, 6));
    TEST_ASSERT_EQUAL_UINT16(32, evs_tile_of_pixel(&grid, 230, 0));
    TEST_ASSERT_EQUAL_UINT16(33, evs_tile_of_pixel(&grid, 231, 0));
    TEST_ASSERT_EQUAL_UINT16(33, evs_tile_of_pixel(&grid, 239, 0));
    TEST_ASSERT_EQUAL_UINT16(24 * 34, evs_tile_of_pixel(&grid, 0, 149));
    TEST_ASSERT_EQUAL_UINT16(25 * 34, evs_tile_of_pixel(&grid, 0, 150));
    TEST_ASSERT_EQUAL_UINT16(26 * 34 - 1, evs_tile_of_pixel(&grid, 239, 179));
    TEST_ASSERT_EQUAL_UINT32(26u * 34u, grid.n_tiles);
}

static void test_position_off_the_sensor_has_no_tile(void)
{
    static const int32_t OFF[][2] = {{-1, 0}, {0, -1}, {240, 0}, {0, 180}, {INT32_MIN, 0}, {0, INT32_MAX}};
    for (size_t i = 0; i < sizeof OFF / sizeof OFF[0]; i++) {
        TEST_ASSERT_EQUAL_UINT16(EVS_TILE_NONE, evs_tile_of_pixel(&grid, OFF[i][0], OFF[i][1]));
    }
    TEST_ASSERT_EQUAL_UINT16(EVS_TILE_NONE, evs_tile_of_point(&grid, evs_point_outside()));
}

static void test_position_is_rounded_half_up_to_a_pixel(void)
{
    static const struct {
        int16_t x_q4;
        uint16_t want;
    } CASES[] = {
        {-9, EVS_TILE_NONE},
        {-8, 0},
        {0, 0},
        {7 * 16 - 9, 0},
        {7 * 16 - 8, 1},
        {240 * 16 - 9, 33},
        {240 * 16 - 8, EVS_TILE_NONE},
        {EVS_POINT_MAX_Q4, EVS_TILE_NONE},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        const evs_point_t p = {CASES[i].x_q4, 0};
        TEST_ASSERT_EQUAL_UINT16(CASES[i].want, evs_tile_of_point(&grid, p));
    }
    TEST_ASSERT_EQUAL_UINT16(0, evs_tile_of_point(&grid, (evs_point_t){0, -8}));
    TEST_ASSERT_EQUAL_UINT16(EVS_TILE_NONE, evs_tile_of_point(&grid, (evs_point_t){0, -9}));
    TEST_ASSERT_EQUAL_UINT16(34, evs_tile_of_point(&grid, (evs_point_t){0, 6 * 16 - 8}));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_names_the_fault_and_leaves_the_grid_alone);
    RUN_TEST(test_reciprocal_equals_division_for_every_tile_size_and_every_coordinate);
    RUN_TEST(test_rows_use_the_same_arithmetic_as_columns);
    RUN_TEST(test_tiles_count_row_by_row_and_the_last_ones_absorb_the_remainder);
    RUN_TEST(test_position_off_the_sensor_has_no_tile);
    RUN_TEST(test_position_is_rounded_half_up_to_a_pixel);
    return UNITY_END();
}
