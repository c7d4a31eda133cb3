/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/clock.h
 * @brief Guards a stream against times that run back, without being fooled for ever by one bad time.
 *
 * Model    A time before the newest accepted one is refused. One wild time ahead would so silence the stream until the
 *          clock caught up with it: when EVS_CLOCK_RESTART_AFTER refused times follow each other, each not before
 *          the one before it, the stream itself is taken to have restarted (sensor reset, or the wild time undone).
 * Memory   one evs_clock_t.
 * Cost     about 10 instructions per time.
 * Time     wraps; times must lie less than 2^31 us (35 min) apart.
 */
#ifndef EVS_CLOCK_H
#define EVS_CLOCK_H

#include "evs/types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_CLOCK_RESTART_AFTER 16u

typedef enum {
    EVS_CLOCK_FORWARD, /**< Accepted. */
    EVS_CLOCK_BACK,    /**< Refused: before the newest (or equal, where equal times are refused). */
    EVS_CLOCK_RESTART  /**< Accepted as the first time of a restarted clock: forget what depends on older times. */
} evs_clock_verdict_t;

typedef struct { /** Context; zero-initialize it. Every member is private. */
    uint32_t newest_us;
    uint32_t refused_us;
    uint32_t n_back;
    uint16_t n_refused_run;
    bool started;
} evs_clock_t;

/** What is left to judge of a time that is not ahead; part of evs_clock_step(). */
evs_clock_verdict_t evs_clock_refuse(evs_clock_t *clock, uint32_t t_us);

/** Take a time as the newest without judging it: for a loop that has compared each with the one before itself. */
static inline void evs_clock_accept(evs_clock_t *clock, uint32_t t_us)
{
    clock->started = true;
    clock->newest_us = t_us;
    clock->n_refused_run = 0u;
}

/** Judge the next time of a stream. @param equal_ok  Whether a time equal to the newest is accepted. */
static inline evs_clock_verdict_t evs_clock_step(evs_clock_t *clock, uint32_t t_us, bool equal_ok)
{
    const int32_t ahead_us = evs_time_diff_us(t_us, clock->newest_us);
    if ((ahead_us > 0) || (equal_ok && (ahead_us == 0)) || !clock->started) {
        evs_clock_accept(clock, t_us);
        return EVS_CLOCK_FORWARD;
    }
    return evs_clock_refuse(clock, t_us);
}

#ifdef __cplusplus
}
#endif
#endif
