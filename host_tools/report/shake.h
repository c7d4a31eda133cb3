/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  shake.h
 * @brief How fast the camera turned lately, by milliseconds, so that a span of events can be asked for its rate when it
 * ends: orientations run ahead of the events.
 */
#ifndef EVR_SHAKE_H
#define EVR_SHAKE_H

#include <stdint.h>

#define EVR_SHAKE_MS 4096 /**< How far back the memory reaches. */

typedef struct {
    double rate_rad_s;  /**< Mean angular rate. */
    double motion_px_s; /**< Mean motion of the image centre through rotation. */
    double rate_max_rad_s, motion_max_px_s;
    uint32_t n; /**< Samples; 0: nothing known. */
} evr_shake_mean_t;

typedef struct {
    int64_t ms;
    double rate_sum, motion_sum, rate_max, motion_max;
    uint32_t n;
} evr_shake_cell_t;

typedef struct {
    evr_shake_cell_t cell[EVR_SHAKE_MS];
} evr_shake_t;

void evr_shake_clear(evr_shake_t *s);
void evr_shake_put(evr_shake_t *s, int64_t t_us, double rate_rad_s, double motion_px_s);

/** Over [from, to], by whole milliseconds. */
evr_shake_mean_t evr_shake_between(const evr_shake_t *s, int64_t from_us, int64_t to_us);

#endif
