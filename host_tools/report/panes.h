/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  panes.h
 * @brief The pictures of the animation: what the sensor saw (undistorted), and what stabilization made of it on a
 * canvas of twice the width and height, in whose middle the sensor's own frame lies.
 *
 * A picture is one byte a cell: bits 0..3 count brighter events, bits 4..7 darker ones, up to 15 each. Sensors that are
 * wider than EVR_PANE_MAX_PX are binned, so that memory and the report stay small.
 */
#ifndef EVR_PANES_H
#define EVR_PANES_H

#include <stddef.h>
#include <stdint.h>

#include "evs/types.h"

#define EVR_PANE_MAX_PX 346

typedef struct {
    int bin;           /**< Pixels to a cell, along each side. */
    int width, height; /**< Of the sensor's pane, in cells; the canvas has twice that. */
    size_t n_cells;    /**< Bytes of a picture: the pane, then the canvas, row-major. */
} evr_panes_t;

evr_panes_t evr_panes_layout(uint16_t width_px, uint16_t height_px);

/** The canvas within a picture. */
static inline size_t evr_panes_canvas_at(const evr_panes_t *p) { return (size_t)p->width * (size_t)p->height; }

void evr_panes_add(const evr_panes_t *p, uint8_t *picture, const evs_event_t *ev, const evs_point_t *undistorted,
                   const evs_point_t *stabilized, size_t n);

/** into += from, cell by cell. */
void evr_panes_merge(const evr_panes_t *p, uint8_t *into, const uint8_t *from);

#endif
