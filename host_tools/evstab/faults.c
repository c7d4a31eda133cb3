/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "faults.h"

#include <inttypes.h>
#include <stdio.h>

#include "error.h"

void evt_note_attitude_faults(const evs_attitude_faults_t *faults)
{
    const struct {
        uint32_t n;
        const char *text;
    } parts[] = {{faults->n_gyro_saturated, "clipped rates"},
                 {faults->n_gyro_spikes, "spikes of the gyro taken back"},
                 {faults->n_gyro_gaps, "gaps between gyro samples"},
                 {faults->n_accel_bad, "accelerations left out"},
                 {faults->n_mag_bad, "fields left out"},
                 {faults->n_time_bad, "times left out"}};
    char text[400] = "";
    size_t at = 0u;
    for (size_t i = 0u; i < sizeof parts / sizeof parts[0]; i++) {
        if (parts[i].n == 0u) { continue; }
        at += (size_t)snprintf(text + at, sizeof text - at, "%s%" PRIu32 " %s", (at > 0u) ? ", " : "", parts[i].n,
                               parts[i].text);
    }
    if (at > 0u) { evh_note("the attitude filter counts %s", text); }
}
