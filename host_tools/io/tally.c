/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "tally.h"

#include <inttypes.h>
#include <stdio.h>

static const struct {
    const char *text;
    const char *key;
} FAULTS[EVH_FAULT_COUNT] = {
    [EVH_FAULT_NONE] = {"none", "none"},
    [EVH_FAULT_MALFORMED] = {"malformed", "malformed"},
    [EVH_FAULT_NOT_FINITE] = {"with NaN or infinity", "not_finite"},
    [EVH_FAULT_RANGE] = {"with a value out of range", "out_of_range"},
    [EVH_FAULT_OFF_SENSOR] = {"off the sensor", "off_sensor"},
    [EVH_FAULT_TIME_BACK] = {"where time runs back", "time_back"},
    [EVH_FAULT_TIME_JUMP] = {"where time jumps ahead of both neighbours", "time_jump"},
};

void evh_tally_fault(evh_tally_t *tally, evh_fault_t fault, uint64_t line)
{
    if (tally->n_fault[fault]++ == 0u) { tally->first_line[fault] = line; }
}

uint64_t evh_tally_skipped(const evh_tally_t *tally)
{
    uint64_t sum = 0u;
    for (int i = EVH_FAULT_NONE + 1; i < EVH_FAULT_COUNT; i++) { sum += tally->n_fault[i]; }
    return sum;
}

uint64_t evh_tally_first_line(const evh_tally_t *tally)
{
    uint64_t first = 0u;
    for (int i = EVH_FAULT_NONE + 1; i < EVH_FAULT_COUNT; i++) {
        if ((tally->n_fault[i] > 0u) && ((first == 0u) || (tally->first_line[i] < first))) {
            first = tally->first_line[i];
        }
    }
    return first;
}

const char *evh_fault_text(evh_fault_t fault) { return FAULTS[fault].text; }
const char *evh_fault_key(evh_fault_t fault) { return FAULTS[fault].key; }

void evh_tally_text(const evh_tally_t *tally, const char *name, char *out, size_t out_bytes)
{
    const uint64_t skipped = evh_tally_skipped(tally);
    const char *separator = ":";
    size_t at = 0u;
    out[0] = '\0';
    if (skipped == 0u) { return; }
    at = (size_t)snprintf(out, out_bytes, "skipped %" PRIu64 " %s of %s", skipped, (skipped == 1u) ? "line" : "lines",
                          name);
    for (int i = EVH_FAULT_NONE + 1; (i < EVH_FAULT_COUNT) && (at < out_bytes); i++) {
        if (tally->n_fault[i] == 0u) { continue; }
        at += (size_t)snprintf(out + at, out_bytes - at, "%s %" PRIu64 " %s (first: line %" PRIu64 ")", separator,
                               tally->n_fault[i], FAULTS[i].text, tally->first_line[i]);
        separator = ",";
    }
}

void evh_tally_report(const evh_tally_t *tally, const char *name)
{
    char text[1024];
    evh_tally_text(tally, name, text, sizeof text);
    if (text[0] != '\0') { (void)fprintf(stderr, "evstab: %s\n", text); }
}
