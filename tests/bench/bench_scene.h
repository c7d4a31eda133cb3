/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Stabilized events as a window of them has: most on the edges of a textured scene, a few at random. */
#ifndef EVS_BENCH_SCENE_H
#define EVS_BENCH_SCENE_H

#include "evs/types.h"

static inline uint32_t scene_random(void)
{
    static uint32_t state = 0x2545F491u;
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state;
}

/* 40 lines of 20 to 60 px, three pixels wide, and one event in ten anywhere; one event each `mean_us` on average. */
static inline void scene_events(evs_event_t *ev, evs_point_t *points, size_t n, uint32_t width_px, uint32_t height_px,
                                uint32_t mean_us)
{
    enum { N_LINES = 40 };
    static int32_t lines[N_LINES][4];
    static uint32_t t_us;
    if (lines[0][2] == 0) {
        for (int i = 0; i < N_LINES; i++) {
            lines[i][0] = (int32_t)(scene_random() % (16u * width_px));
            lines[i][1] = (int32_t)(scene_random() % (16u * height_px));
            lines[i][2] = (int32_t)(scene_random() % 1280u) - 640;
            lines[i][3] = (int32_t)(scene_random() % 1280u) - 640;
            if (lines[i][2] == 0) { lines[i][2] = 1; }
        }
    }
    for (size_t i = 0u; i < n; i++) {
        int32_t x = (int32_t)(scene_random() % (16u * width_px));
        int32_t y = (int32_t)(scene_random() % (16u * height_px));
        if ((scene_random() % 10u) != 0u) {
            const int32_t *const line = lines[scene_random() % N_LINES];
            const int32_t along = (int32_t)(scene_random() % 256u);
            x = line[0] + line[2] * along / 256 + (int32_t)(scene_random() % 48u) - 24;
            y = line[1] + line[3] * along / 256 + (int32_t)(scene_random() % 48u) - 24;
        }
        t_us += scene_random() % (2u * mean_us);
        ev[i] = evs_event_make(t_us, 0u, 0u, (scene_random() & 1u) != 0u);
        points[i].x_q4 = (int16_t)x;
        points[i].y_q4 = (int16_t)y;
    }
}

#endif
