/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * usage: dump_camera pinhole|fisheye WIDTH HEIGHT FX FY CX CY D0 D1 D2 D3 D4 WHAT
 *
 * Prints one line "x y" per pixel, row by row, or "none":
 *   WHAT = distort     evs_camera_distort() of the pixel, 16 fractional bits
 *          undistort   evs_camera_undistort() of the pixel, 16 fractional bits
 *          1 2 4 .. 32 evs_undistort_map() with a table of that step, 4 fractional bits
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "evs/float.h"
#include "evs/undistort.h"

static void print_model(const evs_camera_t *cam, bool forward)
{
    for (int32_t y = 0; y < cam->cfg.height_px; y++) {
        for (int32_t x = 0; x < cam->cfg.width_px; x++) {
            const evs_camera_px_t px = {x * 65536, y * 65536};
            evs_camera_px_t out;
            const evs_status_t status =
                forward ? evs_camera_distort(cam, px, &out) : evs_camera_undistort(cam, px, &out);
            if (status == EVS_OK) {
                printf("%ld %ld\n", (long)out.x_q16, (long)out.y_q16);
            } else {
                puts("none");
            }
        }
    }
}

static int print_table(const evs_camera_t *cam, uint16_t step_px)
{
    const size_t n = EVS_UNDISTORT_POINTS(cam->cfg.width_px, cam->cfg.height_px, step_px);
    evs_point_t *const table = malloc(n * sizeof *table);
    evs_undistort_t u;
    if ((table == NULL) || (evs_undistort_build(&u, cam, step_px, table, n) != EVS_OK)) {
        fprintf(stderr, "dump_camera: no table of step %u\n", (unsigned)step_px);
        free(table);
        return 1;
    }
    for (uint16_t y = 0; y < cam->cfg.height_px; y++) {
        for (uint16_t x = 0; x < cam->cfg.width_px; x++) {
            const evs_event_t ev = evs_event_make(0, x, y, ((x ^ y) & 1) != 0);
            evs_point_t p;
            evs_undistort_map(&u, &ev, 1, &p);
            if (evs_point_is_outside(p)) {
                puts("none");
            } else {
                printf("%d %d\n", p.x_q4, p.y_q4);
            }
        }
    }
    free(table);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc != 14) {
        fputs("usage: dump_camera pinhole|fisheye WIDTH HEIGHT FX FY CX CY D0 D1 D2 D3 D4 WHAT\n", stderr);
        return 2;
    }
    double number[11];
    for (int i = 0; i < 11; i++) { number[i] = strtod(argv[2 + i], NULL); }
    const evs_camera_model_t model = (strcmp(argv[1], "fisheye") == 0) ? EVS_CAMERA_FISHEYE : EVS_CAMERA_PINHOLE;
    evs_camera_config_t cfg;
    evs_camera_t cam;
    if ((evs_camera_config_from_double(&cfg, model, (uint16_t)number[0], (uint16_t)number[1], number + 2, number + 6) !=
         EVS_OK) ||
        (evs_camera_init(&cam, &cfg) != EVS_OK)) {
        fputs("dump_camera: the calibration is refused\n", stderr);
        return 1;
    }
    if (strcmp(argv[13], "distort") == 0) {
        print_model(&cam, true);
    } else if (strcmp(argv[13], "undistort") == 0) {
        print_model(&cam, false);
    } else {
        return print_table(&cam, (uint16_t)strtoul(argv[13], NULL, 10));
    }
    return 0;
}
