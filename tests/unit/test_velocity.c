/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/velocity.h"
#include "flight.h"
#include "unity.h"

enum { W = 160, H = 120, N_DOTS = 1500, N_RESULTS = 100 };

#define FOCAL   120.0
#define MS      UINT32_C(1000)
#define STEP_US (20u * MS)
#define N_BYTES EVS_VELOCITY_DEFAULT_BYTES(W, H)
#define CANARY  UINT64_C(0x5A5A5A5A5A5A5A5A)
#define DEG     (MODEL_PI / 180.0)

static evs_velocity_t velocity;
static uint64_t memory[N_BYTES / 8u + 1u]; /* the last word is a canary */
static uint8_t scratch[W * H];
static evs_pinhole_t pinhole;

/* The flight. */
static double v_w[3];          /* velocity in the world, m/s */
static model_quat_t reference; /* q_wr */
static model_quat_t attitude;  /* that the camera swings about */
static double drift_rad_s;     /* how fast what is held still turns after all */
static double swing_rad;       /* how far it swings */
static evs_velocity_result_t results[N_RESULTS];
static size_t n_results;
static uint32_t t_newest_us[N_RESULTS]; /* of the image that each result is of */
static uint32_t t_start_us;
static uint32_t t_now_us; /* of the next image */
static size_t max_tracks;

static void init(const evs_velocity_config_t *cfg)
{
    TEST_ASSERT_TRUE(evs_velocity_bytes(cfg) <= N_BYTES);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_velocity_init(&velocity, cfg, memory, N_BYTES));
    n_results = 0u;
    t_now_us = t_start_us;
}

static void init_default(void)
{
    const evs_velocity_config_t cfg = evs_velocity_config_default(&pinhole);
    init(&cfg);
}

void setUp(void)
{
    memory[N_BYTES / 8u] = CANARY;
    pinhole = (evs_pinhole_t){.width_px = W,
                              .height_px = H,
                              .fx_q16 = evs_q_from_double(FOCAL, 16),
                              .fy_q16 = evs_q_from_double(FOCAL, 16),
                              .cx_q16 = evs_q_from_double((W - 1) / 2.0, 16),
                              .cy_q16 = evs_q_from_double((H - 1) / 2.0, 16)};
    flight_make_wall(N_DOTS, 1u);
    v_w[0] = 0.8;
    v_w[1] = 0.1;
    v_w[2] = 0.4;
    reference = model_exp(0.05, -0.1, 0.1);
    attitude = reference;
    swing_rad = 0.0;
    drift_rad_s = 0.0;
    t_start_us = 5000u;
    max_tracks = 1000u;
    init_default();
}
void tearDown(void) { TEST_ASSERT_TRUE_MESSAGE(memory[N_BYTES / 8u] == CANARY, "wrote past"); }

static model_quat_t camera_at(double t_s)
{
    return model_mul(attitude, model_exp(swing_rad * sin(9.0 * t_s), swing_rad * sin(7.0 * t_s), 0.3 * t_s));
}

static void push_orientation(uint32_t t_us)
{
    const double t_s = (t_us - t_start_us) * 1e-6;
    const double h = 1e-5;
    const model_quat_t d = model_mul(model_conj(camera_at(t_s - h)), camera_at(t_s + h));
    const evs_orientation_t s = {.t_us = t_us,
                                 .q_wc = model_to_fixed(camera_at(t_s)),
                                 .rate_rad_s_q24 = evs_vec3_from_double(d.x / h, d.y / h, d.z / h, 24)};
    evs_velocity_push_orientation(&velocity, &s);
}

static void work(void)
{
    for (unsigned i = 0u; evs_velocity_busy(&velocity); i++) {
        TEST_ASSERT_TRUE_MESSAGE(i < 1000u, "never ends");
        if (evs_velocity_step(&velocity, max_tracks, &results[n_results])) { t_newest_us[n_results++] = t_now_us; }
    }
}

/* The image of the flight at t_now_us, and the work on it. */
static void see(void)
{
    const double t_s = (t_now_us - t_start_us) * 1e-6;
    const double position[3] = {v_w[0] * t_s, v_w[1] * t_s, v_w[2] * t_s};
    uint8_t *const px = evs_velocity_plane(&velocity);
    TEST_ASSERT_NOT_NULL(px);
    const model_quat_t held = model_mul(reference, model_exp(0.0, drift_rad_s * t_s, 0.0));
    flight_render(&pinhole, held, position, t_s, px);
    const evs_velocity_image_t image = {.px = px, .t_us = t_now_us, .q_wr = model_to_fixed(reference)};
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_velocity_begin(&velocity, &image, scratch));
}

static void fly(unsigned n_images)
{
    for (unsigned i = 0u; i < n_images; i++, t_now_us += STEP_US) {
        for (uint32_t t_us = t_now_us - STEP_US; t_us != t_now_us; t_us += MS) {
            if (t_us - t_start_us < UINT32_C(0x80000000)) { push_orientation(t_us); }
        }
        push_orientation(t_now_us);
        see();
        work();
    }
}

/* Angle between an estimate and the velocity in a frame whose orientation is q_wf, degrees. */
static double error_deg(evs_vec3_t v_q30, model_quat_t q_wf)
{
    double want[3];
    double got[3];
    model_rotate(model_conj(q_wf), v_w, want);
    model_from_unit(v_q30, got);
    return model_angle_between(got, want) / DEG;
}

/* Results are valid, except that the first ones may span too short a time, and right in both frames. */
static void assert_right(size_t from, double tolerance_deg)
{
    size_t n_valid = 0u;
    for (size_t i = from; i < n_results; i++) {
        const evs_velocity_result_t *const r = &results[i];
        if ((r->interval_us < 60u * MS) && ((r->flags & ~EVS_VELOCITY_NO_ORIENTATION) == EVS_VELOCITY_STILL)) {
            continue;
        }
        n_valid++;
        TEST_ASSERT_BITS(EVS_VELOCITY_FEW | EVS_VELOCITY_STILL | EVS_VELOCITY_UNSOLVED | EVS_VELOCITY_UNLIKE |
                             EVS_VELOCITY_VALID,
                         EVS_VELOCITY_VALID, r->flags);
        TEST_ASSERT_DOUBLE_WITHIN(tolerance_deg, 0.0, error_deg(r->v_r_q30, reference));
        if ((r->flags & EVS_VELOCITY_NO_ORIENTATION) == 0u) {
            const double t_s = (r->t_us - t_start_us) * 1e-6;
            TEST_ASSERT_DOUBLE_WITHIN(tolerance_deg, 0.0, error_deg(r->v_c_q30, camera_at(t_s)));
        }
    }
    TEST_ASSERT_TRUE(n_valid >= 5u);
}

static void assert_none_valid(void)
{
    TEST_ASSERT_TRUE(n_results > 0u);
    for (size_t i = 0u; i < n_results; i++) { TEST_ASSERT_BITS_LOW(EVS_VELOCITY_VALID, results[i].flags); }
}

/* --- what it is for ----------------------------------------------------------------------------------------------- */

static void test_direction_and_its_sign_are_found_wherever_the_camera_flies(void)
{
    static const double V[][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 0.7, 0}, {0, 0, 1}, {0, 0, -1}, {0.6, -0.3, 0.7}};
    for (size_t i = 0u; i < sizeof V / sizeof V[0]; i++) {
        memcpy(v_w, V[i], sizeof v_w);
        init_default();
        fly(12u);
        assert_right(0u, 3.0);
    }
}

static void test_camera_frame_is_that_of_the_middle_of_the_interval(void)
{
    swing_rad = 0.15;
    fly(15u);
    assert_right(0u, 3.0);
    for (size_t i = 0u; i < n_results; i++) {
        TEST_ASSERT_BITS_LOW(EVS_VELOCITY_NO_ORIENTATION, results[i].flags);
        TEST_ASSERT_EQUAL_UINT32(t_newest_us[i] - results[i].interval_us / 2u, results[i].t_us);
        /* The two directions differ by the camera's rotation at that very time, to the last digits. */
        const model_quat_t q_rc = model_mul(model_conj(reference), camera_at((results[i].t_us - t_start_us) * 1e-6));
        const evs_vec3_t back = evs_quat_rotate(model_to_fixed(q_rc), results[i].v_c_q30);
        TEST_ASSERT_INT32_WITHIN(20000, results[i].v_r_q30.x, back.x); /* 2e-5: swinging on 5 ms between samples */
        TEST_ASSERT_INT32_WITHIN(20000, results[i].v_r_q30.y, back.y);
        TEST_ASSERT_INT32_WITHIN(20000, results[i].v_r_q30.z, back.z);
    }
}

static void test_displacements_reach_the_target_at_any_speed(void)
{
    static const double SPEED[] = {0.6, 1.0, 1.6};
    for (size_t i = 0u; i < 3u; i++) {
        v_w[0] = SPEED[i];
        v_w[1] = v_w[2] = 0.0;
        init_default();
        fly(30u);
        double sum_px = 0.0;
        for (size_t k = n_results - 12u; k < n_results; k++) { sum_px += results[k].flow_px_q8 / 256.0; }
        TEST_ASSERT_DOUBLE_WITHIN(0.7, 5.0, sum_px / 12.0);
        assert_right(n_results - 12u, 3.0);
    }
}

static double mean_error_deg(size_t from)
{
    double sum = 0.0;
    for (size_t i = from; i < n_results; i++) { sum += error_deg(results[i].v_r_q30, reference); }
    return sum / (double)(n_results - from);
}

static void test_rotation_that_is_left_is_allowed_for(void)
{
    drift_rad_s = 0.04;
    fly(20u);
    const double ignored_deg = mean_error_deg(4u);
    evs_velocity_config_t cfg = evs_velocity_config_default(&pinhole);
    cfg.residual_rate_rad_s_q24 = evs_q_from_double(0.04, 24);
    init(&cfg);
    fly(20u);
    TEST_ASSERT_TRUE(ignored_deg > 2.0);
    TEST_ASSERT_TRUE(mean_error_deg(4u) < 0.6 * ignored_deg);
    const evs_velocity_result_t *const r = &results[n_results - 1u];
    const double found_rad_s = fabs(evs_q_to_double(r->solution.rotation_rad_q28.y, 28)) / (r->interval_us * 1e-6);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.04, found_rad_s);
}

static void test_sigma_is_honest(void)
{
    double sum_sq = 0.0;
    fly(40u);
    for (size_t i = 0u; i < n_results; i++) {
        const double sigma_deg = evs_q_to_double(results[i].solution.sigma_rad_q28, 28) / DEG;
        const double ratio = error_deg(results[i].v_r_q30, reference) / sigma_deg;
        sum_sq += ratio * ratio;
    }
    TEST_ASSERT_TRUE(sqrt(sum_sq / (double)n_results) < 3.0);
}

/* --- what must not look like a direction --------------------------------------------------------------------------- */

static void test_no_motion_and_rotation_alone_are_flagged(void)
{
    v_w[0] = v_w[1] = v_w[2] = 0.0;
    fly(12u);
    assert_none_valid();
    for (size_t i = 0u; i < n_results; i++) { TEST_ASSERT_BITS_HIGH(EVS_VELOCITY_STILL, results[i].flags); }
    swing_rad = 0.2; /* in stabilized images rotation is no motion */
    init_default();
    fly(12u);
    assert_none_valid();
}

static void test_no_texture_and_five_dots_are_flagged(void)
{
    flight_make_wall(0u, 1u);
    fly(10u);
    assert_none_valid();
    for (size_t i = 0u; i < n_results; i++) {
        TEST_ASSERT_BITS_HIGH(EVS_VELOCITY_FEW, results[i].flags);
        TEST_ASSERT_EQUAL_UINT16(0u, results[i].n_flow);
    }
    flight_make_wall(5u, 1u);
    for (size_t i = 0u; i < 5u; i++) { /* all in view */
        flight_dots[i].at[0] = -0.6 + 0.3 * (double)i;
        flight_dots[i].at[1] = ((i & 1u) != 0u) ? 0.3 : -0.3;
        flight_dots[i].at[2] = 2.0;
        flight_dots[i].grey = 200;
    }
    init_default();
    fly(10u);
    assert_none_valid();
    for (size_t i = 0u; i < n_results; i++) {
        TEST_ASSERT_BITS_HIGH(EVS_VELOCITY_FEW, results[i].flags);
        TEST_ASSERT_TRUE((results[i].n_flow >= 3u) && (results[i].n_flow < 20u));
    }
}

static void test_images_that_have_nothing_in_common_are_flagged(void)
{
    for (unsigned i = 0u; i < 12u; i++, t_now_us += STEP_US) {
        flight_make_wall(N_DOTS, 100u + 7919u * i); /* other dots every time */
        see();
        work();
        if (i == 0u) { continue; }
        TEST_ASSERT_BITS_HIGH(EVS_VELOCITY_UNLIKE, results[n_results - 1u].flags);
        TEST_ASSERT_UINT16_WITHIN(30u, 256u, results[n_results - 1u].mismatch_q8);
        TEST_ASSERT_EQUAL_INT16(0, evs_flow_grid_global(&velocity.grid).x_px_s_q3); /* no prediction from it */
        TEST_ASSERT_TRUE(evs_keyframes_baseline_us(&velocity.keyframes) <= results[n_results - 1u].baseline_us);
    }
    TEST_ASSERT_EQUAL_UINT32(10u * MS, evs_keyframes_baseline_us(&velocity.keyframes)); /* shorter and shorter */
    assert_none_valid();
}

static void test_scene_that_is_exchanged_ends_what_was_predicted(void)
{
    fly(12u);
    TEST_ASSERT_TRUE(evs_flow_grid_global(&velocity.grid).x_px_s_q3 != 0);
    flight_make_wall(N_DOTS, 77u);
    see();
    work();
    TEST_ASSERT_BITS_HIGH(EVS_VELOCITY_UNLIKE, results[n_results - 1u].flags);
    TEST_ASSERT_EQUAL_INT16(0, evs_flow_grid_global(&velocity.grid).x_px_s_q3);
}

static void test_too_few_is_below_the_least_number(void)
{
    fly(6u);
    const evs_velocity_result_t first = results[0];
    TEST_ASSERT_TRUE(first.mismatch_q8 < 128u);
    for (unsigned missing = 0u; missing < 2u; missing++) {
        evs_velocity_config_t cfg = evs_velocity_config_default(&pinhole);
        cfg.min_features = (uint16_t)(first.n_flow + missing);
        init(&cfg);
        fly(6u);
        TEST_ASSERT_EQUAL_UINT16(first.n_flow, results[0].n_flow); /* nothing has been learnt yet */
        TEST_ASSERT_BITS(EVS_VELOCITY_FEW, (missing == 0u) ? 0u : EVS_VELOCITY_FEW, results[0].flags);
    }
}

static void test_unsure_is_above_the_largest_sigma(void)
{
    fly(8u);
    const evs_velocity_result_t last = results[n_results - 1u];
    TEST_ASSERT_BITS_HIGH(EVS_VELOCITY_VALID, last.flags);
    for (int32_t less = 0; less < 2; less++) {
        evs_velocity_config_t cfg = evs_velocity_config_default(&pinhole);
        cfg.max_sigma_rad_q28 = last.solution.sigma_rad_q28 - less;
        init(&cfg);
        fly(8u);
        const evs_velocity_result_t *const r = &results[n_results - 1u];
        TEST_ASSERT_BITS(EVS_VELOCITY_VALID | EVS_VELOCITY_UNSOLVED,
                         (less == 0) ? EVS_VELOCITY_VALID : EVS_VELOCITY_UNSOLVED, r->flags);
        TEST_ASSERT_BITS_HIGH(EVS_EGOMOTION_VALID, r->solution.flags); /* the solver is not asked */
    }
}

static void test_object_that_moves_by_itself_over_a_third_of_the_image_does_not_mislead(void)
{
    flight_mover_v[0] = -0.3;
    flight_mover_v[1] = 0.9;
    flight_mover_v[2] = 0.0;
    for (size_t i = 0u; i < flight_n_dots; i++) { /* what is right of the middle */
        flight_dots[i].mover = flight_dots[i].at[0] > 0.28 * flight_dots[i].at[2];
    }
    fly(15u);
    for (size_t i = 0u; i < n_results; i++) {
        const double sigma_deg = evs_q_to_double(results[i].solution.sigma_rad_q28, 28) / DEG;
        const bool valid = (results[i].flags & EVS_VELOCITY_VALID) != 0u;
        if (valid) {
            TEST_ASSERT_DOUBLE_WITHIN(fmax(8.0, 3.0 * sigma_deg), 0.0, error_deg(results[i].v_r_q30, reference));
        }
    }
    /* The next tracks there start where the still world would be: a track that errs must not lead the next one. */
    const evs_point_t right = {16 * (W - 12), 16 * H / 2};
    TEST_ASSERT_INT16_WITHIN(160, 0, evs_flow_grid_at(&velocity.grid, right).y_px_s_q3); /* the object: 340 */
}

/* --- saccades ------------------------------------------------------------------------------------------------------ */

static void test_saccade_costs_no_result(void)
{
    fly(12u);
    const size_t n_before = n_results;
    const uint32_t n_unpaired = evs_velocity_counts(&velocity).n_unpaired;
    reference = model_mul(reference, model_exp(0.08, 0.22, 0.15));
    fly(1u);
    TEST_ASSERT_EQUAL_UINT(n_before + 1u, n_results);
    TEST_ASSERT_BITS_HIGH(EVS_VELOCITY_TURNED, results[n_before].flags);
    fly(11u);
    TEST_ASSERT_EQUAL_UINT32(n_unpaired, evs_velocity_counts(&velocity).n_unpaired);
    TEST_ASSERT_TRUE(evs_velocity_counts(&velocity).n_turned >= 1u);
    assert_right(n_before, 5.0); /* against the new reference; part of the view is dark in the turned images */
    TEST_ASSERT_BITS_LOW(EVS_VELOCITY_TURNED, results[n_results - 1u].flags);
}

static void test_predicted_flow_follows_the_reference(void)
{
    /* Fast enough that tracks are lost without the prediction; a quarter turn about the optical axis. */
    v_w[0] = 2.5;
    v_w[1] = v_w[2] = 0.0;
    evs_velocity_config_t cfg = evs_velocity_config_default(&pinhole);
    cfg.keyframes.baseline_min_us = 120u * MS;
    cfg.keyframes.baseline_first_us = 120u * MS;
    init(&cfg);
    flight_make_wall(N_DOTS, 1u);
    fly(1u);
    velocity.grid_q_wr = model_to_fixed(reference);
    evs_flow_grid_set_all(&velocity.grid, (evs_flow_velocity_t){(int16_t)(-8 * 120), 0});
    const model_quat_t turn = model_exp(0.0, 0.0, MODEL_PI / 2.0);
    reference = model_mul(reference, turn);
    t_now_us += 100u * MS;
    fly(1u);
    /* The image moved to the left; in the new reference, whose x axis is the old y axis, it moves up or down. */
    const evs_flow_track_t *tracks;
    const size_t n = evs_velocity_tracks(&velocity, &tracks);
    size_t n_ok = 0u;
    for (size_t i = 0u; i < n; i++) {
        if (tracks[i].status != EVS_FLOW_OK) { continue; }
        TEST_ASSERT_DOUBLE_WITHIN(4.0, 0.0, (tracks[i].from.x_q8 - tracks[i].to.x_q8) / 256.0);
        TEST_ASSERT_TRUE((tracks[i].from.y_q8 - tracks[i].to.y_q8) > 5 * 256);
        n_ok++;
    }
    TEST_ASSERT_TRUE(n_ok >= 12u);
}

static void test_without_a_scratch_plane_a_saccade_forgets_the_keyframes(void)
{
    fly(5u);
    reference = model_mul(reference, model_exp(0.0, 0.2, 0.0));
    flight_render(&pinhole, reference, v_w, 0.0, evs_velocity_plane(&velocity));
    const evs_velocity_image_t image = {
        .px = evs_velocity_plane(&velocity), .t_us = t_now_us, .q_wr = model_to_fixed(reference)};
    const uint32_t n_unpaired = evs_velocity_counts(&velocity).n_unpaired;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_velocity_begin(&velocity, &image, NULL));
    TEST_ASSERT_FALSE(evs_velocity_busy(&velocity));
    TEST_ASSERT_EQUAL_UINT32(n_unpaired + 1u, evs_velocity_counts(&velocity).n_unpaired);
    TEST_ASSERT_EQUAL_UINT(1u, velocity.keyframes.n_used); /* this one */
}

/* --- how it is called ---------------------------------------------------------------------------------------------- */

static void test_result_does_not_depend_on_how_the_work_is_cut(void)
{
    static evs_velocity_result_t first[N_RESULTS];
    static const size_t LOTS[] = {1000u, 1u, 7u, SIZE_MAX};
    swing_rad = 0.1;
    for (size_t i = 0u; i < 4u; i++) {
        max_tracks = LOTS[i];
        init_default();
        fly(10u);
        if (i == 0u) { memcpy(first, results, sizeof first); }
        TEST_ASSERT_TRUE(n_results >= 6u);
        TEST_ASSERT_EQUAL_MEMORY(first, results, n_results * sizeof first[0]);
    }
}

static void test_each_step_is_bounded(void)
{
    max_tracks = 1000u;
    fly(6u);
    see();
    evs_velocity_result_t result;
    size_t n_steps = 0u;
    while (!evs_velocity_step(&velocity, 10u, &result)) { n_steps++; }
    /* Rows by thirties, pyramids, tracks by tens; and the solution, which returned true. */
    TEST_ASSERT_EQUAL_UINT((H - 2u + 29u) / 30u + 1u + (result.n_corners + 9u) / 10u, n_steps);
}

static void test_image_is_refused_while_another_is_worked_on_and_does_no_harm(void)
{
    fly(8u);
    const size_t n_before = n_results;
    see();
    evs_velocity_result_t want;
    TEST_ASSERT_FALSE(evs_velocity_step(&velocity, 3u, &want));
    const evs_velocity_t before = velocity;
    const evs_velocity_image_t image = {.px = scratch, .t_us = t_now_us + 1u, .q_wr = model_to_fixed(reference)};
    TEST_ASSERT_NULL(evs_velocity_plane(&velocity));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_STATE, evs_velocity_begin(&velocity, &image, scratch));
    TEST_ASSERT_EQUAL_MEMORY(&before, &velocity, sizeof before);
    work();
    TEST_ASSERT_EQUAL_UINT(n_before + 1u, n_results);
    assert_right(0u, 3.0);
    TEST_ASSERT_FALSE(evs_velocity_step(&velocity, 3u, &want)); /* nothing to do */
}

static void test_image_of_the_caller_is_as_good_as_the_plane(void)
{
    static uint8_t own[W * H];
    fly(8u);
    const evs_velocity_result_t want = results[n_results - 1u];
    init_default();
    fly(7u);
    const double t_s = (t_now_us - t_start_us) * 1e-6;
    const double position[3] = {v_w[0] * t_s, v_w[1] * t_s, v_w[2] * t_s};
    flight_render(&pinhole, reference, position, t_s, own);
    for (uint32_t t_us = t_now_us - STEP_US; t_us != t_now_us; t_us += MS) { push_orientation(t_us); }
    push_orientation(t_now_us);
    const evs_velocity_image_t image = {.px = own, .t_us = t_now_us, .q_wr = model_to_fixed(reference)};
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_velocity_begin(&velocity, &image, scratch));
    memset(own, 0, sizeof own);
    work();
    TEST_ASSERT_EQUAL_MEMORY(&want, &results[n_results - 1u], sizeof want);
}

static void test_without_orientations_the_reference_frame_stands(void)
{
    for (unsigned i = 0u; i < 10u; i++, t_now_us += STEP_US) {
        see();
        work();
    }
    assert_right(0u, 3.0);
    TEST_ASSERT_BITS_HIGH(EVS_VELOCITY_NO_ORIENTATION, results[n_results - 1u].flags);
    TEST_ASSERT_EQUAL_INT32(0, results[n_results - 1u].v_c_q30.x);
}

static void test_images_of_the_same_time_are_no_pair(void)
{
    evs_velocity_config_t cfg = evs_velocity_config_default(&pinhole);
    cfg.keyframes.baseline_min_us = 1u;
    init(&cfg);
    for (unsigned i = 0u; i < 2u; i++) {
        see();
        TEST_ASSERT_FALSE(evs_velocity_busy(&velocity));
    }
    t_now_us++;
    see();
    work();
    TEST_ASSERT_EQUAL_UINT(1u, n_results);
    TEST_ASSERT_EQUAL_UINT32(1u, results[0].interval_us);
}

static void test_clock_may_wrap_and_restart(void)
{
    t_start_us = UINT32_MAX - 150u * MS;
    init_default();
    fly(15u);
    assert_right(0u, 3.0);
    const size_t n_before = n_results;
    t_start_us = 77u * MS; /* the sensor was reset */
    t_now_us = t_start_us;
    fly(16u);
    TEST_ASSERT_TRUE(n_results >= n_before + 10u);
    assert_right(n_before, 3.0);
    TEST_ASSERT_BITS_LOW(EVS_VELOCITY_NO_ORIENTATION, results[n_results - 1u].flags);
}

static void test_reset_forgets_everything_but_the_counters(void)
{
    fly(8u);
    see();
    evs_velocity_reset(&velocity);
    TEST_ASSERT_FALSE(evs_velocity_busy(&velocity));
    TEST_ASSERT_EQUAL_INT16(0, evs_flow_grid_global(&velocity.grid).x_px_s_q3);
    uint32_t t_us;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_STATE, evs_orientation_track_newest(&velocity.orientations, &t_us));
    push_orientation(velocity.orientation_t_us + 1u); /* however close to the one before */
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_newest(&velocity.orientations, &t_us));
    const uint32_t n_unpaired = evs_velocity_counts(&velocity).n_unpaired;
    see();
    TEST_ASSERT_FALSE(evs_velocity_busy(&velocity));
    TEST_ASSERT_EQUAL_UINT32(n_unpaired + 1u, evs_velocity_counts(&velocity).n_unpaired);
}

static void test_tracks_tell_which_agree(void)
{
    fly(10u);
    const evs_flow_track_t *tracks;
    const size_t n = evs_velocity_tracks(&velocity, &tracks);
    const evs_velocity_result_t *const r = &results[n_results - 1u];
    TEST_ASSERT_EQUAL_UINT(r->n_corners, n);
    size_t n_ok = 0u, n_agree = 0u;
    for (size_t i = 0u; i < n; i++) {
        n_ok += (tracks[i].status == EVS_FLOW_OK) ? 1u : 0u;
        n_agree += evs_velocity_track_is_inlier(&velocity, r, &tracks[i]) ? 1u : 0u;
    }
    TEST_ASSERT_EQUAL_UINT(r->n_flow, n_ok);
    TEST_ASSERT_EQUAL_UINT(r->solution.n_inliers, n_agree);
    TEST_ASSERT_TRUE(n_agree > n_ok / 2u);
}

static void test_init_refuses_what_any_module_refuses_and_leaves_the_context_alone(void)
{
    const evs_velocity_config_t good = evs_velocity_config_default(&pinhole);
    const evs_velocity_t before = velocity;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_velocity_init(NULL, &good, memory, N_BYTES));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_velocity_init(&velocity, NULL, memory, N_BYTES));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_velocity_init(&velocity, &good, NULL, N_BYTES));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_velocity_init(&velocity, &good, memory, N_BYTES - 8u));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_velocity_init(&velocity, &good, (uint8_t *)memory + 4, N_BYTES));
    enum { N_BAD = 20 };
    evs_velocity_config_t bad[N_BAD];
    for (size_t i = 0u; i < N_BAD; i++) { bad[i] = good; }
    bad[0].keyframes.pinhole.fx_q16 = 0;
    bad[1].keyframes.n_stored = 0u;
    bad[2].keyframes.target_px_q4 = 0u;
    bad[3].corners.cell_px = 0u;
    bad[4].corners.min_permille = 1001u;
    bad[5].flow.window_px = 24u;
    bad[6].flow.n_iterations = 0u;
    bad[7].egomotion.rotation_sigma_rad_q28 = -1;
    bad[8].egomotion.flow_kind = EVS_EGOMOTION_NORMAL_FLOW;
    bad[9].n_levels = 0u;
    bad[10].n_tracks = 7u;
    bad[11].grid_cols = 0u;
    bad[12].min_features = 0u;
    bad[13].n_orientations = 3u;
    bad[14].orientation_spacing_us = 100001u;
    bad[15].track.max_gap_us = 0u;
    bad[16].residual_rate_rad_s_q24 = -1;
    bad[17].residual_rate_rad_s_q24 = (1 << 24) + 1;
    bad[18].max_sigma_rad_q28 = 0;
    bad[19].max_sigma_rad_q28 = (1 << 30) + 1;
    for (size_t i = 0u; i < N_BAD; i++) {
        TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_velocity_init(&velocity, &bad[i], memory, N_BYTES));
    }
    TEST_ASSERT_EQUAL_MEMORY(&before, &velocity, sizeof velocity);
    TEST_ASSERT_EQUAL_UINT(0u, evs_velocity_bytes(&bad[1]));
    TEST_ASSERT_EQUAL_UINT(N_BYTES, evs_velocity_bytes(&good));
    init_default();
    const evs_velocity_image_t no_px = {.px = NULL};
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_velocity_begin(&velocity, &no_px, scratch));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_velocity_begin(&velocity, NULL, scratch));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_direction_and_its_sign_are_found_wherever_the_camera_flies);
    RUN_TEST(test_camera_frame_is_that_of_the_middle_of_the_interval);
    RUN_TEST(test_displacements_reach_the_target_at_any_speed);
    RUN_TEST(test_rotation_that_is_left_is_allowed_for);
    RUN_TEST(test_sigma_is_honest);
    RUN_TEST(test_no_motion_and_rotation_alone_are_flagged);
    RUN_TEST(test_no_texture_and_five_dots_are_flagged);
    RUN_TEST(test_images_that_have_nothing_in_common_are_flagged);
    RUN_TEST(test_scene_that_is_exchanged_ends_what_was_predicted);
    RUN_TEST(test_too_few_is_below_the_least_number);
    RUN_TEST(test_unsure_is_above_the_largest_sigma);
    RUN_TEST(test_object_that_moves_by_itself_over_a_third_of_the_image_does_not_mislead);
    RUN_TEST(test_saccade_costs_no_result);
    RUN_TEST(test_predicted_flow_follows_the_reference);
    RUN_TEST(test_without_a_scratch_plane_a_saccade_forgets_the_keyframes);
    RUN_TEST(test_result_does_not_depend_on_how_the_work_is_cut);
    RUN_TEST(test_each_step_is_bounded);
    RUN_TEST(test_image_is_refused_while_another_is_worked_on_and_does_no_harm);
    RUN_TEST(test_image_of_the_caller_is_as_good_as_the_plane);
    RUN_TEST(test_without_orientations_the_reference_frame_stands);
    RUN_TEST(test_images_of_the_same_time_are_no_pair);
    RUN_TEST(test_clock_may_wrap_and_restart);
    RUN_TEST(test_reset_forgets_everything_but_the_counters);
    RUN_TEST(test_tracks_tell_which_agree);
    RUN_TEST(test_init_refuses_what_any_module_refuses_and_leaves_the_context_alone);
    return UNITY_END();
}
