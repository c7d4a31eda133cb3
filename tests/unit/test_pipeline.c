/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/pipeline.h"
#include "model.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { W = 64, H = 48, STEP = 1, N_FIFO = 256, N_RING = 8, N_BATCH = 32, COLS = 4, ROWS = 3 };

#define FOCAL 60.0
#define BYTES EVS_PIPELINE_BYTES(W, H, STEP, true, COLS *ROWS, N_FIFO, N_RING, N_BATCH)

static evs_pipeline_t p;
static uint64_t memory[BYTES / 8u + 1u]; /* the last word is a canary */
static evs_camera_config_t camera;
static double spin_rad_s; /* how fast the camera turns about its y axis, on top of its swing */

static evs_pipeline_config_t config(evs_pipeline_source_t source)
{
    evs_pipeline_config_t cfg = evs_pipeline_config_default(&camera);
    cfg.source = source;
    cfg.tile_table = true;
    cfg.n_cols = COLS;
    cfg.n_rows = ROWS;
    cfg.n_fifo = N_FIFO;
    cfg.n_ring = N_RING;
    cfg.n_batch = N_BATCH;
    cfg.window.kind = EVS_WINDOW_COUNT;
    cfg.window.threshold = 100u;
    return cfg;
}

static void init(const evs_pipeline_config_t *cfg)
{
    TEST_ASSERT_TRUE(evs_pipeline_bytes(cfg) <= BYTES);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_init(&p, cfg, memory, BYTES));
}

void setUp(void)
{
    memory[BYTES / 8u] = UINT64_C(0x5A5A5A5A5A5A5A5A);
    camera = evs_camera_config_ideal(W, H, evs_q_from_double(FOCAL, 16));
    spin_rad_s = 0.0;
}
void tearDown(void) { TEST_ASSERT_TRUE_MESSAGE(memory[BYTES / 8u] == UINT64_C(0x5A5A5A5A5A5A5A5A), "wrote past"); }

/* --- a small world: a camera that swings, and events all over the sensor ----------------------------------------- */

static model_quat_t swing(double t_s)
{
    return model_exp(0.05 * sin(9.0 * t_s), 0.12 * sin(7.0 * t_s) + spin_rad_s * t_s, 0.3 * t_s);
}

static evs_orientation_t swing_sample(uint32_t t_us, uint32_t t0_us)
{
    const double t_s = (t_us - t0_us) * 1e-6;
    const double h = 1e-5;
    const model_quat_t d = model_mul(model_conj(swing(t_s - h)), swing(t_s + h));
    const evs_orientation_t s = {.t_us = t_us,
                                 .q_wc = model_to_fixed(swing(t_s)),
                                 .rate_rad_s_q24 = evs_vec3_from_double(d.x / h, d.y / h, d.z / h, 24)};
    return s;
}

static evs_event_t event_at(uint32_t t_us)
{
    const uint32_t hash = (t_us * 2654435761u) >> 8;
    return evs_event_make(t_us, (uint16_t)(hash % W), (uint16_t)((hash / W) % H), (hash & 1u) != 0u);
}

enum { N_OUT = 6000 };
static evs_event_t out_events[N_OUT];
static evs_point_t out_undistorted[N_OUT];
static evs_point_t out_stabilized[N_OUT];
static bool out_oriented[N_OUT];
static uint32_t out_window[N_OUT];
static size_t n_out;
static evs_window_end_t out_ends[N_OUT];
static bool out_saccade[N_OUT];
static evs_quat_t out_q_rc[N_OUT];
static size_t n_ends;

static void pull_all(void)
{
    evs_pipeline_chunk_t c;
    while (evs_pipeline_pull(&p, &c)) {
        TEST_ASSERT_TRUE(c.n <= N_BATCH);
        for (size_t i = 0; i < c.n; i++) {
            out_events[n_out] = c.events[i];
            out_undistorted[n_out] = c.undistorted[i];
            out_stabilized[n_out] = c.stabilized[i];
            out_oriented[n_out] = c.oriented;
            out_window[n_out] = c.window;
            n_out++;
        }
        if (c.end.reason != EVS_WINDOW_OPEN) {
            out_saccade[n_ends] = c.saccade;
            out_q_rc[n_ends] = c.q_rc;
            out_ends[n_ends++] = c.end;
        }
    }
}

/* Feed `n` events, 100 us apart, and orientations every 2 ms, as a firmware loop would; events in lots of `lot`. */
static void fly(uint32_t t0_us, size_t n, size_t lot)
{
    n_out = 0u;
    n_ends = 0u;
    uint32_t next_sample_us = t0_us;
    evs_event_t batch[64];
    size_t sent = 0u;
    while (sent < n) {
        const size_t size = (lot < n - sent) ? lot : n - sent;
        for (size_t i = 0; i < size; i++) { batch[i] = event_at(t0_us + (uint32_t)(100u * (sent + i))); }
        size_t done = 0u;
        while (done < size) {
            done += evs_pipeline_push_events(&p, batch + done, size - done);
            pull_all();
        }
        sent += size;
        while (evs_time_diff_us(t0_us + (uint32_t)(100u * sent), next_sample_us) >= 0) {
            const evs_orientation_t s = swing_sample(next_sample_us, t0_us);
            TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_push_orientation(&p, &s));
            next_sample_us += 2000u;
            pull_all();
        }
    }
    const evs_orientation_t s = swing_sample(next_sample_us, t0_us);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_push_orientation(&p, &s));
    evs_pipeline_finish(&p);
    pull_all();
}

/* The points of a flight of n events against the motion itself. */
static void assert_points_follow(uint32_t t0_us, size_t n, size_t n_checked_min)
{
    evs_pipeline_config_t cfg = config(EVS_PIPELINE_ORIENTATION);
    cfg.stabilize.saccade_px_q4 = EVS_STABILIZE_SACCADE_OFF;
    init(&cfg);
    fly(t0_us, n, 40u);
    TEST_ASSERT_EQUAL_UINT(n, n_out);
    const double cx = (W - 1) / 2.0, cy = (H - 1) / 2.0;
    size_t n_checked = 0u;
    for (size_t i = 0; i < n_out; i++) {
        const evs_event_t want = event_at(t0_us + (uint32_t)(100u * i));
        TEST_ASSERT_EQUAL_MEMORY(&want, &out_events[i], sizeof want);
        TEST_ASSERT_TRUE(out_oriented[i]);
        TEST_ASSERT_EQUAL_INT16(16 * evs_event_x_px(want), out_undistorted[i].x_q4);
        const double ray[3] = {(evs_event_x_px(want) - cx) / FOCAL, (evs_event_y_px(want) - cy) / FOCAL, 1.0};
        double r[3];
        model_rotate(model_mul(model_conj(swing(0.0)), swing(1e-4 * (double)i)), ray, r);
        if (r[2] < 0.2) { continue; }
        /* 1/4 px of smear at the centre, more towards the border by 1 + tan^2; the kernel's 3/64 px. */
        const double tan_sq = (r[0] * r[0] + r[1] * r[1]) / (r[2] * r[2]);
        const double tolerance = 0.25 * (1.0 + tan_sq) + 3.0 / 64.0;
        TEST_ASSERT_DOUBLE_WITHIN(tolerance, cx + FOCAL * r[0] / r[2], out_stabilized[i].x_q4 / 16.0);
        TEST_ASSERT_DOUBLE_WITHIN(tolerance, cy + FOCAL * r[1] / r[2], out_stabilized[i].y_q4 / 16.0);
        n_checked++;
    }
    TEST_ASSERT_TRUE(n_checked > n_checked_min);
}

static void test_points_follow_the_real_motion_within_the_allowed_smear(void)
{
    assert_points_follow(0xFFFF0000u, 5000u, 4900u); /* the clock wraps during the flight */
    TEST_ASSERT_EQUAL_UINT(50u, n_ends);
    TEST_ASSERT_EQUAL_UINT32(4999u / 100u, out_window[n_out - 1u]);
}

static void test_fast_turns_smear_no_more_in_long_slices_and_in_short_ones(void)
{
    static const double SPINS[] = {8.0, 30.0}; /* the longest slice just smears by 1/4 px; slices of a quarter of it */
    for (size_t i = 0; i < 2u; i++) {
        spin_rad_s = SPINS[i];
        assert_points_follow(1000u, (size_t)(4000.0 / SPINS[i]), 100u);
    }
}

static void test_output_does_not_depend_on_how_the_input_is_split(void)
{
    static evs_point_t first[N_OUT];
    static evs_window_end_t first_ends[N_OUT];
    size_t n_first = 0u;
    static const size_t LOTS[] = {1u, 7u, 20u, 64u};
    for (size_t k = 0; k < 4u; k++) {
        const evs_pipeline_config_t cfg = config(EVS_PIPELINE_ORIENTATION);
        init(&cfg);
        fly(777u, 3000u, LOTS[k]);
        TEST_ASSERT_EQUAL_UINT(3000u, n_out);
        TEST_ASSERT_EQUAL_UINT32(0u, evs_pipeline_counts(&p).n_unoriented);
        if (k == 0u) {
            memcpy(first, out_stabilized, sizeof first);
            memcpy(first_ends, out_ends, sizeof first_ends);
            n_first = n_ends;
        }
        TEST_ASSERT_EQUAL_MEMORY(first, out_stabilized, n_out * sizeof first[0]);
        TEST_ASSERT_EQUAL_UINT(n_first, n_ends);
        TEST_ASSERT_EQUAL_MEMORY(first_ends, out_ends, n_ends * sizeof first_ends[0]);
    }
}

static void test_window_rotation_turns_the_whole_window_by_its_first_event(void)
{
    evs_pipeline_config_t cfg = config(EVS_PIPELINE_ORIENTATION);
    cfg.stabilize.rotation = EVS_ROTATION_WINDOW;
    cfg.stabilize.saccade_px_q4 = EVS_STABILIZE_SACCADE_OFF;
    init(&cfg);
    fly(5000u, 1000u, 30u);
    for (size_t i = 0; i < n_out; i++) {
        evs_homography_t h;
        evs_homography_set(&h, &p.cfg.stabilize.pinhole, out_q_rc[out_window[i]]);
        evs_point_t want;
        evs_homography_map(&h, &out_undistorted[i], 1u, &want);
        TEST_ASSERT_EQUAL_MEMORY(&want, &out_stabilized[i], sizeof want);
    }
    const model_quat_t want_q = model_mul(model_conj(swing(0.0)), swing(0.05));
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.0, model_angle(want_q, model_from_fixed(out_q_rc[5])));
}

static void test_saccade_is_flagged_on_the_window_that_starts_the_new_reference(void)
{
    evs_pipeline_config_t cfg = config(EVS_PIPELINE_ORIENTATION);
    cfg.stabilize.saccade_px_q4 = 16u * 3u;
    init(&cfg);
    fly(0u, 3000u, 20u);
    size_t n_saccades = 0u;
    for (size_t i = 0; i < n_ends; i++) {
        const double angle = model_angle(model_from_fixed(out_q_rc[i]), (model_quat_t){1, 0, 0, 0});
        if (out_saccade[i] || (i == 0u)) { TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0.0, angle); }
        n_saccades += out_saccade[i] ? 1u : 0u;
    }
    TEST_ASSERT_TRUE(n_saccades >= 2u);
    TEST_ASSERT_FALSE(out_saccade[0]);
}

static void test_event_waits_for_its_orientation_and_then_for_no_longer_than_allowed(void)
{
    evs_pipeline_config_t cfg = config(EVS_PIPELINE_ORIENTATION);
    cfg.max_wait_us = 3000u;
    cfg.track.max_predict_us = 4000u;
    init(&cfg);
    evs_pipeline_chunk_t chunk;
    evs_orientation_t s = swing_sample(0u, 0u);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_push_orientation(&p, &s));
    evs_event_t ev = event_at(100u);
    TEST_ASSERT_EQUAL_UINT(1u, evs_pipeline_push_events(&p, &ev, 1u));
    TEST_ASSERT_FALSE(evs_pipeline_pull(&p, &chunk)); /* the middle of its slice is not known yet */
    s = swing_sample(1000u, 0u);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_push_orientation(&p, &s));
    TEST_ASSERT_TRUE(evs_pipeline_pull(&p, &chunk));
    TEST_ASSERT_TRUE(chunk.oriented);
    TEST_ASSERT_EQUAL_UINT(1u, chunk.n);

    ev = event_at(2000u); /* ahead of the newest orientation: waits until the events are 3 ms further, then predicts */
    TEST_ASSERT_EQUAL_UINT(1u, evs_pipeline_push_events(&p, &ev, 1u));
    TEST_ASSERT_FALSE(evs_pipeline_pull(&p, &chunk));
    ev = event_at(4999u);
    TEST_ASSERT_EQUAL_UINT(1u, evs_pipeline_push_events(&p, &ev, 1u));
    TEST_ASSERT_FALSE(evs_pipeline_pull(&p, &chunk));
    ev = event_at(5001u); /* more than 4 ms past the newest orientation: too far to predict */
    TEST_ASSERT_EQUAL_UINT(1u, evs_pipeline_push_events(&p, &ev, 1u));
    TEST_ASSERT_TRUE(evs_pipeline_pull(&p, &chunk));
    TEST_ASSERT_TRUE(chunk.oriented);
    TEST_ASSERT_FALSE(evs_pipeline_pull(&p, &chunk));
    evs_pipeline_finish(&p);
    TEST_ASSERT_TRUE(evs_pipeline_pull(&p, &chunk));
    TEST_ASSERT_TRUE(chunk.oriented);    /* 4999 us */
    TEST_ASSERT_EQUAL_UINT(2u, chunk.n); /* 5001 us lies in the same slice */
    TEST_ASSERT_TRUE(evs_pipeline_pull(&p, &chunk));
    TEST_ASSERT_EQUAL_UINT(0u, chunk.n);
    TEST_ASSERT_EQUAL_INT(EVS_WINDOW_BY_FLUSH, chunk.end.reason);
    TEST_ASSERT_EQUAL_UINT32(4u, chunk.end.n_events);
    TEST_ASSERT_FALSE(evs_pipeline_pull(&p, &chunk));
}

static void test_events_without_an_orientation_come_out_as_outside_and_counted(void)
{
    const evs_pipeline_config_t cfg = config(EVS_PIPELINE_ORIENTATION);
    init(&cfg);
    n_out = 0u;
    n_ends = 0u;
    for (uint32_t i = 0; i < 50u; i++) {
        const evs_event_t ev = event_at(100u * i);
        TEST_ASSERT_EQUAL_UINT(1u, evs_pipeline_push_events(&p, &ev, 1u));
    }
    evs_pipeline_finish(&p);
    pull_all();
    TEST_ASSERT_EQUAL_UINT(50u, n_out);
    for (size_t i = 0; i < n_out; i++) {
        TEST_ASSERT_FALSE(out_oriented[i]);
        TEST_ASSERT_TRUE(evs_point_is_outside(out_stabilized[i]));
        TEST_ASSERT_FALSE(evs_point_is_outside(out_undistorted[i]));
    }
    TEST_ASSERT_EQUAL_UINT32(50u, evs_pipeline_counts(&p).n_unoriented);
}

static void test_without_a_source_events_are_undistorted_and_windowed_at_once(void)
{
    const evs_pipeline_config_t cfg = config(EVS_PIPELINE_NONE);
    init(&cfg);
    n_out = 0u;
    n_ends = 0u;
    for (uint32_t i = 0; i < 250u; i++) {
        const evs_event_t ev = event_at(10u * i);
        TEST_ASSERT_EQUAL_UINT(1u, evs_pipeline_push_events(&p, &ev, 1u));
        pull_all();
    }
    TEST_ASSERT_EQUAL_UINT(250u, n_out);
    TEST_ASSERT_EQUAL_UINT(2u, n_ends);
    TEST_ASSERT_EQUAL_MEMORY(out_undistorted, out_stabilized, n_out * sizeof out_stabilized[0]);
    TEST_ASSERT_EQUAL_UINT32(0u, evs_pipeline_counts(&p).n_unoriented);
}

static void test_bad_events_are_counted_and_harm_nothing(void)
{
    const evs_pipeline_config_t cfg = config(EVS_PIPELINE_NONE);
    init(&cfg);
    n_out = 0u;
    n_ends = 0u;
    const evs_event_t ev[] = {evs_event_make(100u, 3u, 4u, true), evs_event_make(99u, 3u, 4u, true),
                              evs_event_make(100u, W, 4u, true), evs_event_make(101u, 3u, H, false),
                              evs_event_make(102u, 5u, 6u, true)};
    TEST_ASSERT_EQUAL_UINT(5u, evs_pipeline_push_events(&p, ev, 5u));
    pull_all();
    TEST_ASSERT_EQUAL_UINT(4u, n_out);
    TEST_ASSERT_TRUE(evs_point_is_outside(out_stabilized[1]));
    TEST_ASSERT_TRUE(evs_point_is_outside(out_stabilized[2]));
    TEST_ASSERT_EQUAL_INT16(80, out_stabilized[3].x_q4);
    const evs_pipeline_counts_t counts = evs_pipeline_counts(&p);
    TEST_ASSERT_EQUAL_UINT32(4u, counts.n_events);
    TEST_ASSERT_EQUAL_UINT32(1u, counts.n_time_back);
    TEST_ASSERT_EQUAL_UINT32(2u, counts.n_off_sensor);
}

static void test_restarted_clock_closes_the_window_and_goes_on(void)
{
    const evs_pipeline_config_t cfg = config(EVS_PIPELINE_NONE);
    init(&cfg);
    n_out = 0u;
    n_ends = 0u;
    evs_event_t ev[60];
    for (uint32_t i = 0; i < 60u; i++) { ev[i] = event_at((i < 30u) ? 1000000u + i : 1000u + i); }
    size_t done = 0u;
    while (done < 60u) {
        done += evs_pipeline_push_events(&p, ev + done, 60u - done);
        pull_all();
    }
    evs_pipeline_finish(&p);
    pull_all();
    TEST_ASSERT_EQUAL_UINT(60u - EVS_CLOCK_RESTART_AFTER, n_out);
    TEST_ASSERT_EQUAL_UINT(2u, n_ends);
    TEST_ASSERT_EQUAL_INT(EVS_WINDOW_BY_RESTART, out_ends[0].reason);
    TEST_ASSERT_EQUAL_UINT32(30u, out_ends[0].n_events);
    TEST_ASSERT_EQUAL_INT(EVS_WINDOW_BY_FLUSH, out_ends[1].reason);
    TEST_ASSERT_EQUAL_UINT32(1u, evs_pipeline_counts(&p).n_restarts);
    TEST_ASSERT_EQUAL_UINT32(EVS_CLOCK_RESTART_AFTER, evs_pipeline_counts(&p).n_time_back);
}

static void test_full_fifo_takes_no_more_and_never_locks_up(void)
{
    const evs_pipeline_config_t cfg = config(EVS_PIPELINE_ORIENTATION); /* no orientation ever comes */
    init(&cfg);
    n_out = 0u;
    n_ends = 0u;
    evs_event_t ev[2 * N_FIFO];
    for (uint32_t i = 0; i < 2u * N_FIFO; i++) { ev[i] = event_at(i); } /* too close in time to give up waiting */
    TEST_ASSERT_EQUAL_UINT(N_FIFO, evs_pipeline_push_events(&p, ev, 2u * N_FIFO));
    size_t done = N_FIFO;
    for (int round = 0; (round < 100) && (done < 2u * N_FIFO); round++) {
        pull_all();
        done += evs_pipeline_push_events(&p, ev + done, 2u * N_FIFO - done);
    }
    TEST_ASSERT_EQUAL_UINT(2u * N_FIFO, done);
    evs_pipeline_finish(&p);
    pull_all();
    TEST_ASSERT_EQUAL_UINT(2u * N_FIFO, n_out);
}

static void test_imu_samples_become_camera_orientations(void)
{
    /* The IMU is mounted a quarter turn about z; the camera turns about its own x at 0.5 rad/s. */
    evs_pipeline_config_t cfg = config(EVS_PIPELINE_IMU);
    cfg.q_ci = model_to_fixed(model_exp(0, 0, MODEL_PI / 2));
    cfg.attitude.mode = EVS_ATTITUDE_GYRO_ONLY;
    init(&cfg);
    evs_orientation_t at;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_STATE, evs_pipeline_newest_orientation(&p, &at));
    double rate_i[3];
    const double rate_c[3] = {0.5, 0.0, 0.0};
    model_rotate(model_exp(0, 0, -MODEL_PI / 2), rate_c, rate_i);
    const evs_vec3_t gyro = evs_vec3_from_double(rate_i[0], rate_i[1], rate_i[2], 24);
    evs_orientation_t start = {0};
    for (uint32_t i = 0; i <= 1000u; i++) {
        evs_pipeline_push_gyro(&p, 1000u * i, gyro);
        if (i == 100u) { TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_newest_orientation(&p, &start)); }
    }
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_newest_orientation(&p, &at));
    TEST_ASSERT_EQUAL_UINT32(1000000u, at.t_us);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.5, evs_q_to_double(at.rate_rad_s_q24.x, 24));
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.0, evs_q_to_double(at.rate_rad_s_q24.y, 24));
    const model_quat_t turned = model_mul(model_conj(model_from_fixed(start.q_wc)), model_from_fixed(at.q_wc));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.0, model_angle(turned, model_exp(0.45, 0, 0)));
    evs_pipeline_push_accel(&p, 1000500u, evs_vec3_from_double(0, 0, 9.81, 20));
    evs_pipeline_push_mag(&p, 1000500u, evs_vec3_from_double(0, 20, -40, 16));
    TEST_ASSERT_EQUAL_PTR(&p.attitude, evs_pipeline_attitude(&p));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_pipeline_newest_orientation(&p, NULL));
}

/* The rotation from one orientation to the other, in rad. */
static double between(evs_quat_t a, evs_quat_t b) { return model_angle(model_from_fixed(a), model_from_fixed(b)); }

/*
 * Switched on in motion: the filter starts 0.4 rad off and learns better; the view must turn by what the gyro says, from
 * the time at which somebody looks first to 1 s. Then the carrier comes to rest.
 * @return how far it did not. The angle between attitude and view in *apart.
 */
static double view_error_after_1_s(uint32_t view_tau_ms, uint16_t rate_max_mrad_s, double *apart)
{
    evs_pipeline_config_t cfg = config(EVS_PIPELINE_IMU);
    cfg.view_tau_ms = view_tau_ms;
    cfg.view_rate_max_mrad_s = rate_max_mrad_s;
    cfg.attitude.learn_bias = false;
    init(&cfg);
    const evs_event_t ev = event_at(1000u);
    evs_orientation_t before = {0};
    evs_orientation_t at = {0};
    for (uint32_t ms = 0; ms <= 1000u; ms++) {
        const double push = (ms < 500u) ? 4.0 : -4.0; /* an acceleration that averages out */
        evs_pipeline_push_accel(&p, 1000u * ms, evs_vec3_from_double(push, 0, 9.81, 20));
        evs_pipeline_push_gyro(&p, 1000u * ms, evs_vec3_from_double(0, 0, 0.5, 24));
        if (ms == 3u) { /* the first window: from here on somebody looks */
            TEST_ASSERT_EQUAL_UINT(1u, evs_pipeline_push_events(&p, &ev, 1u));
            pull_all();
            TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_newest_orientation(&p, &before));
        }
    }
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_newest_orientation(&p, &at));
    *apart = between(evs_attitude_orientation(evs_pipeline_attitude(&p)), at.q_wc);
    const model_quat_t turned = model_mul(model_conj(model_from_fixed(before.q_wc)), model_from_fixed(at.q_wc));
    return model_angle(turned, model_exp(0, 0, 0.5 * 0.997));
}

/* Rest, samples at 100 Hz after from_ms up to to_ms; returns by how much the view turns. */
static double view_turns_at_rest(uint32_t from_ms, uint32_t to_ms)
{
    evs_orientation_t before = {0};
    evs_orientation_t at = {0};
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_newest_orientation(&p, &before));
    for (uint32_t ms = from_ms + 10u; ms <= to_ms; ms += 10u) {
        evs_pipeline_push_accel(&p, 1000u * ms, evs_vec3_from_double(0, 0, 9.81, 20));
        evs_pipeline_push_gyro(&p, 1000u * ms, evs_vec3_from_double(0, 0, 0, 24));
    }
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_newest_orientation(&p, &at));
    return between(before.q_wc, at.q_wc);
}

static void test_view_turns_by_the_gyro_while_the_attitude_still_settles(void)
{
    n_out = 0u;
    n_ends = 0u;
    double apart;
    const double at_once = view_error_after_1_s(0u, 0u, &apart);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0.0, apart);
    TEST_ASSERT_TRUE(at_once > 0.1);
    const double held = view_error_after_1_s(10000u, 4u, &apart);
    TEST_ASSERT_TRUE(apart > 0.05);
    TEST_ASSERT_TRUE(held < 1e-5);
}

static void test_view_gives_up_slowly_what_it_kept_while_the_attitude_settled(void)
{
    const uint16_t rate_max_mrad_s[3] = {4u, 2u, 0u};
    double turned[3];
    for (int k = 0; k < 3; k++) {
        double apart;
        (void)view_error_after_1_s(10000u, rate_max_mrad_s[k], &apart);
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.0025,
                                  view_turns_at_rest(1000u, 2900u)); /* 0.5 rad/s, ebbing away over 10 ms */
        turned[k] = view_turns_at_rest(2900u, 5900u);                /* 3 s after the start the attitude has settled */
        if (k == 2) { break; }
        (void)view_turns_at_rest(5900u, 40900u);
        turned[k] = view_turns_at_rest(40900u, 41900u);
        TEST_ASSERT_TRUE(view_turns_at_rest(42100u, 42110u) > 0.1);  /* after a gap it takes over the attitude, */
        TEST_ASSERT_TRUE(view_turns_at_rest(42110u, 43110u) < 1e-5); /* and keeps nothing */
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.0002, 0.004, turned[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.0002, 0.002, turned[1]);
    TEST_ASSERT_TRUE(turned[2] > 0.05); /* a quarter of 0.37 rad */
}

static void test_view_takes_over_later_corrections_with_its_time_constant(void)
{
    const evs_pipeline_config_t cfg = config(EVS_PIPELINE_IMU);
    init(&cfg);
    evs_pipeline_push_accel(&p, 0u, evs_vec3_from_double(0, 0, 9.81, 20));
    evs_pipeline_push_gyro(&p, 0u, evs_vec3_from_double(0, 0, 0, 24));
    (void)view_turns_at_rest(0u, 4000u);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_set_orientation(&p.attitude, model_to_fixed(model_exp(0, 0, 0.5))));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.5, view_turns_at_rest(4000u, 4010u)); /* north is found: at once */
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_set_orientation(&p.attitude, model_to_fixed(model_exp(0, 0, 0.6))));
    TEST_ASSERT_DOUBLE_WITHIN(0.0001, 0.1 * (1.0 - exp(-0.1)), view_turns_at_rest(4010u, 5010u));
}

static void test_view_takes_a_rate_between_two_samples_as_a_straight_line(void)
{
    evs_pipeline_config_t cfg = config(EVS_PIPELINE_IMU);
    cfg.attitude.mode = EVS_ATTITUDE_GYRO_ONLY;
    init(&cfg);
    evs_orientation_t start = {0};
    evs_orientation_t at = {0};
    for (uint32_t i = 0; i <= 100u; i++) { /* 100 Hz, so that an interval counts */
        const double rate_rad_s = 2.0 * (0.01 * i);
        evs_pipeline_push_gyro(&p, 10000u * i, evs_vec3_from_double(0, rate_rad_s, 0, 24));
        if (i == 0u) { TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_newest_orientation(&p, &start)); }
    }
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_newest_orientation(&p, &at));
    const model_quat_t turned = model_mul(model_conj(model_from_fixed(start.q_wc)), model_from_fixed(at.q_wc));
    TEST_ASSERT_DOUBLE_WITHIN(0.001, 0.0, model_angle(turned, model_exp(0, 1.0, 0))); /* by the last rate alone: 0.01 */
}

static void test_table_in_flash_gives_the_bits_of_a_table_built_here(void)
{
    camera.dist_q32[0] = -(INT64_C(1) << 30);
    evs_pipeline_config_t cfg = config(EVS_PIPELINE_NONE);
    cfg.table_step_px = 8u;
    init(&cfg);
    n_out = 0u;
    n_ends = 0u;
    for (uint32_t i = 0; i < 200u; i++) {
        const evs_event_t ev = event_at(10u * i);
        TEST_ASSERT_EQUAL_UINT(1u, evs_pipeline_push_events(&p, &ev, 1u));
        pull_all();
    }
    static evs_point_t built[200];
    memcpy(built, out_stabilized, sizeof built);

    static evs_point_t flash[EVS_UNDISTORT_POINTS(W, H, 8u)];
    evs_camera_t lens;
    evs_undistort_t u;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_camera_init(&lens, &camera));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_undistort_build(&u, &lens, 8u, flash, sizeof flash / sizeof flash[0]));
    const size_t with_table = evs_pipeline_bytes(&cfg);
    cfg.table = flash;
    cfg.n_table = sizeof flash / sizeof flash[0];
    TEST_ASSERT_EQUAL_UINT(with_table - EVS_PIPELINE_PART(sizeof flash), evs_pipeline_bytes(&cfg));
    init(&cfg);
    n_out = 0u;
    for (uint32_t i = 0; i < 200u; i++) {
        const evs_event_t ev = event_at(10u * i);
        TEST_ASSERT_EQUAL_UINT(1u, evs_pipeline_push_events(&p, &ev, 1u));
        pull_all();
    }
    TEST_ASSERT_EQUAL_MEMORY(built, out_stabilized, sizeof built);
}

static void test_init_refuses_what_any_module_refuses_and_leaves_the_context_alone(void)
{
    const evs_pipeline_config_t good = config(EVS_PIPELINE_IMU);
    evs_pipeline_config_t bad[16];
    for (size_t i = 0; i < 16u; i++) { bad[i] = good; }
    bad[0].camera.fx_q16 = 0;
    bad[1].table_step_px = 3u;
    bad[2].n_cols = 0u;
    bad[3].window.threshold = 0u;
    bad[4].source = (evs_pipeline_source_t)3;
    bad[5].attitude.mode = (evs_attitude_mode_t)9;
    bad[6].q_ci = (evs_quat_t){0, 0, 0, 0};
    bad[7].track.max_gap_us = 0u;
    bad[8].stabilize.slice_max_us = 0u;
    bad[9].max_wait_us = 1000001u;
    bad[10].n_fifo = 1u;
    bad[11].n_ring = 3u;
    bad[12].n_batch = good.n_fifo + 1u;
    bad[13].camera.width_px = 0u;
    bad[14].view_tau_ms = 100001u;
    bad[15].view_rate_max_mrad_s = 1001u;
    for (size_t i = 0; i < 16u; i++) {
        p.slice_first_us = 77u;
        TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_pipeline_init(&p, &bad[i], memory, BYTES));
        TEST_ASSERT_EQUAL_UINT32(77u, p.slice_first_us);
    }
    TEST_ASSERT_EQUAL_UINT(0u, evs_pipeline_bytes(&bad[1]));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_pipeline_init(&p, &good, memory, evs_pipeline_bytes(&good) - 1u));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_pipeline_init(&p, &good, (unsigned char *)memory + 4, BYTES - 8u));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_pipeline_init(NULL, &good, memory, BYTES));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_pipeline_init(&p, NULL, memory, BYTES));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_pipeline_init(&p, &good, NULL, BYTES));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_init(&p, &good, memory, evs_pipeline_bytes(&good)));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_points_follow_the_real_motion_within_the_allowed_smear);
    RUN_TEST(test_fast_turns_smear_no_more_in_long_slices_and_in_short_ones);
    RUN_TEST(test_output_does_not_depend_on_how_the_input_is_split);
    RUN_TEST(test_window_rotation_turns_the_whole_window_by_its_first_event);
    RUN_TEST(test_saccade_is_flagged_on_the_window_that_starts_the_new_reference);
    RUN_TEST(test_event_waits_for_its_orientation_and_then_for_no_longer_than_allowed);
    RUN_TEST(test_events_without_an_orientation_come_out_as_outside_and_counted);
    RUN_TEST(test_without_a_source_events_are_undistorted_and_windowed_at_once);
    RUN_TEST(test_bad_events_are_counted_and_harm_nothing);
    RUN_TEST(test_restarted_clock_closes_the_window_and_goes_on);
    RUN_TEST(test_full_fifo_takes_no_more_and_never_locks_up);
    RUN_TEST(test_imu_samples_become_camera_orientations);
    RUN_TEST(test_view_turns_by_the_gyro_while_the_attitude_still_settles);
    RUN_TEST(test_view_gives_up_slowly_what_it_kept_while_the_attitude_settled);
    RUN_TEST(test_view_takes_over_later_corrections_with_its_time_constant);
    RUN_TEST(test_view_takes_a_rate_between_two_samples_as_a_straight_line);
    RUN_TEST(test_table_in_flash_gives_the_bits_of_a_table_built_here);
    RUN_TEST(test_init_refuses_what_any_module_refuses_and_leaves_the_context_alone);
    return UNITY_END();
}
