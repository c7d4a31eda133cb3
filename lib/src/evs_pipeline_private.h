/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* What evs_pipeline.c and evs_pipeline_imaging.c share. */
#ifndef EVS_PIPELINE_PRIVATE_H
#define EVS_PIPELINE_PRIVATE_H

#include "evs/pipeline.h"

/* The camera after undistortion: the same sensor and K. */
static inline evs_pinhole_t evs_pipeline_pinhole(const evs_camera_config_t *camera)
{
    const evs_pinhole_t pinhole = {.width_px = camera->width_px,
                                   .height_px = camera->height_px,
                                   .fx_q16 = camera->fx_q16,
                                   .fy_q16 = camera->fy_q16,
                                   .cx_q16 = camera->cx_q16,
                                   .cy_q16 = camera->cy_q16};
    return pinhole;
}

/* Cut the next part off the memory block. */
static inline void *evs_pipeline_take(unsigned char **cursor, size_t bytes)
{
    unsigned char *const part = *cursor;
    *cursor += EVS_PIPELINE_PART(bytes);
    return part;
}

/* Bytes of memory for the images of these settings, evs_pipeline_imaging_t included; 0 when they are out of range. */
size_t evs_pipeline_imaging_bytes(const evs_pipeline_config_t *cfg);

/* Set up what the settings ask for, in memory at *cursor. @return as the modules. */
evs_status_t evs_pipeline_imaging_init(evs_pipeline_imaging_t *imaging, const evs_pipeline_config_t *cfg,
                                       unsigned char **cursor);

/* A sample that the orientation track has taken. */
void evs_pipeline_imaging_push_orientation(evs_pipeline_t *p, const evs_orientation_t *sample);

/* n events of the open window, stabilized. */
void evs_pipeline_imaging_add(evs_pipeline_t *p, const evs_event_t *ev, const evs_point_t *points, size_t n);

/* The open window has closed as chunk->end says: add its image to the chunk, begin with its velocity, and be ready for the
 * next window. */
void evs_pipeline_imaging_finish(evs_pipeline_t *p, evs_pipeline_chunk_t *chunk);

#endif
