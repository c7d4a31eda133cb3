/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/types.h"
#include "evs/version.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

static void test_every_status_has_its_own_name(void)
{
    static const struct {
        evs_status_t status;
        const char *name;
    } CASES[] = {
        {EVS_OK, "EVS_OK"},
        {EVS_ERR_NULL, "EVS_ERR_NULL"},
        {EVS_ERR_ARG, "EVS_ERR_ARG"},
        {EVS_ERR_SIZE, "EVS_ERR_SIZE"},
        {EVS_ERR_TIME, "EVS_ERR_TIME"},
        {EVS_ERR_STATE, "EVS_ERR_STATE"},
        {EVS_ERR_NUMERIC, "EVS_ERR_NUMERIC"},
        {EVS_ERR_TOO_OLD, "EVS_ERR_TOO_OLD"},
        {EVS_ERR_TOO_NEW, "EVS_ERR_TOO_NEW"},
        {EVS_ERR_GAP, "EVS_ERR_GAP"},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        TEST_ASSERT_EQUAL_STRING(CASES[i].name, evs_status_name(CASES[i].status));
    }
}

static void test_a_value_that_is_no_status_is_named_as_such(void)
{
    TEST_ASSERT_EQUAL_STRING("EVS_ERR_?", evs_status_name((evs_status_t)1));
    TEST_ASSERT_EQUAL_STRING("EVS_ERR_?", evs_status_name((evs_status_t)-10));
}

static void test_an_event_gives_back_what_it_was_made_of(void)
{
    const uint16_t last_px = EVS_SENSOR_MAX_PX - 1u;
    for (int p = 0; p <= 1; p++) {
        const evs_event_t ev = evs_event_make(UINT32_MAX, last_px, last_px, p == 1);
        TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, ev.t_us);
        TEST_ASSERT_EQUAL_UINT16(last_px, evs_event_x_px(ev));
        TEST_ASSERT_EQUAL_UINT16(last_px, evs_event_y_px(ev));
        TEST_ASSERT_EQUAL_INT(p, evs_event_brighter(ev));
    }
}

static void test_a_row_beyond_15_bits_does_not_turn_into_polarity(void)
{
    const evs_event_t ev = evs_event_make(0u, 0u, 0x8001u, false);
    TEST_ASSERT_FALSE(evs_event_brighter(ev));
    TEST_ASSERT_EQUAL_UINT16(1u, evs_event_y_px(ev));
}

static void test_only_the_marker_is_outside(void)
{
    const evs_point_t least = {-EVS_POINT_MAX_Q4, -EVS_POINT_MAX_Q4};
    const evs_point_t most = {EVS_POINT_MAX_Q4, EVS_POINT_MAX_Q4};
    TEST_ASSERT_TRUE(evs_point_is_outside(evs_point_outside()));
    TEST_ASSERT_FALSE(evs_point_is_outside(least));
    TEST_ASSERT_FALSE(evs_point_is_outside(most));
}

static void test_time_difference_is_right_across_the_wrap(void)
{
    TEST_ASSERT_EQUAL_INT32(250, evs_time_diff_us(150u, UINT32_MAX - 99u));
    TEST_ASSERT_EQUAL_INT32(-250, evs_time_diff_us(UINT32_MAX - 99u, 150u));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, evs_time_diff_us(0x7FFFFFFFu, 0u));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, evs_time_diff_us(0x80000000u, 0u));
}

static void test_a_fault_counter_saturates(void)
{
    uint32_t n = UINT32_MAX - 1u;
    evs_count(&n);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, n);
    evs_count(&n);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, n);
}

static void test_version_string_is_the_three_numbers(void)
{
    TEST_ASSERT_EQUAL_STRING(EVS_TEST_VERSION, EVS_VERSION_STRING); /* As CMake read it from version.h. */
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_every_status_has_its_own_name);
    RUN_TEST(test_a_value_that_is_no_status_is_named_as_such);
    RUN_TEST(test_an_event_gives_back_what_it_was_made_of);
    RUN_TEST(test_a_row_beyond_15_bits_does_not_turn_into_polarity);
    RUN_TEST(test_only_the_marker_is_outside);
    RUN_TEST(test_time_difference_is_right_across_the_wrap);
    RUN_TEST(test_a_fault_counter_saturates);
    RUN_TEST(test_version_string_is_the_three_numbers);
    return UNITY_END();
}
