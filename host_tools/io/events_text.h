/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  events_text.h
 * @brief Event text of the Event Camera Dataset: one "t x y p" a line, t in seconds, plain or gzip.
 *
 * Mueggler et al., "The Event-Camera Dataset and Simulator", IJRR 36(2), 2017. doi:10.1177/0278364917691115
 * Columns are parted by blanks, tabs or commas; p is 0, 1, -1; '#' starts a comment line. Times are read exactly and
 * rounded to the nearest microsecond. Memory: one block. Speed: see tests/bench/bench_host_io.c.
 */
#ifndef EVH_EVENTS_TEXT_H
#define EVH_EVENTS_TEXT_H

#include "event_source.h"

/** @return NULL on error. An event with x >= width_px or y >= height_px counts as off the sensor. */
evh_event_source_t *evh_events_text_open(const char *path, uint16_t width_px, uint16_t height_px, evh_error_t *err);

#endif
