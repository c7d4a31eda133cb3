/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include "progress.h"

#include <stdio.h>
#include <time.h>
#include <unistd.h>

#include "error.h"

#define PERIOD_NS INT64_C(200000000)

int64_t evt_now_ns(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

void evt_progress_start(evt_progress_t *p)
{
    p->enabled = !evh_is_quiet() && (isatty(STDERR_FILENO) == 1);
    p->shown = false;
    p->start_ns = evt_now_ns();
    p->next_ns = p->start_ns + PERIOD_NS;
}

void evt_progress_update(evt_progress_t *p, double fraction, uint64_t n_done, const char *unit)
{
    int64_t now;
    double seconds;
    if (!p->enabled) { return; }
    now = evt_now_ns();
    if (now < p->next_ns) { return; }
    p->next_ns = now + PERIOD_NS;
    p->shown = true;
    seconds = (double)(now - p->start_ns) * 1e-9;
    (void)fprintf(stderr, "\r\033[K%5.1f %%  %.2f M %s/s", 100.0 * fraction, (double)n_done / seconds * 1e-6, unit);
    if (fraction > 0.001) { (void)fprintf(stderr, "  %.0f s left", seconds * (1.0 - fraction) / fraction + 0.5); }
    (void)fflush(stderr);
}

void evt_progress_end(evt_progress_t *p)
{
    if (p->shown) { (void)fprintf(stderr, "\r\033[K"); }
    p->shown = false;
}
