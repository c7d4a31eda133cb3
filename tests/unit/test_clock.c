/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/clock.h"
#include "unity.h"

static evs_clock_t watch;

void setUp(void) { watch = (evs_clock_t){0}; }
void tearDown(void) {}

static void test_ascending_times_pass_across_the_wrap(void)
{
    TEST_ASSERT_EQUAL_INT(EVS_CLOCK_FORWARD, evs_clock_step(&watch, 0xFFFFFFF0u, false));
    TEST_ASSERT_EQUAL_INT(EVS_CLOCK_FORWARD, evs_clock_step(&watch, 5u, false));
    TEST_ASSERT_EQUAL_INT(EVS_CLOCK_BACK, evs_clock_step(&watch, 0xFFFFFFF8u, false));
    TEST_ASSERT_EQUAL_UINT32(1u, watch.n_back);
}

static void test_equal_times_pass_only_where_allowed(void)
{
    TEST_ASSERT_EQUAL_INT(EVS_CLOCK_FORWARD, evs_clock_step(&watch, 7u, true));
    TEST_ASSERT_EQUAL_INT(EVS_CLOCK_FORWARD, evs_clock_step(&watch, 7u, true));
    TEST_ASSERT_EQUAL_INT(EVS_CLOCK_BACK, evs_clock_step(&watch, 7u, false));
}

static void test_one_wild_time_ahead_silences_the_stream_only_briefly(void)
{
    (void)evs_clock_step(&watch, 1000u, false);
    TEST_ASSERT_EQUAL_INT(EVS_CLOCK_FORWARD, evs_clock_step(&watch, 500000000u, false));
    for (uint32_t i = 0; i < EVS_CLOCK_RESTART_AFTER; i++) {
        TEST_ASSERT_EQUAL_INT(EVS_CLOCK_BACK, evs_clock_step(&watch, 1010u + i, false));
    }
    TEST_ASSERT_EQUAL_INT(EVS_CLOCK_RESTART, evs_clock_step(&watch, 2000u, false));
    TEST_ASSERT_EQUAL_INT(EVS_CLOCK_FORWARD, evs_clock_step(&watch, 2001u, false));
    TEST_ASSERT_EQUAL_UINT32(EVS_CLOCK_RESTART_AFTER, watch.n_back);
}

static void test_accepted_time_is_the_newest_whatever_came_before(void)
{
    (void)evs_clock_step(&watch, 1000u, false);
    evs_clock_accept(&watch, 0x90000000u); /* a jump that a single step would take for one back */
    TEST_ASSERT_EQUAL_INT(EVS_CLOCK_FORWARD, evs_clock_step(&watch, 0x90000001u, false));
    TEST_ASSERT_EQUAL_INT(EVS_CLOCK_BACK, evs_clock_step(&watch, 0x8FFFFFFFu, false));
}

static void test_scattered_old_times_never_restart_the_clock(void)
{
    (void)evs_clock_step(&watch, 100000u, false);
    for (uint32_t i = 0; i < 200u; i++) { /* descending: not the order of a restarted stream */
        TEST_ASSERT_EQUAL_INT(EVS_CLOCK_BACK, evs_clock_step(&watch, 90000u - i, false));
    }
    for (uint32_t i = 0; i < 200u; i++) { /* ascending, but between good ones */
        TEST_ASSERT_EQUAL_INT(EVS_CLOCK_FORWARD, evs_clock_step(&watch, 100001u + i, false));
        TEST_ASSERT_EQUAL_INT(EVS_CLOCK_BACK, evs_clock_step(&watch, 50000u + i, false));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_ascending_times_pass_across_the_wrap);
    RUN_TEST(test_equal_times_pass_only_where_allowed);
    RUN_TEST(test_one_wild_time_ahead_silences_the_stream_only_briefly);
    RUN_TEST(test_accepted_time_is_the_newest_whatever_came_before);
    RUN_TEST(test_scattered_old_times_never_restart_the_clock);
    return UNITY_END();
}
