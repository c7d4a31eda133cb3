/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  event_source.h
 * @brief What every event reader looks like to the commands: blocks of events in the order of time.
 *
 * The device format has a 32-bit microsecond clock; the host keeps the whole 64-bit time beside it. A reader hands out
 * only events on the sensor whose time does not run back; all others are in the tally.
 */
#ifndef EVH_EVENT_SOURCE_H
#define EVH_EVENT_SOURCE_H

#include <sys/types.h>

#include "error.h"
#include "evs/types.h"
#include "tally.h"

/** One record this far ahead of the one before it is believed only if the next one is no earlier. */
#define EVH_TIME_JUMP_US 1000000

/** 1000 years either way: differences of two times cannot overflow. */
#define EVH_TIME_MAX_US INT64_C(31557600000000000)

typedef struct evh_event_source evh_event_source_t;

struct evh_event_source {
    /** Up to @p cap events and their host times. @return the count, 0 at the end, -1 on an error that ends the file. */
    ssize_t (*read)(evh_event_source_t *self, evs_event_t *ev, int64_t *t_us, size_t cap, evh_error_t *err);
    double (*fraction)(const evh_event_source_t *self); /**< Share of the file done, 0..1. */
    void (*close)(evh_event_source_t *self);            /**< Frees the source too. */
    const char *format;                                 /**< For people: "text (t x y p)". */
    char *path;
    uint16_t width_px;
    uint16_t height_px;
    evh_tally_t tally;
};

#endif
