/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/keyframes.h"
#include "model.h"
#include "unity.h"

#include <string.h>

enum { W = 80, H = 60, N_STORED = 3, N_PX = W * H };

#define FOCAL   70.0
#define MS      UINT32_C(1000)
#define CANARY  UINT8_C(0xA5)
#define N_BYTES EVS_KEYFRAMES_BYTES(W, H, N_STORED)

static evs_keyframes_t k;
static uint8_t memory[N_BYTES + 1u];
static uint8_t scratch[N_PX + 1];
static evs_pinhole_t pinhole;

static void init(void)
{
    evs_keyframes_config_t cfg = evs_keyframes_config_default(&pinhole);
    cfg.baseline_min_us = 30u * MS;
    cfg.target_px_q4 = 4u * 16u;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_keyframes_init(&k, &cfg, memory, N_BYTES));
}

void setUp(void)
{
    memset(memory, 0, sizeof memory);
    memory[N_BYTES] = CANARY;
    scratch[N_PX] = CANARY;
    pinhole = (evs_pinhole_t){.width_px = W,
                              .height_px = H,
                              .fx_q16 = evs_q_from_double(FOCAL, 16),
                              .fy_q16 = evs_q_from_double(FOCAL, 16),
                              .cx_q16 = evs_q_from_double((W - 1) / 2.0, 16),
                              .cy_q16 = evs_q_from_double((H - 1) / 2.0, 16)};
    init();
}
void tearDown(void)
{
    TEST_ASSERT_EQUAL_HEX8(CANARY, memory[N_BYTES]);
    TEST_ASSERT_EQUAL_HEX8(CANARY, scratch[N_PX]);
}

static uint32_t age_of_partner_us(uint32_t t_us)
{
    const size_t partner = evs_keyframes_choose(&k, t_us);
    return (partner == EVS_KEYFRAMES_NONE) ? 0u : t_us - evs_keyframes_get(&k, partner)->t_us;
}

/* --- pairs ------------------------------------------------------------------------------------------------------- */

static void test_partner_is_a_baseline_old_whatever_the_rate_of_images(void)
{
    static const uint32_t STEPS_US[] = {5000u, 11000u, 23000u, 40000u};
    for (size_t s = 0u; s < 4u; s++) {
        init();
        uint32_t t_us = UINT32_MAX - 300u * MS; /* the clock wraps on the way */
        for (unsigned i = 0u; i < 100u; i++, t_us += STEPS_US[s]) {
            const uint32_t age_us = age_of_partner_us(t_us);
            const uint32_t baseline_us = evs_keyframes_baseline_us(&k);
            if (i * STEPS_US[s] > 400u * MS) { /* 50 px/s: 4 px take 80 ms */
                TEST_ASSERT_EQUAL_UINT32(80u * MS, baseline_us);
                /* Stored ones lie half a baseline and up to a step apart; the nearest is off by half of that. */
                const uint32_t tolerance_us = (baseline_us / 2u + STEPS_US[s]) / 2u;
                TEST_ASSERT_UINT32_WITHIN(tolerance_us, baseline_us, age_us);
            }
            if (age_us > 0u) { evs_keyframes_learn(&k, 50u * 16u); }
            (void)evs_keyframes_store(&k, t_us, evs_quat_identity());
        }
    }
}

static void test_baseline_follows_the_image_speed_within_its_limits(void)
{
    TEST_ASSERT_EQUAL_UINT32(70u * MS, evs_keyframes_baseline_us(&k));
    static const uint32_t PX_S[] = {0u, 10u, 16u, 40u, 100u, 1000u, 100000u};
    static const uint32_t WANT_MS[] = {250u, 250u, 250u, 100u, 40u, 30u, 30u};
    for (size_t i = 0u; i < 7u; i++) {
        for (unsigned n = 0u; n < 40u; n++) { evs_keyframes_learn(&k, PX_S[i] * 16u); }
        TEST_ASSERT_UINT32_WITHIN(WANT_MS[i] * 10u, WANT_MS[i] * MS, evs_keyframes_baseline_us(&k));
    }
    for (unsigned n = 0u; n < 5u; n++) { evs_keyframes_learn(&k, 40u * 16u); }
    TEST_ASSERT_TRUE(evs_keyframes_baseline_us(&k) > 70u * MS); /* however wild it was before */
}

static void test_first_speed_is_taken_as_it_is_and_later_ones_by_their_share(void)
{
    evs_keyframes_learn(&k, 40u * 16u);
    TEST_ASSERT_EQUAL_UINT32(100u * MS, evs_keyframes_baseline_us(&k));
    evs_keyframes_learn(&k, 80u * 16u); /* 40 + 0.5 * 40 */
    TEST_ASSERT_UINT32_WITHIN(200u, 66667u, evs_keyframes_baseline_us(&k));
}

static void test_lost_patches_shorten_the_baseline_until_speed_is_seen_again(void)
{
    evs_keyframes_learn(&k, 20u * 16u);
    TEST_ASSERT_EQUAL_UINT32(200u * MS, evs_keyframes_baseline_us(&k));
    evs_keyframes_shorten(&k);
    TEST_ASSERT_EQUAL_UINT32(150u * MS, evs_keyframes_baseline_us(&k));
    for (unsigned n = 0u; n < 20u; n++) { evs_keyframes_shorten(&k); }
    TEST_ASSERT_EQUAL_UINT32(30u * MS, evs_keyframes_baseline_us(&k));
    evs_keyframes_learn(&k, 400u * 16u); /* faster than it can show: remains */
    TEST_ASSERT_UINT32_WITHIN(5u, 30u * MS, evs_keyframes_baseline_us(&k));
    for (unsigned n = 0u; n < 20u; n++) { evs_keyframes_learn(&k, 20u * 16u); }
    TEST_ASSERT_UINT32_WITHIN(2u * MS, 200u * MS, evs_keyframes_baseline_us(&k));
}

static void test_no_partner_that_is_too_young_or_too_old(void)
{
    TEST_ASSERT_EQUAL_UINT(EVS_KEYFRAMES_NONE, evs_keyframes_choose(&k, 0u));
    TEST_ASSERT_TRUE(evs_keyframes_store(&k, 0u, evs_quat_identity()));
    TEST_ASSERT_EQUAL_UINT32(0u, age_of_partner_us(15u * MS - 1u)); /* half the shortest baseline */
    TEST_ASSERT_EQUAL_UINT32(15u * MS, age_of_partner_us(15u * MS));
    TEST_ASSERT_EQUAL_UINT32(210u * MS, age_of_partner_us(210u * MS)); /* three baselines of 70 ms */
    TEST_ASSERT_EQUAL_UINT32(0u, age_of_partner_us(214u * MS));
    evs_keyframes_learn(&k, 0u); /* now the baseline is 250 ms .. */
    TEST_ASSERT_EQUAL_UINT32(400u * MS, age_of_partner_us(400u * MS));
    TEST_ASSERT_EQUAL_UINT32(0u, age_of_partner_us(400u * MS + 1u)); /* .. but too old is dropped for good */
    TEST_ASSERT_EQUAL_UINT32(0u, age_of_partner_us(100u * MS));
}

static void test_of_two_equally_near_the_older_one_is_the_partner(void)
{
    TEST_ASSERT_TRUE(evs_keyframes_store(&k, 0u, evs_quat_identity()));
    TEST_ASSERT_TRUE(evs_keyframes_store(&k, 60u * MS, evs_quat_identity()));
    TEST_ASSERT_EQUAL_UINT32(100u * MS, age_of_partner_us(100u * MS)); /* 70 ms are wanted: 100 or 40 */
}

static void test_time_that_runs_back_drops_what_lies_in_the_future(void)
{
    TEST_ASSERT_TRUE(evs_keyframes_store(&k, 1000u * MS, evs_quat_identity()));
    TEST_ASSERT_TRUE(evs_keyframes_store(&k, 1100u * MS, evs_quat_identity()));
    TEST_ASSERT_EQUAL_UINT32(0u, age_of_partner_us(50u * MS));
    TEST_ASSERT_TRUE(evs_keyframes_store(&k, 50u * MS, evs_quat_identity()));
    TEST_ASSERT_EQUAL_UINT32(100u * MS, age_of_partner_us(150u * MS));
}

/* --- planes ------------------------------------------------------------------------------------------------------ */

static void paint(uint8_t value) { memset(evs_keyframes_plane(&k), value, N_PX); }

static void test_images_keep_their_pixels_while_others_come_and_go(void)
{
    for (uint8_t i = 0u; i < 10u; i++) {
        paint((uint8_t)(100u + i));
        const uint32_t t_us = i * 40u * MS;
        if (i == 6u) { evs_keyframes_clear(&k); }
        const size_t partner = evs_keyframes_choose(&k, t_us);
        TEST_ASSERT_EQUAL_HEX8(100u + i, evs_keyframes_plane(&k)[0]); /* the newest survives what is dropped */
        TEST_ASSERT_EQUAL_HEX8(100u + i, evs_keyframes_plane(&k)[N_PX - 1]);
        if ((i == 0u) || (i == 6u)) {
            TEST_ASSERT_EQUAL_UINT(EVS_KEYFRAMES_NONE, partner);
        } else {
            const evs_keyframe_t *const frame = evs_keyframes_get(&k, partner);
            const uint8_t want = (uint8_t)(100u + frame->t_us / (40u * MS));
            TEST_ASSERT_EACH_EQUAL_HEX8(want, frame->px, N_PX);
        }
        TEST_ASSERT_TRUE(evs_keyframes_store(&k, t_us, evs_quat_identity()));
    }
}

static void test_image_too_close_to_the_newest_stored_one_leaves_its_plane(void)
{
    TEST_ASSERT_TRUE(evs_keyframes_store(&k, 0u, evs_quat_identity()));
    const uint8_t *const plane = evs_keyframes_plane(&k);
    TEST_ASSERT_FALSE(evs_keyframes_store(&k, 35u * MS - 1u, evs_quat_identity()));
    TEST_ASSERT_EQUAL_PTR(plane, evs_keyframes_plane(&k));
    TEST_ASSERT_TRUE(evs_keyframes_store(&k, 35u * MS, evs_quat_identity()));
    TEST_ASSERT_TRUE(plane != evs_keyframes_plane(&k));
}

/* --- turning ----------------------------------------------------------------------------------------------------- */

/* A texture on the sphere of directions, seen through the pinhole by a camera with orientation q. */
static double seen(model_quat_t q, double x, double y)
{
    const double ray[3] = {(x - (W - 1) / 2.0) / FOCAL, (y - (H - 1) / 2.0) / FOCAL, 1.0};
    double d[3];
    model_rotate(q, ray, d);
    const double n = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    return 128.0 + 50.0 * sin(12.0 * d[0] / n) + 50.0 * cos(10.0 * d[1] / n + 3.0 * d[2] / n);
}

static void test_turned_image_shows_what_the_new_reference_would_see(void)
{
    const model_quat_t old_q = model_exp(0.3, -0.2, 0.5);
    const model_quat_t turn = model_exp(0.08, 0.15, -0.1); /* old from new reference */
    const model_quat_t new_q = model_mul(old_q, turn);
    uint8_t *const px = evs_keyframes_plane(&k);
    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++) { px[y * W + x] = (uint8_t)(seen(old_q, x, y) + 0.5); }
    }
    TEST_ASSERT_TRUE(evs_keyframes_store(&k, 0u, model_to_fixed(old_q)));
    TEST_ASSERT_FALSE(evs_keyframes_turn(&k, 0u, model_to_fixed(old_q), scratch)); /* it has that reference */
    TEST_ASSERT_TRUE(evs_keyframes_turn(&k, 0u, model_to_fixed(new_q), scratch));
    TEST_ASSERT_FALSE(evs_keyframes_turn(&k, 0u, model_to_fixed(new_q), scratch));

    int n_seen = 0, n_dark = 0;
    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++) {
            const double ray[3] = {(x - (W - 1) / 2.0) / FOCAL, (y - (H - 1) / 2.0) / FOCAL, 1.0};
            double d[3];
            model_rotate(turn, ray, d);
            const double was_x = FOCAL * d[0] / d[2] + (W - 1) / 2.0;
            const double was_y = FOCAL * d[1] / d[2] + (H - 1) / 2.0;
            const double inside = fmin(fmin(was_x, W - 1 - was_x), fmin(was_y, H - 1 - was_y));
            const uint8_t got = evs_keyframes_get(&k, 0u)->px[y * W + x];
            if (inside > 0.0) { /* nearest pixel: half a pixel off, at a slope of 12 grey levels at most, in x and y */
                TEST_ASSERT_DOUBLE_WITHIN(14.0, seen(new_q, x, y), got);
                n_seen++;
            } else if (inside < -0.6) {
                TEST_ASSERT_EQUAL_HEX8(0u, got);
                n_dark++;
            }
        }
    }
    TEST_ASSERT_TRUE(n_seen > N_PX / 2);
    TEST_ASSERT_TRUE(n_dark > N_PX / 10);
}

static void test_turning_by_a_whole_pixel_moves_every_pixel_exactly(void)
{
    uint8_t *const px = evs_keyframes_plane(&k);
    for (int i = 0; i < N_PX; i++) { px[i] = (uint8_t)(1 + i % 251); }
    TEST_ASSERT_TRUE(evs_keyframes_store(&k, 0u, evs_quat_identity()));
    const evs_quat_t half_turn = {0, 0, 0, EVS_ONE_Q30}; /* about the optical axis: pixel (x, y) to (W-1-x, H-1-y) */
    TEST_ASSERT_TRUE(evs_keyframes_turn(&k, 0u, half_turn, scratch));
    const uint8_t *const got = evs_keyframes_get(&k, 0u)->px;
    for (int i = 0; i < N_PX; i++) { TEST_ASSERT_EQUAL_HEX8(1 + (N_PX - 1 - i) % 251, got[i]); }
}

static void test_turning_behind_the_camera_gives_a_dark_image(void)
{
    paint(200u);
    TEST_ASSERT_TRUE(evs_keyframes_store(&k, 0u, evs_quat_identity()));
    const evs_quat_t behind = {0, 0, EVS_ONE_Q30, 0};
    TEST_ASSERT_TRUE(evs_keyframes_turn(&k, 0u, behind, scratch));
    TEST_ASSERT_EACH_EQUAL_HEX8(0u, evs_keyframes_get(&k, 0u)->px, N_PX);
}

static void test_init_refuses_bad_settings_and_leaves_the_context_alone(void)
{
    const evs_keyframes_t before = k;
    const evs_keyframes_config_t good = evs_keyframes_config_default(&pinhole);
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_keyframes_init(NULL, &good, memory, N_BYTES));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_keyframes_init(&k, NULL, memory, N_BYTES));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_keyframes_init(&k, &good, NULL, N_BYTES));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_keyframes_init(&k, &good, memory, N_BYTES - 1u));
    evs_keyframes_config_t bad[9];
    for (size_t i = 0u; i < 9u; i++) { bad[i] = good; }
    bad[0].pinhole.fx_q16 = 0;
    bad[1].n_stored = 0u;
    bad[2].n_stored = EVS_KEYFRAMES_MAX + 1u;
    bad[3].target_px_q4 = 0u;
    bad[4].target_px_q4 = 4097u;
    bad[5].baseline_min_us = 0u;
    bad[6].baseline_first_us = 300u * MS;
    bad[7].baseline_max_us = 500u * MS;
    bad[8].age_max_us = EVS_KEYFRAMES_AGE_MAX_US + 1u;
    for (size_t i = 0u; i < 9u; i++) {
        TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_keyframes_init(&k, &bad[i], memory, N_BYTES));
    }
    TEST_ASSERT_EQUAL_MEMORY(&before, &k, sizeof k);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_partner_is_a_baseline_old_whatever_the_rate_of_images);
    RUN_TEST(test_baseline_follows_the_image_speed_within_its_limits);
    RUN_TEST(test_first_speed_is_taken_as_it_is_and_later_ones_by_their_share);
    RUN_TEST(test_lost_patches_shorten_the_baseline_until_speed_is_seen_again);
    RUN_TEST(test_no_partner_that_is_too_young_or_too_old);
    RUN_TEST(test_of_two_equally_near_the_older_one_is_the_partner);
    RUN_TEST(test_time_that_runs_back_drops_what_lies_in_the_future);
    RUN_TEST(test_images_keep_their_pixels_while_others_come_and_go);
    RUN_TEST(test_image_too_close_to_the_newest_stored_one_leaves_its_plane);
    RUN_TEST(test_turned_image_shows_what_the_new_reference_would_see);
    RUN_TEST(test_turning_by_a_whole_pixel_moves_every_pixel_exactly);
    RUN_TEST(test_turning_behind_the_camera_gives_a_dark_image);
    RUN_TEST(test_init_refuses_bad_settings_and_leaves_the_context_alone);
    return UNITY_END();
}
