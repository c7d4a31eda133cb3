/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  jobs.h
 * @brief Jobs in processes of their own, so many at a time: one that crashes takes no other down.
 */
#ifndef EVB_JOBS_H
#define EVB_JOBS_H

#include <stddef.h>

#include "error.h"

#define EVB_JOBS_CRASHED 128 /**< Exit status of a job that a signal ended: this plus the signal's number. */

typedef struct {
    size_t n_jobs;
    unsigned n_parallel; /**< At least 1. */
    /** In the job's own process. @return its exit status, 0 .. 127. */
    int (*run)(void *user, size_t job);
    /** In this process, as jobs end, but in the order of the jobs: what is printed reads the same in every run. */
    void (*done)(void *user, size_t job, int status);
    void *user;
} evb_jobs_t;

/** Run them all. @return false when a process could not be started; those that were are waited for. */
bool evb_jobs_run(const evb_jobs_t *jobs, evh_error_t *err);

/** How many processors there are; at least 1. */
unsigned evb_n_processors(void);

#endif
