/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "bench_events.h"

#include <math.h>

#define PX_PER_S  300.0 /* Speed of an edge: a brisk hand-held sweep. */
#define LENGTH    0.4   /* Of an edge, in heights of the sensor. */
#define SPREAD_PX 3u    /* An edge is so many pixels thick. */
#define UNIT      (1.0 / 4294967296.0)

typedef struct {
    double x_px, y_px; /* Middle at time 0. */
    double along_x, along_y;
    double vx_px_s, vy_px_s;
} edge_t;

static uint32_t next_random(uint32_t *state)
{
    uint32_t s = *state;
    s ^= s << 13;
    s ^= s >> 17;
    s ^= s << 5;
    *state = s;
    return s;
}

/* Position modulo a length, so that an edge that leaves the sensor comes in again. */
static uint16_t wrap(double x, uint16_t length)
{
    const double r = x - floor(x / length) * length;
    const uint16_t i = (uint16_t)r;
    return (i < length) ? i : (uint16_t)(length - 1u);
}

void evt_bench_events(evs_event_t *ev, size_t n, uint16_t width_px, uint16_t height_px)
{
    edge_t edges[EVT_BENCH_EDGES];
    uint32_t state = 0x2545F491u;
    for (unsigned i = 0u; i < EVT_BENCH_EDGES; i++) {
        edge_t *const e = &edges[i];
        const double angle = 6.283185307179586 * UNIT * next_random(&state);
        e->x_px = UNIT * next_random(&state) * width_px;
        e->y_px = UNIT * next_random(&state) * height_px;
        e->along_x = cos(angle) * LENGTH * height_px;
        e->along_y = sin(angle) * LENGTH * height_px;
        e->vx_px_s = -sin(angle) * PX_PER_S; /* Across itself: along itself an edge makes no events. */
        e->vy_px_s = cos(angle) * PX_PER_S;
    }
    for (size_t i = 0u; i < n; i++) {
        const double t_s = (double)i / EVT_BENCH_EVENTS_HZ;
        const uint32_t r = next_random(&state);
        const edge_t *const e = &edges[r % EVT_BENCH_EDGES];
        const double at = UNIT * next_random(&state) - 0.5;
        const double jitter = (double)((r >> 16) % SPREAD_PX);
        const uint16_t x = wrap(e->x_px + at * e->along_x + t_s * e->vx_px_s + jitter, width_px);
        const uint16_t y = wrap(e->y_px + at * e->along_y + t_s * e->vy_px_s, height_px);
        ev[i] = evs_event_make((uint32_t)(1e6 * t_s), x, y, (r & 0x8000u) != 0u);
    }
}
