/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Whatever is pushed, in whatever order: every accepted event comes out once, in order, in a window that adds up; every
 * window gives an image or is counted; a direction that is said to be valid is a direction. */
#include "evs/pipeline.h"
#include "unity.h"

enum { W = 40, H = 30, N_FIFO = 64, N_RING = 4, N_BATCH = 16, N_RUNS = 60, N_STEPS = 400 };

static evs_pipeline_t p;
enum { N_KEPT = 200, N_BUDGET = 100 };
static uint64_t memory[(EVS_PIPELINE_BYTES(W, H, 4, true, 20, N_FIFO, N_RING, N_BATCH) +
                        EVS_PIPELINE_IMAGE_BYTES(W, H, EVS_PIPELINE_IMAGE_SURFACE, EVS_IWE_GAUSSIAN,
                                                 EVS_PIPELINE_WARP_PREDICTED, true, N_BATCH) +
                        EVS_PIPELINE_WARP_BYTES(W, H, N_KEPT, N_BUDGET, EVS_WARP_MAX_PX, 1u) +
                        EVS_VELOCITY_BYTES(W, H, 4u, 4u, 0u, 4u, 31u, 1u, 64u)) /
                       8u];
static uint64_t state;

void setUp(void) {}
void tearDown(void) {}

static uint32_t next_u32(void)
{
    state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(state >> 32);
}

static uint32_t below(uint32_t n) { return next_u32() % n; }

/* Mostly ordinary numbers, now and then an extreme one. */
static int32_t any_i32(int32_t ordinary)
{
    switch (below(12u)) {
    case 0:
        return INT32_MAX;
    case 1:
        return INT32_MIN;
    case 2:
        return 0;
    case 3:
        return (int32_t)next_u32();
    default:
        return (int32_t)below(2u * (uint32_t)ordinary + 1u) - ordinary;
    }
}

static evs_vec3_t any_vec3(int32_t ordinary)
{
    const evs_vec3_t v = {any_i32(ordinary), any_i32(ordinary), any_i32(ordinary)};
    return v;
}

/* Time that mostly creeps on, sometimes stands, jumps or runs back. */
static uint32_t step_time(uint32_t t_us)
{
    switch (below(40u)) {
    case 0:
        return next_u32();
    case 1:
        return t_us - below(3000u);
    case 2:
        return t_us + below(200000u);
    case 3:
        return t_us;
    default:
        return t_us + below(400u);
    }
}

/* Images of any kind, and small pieces to track in them. */
static void ask_for_images(evs_pipeline_config_t *cfg)
{
    cfg->image = (evs_pipeline_image_t)below(4u);
    cfg->iwe.vote = (evs_iwe_vote_t)below(3u);
    if (cfg->image == EVS_PIPELINE_IMAGE_NONE) { return; }
    cfg->velocity_on = below(4u) != 0u;
    cfg->velocity.keyframes.n_stored = (uint16_t)(1u + below(EVS_KEYFRAMES_MAX));
    cfg->velocity.keyframes.baseline_min_us = 1u + below(10000u);
    cfg->velocity.corners.cell_px = (uint16_t)(4u + below(8u));
    cfg->velocity.flow.window_px = (uint16_t)(7u + 2u * below(13u));
    cfg->velocity.flow.stride_px = (uint16_t)(1u + below(2u));
    cfg->velocity.n_levels = (uint16_t)(1u + below(EVS_FLOW_LEVELS_MAX));
    cfg->velocity.egomotion.method = (evs_egomotion_method_t)below(3u);
    cfg->velocity.egomotion.rotation_sigma_rad_q28 = (int32_t)below(1u << 24);
    cfg->velocity.min_features = (uint16_t)(1u + below(20u));
    if (cfg->image == EVS_PIPELINE_IMAGE_SURFACE) { return; }
    cfg->warp = (evs_pipeline_warp_t)below(4u);
    if ((cfg->warp == EVS_PIPELINE_WARP_PREDICTED) && !cfg->velocity_on) { cfg->warp = EVS_PIPELINE_WARP_NONE; }
    cfg->warp_search.n_budget = N_BUDGET;
    cfg->warp_search.n_cols = 4u;
    cfg->warp_search.n_rows = 3u;
    cfg->warp_search.n_min = 5u;
    cfg->n_warp_events = N_KEPT;
}

static evs_pipeline_config_t any_config(void)
{
    evs_camera_config_t camera = evs_camera_config_ideal(W, H, (int32_t)((20u + below(60u)) << 16));
    camera.model = (below(2u) == 0u) ? EVS_CAMERA_PINHOLE : EVS_CAMERA_FISHEYE;
    camera.dist_q32[0] = (int64_t)any_i32(1 << 30);
    evs_pipeline_config_t cfg = evs_pipeline_config_default(&camera);
    cfg.table_step_px = (below(2u) == 0u) ? 4u : 8u;
    cfg.tile_table = below(2u) == 0u;
    cfg.n_cols = 5u;
    cfg.n_rows = 4u;
    cfg.n_fifo = N_FIFO;
    cfg.n_ring = N_RING;
    cfg.n_batch = 1u + below(N_BATCH);
    cfg.source = (evs_pipeline_source_t)below(3u);
    cfg.window.kind = (evs_window_kind_t)below(3u);
    cfg.window.threshold = 1u + below(40u);
    cfg.window.duration_us = 1u + below(5000u);
    cfg.window.max_duration_us = 1u + below(20000u);
    cfg.window.min_duration_us = below(cfg.window.max_duration_us);
    cfg.stabilize.rotation = (evs_rotation_t)below(2u);
    cfg.stabilize.saccade_px_q4 = (uint16_t)below(200u);
    cfg.attitude.mode = (evs_attitude_mode_t)below(3u);
    cfg.max_wait_us = below(5000u);
    ask_for_images(&cfg);
    return cfg;
}

static uint32_t n_given;
static uint32_t n_backwards;
static uint32_t n_in_window;
static uint32_t n_windows;
static uint32_t n_images;
static uint32_t n_results; /* in all runs, and valid ones */
static uint32_t n_valid;
static uint32_t last_t_us;
static bool have_last;

static void take(const evs_pipeline_chunk_t *c)
{
    for (size_t i = 0; i < c->n; i++) {
        if (have_last && (evs_time_diff_us(c->events[i].t_us, last_t_us) < 0)) { n_backwards++; }
        last_t_us = c->events[i].t_us;
        have_last = true;
        const evs_point_t s = c->stabilized[i];
        TEST_ASSERT_TRUE(evs_point_is_outside(s) == (s.y_q4 == EVS_POINT_OUTSIDE_Q4));
        if (!c->oriented) { TEST_ASSERT_TRUE(evs_point_is_outside(s)); }
        if (evs_point_is_outside(c->undistorted[i])) { TEST_ASSERT_TRUE(evs_point_is_outside(s)); }
    }
    n_given += (uint32_t)c->n;
    n_in_window += (uint32_t)c->n;
    if (c->end.reason != EVS_WINDOW_OPEN) {
        TEST_ASSERT_EQUAL_UINT32(n_in_window, c->end.n_events);
        TEST_ASSERT_EQUAL_UINT32(c->window, c->end.index);
        n_in_window = 0u;
        n_windows++;
        n_images += (c->image.px != NULL) ? 1u : 0u;
    } else {
        TEST_ASSERT_NULL(c->image.px);
    }
}

static void assert_unit(evs_vec3_t v)
{
    TEST_ASSERT_INT64_WITHIN(INT64_C(1) << 36, INT64_C(1) << 60, (int64_t)evs_vec3_norm_sq(v));
}

static void work(const evs_pipeline_config_t *cfg)
{
    evs_velocity_result_t r;
    if (!evs_pipeline_velocity(&p, 1u + below(50u), &r)) { return; }
    TEST_ASSERT_TRUE(cfg->velocity_on);
    n_results++;
    TEST_ASSERT_TRUE(r.n_flow <= r.n_corners);
    const uint32_t bad = EVS_VELOCITY_FEW | EVS_VELOCITY_STILL | EVS_VELOCITY_UNSOLVED | EVS_VELOCITY_UNLIKE;
    TEST_ASSERT_TRUE(((r.flags & EVS_VELOCITY_VALID) != 0u) == ((r.flags & bad) == 0u));
    TEST_ASSERT_TRUE((r.interval_us >= cfg->velocity.keyframes.baseline_min_us / 2u) &&
                     (r.interval_us <= cfg->velocity.keyframes.age_max_us));
    if ((r.flags & EVS_VELOCITY_VALID) == 0u) { return; }
    n_valid++;
    TEST_ASSERT_TRUE(r.n_flow >= cfg->velocity.min_features);
    assert_unit(r.v_r_q30);
    if ((r.flags & EVS_VELOCITY_NO_ORIENTATION) == 0u) { assert_unit(r.v_c_q30); }
}

static void pull_all(void)
{
    evs_pipeline_chunk_t c;
    while (evs_pipeline_pull(&p, &c)) { take(&c); }
}

static void push_sample(const evs_pipeline_config_t *cfg, uint32_t t_us)
{
    if (cfg->source == EVS_PIPELINE_IMU) {
        switch (below(3u)) {
        case 0:
            evs_pipeline_push_accel(&p, t_us, any_vec3(12 << 20));
            break;
        case 1:
            evs_pipeline_push_mag(&p, t_us, any_vec3(60 << 16));
            break;
        default:
            evs_pipeline_push_gyro(&p, t_us, any_vec3(20 << 24));
            break;
        }
    } else if (cfg->source == EVS_PIPELINE_ORIENTATION) {
        const evs_vec3_t turn = any_vec3(1 << 28);
        const evs_orientation_t s = {t_us, evs_quat_from_rotvec(turn), any_vec3(20 << 24)};
        (void)evs_pipeline_push_orientation(&p, &s);
    }
}

static void test_nothing_is_lost_or_given_twice_whatever_is_pushed(void)
{
    for (uint32_t run = 0; run < N_RUNS; run++) {
        state = UINT64_C(88172645463325252) + run;
        const evs_pipeline_config_t cfg = any_config();
        const evs_status_t status = evs_pipeline_init(&p, &cfg, memory, sizeof memory);
        if (status == EVS_ERR_NUMERIC) { continue; } /* a lens that folds over at once */
        TEST_ASSERT_EQUAL_INT(EVS_OK, status);
        n_given = 0u;
        n_backwards = 0u;
        n_in_window = 0u;
        n_windows = 0u;
        n_images = 0u;
        have_last = false;
        uint32_t t_us = next_u32();
        for (int step = 0; step < N_STEPS; step++) {
            if (below(2u) == 0u) {
                push_sample(&cfg, t_us + below(2000u));
            } else {
                evs_event_t ev[8];
                for (size_t i = 0; i < 8u; i++) {
                    t_us = step_time(t_us);
                    ev[i] = evs_event_make(t_us, (uint16_t)below(W + 2u), (uint16_t)below(H + 2u), below(2u) == 0u);
                }
                size_t done = 0u;
                for (int round = 0; (done < 8u) && (round < 1000); round++) {
                    done += evs_pipeline_push_events(&p, ev + done, 8u - done);
                    if (done < 8u) { pull_all(); }
                }
                TEST_ASSERT_EQUAL_UINT_MESSAGE(8u, done, "locked up");
            }
            if (below(3u) == 0u) { pull_all(); }
            if (below(2u) == 0u) { work(&cfg); }
        }
        evs_pipeline_finish(&p);
        pull_all();
        const evs_pipeline_counts_t counts = evs_pipeline_counts(&p);
        TEST_ASSERT_EQUAL_UINT32(counts.n_events, n_given);
        TEST_ASSERT_TRUE_MESSAGE(n_backwards <= counts.n_restarts, "out of order");
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(0u, n_in_window, "a window was left open");
        TEST_ASSERT_EQUAL_UINT32(counts.n_images, n_images);
        if (cfg.image != EVS_PIPELINE_IMAGE_NONE) {
            TEST_ASSERT_EQUAL_UINT32(n_windows, n_images + counts.n_images_busy + counts.n_images_incomplete);
        }
    }
    TEST_ASSERT_TRUE(n_results > 100u);
    TEST_ASSERT_TRUE_MESSAGE(n_valid <= n_results / 50u, "random events have no direction");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_nothing_is_lost_or_given_twice_whatever_is_pushed);
    return UNITY_END();
}
