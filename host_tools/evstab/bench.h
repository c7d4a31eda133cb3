/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  bench.h
 * @brief evstab bench, in three parts: events, the steps that are timed, and the computer that they ran on.
 */
#ifndef EVT_BENCH_H
#define EVT_BENCH_H

#include <stddef.h>
#include <stdint.h>

#include "error.h"

typedef enum {
    EVT_BENCH_MEMCPY = 0, /**< Copying the events: what any pass over them costs at least. */
    EVT_BENCH_UNDISTORT,  /**< Table lookup of position and tile. */
    EVT_BENCH_WINDOW,     /**< Area count. */
    EVT_BENCH_ROTATE,     /**< Rotation to the reference, a new orientation every ms. */
    EVT_BENCH_PIPELINE,   /**< All of it, as firmware would call it: events in, chunks out. */
    EVT_BENCH_STEPS
} evt_bench_step_t;

typedef struct {
    uint16_t width_px, height_px;
    size_t n_events;
    unsigned n_rounds;
} evt_bench_t;

typedef struct {
    double median_ns[EVT_BENCH_STEPS]; /**< Per event. */
    double least_ns[EVT_BENCH_STEPS];
    uint64_t n_windows; /**< In one pass of the pipeline. */
    uint64_t n_kept;    /**< Events that got a stabilized position there. */
} evt_bench_result_t;

/** All steps in turn, n_rounds times: what slows the computer down for a while slows all of them down. */
bool evt_bench_run(const evt_bench_t *b, evt_bench_result_t *result, evh_error_t *err);

/** Name of the processor, "unknown" where the system does not tell. */
void evt_cpu_name(char *name, size_t bytes);

/** How the program was built: commit of the source ("unknown" outside of git), compiler. */
const char *evt_build_commit(void);
const char *evt_build_compiler(void);

/** What makes timings of this build worthless, or NULL: no optimization, sanitizers. */
const char *evt_build_flaw(void);

#endif
