/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  replay.h
 * @brief Plays a recording through the public API and condenses what comes out into a CRC per stage.
 *
 * The same source runs on the host and on the emulated targets: equal CRCs mean equal bits.
 */
#ifndef EVS_TESTS_REPLAY_H
#define EVS_TESTS_REPLAY_H

#include "recording.h"
#include "replay_images.h"

typedef struct {
    uint32_t n_events;
    uint32_t n_windows;
    uint32_t n_saccades;
    uint32_t n_outside; /**< Events whose stabilized point is outside. */
    uint32_t attitude;  /**< CRC-32 of the newest orientation after each IMU sample ... */
    uint32_t undistorted;
    uint32_t windows;
    uint32_t stabilized;
    replay_images_t images;
    uint32_t n_directions; /**< Directions of flight that are valid; ... */
    uint32_t velocity;     /**< ... a CRC of all, ... */
    uint32_t counts;       /**< ... and of the counters of bad input. */
} replay_result_t;

/**
 * @param setting  "full": exact table, tiles from a table, windows by area, rotation per slice. "grid": grid of 8 px,
 *                 windows by count, rotation per window. "duration": grid of 4 px, windows by time, per slice, no
 *                 saccades. "velocity": grid of 8 px, images with the predicted warp, direction of flight.
 * @return NULL when all went well, else what did not.
 */
const char *replay_run(recording_read_fn read, void *source, const char *setting, replay_result_t *result);

/** Print the result, one line per number. */
void replay_print(const replay_result_t *result);

#endif
