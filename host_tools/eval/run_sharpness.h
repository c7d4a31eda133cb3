/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  run_sharpness.h
 * @brief The sharpness of a run's pictures with and without stabilization, from its events.csv and windows.csv.
 *
 * Two kinds of pictures: one per window, and one per 0.1 s (cut short by a saccade, for then the reference moves). A
 * window is often so short that there is little to stabilize in it; over 0.1 s there is.
 */
#ifndef EVL_RUN_SHARPNESS_H
#define EVL_RUN_SHARPNESS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "error.h"

#define EVL_PICTURE_US 100000 /**< Longest picture of the second kind. */

typedef struct {
    uint32_t window; /**< Its index, or that of its first event. */
    int64_t t_first_us;
    uint64_t n_events;   /**< With a position. */
    double unstabilized; /**< Undistorted positions. */
    double stabilized;
} evl_picture_t;

typedef struct {
    evl_picture_t *at;
    size_t n;
    size_t cap;
} evl_pictures_t;

typedef struct {
    evl_pictures_t per_window;
    evl_pictures_t per_100ms;
    uint64_t n_events;
} evl_run_sharpness_t;

/** Called now and then with the share of events.csv that is done; for whoever waits. */
typedef struct {
    void (*tell)(void *user, double fraction, uint64_t n_events);
    void *user;
} evl_waiting_t;

/** What a list of pictures says. */
typedef struct {
    size_t n;
    double unstabilized; /**< Means. */
    double stabilized;
    double gain; /**< Of the means. */
    double gain_median;
} evl_gain_t;

/**
 * @param events_path, windows_path  Of the run. Events in [from, to).
 * @param waiting  May be NULL.
 * An event without a stabilized position counts in neither picture, so that both hold the same events.
 */
bool evl_run_sharpness(evl_run_sharpness_t *s, const char *events_path, const char *windows_path, uint16_t width_px,
                       uint16_t height_px, int64_t from_us, int64_t to_us, const evl_waiting_t *waiting,
                       evh_error_t *err);
void evl_run_sharpness_free(evl_run_sharpness_t *s);

/** @return false when memory is short. Pictures whose unstabilized sharpness is 0 have no gain and do not count. */
bool evl_gain(const evl_pictures_t *pictures, evl_gain_t *gain);

#endif
