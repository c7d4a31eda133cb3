/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* A small world for the tests of everything that looks at images: bright dots on an uneven wall all around, in double
 * precision, and what a camera sees of it that is held to a reference orientation. */
#ifndef EVS_TEST_FLIGHT_H
#define EVS_TEST_FLIGHT_H

#include "evs/homography.h"
#include "model.h"

#include <string.h>

enum { FLIGHT_DOTS_MAX = 1800 };

typedef struct {
    double at[3]; /* in the world; the flight begins near the origin and looks along z, y down */
    int32_t grey; /* brightness of its middle */
    bool mover;   /* moves with the velocity flight_mover_v instead of standing still */
} flight_dot_t;

static flight_dot_t flight_dots[FLIGHT_DOTS_MAX];
static size_t flight_n_dots;
static double flight_mover_v[3];

/* Dots in all directions up to 65 degrees to the sides and 50 up and down, at 1.5 to 3.5 m. */
static inline double flight_uniform(uint32_t *seed, double lo, double hi)
{
    *seed = *seed * 1664525u + 1013904223u;
    return lo + (hi - lo) * (double)(*seed >> 8) / 16777216.0;
}

static inline void flight_make_wall(size_t n_dots, uint32_t seed)
{
    flight_n_dots = n_dots;
    for (size_t i = 0u; i < n_dots; i++) {
        const double azimuth = flight_uniform(&seed, -1.13, 1.13);
        const double elevation = flight_uniform(&seed, -0.87, 0.87);
        const double depth = 2.5 + 0.6 * sin(2.2 * azimuth + 0.5) + 0.4 * cos(3.1 * elevation);
        flight_dot_t *const dot = &flight_dots[i];
        dot->at[0] = depth * tan(azimuth / 1.2);
        dot->at[1] = depth * tan(elevation / 1.2);
        dot->at[2] = depth;
        dot->grey = (int32_t)flight_uniform(&seed, 60.0, 200.0);
        dot->mover = false;
    }
}

/* Where a camera at `position` sees a world point when it is held to the orientation q_wr; false behind it. */
static inline bool flight_project(const evs_pinhole_t *k, model_quat_t q_wr, const double position[3],
                                  const double point[3], double px[2])
{
    const double apart[3] = {point[0] - position[0], point[1] - position[1], point[2] - position[2]};
    double ray[3];
    model_rotate(model_conj(q_wr), apart, ray);
    if (ray[2] < 0.1) { return false; }
    px[0] = k->cx_q16 / 65536.0 + k->fx_q16 / 65536.0 * ray[0] / ray[2];
    px[1] = k->cy_q16 / 65536.0 + k->fy_q16 / 65536.0 * ray[1] / ray[2];
    return true;
}

static inline bool flight_sees(const evs_pinhole_t *k, model_quat_t q_wr, const double position[3], double t_s,
                               const flight_dot_t *dot, double px[2])
{
    double at[3];
    for (int i = 0; i < 3; i++) { at[i] = dot->at[i] + (dot->mover ? flight_mover_v[i] * t_s : 0.0); }
    return flight_project(k, q_wr, position, at, px);
}

/* A dot of 7 x 7 px with soft flanks, added to what is there. */
static inline void flight_draw_dot(uint8_t *image, int width, int height, const double px[2], int32_t grey)
{
    if ((px[0] < -4.0) || (px[1] < -4.0) || (px[0] > width + 3.0) || (px[1] > height + 3.0)) { return; }
    const int32_t x_q4 = (int32_t)floor(px[0] * 16.0 + 0.5), y_q4 = (int32_t)floor(px[1] * 16.0 + 0.5);
    for (int32_t y = (y_q4 >> 4) - 3; y <= (y_q4 >> 4) + 3; y++) {
        for (int32_t x = (x_q4 >> 4) - 3; x <= (x_q4 >> 4) + 3; x++) {
            if ((x < 0) || (y < 0) || (x >= width) || (y >= height)) { continue; }
            const int32_t dx = x * 16 - x_q4, dy = y * 16 - y_q4;
            const int32_t rest = 48 * 48 - dx * dx - dy * dy; /* radius 3 px */
            if (rest <= 0) { continue; }
            const int32_t sum = image[y * width + x] + grey * (rest * rest / 2304) / 2304;
            image[y * width + x] = (uint8_t)((sum < 255) ? sum : 255);
        }
    }
}

static inline void flight_render(const evs_pinhole_t *k, model_quat_t q_wr, const double position[3], double t_s,
                                 uint8_t *image)
{
    memset(image, 0, (size_t)k->width_px * k->height_px);
    for (size_t i = 0u; i < flight_n_dots; i++) {
        double px[2];
        if (flight_sees(k, q_wr, position, t_s, &flight_dots[i], px)) {
            flight_draw_dot(image, k->width_px, k->height_px, px, flight_dots[i].grey);
        }
    }
}

#endif
