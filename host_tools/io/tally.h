/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  tally.h
 * @brief Counts of what a reader skipped, by cause, with the line of the first of each: nothing is dropped silently.
 */
#ifndef EVH_TALLY_H
#define EVH_TALLY_H

#include <stddef.h>
#include <stdint.h>

typedef enum {
    EVH_FAULT_NONE = 0,
    EVH_FAULT_MALFORMED,  /**< Not the columns that the format has. */
    EVH_FAULT_NOT_FINITE, /**< NaN or infinite. */
    EVH_FAULT_RANGE,      /**< A number that no sensor delivers, e.g. 1e9 rad/s. */
    EVH_FAULT_OFF_SENSOR, /**< A pixel outside the sensor. */
    EVH_FAULT_TIME_BACK,  /**< Earlier than the record before it (or, for samples, not later). */
    EVH_FAULT_TIME_JUMP,  /**< One record far ahead of both its neighbours. */
    EVH_FAULT_COUNT
} evh_fault_t;

typedef struct {
    uint64_t n_good;
    uint64_t n_fault[EVH_FAULT_COUNT];
    uint64_t first_line[EVH_FAULT_COUNT];
} evh_tally_t;

void evh_tally_fault(evh_tally_t *tally, evh_fault_t fault, uint64_t line);
uint64_t evh_tally_skipped(const evh_tally_t *tally);

/** The line of the first fault of any cause; 0 when there is none. */
uint64_t evh_tally_first_line(const evh_tally_t *tally);

/** Words for a message ("malformed") and for a JSON key ("malformed"). */
const char *evh_fault_text(evh_fault_t fault);
const char *evh_fault_key(evh_fault_t fault);

/** "skipped 3 lines of NAME: 2 malformed (first: line 7), 1 off the sensor (first: line 9)". Empty when none. */
void evh_tally_text(const evh_tally_t *tally, const char *name, char *out, size_t out_bytes);

/** Print that line to stderr, if there is anything to report. Not muted by --quiet: it is about the user's data. */
void evh_tally_report(const evh_tally_t *tally, const char *name);

#endif
