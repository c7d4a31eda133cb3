/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  video.h
 * @brief The three panes as a video, made by the program ffmpeg: raw pictures go to its standard input.
 */
#ifndef EVR_VIDEO_H
#define EVR_VIDEO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "error.h"
#include "evs/types.h"

typedef struct evr_video evr_video_t;

/** Whether the name is that of a video: ends in .mp4 or .gif. */
bool evr_video_name_ok(const char *path);

/** Whether a video can be made at all: ffmpeg is installed. */
bool evr_video_possible(const char *path, evh_error_t *err);

/** ffmpeg starts with the first event and overwrites @p path. NULL with the cause in @p err. */
evr_video_t *evr_video_open(const char *path, uint16_t width_px, uint16_t height_px, evh_error_t *err);

/** Consecutive events with their host times. A failure is told by evr_video_close(). */
void evr_video_add(evr_video_t *v, const int64_t *t_us, const evs_event_t *ev, const evs_point_t *undistorted,
                   const evs_point_t *stabilized, size_t n);

/** The last picture, and wait until ffmpeg has finished. @p v may be NULL. */
bool evr_video_close(evr_video_t *v, evh_error_t *err);

#endif
