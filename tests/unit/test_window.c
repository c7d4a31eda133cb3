/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/window.h"
#include "unity.h"

#include <string.h>

enum { N_TILES = 6, N_EVENTS = 4000, N_ENDS = 4000 };

static evs_window_t win;
static uint16_t counts[N_TILES + 1];
static evs_event_t events[N_EVENTS];
static uint16_t tiles[N_EVENTS];
static evs_window_end_t ends[N_ENDS];
static uint32_t seed;

void setUp(void)
{
    counts[N_TILES] = 0x5A5Au;
    seed = 99u;
}
void tearDown(void) { TEST_ASSERT_EQUAL_HEX16_MESSAGE(0x5A5A, counts[N_TILES], "wrote past the counts"); }

static uint32_t next_random(uint32_t below)
{
    seed = seed * 1664525u + 1013904223u;
    return (seed >> 8) % below;
}

static evs_window_config_t config(evs_window_kind_t kind, uint32_t threshold)
{
    evs_window_config_t cfg = evs_window_config_default();
    cfg.kind = kind;
    cfg.threshold = threshold;
    return cfg;
}

static void init(const evs_window_config_t *cfg)
{
    const bool area = cfg->kind == EVS_WINDOW_AREA;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_window_init(&win, cfg, area ? counts : NULL, area ? N_TILES : 0u));
}

/* A stream with bursts, pauses and repeated times, from t0 on. */
static void make_stream(uint32_t t0_us)
{
    uint32_t t_us = t0_us;
    for (size_t i = 0; i < N_EVENTS; i++) {
        t_us += (next_random(10) == 0u) ? next_random(2000) : next_random(3);
        events[i] = evs_event_make(t_us, 0u, 0u, false);
        const uint32_t pick = next_random(N_TILES + 2u);
        tiles[i] = (pick < N_TILES) ? (uint16_t)((pick * pick) / N_TILES) : EVS_TILE_NONE;
    }
}

/* Push everything in batches of at most `batch` (0: of random sizes); returns the number of windows. */
static size_t run(size_t batch)
{
    size_t n_ends = 0u;
    size_t at = 0u;
    while (at < N_EVENTS) {
        size_t n = (batch > 0u) ? batch : 1u + next_random(200);
        if (n > N_EVENTS - at) { n = N_EVENTS - at; }
        size_t done = 0u;
        while (done < n) {
            evs_window_end_t end = {.reason = EVS_WINDOW_OPEN};
            done += evs_window_push(&win, &events[at + done], &tiles[at + done], n - done, &end);
            if (end.reason != EVS_WINDOW_OPEN) { ends[n_ends++] = end; }
        }
        at += n;
    }
    evs_window_end_t end;
    if (evs_window_close(&win, EVS_WINDOW_BY_FLUSH, &end)) { ends[n_ends++] = end; }
    return n_ends;
}

/* The rules of the header, one event at a time and from the whole stream: an independent model. */
static size_t model(const evs_window_config_t *cfg, evs_window_end_t *out)
{
    size_t n_out = 0u;
    size_t first = 0u;
    while (first < N_EVENTS) {
        uint32_t tile_count[N_TILES] = {0};
        uint32_t highest = 0u;
        size_t i = first;
        evs_window_reason_t reason = EVS_WINDOW_BY_FLUSH;
        for (; i < N_EVENTS; i++) {
            const uint32_t age = events[i].t_us - events[first].t_us;
            if (cfg->kind == EVS_WINDOW_DURATION) {
                const uint32_t cell_of_first = (events[first].t_us - events[0].t_us) / cfg->duration_us;
                const uint32_t cell = (events[i].t_us - events[0].t_us) / cfg->duration_us;
                if (cell != cell_of_first) {
                    reason = EVS_WINDOW_BY_DURATION;
                    break;
                }
                continue;
            }
            if (age >= cfg->max_duration_us) {
                reason = EVS_WINDOW_BY_MAX_DURATION;
                break;
            }
            if (tiles[i] != EVS_TILE_NONE) { tile_count[tiles[i]]++; }
            for (size_t t = 0; t < N_TILES; t++) { highest = (tile_count[t] > highest) ? tile_count[t] : highest; }
            const bool due =
                (cfg->kind == EVS_WINDOW_AREA) ? highest > cfg->threshold : i - first + 1u >= cfg->threshold;
            if (due && (age >= cfg->min_duration_us)) {
                reason = (cfg->kind == EVS_WINDOW_AREA) ? EVS_WINDOW_BY_AREA : EVS_WINDOW_BY_COUNT;
                i++;
                break;
            }
        }
        out[n_out] = (evs_window_end_t){.index = (uint32_t)n_out,
                                        .n_events = (uint32_t)(i - first),
                                        .t_first_us = events[first].t_us,
                                        .t_last_us = events[i - 1u].t_us,
                                        .reason = reason};
        n_out++;
        first = i;
    }
    return n_out;
}

static void test_init_names_the_fault_and_leaves_the_context_alone(void)
{
    const evs_window_config_t good = evs_window_config_default();
    struct {
        evs_window_config_t cfg;
        evs_status_t want;
    } cases[12];
    for (size_t i = 0; i < 12u; i++) {
        cases[i].cfg = good;
        cases[i].want = EVS_ERR_ARG;
    }
    cases[0].cfg.threshold = 0u;
    cases[1].cfg.threshold = EVS_WINDOW_AREA_MAX + 1u;
    cases[2].cfg.max_duration_us = 0u;
    cases[3].cfg.max_duration_us = EVS_WINDOW_DURATION_MAX_US + 1u;
    cases[4].cfg.min_duration_us = EVS_WINDOW_DURATION_MAX_US + 1u;
    cases[5].cfg.kind = EVS_WINDOW_COUNT;
    cases[5].cfg.threshold = EVS_WINDOW_COUNT_MAX + 1u;
    cases[6].cfg.kind = EVS_WINDOW_DURATION;
    cases[6].cfg.duration_us = 0u;
    cases[7].cfg.kind = EVS_WINDOW_DURATION;
    cases[7].cfg.duration_us = EVS_WINDOW_DURATION_MAX_US + 1u;
    cases[8].cfg.kind = (evs_window_kind_t)3;
    cases[9].cfg.threshold = EVS_WINDOW_AREA_MAX;
    cases[9].want = EVS_OK;
    cases[10].cfg.min_duration_us = cases[10].cfg.max_duration_us;
    cases[10].want = EVS_OK;
    cases[11].want = EVS_OK;
    for (size_t i = 0; i < 12u; i++) {
        evs_window_t fresh = {.index = 7u};
        TEST_ASSERT_EQUAL_INT(cases[i].want, evs_window_init(&fresh, &cases[i].cfg, counts, N_TILES));
        TEST_ASSERT_EQUAL_UINT32((cases[i].want == EVS_OK) ? 0u : 7u, fresh.index);
    }
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_window_init(NULL, &good, counts, N_TILES));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_window_init(&win, NULL, counts, N_TILES));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_window_init(&win, &good, NULL, N_TILES));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_window_init(&win, &good, counts, 0u));
}

static void test_area_closes_with_the_event_that_exceeds_the_threshold(void)
{
    const evs_window_config_t cfg = config(EVS_WINDOW_AREA, 2u);
    init(&cfg);
    const uint16_t where[] = {0, 1, 0, EVS_TILE_NONE, 1, 0, 5, 5};
    for (size_t i = 0; i < 8u; i++) { events[i] = evs_event_make((uint32_t)(10u * i), 0u, 0u, true); }
    evs_window_end_t end;
    TEST_ASSERT_EQUAL_UINT(6u, evs_window_push(&win, events, where, 8u, &end));
    TEST_ASSERT_EQUAL_INT(EVS_WINDOW_BY_AREA, end.reason);
    TEST_ASSERT_EQUAL_UINT32(6u, end.n_events);
    TEST_ASSERT_EQUAL_UINT32(0u, end.t_first_us);
    TEST_ASSERT_EQUAL_UINT32(50u, end.t_last_us);
    TEST_ASSERT_TRUE(evs_window_is_empty(&win));
    TEST_ASSERT_EQUAL_UINT32(1u, evs_window_index(&win));
    TEST_ASSERT_EQUAL_UINT(2u, evs_window_push(&win, events + 6, where + 6, 2u, &end));
    TEST_ASSERT_EQUAL_INT_MESSAGE(EVS_WINDOW_OPEN, end.reason, "the counts of the last window were kept");
}

static void test_every_kind_agrees_with_the_model_however_the_stream_is_split(void)
{
    evs_window_config_t cfgs[7];
    cfgs[0] = config(EVS_WINDOW_AREA, 20u);
    cfgs[1] = config(EVS_WINDOW_COUNT, 33u);
    cfgs[2] = config(EVS_WINDOW_DURATION, 1u);
    cfgs[2].duration_us = 1500u;
    cfgs[3] = config(EVS_WINDOW_AREA, 20u);
    cfgs[3].min_duration_us = 5000u;
    cfgs[3].max_duration_us = 9000u;
    cfgs[4] = config(EVS_WINDOW_COUNT, 33u);
    cfgs[4].max_duration_us = 2500u;
    cfgs[5] = config(EVS_WINDOW_COUNT, 1u);
    cfgs[6] = config(EVS_WINDOW_AREA, 60000u);
    static evs_window_end_t want[N_ENDS];
    for (size_t c = 0; c < 7u; c++) {
        make_stream((c % 2u == 0u) ? 0u : 0xFFFF0000u); /* every second one runs across the wrap */
        const size_t n_want = model(&cfgs[c], want);
        TEST_ASSERT_TRUE((c == 6u) || (n_want > 20u));
        static const size_t BATCHES[] = {1u, 7u, 64u, N_EVENTS, 0u};
        for (size_t b = 0; b < 5u; b++) {
            init(&cfgs[c]);
            TEST_ASSERT_EQUAL_UINT(n_want, run(BATCHES[b]));
            for (size_t i = 0; i < n_want; i++) {
                TEST_ASSERT_EQUAL_UINT32(want[i].index, ends[i].index);
                TEST_ASSERT_EQUAL_UINT32(want[i].n_events, ends[i].n_events);
                TEST_ASSERT_EQUAL_UINT32(want[i].t_first_us, ends[i].t_first_us);
                TEST_ASSERT_EQUAL_UINT32(want[i].t_last_us, ends[i].t_last_us);
                TEST_ASSERT_EQUAL_INT(want[i].reason, ends[i].reason);
            }
        }
    }
}

static void test_duration_grid_skips_empty_cells_and_starts_at_the_first_event(void)
{
    evs_window_config_t cfg = config(EVS_WINDOW_DURATION, 1u);
    cfg.duration_us = 100u;
    init(&cfg);
    const uint32_t times[] = {1050u, 1149u, 1150u, 1455u, 1549u};
    for (size_t i = 0; i < 5u; i++) { events[i] = evs_event_make(times[i], 0u, 0u, true); }
    evs_window_end_t end;
    TEST_ASSERT_EQUAL_UINT(2u, evs_window_push(&win, events, NULL, 5u, &end));
    TEST_ASSERT_EQUAL_INT(EVS_WINDOW_BY_DURATION, end.reason);
    TEST_ASSERT_EQUAL_UINT(1u, evs_window_push(&win, events + 2, NULL, 3u, &end));
    TEST_ASSERT_EQUAL_INT(EVS_WINDOW_BY_DURATION, end.reason);
    TEST_ASSERT_EQUAL_UINT32(1150u, end.t_last_us);
    TEST_ASSERT_EQUAL_UINT(2u, evs_window_push(&win, events + 3, NULL, 2u, &end)); /* [1450, 1550) */
    TEST_ASSERT_EQUAL_INT(EVS_WINDOW_OPEN, end.reason);
}

static void test_expire_closes_only_what_the_time_has_passed(void)
{
    evs_window_config_t cfg = config(EVS_WINDOW_COUNT, 10u);
    cfg.max_duration_us = 100u;
    init(&cfg);
    evs_window_end_t end = {.n_events = 77u};
    TEST_ASSERT_FALSE(evs_window_expire(&win, 5000u, &end)); /* nothing in it */
    events[0] = evs_event_make(5000u, 0u, 0u, true);
    TEST_ASSERT_EQUAL_UINT(1u, evs_window_push(&win, events, tiles, 1u, &end));
    TEST_ASSERT_FALSE(evs_window_expire(&win, 5099u, &end));
    TEST_ASSERT_TRUE(evs_window_expire(&win, 5100u, &end));
    TEST_ASSERT_EQUAL_INT(EVS_WINDOW_BY_MAX_DURATION, end.reason);
    TEST_ASSERT_EQUAL_UINT32(1u, end.n_events);

    cfg.kind = EVS_WINDOW_DURATION;
    cfg.duration_us = 100u;
    init(&cfg);
    TEST_ASSERT_EQUAL_UINT(1u, evs_window_push(&win, events, tiles, 1u, &end));
    TEST_ASSERT_TRUE(evs_window_expire(&win, 5100u, &end));
    TEST_ASSERT_EQUAL_INT(EVS_WINDOW_BY_DURATION, end.reason);
}

static void test_close_ends_a_window_that_holds_events_and_only_that(void)
{
    const evs_window_config_t cfg = config(EVS_WINDOW_COUNT, 10u);
    init(&cfg);
    evs_window_end_t end = {.n_events = 77u};
    TEST_ASSERT_FALSE(evs_window_close(&win, EVS_WINDOW_BY_FLUSH, &end));
    TEST_ASSERT_EQUAL_UINT32(77u, end.n_events);
    make_stream(0u);
    TEST_ASSERT_EQUAL_UINT(3u, evs_window_push(&win, events, tiles, 3u, &end));
    TEST_ASSERT_TRUE(evs_window_close(&win, EVS_WINDOW_BY_RESTART, &end));
    TEST_ASSERT_EQUAL_UINT32(3u, end.n_events);
    TEST_ASSERT_EQUAL_INT(EVS_WINDOW_BY_RESTART, end.reason);
    TEST_ASSERT_EQUAL_UINT(0u, evs_window_push(&win, events, tiles, 0u, &end));
    TEST_ASSERT_EQUAL_INT(EVS_WINDOW_OPEN, end.reason);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_names_the_fault_and_leaves_the_context_alone);
    RUN_TEST(test_area_closes_with_the_event_that_exceeds_the_threshold);
    RUN_TEST(test_every_kind_agrees_with_the_model_however_the_stream_is_split);
    RUN_TEST(test_duration_grid_skips_empty_cells_and_starts_at_the_first_event);
    RUN_TEST(test_expire_closes_only_what_the_time_has_passed);
    RUN_TEST(test_close_ends_a_window_that_holds_events_and_only_that);
    return UNITY_END();
}
