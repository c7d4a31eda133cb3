/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * The hot path of an event, step by step, with markers around each step. bench_table.py makes instructions
 * per event and docs/performance.md of the counts.
 *
 * Events lie at random over a DAVIS 240C (240 x 180) with the lens of the Event-Camera Dataset, in batches of 256, as
 * they come from a sensor: the worst case of a table lookup, since nothing repeats. The rotation is 5 degrees about an
 * oblique axis, inside the saccade limit.
 */
#include "bench_markers.h"
#include "bench_regions.h"

#include "board.h"
#include "evs/camera.h"
#include "evs/orientation_track.h"
#include "evs/pipeline.h"
#include "evs/stabilize.h"
#include "evs/undistort.h"
#include "evs/window.h"

enum { W = 240, H = 180, COLS = 34, ROWS = 26, GRID_STEP = 8, TRACK = 16 };

static evs_event_t events[BENCH_EVENTS];
static evs_point_t points[BENCH_EVENTS];
static uint16_t tiles[BENCH_EVENTS];

static evs_point_t table_full[EVS_UNDISTORT_POINTS(W, H, 1u)];
static evs_point_t table_grid[EVS_UNDISTORT_POINTS(W, H, GRID_STEP)];
static uint16_t table_tiles[EVS_UNDISTORT_TILES(W, H)];
static uint16_t tile_counts[COLS * ROWS];

static evs_camera_t camera;
static evs_tile_grid_t grid;
static evs_undistort_t full, full_tiles, coarse, coarse_tiles;
static evs_window_t window;
static evs_stabilize_t stabilize;
static evs_orientation_t ring[TRACK];
static evs_orientation_track_t track;

enum { FIFO = 512, BATCH = 256, RING = 8 };

static evs_pipeline_t pipeline;
static uint64_t memory[EVS_PIPELINE_BYTES(W, H, 0, true, COLS *ROWS, FIFO, RING, BATCH) / 8u];

static uint32_t next_random(void)
{
    static uint32_t state = 0x2545F491u;
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state;
}

/* Time steps by some us: 256 events take about 1 ms, as at a quarter of a million events a second. */
static void make_events(void)
{
    static uint32_t t_us;
    for (int i = 0; i < BENCH_EVENTS; i++) {
        t_us += next_random() % 8u;
        events[i] = evs_event_make(t_us, (uint16_t)(next_random() % W), (uint16_t)(next_random() % H), (i & 1) != 0);
    }
}

static const evs_camera_config_t lens = {
    .model = EVS_CAMERA_PINHOLE,
    .width_px = W,
    .height_px = H,
    .fx_q16 = 13047717, /* 199.092 px */
    .fy_q16 = 13030446, /* 198.829 px */
    .cx_q16 = 8663340,  /* 132.192 px */
    .cy_q16 = 7255665,  /* 110.713 px */
    .dist_q32 = {-1582421910, 648313474, -1271871, -3261734, 0},
};

static bool set_up_tables(void)
{
    if ((evs_camera_init(&camera, &lens) != EVS_OK) || (evs_tile_grid_init(&grid, W, H, COLS, ROWS) != EVS_OK) ||
        (evs_undistort_build(&coarse, &camera, GRID_STEP, table_grid, EVS_UNDISTORT_POINTS(W, H, GRID_STEP)) !=
         EVS_OK)) {
        return false;
    }
    /* The full table from the grid: the same to look up, and QEMU need not invert the lens 43200 times. */
    for (uint16_t y = 0u; y < H; y++) {
        for (uint16_t x = 0u; x < W; x++) { table_full[y * W + x] = evs_undistort_pixel(&coarse, x, y); }
    }
    if (evs_undistort_bind(&full, W, H, 1u, table_full, EVS_UNDISTORT_POINTS(W, H, 1u)) != EVS_OK) { return false; }
    full_tiles = full;
    coarse_tiles = coarse;
    return (evs_undistort_build_tiles(&full_tiles, &grid, table_tiles, EVS_UNDISTORT_TILES(W, H)) == EVS_OK) &&
           (evs_undistort_bind_tiles(&coarse_tiles, &grid, NULL, 0u) == EVS_OK);
}

static bool set_up_window(void)
{
    evs_window_config_t areas = evs_window_config_default();
    areas.threshold = EVS_WINDOW_AREA_MAX; /* Out of reach: a batch is counted as a whole. */
    return evs_window_init(&window, &areas, tile_counts, grid.n_tiles) == EVS_OK;
}

/* The camera's orientation every ms: turning at 0.5, -0.8, 0.3 rad/s. */
static bool set_up_rotation(void)
{
    const evs_pinhole_t ideal = {W, H, camera.cfg.fx_q16, camera.cfg.fy_q16, camera.cfg.cx_q16, camera.cfg.cy_q16};
    const evs_stabilize_config_t cfg = evs_stabilize_config_default(&ideal);
    const evs_orientation_track_config_t track_cfg = evs_orientation_track_config_default();
    const evs_vec3_t rate = {8388608, -13421773, 5033165};
    const evs_vec3_t step = {rate.x / 1000 * 16, rate.y / 1000 * 16, rate.z / 1000 * 16}; /* rad Q28 in 1 ms */
    evs_quat_t q = evs_quat_identity();

    if ((evs_stabilize_init(&stabilize, &cfg) != EVS_OK) ||
        (evs_orientation_track_init(&track, &track_cfg, ring, TRACK) != EVS_OK)) {
        return false;
    }
    (void)evs_stabilize_begin_window(&stabilize, q);
    for (uint32_t ms = 1u; ms <= 88u; ms++) { /* 5 degrees */
        const evs_orientation_t sample = {1000u * ms, q, rate};
        if (evs_orientation_track_push(&track, &sample) != EVS_OK) { return false; }
        q = evs_quat_mul(q, evs_quat_from_rotvec(step));
    }
    return true;
}

static bool set_up_pipeline(void)
{
    evs_pipeline_config_t cfg = evs_pipeline_config_default(&lens);
    cfg.table = table_full;
    cfg.n_table = EVS_UNDISTORT_POINTS(W, H, 1u);
    cfg.tile_table = true;
    cfg.n_fifo = FIFO;
    cfg.n_ring = RING;
    cfg.n_batch = BATCH;
    return evs_pipeline_init(&pipeline, &cfg, memory, sizeof memory) == EVS_OK;
}

/* What a firmware does in a millisecond: a sample of the IMU, the events since the last one, and all that is ready. Every
 * event comes out, though not in the millisecond in which it went in. */
static bool run_pipeline(uint32_t ms)
{
    const evs_vec3_t rate = {8388608, -13421773, 5033165};
    const evs_vec3_t accel = {0, 0, 10283328}; /* 9.807 m/s^2 */
    evs_pipeline_chunk_t chunk;
    size_t n_taken;
    for (uint32_t i = 0u; i < BENCH_EVENTS; i++) { events[i].t_us = 1000u * ms + 4u * i - 1023u; }

    BENCH_START(BENCH_PIPELINE);
    evs_pipeline_push_accel(&pipeline, 1000u * ms, accel);
    evs_pipeline_push_gyro(&pipeline, 1000u * ms, rate);
    n_taken = evs_pipeline_push_events(&pipeline, events, BENCH_EVENTS);
    while (evs_pipeline_pull(&pipeline, &chunk)) {}
    BENCH_STOP(BENCH_PIPELINE);
    return n_taken == BENCH_EVENTS;
}

static bool run_batch(void)
{
    evs_window_end_t end;
    evs_orientation_t now;
    size_t n_taken;

    make_events();
    BENCH_START(BENCH_LOOKUP_FULL);
    evs_undistort_map(&full, events, BENCH_EVENTS, points);
    BENCH_STOP(BENCH_LOOKUP_FULL);

    BENCH_START(BENCH_LOOKUP_GRID);
    evs_undistort_map(&coarse, events, BENCH_EVENTS, points);
    BENCH_STOP(BENCH_LOOKUP_GRID);

    BENCH_START(BENCH_LOOKUP_GRID_TILES);
    evs_undistort_map_tiles(&coarse_tiles, events, BENCH_EVENTS, points, tiles);
    BENCH_STOP(BENCH_LOOKUP_GRID_TILES);

    BENCH_START(BENCH_LOOKUP_FULL_TILES);
    evs_undistort_map_tiles(&full_tiles, events, BENCH_EVENTS, points, tiles);
    BENCH_STOP(BENCH_LOOKUP_FULL_TILES);

    BENCH_START(BENCH_WINDOW);
    n_taken = evs_window_push(&window, events, tiles, BENCH_EVENTS, &end);
    BENCH_STOP(BENCH_WINDOW);
    if (n_taken != BENCH_EVENTS) { return false; }

    BENCH_START(BENCH_SLICE);
    if (evs_orientation_track_at(&track, 87500u, &now) != EVS_OK) { return false; }
    evs_stabilize_set_orientation(&stabilize, now.q_wc);
    BENCH_STOP(BENCH_SLICE);

    BENCH_START(BENCH_ROTATE);
    evs_stabilize_map(&stabilize, points, BENCH_EVENTS, points);
    BENCH_STOP(BENCH_ROTATE);
    return true;
}

int main(void)
{
    if (!set_up_tables() || !set_up_window() || !set_up_rotation() || !set_up_pipeline()) {
        board_puts("bench_events: set-up refused\n");
        return 1;
    }
    for (int i = 0; i < BENCH_BATCHES; i++) {
        if (!run_batch()) {
            board_puts("bench_events: a step gave another answer than expected\n");
            return 1;
        }
    }
    for (uint32_t ms = 2u; ms < 2u + BENCH_BATCHES; ms++) {
        if (!run_pipeline(ms)) {
            board_puts("bench_events: the pipeline took fewer events than expected\n");
            return 1;
        }
    }
    return 0;
}
