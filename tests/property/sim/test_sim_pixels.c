/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Event pixels under intensities whose events can be counted by hand. */
#include <math.h>
#include <stdlib.h>

#include "pixels.h"
#include "unity.h"

enum { W = 8, H = 4, N = W * H };

static evsim_settings_t settings;
static evsim_pixels_t pixels;
static evsim_event_list_t list;
static float intensity[N];
static evh_error_t err;

static void start(double log_intensity)
{
    TEST_ASSERT_TRUE_MESSAGE(evsim_pixels_init(&pixels, &settings, &err), err.text);
    for (int i = 0; i < N; i++) { intensity[i] = (float)exp(log_intensity) - EVSIM_DARK; }
    evsim_pixels_start(&pixels, 0u, H, intensity);
}

static void step(double log_intensity, int64_t t0_ns, int64_t t1_ns)
{
    const evsim_interval_t interval = {t0_ns, t1_ns, 0};
    for (int i = 0; i < N; i++) { intensity[i] = (float)exp(log_intensity) - EVSIM_DARK; }
    evsim_pixels_step(&pixels, 0u, H, intensity, &interval, &list);
}

void setUp(void)
{
    evsim_settings_default(&settings, EVSIM_SCENE_ROOM);
    settings.calib.width_px = W;
    settings.calib.height_px = H;
    settings.noise_hz = 0.0;
    settings.contrast_sigma = 0.0;
    settings.contrast_on = 0.2;
    settings.contrast_off = 0.3;
    settings.refractory_us = 0;
    list = (evsim_event_list_t){NULL, 0u, 0u, false};
}

void tearDown(void)
{
    evsim_pixels_free(&pixels);
    free(list.event);
}

static void test_a_ramp_fires_at_every_threshold_on_the_line(void)
{
    unsigned count[N] = {0};
    start(-2.0);
    step(-1.0, 0, 1000000); /* +1 in 1 ms. The first threshold is up to 0.5 away. */
    for (size_t i = 0u; i < list.n; i++) {
        const unsigned pixel = (list.event[i].y_px & 0x7FFFu) * W + list.event[i].x_px;
        TEST_ASSERT_TRUE_MESSAGE((list.event[i].y_px & 0x8000u) != 0u, "brighter is ON");
        if (count[pixel] > 0u) { TEST_ASSERT_UINT_WITHIN(1u, list.event[i - 1].t_us + 200u, list.event[i].t_us); }
        count[pixel]++;
    }
    for (int i = 0; i < N; i++) { TEST_ASSERT_TRUE((count[i] >= 3u) && (count[i] <= 5u)); }
}

static void test_down_again_fires_off_events_with_their_own_threshold(void)
{
    size_t n_on;
    start(-2.0);
    step(-0.5, 0, 1000000);
    n_on = list.n;
    TEST_ASSERT_TRUE((n_on > N * 6u) && (n_on < N * 9u));
    step(-2.0, 1000000, 2000000);
    for (size_t i = n_on; i < list.n; i++) { TEST_ASSERT_EQUAL_UINT(0u, list.event[i].y_px & 0x8000u); }
    TEST_ASSERT_TRUE((list.n - n_on > N * 3u) && (list.n - n_on < N * 6u)); /* 1.5 / 0.3 less the dead band */
}

static void test_nothing_happens_while_nothing_changes(void)
{
    start(-1.0);
    for (int64_t k = 0; k < 100; k++) { step(-1.0, k * 1000000, (k + 1) * 1000000); }
    TEST_ASSERT_EQUAL_UINT(0u, list.n);
}

static void test_one_step_or_many_small_ones_fire_the_same(void)
{
    evsim_event_list_t once;
    start(-2.0);
    step(-1.0, 0, 1000000);
    once = list;
    list = (evsim_event_list_t){NULL, 0u, 0u, false};
    evsim_pixels_free(&pixels);
    start(-2.0);
    for (int64_t k = 0; k < 50; k++) { step(-2.0 + 0.02 * (double)(k + 1), k * 20000, (k + 1) * 20000); }
    TEST_ASSERT_EQUAL_UINT(once.n, list.n);
    free(once.event);
}

static void test_refractory_period_keeps_events_apart(void)
{
    uint32_t last[N];
    settings.refractory_us = 350;
    settings.noise_hz = 20000.0; /* Every gap is tried, also one microsecond too short. */
    start(-3.0);
    for (int i = 0; i < N; i++) { last[i] = 0x80000000u; }
    step(0.0, 0, 5000000);
    step(-3.0, 5000000, 9000000);
    TEST_ASSERT_TRUE(list.n > 0u);
    for (size_t i = 0u; i < list.n; i++) {
        const unsigned pixel = (list.event[i].y_px & 0x7FFFu) * W + list.event[i].x_px;
        TEST_ASSERT_TRUE(list.event[i].t_us - last[pixel] >= 350u);
        last[pixel] = list.event[i].t_us;
    }
}

static void test_noise_has_its_rate_and_hot_pixels_theirs(void)
{
    unsigned count[N] = {0};
    unsigned n_hot = 0u;
    unsigned n_rest = 0u;
    settings.noise_hz = 20.0;
    settings.n_hot = 3u;
    settings.hot_hz = 1000.0;
    start(-1.0);
    step(-1.0, 0, INT64_C(10000000000));
    for (size_t i = 0u; i < list.n; i++) { count[(list.event[i].y_px & 0x7FFFu) * W + list.event[i].x_px]++; }
    for (int i = 0; i < N; i++) {
        if (count[i] > 5000u) {
            n_hot++;
            TEST_ASSERT_UINT_WITHIN(510u, 10200u, count[i]); /* 5 sigma */
        } else {
            n_rest += count[i];
        }
    }
    TEST_ASSERT_EQUAL_UINT(3u, n_hot);
    TEST_ASSERT_UINT_WITHIN(380u, (N - 3u) * 200u, n_rest);
}

static void test_thresholds_spread_as_stated(void)
{
    double mean = 0.0;
    double var = 0.0;
    settings.calib.width_px = 100;
    settings.calib.height_px = 100;
    settings.contrast_sigma = 0.03;
    TEST_ASSERT_TRUE(evsim_pixels_init(&pixels, &settings, &err));
    for (int i = 0; i < 10000; i++) { mean += (double)pixels.on[i] / 10000.0; }
    for (int i = 0; i < 10000; i++) { var += ((double)pixels.on[i] - mean) * ((double)pixels.on[i] - mean) / 10000.0; }
    TEST_ASSERT_DOUBLE_WITHIN(0.0015, 0.2, mean);
    TEST_ASSERT_DOUBLE_WITHIN(0.0015, 0.03, sqrt(var));
}

static void test_merging_sorts_by_time_and_keeps_the_order_of_equals(void)
{
    evsim_event_t a[] = {{5u, 1u, 0u}, {0u, 2u, 0u}, {7u, 3u, 0u}};
    evsim_event_t b[] = {{5u, 4u, 0u}, {5u, 5u, 0u}, {0u, 6u, 0u}};
    static const uint16_t WANT[] = {2u, 6u, 1u, 4u, 5u, 3u};
    const evsim_event_list_t lists[] = {{a, 3u, 3u, false}, {b, 3u, 3u, false}};
    uint32_t count[9];
    evsim_event_t sorted[6];
    evsim_events_merge(lists, 2u, 7u, count, sorted);
    for (int i = 0; i < 6; i++) { TEST_ASSERT_EQUAL_UINT16(WANT[i], sorted[i].x_px); }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_ramp_fires_at_every_threshold_on_the_line);
    RUN_TEST(test_down_again_fires_off_events_with_their_own_threshold);
    RUN_TEST(test_nothing_happens_while_nothing_changes);
    RUN_TEST(test_one_step_or_many_small_ones_fire_the_same);
    RUN_TEST(test_refractory_period_keeps_events_apart);
    RUN_TEST(test_noise_has_its_rate_and_hot_pixels_theirs);
    RUN_TEST(test_thresholds_spread_as_stated);
    RUN_TEST(test_merging_sorts_by_time_and_keeps_the_order_of_equals);
    return UNITY_END();
}
