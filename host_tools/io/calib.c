/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "calib.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lines.h"

#define FOCAL_MIN_PX  8.0 /* The limits of the library: evs/homography.h, evs/camera.h. */
#define FOCAL_MAX_PX  8192.0
#define CENTRE_MAX_PX 4096.0
#define DIST_MAX      16383.0

bool evh_calib_check(const evh_calib_t *calib, const char *path, evh_error_t *err)
{
    if (!(calib->fx_px >= FOCAL_MIN_PX) || !(calib->fy_px >= FOCAL_MIN_PX) || !(calib->fx_px <= FOCAL_MAX_PX) ||
        !(calib->fy_px <= FOCAL_MAX_PX)) {
        return evh_fail(err, "%s: focal length fx %g, fy %g; it is given in pixels and must lie in %g .. %g", path,
                        calib->fx_px, calib->fy_px, FOCAL_MIN_PX, FOCAL_MAX_PX);
    }
    if (!(calib->fx_px < 2.0 * calib->fy_px) || !(calib->fy_px < 2.0 * calib->fx_px)) {
        return evh_fail(err, "%s: focal lengths fx %g and fy %g differ by more than a factor of 2, which no lens does",
                        path, calib->fx_px, calib->fy_px);
    }
    if (!(fabs(calib->cx_px) <= CENTRE_MAX_PX) || !(fabs(calib->cy_px) <= CENTRE_MAX_PX)) {
        return evh_fail(err, "%s: principal point cx %g, cy %g; it is given in pixels and must lie near the sensor",
                        path, calib->cx_px, calib->cy_px);
    }
    for (int i = 0; i < 5; i++) {
        if (!(fabs(calib->dist[i]) <= DIST_MAX)) {
            return evh_fail(err, "%s: distortion coefficient %d is %g, which no lens has", path, i + 1, calib->dist[i]);
        }
    }
    return true;
}

/* The numbers of one line, after those of the lines before. */
static bool take_numbers(const evh_line_t *line, double *number, size_t cap, size_t *n)
{
    const char *p = line->text;
    const char *const end = line->text + line->length;
    for (;;) {
        char *stop = NULL;
        while ((p < end) && ((*p == ' ') || (*p == '\t') || (*p == ','))) { p++; }
        if ((p == end) || (*p == '#')) { return true; }
        if (*n == cap) { return false; }
        number[*n] = strtod(p, &stop);
        if ((stop == p) || ((stop < end) && (*stop != ' ') && (*stop != '\t') && (*stop != ','))) { return false; }
        (*n)++;
        p = stop;
    }
}

bool evh_calib_text_read(evh_calib_t *calib, const char *path, evh_error_t *err)
{
    evh_lines_t lines;
    evh_line_t line;
    double number[9] = {0.0};
    size_t n = 0u;
    bool ok = true;

    if (!evh_lines_open(&lines, path, err)) { return false; }
    while (ok && evh_lines_next(&lines, &line, err)) {
        if (line.overlong || !take_numbers(&line, number, 9u, &n)) {
            ok = evh_fail(err, "%s: line %" PRIu64 ": expected up to nine numbers, fx fy cx cy k1 k2 p1 p2 k3", path,
                          lines.line);
        }
    }
    ok = ok && !lines.failed;
    evh_lines_close(&lines);
    if (!ok) { return false; }
    if ((n != 4u) && (n != 8u) && (n != 9u)) {
        return evh_fail(err, "%s: holds %zu numbers; expected fx fy cx cy, alone or followed by k1 k2 p1 p2 [k3]", path,
                        n);
    }
    memset(calib, 0, sizeof *calib);
    calib->fx_px = number[0];
    calib->fy_px = number[1];
    calib->cx_px = number[2];
    calib->cy_px = number[3];
    memcpy(calib->dist, number + 4, 5u * sizeof number[0]);
    return evh_calib_check(calib, path, err);
}
