/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "jobs.h"
#include "names.h"
#include "unity.h"

enum { N_JOBS = 6 };

static evh_error_t err;
static size_t told[N_JOBS];
static int statuses[N_JOBS];
static size_t n_told;

void setUp(void)
{
    memset(&err, 0, sizeof err);
    n_told = 0u;
}
void tearDown(void) {}

static int run(void *user, size_t job)
{
    (void)user;
    /* The later, the sooner: the order in which they end is not the one in which they are told. */
    const struct timespec pause = {0, (long)(N_JOBS - job) * 3000000};
    (void)nanosleep(&pause, NULL);
    if (job == 4u) { (void)kill(getpid(), SIGKILL); }
    _Exit((int)job % 3);
}

static void done(void *user, size_t job, int status)
{
    TEST_ASSERT_EQUAL_PTR(&told, user);
    told[n_told] = job;
    statuses[n_told] = status;
    n_told++;
}

static void expect_all_told(void)
{
    static const int WANT[N_JOBS] = {0, 1, 2, 0, EVB_JOBS_CRASHED + SIGKILL, 2};
    TEST_ASSERT_EQUAL_UINT((size_t)N_JOBS, n_told);
    for (size_t i = 0; i < N_JOBS; i++) {
        TEST_ASSERT_EQUAL_UINT(i, told[i]);
        TEST_ASSERT_EQUAL_INT(WANT[i], statuses[i]);
    }
}

static void test_jobs_are_told_in_order_and_one_that_crashes_takes_no_other_down(void)
{
    static const unsigned PARALLEL[] = {1u, 2u, N_JOBS, 100u};
    for (size_t i = 0; i < sizeof PARALLEL / sizeof PARALLEL[0]; i++) {
        const evb_jobs_t jobs = {N_JOBS, PARALLEL[i], run, done, &told};
        n_told = 0u;
        TEST_ASSERT_TRUE(evb_jobs_run(&jobs, &err));
        expect_all_told();
    }
}

static void test_no_job_is_no_fault(void)
{
    const evb_jobs_t jobs = {0u, 1u, run, done, &told};
    TEST_ASSERT_TRUE(evb_jobs_run(&jobs, &err));
    TEST_ASSERT_EQUAL_UINT(0u, n_told);
    TEST_ASSERT_TRUE(evb_n_processors() >= 1u);
}

static void test_names_are_short_and_no_two_alike(void)
{
    static const char *const PATHS[] = {"a/shapes/", "b/shapes.txt", "shapes", "shapes_2", "x//y.txt.gz",
                                        "/",         ".gz",          "a b.csv"};
    static const char *const WANT[] = {"shapes", "shapes_2", "shapes_3", "shapes_2_2", "y", "recording", ".gz", "a b"};
    char *name[8];
    TEST_ASSERT_TRUE(evb_names(PATHS, 8u, name));
    for (int i = 0; i < 8; i++) {
        TEST_ASSERT_EQUAL_STRING(WANT[i], name[i]);
        free(name[i]);
    }
}

static void test_a_dot_stands_for_its_folder(void)
{
    static const char *const PATHS[] = {".", "./"};
    char cwd[4096];
    char *name[2];
    TEST_ASSERT_NOT_NULL(getcwd(cwd, sizeof cwd));
    TEST_ASSERT_TRUE(evb_names(PATHS, 2u, name));
    TEST_ASSERT_EQUAL_STRING(strrchr(cwd, '/') + 1, name[0]);
    TEST_ASSERT_TRUE(strncmp(name[1], name[0], strlen(name[0])) == 0);
    free(name[0]);
    free(name[1]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_jobs_are_told_in_order_and_one_that_crashes_takes_no_other_down);
    RUN_TEST(test_no_job_is_no_fault);
    RUN_TEST(test_names_are_short_and_no_two_alike);
    RUN_TEST(test_a_dot_stands_for_its_folder);
    return UNITY_END();
}
