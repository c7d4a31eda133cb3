/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "decimal.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

static bool parse(const char *text, int decimals, int64_t *value, bool *exact)
{
    const char *p = text;
    return evh_decimal_parse(&p, text + strlen(text), decimals, value, exact) && (*p == '\0');
}

static void test_numbers_become_scaled_integers_exactly(void)
{
    static const struct {
        const char *text;
        int decimals;
        int64_t want;
        bool exact;
    } CASES[] = {
        {"0", 6, 0, true},
        {"2.097134001", 6, 2097134, false},
        {"2.097134", 6, 2097134, true},
        {"0.0000005", 6, 1, false}, /* half away from zero */
        {"-0.0000005", 6, -1, false},
        {"0.0000004999999999999999999999", 6, 0, false},
        {"1403715273262142976", -3, 1403715273262143, false},
        {"1403715273262142976", 0, 1403715273262142976, true},
        {"1403715273.262142976", 6, 1403715273262143, false},
        {"1403715273.26214", 6, 1403715273262140, true},
        {"1.468939802250980000e+09", 6, 1468939802250980, true}, /* numpy.savetxt */
        {"9.223372036854775807e18", 0, INT64_MAX, true},
        {"-9223372036854775807", 0, -INT64_MAX, true},
        {"1e-400000000000", 6, 0, false},
        {"0e999999999999", 6, 0, true},
        {"+12.", 1, 120, true},
        {".5", 0, 1, false},
        {"000000000000000000000000000001", 0, 1, true},
        {"0.000000000000000000000000000000000001e36", 0, 1, true},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        int64_t value = 77;
        bool exact = !CASES[i].exact;
        TEST_ASSERT_TRUE_MESSAGE(parse(CASES[i].text, CASES[i].decimals, &value, &exact), CASES[i].text);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(CASES[i].want, value, CASES[i].text);
        TEST_ASSERT_EQUAL_INT_MESSAGE(CASES[i].exact, exact, CASES[i].text);
    }
}

static void test_what_is_no_number_or_does_not_fit_is_refused(void)
{
    static const char *const CASES[] = {"",           "-",
                                        ".",          "+.",
                                        "nan",        "inf",
                                        "-inf",       "e5",
                                        "x1",         "9223372036854775808",
                                        "1e19",       "99999999999999999999999",
                                        "1e999999999"};
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        int64_t value = 77;
        TEST_ASSERT_FALSE_MESSAGE(parse(CASES[i], 0, &value, NULL), CASES[i]);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(77, value, CASES[i]);
    }
}

static void test_reading_stops_at_the_end_it_is_given(void)
{
    const char *const text = "123456";
    const char *p = text;
    int64_t value = 0;
    TEST_ASSERT_TRUE(evh_decimal_parse(&p, text + 3, 0, &value, NULL));
    TEST_ASSERT_EQUAL_INT64(123, value);
    TEST_ASSERT_EQUAL_PTR(text + 3, p);
}

static void test_a_lonely_exponent_letter_is_not_part_of_the_number(void)
{
    const char *const text = "12e";
    const char *p = text;
    int64_t value = 0;
    TEST_ASSERT_TRUE(evh_decimal_parse(&p, text + 3, 0, &value, NULL));
    TEST_ASSERT_EQUAL_INT64(12, value);
    TEST_ASSERT_EQUAL_PTR(text + 2, p);
}

static void test_format_and_parse_are_inverse(void)
{
    static const int64_t VALUES[] = {0, 1, -1, 999999, -999999, 1000000, 1403715273262143, INT64_MAX, -INT64_MAX};
    for (size_t i = 0; i < sizeof VALUES / sizeof VALUES[0]; i++) {
        for (unsigned decimals = 0; decimals <= 9; decimals++) {
            char text[25];
            int64_t value = 0;
            text[evh_decimal_format(text, VALUES[i], decimals)] = '\0';
            TEST_ASSERT_TRUE_MESSAGE(parse(text, (int)decimals, &value, NULL), text);
            TEST_ASSERT_EQUAL_INT64_MESSAGE(VALUES[i], value, text);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_numbers_become_scaled_integers_exactly);
    RUN_TEST(test_what_is_no_number_or_does_not_fit_is_refused);
    RUN_TEST(test_reading_stops_at_the_end_it_is_given);
    RUN_TEST(test_a_lonely_exponent_letter_is_not_part_of_the_number);
    RUN_TEST(test_format_and_parse_are_inverse);
    return UNITY_END();
}
