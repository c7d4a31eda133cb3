/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The pipeline's images and velocity, from events on. */
#include "evs/pipeline.h"
#include "flight.h"
#include "unity.h"

enum { W = 160, H = 120, N_DOTS = 700, N_FIFO = 1024, N_RING = 32, N_BATCH = 64, N_RESULTS = 40, N_LOT = 50 };
enum { STEP_MS = 10, EVENTS_PER_STEP = 2500 };

#define FOCAL     120.0
#define MS        UINT32_C(1000)
#define WINDOW_US (20u * MS)
#define DEG       (MODEL_PI / 180.0)
#define CANARY    UINT64_C(0x5A5A5A5A5A5A5A5A)
/* Enough for every kind of image, and every warp. */
enum { N_KEPT = 12000, N_BUDGET = 2000 };
#define BYTES                                                                                                          \
    (EVS_PIPELINE_BYTES(W, H, 0u, false, 0u, N_FIFO, N_RING, N_BATCH) +                                                \
     EVS_PIPELINE_IMAGE_BYTES(W, H, EVS_PIPELINE_IMAGE_SURFACE, EVS_IWE_NEAREST, EVS_PIPELINE_WARP_PREDICTED, true,    \
                              N_BATCH) +                                                                               \
     EVS_PIPELINE_WARP_BYTES(W, H, N_KEPT, N_BUDGET, EVS_WARP_MAX_PX, 1u) + EVS_VELOCITY_DEFAULT_BYTES(W, H))

EVS_STATIC_ASSERT(EVS_PIPELINE_BYTES(240, 180, 8u, false, 34u * 26u, 2048u, 32u, 128u) +
                          EVS_PIPELINE_VELOCITY_BYTES(240, 180) + sizeof(evs_pipeline_t) <=
                      300000u,
                  "all of it fits into a microcontroller of 320 KB");

static evs_pipeline_t p;
static uint64_t memory[BYTES / 8u + 1u]; /* the last word is a canary */
static evs_camera_config_t camera;
static evs_pinhole_t pinhole;
static evs_point_t table[W * H]; /* an ideal lens: where a pixel is */

/* The flight. */
static double v_w[3];
static double swing_rad;  /* about two axes */
static double spin_rad_s; /* about the vertical axis */
static size_t max_tracks;
static bool never_work;
static bool late_work; /* one step of work a chunk, not all at once */
static uint32_t t_start_us;
static uint32_t t_now_us;
static uint32_t seed;
static double gyro_bias[3]; /* of the gyro, with source IMU */
static int32_t offset_us;   /* of the events' clock against that of the orientations */

/* What came out. */
static evs_velocity_result_t results[N_RESULTS];
static size_t n_results;
static uint32_t n_windows;
static uint32_t n_images;
static uint8_t newest_image[W * H];
static uint32_t image_t_us;
static uint32_t n_window_events;
static uint32_t n_saccade_windows;
static uint32_t n_saccade_windows_warped;

static evs_pipeline_config_t config(void)
{
    evs_pipeline_config_t cfg = evs_pipeline_config_velocity(&camera);
    cfg.source = EVS_PIPELINE_ORIENTATION;
    cfg.table = table;
    cfg.n_table = W * H;
    cfg.n_fifo = N_FIFO;
    cfg.n_ring = N_RING;
    cfg.n_batch = N_BATCH;
    cfg.window.kind = EVS_WINDOW_DURATION;
    cfg.window.duration_us = WINDOW_US;
    return cfg;
}

static void init(const evs_pipeline_config_t *cfg)
{
    const size_t n_bytes = evs_pipeline_bytes(cfg);
    TEST_ASSERT_TRUE((n_bytes > 0u) && (n_bytes <= BYTES));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_init(&p, cfg, memory, n_bytes));
    n_results = 0u;
    n_windows = 0u;
    n_images = 0u;
    n_saccade_windows = 0u;
    n_saccade_windows_warped = 0u;
    t_now_us = t_start_us;
    seed = 1u;
}

void setUp(void)
{
    memory[BYTES / 8u] = CANARY;
    camera = evs_camera_config_ideal(W, H, evs_q_from_double(FOCAL, 16));
    pinhole = (evs_pinhole_t){.width_px = W,
                              .height_px = H,
                              .fx_q16 = camera.fx_q16,
                              .fy_q16 = camera.fy_q16,
                              .cx_q16 = camera.cx_q16,
                              .cy_q16 = camera.cy_q16};
    for (int i = 0; i < W * H; i++) { table[i] = (evs_point_t){(int16_t)(i % W * 16), (int16_t)(i / W * 16)}; }
    flight_make_wall(N_DOTS, 1u);
    v_w[0] = 0.9;
    v_w[1] = 0.2;
    v_w[2] = 0.3;
    swing_rad = 0.06;
    spin_rad_s = 0.0;
    max_tracks = 1000u;
    never_work = false;
    late_work = false;
    offset_us = 0;
    gyro_bias[0] = gyro_bias[1] = gyro_bias[2] = 0.0;
    t_start_us = 9000u;
}
void tearDown(void) { TEST_ASSERT_TRUE_MESSAGE(memory[BYTES / 8u] == CANARY, "wrote past"); }

static model_quat_t camera_at(double t_s)
{
    return model_exp(swing_rad * sin(11.0 * t_s), swing_rad * sin(9.0 * t_s) + spin_rad_s * t_s, 0.0);
}

static double seconds(uint32_t t_us) { return (t_us - t_start_us) * 1e-6; }

static void push_orientation(uint32_t t_us)
{
    const double t_s = seconds(t_us), h = 1e-5;
    const model_quat_t d = model_mul(model_conj(camera_at(t_s - h)), camera_at(t_s + h));
    if (p.cfg.source == EVS_PIPELINE_IMU) {
        const evs_vec3_t rate =
            evs_vec3_from_double(d.x / h + gyro_bias[0], d.y / h + gyro_bias[1], d.z / h + gyro_bias[2], 24);
        evs_pipeline_push_gyro(&p, t_us - (uint32_t)offset_us, rate);
        return;
    }
    const evs_orientation_t s = {.t_us = t_us - (uint32_t)offset_us,
                                 .q_wc = model_to_fixed(camera_at(t_s)),
                                 .rate_rad_s_q24 = evs_vec3_from_double(d.x / h, d.y / h, d.z / h, 24)};
    (void)evs_pipeline_push_orientation(&p, &s);
}

/* A sample every 2 ms, up to 2 ms past the next step. */
static void push_orientations(void)
{
    const bool first = t_now_us == t_start_us;
    for (uint32_t t_ms = first ? 0u : 4u; t_ms <= STEP_MS + 2u; t_ms += 2u) { push_orientation(t_now_us + t_ms * MS); }
}

static void work(void)
{
    while (!never_work && evs_pipeline_velocity_busy(&p)) {
        if (evs_pipeline_velocity(&p, max_tracks, &results[n_results])) { n_results++; }
        if (late_work) { return; }
    }
}

static void take_chunk(const evs_pipeline_chunk_t *c)
{
    if (c->end.reason == EVS_WINDOW_OPEN) {
        TEST_ASSERT_NULL(c->image.px);
        return;
    }
    n_windows++;
    if (c->saccade) {
        n_saccade_windows++;
        n_saccade_windows_warped += p.imaging->warping ? 1u : 0u;
    }
    if (c->image.px == NULL) { return; }
    n_images++;
    TEST_ASSERT_EQUAL_UINT16(W, c->image.width_px);
    TEST_ASSERT_EQUAL_UINT16(H, c->image.height_px);
    TEST_ASSERT_TRUE((c->image_t_us - c->end.t_first_us) <= (c->end.t_last_us - c->end.t_first_us));
    image_t_us = c->image_t_us;
    n_window_events = c->end.n_events;
    memcpy(newest_image, c->image.px, sizeof newest_image);
}

static void pull(void)
{
    evs_pipeline_chunk_t c;
    while (evs_pipeline_pull(&p, &c)) {
        take_chunk(&c);
        work();
    }
}

/* Where each dot is seen now, in 1/16 px; the camera turns, nothing is held still here. */
static bool seen[2][N_DOTS];
static int32_t seen_q4[2][N_DOTS][2];

static void look(int slot, uint32_t t_us)
{
    const double t_s = seconds(t_us);
    const double position[3] = {v_w[0] * t_s, v_w[1] * t_s, v_w[2] * t_s};
    for (size_t i = 0u; i < flight_n_dots; i++) {
        double px[2];
        seen[slot][i] = flight_project(&pinhole, camera_at(t_s), position, flight_dots[i].at, px) &&
                        (fabs(px[0]) < 500) && (fabs(px[1]) < 500);
        if (!seen[slot][i]) { continue; }
        seen_q4[slot][i][0] = (int32_t)floor(px[0] * 16.0 + 0.5);
        seen_q4[slot][i][1] = (int32_t)floor(px[1] * 16.0 + 0.5);
    }
}

/* The next 10 ms: random dots give events, one within a pixel of where it is at that time. */
static evs_event_t step_events[EVENTS_PER_STEP];

static size_t make_step(void)
{
    size_t n = 0u;
    look(0, t_now_us);
    look(1, t_now_us + STEP_MS * MS);
    for (int32_t k = 0; k < EVENTS_PER_STEP; k++) {
        seed = seed * 1664525u + 1013904223u;
        const size_t dot = (seed >> 8) % flight_n_dots;
        if (!seen[0][dot] || !seen[1][dot]) { continue; }
        int32_t at[2];
        for (int axis = 0; axis < 2; axis++) {
            const int32_t from = seen_q4[0][dot][axis], to = seen_q4[1][dot][axis];
            const int32_t jitter = (int32_t)((seed >> (20 + 4 * axis)) & 15u) * 2 - 15;
            at[axis] = (from + (to - from) * k / EVENTS_PER_STEP + jitter + 8) >> 4;
        }
        if ((at[0] < 0) || (at[0] >= W) || (at[1] < 0) || (at[1] >= H)) { continue; }
        const uint32_t t_us = t_now_us + (uint32_t)k * STEP_MS * MS / EVENTS_PER_STEP;
        step_events[n++] = evs_event_make(t_us, (uint16_t)at[0], (uint16_t)at[1], (seed & 0x100u) != 0u);
    }
    return n;
}

static void push_events(size_t n)
{
    for (size_t i = 0u; i < n;) {
        const size_t lot = (n - i < N_LOT) ? n - i : N_LOT;
        i += evs_pipeline_push_events(&p, &step_events[i], lot);
        pull();
    }
}

static void fly_ms(uint32_t duration_ms, bool oriented)
{
    for (uint32_t done_ms = 0u; done_ms < duration_ms; done_ms += STEP_MS) {
        const size_t n = make_step();
        if (oriented) { push_orientations(); }
        push_events(n);
        t_now_us += STEP_MS * MS;
    }
}

static double error_deg(evs_vec3_t v_q30, model_quat_t q_wf)
{
    double want[3];
    double got[3];
    model_rotate(model_conj(q_wf), v_w, want);
    model_from_unit(v_q30, got);
    return model_angle_between(got, want) / DEG;
}

/* Of the results from `from` on, those over at least 50 ms are valid and, in both frames, right: on average within mean_deg,
 * each within three times as much. */
static void assert_right(size_t from, double mean_deg)
{
    double sum_deg = 0.0;
    size_t n_checked = 0u;
    for (size_t i = from; i < n_results; i++) {
        const evs_velocity_result_t *const r = &results[i];
        if (r->interval_us < 50u * MS) { continue; }
        TEST_ASSERT_BITS_HIGH(EVS_VELOCITY_VALID, r->flags);
        TEST_ASSERT_BITS_LOW(EVS_VELOCITY_NO_ORIENTATION, r->flags);
        const double in_camera_deg = error_deg(r->v_c_q30, camera_at(seconds(r->t_us)));
        const double in_reference_deg = error_deg(r->v_r_q30, model_from_fixed(r->q_wr));
        TEST_ASSERT_DOUBLE_WITHIN(0.1, in_reference_deg, in_camera_deg);
        TEST_ASSERT_DOUBLE_WITHIN(3.0 * mean_deg, 0.0, in_camera_deg);
        sum_deg += in_camera_deg;
        n_checked++;
    }
    TEST_ASSERT_TRUE(n_checked >= 3u);
    TEST_ASSERT_DOUBLE_WITHIN(mean_deg, 0.0, sum_deg / (double)n_checked);
}

/* --- velocity ------------------------------------------------------------------------------------------------------ */

static void test_shaken_camera_finds_its_direction_of_flight(void)
{
    const evs_pipeline_config_t cfg = config();
    init(&cfg);
    fly_ms(250u, true);
    TEST_ASSERT_EQUAL_UINT32(12u, n_images); /* the 13th window is open */
    TEST_ASSERT_EQUAL_UINT(11u, n_results);
    assert_right(0u, 4.0);
    const evs_pipeline_counts_t n = evs_pipeline_counts(&p);
    TEST_ASSERT_EQUAL_UINT32(n_images, n.n_images);
    TEST_ASSERT_EQUAL_UINT32(0u, n.n_images_busy);
    TEST_ASSERT_EQUAL_UINT32(n_results, evs_velocity_counts(evs_pipeline_velocity_part(&p)).n_results);
}

/* The gyro alone, which begins where the camera is. */
static void init_by_gyro(evs_pipeline_config_t *cfg)
{
    cfg->source = EVS_PIPELINE_IMU;
    cfg->attitude.mode = EVS_ATTITUDE_GYRO_ONLY;
    init(cfg);
    TEST_ASSERT_EQUAL_INT(EVS_OK,
                          evs_attitude_set_orientation(evs_pipeline_attitude(&p), model_to_fixed(camera_at(0.0))));
}

static double bias_missed(void)
{
    const evs_vec3_t known = evs_pipeline_gyro_bias(&p);
    return sqrt(pow(evs_q_to_double(known.x, 24) - gyro_bias[0], 2) +
                pow(evs_q_to_double(known.y, 24) - gyro_bias[1], 2) +
                pow(evs_q_to_double(known.z, 24) - gyro_bias[2], 2));
}

static void test_bias_of_the_gyro_is_learnt_until_it_is_known(void)
{
    gyro_bias[0] = 0.05;
    gyro_bias[1] = -0.04;
    gyro_bias[2] = 0.06;
    const evs_vec3_t told = evs_vec3_from_double(gyro_bias[0], gyro_bias[1], gyro_bias[2], 24);
    evs_pipeline_config_t cfg = config();
    cfg.velocity.learn_bias = false;
    init_by_gyro(&cfg);
    const double nothing_known = bias_missed();
    fly_ms(300u, true);
    TEST_ASSERT_TRUE_MESSAGE(bias_missed() == nothing_known, "not unless it is asked for");

    cfg.velocity.learn_bias = true;
    init_by_gyro(&cfg);
    fly_ms(300u, true);
    TEST_ASSERT_TRUE_MESSAGE(bias_missed() < 0.95 * nothing_known, "learnt");
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_set_bias(evs_pipeline_attitude(&p), told));
    fly_ms(60u, true);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-6, 0.0, bias_missed(), "once it is known it is not counted twice");

    init_by_gyro(&cfg);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_set_bias(evs_pipeline_attitude(&p), told));
    fly_ms(300u, true);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-6, 0.0, bias_missed(), "nothing is learnt beside one that was told");
    assert_right(0u, 4.0);
}

static void test_offset_between_the_clocks_is_that_of_the_track(void)
{
    offset_us = 25000;
    evs_pipeline_config_t cfg = config();
    cfg.track.offset_us = offset_us;
    init(&cfg);
    fly_ms(250u, true);
    assert_right(0u, 4.0);
}

static void test_backwards_is_told_from_forwards(void)
{
    v_w[0] = -0.2;
    v_w[1] = 0.1;
    v_w[2] = -1.0;
    const evs_pipeline_config_t cfg = config();
    init(&cfg);
    fly_ms(250u, true);
    assert_right(0u, 4.0);
}

static void test_rotation_alone_is_no_flight(void)
{
    v_w[0] = v_w[1] = v_w[2] = 0.0;
    const evs_pipeline_config_t cfg = config();
    init(&cfg);
    fly_ms(200u, true);
    TEST_ASSERT_TRUE(n_results >= 8u);
    for (size_t i = 0u; i < n_results; i++) {
        TEST_ASSERT_BITS_LOW(EVS_VELOCITY_VALID, results[i].flags);
        TEST_ASSERT_BITS_HIGH(EVS_VELOCITY_STILL, results[i].flags);
    }
}

static void test_saccades_cost_no_result(void)
{
    spin_rad_s = 1.2;
    evs_pipeline_config_t cfg = config(); /* a sixth of the width is 27 px: a saccade after some 180 ms */
    init(&cfg);
    fly_ms(400u, true);
    size_t n_turned = 0u;
    for (size_t i = 0u; i < n_results; i++) { n_turned += ((results[i].flags & EVS_VELOCITY_TURNED) != 0u) ? 1u : 0u; }
    TEST_ASSERT_TRUE(n_turned >= 2u);
    TEST_ASSERT_EQUAL_UINT(n_images - 1u, n_results); /* every image but the first found its keyframe */
    assert_right(0u, 4.0);
    cfg.image = EVS_PIPELINE_IMAGE_SURFACE; /* which has no empty memory to lend for turning */
    init(&cfg);
    fly_ms(250u, true);
    TEST_ASSERT_EQUAL_UINT(n_images - 1u, n_results);
    TEST_ASSERT_TRUE(evs_velocity_counts(evs_pipeline_velocity_part(&p)).n_turned >= 1u);
}

static void test_rotation_once_per_window_gives_images_too(void)
{
    swing_rad = 0.01;
    evs_pipeline_config_t cfg = config();
    cfg.stabilize.rotation = EVS_ROTATION_WINDOW;
    init(&cfg);
    fly_ms(200u, true);
    assert_right(0u, 7.0);
}

static void test_time_surface_and_counts_find_it_as_well(void)
{
    static const evs_pipeline_image_t KINDS[] = {EVS_PIPELINE_IMAGE_SURFACE, EVS_PIPELINE_IMAGE_COUNT};
    for (size_t i = 0u; i < 2u; i++) {
        evs_pipeline_config_t cfg = config();
        cfg.image = KINDS[i];
        cfg.velocity.min_features = 12u; /* noisier, and fewer tracks last */
        init(&cfg);
        fly_ms(200u, true);
        assert_right(0u, 8.0);
    }
}

static void test_without_a_source_the_camera_is_its_own_reference(void)
{
    swing_rad = 0.0;
    evs_pipeline_config_t cfg = config();
    cfg.source = EVS_PIPELINE_NONE;
    init(&cfg);
    fly_ms(200u, false);
    assert_right(0u, 4.0);
    TEST_ASSERT_EQUAL_MEMORY(&results[0].v_r_q30, &results[0].v_c_q30, sizeof results[0].v_r_q30);
}

static void test_result_does_not_depend_on_how_the_work_is_cut(void)
{
    static evs_velocity_result_t first[N_RESULTS];
    static const size_t LOTS[] = {1000u, 1u, 7u};
    evs_pipeline_config_t cfg = config();
    cfg.warp = EVS_PIPELINE_WARP_PREDICTED; /* and neither does what flows back into the images */
    for (size_t i = 0u; i < 3u; i++) {
        max_tracks = LOTS[i];
        late_work = i == 2u;
        init(&cfg);
        fly_ms(150u, true);
        TEST_ASSERT_TRUE(n_results >= 5u);
        if (i == 0u) { memcpy(first, results, sizeof first); }
        TEST_ASSERT_EQUAL_MEMORY(first, results, n_results * sizeof first[0]);
    }
}

/* --- images -------------------------------------------------------------------------------------------------------- */

/* The images of a flight against those that the modules make of the chunks' points. */
static uint32_t own_memory[EVS_IWE_BYTES(W, H, EVS_IWE_BILINEAR) / 4u];
static uint8_t own_image[W * H];
static evs_iwe_t own_iwe;
static evs_surface_t own_surface;
static uint32_t n_compared;

static void compare(const evs_pipeline_config_t *cfg, const evs_pipeline_chunk_t *c)
{
    const bool surface = cfg->image == EVS_PIPELINE_IMAGE_SURFACE;
    static bool fresh = true; /* the next event begins a window */
    if (surface && c->saccade && fresh) { evs_surface_clear(&own_surface); }
    fresh = false;
    if (surface) {
        evs_surface_add(&own_surface, c->events, c->stabilized, c->n);
    } else {
        evs_iwe_add(&own_iwe, c->stabilized, c->n);
    }
    if (c->end.reason == EVS_WINDOW_OPEN) { return; }
    fresh = true;
    if (surface) {
        evs_surface_end_window(&own_surface, c->end.t_last_us - c->end.t_first_us);
        evs_surface_render(&own_surface, c->end.t_last_us, own_image);
    } else {
        evs_iwe_render(&own_iwe, own_image);
        evs_iwe_clear(&own_iwe);
    }
    TEST_ASSERT_EQUAL_MEMORY(own_image, c->image.px, sizeof own_image);
    TEST_ASSERT_EQUAL_UINT32(c->end.t_first_us + (c->end.t_last_us - c->end.t_first_us) / 2u, c->image_t_us);
    n_compared++;
}

static void test_image_is_that_of_the_stabilized_points_of_its_window(void)
{
    static const evs_pipeline_image_t KINDS[] = {EVS_PIPELINE_IMAGE_COUNT, EVS_PIPELINE_IMAGE_IWE,
                                                 EVS_PIPELINE_IMAGE_SURFACE};
    spin_rad_s = 2.0; /* a saccade comes within 0.1 s */
    for (size_t kind = 0u; kind < 3u; kind++) {
        evs_pipeline_config_t cfg = config();
        cfg.image = KINDS[kind];
        cfg.velocity_on = false;
        init(&cfg);
        evs_iwe_config_t iwe_cfg = evs_iwe_config_default(W, H);
        iwe_cfg.smooth = KINDS[kind] != EVS_PIPELINE_IMAGE_COUNT;
        const evs_surface_config_t surface_cfg = evs_surface_config_default(W, H);
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_surface_init(&own_surface, &surface_cfg, own_memory, sizeof own_memory));
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_iwe_init(&own_iwe, &iwe_cfg, own_memory, sizeof own_memory));
        n_compared = 0u;
        uint32_t n_saccades = 0u;
        if (KINDS[kind] == EVS_PIPELINE_IMAGE_SURFACE) { evs_surface_clear(&own_surface); }
        for (unsigned step = 0u; step < 15u; step++, t_now_us += STEP_MS * MS) {
            const size_t n = make_step();
            push_orientations();
            for (size_t i = 0u; i < n;) {
                i += evs_pipeline_push_events(&p, &step_events[i], (n - i < N_LOT) ? n - i : N_LOT);
                evs_pipeline_chunk_t c;
                while (evs_pipeline_pull(&p, &c)) {
                    compare(&cfg, &c);
                    n_saccades += (c.saccade && (c.end.reason != EVS_WINDOW_OPEN)) ? 1u : 0u;
                }
            }
        }
        TEST_ASSERT_EQUAL_UINT32(7u, n_compared);
        TEST_ASSERT_TRUE(n_saccades >= 1u);
    }
    evs_velocity_result_t none;
    TEST_ASSERT_FALSE(evs_pipeline_velocity(&p, 1u, &none));
    TEST_ASSERT_FALSE(evs_pipeline_velocity_busy(&p));
    TEST_ASSERT_NULL(evs_pipeline_velocity_part(&p));
}

static void test_restarted_clock_clears_a_time_surface(void)
{
    evs_pipeline_config_t cfg = config();
    cfg.image = EVS_PIPELINE_IMAGE_SURFACE;
    cfg.velocity_on = false;
    cfg.source = EVS_PIPELINE_NONE;
    init(&cfg);
    fly_ms(50u, false);
    t_start_us -= 1000000000u; /* 17 minutes back .. */
    t_now_us = t_start_us;
    flight_make_wall(3u, 1u); /* .. and nearly nothing to see */
    fly_ms(50u, false);
    uint32_t n_lit = 0u;
    for (int i = 0; i < W * H; i++) { n_lit += (newest_image[i] > 0u) ? 1u : 0u; }
    TEST_ASSERT_TRUE(n_lit < 100u);
}

/* Sum of squares over the square of the sum: the larger, the fewer pixels share the votes. */
static double sharpness(void)
{
    double sum = 0.0, sum_sq = 0.0;
    for (int i = 0; i < W * H; i++) {
        sum += newest_image[i];
        sum_sq += (double)newest_image[i] * newest_image[i];
    }
    return sum_sq / (sum * sum);
}

static evs_pipeline_config_t config_of_warp(evs_pipeline_warp_t warp)
{
    evs_pipeline_config_t cfg = config();
    cfg.warp = warp;
    cfg.iwe.smooth = false;
    cfg.window.duration_us = 2u * WINDOW_US;
    cfg.n_warp_events = N_KEPT;
    cfg.warp_search =
        evs_warp_config_default((warp == EVS_PIPELINE_WARP_GLOBAL) ? EVS_WARP_GLOBAL : EVS_WARP_TILED, W, H);
    cfg.warp_search.n_budget = N_BUDGET;
    return cfg;
}

static void test_warps_make_images_sharper(void)
{
    static const evs_pipeline_warp_t WARPS[] = {EVS_PIPELINE_WARP_NONE, EVS_PIPELINE_WARP_PREDICTED,
                                                EVS_PIPELINE_WARP_GLOBAL, EVS_PIPELINE_WARP_TILED};
    double sharp[4];
    v_w[0] = 1.6; /* 3 px in a window */
    v_w[1] = v_w[2] = 0.0;
    for (int warp = 0; warp < 4; warp++) {
        const evs_pipeline_config_t cfg = config_of_warp(WARPS[warp]);
        init(&cfg);
        fly_ms(290u, true);
        assert_right(0u, 4.0);
        sharp[warp] = sharpness();
        TEST_ASSERT_EQUAL_UINT32(0u, evs_pipeline_counts(&p).n_unwarped);
    }
    TEST_ASSERT_TRUE(sharp[1] > 1.1 * sharp[0]);
    TEST_ASSERT_TRUE(sharp[2] > 1.1 * sharp[0]);
    TEST_ASSERT_TRUE(sharp[3] > 1.1 * sharp[0]);
}

static void test_events_that_a_warp_cannot_keep_are_left_out_and_counted(void)
{
    evs_pipeline_config_t cfg = config_of_warp(EVS_PIPELINE_WARP_GLOBAL);
    cfg.velocity_on = false;
    cfg.n_warp_events = 500u;
    init(&cfg);
    fly_ms(50u, true);
    TEST_ASSERT_EQUAL_UINT32(1u, n_images);
    TEST_ASSERT_TRUE(n_window_events > 1000u);
    uint32_t n_lit = 0u;
    for (int i = 0; i < W * H; i++) { n_lit += (newest_image[i] > 0u) ? 1u : 0u; }
    TEST_ASSERT_TRUE((n_lit > 100u) && (n_lit <= 500u)); /* no more pixels than votes */
    evs_pipeline_finish(&p);
    pull(); /* what is open is no image, but was counted as it came */
    TEST_ASSERT_EQUAL_UINT32(evs_pipeline_counts(&p).n_events - 1000u, evs_pipeline_counts(&p).n_unwarped);
}

static void test_time_of_an_image_is_that_to_which_its_events_were_moved(void)
{
    evs_pipeline_config_t cfg = config_of_warp(EVS_PIPELINE_WARP_GLOBAL);
    cfg.velocity_on = false;
    init(&cfg);
    fly_ms(50u, true);
    TEST_ASSERT_UINT32_WITHIN(200u, t_start_us + WINDOW_US, image_t_us); /* the middle */
    cfg.stabilize.rotation = EVS_ROTATION_WINDOW;
    init(&cfg);
    fly_ms(50u, true);
    TEST_ASSERT_UINT32_WITHIN(200u, t_start_us, image_t_us); /* the first event, whose orientation all were given */
    cfg = config_of_warp(EVS_PIPELINE_WARP_PREDICTED);
    init(&cfg);
    fly_ms(210u, true);
    TEST_ASSERT_TRUE(p.imaging->warping);
    TEST_ASSERT_UINT32_WITHIN(200u, t_start_us + 9u * WINDOW_US, image_t_us);
}

static void test_flow_of_another_reference_warps_nothing(void)
{
    spin_rad_s = 2.0;
    evs_pipeline_config_t cfg = config_of_warp(EVS_PIPELINE_WARP_PREDICTED);
    cfg.window.duration_us = WINDOW_US;
    init(&cfg);
    fly_ms(250u, true);
    TEST_ASSERT_TRUE(n_saccade_windows >= 2u);
    TEST_ASSERT_EQUAL_UINT32(0u, n_saccade_windows_warped);
}

static void test_turn_within_a_window_that_is_rotated_once_is_taken_out_by_a_warp(void)
{
    double error[2];
    for (int warp = 0; warp < 2; warp++) {
        swing_rad = 0.12;
        evs_pipeline_config_t cfg = config_of_warp((warp == 1) ? EVS_PIPELINE_WARP_TILED : EVS_PIPELINE_WARP_NONE);
        cfg.window.duration_us = WINDOW_US;
        cfg.iwe.smooth = true;
        cfg.stabilize.rotation = EVS_ROTATION_WINDOW;
        init(&cfg);
        fly_ms(250u, true);
        error[warp] = 0.0;
        for (size_t i = 2u; i < n_results; i++) {
            error[warp] += error_deg(results[i].v_r_q30, model_from_fixed(results[i].q_wr));
        }
    }
    TEST_ASSERT_TRUE(error[1] < 0.6 * error[0]);
}

static void test_image_of_a_busy_time_is_left_out_and_counted(void)
{
    const evs_pipeline_config_t cfg = config();
    init(&cfg);
    never_work = true;
    fly_ms(110u, true);
    TEST_ASSERT_EQUAL_UINT32(5u, n_windows);
    TEST_ASSERT_EQUAL_UINT32(2u, n_images); /* the first has no partner, so there is no work on it */
    TEST_ASSERT_EQUAL_UINT32(3u, evs_pipeline_counts(&p).n_images_busy);
    TEST_ASSERT_TRUE(evs_pipeline_velocity_busy(&p));
    never_work = false;
    work();
    TEST_ASSERT_EQUAL_UINT(1u, n_results);
    fly_ms(200u, true);
    assert_right(1u, 4.0);
    TEST_ASSERT_EQUAL_UINT32(3u, evs_pipeline_counts(&p).n_images_busy);
}

static void test_windows_that_are_not_whole_give_no_image(void)
{
    evs_pipeline_config_t cfg = config();
    cfg.max_wait_us = 1000u;
    init(&cfg);
    fly_ms(50u, false); /* no orientation comes */
    TEST_ASSERT_EQUAL_UINT32(2u, n_windows);
    TEST_ASSERT_EQUAL_UINT32(0u, n_images);
    TEST_ASSERT_EQUAL_UINT32(2u, evs_pipeline_counts(&p).n_images_incomplete);
    evs_pipeline_finish(&p);
    pull();
    TEST_ASSERT_EQUAL_UINT32(3u, n_windows);
    TEST_ASSERT_EQUAL_UINT32(0u, n_images);
    TEST_ASSERT_EQUAL_UINT32(3u, evs_pipeline_counts(&p).n_images_incomplete);
    evs_pipeline_finish(&p); /* nothing is open: nothing to count */
    pull();
    TEST_ASSERT_EQUAL_UINT32(3u, evs_pipeline_counts(&p).n_images_incomplete);

    cfg = config();
    init(&cfg);
    fly_ms(50u, true);
    TEST_ASSERT_EQUAL_UINT32(2u, n_images);
    evs_pipeline_finish(&p); /* the third window is oriented, but cut off */
    pull();
    TEST_ASSERT_EQUAL_UINT32(3u, n_windows);
    TEST_ASSERT_EQUAL_UINT32(2u, n_images);
    TEST_ASSERT_EQUAL_UINT32(1u, evs_pipeline_counts(&p).n_images_incomplete);
}

static void test_clock_may_wrap(void)
{
    t_start_us = UINT32_MAX - 130u * MS;
    const evs_pipeline_config_t cfg = config();
    init(&cfg);
    fly_ms(250u, true);
    TEST_ASSERT_EQUAL_UINT(11u, n_results);
    assert_right(0u, 4.0);
}

static void test_restarted_clock_forgets_the_images_and_goes_on(void)
{
    t_start_us = 3000u * MS;
    const evs_pipeline_config_t cfg = config();
    init(&cfg);
    fly_ms(200u, true);
    assert_right(0u, 4.0);
    const size_t n_before = n_results;
    t_start_us = 3000u;
    t_now_us = t_start_us;
    fly_ms(250u, true);
    TEST_ASSERT_EQUAL_UINT32(1u, evs_pipeline_counts(&p).n_restarts);
    TEST_ASSERT_TRUE(n_results > n_before + 5u);
    for (size_t i = n_before; i < n_results; i++) { TEST_ASSERT_TRUE(results[i].t_us - t_start_us < 250u * MS); }
    assert_right(n_before, 4.0);
}

static void test_bytes_are_what_the_macros_say(void)
{
    static const evs_pipeline_image_t KINDS[] = {EVS_PIPELINE_IMAGE_COUNT, EVS_PIPELINE_IMAGE_IWE,
                                                 EVS_PIPELINE_IMAGE_SURFACE};
    const size_t base = EVS_PIPELINE_BYTES(W, H, 0u, false, 0u, N_FIFO, N_RING, N_BATCH);
    for (size_t i = 0u; i < 3u; i++) {
        for (int velocity_on = 0; velocity_on < 2; velocity_on++) {
            evs_pipeline_config_t cfg = config();
            cfg.image = KINDS[i];
            cfg.velocity_on = velocity_on == 1;
            const size_t image = EVS_PIPELINE_IMAGE_BYTES(W, H, KINDS[i], EVS_IWE_NEAREST, EVS_PIPELINE_WARP_NONE,
                                                          cfg.velocity_on, N_BATCH);
            const size_t velocity = cfg.velocity_on ? EVS_VELOCITY_DEFAULT_BYTES(W, H) : 0u;
            TEST_ASSERT_EQUAL_UINT(base + image + velocity, evs_pipeline_bytes(&cfg));
            if (cfg.velocity_on && (KINDS[i] == EVS_PIPELINE_IMAGE_IWE)) {
                TEST_ASSERT_EQUAL_UINT(EVS_PIPELINE_VELOCITY_BYTES(W, H), image + velocity);
            }
        }
    }
    evs_pipeline_config_t none = config();
    none.image = EVS_PIPELINE_IMAGE_NONE;
    none.velocity_on = false;
    TEST_ASSERT_EQUAL_UINT(base, evs_pipeline_bytes(&none));
    const evs_pipeline_config_t tiled = config_of_warp(EVS_PIPELINE_WARP_TILED);
    TEST_ASSERT_EQUAL_UINT(base + EVS_PIPELINE_VELOCITY_BYTES(W, H) +
                               EVS_PIPELINE_WARP_BYTES(W, H, N_KEPT, N_BUDGET, EVS_WARP_MAX_PX, 1u),
                           evs_pipeline_bytes(&tiled));
}

static void test_init_refuses_what_makes_no_sense(void)
{
    enum { N_BAD = 12 };
    evs_pipeline_config_t bad[N_BAD];
    for (size_t i = 0u; i < N_BAD; i++) { bad[i] = config(); }
    bad[0].image = EVS_PIPELINE_IMAGE_NONE; /* velocity of nothing */
    bad[1].image = (evs_pipeline_image_t)4;
    bad[2].warp = (evs_pipeline_warp_t)9;
    bad[3].warp = EVS_PIPELINE_WARP_PREDICTED;
    bad[3].velocity_on = false; /* nothing predicts */
    bad[4].warp = EVS_PIPELINE_WARP_PREDICTED;
    bad[4].image = EVS_PIPELINE_IMAGE_SURFACE;
    bad[5].velocity.n_levels = 0u;
    bad[6].velocity.keyframes.target_px_q4 = 0u;
    bad[7].iwe.scale = (evs_iwe_scale_t)7;
    bad[8].image = EVS_PIPELINE_IMAGE_SURFACE;
    bad[8].surface.tau_min_us = 0u;
    bad[9] = config_of_warp(EVS_PIPELINE_WARP_TILED);
    bad[9].n_warp_events = 0u;
    bad[10] = config_of_warp(EVS_PIPELINE_WARP_TILED);
    bad[10].warp_search.max_px = 0u;
    bad[11] = config_of_warp(EVS_PIPELINE_WARP_TILED);
    bad[11].image = EVS_PIPELINE_IMAGE_SURFACE;
    memset(&p, 0x11, sizeof p);
    static evs_pipeline_t before;
    before = p;
    for (size_t i = 0u; i < N_BAD; i++) {
        TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_pipeline_init(&p, &bad[i], memory, BYTES));
    }
    const evs_pipeline_config_t good = config();
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_pipeline_init(&p, &good, memory, evs_pipeline_bytes(&good) - 8u));
    TEST_ASSERT_EQUAL_MEMORY(&before, &p, sizeof p);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_shaken_camera_finds_its_direction_of_flight);
    RUN_TEST(test_bias_of_the_gyro_is_learnt_until_it_is_known);
    RUN_TEST(test_offset_between_the_clocks_is_that_of_the_track);
    RUN_TEST(test_backwards_is_told_from_forwards);
    RUN_TEST(test_rotation_alone_is_no_flight);
    RUN_TEST(test_saccades_cost_no_result);
    RUN_TEST(test_rotation_once_per_window_gives_images_too);
    RUN_TEST(test_time_surface_and_counts_find_it_as_well);
    RUN_TEST(test_without_a_source_the_camera_is_its_own_reference);
    RUN_TEST(test_result_does_not_depend_on_how_the_work_is_cut);
    RUN_TEST(test_image_is_that_of_the_stabilized_points_of_its_window);
    RUN_TEST(test_warps_make_images_sharper);
    RUN_TEST(test_events_that_a_warp_cannot_keep_are_left_out_and_counted);
    RUN_TEST(test_time_of_an_image_is_that_to_which_its_events_were_moved);
    RUN_TEST(test_flow_of_another_reference_warps_nothing);
    RUN_TEST(test_turn_within_a_window_that_is_rotated_once_is_taken_out_by_a_warp);
    RUN_TEST(test_image_of_a_busy_time_is_left_out_and_counted);
    RUN_TEST(test_windows_that_are_not_whole_give_no_image);
    RUN_TEST(test_restarted_clock_clears_a_time_surface);
    RUN_TEST(test_clock_may_wrap);
    RUN_TEST(test_restarted_clock_forgets_the_images_and_goes_on);
    RUN_TEST(test_bytes_are_what_the_macros_say);
    RUN_TEST(test_init_refuses_what_makes_no_sense);
    return UNITY_END();
}
