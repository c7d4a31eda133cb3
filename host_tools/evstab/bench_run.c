/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bench.h"
#include "bench_events.h"
#include "evs/float.h"
#include "evs/pipeline.h"
#include "progress.h"

#define BATCH       1024u
#define COLS        34u
#define ROWS        26u
#define THRESHOLD   200u
#define SAMPLE_US   1000u /* Orientations at 1 kHz. */
#define RING        64u
#define SWEEP_DEG   6.0 /* The view swings by that much: the rotation is never trivial, a saccade seldom. */
#define SWEEP_HZ    2.0
#define TAU         6.283185307179586
#define RAD_PER_DEG (TAU / 360.0)

typedef struct {
    const evt_bench_t *b;
    evs_event_t *events, *copy;
    evs_point_t *points, *out;
    uint16_t *tiles;
    /* The modules by themselves. */
    evs_camera_t camera;
    evs_tile_grid_t grid;
    evs_undistort_t undistort;
    evs_point_t *table;
    uint16_t *tile_table;
    uint16_t *tile_counts;
    /* And together. */
    evs_pipeline_config_t cfg;
    evs_pipeline_t pipeline;
    void *memory;
    double *ns[EVT_BENCH_STEPS]; /* One per round. */
} bench_t;

/* A lens as that of the Event-Camera Dataset, scaled to the sensor. */
static bool make_lens(const evt_bench_t *b, evs_camera_config_t *c)
{
    const double scale = b->width_px / 240.0;
    const double k_px[4] = {199.092 * scale, 198.829 * scale, 0.5 * (b->width_px - 1.0), 0.5 * (b->height_px - 1.0)};
    const double dist[EVS_CAMERA_N_DIST] = {-0.368436, 0.150947, -0.000296, -0.000759, 0.0};
    return evs_camera_config_from_double(c, EVS_CAMERA_PINHOLE, b->width_px, b->height_px, k_px, dist) == EVS_OK;
}

/* A flapping wing's swing: pitch, with half of it in yaw. */
static evs_orientation_t orientation_at(uint32_t t_us)
{
    const double phase = TAU * SWEEP_HZ * 1e-6 * (double)t_us;
    const double rad = SWEEP_DEG * RAD_PER_DEG * sin(phase);
    const double rad_s = SWEEP_DEG * RAD_PER_DEG * TAU * SWEEP_HZ * cos(phase);
    evs_orientation_t o;
    o.t_us = t_us;
    o.q_wc = evs_quat_from_rotvec(evs_vec3_from_double(rad, 0.5 * rad, 0.0, 28));
    o.rate_rad_s_q24 = evs_vec3_from_double(rad_s, 0.5 * rad_s, 0.0, 24);
    return o;
}

static bool set_up(bench_t *x, evh_error_t *err)
{
    const evt_bench_t *const b = x->b;
    evs_camera_config_t camera;
    const size_t n_pixels = (size_t)b->width_px * b->height_px;
    size_t bytes;

    if (!make_lens(b, &camera)) { return evh_fail(err, "the library refuses this lens"); }
    x->cfg = evs_pipeline_config_default(&camera);
    x->cfg.tile_table = true;
    x->cfg.n_cols = (b->width_px < COLS) ? b->width_px : COLS;
    x->cfg.n_rows = (b->height_px < ROWS) ? b->height_px : ROWS;
    x->cfg.window.threshold = THRESHOLD;
    x->cfg.source = EVS_PIPELINE_ORIENTATION;
    x->cfg.n_ring = RING;
    x->cfg.n_fifo = 16u * BATCH;
    x->cfg.n_batch = BATCH;

    x->events = malloc(b->n_events * sizeof *x->events);
    x->copy = malloc(b->n_events * sizeof *x->copy);
    x->points = malloc(b->n_events * sizeof *x->points);
    x->out = malloc(b->n_events * sizeof *x->out);
    x->tiles = malloc(b->n_events * sizeof *x->tiles);
    x->table = malloc(n_pixels * sizeof *x->table);
    x->cfg.table = x->table; /* The pipeline shares it. */
    x->cfg.n_table = n_pixels;
    bytes = evs_pipeline_bytes(&x->cfg);
    x->tile_table = malloc(n_pixels * sizeof *x->tile_table);
    x->tile_counts = malloc((size_t)x->cfg.n_cols * x->cfg.n_rows * sizeof *x->tile_counts);
    x->memory = malloc(bytes + 1u);
    for (int i = 0; i < EVT_BENCH_STEPS; i++) { x->ns[i] = malloc(b->n_rounds * sizeof *x->ns[i]); }
    for (int i = 0; i < EVT_BENCH_STEPS; i++) {
        if (x->ns[i] == NULL) { return evh_fail(err, "out of memory"); }
    }
    if ((x->events == NULL) || (x->copy == NULL) || (x->points == NULL) || (x->out == NULL) || (x->tiles == NULL) ||
        (x->table == NULL) || (x->tile_table == NULL) || (x->tile_counts == NULL) || (x->memory == NULL)) {
        return evh_fail(err, "out of memory for %zu events", b->n_events);
    }
    evt_bench_events(x->events, b->n_events, b->width_px, b->height_px);
    if ((bytes == 0u) || (evs_camera_init(&x->camera, &camera) != EVS_OK) ||
        (evs_tile_grid_init(&x->grid, b->width_px, b->height_px, x->cfg.n_cols, x->cfg.n_rows) != EVS_OK) ||
        (evs_undistort_build(&x->undistort, &x->camera, 1u, x->table, n_pixels) != EVS_OK) ||
        (evs_undistort_build_tiles(&x->undistort, &x->grid, x->tile_table, n_pixels) != EVS_OK)) {
        return evh_fail(err, "the library refuses a sensor of %ux%u", (unsigned)b->width_px, (unsigned)b->height_px);
    }
    return true;
}

static size_t batch_at(const bench_t *x, size_t i)
{
    const size_t left = x->b->n_events - i;
    return (left < BATCH) ? left : BATCH;
}

static void run_memcpy(bench_t *x) { memcpy(x->copy, x->events, x->b->n_events * sizeof *x->events); }

static void run_undistort(bench_t *x)
{
    for (size_t i = 0u; i < x->b->n_events; i += BATCH) {
        evs_undistort_map_tiles(&x->undistort, x->events + i, batch_at(x, i), x->points + i, x->tiles + i);
    }
}

static bool run_window(bench_t *x)
{
    evs_window_t window;
    if (evs_window_init(&window, &x->cfg.window, x->tile_counts, x->grid.n_tiles) != EVS_OK) { return false; }
    for (size_t i = 0u; i < x->b->n_events; i += BATCH) {
        const size_t n = batch_at(x, i);
        size_t done = 0u;
        while (done < n) {
            evs_window_end_t end;
            done += evs_window_push(&window, x->events + i + done, x->tiles + i + done, n - done, &end);
        }
    }
    return true;
}

static bool run_rotate(bench_t *x)
{
    const evs_camera_config_t *const c = &x->camera.cfg;
    const evs_pinhole_t pinhole = {c->width_px, c->height_px, c->fx_q16, c->fy_q16, c->cx_q16, c->cy_q16};
    const evs_stabilize_config_t cfg = evs_stabilize_config_default(&pinhole);
    const size_t slice = EVT_BENCH_EVENTS_HZ / 1000000u * SAMPLE_US;
    evs_stabilize_t stabilize;
    if (evs_stabilize_init(&stabilize, &cfg) != EVS_OK) { return false; }
    (void)evs_stabilize_begin_window(&stabilize, evs_quat_identity());
    for (size_t i = 0u; i < x->b->n_events; i += slice) {
        const size_t left = x->b->n_events - i;
        evs_stabilize_set_orientation(&stabilize, orientation_at(x->events[i].t_us).q_wc);
        evs_stabilize_map(&stabilize, x->points + i, (left < slice) ? left : slice, x->out + i);
    }
    return true;
}

static void pull_all(bench_t *x, evt_bench_result_t *result)
{
    evs_pipeline_chunk_t chunk;
    while (evs_pipeline_pull(&x->pipeline, &chunk)) {
        /* A user touches each point; so does this. */
        for (size_t i = 0u; i < chunk.n; i++) { result->n_kept += evs_point_is_outside(chunk.stabilized[i]) ? 0u : 1u; }
        result->n_windows += (chunk.end.reason != EVS_WINDOW_OPEN) ? 1u : 0u;
    }
}

/* A stream begins anew; setting up is no part of what is timed. */
static bool restart_pipeline(bench_t *x)
{
    return evs_pipeline_init(&x->pipeline, &x->cfg, x->memory, evs_pipeline_bytes(&x->cfg)) == EVS_OK;
}

/* Orientations ahead of the events, as they come from an IMU that is read first. */
static void run_pipeline(bench_t *x, evt_bench_result_t *result)
{
    uint32_t next_us = 0u;
    result->n_windows = 0u;
    result->n_kept = 0u;
    for (size_t i = 0u; i < x->b->n_events;) {
        const size_t n = batch_at(x, i);
        const uint32_t until_us = x->events[i + n - 1u].t_us + 4u * SAMPLE_US;
        while (next_us <= until_us) {
            const evs_orientation_t o = orientation_at(next_us);
            (void)evs_pipeline_push_orientation(&x->pipeline, &o);
            next_us += SAMPLE_US;
        }
        i += evs_pipeline_push_events(&x->pipeline, x->events + i, n);
        pull_all(x, result);
    }
    evs_pipeline_finish(&x->pipeline);
    pull_all(x, result);
}

static bool run_step(bench_t *x, evt_bench_step_t step, evt_bench_result_t *result)
{
    switch (step) {
    case EVT_BENCH_MEMCPY:
        run_memcpy(x);
        return true;
    case EVT_BENCH_UNDISTORT:
        run_undistort(x);
        return true;
    case EVT_BENCH_WINDOW:
        return run_window(x);
    case EVT_BENCH_ROTATE:
        return run_rotate(x);
    default:
        run_pipeline(x, result);
        return true;
    }
}

/* Time that this process has run. Where others want the processor, a clock on the wall would count their turns too, and
 * most of all in the longest step. */
static int64_t cpu_ns(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a;
    const double y = *(const double *)b;
    return (x > y) - (x < y);
}

static bool run_rounds(bench_t *x, evt_bench_result_t *result, evh_error_t *err)
{
    const unsigned n = x->b->n_rounds;
    evt_progress_t progress;
    evt_progress_start(&progress);
    for (unsigned round = 0u; round <= n; round++) { /* Round 0 warms up: pages, caches, clock. */
        for (int step = 0; step < EVT_BENCH_STEPS; step++) {
            const bool ready = (step != EVT_BENCH_PIPELINE) || restart_pipeline(x);
            const int64_t start_ns = cpu_ns();
            const bool ok = ready && run_step(x, (evt_bench_step_t)step, result);
            const double ns = (double)(cpu_ns() - start_ns) / (double)x->b->n_events;
            if (!ok) {
                evt_progress_end(&progress);
                return evh_fail(err, "the library refuses its own defaults");
            }
            if (round > 0u) { x->ns[step][round - 1u] = ns; }
        }
        evt_progress_update(&progress, (double)round / n, (uint64_t)round * x->b->n_events, "events");
    }
    evt_progress_end(&progress);
    for (int step = 0; step < EVT_BENCH_STEPS; step++) {
        double *const ns = x->ns[step];
        qsort(ns, n, sizeof *ns, by_value);
        result->least_ns[step] = ns[0];
        result->median_ns[step] = 0.5 * (ns[(n - 1u) / 2u] + ns[n / 2u]);
    }
    return true;
}

bool evt_bench_run(const evt_bench_t *b, evt_bench_result_t *result, evh_error_t *err)
{
    bench_t *const x = calloc(1u, sizeof *x);
    bool ok;
    memset(result, 0, sizeof *result);
    if (x == NULL) { return evh_fail(err, "out of memory"); }
    x->b = b;
    ok = set_up(x, err) && run_rounds(x, result, err);
    for (int i = 0; i < EVT_BENCH_STEPS; i++) { free(x->ns[i]); }
    free(x->memory);
    free(x->tile_counts);
    free(x->tile_table);
    free(x->table);
    free(x->tiles);
    free(x->out);
    free(x->points);
    free(x->copy);
    free(x->events);
    free(x);
    return ok;
}
