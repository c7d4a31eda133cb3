/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "csv_writer.h"
#include "temp_file.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) { temp_file_remove(); }

static void test_integers_and_times_print_exactly(void)
{
    static const int64_t VALUES[] = {0,         1,        -1, 9, 10, 999999, 1000000, -1000001, 1403715273262143,
                                     INT64_MAX, INT64_MIN};
    char want[64];
    char have[64];
    for (size_t i = 0; i < sizeof VALUES / sizeof VALUES[0]; i++) {
        *evh_put_int(have, VALUES[i]) = '\0';
        (void)snprintf(want, sizeof want, "%" PRId64, VALUES[i]);
        TEST_ASSERT_EQUAL_STRING(want, have);
    }
    *evh_put_time_us(have, 1403715273262143) = '\0';
    TEST_ASSERT_EQUAL_STRING("1403715273.262143", have);
    *evh_put_time_us(have, -1) = '\0';
    TEST_ASSERT_EQUAL_STRING("-0.000001", have);
}

static void test_sixteenths_print_exactly_for_every_value(void)
{
    char want[64];
    char have[64];
    for (int v = INT16_MIN; v <= INT16_MAX; v++) {
        *evh_put_q4(have, (int16_t)v) = '\0';
        (void)snprintf(want, sizeof want, "%.4f", (double)v / 16.0);
        if (v == 0) { (void)snprintf(want, sizeof want, "0.0000"); }
        TEST_ASSERT_EQUAL_STRING(want, have);
    }
}

static void test_fixed_point_rounds_to_the_nearest_decimal(void)
{
    static const int32_t VALUES[] = {0, 1, -1, 1 << 30, -(1 << 30), INT32_MAX, INT32_MIN, 759250125, -379625062};
    char have[64];
    for (size_t i = 0; i < sizeof VALUES / sizeof VALUES[0]; i++) {
        *evh_put_q(have, VALUES[i], 30, 9) = '\0';
        TEST_ASSERT_DOUBLE_WITHIN(0.5000001e-9, (double)VALUES[i] / 1073741824.0, strtod(have, NULL));
        *evh_put_q(have, VALUES[i], 24, 6) = '\0';
        TEST_ASSERT_DOUBLE_WITHIN(0.5000001e-6, (double)VALUES[i] / 16777216.0, strtod(have, NULL));
    }
}

static void test_a_file_that_cannot_be_made_and_a_full_disk_are_errors(void)
{
    evh_csv_t csv;
    evh_error_t err = {""};
    FILE *full;
    TEST_ASSERT_FALSE(evh_csv_open(&csv, "/nonexistent", "a.csv", "#a", &err));
    TEST_ASSERT_EQUAL_STRING("/nonexistent/a.csv: cannot write: No such file or directory", err.text);
    full = fopen("/dev/full", "wb");
    if (full == NULL) { TEST_IGNORE_MESSAGE("no /dev/full here"); }
    (void)fclose(full);
    err.text[0] = '\0';
    TEST_ASSERT_TRUE(evh_csv_open_path(&csv, "/dev/full", "#a", &err));
    for (int i = 0; i < 100000; i++) { evh_csv_advance(&csv, evh_put_text(evh_csv_reserve(&csv, 8), "1,2,3,4\n")); }
    TEST_ASSERT_FALSE(evh_csv_close(&csv, &err));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(err.text, "No space left"), err.text);
}

static void test_rows_arrive_whole_across_block_ends(void)
{
    const char *const path = temp_text("");
    evh_csv_t csv;
    evh_error_t err = {""};
    FILE *file;
    char line[64];
    int n = 0;
    TEST_ASSERT_TRUE(evh_csv_open_path(&csv, path, "#i,j", &err));
    for (int i = 0; i < 100000; i++) {
        char *p = evh_csv_reserve(&csv, 64);
        p = evh_put_int(p, i);
        *p++ = ',';
        p = evh_put_int(p, -i);
        *p++ = '\n';
        evh_csv_advance(&csv, p);
    }
    TEST_ASSERT_TRUE(evh_csv_close(&csv, &err));
    file = fopen(path, "rb");
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_NOT_NULL(fgets(line, sizeof line, file));
    TEST_ASSERT_EQUAL_STRING("#i,j\n", line);
    while (fgets(line, sizeof line, file) != NULL) {
        char want[64];
        (void)snprintf(want, sizeof want, "%d,%d\n", n, -n);
        TEST_ASSERT_EQUAL_STRING(want, line);
        n++;
    }
    TEST_ASSERT_EQUAL_INT(100000, n);
    (void)fclose(file);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_integers_and_times_print_exactly);
    RUN_TEST(test_sixteenths_print_exactly_for_every_value);
    RUN_TEST(test_fixed_point_rounds_to_the_nearest_decimal);
    RUN_TEST(test_a_file_that_cannot_be_made_and_a_full_disk_are_errors);
    RUN_TEST(test_rows_arrive_whole_across_block_ends);
    return UNITY_END();
}
