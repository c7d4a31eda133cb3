/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  clip.h
 * @brief The animation: a hundred pictures in a row from the two seconds in which the camera turned fastest.
 *
 * How long the recording is, nobody knows before its end. So pictures begin short (0.6 ms) and pairs of them merge
 * while the first clip fills, until one lasts 20 ms; from then on each full clip is compared with the best so far.
 */
#ifndef EVR_CLIP_H
#define EVR_CLIP_H

#include <stdbool.h>

#include "panes.h"
#include "shake.h"

#define EVR_CLIP_PICTURES 100

typedef struct {
    uint8_t *pictures; /**< EVR_CLIP_PICTURES of them. */
    int64_t start_us;
    int64_t picture_us;
    int n; /**< Pictures in use. */
    double rate_rad_s;
} evr_take_t;

typedef struct {
    evr_panes_t panes;
    evr_take_t now, best;
    bool has_best;
} evr_clip_t;

/** @return false when memory is short. */
bool evr_clip_open(evr_clip_t *c, uint16_t width_px, uint16_t height_px);
void evr_clip_close(evr_clip_t *c);

/** Consecutive events with their host times. @p shake tells how fast the camera turned, up to these times at least. */
void evr_clip_add(evr_clip_t *c, const evr_shake_t *shake, const int64_t *t_us, const evs_event_t *ev,
                  const evs_point_t *undistorted, const evs_point_t *stabilized, size_t n);

/** After the last event. @return the best clip, NULL when there were no events. */
const evr_take_t *evr_clip_finish(evr_clip_t *c, const evr_shake_t *shake);

#endif
