/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/clock.h"

evs_clock_verdict_t evs_clock_refuse(evs_clock_t *clock, uint32_t t_us)
{
    const bool in_order = (clock->n_refused_run > 0u) && (evs_time_diff_us(t_us, clock->refused_us) >= 0);
    clock->n_refused_run = in_order ? (uint16_t)(clock->n_refused_run + 1u) : 1u;
    clock->refused_us = t_us;
    if (clock->n_refused_run > EVS_CLOCK_RESTART_AFTER) {
        clock->newest_us = t_us;
        clock->n_refused_run = 0u;
        return EVS_CLOCK_RESTART;
    }
    evs_count(&clock->n_back);
    return EVS_CLOCK_BACK;
}
