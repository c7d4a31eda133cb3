/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "events_text.h"
#include "temp_file.h"
#include "unity.h"

enum { W = 240, H = 180, CAP = 4096, ROOM = 2 * CAP }; /* A last read of a whole block finds the end. */

static evs_event_t ev[ROOM];
static int64_t t_us[ROOM];
static size_t n_read;
static evh_tally_t tally;
static evh_error_t err;

void setUp(void)
{
    n_read = 0;
    memset(&tally, 0, sizeof tally);
    memset(&err, 0, sizeof err);
}

void tearDown(void) { temp_file_remove(); }

/* Read all of a file in blocks of `block` events. @return what the last read() returned. */
static ssize_t read_path(const char *path, size_t block)
{
    evh_event_source_t *const source = evh_events_text_open(path, W, H, &err);
    ssize_t got = -2;
    n_read = 0;
    if (source == NULL) { return -2; }
    while ((n_read + block <= ROOM) && ((got = source->read(source, ev + n_read, t_us + n_read, block, &err)) > 0)) {
        n_read += (size_t)got;
    }
    tally = source->tally;
    source->close(source);
    return got;
}

static void expect_event(size_t i, int64_t want_us, unsigned x, unsigned y, bool brighter)
{
    TEST_ASSERT_TRUE(i < n_read);
    TEST_ASSERT_EQUAL_INT64(want_us, t_us[i]);
    TEST_ASSERT_EQUAL_UINT32((uint32_t)(uint64_t)want_us, ev[i].t_us);
    TEST_ASSERT_EQUAL_UINT16(x, evs_event_x_px(ev[i]));
    TEST_ASSERT_EQUAL_UINT16(y, evs_event_y_px(ev[i]));
    TEST_ASSERT_EQUAL_INT(brighter, evs_event_brighter(ev[i]));
}

static void test_every_spelling_of_an_event_is_read(void)
{
    TEST_ASSERT_EQUAL_INT(0, read_path(temp_text("# comment\n"
                                                 "2.097134001 162 27 0\n"
                                                 "2.097134500 1 2 1\r\n"
                                                 "2.0971346\t3\t4\t-1\n"
                                                 "\n"
                                                 "2.0972,5,6,+1\n"
                                                 "  2.0973  7   8  1  \n"
                                                 "2.09740000e+00 9.000e+00 1.0e+01 1.0\n"
                                                 "2.0975 239 179 1"),
                                       CAP));
    TEST_ASSERT_EQUAL_UINT(7, n_read);
    TEST_ASSERT_EQUAL_UINT64(0, evh_tally_skipped(&tally));
    TEST_ASSERT_EQUAL_UINT64(7, tally.n_good);
    expect_event(0, 2097134, 162, 27, false);
    expect_event(1, 2097135, 1, 2, true);
    expect_event(2, 2097135, 3, 4, false);
    expect_event(3, 2097200, 5, 6, true);
    expect_event(4, 2097300, 7, 8, true);
    expect_event(5, 2097400, 9, 10, true);
    expect_event(6, 2097500, 239, 179, true);
}

static void test_each_fault_is_counted_by_cause_with_its_first_line(void)
{
    char text[1024];
    TEST_ASSERT_EQUAL_INT(0, read_path(temp_text("1.0 1 1 1\n"
                                                 "1.1 2 2\n"            /* 2: malformed */
                                                 "1.1 2 2 1 5\n"        /* 3: malformed */
                                                 "1.2 240 2 1\n"        /* 4: off the sensor */
                                                 "1.2 2 180 1\n"        /* 5: off */
                                                 "1.2 -1 2 1\n"         /* 6: off */
                                                 "1.2 1000000000 2 1\n" /* 7: off */
                                                 "nan 2 2 1\n"          /* 8: not finite */
                                                 "1.3 2 2 1\n"
                                                 "1.29 2 2 1\n"         /* 10: back */
                                                 "1000000000.0 2 2 1\n" /* 11: jump */
                                                 "1.4 2 2 1\n"
                                                 "1.5 2 2 2\n"           /* 13: malformed: p */
                                                 "99999999999.0 1 1 1\n" /* 14: out of range */
                                                 "1.6 2.5 2 1\n"         /* 15: malformed */
                                                 "1.7 3 3 0\n"),
                                       CAP));
    TEST_ASSERT_EQUAL_UINT(4, n_read);
    expect_event(3, 1700000, 3, 3, false);
    TEST_ASSERT_EQUAL_UINT64(4, tally.n_fault[EVH_FAULT_MALFORMED]);
    TEST_ASSERT_EQUAL_UINT64(2, tally.first_line[EVH_FAULT_MALFORMED]);
    TEST_ASSERT_EQUAL_UINT64(4, tally.n_fault[EVH_FAULT_OFF_SENSOR]);
    TEST_ASSERT_EQUAL_UINT64(4, tally.first_line[EVH_FAULT_OFF_SENSOR]);
    TEST_ASSERT_EQUAL_UINT64(1, tally.n_fault[EVH_FAULT_NOT_FINITE]);
    TEST_ASSERT_EQUAL_UINT64(8, tally.first_line[EVH_FAULT_NOT_FINITE]);
    TEST_ASSERT_EQUAL_UINT64(1, tally.n_fault[EVH_FAULT_TIME_BACK]);
    TEST_ASSERT_EQUAL_UINT64(10, tally.first_line[EVH_FAULT_TIME_BACK]);
    TEST_ASSERT_EQUAL_UINT64(1, tally.n_fault[EVH_FAULT_TIME_JUMP]);
    TEST_ASSERT_EQUAL_UINT64(11, tally.first_line[EVH_FAULT_TIME_JUMP]);
    TEST_ASSERT_EQUAL_UINT64(1, tally.n_fault[EVH_FAULT_RANGE]);
    evh_tally_text(&tally, "events.txt", text, sizeof text);
    TEST_ASSERT_EQUAL_STRING(
        "skipped 12 lines of events.txt: 4 malformed (first: line 2), 1 with NaN or infinity (first: line 8), "
        "1 with a value out of range (first: line 14), 4 off the sensor (first: line 4), "
        "1 where time runs back (first: line 10), 1 where time jumps ahead of both neighbours (first: line 11)",
        text);
}

static void test_a_pause_is_believed_when_the_next_event_agrees(void)
{
    TEST_ASSERT_EQUAL_INT(0, read_path(temp_text("1.0 1 1 1\n1.1 1 1 1\n61.0 2 2 1\n61.1 2 2 1\n"), CAP));
    TEST_ASSERT_EQUAL_UINT(4, n_read);
    expect_event(2, 61000000, 2, 2, true);
}

static void test_a_wild_first_or_last_time_does_not_drop_the_others(void)
{
    TEST_ASSERT_EQUAL_INT(0, read_path(temp_text("1000000000.0 1 1 1\n1.0 1 1 1\n1.1 2 2 1\n1000000000 3 3 1\n"), CAP));
    TEST_ASSERT_EQUAL_UINT(2, n_read);
    TEST_ASSERT_EQUAL_UINT64(2, tally.n_fault[EVH_FAULT_TIME_JUMP]);
    expect_event(0, 1000000, 1, 1, true);
}

static void test_one_event_is_a_recording(void)
{
    TEST_ASSERT_EQUAL_INT(0, read_path(temp_text("1468939802.250980 1 1 1"), CAP));
    TEST_ASSERT_EQUAL_UINT(1, n_read);
    expect_event(0, 1468939802250980, 1, 1, true);
}

static void test_an_empty_file_has_no_events_and_no_error(void)
{
    TEST_ASSERT_EQUAL_INT(0, read_path(temp_text(""), CAP));
    TEST_ASSERT_EQUAL_UINT(0, n_read);
    TEST_ASSERT_EQUAL_STRING("", err.text);
}

static void test_binary_garbage_is_refused_as_another_kind_of_file(void)
{
    static unsigned char garbage[1 << 20];
    uint32_t x = 12345;
    for (size_t i = 0; i < sizeof garbage; i++) {
        x = x * 1664525u + 1013904223u;
        garbage[i] = (unsigned char)(x >> 24);
    }
    TEST_ASSERT_EQUAL_INT(-1, read_path(temp_file(garbage, sizeof garbage), CAP));
    TEST_ASSERT_NOT_NULL(strstr(err.text, "is this the right file"));
}

static void test_a_megabyte_without_line_end_is_one_bad_line(void)
{
    static char blob[1 << 20];
    memset(blob, '7', sizeof blob);
    memcpy(blob, "1.0 1 1 1\n", 10);
    memcpy(blob + sizeof blob - 22, "\n1.1 1 1 1\n1.2 2 2 1\n", 21);
    TEST_ASSERT_EQUAL_INT(0, read_path(temp_file(blob, sizeof blob - 1), CAP));
    TEST_ASSERT_EQUAL_UINT(3, n_read);
    TEST_ASSERT_EQUAL_UINT64(1, evh_tally_skipped(&tally));
    TEST_ASSERT_EQUAL_UINT64(2, tally.first_line[EVH_FAULT_MALFORMED]);
}

static void test_gzip_is_read_and_its_truncation_reported(void)
{
    static char text[40000];
    size_t n = 0;
    for (int i = 0; i < 1000; i++) {
        n += (size_t)sprintf(text + n, "%d.%06d %d %d %d\n", 1, i * 731 % 999 + i * 900, i % 240, i % 180, i & 1);
    }
    TEST_ASSERT_EQUAL_INT(0, read_path(temp_gz(text, 0), 100));
    TEST_ASSERT_EQUAL_UINT64(1000, tally.n_good + evh_tally_skipped(&tally));
    TEST_ASSERT_EQUAL_INT(-1, read_path(temp_gz(text, 1000), 100));
    TEST_ASSERT_NOT_NULL(strstr(err.text, "truncated"));
    TEST_ASSERT_TRUE(n_read > 0);
}

static void test_missing_files_and_folders_are_named(void)
{
    TEST_ASSERT_EQUAL_INT(-2, read_path("/nonexistent/events.txt", CAP));
    TEST_ASSERT_EQUAL_STRING("/nonexistent/events.txt: No such file or directory; check the path", err.text);
    memset(&err, 0, sizeof err);
    TEST_ASSERT_EQUAL_INT(-2, read_path("/", CAP));
    TEST_ASSERT_EQUAL_STRING("/: is a folder, but a file is needed here", err.text);
}

/* The fast path takes canonical lines, the careful one everything else: the same file written for either must read the
 * same, whatever the block size, the place of block ends, and the digits after the microsecond. */
static void test_the_fast_path_reads_what_the_careful_path_reads(void)
{
    static char fast[200000];
    static char careful[220000];
    static evs_event_t want[ROOM];
    static int64_t want_us[ROOM];
    uint32_t rng = 1;
    size_t n_fast = 0;
    size_t n_careful = 0;
    int64_t t_ns = 1403715273000000000;
    size_t n_want;
    for (int i = 0; i < 3000; i++) {
        unsigned x;
        unsigned y;
        rng = rng * 1664525u + 1013904223u;
        t_ns += (int64_t)(rng >> 12);
        x = (rng >> 3) % 245u; /* some off the sensor */
        y = (rng >> 13) % 182u;
        if (rng % 97u == 0u) { t_ns -= 900000; } /* some back in time */
        n_fast += (size_t)sprintf(fast + n_fast, "%" PRId64 ".%09" PRId64 " %u %u %u\n", t_ns / 1000000000,
                                  t_ns % 1000000000, x, y, rng >> 31);
        n_careful += (size_t)sprintf(careful + n_careful, " %" PRId64 ".%09" PRId64 "  %u,%u\t%u\n", t_ns / 1000000000,
                                     t_ns % 1000000000, x, y, rng >> 31);
    }
    TEST_ASSERT_EQUAL_INT(0, read_path(temp_file(careful, n_careful), CAP));
    n_want = n_read;
    memcpy(want, ev, sizeof ev);
    memcpy(want_us, t_us, sizeof t_us);
    TEST_ASSERT_TRUE(n_want > 2500);
    for (size_t block = 2; block <= 700; block = block * 3 + 1) {
        TEST_ASSERT_EQUAL_INT(0, read_path(temp_file(fast, n_fast), block));
        TEST_ASSERT_EQUAL_UINT(n_want, n_read);
        TEST_ASSERT_EQUAL_MEMORY(want, ev, n_want * sizeof ev[0]);
        TEST_ASSERT_EQUAL_MEMORY(want_us, t_us, n_want * sizeof t_us[0]);
        TEST_ASSERT_EQUAL_UINT64(3000, tally.n_good + evh_tally_skipped(&tally));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_every_spelling_of_an_event_is_read);
    RUN_TEST(test_each_fault_is_counted_by_cause_with_its_first_line);
    RUN_TEST(test_a_pause_is_believed_when_the_next_event_agrees);
    RUN_TEST(test_a_wild_first_or_last_time_does_not_drop_the_others);
    RUN_TEST(test_one_event_is_a_recording);
    RUN_TEST(test_an_empty_file_has_no_events_and_no_error);
    RUN_TEST(test_binary_garbage_is_refused_as_another_kind_of_file);
    RUN_TEST(test_a_megabyte_without_line_end_is_one_bad_line);
    RUN_TEST(test_gzip_is_read_and_its_truncation_reported);
    RUN_TEST(test_missing_files_and_folders_are_named);
    RUN_TEST(test_the_fast_path_reads_what_the_careful_path_reads);
    return UNITY_END();
}
