/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "panes.h"

#include <stdbool.h>
#include <string.h>

evr_panes_t evr_panes_layout(uint16_t width_px, uint16_t height_px)
{
    evr_panes_t p = {1, 0, 0, 0u};
    while (width_px > p.bin * EVR_PANE_MAX_PX) { p.bin++; }
    p.width = (width_px + p.bin - 1) / p.bin;
    p.height = (height_px + p.bin - 1) / p.bin;
    p.n_cells = 5u * evr_panes_canvas_at(&p);
    return p;
}

/* 1/16 px to a cell, by the nearest pixel: counted from -2048 cells, where nothing is negative. */
static int cell_of(int16_t q4, int bin)
{
    const unsigned shifted = (unsigned)(q4 + 2048 * 16 * bin + 8);
    return (int)((bin == 1) ? shifted / 16u : shifted / (16u * (unsigned)bin)) - 2048;
}

static void count(uint8_t *cell, bool brighter)
{
    if (brighter) {
        if ((*cell & 0x0Fu) != 0x0Fu) { *cell = (uint8_t)(*cell + 0x01u); }
    } else {
        if ((*cell & 0xF0u) != 0xF0u) { *cell = (uint8_t)(*cell + 0x10u); }
    }
}

static void add_point(uint8_t *image, int width, int height, int x, int y, bool brighter)
{
    if ((x >= 0) && (y >= 0) && (x < width) && (y < height)) {
        count(&image[(size_t)y * (size_t)width + (size_t)x], brighter);
    }
}

void evr_panes_add(const evr_panes_t *p, uint8_t *picture, const evs_event_t *ev, const evs_point_t *undistorted,
                   const evs_point_t *stabilized, size_t n)
{
    uint8_t *const canvas = picture + evr_panes_canvas_at(p);
    for (size_t i = 0u; i < n; i++) {
        const bool brighter = evs_event_brighter(ev[i]);
        if (!evs_point_is_outside(undistorted[i])) {
            add_point(picture, p->width, p->height, cell_of(undistorted[i].x_q4, p->bin),
                      cell_of(undistorted[i].y_q4, p->bin), brighter);
        }
        if (!evs_point_is_outside(stabilized[i])) {
            add_point(canvas, 2 * p->width, 2 * p->height, cell_of(stabilized[i].x_q4, p->bin) + p->width / 2,
                      cell_of(stabilized[i].y_q4, p->bin) + p->height / 2, brighter);
        }
    }
}

static uint8_t sum_up_to(unsigned a, unsigned b, unsigned top) { return (uint8_t)((a + b < top) ? a + b : top); }

static bool eight_are_empty(const uint8_t *cells)
{
    uint64_t word;
    memcpy(&word, cells, sizeof word);
    return word == 0u;
}

void evr_panes_merge(const evr_panes_t *p, uint8_t *into, const uint8_t *from)
{
    size_t i = 0u;
    while (i < p->n_cells) {
        if ((i + 8u <= p->n_cells) && eight_are_empty(from + i)) { /* Most are. */
            i += 8u;
        } else {
            const unsigned brighter = sum_up_to(into[i] & 0x0Fu, from[i] & 0x0Fu, 0x0Fu);
            const unsigned darker = sum_up_to(into[i] & 0xF0u, from[i] & 0xF0u, 0xF0u);
            into[i] = (uint8_t)(darker | brighter);
            i++;
        }
    }
}
