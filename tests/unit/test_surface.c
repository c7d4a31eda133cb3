/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/surface.h"
#include "model.h"
#include "unity.h"

#include <string.h>

enum { W = 13, H = 11, N_PX = W * H, GUARD = 0xA5 };

static evs_surface_t surface;
static uint16_t memory[N_PX + 1];
static uint8_t image[N_PX + 1];

/* The model: times that do not wrap; -1 before the first event. */
static int64_t last_us[N_PX];
static bool brighter[N_PX];
static uint32_t start_us; /* what the device's clock showed at 0 */

void setUp(void) { memory[N_PX] = 0x5A5Au; }
void tearDown(void) { TEST_ASSERT_EQUAL_HEX16_MESSAGE(0x5A5A, memory[N_PX], "wrote past the memory"); }

static void init(const evs_surface_config_t *cfg, uint32_t clock_us)
{
    memset(memory, GUARD, sizeof memory[0] * N_PX);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_surface_init(&surface, cfg, memory, EVS_SURFACE_BYTES(W, H)));
    for (size_t i = 0; i < N_PX; i++) { last_us[i] = -1; }
    start_us = clock_us;
}

static evs_point_t at_pixel(size_t i)
{
    const evs_point_t p = {(int16_t)(16 * (int)(i % W) + (int)(i % 16u) - 8), (int16_t)(16 * (int)(i / W) + 7)};
    return p;
}

static void event(int64_t t_us, size_t pixel, bool is_brighter)
{
    const evs_event_t ev = evs_event_make(start_us + (uint32_t)t_us, 7u, 9u, is_brighter);
    const evs_point_t p = at_pixel(pixel);
    evs_surface_add(&surface, &ev, &p, 1u);
    last_us[pixel] = t_us;
    brighter[pixel] = is_brighter;
}

static int64_t ticks(int64_t t_us) { return ((int64_t)start_us + t_us) >> 6; }

static void check_image(int64_t t_us)
{
    const bool with_sign = surface.cfg.polarity == EVS_SURFACE_SIGNED;
    const double full = with_sign ? 127.0 : 255.0;
    image[N_PX] = GUARD;
    evs_surface_render(&surface, start_us + (uint32_t)t_us, image);
    for (size_t i = 0; i < N_PX; i++) {
        const double age_us = 64.0 * (double)(ticks(t_us) - ticks(last_us[i]));
        double level = (last_us[i] < 0) ? 0.0 : full * exp(-age_us / evs_surface_tau_us(&surface));
        if (with_sign) { level = brighter[i] ? 128.0 + level : 128.0 - level; }
        TEST_ASSERT_TRUE_MESSAGE(fabs(image[i] - level) <= 1.0, "a grey level");
    }
    TEST_ASSERT_EQUAL_HEX8_MESSAGE(GUARD, image[N_PX], "wrote past the image");
}

static evs_surface_config_t fixed_tau(uint32_t tau_us)
{
    evs_surface_config_t cfg = evs_surface_config_default(W, H);
    cfg.tau_min_us = tau_us;
    cfg.tau_start_us = tau_us;
    return cfg;
}

static void test_init_names_the_fault_and_leaves_the_context_alone(void)
{
    const evs_surface_config_t good = evs_surface_config_default(W, H);
    const size_t n = EVS_SURFACE_BYTES(W, H);
    evs_surface_config_t bad[12];
    for (size_t i = 0; i < 12u; i++) { bad[i] = good; }
    bad[0].width_px = 0u;
    bad[1].height_px = 0u;
    bad[2].width_px = EVS_SENSOR_MAX_PX + 1u;
    bad[3].height_px = EVS_SENSOR_MAX_PX + 1u;
    bad[4].polarity = (evs_surface_polarity_t)2;
    bad[5].polarity = (evs_surface_polarity_t)-1;
    bad[6].alpha_q15 = 32769u;
    bad[7].tau_min_us = EVS_SURFACE_TAU_MIN_US - 1u;
    bad[8].tau_max_us = EVS_SURFACE_TAU_MAX_US + 1u;
    bad[9].tau_start_us = bad[9].tau_min_us - 1u;
    bad[10].tau_max_us = bad[10].tau_start_us - 1u;
    bad[11].tau_min_us = bad[11].tau_start_us + 1u;
    evs_surface_t before;
    memset(&surface, 0x77, sizeof surface);
    before = surface;
    for (size_t i = 0; i < 12u; i++) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(EVS_ERR_ARG, evs_surface_init(&surface, &bad[i], memory, n), "a bad setting");
    }
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_surface_init(&surface, &good, (uint8_t *)memory + 1, n));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_surface_init(NULL, &good, memory, n));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_surface_init(&surface, NULL, memory, n));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_surface_init(&surface, &good, NULL, n));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_surface_init(&surface, &good, memory, n - 1u));
    TEST_ASSERT_EQUAL_MEMORY(&before, &surface, sizeof surface);
}

/* Every age and many time constants, both kinds of image: one pixel that fades. */
static void test_every_age_is_within_one_grey_level(void)
{
    static const uint32_t TAUS[] = {EVS_SURFACE_TAU_MIN_US, 333u, 1000u, 7777u, 20000u, 90001u, EVS_SURFACE_TAU_MAX_US};
    for (size_t k = 0; k < sizeof TAUS / sizeof TAUS[0]; k++) {
        for (int polarity = EVS_SURFACE_MERGED; polarity <= EVS_SURFACE_SIGNED; polarity++) {
            evs_surface_config_t cfg = evs_surface_config_default(1u, 2u);
            cfg.polarity = (evs_surface_polarity_t)polarity;
            cfg.tau_min_us = EVS_SURFACE_TAU_MIN_US;
            cfg.tau_start_us = TAUS[k];
            TEST_ASSERT_EQUAL_INT(EVS_OK, evs_surface_init(&surface, &cfg, memory, EVS_SURFACE_BYTES(1, 2)));
            const evs_event_t ev[2] = {evs_event_make(640u, 0u, 0u, true), evs_event_make(650u, 0u, 0u, false)};
            const evs_point_t at[2] = {{0, 0}, {0, 16}};
            evs_surface_add(&surface, ev, at, 2u);
            const double full = (polarity == EVS_SURFACE_SIGNED) ? 127.0 : 255.0;
            for (uint32_t age = 0u; age < 40000u; age += (age < 3000u) ? 1u : 37u) {
                evs_surface_render(&surface, 640u + 64u * age, image);
                const double level = full * exp(-64.0 * age / TAUS[k]);
                const double sign = (polarity == EVS_SURFACE_SIGNED) ? -1.0 : 1.0;
                const double zero = (polarity == EVS_SURFACE_SIGNED) ? 128.0 : 0.0;
                TEST_ASSERT_TRUE(fabs(image[0] - zero - level) <= 0.9); /* half of it the rounding */
                TEST_ASSERT_TRUE(fabs(image[1] - zero - sign * level) <= 0.9);
            }
            evs_surface_render(&surface, 640u, image);
            TEST_ASSERT_EQUAL_UINT8(255, image[0]);
            TEST_ASSERT_EQUAL_UINT8((polarity == EVS_SURFACE_SIGNED) ? 1 : 255, image[1]);
        }
    }
}

/* Steps from nothing to 35 min, and the clock's own wrap among them. */
static void test_gaps_of_any_length_are_right(void)
{
    static const int64_t CLOCKS[] = {0, 4294960000, 2147480000, 4294000000};
    static const double LONGEST_US[] = {60.0, 3e3, 4e4, 3e5, 3e6, 2147483647.0};
    for (size_t c = 0; c < 4u; c++) {
        evs_surface_config_t cfg = fixed_tau((c % 2u == 0u) ? EVS_SURFACE_TAU_MAX_US : 30000u);
        cfg.polarity = (c < 2u) ? EVS_SURFACE_MERGED : EVS_SURFACE_SIGNED;
        init(&cfg, (uint32_t)CLOCKS[c]);
        check_image(0);
        int64_t t_us = 0;
        for (int i = 0; i < 1500; i++) {
            event(t_us, (size_t)model_uniform(0, N_PX), model_uniform(0, 1) < 0.5);
            if (i % 3 == 0) { check_image(t_us); }
            const double longest = LONGEST_US[(size_t)model_uniform(0, 6)];
            if (i % 5 == 0) { check_image(t_us + (int64_t)model_uniform(0, longest)); }
            t_us += (int64_t)model_uniform(0, longest);
        }
    }
}

/* One busy pixel keeps time going for half a minute, at several paces; none of the others may come back. */
static void test_stale_pixels_stay_dark(void)
{
    static const int64_t STEP_US[] = {63,     1000,    50000,   131000,  131072, 131136,
                                      262144, 1572800, 1572864, 2097152, 4194304};
    for (size_t k = 0; k < sizeof STEP_US / sizeof STEP_US[0]; k++) {
        const evs_surface_config_t cfg = fixed_tau(EVS_SURFACE_TAU_MAX_US);
        init(&cfg, 4290000000u);
        for (size_t i = 0; i < N_PX; i++) { event((int64_t)(60u * i), i, (i & 1u) != 0u); }
        const int64_t last = (STEP_US[k] < 1000) ? 5000000 : 30000000;
        int64_t next_look = 0;
        for (int64_t t_us = 60 * N_PX; t_us < last; t_us += STEP_US[k]) {
            event(t_us, 5u, true);
            if (t_us >= next_look) {
                check_image(t_us);
                next_look = t_us + 20000;
            }
        }
    }
}

/* Ages that are made of the age at the last event and of the time since then. */
static void test_an_image_later_than_the_last_event(void)
{
    const evs_surface_config_t cfg = fixed_tau(20000u);
    for (int64_t step_us = 500; step_us < 200000; step_us += 7777) {
        init(&cfg, 4294900000u);
        event(0, 0u, true);
        event(step_us, 1u, true);
        for (int64_t late_us = 0; late_us < 200000; late_us += 5555) { check_image(step_us + late_us); }
    }
}

/* A gap that is a whole number of turns of the 15 bits, after an event of either polarity. */
static void test_whole_turns_do_not_make_young(void)
{
    for (int64_t turns = 1; turns < 1024; turns += 73) {
        for (int64_t off = -2; off <= 2; off++) {
            const evs_surface_config_t cfg = fixed_tau(20000u);
            init(&cfg, 12345u);
            event(0, 3u, true);
            event(1, 4u, false);
            event(turns * 2097152 + 64 * off, 9u, true);
            check_image(turns * 2097152 + 64 * off);
        }
    }
}

static void test_batches_do_not_matter(void)
{
    enum { N = 600 };
    static evs_event_t ev[N];
    static evs_point_t points[N];
    static uint8_t whole[N_PX];
    const evs_surface_config_t cfg = evs_surface_config_default(W, H);
    uint32_t t_us = 4294900000u;
    for (size_t i = 0; i < N; i++) {
        t_us += (uint32_t)model_uniform(0, (i % 100u == 99u) ? 500000 : 300);
        ev[i] = evs_event_make(t_us, 0u, 0u, (i & 1u) != 0u);
        points[i] = at_pixel((size_t)model_uniform(0, N_PX));
    }
    init(&cfg, 0u);
    evs_surface_add(&surface, ev, points, N);
    evs_surface_render(&surface, t_us, whole);
    init(&cfg, 0u);
    for (size_t i = 0; i < N; i += 7u) { evs_surface_add(&surface, ev + i, points + i, (N - i < 7u) ? N - i : 7u); }
    evs_surface_render(&surface, t_us, image);
    TEST_ASSERT_EQUAL_MEMORY(whole, image, N_PX);
}

static void test_points_off_the_view_and_times_that_run_back_are_counted(void)
{
    const evs_surface_config_t cfg = fixed_tau(20000u);
    init(&cfg, 0u);
    event(6400, 0u, true);
    const evs_point_t off[] = {{-9, 0},
                               {0, -9},
                               {16 * W - 8, 0},
                               {0, 16 * H - 8},
                               {EVS_POINT_MAX_Q4, 0},
                               {0, -EVS_POINT_MAX_Q4},
                               {EVS_POINT_OUTSIDE_Q4, EVS_POINT_OUTSIDE_Q4}};
    for (size_t i = 0; i < 7u; i++) {
        const evs_event_t ev = evs_event_make(6500u, 1u, 1u, true);
        evs_surface_add(&surface, &ev, &off[i], 1u);
    }
    TEST_ASSERT_EQUAL_UINT32(7u, evs_surface_n_outside(&surface));
    check_image(6500);

    const uint32_t back[] = {6463u, 6400u, 0u, 6500u - 0x7FFFFFFFu};
    for (size_t i = 0; i < 4u; i++) {
        const evs_event_t ev = evs_event_make(back[i], 1u, 1u, true);
        const evs_point_t p = at_pixel(20u);
        evs_surface_add(&surface, &ev, &p, 1u);
    }
    TEST_ASSERT_EQUAL_UINT32(4u, evs_surface_n_time_back(&surface));
    TEST_ASSERT_EQUAL_UINT32(7u, evs_surface_n_outside(&surface));
    check_image(6500);
    /* An image at a time before the last event is that of the last event. */
    evs_surface_render(&surface, 100u, image);
    TEST_ASSERT_EQUAL_UINT8(254, image[0]); /* a tick old */
    evs_surface_add(&surface, NULL, NULL, 0u);
    check_image(6500);
}

static void test_corner_pixels_take_events(void)
{
    const evs_surface_config_t cfg = fixed_tau(20000u);
    init(&cfg, 0u);
    const evs_point_t corners[] = {{-8, -8}, {16 * W - 9, -8}, {-8, 16 * H - 9}, {16 * W - 9, 16 * H - 9}};
    const size_t pixels[] = {0u, W - 1u, N_PX - W, N_PX - 1u};
    for (size_t i = 0; i < 4u; i++) {
        const evs_event_t ev = evs_event_make(64u, 1u, 1u, true);
        evs_surface_add(&surface, &ev, &corners[i], 1u);
        last_us[pixels[i]] = 64;
    }
    TEST_ASSERT_EQUAL_UINT32(0u, evs_surface_n_outside(&surface));
    check_image(64);
}

static void test_tau_follows_the_windows(void)
{
    evs_surface_config_t cfg = evs_surface_config_default(W, H);
    init(&cfg, 0u);
    double tau = cfg.tau_start_us;
    TEST_ASSERT_EQUAL_UINT32(cfg.tau_start_us, evs_surface_tau_us(&surface));
    for (int i = 0; i < 200; i++) {
        const double duration_us = floor(model_uniform(0, (i % 7 == 0) ? 4e9 : ((i % 5 == 0) ? 900.0 : 60000.0)));
        tau = (1.0 - 9830.0 / 32768.0) * duration_us + 9830.0 / 32768.0 * tau;
        tau = fmax(cfg.tau_min_us, fmin(cfg.tau_max_us, floor(tau + 0.5)));
        evs_surface_end_window(&surface, (uint32_t)duration_us);
        TEST_ASSERT_EQUAL_UINT32((uint32_t)tau, evs_surface_tau_us(&surface));
    }
    cfg.alpha_q15 = 32768u;
    init(&cfg, 0u);
    evs_surface_end_window(&surface, 50000u);
    TEST_ASSERT_EQUAL_UINT32(cfg.tau_start_us, evs_surface_tau_us(&surface));
    cfg.alpha_q15 = 0u;
    init(&cfg, 0u);
    evs_surface_end_window(&surface, 50000u);
    TEST_ASSERT_EQUAL_UINT32(50000u, evs_surface_tau_us(&surface));
    event(0, 0u, true);
    check_image(40000);
}

static void test_clear_forgets_events_and_time_but_not_tau(void)
{
    const evs_surface_config_t cfg = evs_surface_config_default(W, H);
    init(&cfg, 0u);
    event(5000000, 7u, true);
    evs_surface_end_window(&surface, 40000u);
    const uint32_t tau_us = evs_surface_tau_us(&surface);
    evs_surface_clear(&surface);
    last_us[7] = -1;
    TEST_ASSERT_EQUAL_UINT32(tau_us, evs_surface_tau_us(&surface));
    check_image(5000000);
    event(1000, 8u, true); /* a clock that has restarted */
    TEST_ASSERT_EQUAL_UINT32(0u, evs_surface_n_time_back(&surface));
    check_image(1000);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_names_the_fault_and_leaves_the_context_alone);
    RUN_TEST(test_every_age_is_within_one_grey_level);
    RUN_TEST(test_gaps_of_any_length_are_right);
    RUN_TEST(test_stale_pixels_stay_dark);
    RUN_TEST(test_an_image_later_than_the_last_event);
    RUN_TEST(test_whole_turns_do_not_make_young);
    RUN_TEST(test_batches_do_not_matter);
    RUN_TEST(test_points_off_the_view_and_times_that_run_back_are_counted);
    RUN_TEST(test_corner_pixels_take_events);
    RUN_TEST(test_tau_follows_the_windows);
    RUN_TEST(test_clear_forgets_events_and_time_but_not_tau);
    return UNITY_END();
}
