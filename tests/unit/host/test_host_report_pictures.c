/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <stdlib.h>
#include <string.h>

#include "clip.h"
#include "panes.h"
#include "span.h"
#include "unity.h"

enum { W = 40, H = 30 };

static evr_shake_t shake;
static evr_clip_t clip;
static evr_spans_t spans;

void setUp(void)
{
    evr_shake_clear(&shake);
    TEST_ASSERT_TRUE(evr_clip_open(&clip, W, H));
    TEST_ASSERT_TRUE(evr_spans_open(&spans, W, H));
}
void tearDown(void)
{
    evr_clip_close(&clip);
    evr_spans_close(&spans);
}

static evs_point_t px(int x, int y)
{
    const evs_point_t p = {(int16_t)(16 * x), (int16_t)(16 * y)};
    return p;
}

/* --- panes --- */

static void test_the_stabilized_frame_lies_in_the_middle_of_the_canvas(void)
{
    const evr_panes_t p = evr_panes_layout(W, H);
    uint8_t *const picture = calloc(1u, p.n_cells);
    const evs_event_t ev[2] = {evs_event_make(0u, 0u, 0u, true), evs_event_make(0u, 0u, 0u, false)};
    const evs_point_t raw[2] = {px(3, 2), px(3, 2)};
    const evs_point_t stab[2] = {px(0, 0), px(-20, -15)};
    TEST_ASSERT_EQUAL_INT(1, p.bin);
    TEST_ASSERT_EQUAL_size_t(5u * W * H, p.n_cells);
    evr_panes_add(&p, picture, ev, raw, stab, 2u);
    TEST_ASSERT_EQUAL_HEX8(0x11, picture[2 * W + 3]);
    TEST_ASSERT_EQUAL_HEX8(0x01, picture[W * H + 15 * 2 * W + 20]);
    TEST_ASSERT_EQUAL_HEX8(0x10, picture[W * H]); /* The canvas' first corner. */
    free(picture);
}

static void test_what_lies_beyond_the_canvas_or_has_no_position_is_left_out(void)
{
    const evr_panes_t p = evr_panes_layout(W, H);
    uint8_t *const picture = calloc(1u, p.n_cells);
    const evs_event_t ev = evs_event_make(0u, 0u, 0u, true);
    const evs_point_t far[5] = {px(-21, 0), px(60, 0), px(0, -16), px(0, 45), evs_point_outside()};
    const evs_point_t none = evs_point_outside();
    for (int i = 0; i < 5; i++) { evr_panes_add(&p, picture, &ev, &none, &far[i], 1u); }
    for (size_t i = 0u; i < p.n_cells; i++) { TEST_ASSERT_EQUAL_HEX8(0u, picture[i]); }
    free(picture);
}

static void test_a_large_sensor_is_binned(void)
{
    const evr_panes_t p = evr_panes_layout(1280u, 720u);
    uint8_t *const picture = calloc(1u, p.n_cells);
    const evs_event_t ev = evs_event_make(0u, 0u, 0u, true);
    const evs_point_t corner = px(1279, 719);
    TEST_ASSERT_EQUAL_INT(4, p.bin);
    TEST_ASSERT_EQUAL_INT(320, p.width);
    TEST_ASSERT_EQUAL_INT(180, p.height);
    evr_panes_add(&p, picture, &ev, &corner, &corner, 1u);
    TEST_ASSERT_EQUAL_HEX8(1u, picture[320 * 180 - 1]);
    TEST_ASSERT_EQUAL_HEX8(1u, picture[320 * 180 + (179 + 90) * 640 + 319 + 160]);
    free(picture);
}

static void test_a_full_cell_stays_full_and_keeps_its_other_half(void)
{
    const evr_panes_t p = evr_panes_layout(W, H);
    uint8_t *const a = calloc(1u, p.n_cells);
    uint8_t *const b = calloc(1u, p.n_cells);
    const evs_event_t ev[2] = {evs_event_make(0u, 0u, 0u, true), evs_event_make(0u, 0u, 0u, false)};
    const evs_point_t at[2] = {px(0, 0), px(0, 0)};
    for (int i = 0; i < 20; i++) { evr_panes_add(&p, a, ev, at, at, 1u); }
    TEST_ASSERT_EQUAL_HEX8(0x0f, a[0]);
    for (int i = 0; i < 9; i++) { evr_panes_add(&p, b, ev, at, at, 2u); }
    TEST_ASSERT_EQUAL_HEX8(0x99, b[0]);
    evr_panes_merge(&p, a, b);
    TEST_ASSERT_EQUAL_HEX8(0x9f, a[0]);
    evr_panes_merge(&p, a, b);
    TEST_ASSERT_EQUAL_HEX8(0xff, a[0]);
    free(a);
    free(b);
}

/* --- clip --- */

/* One brighter event a millisecond at a pixel, the camera turning at `rate`. */
static void film(int64_t from_us, int64_t to_us, double rate, int x)
{
    for (int64_t t = from_us; t < to_us; t += 1000) {
        const evs_event_t ev = evs_event_make(0u, 0u, 0u, true);
        const evs_point_t at = px(x, 5);
        evr_shake_put(&shake, t, rate, 10.0 * rate);
        evr_clip_add(&clip, &shake, &t, &ev, &at, &at, 1u);
        evr_spans_add(&spans, &shake, false, &t, &at, &at, 1u);
    }
}

static unsigned clip_sum(const evr_take_t *take)
{
    unsigned sum = 0u;
    for (size_t i = 0u; i < (size_t)take->n * clip.panes.n_cells; i++) {
        if (i % clip.panes.n_cells < (size_t)W * H) { sum += take->pictures[i] & 15u; }
    }
    return sum;
}

static void test_a_short_recording_has_short_pictures_and_loses_no_event(void)
{
    const evr_take_t *take;
    film(1000000, 1100000, 1.0, 3);
    take = evr_clip_finish(&clip, &shake);
    TEST_ASSERT_EQUAL_INT64(1250, take->picture_us);
    TEST_ASSERT_EQUAL_INT(80, take->n);
    TEST_ASSERT_EQUAL_UINT(100u, clip_sum(take));
    TEST_ASSERT_EQUAL_INT64(1000000, take->start_us);
}

static void test_the_clip_is_that_of_the_fastest_turn(void)
{
    const evr_take_t *take;
    film(0, 2000000, 1.0, 3);
    film(2000000, 4000000, 5.0, 4);
    film(4000000, 6000000, 2.0, 5);
    film(6000000, 6100000, 9.0, 6); /* Faster, but only a rest of a clip. */
    take = evr_clip_finish(&clip, &shake);
    TEST_ASSERT_EQUAL_INT64(2000000, take->start_us);
    TEST_ASSERT_EQUAL_INT64(20000, take->picture_us);
    TEST_ASSERT_EQUAL_INT(100, take->n);
    TEST_ASSERT_EQUAL_HEX8(15u, take->pictures[5 * W + 4]);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 5.0, take->rate_rad_s);
}

static void test_a_pause_ends_a_clip(void)
{
    film(0, 1600000, 1.0, 3);
    film(INT64_C(90000000), 90001000, 1.0, 4);
    TEST_ASSERT_EQUAL_INT64(0, evr_clip_finish(&clip, &shake)->start_us);
}

static void test_no_events_no_clip(void) { TEST_ASSERT_NULL(evr_clip_finish(&clip, &shake)); }

/* --- spans --- */

static void test_the_span_shown_is_the_fastest_with_enough_events(void)
{
    film(0, 120000, 1.0, 3);
    film(120000, 240000, 4.0, 7);
    film(240000, 250000, 9.0, 5); /* Too short. */
    evr_spans_finish(&spans, &shake);
    TEST_ASSERT_EQUAL_UINT64(3u, spans.n_spans);
    TEST_ASSERT_EQUAL_INT64(120000, spans.best.first_us);
    TEST_ASSERT_EQUAL_UINT64(120u, spans.best.n_events);
    TEST_ASSERT_EQUAL_UINT8(120u, spans.best_before[5 * W + 7]);
    TEST_ASSERT_EQUAL_UINT8(0u, spans.best_before[5 * W + 3]);
    TEST_ASSERT_TRUE(spans.best.before > 0.0);
}

static void test_a_saccade_ends_a_span(void)
{
    const int64_t t_us[2] = {0, 1000};
    const evs_point_t at[2] = {px(1, 1), px(2, 2)};
    evr_spans_add(&spans, &shake, false, t_us, at, at, 1u);
    evr_spans_add(&spans, &shake, true, t_us + 1, at + 1, at + 1, 1u);
    evr_spans_finish(&spans, &shake);
    TEST_ASSERT_EQUAL_UINT64(2u, spans.n_spans);
}

static void test_the_mean_rate_weighs_spans_by_their_duration(void)
{
    film(0, 120000, 1.0, 3);
    film(120000, 180000, 4.0, 7);
    evr_spans_finish(&spans, &shake);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 2.0, spans.all.rate_rad_s);
    TEST_ASSERT_EQUAL_DOUBLE(4.0, spans.all.rate_max_rad_s);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_stabilized_frame_lies_in_the_middle_of_the_canvas);
    RUN_TEST(test_what_lies_beyond_the_canvas_or_has_no_position_is_left_out);
    RUN_TEST(test_a_large_sensor_is_binned);
    RUN_TEST(test_a_full_cell_stays_full_and_keeps_its_other_half);
    RUN_TEST(test_a_short_recording_has_short_pictures_and_loses_no_event);
    RUN_TEST(test_the_clip_is_that_of_the_fastest_turn);
    RUN_TEST(test_a_pause_ends_a_clip);
    RUN_TEST(test_no_events_no_clip);
    RUN_TEST(test_the_span_shown_is_the_fastest_with_enough_events);
    RUN_TEST(test_a_saccade_ends_a_span);
    RUN_TEST(test_the_mean_rate_weighs_spans_by_their_duration);
    return UNITY_END();
}
