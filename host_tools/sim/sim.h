/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  sim.h
 * @brief The event-camera simulator: one call from settings to a recording on disk.
 */
#ifndef EVSIM_SIM_H
#define EVSIM_SIM_H

#include "settings.h"

typedef struct {
    uint64_t n_events;
    uint64_t n_on;
    uint64_t n_frames;
    uint64_t n_renders;
    double speed_max_px_s;  /**< Fastest motion in the image. */
    double rate_mean_rad_s; /**< Of the camera's rotation. */
    double rate_max_rad_s;
    double velocity_mean_m_s;
    unsigned jobs; /**< Threads that did it. */
} evsim_result_t;

/** Called now and then from the caller's thread; may be NULL. */
typedef void (*evsim_progress_t)(void *context, double fraction, uint64_t n_events);

/**
 * Simulate @p settings into the folder @p dir, which is made if it is not there.
 * @return false with the cause in @p err.
 */
bool evsim_run(const evsim_settings_t *settings, const char *dir, evsim_progress_t progress, void *context,
               evsim_result_t *result, evh_error_t *err);

#endif
