/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include "jobs.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#define PENDING (-1)

typedef struct {
    pid_t pid;
    int status; /* PENDING until it has ended. */
} job_t;

unsigned evb_n_processors(void)
{
    const long n = sysconf(_SC_NPROCESSORS_ONLN);
    return (n < 1) ? 1u : (n > 1024) ? 1024u : (unsigned)n;
}

/* Forking alone does: the child is this very program, and where its file lies cannot be told on every system. */
static bool start(const evb_jobs_t *jobs, size_t i, job_t *job)
{
    (void)fflush(NULL); /* What is still in a buffer would be printed twice. */
    job->pid = fork();
    if (job->pid == 0) { exit(jobs->run(jobs->user, i)); }
    return job->pid > 0;
}

static int exit_status(int wait_status)
{
    if (WIFEXITED(wait_status)) { return WEXITSTATUS(wait_status); }
    return EVB_JOBS_CRASHED + (WIFSIGNALED(wait_status) ? WTERMSIG(wait_status) : 0);
}

/* Wait until one of the jobs [0, n) has ended. */
static bool wait_for_one(job_t *job, size_t n, evh_error_t *err)
{
    for (;;) {
        int wait_status = 0;
        const pid_t pid = waitpid(-1, &wait_status, 0);
        if (pid < 0) {
            if (errno == EINTR) { continue; }
            return evh_fail(err, "cannot wait for a job: %s", strerror(errno));
        }
        for (size_t i = 0u; i < n; i++) {
            if ((job[i].status == PENDING) && (job[i].pid == pid)) {
                job[i].status = exit_status(wait_status);
                return true;
            }
        }
    }
}

static bool run_all(const evb_jobs_t *jobs, job_t *job, evh_error_t *err)
{
    size_t n_started = 0u;
    size_t n_running = 0u;
    size_t n_told = 0u;
    bool ok = true;
    while ((n_running > 0u) || (ok && (n_started < jobs->n_jobs))) {
        if (ok && (n_started < jobs->n_jobs) && (n_running < jobs->n_parallel)) {
            if (start(jobs, n_started, &job[n_started])) {
                n_started++;
                n_running++;
                continue;
            }
            /* Out of processes for now? One that ends makes room. */
            if (n_running == 0u) { ok = evh_fail(err, "cannot start a process: %s", strerror(errno)); }
        }
        if (n_running > 0u) {
            if (!wait_for_one(job, n_started, err)) { return false; }
            n_running--;
        }
        while ((n_told < n_started) && (job[n_told].status != PENDING)) {
            jobs->done(jobs->user, n_told, job[n_told].status);
            n_told++;
        }
    }
    return ok;
}

bool evb_jobs_run(const evb_jobs_t *jobs, evh_error_t *err)
{
    job_t *const job = malloc((jobs->n_jobs + 1u) * sizeof *job);
    bool ok;
    if (job == NULL) { return evh_fail(err, "out of memory"); }
    for (size_t i = 0u; i < jobs->n_jobs; i++) { job[i].status = PENDING; }
    ok = run_all(jobs, job, err);
    free(job);
    return ok;
}
