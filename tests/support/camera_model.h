/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  camera_model.h
 * @brief The lens models in double precision, written from the formulas and not from the library's code, and the
 *        calibrations of the three cameras of the paper.
 */
#ifndef CAMERA_MODEL_H
#define CAMERA_MODEL_H

#include <math.h>
#include <stdbool.h>

#include "evs/camera.h"
#include "evs/float.h"

typedef struct {
    const char *name;
    evs_camera_model_t model;
    uint16_t width_px;
    uint16_t height_px;
    double k_px[4]; /* fx, fy, cx, cy */
    double dist[EVS_CAMERA_N_DIST];
} calibration_t;

/* Event Camera Dataset (DAVIS240C), MVSEC indoor flying, left (DAVIS346), VECtor, left (Prophesee Gen3). */
static const calibration_t PAPER_CAMERAS[] = {
    {"ecd",
     EVS_CAMERA_PINHOLE,
     240,
     180,
     {199.092366542, 198.82882047, 132.192071378, 110.712660011},
     {-0.368436311798, 0.150947243557, -0.000296130534385, -0.000759431726241, 0.0}},
    {"mvsec",
     EVS_CAMERA_FISHEYE,
     346,
     260,
     {226.38018519795807, 226.15002947047415, 173.6470807871759, 133.73271487507847},
     {-0.048031442223833355, 0.011330957517194437, -0.055378166304281135, 0.021500973881459395, 0.0}},
    {"vector",
     EVS_CAMERA_PINHOLE,
     640,
     480,
     {327.32749, 327.46184, 304.97749, 235.37621},
     {-0.031982, 0.041966, -0.000507, -0.001031, 0.0}},
};
enum { N_PAPER_CAMERAS = sizeof PAPER_CAMERAS / sizeof PAPER_CAMERAS[0] };

static inline evs_camera_t camera_of(const calibration_t *c)
{
    evs_camera_config_t cfg;
    evs_camera_t cam = {.domain_q32 = 0};
    if ((evs_camera_config_from_double(&cfg, c->model, c->width_px, c->height_px, c->k_px, c->dist) != EVS_OK) ||
        (evs_camera_init(&cam, &cfg) != EVS_OK)) {
        cam.domain_q32 = -1; /* the tests look at it */
    }
    return cam;
}

static inline double fisheye_radius(const double d[EVS_CAMERA_N_DIST], double angle)
{
    const double a2 = angle * angle;
    return angle * (1.0 + d[0] * a2 + d[1] * a2 * a2 + d[2] * a2 * a2 * a2 + d[3] * a2 * a2 * a2 * a2);
}

/* Angle whose distorted radius is rd: bisection on [0, max], where the model rises. */
static inline double fisheye_angle(const double d[EVS_CAMERA_N_DIST], double rd, double max)
{
    double lo = 0.0;
    double hi = max;
    for (int i = 0; i < 60; i++) {
        const double mid = 0.5 * (lo + hi);
        if (fisheye_radius(d, mid) < rd) {
            lo = mid;
        } else {
            hi = mid;
        }
    }
    return 0.5 * (lo + hi);
}

/* Distorted pixel of an ideal pixel. */
static inline void model_distort(const calibration_t *c, double x_px, double y_px, double out_px[2])
{
    const double *const d = c->dist;
    const double x = (x_px - c->k_px[2]) / c->k_px[0];
    const double y = (y_px - c->k_px[3]) / c->k_px[1];
    const double r2 = x * x + y * y;
    double xd = x;
    double yd = y;
    if (c->model == EVS_CAMERA_FISHEYE) {
        const double r = sqrt(r2);
        const double s = (r > 0.0) ? fisheye_radius(d, atan(r)) / r : 1.0;
        xd = x * s;
        yd = y * s;
    } else {
        const double s = 1.0 + d[0] * r2 + d[1] * r2 * r2 + d[4] * r2 * r2 * r2;
        xd = x * s + 2.0 * d[2] * x * y + d[3] * (r2 + 2.0 * x * x);
        yd = y * s + d[2] * (r2 + 2.0 * y * y) + 2.0 * d[3] * x * y;
    }
    out_px[0] = c->k_px[0] * xd + c->k_px[2];
    out_px[1] = c->k_px[1] * yd + c->k_px[3];
}

/* Ideal pixel of a distorted pixel, for a fisheye within 90 degrees. Plain fixed-point iteration, as far as it goes. */
static inline void model_undistort(const calibration_t *c, double x_px, double y_px, double out_px[2])
{
    const double *const d = c->dist;
    const double xd = (x_px - c->k_px[2]) / c->k_px[0];
    const double yd = (y_px - c->k_px[3]) / c->k_px[1];
    double x = xd;
    double y = yd;
    if (c->model == EVS_CAMERA_FISHEYE) {
        const double rd = sqrt(xd * xd + yd * yd);
        const double s = (rd > 0.0) ? tan(fisheye_angle(d, rd, 1.57)) / rd : 1.0;
        x = xd * s;
        y = yd * s;
    } else {
        for (int i = 0; i < 2000; i++) {
            const double r2 = x * x + y * y;
            const double s = 1.0 + d[0] * r2 + d[1] * r2 * r2 + d[4] * r2 * r2 * r2;
            const double next_x = (xd - 2.0 * d[2] * x * y - d[3] * (r2 + 2.0 * x * x)) / s;
            const double next_y = (yd - d[2] * (r2 + 2.0 * y * y) - 2.0 * d[3] * x * y) / s;
            const double moved = fabs(next_x - x) + fabs(next_y - y);
            x = next_x;
            y = next_y;
            if (moved < 1e-13) { break; }
        }
    }
    out_px[0] = c->k_px[0] * x + c->k_px[2];
    out_px[1] = c->k_px[1] * y + c->k_px[3];
}

static inline evs_camera_px_t px_of(double x_px, double y_px)
{
    const evs_camera_px_t p = {evs_q_from_double(x_px, 16), evs_q_from_double(y_px, 16)};
    return p;
}
static inline double px_x(evs_camera_px_t p) { return evs_q_to_double(p.x_q16, 16); }
static inline double px_y(evs_camera_px_t p) { return evs_q_to_double(p.y_q16, 16); }

#endif
