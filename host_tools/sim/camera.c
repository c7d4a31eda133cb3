/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "camera.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NEWTON_STEPS   50
#define CONVERGED      1e-12
#define PROBE_COLUMNS  16u
#define PROBE_ROWS     12u
#define RAY_LENGTH_MAX 20.0 /* 87 degrees off axis. */
#define PATH_STEPS     16   /* From the centre to a pixel. */
#define DET_MIN        1e-3

void evsim_distort(const evh_calib_t *calib, double x, double y, double out[2], double jacobian[4])
{
    const double k1 = calib->dist[0];
    const double k2 = calib->dist[1];
    const double p1 = calib->dist[2];
    const double p2 = calib->dist[3];
    const double k3 = calib->dist[4];
    const double r2 = x * x + y * y;
    const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    out[0] = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
    out[1] = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
    if (jacobian != NULL) {
        const double slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3)); /* d(radial)/d(x) = slope x */
        jacobian[0] = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x;
        jacobian[1] = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y;
        jacobian[2] = jacobian[1];
        jacobian[3] = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x;
    }
}

/* Improve @p ray until it lands on (xd, yd) of the image plane. The model folds over far outside; a step over the fold
 * is refused, so that a good start leads to the root on this side of it. */
static bool newton(const evh_calib_t *calib, double xd, double yd, double ray[2])
{
    double x = ray[0];
    double y = ray[1];
    for (int i = 0; i < NEWTON_STEPS; i++) {
        double out[2];
        double j[4];
        double det;
        double ex;
        double ey;
        evsim_distort(calib, x, y, out, j);
        det = j[0] * j[3] - j[1] * j[2];
        if (!(det > DET_MIN) || !(j[0] + j[3] > 0.0)) { return false; }
        ex = xd - out[0];
        ey = yd - out[1];
        if (fabs(ex) + fabs(ey) < CONVERGED) {
            ray[0] = x;
            ray[1] = y;
            return true;
        }
        x += (j[3] * ex - j[1] * ey) / det;
        y += (j[0] * ey - j[2] * ex) / det;
        if (!(fabs(x) < RAY_LENGTH_MAX) || !(fabs(y) < RAY_LENGTH_MAX)) { return false; }
    }
    return false;
}

bool evsim_undistort(const evh_calib_t *calib, double x_px, double y_px, double ray[2])
{
    const double xd = (x_px - calib->cx_px) / calib->fx_px;
    const double yd = (y_px - calib->cy_px) / calib->fy_px;
    ray[0] = 0.0;
    ray[1] = 0.0;
    for (int step = 1; step <= PATH_STEPS; step++) {
        const double part = (double)step / PATH_STEPS;
        if (!newton(calib, part * xd, part * yd, ray)) { return false; }
    }
    return true;
}

/* As above with the ray of a neighbour to start from. */
static bool undistort_near(const evh_calib_t *calib, double x_px, double y_px, double ray[2])
{
    return newton(calib, (x_px - calib->cx_px) / calib->fx_px, (y_px - calib->cy_px) / calib->fy_px, ray);
}

/* d(pixel)/d(ray) */
static void pixel_jacobian(const evh_calib_t *calib, double x, double y, double j[4])
{
    double out[2];
    evsim_distort(calib, x, y, out, j);
    j[0] *= calib->fx_px;
    j[1] *= calib->fx_px;
    j[2] *= calib->fy_px;
    j[3] *= calib->fy_px;
}

static bool fill_rays(evsim_camera_t *c, const evh_calib_t *calib, evh_error_t *err)
{
    double row_start[2];
    for (unsigned y = 0u; y < c->height_px; y++) {
        double ray[2];
        for (unsigned x = 0u; x < c->width_px; x++) {
            const size_t i = (size_t)y * c->width_px + x;
            double j[4];
            double pitch;
            bool ok;
            if (x > 0u) {
                ok = undistort_near(calib, (double)x, (double)y, ray);
            } else if (y > 0u) {
                memcpy(ray, row_start, sizeof ray);
                ok = undistort_near(calib, 0.0, (double)y, ray);
            } else {
                ok = evsim_undistort(calib, 0.0, 0.0, ray);
            }
            if (x == 0u) { memcpy(row_start, ray, sizeof row_start); }
            if (!ok) {
                return evh_fail(err,
                                "calibration: the lens model has no inverse at pixel (%u, %u); use a longer focal "
                                "length, weaker distortion or a smaller sensor",
                                x, y);
            }
            pixel_jacobian(calib, ray[0], ray[1], j);
            pitch = 1.0 / sqrt(j[0] * j[3] - j[1] * j[2]);
            c->ray_x[i] = (float)ray[0];
            c->ray_y[i] = (float)ray[1];
            c->pitch[i] = (float)pitch;
        }
    }
    return true;
}

static evsim_tile_t tile_bounds(const evsim_camera_t *c, unsigned x0, unsigned y0)
{
    float low[2] = {INFINITY, INFINITY};
    float high[2] = {-INFINITY, -INFINITY};
    for (unsigned y = y0; (y < y0 + EVSIM_TILE_H) && (y < c->height_px); y++) {
        for (unsigned x = x0; (x < x0 + EVSIM_TILE_W) && (x < c->width_px); x++) {
            const size_t i = (size_t)y * c->width_px + x;
            const float margin = c->pitch[i]; /* An edge half a pixel away still shows. */
            low[0] = fminf(low[0], c->ray_x[i] - margin);
            high[0] = fmaxf(high[0], c->ray_x[i] + margin);
            low[1] = fminf(low[1], c->ray_y[i] - margin);
            high[1] = fmaxf(high[1], c->ray_y[i] + margin);
        }
    }
    return (evsim_tile_t){0.5f * (low[0] + high[0]), 0.5f * (low[1] + high[1]), 0.5f * (high[0] - low[0]),
                          0.5f * (high[1] - low[1])};
}

static void fill_probes(evsim_camera_t *c, const evh_calib_t *calib)
{
    const unsigned columns = (c->width_px < PROBE_COLUMNS) ? c->width_px : PROBE_COLUMNS;
    const unsigned rows = (c->height_px < PROBE_ROWS) ? c->height_px : PROBE_ROWS;
    for (unsigned r = 0u; r < rows; r++) {
        for (unsigned q = 0u; q < columns; q++) {
            const unsigned x = (columns > 1u) ? q * (c->width_px - 1u) / (columns - 1u) : 0u;
            const unsigned y = (rows > 1u) ? r * (c->height_px - 1u) / (rows - 1u) : 0u;
            const size_t i = (size_t)y * c->width_px + x;
            evsim_probe_t *const probe = &c->probe[c->n_probes++];
            double j[4];
            probe->x = (double)c->ray_x[i];
            probe->y = (double)c->ray_y[i];
            pixel_jacobian(calib, probe->x, probe->y, j);
            probe->px_per_x[0] = j[0];
            probe->px_per_x[1] = j[2];
            probe->px_per_y[0] = j[1];
            probe->px_per_y[1] = j[3];
        }
    }
}

bool evsim_camera_init(evsim_camera_t *camera, const evh_calib_t *calib, evh_error_t *err)
{
    const size_t n = (size_t)calib->width_px * calib->height_px;
    memset(camera, 0, sizeof *camera);
    camera->width_px = calib->width_px;
    camera->height_px = calib->height_px;
    camera->n_tiles_x = (camera->width_px + EVSIM_TILE_W - 1u) / EVSIM_TILE_W;
    camera->n_bands = (camera->height_px + EVSIM_TILE_H - 1u) / EVSIM_TILE_H;
    camera->ray_x = malloc(n * sizeof *camera->ray_x);
    camera->ray_y = malloc(n * sizeof *camera->ray_y);
    camera->pitch = malloc(n * sizeof *camera->pitch);
    camera->tile = malloc((size_t)camera->n_tiles_x * camera->n_bands * sizeof *camera->tile);
    if ((camera->ray_x == NULL) || (camera->ray_y == NULL) || (camera->pitch == NULL) || (camera->tile == NULL)) {
        return evh_fail(err, "out of memory for a sensor of %ux%u pixels", camera->width_px, camera->height_px);
    }
    if (!fill_rays(camera, calib, err)) { return false; }
    for (unsigned band = 0u; band < camera->n_bands; band++) {
        for (unsigned t = 0u; t < camera->n_tiles_x; t++) {
            camera->tile[band * camera->n_tiles_x + t] = tile_bounds(camera, t * EVSIM_TILE_W, band * EVSIM_TILE_H);
        }
    }
    fill_probes(camera, calib);
    return true;
}

void evsim_camera_free(evsim_camera_t *camera)
{
    free(camera->ray_x);
    free(camera->ray_y);
    free(camera->pitch);
    free(camera->tile);
    memset(camera, 0, sizeof *camera);
}
