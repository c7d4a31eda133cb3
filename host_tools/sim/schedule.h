/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  schedule.h
 * @brief When to render: often enough that nothing in the image moves more than half a pixel in between, and exactly
 *        where an exposure begins and ends.
 */
#ifndef EVSIM_SCHEDULE_H
#define EVSIM_SCHEDULE_H

#include "camera.h"
#include "motion.h"
#include "render.h"

#define EVSIM_BATCH_RENDERS 64u
#define EVSIM_BATCH_SPAN_NS INT64_C(100000000)

typedef struct {
    int64_t t0_ns; /**< The render before. */
    int64_t t1_ns;
    float exposure;    /**< Share of the running exposure that this interval is. */
    evsim_view_t view; /**< At t1_ns. */
} evsim_render_t;

/** Renders that are worked on together. */
typedef struct {
    evsim_render_t render[EVSIM_BATCH_RENDERS];
    unsigned n;
    bool ends_frame; /**< The last render ends an exposure... */
    uint64_t frame;  /**< ...that of this frame. */
} evsim_batch_t;

typedef struct {
    const evsim_motion_t *motion;
    const evsim_scene_t *scene;
    const evsim_camera_t *camera;
    double fps_hz;
    int64_t exposure_ns;
    int64_t end_ns;
    int64_t t_ns;
    uint64_t frame; /**< Whose exposure runs or comes next. */
    double speed_px_s;
    uint64_t n_renders;
    double speed_max_px_s;
} evsim_schedule_t;

void evsim_schedule_init(evsim_schedule_t *schedule, const evsim_settings_t *settings, const evsim_motion_t *motion,
                         const evsim_scene_t *scene, const evsim_camera_t *camera);

/** Start of the exposure of frame k. */
int64_t evsim_exposure_start_ns(double fps_hz, uint64_t frame);

/** The view at time 0, which all begins with. */
bool evsim_schedule_start(evsim_schedule_t *schedule, evsim_view_t *view, evh_error_t *err);

/** The next renders; none at the end. @return false: the camera hits something. */
bool evsim_schedule_next(evsim_schedule_t *schedule, evsim_batch_t *batch, evh_error_t *err);

#endif
