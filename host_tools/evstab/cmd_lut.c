/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* evstab lut: the undistortion table of a camera as a const array for flash, made by the very function that would build
 * it on the device, so that both have the same bits. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "config_yaml.h"
#include "csv_writer.h"
#include "detect.h"
#include "evs/undistort.h"
#include "evs/version.h"
#include "options.h"
#include "recording.h"
#include "to_device.h"

#define NAME_MAX_BYTES 48u

static const char *opt_out;
static const char *opt_step;
static const char *opt_size;
static const char *opt_name;

static const evt_option_t OPTIONS[] = {
    {"output", 'o', "LUT.h", "The header to write. Needed.", &opt_out, NULL},
    {"step", '\0', "N",
     "1: a point per pixel, exact (default); 2, 4, 8, 16 or 32:\na grid to interpolate, much smaller "
     "(docs/modules/undistort.md).",
     &opt_step, NULL},
    {"size", '\0', "WxH", "Sensor size in pixels, if CALIB does not say.\nDefault: 240x180 for a calib.txt.", &opt_size,
     NULL},
    {"name", '\0', "NAME", "Name of the array; default: from that of LUT.h.", &opt_name, NULL},
};

static const evt_usage_t USAGE = {
    .command = "lut",
    .synopsis = "CALIB -o LUT.h [options]",
    .about =
        "Writes the undistortion table of a camera as a C header with a const array, for a microcontroller to keep in\n"
        "flash: give it to evs_undistort_bind() or to the pipeline. CALIB is a calib.txt (fx fy cx cy k1 k2 p1 p2 k3) "
        "or a\n"
        "YAML file with K and D, EuRoC's sensor.yaml included.",
    .examples = "  evstab lut calib.txt -o camera_lut.h --step 8\n  evstab lut vector_davis.yaml -o camera_lut.h",
    .options = OPTIONS,
    .n_options = sizeof OPTIONS / sizeof OPTIONS[0],
    .n_words_min = 1u,
    .n_words_max = 1u,
};

static bool read_calib(const char *path, evh_calib_t *calib, evh_error_t *err)
{
    evh_kind_t kind = EVH_KIND_UNKNOWN;
    if (!evh_detect(path, &kind, err)) { return false; }
    if (kind == EVH_KIND_CONFIG) {
        evh_config_t config;
        if (!evh_config_read(&config, path, err)) { return false; }
        if (!config.has_calib) { return evh_fail(err, "%s: no camera in it; needed are K and D, or intrinsics", path); }
        *calib = config.calib;
        return true;
    }
    return evh_calib_text_read(calib, path, err);
}

/* A C name from a file name: "dir/cam-0.h" gives "cam_0". */
static void make_name(const char *path, char name[NAME_MAX_BYTES])
{
    const char *const file = evh_path_name(path);
    size_t n = strcspn(file, ".");
    size_t at = 0u;
    if ((n == 0u) || ((file[0] >= '0') && (file[0] <= '9'))) { at = (size_t)snprintf(name, NAME_MAX_BYTES, "lut_"); }
    for (size_t i = 0u; (i < n) && (at + 1u < NAME_MAX_BYTES); i++) {
        const char c = file[i];
        const bool ok = ((c >= 'a') && (c <= 'z')) || ((c >= 'A') && (c <= 'Z')) || ((c >= '0') && (c <= '9'));
        name[at++] = ok ? c : '_';
    }
    name[at] = '\0';
}

static bool is_c_name(const char *name)
{
    if ((name[0] >= '0') && (name[0] <= '9')) { return false; }
    for (const char *p = name; *p != '\0'; p++) {
        const char c = *p;
        if (!(((c >= 'a') && (c <= 'z')) || ((c >= 'A') && (c <= 'Z')) || ((c >= '0') && (c <= '9')) || (c == '_'))) {
            return false;
        }
    }
    return strlen(name) < NAME_MAX_BYTES;
}

static void put_line(evh_csv_t *out, const char *text)
{
    evh_csv_advance(out, evh_put_text(evh_csv_reserve(out, strlen(text)), text));
}

static void put_head(evh_csv_t *out, const char *name, const char *source, const evh_calib_t *c, uint16_t step_px,
                     size_t n_points)
{
    char upper[NAME_MAX_BYTES];
    char text[2048];
    size_t i;
    for (i = 0u; name[i] != '\0'; i++) {
        upper[i] = (char)(((name[i] >= 'a') && (name[i] <= 'z')) ? name[i] - 'a' + 'A' : name[i]);
    }
    upper[i] = '\0';
    (void)snprintf(text, sizeof text,
                   " * Sensor %ux%u px, step %u px, %zu bytes. Made by evstab %s from %s:\n"
                   " *   %s, fx %.9g fy %.9g cx %.9g cy %.9g\n"
                   " *   distortion %.9g %.9g %.9g %.9g %.9g\n"
                   " * Use: evs_undistort_bind(&u, %s_WIDTH_PX, %s_HEIGHT_PX, %s_STEP_PX, %s,\n"
                   " *                         sizeof %s / sizeof %s[0]);\n"
                   " */\n",
                   (unsigned)c->width_px, (unsigned)c->height_px, (unsigned)step_px, n_points * sizeof(evs_point_t),
                   EVS_VERSION_STRING, evh_path_name(source),
                   c->fisheye ? "equidistant fisheye" : "pinhole (Brown-Conrady)", c->fx_px, c->fy_px, c->cx_px,
                   c->cy_px, c->dist[0], c->dist[1], c->dist[2], c->dist[3], c->dist[4], upper, upper, upper, name,
                   name, name);
    put_line(out, text);
    (void)snprintf(text, sizeof text,
                   "#ifndef EVS_LUT_%s_H\n#define EVS_LUT_%s_H\n\n#include \"evs/types.h\"\n\n"
                   "#define %s_WIDTH_PX  %uu\n#define %s_HEIGHT_PX %uu\n#define %s_STEP_PX   %uu\n\n"
                   "static const evs_point_t %s[%zu] = {",
                   upper, upper, upper, (unsigned)c->width_px, upper, (unsigned)c->height_px, upper, (unsigned)step_px,
                   name, n_points);
    put_line(out, text);
}

static bool write_header(const char *path, const char *name, const char *source, const evh_calib_t *calib,
                         uint16_t step_px, const evs_point_t *points, size_t n_points, evh_error_t *err)
{
    evh_csv_t out;
    if (!evh_csv_open_path(&out, path, "/* Undistortion table: where each pixel lies without the lens, in 1/16 px.",
                           err)) {
        return false;
    }
    put_head(&out, name, source, calib, step_px, n_points);
    for (size_t i = 0u; i < n_points; i++) {
        char *p = evh_csv_reserve(&out, 48u);
        p = evh_put_text(p, (i == 0u) ? "\n    {" : (i % 6u == 0u) ? ",\n    {" : ", {");
        p = evh_put_int(p, points[i].x_q4);
        p = evh_put_text(p, ", ");
        p = evh_put_int(p, points[i].y_q4);
        *p++ = '}';
        evh_csv_advance(&out, p);
    }
    put_line(&out, "};\n\n#endif\n");
    return evh_csv_close(&out, err);
}

static bool make_table(const evh_calib_t *calib, const char *source, const char *out, const char *name,
                       uint16_t step_px, evh_error_t *err)
{
    const evs_camera_config_t config = evt_camera_config(calib, calib->width_px, calib->height_px);
    const size_t n_points = EVS_UNDISTORT_POINTS(calib->width_px, calib->height_px, step_px);
    evs_point_t *const points = malloc(n_points * sizeof *points);
    evs_camera_t camera;
    evs_undistort_t undistort;
    size_t n_outside = 0u;
    evs_status_t status;
    bool ok;

    if (points == NULL) { return evh_fail(err, "out of memory for %zu points", n_points); }
    status = evs_camera_init(&camera, &config);
    if (status == EVS_OK) { status = evs_undistort_build(&undistort, &camera, step_px, points, n_points); }
    if (status != EVS_OK) {
        free(points);
        return evh_fail(err, "%s: the library refuses this camera (%s); check the calibration and --size", source,
                        evs_status_name(status));
    }
    for (size_t i = 0u; i < n_points; i++) { n_outside += evs_point_is_outside(points[i]) ? 1u : 0u; }
    if (n_outside > n_points / 2u) {
        free(points);
        return evh_fail(
            err,
            "%s: most of the sensor (%zu of %zu points) has no undistorted position under this lens model; check the "
            "distortion coefficients",
            source, n_outside, n_points);
    }
    ok = write_header(out, name, source, calib, step_px, points, n_points, err);
    free(points);
    if (ok) {
        (void)printf("%s: %s[%zu], %zu bytes, %ux%u px, step %u\n", out, name, n_points, n_points * sizeof(evs_point_t),
                     (unsigned)calib->width_px, (unsigned)calib->height_px, (unsigned)step_px);
        if (n_outside > 0u) {
            evh_note("%zu of the %zu points have no undistorted position under this lens model: events there become "
                     "\"outside\"",
                     n_outside, n_points);
        }
    }
    return ok;
}

int evt_lut_main(int argc, char **argv)
{
    const char *words[1];
    char name[NAME_MAX_BYTES];
    evh_calib_t calib;
    evh_error_t err = {""};
    int64_t step_px = 1;
    uint16_t width_px = 0u;
    uint16_t height_px = 0u;
    int status = EVT_EXIT_OK;

    if (!evt_options_parse(&USAGE, argc, argv, words, &status)) { return status; }
    if (opt_out == NULL) { return evt_usage_error(&USAGE, "-o LUT.h is missing: where the table shall go"); }
    if ((opt_step != NULL) &&
        (!evt_parse_int(opt_step, 1, EVS_UNDISTORT_STEP_MAX_PX, &step_px) || ((step_px & (step_px - 1)) != 0))) {
        return evt_usage_error(&USAGE, "--step is '%s'; expected 1, 2, 4, 8, 16 or 32", opt_step);
    }
    if ((opt_size != NULL) && !evt_parse_size(opt_size, &width_px, &height_px)) {
        return evt_usage_error(&USAGE, "--size is '%s'; expected WIDTHxHEIGHT, such as 240x180, up to 2048x2048",
                               opt_size);
    }
    if ((opt_name != NULL) && !is_c_name(opt_name)) {
        return evt_usage_error(&USAGE, "--name is '%s'; expected a short C name", opt_name);
    }

    make_name((opt_name != NULL) ? opt_name : opt_out, name);
    if (evh_same_file(words[0], opt_out)) {
        (void)evh_fail(&err, "%s: the output would overwrite the input", opt_out);
    } else if (read_calib(words[0], &calib, &err)) {
        if (opt_size != NULL) {
            calib.width_px = width_px;
            calib.height_px = height_px;
        } else if ((calib.width_px == 0u) || (calib.height_px == 0u)) {
            calib.width_px = 240u;
            calib.height_px = 180u;
            evh_note("%s does not say the sensor size: 240x180 is taken; --size says otherwise", words[0]);
        }
        if (make_table(&calib, words[0], opt_out, name, (uint16_t)step_px, &err)) { return EVT_EXIT_OK; }
    }
    (void)fprintf(stderr, "evstab lut: %s\n", err.text);
    return EVT_EXIT_FAILED;
}
