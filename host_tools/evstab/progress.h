/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  progress.h
 * @brief One line on a terminal that says how far, how fast and how long still. Nothing when piped or with --quiet.
 */
#ifndef EVT_PROGRESS_H
#define EVT_PROGRESS_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    bool shown;
    bool enabled;
    int64_t start_ns;
    int64_t next_ns;
} evt_progress_t;

/** Nanoseconds of a clock that never runs back. */
int64_t evt_now_ns(void);

void evt_progress_start(evt_progress_t *p);
void evt_progress_update(evt_progress_t *p, double fraction, uint64_t n_done, const char *unit);

/** Remove the line, so that what follows starts on a clean one. */
void evt_progress_end(evt_progress_t *p);

#endif
