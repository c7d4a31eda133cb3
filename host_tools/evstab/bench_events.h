/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  bench_events.h
 * @brief Events as a camera sees them: clustered on edges that move, in the order of time. The same for the same size.
 *
 * It matters: tables are looked up where events are, and tiles fill where edges are. Events spread evenly over the
 * sensor would miss the cache more often, a single cluster never.
 */
#ifndef EVT_BENCH_EVENTS_H
#define EVT_BENCH_EVENTS_H

#include <stddef.h>

#include "evs/types.h"

#define EVT_BENCH_EDGES     24u
#define EVT_BENCH_EVENTS_HZ 4000000u /**< 4 million events a second: a busy scene. */

void evt_bench_events(evs_event_t *ev, size_t n, uint16_t width_px, uint16_t height_px);

#endif
