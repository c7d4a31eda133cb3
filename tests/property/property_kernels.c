/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * Every variant of a hot loop (DSP, Helium, SSE2, AVX2, unrolled, without branches) gives the bits of the plain C, at
 * every length and alignment, and writes nothing else. This file is compiled with EVS_NO_SIMD=1, so that the kernel it
 * includes is the plain one.
 */
#include "../../lib/src/evs_homography_kernel.h"
#include "evs/undistort.h"
#include "evs/window.h"
#include "model.h"
#include "unity.h"

#include <string.h>

enum { N_MAX = 40, N_LONG = 300, W = 61, H = 47, N_TILES = 77 };

static uint32_t state = 0x2545F491u;

static uint32_t random_bits(void)
{
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state;
}
static uint32_t below(uint32_t limit) { return (uint32_t)(((uint64_t)random_bits() * limit) >> 32); }
static int32_t between(int32_t lo, int32_t hi) { return lo + (int32_t)below((uint32_t)(hi - lo) + 1u); }

void setUp(void) {}
void tearDown(void) {}

/* --- rotation --------------------------------------------------------------------------------------------------- */

/* Memory at any even address: one point more than is used, at either end. */
static struct {
    uint32_t align;
    int16_t at[2 * (N_LONG + 4)];
} in_store, out_store;

static evs_point_t *points_at(int16_t *store, size_t odd) { return (evs_point_t *)(void *)(store + 2u + odd); }

/* Lenses from wide to long, and principal points on, off and far off the middle. */
static evs_pinhole_t random_camera(void)
{
    static const uint16_t SIZES[][2] = {{128, 128}, {240, 180}, {640, 480}, {1280, 720}, {2048, 2048}};
    const uint32_t i = below(5u);
    const bool centred = below(4u) != 0u;
    const int32_t f = between(SIZES[i][0] / 2, (below(4u) == 0u) ? 8000 : SIZES[i][0] * 2);
    evs_pinhole_t k = {SIZES[i][0], SIZES[i][1], (f << 16) + (int32_t)below(65536u), f << 16, 0, 0};
    k.cx_q16 = centred ? (SIZES[i][0] << 15) + (int32_t)below(1u << 20) : between(-2000, 3000) * 65536;
    k.cy_q16 = centred ? (SIZES[i][1] << 15) - (int32_t)below(1u << 20) : between(-2000, 3000) * 65536;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pinhole_check(&k));
    return k;
}

static evs_homography_t random_homography(evs_pinhole_t *k)
{
    static const double LIMITS_RAD[] = {0.01, 0.2, 0.5, 2.0};
    evs_homography_t h;
    *k = random_camera();
    evs_homography_set(&h, k, model_to_fixed(model_random_rotation(LIMITS_RAD[below(4u)])));
    return h;
}

/* Mostly points on the sensor; some are markers, some far, some the corners of what a point may hold. */
static evs_point_t random_point(const evs_pinhole_t *k)
{
    static const int16_t EDGES[] = {-EVS_POINT_MAX_Q4, EVS_POINT_MAX_Q4, 0, -16384, 16383, 16384};
    switch (below(32u)) {
    case 0:
        return evs_point_outside();
    case 1:
        return (evs_point_t){EDGES[below(6u)], EDGES[below(6u)]};
    case 2:
        return (evs_point_t){(int16_t)between(-EVS_POINT_MAX_Q4, EVS_POINT_MAX_Q4),
                             (int16_t)between(-EVS_POINT_MAX_Q4, EVS_POINT_MAX_Q4)};
    default:
        return (evs_point_t){(int16_t)below(16u * k->width_px - 15u), (int16_t)below(16u * k->height_px - 15u)};
    }
}

static evs_point_t plain(const evs_homography_t *h, evs_point_t p)
{
    return h->fast ? map_fast(h, p) : evs_homography_map_exact(h, p);
}

/* Compare all of `out`, and the point before and behind it. */
static void check_rotated(const evs_homography_t *h, const evs_point_t *in, const evs_point_t *out, size_t n)
{
    for (size_t i = 0u; i < n; i++) {
        const evs_point_t want = plain(h, in[i]);
        TEST_ASSERT_EQUAL_HEX32_MESSAGE(pack_point(want), pack_point(out[i]), "not the bits of the plain C");
    }
    TEST_ASSERT_EQUAL_INT16_MESSAGE(0x5A5A, out[-1].y_q4, "wrote before the output");
    TEST_ASSERT_EQUAL_INT16_MESSAGE(0x5A5A, out[n].x_q4, "wrote behind the output");
}

static void rotate_and_check(const evs_homography_t *h, const evs_pinhole_t *k, size_t n, size_t odd_in, size_t odd_out,
                             bool only_good)
{
    evs_point_t *const in = points_at(in_store.at, odd_in);
    evs_point_t *const out = points_at(out_store.at, odd_out);
    for (size_t i = 0u; i < n; i++) {
        in[i] = only_good ? (evs_point_t){(int16_t)(k->width_px * 8), (int16_t)(k->height_px * 8 + (int)below(16u))}
                          : random_point(k);
    }
    memset(out_store.at, 0x5A, sizeof out_store.at);
    evs_homography_map(h, in, n, out);
    check_rotated(h, in, out, n);
}

static void test_rotation_at_every_length_and_alignment(void)
{
    for (int round = 0; round < 12; round++) {
        evs_pinhole_t k;
        const evs_homography_t h = random_homography(&k);
        for (size_t n = 0u; n <= N_MAX; n++) {
            for (size_t odd = 0u; odd < 4u; odd++) {
                rotate_and_check(&h, &k, n, odd & 1u, odd >> 1, false);
                rotate_and_check(&h, &k, n, odd & 1u, odd >> 1, true);
            }
        }
    }
}

static void test_rotation_by_random_homographies(void)
{
    for (int round = 0; round < 400; round++) {
        evs_pinhole_t k;
        const evs_homography_t h = random_homography(&k);
        rotate_and_check(&h, &k, N_LONG, 0u, 0u, false);
    }
}

static void test_rotation_in_place(void)
{
    for (int round = 0; round < 100; round++) {
        evs_pinhole_t k;
        const evs_homography_t h = random_homography(&k);
        evs_point_t *const in = points_at(in_store.at, 0u);
        evs_point_t *const inout = points_at(out_store.at, 0u);
        memset(out_store.at, 0x5A, sizeof out_store.at);
        for (size_t i = 0u; i < N_LONG; i++) { inout[i] = in[i] = random_point(&k); }
        evs_homography_map(&h, inout, N_LONG, inout);
        check_rotated(&h, in, inout, N_LONG);
    }
}

/* A long lens turned so far that the marker, taken for a point, would be seen in the middle of the image. */
static void test_a_marker_stays_one_where_its_bits_are_a_visible_point(void)
{
    const evs_pinhole_t k = {640, 480, 8000 << 16, 8000 << 16, 320 << 16, 240 << 16};
    int n_visible = 0;
    for (int round = 0; round < 200; round++) {
        const evs_vec3_t r_q28 = {between(-90000000, -60000000), between(60000000, 90000000), 0};
        evs_homography_t h;
        evs_homography_set(&h, &k, evs_quat_from_rotvec(r_q28));
        int32_t x_q4, y_q4;
        if (!h.fast || !position_q4(&h, MARKER, &x_q4, &y_q4)) { continue; }
        if ((evs_abs_u32(x_q4) < 16000u) && (evs_abs_u32(y_q4) < 16000u)) { n_visible++; }
        evs_point_t *const in = points_at(in_store.at, 0u);
        evs_point_t *const out = points_at(out_store.at, 0u);
        memset(out_store.at, 0x5A, sizeof out_store.at);
        for (size_t i = 0u; i < N_MAX; i++) {
            /* -2000 px: where the image now looks */
            in[i] = (below(4u) == 0u) ? evs_point_outside() : (evs_point_t){(int16_t)-32000, (int16_t)-32000};
        }
        evs_homography_map(&h, in, N_MAX, out);
        check_rotated(&h, in, out, N_MAX);
    }
    TEST_ASSERT_GREATER_THAN_INT_MESSAGE(5, n_visible, "the case was not met");
}

/* A long lens turned by a pixel or two: points at the edge of what a point can hold leave it by single steps. */
static void test_the_last_position_in_range_is_one_and_the_next_is_none(void)
{
    const evs_pinhole_t k = {640, 480, 8000 << 16, 8000 << 16, 320 << 16, 240 << 16};
    for (int round = 0; round < 200; round++) {
        const evs_vec3_t r_q28 = {between(-70000, 70000), between(-70000, 70000), 0}; /* 2 px */
        evs_homography_t h;
        evs_homography_set(&h, &k, evs_quat_from_rotvec(r_q28));
        evs_point_t *const in = points_at(in_store.at, 0u);
        evs_point_t *const out = points_at(out_store.at, 0u);
        memset(out_store.at, 0x5A, sizeof out_store.at);
        for (size_t i = 0u; i < N_LONG; i++) {
            if ((i % 8u) >= 5u) { /* groups of one position */
                in[i] = in[i - 1u];
                continue;
            }
            const int32_t far = ((i % 2u) == 0u) ? between(-EVS_POINT_MAX_Q4, -EVS_POINT_MAX_Q4 + 40)
                                                 : between(EVS_POINT_MAX_Q4 - 40, EVS_POINT_MAX_Q4);
            const int32_t near = between(-16000, 16000);
            in[i] = ((i % 4u) < 2u) ? (evs_point_t){(int16_t)far, (int16_t)near}
                                    : (evs_point_t){(int16_t)near, (int16_t)far};
        }
        evs_homography_map(&h, in, N_LONG, out);
        check_rotated(&h, in, out, N_LONG);
    }
}

/* --- undistortion ------------------------------------------------------------------------------------------------ */

static int16_t point_store[2u * EVS_UNDISTORT_POINTS(W, H, 1u) + 5u];
static evs_point_t *point_table;
static uint16_t tile_table[EVS_UNDISTORT_TILES(W, H)];
static evs_event_t events[N_LONG];
static uint16_t tile_store[N_LONG + 2];

static void make_tables(evs_undistort_t *u, size_t odd)
{
    point_table = points_at(point_store, odd);
    for (size_t i = 0u; i < EVS_UNDISTORT_POINTS(W, H, 1u); i++) {
        point_table[i] = (evs_point_t){(int16_t)random_bits(), (int16_t)random_bits()};
        tile_table[i] = (uint16_t)random_bits();
    }
    evs_tile_grid_t grid;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_tile_grid_init(&grid, W, H, 11, 7));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_undistort_bind(u, W, H, 1u, point_table, EVS_UNDISTORT_POINTS(W, H, 1u)));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_undistort_bind_tiles(u, &grid, tile_table, EVS_UNDISTORT_TILES(W, H)));
}

/* Mostly events on the sensor; the others off it by a pixel or by anything. */
static void make_events(size_t n, bool only_good)
{
    static const uint16_t X[] = {W - 1, W, 0x7FFF, 0x8000, 0xFFFF, 0};
    static const uint16_t Y[] = {H - 1, H, 0x7FFF, 0x4000, 0x7F00, 0};
    for (size_t i = 0u; i < n; i++) {
        const bool edge = !only_good && (below(12u) == 0u);
        const uint16_t x = edge ? X[below(6u)] : (uint16_t)below(W);
        const uint16_t y = edge ? Y[below(6u)] : (uint16_t)below(H);
        events[i] = evs_event_make(random_bits(), x, y, (random_bits() & 16u) != 0u);
    }
}

static void look_up_and_check(evs_undistort_t *u, size_t n, size_t odd, bool with_tiles)
{
    evs_point_t *const out = points_at(out_store.at, odd);
    uint16_t *const tiles = tile_store + 1;
    const uint32_t rejected_before = evs_undistort_n_rejected(u);
    memset(out_store.at, 0x5A, sizeof out_store.at);
    memset(tile_store, 0x5A, sizeof tile_store);
    if (with_tiles) {
        evs_undistort_map_tiles(u, events, n, out, tiles);
    } else {
        evs_undistort_map(u, events, n, out);
    }
    uint32_t n_off = 0u;
    for (size_t i = 0u; i < n; i++) {
        const uint32_t x = evs_event_x_px(events[i]), y = evs_event_y_px(events[i]);
        const bool on = (x < W) && (y < H);
        const evs_point_t want = on ? point_table[y * W + x] : evs_point_outside();
        TEST_ASSERT_EQUAL_HEX32(pack_point(want), pack_point(out[i]));
        if (with_tiles) { TEST_ASSERT_EQUAL_HEX16(on ? tile_table[y * W + x] : EVS_TILE_NONE, tiles[i]); }
        if (!on) { n_off++; }
    }
    TEST_ASSERT_EQUAL_UINT32(n_off, evs_undistort_n_rejected(u) - rejected_before);
    TEST_ASSERT_EQUAL_INT16_MESSAGE(0x5A5A, out[-1].y_q4, "wrote before the points");
    TEST_ASSERT_EQUAL_INT16_MESSAGE(0x5A5A, out[n].x_q4, "wrote behind the points");
    TEST_ASSERT_EQUAL_HEX16_MESSAGE(0x5A5A, tiles[-1], "wrote before the tiles");
    TEST_ASSERT_EQUAL_HEX16_MESSAGE(0x5A5A, tiles[with_tiles ? n : 0u], "wrote behind the tiles");
}

static void test_look_up_at_every_length_and_alignment(void)
{
    evs_undistort_t u;
    for (int round = 0; round < 8; round++) {
        make_tables(&u, (size_t)(round / 4));
        for (size_t n = 0u; n <= N_MAX; n++) {
            make_events(n, (round % 2) == 0);
            for (size_t odd = 0u; odd < 2u; odd++) {
                look_up_and_check(&u, n, odd, false);
                look_up_and_check(&u, n, odd, true);
            }
        }
    }
    make_events(N_LONG, false);
    look_up_and_check(&u, N_LONG, 0u, true);
}

/* --- window ------------------------------------------------------------------------------------------------------ */

enum { N_COUNTS = EVS_TILES_MAX };

static uint16_t counts[N_COUNTS + 1];
static uint16_t counts_wanted[N_COUNTS];

static void open_window(evs_window_t *win, uint32_t threshold, size_t n_tiles)
{
    evs_window_config_t cfg = evs_window_config_default();
    cfg.threshold = threshold;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_window_init(win, &cfg, counts, n_tiles));
    memset(counts_wanted, 0, sizeof counts_wanted);
    counts[n_tiles] = 0x5A5Au;
}

/* How many of n events a window takes that closes with the one above the threshold; counts as it does. */
static size_t plain_count(const uint16_t *tiles, size_t n, uint32_t threshold, bool *closes)
{
    *closes = false;
    for (size_t i = 0u; i < n; i++) {
        if (tiles[i] == EVS_TILE_NONE) { continue; }
        if (++counts_wanted[tiles[i]] > threshold) {
            *closes = true;
            return i + 1u;
        }
    }
    return n;
}

/* Push n tiles of tile_store; true when the window closed. */
static bool count_and_check(evs_window_t *win, size_t n, uint32_t threshold, size_t n_tiles)
{
    evs_window_end_t end;
    bool closes;
    const size_t want = plain_count(tile_store, n, threshold, &closes);
    TEST_ASSERT_EQUAL_UINT(want, evs_window_push(win, events, tile_store, n, &end));
    TEST_ASSERT_EQUAL_INT(closes ? EVS_WINDOW_BY_AREA : EVS_WINDOW_OPEN, end.reason);
    if (closes) { memset(counts_wanted, 0, n_tiles * sizeof counts[0]); }
    TEST_ASSERT_EQUAL_MEMORY(counts_wanted, counts, n_tiles * sizeof counts[0]);
    TEST_ASSERT_EQUAL_HEX16_MESSAGE(0x5A5A, counts[n_tiles], "wrote behind the counts");
    return closes;
}

/* From no event with a tile to every one, and from one tile on. */
static void test_area_count_at_every_length(void)
{
    memset(events, 0, sizeof events);
    for (int round = 0; round < 400; round++) {
        const uint32_t threshold = 1u + below(20u);
        const size_t n_tiles = ((round % 2) == 0) ? N_TILES : 1u + below(6u);
        const uint32_t with_tile = below(9u); /* of 8 */
        evs_window_t win;
        open_window(&win, threshold, n_tiles);
        for (size_t n = 0u; n <= N_MAX; n++) {
            for (size_t i = 0u; i < n; i++) {
                tile_store[i] = (below(8u) < with_tile) ? (uint16_t)below((uint32_t)n_tiles) : (uint16_t)EVS_TILE_NONE;
            }
            (void)count_and_check(&win, n, threshold, n_tiles);
        }
    }
}

/* Every tile of the first few is as full as it may be: an event without a tile must not close the window, nor the next
 * event of another tile; one more of a full tile must, wherever it comes in a batch. */
static void test_a_full_tile_closes_the_window_with_its_own_next_event_only(void)
{
    memset(events, 0, sizeof events);
    for (size_t n_tiles = 1u; n_tiles <= 9u; n_tiles++) {
        for (uint32_t threshold = 1u; threshold <= 3u; threshold++) {
            for (size_t closing = 0u; closing < 13u; closing++) {
                evs_window_t win;
                open_window(&win, threshold, n_tiles);
                for (uint32_t k = 0u; k < threshold; k++) {
                    for (size_t i = 0u; i < n_tiles; i++) { tile_store[i] = (uint16_t)i; }
                    TEST_ASSERT_FALSE(count_and_check(&win, n_tiles, threshold, n_tiles));
                }
                for (size_t i = 0u; i < 13u; i++) { tile_store[i] = EVS_TILE_NONE; }
                TEST_ASSERT_FALSE(count_and_check(&win, 13u, threshold, n_tiles));
                tile_store[closing] = (uint16_t)below((uint32_t)n_tiles);
                TEST_ASSERT_TRUE(count_and_check(&win, 13u, threshold, n_tiles));
            }
        }
    }
}

/* The last index of the largest grid lies next to EVS_TILE_NONE, the highest threshold next to where a count wraps. */
static void test_the_largest_grid_and_the_highest_threshold(void)
{
    memset(events, 0, sizeof events);
    evs_window_t win;
    open_window(&win, EVS_WINDOW_AREA_MAX, EVS_TILES_MAX);
    for (size_t i = 0u; i < N_LONG; i++) { tile_store[i] = ((i % 3u) == 0u) ? EVS_TILE_NONE : EVS_TILES_MAX - 1u; }
    const uint32_t per_push = N_LONG / 3u * 2u;
    for (uint32_t n_counted = 0u; n_counted + per_push <= EVS_WINDOW_AREA_MAX; n_counted += per_push) {
        evs_window_end_t end;
        TEST_ASSERT_EQUAL_UINT(N_LONG, evs_window_push(&win, events, tile_store, N_LONG, &end));
    }
    TEST_ASSERT_EQUAL_UINT32(EVS_WINDOW_AREA_MAX / per_push * per_push, counts[EVS_TILES_MAX - 1u]);
    counts_wanted[EVS_TILES_MAX - 1u] = counts[EVS_TILES_MAX - 1u];
    TEST_ASSERT_TRUE(count_and_check(&win, N_LONG, EVS_WINDOW_AREA_MAX, EVS_TILES_MAX));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_rotation_at_every_length_and_alignment);
    RUN_TEST(test_rotation_by_random_homographies);
    RUN_TEST(test_rotation_in_place);
    RUN_TEST(test_a_marker_stays_one_where_its_bits_are_a_visible_point);
    RUN_TEST(test_the_last_position_in_range_is_one_and_the_next_is_none);
    RUN_TEST(test_look_up_at_every_length_and_alignment);
    RUN_TEST(test_area_count_at_every_length);
    RUN_TEST(test_a_full_tile_closes_the_window_with_its_own_next_event_only);
    RUN_TEST(test_the_largest_grid_and_the_highest_threshold);
    return UNITY_END();
}
