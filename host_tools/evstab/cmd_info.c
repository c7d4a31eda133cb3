/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* evstab info: what a recording holds. Everything is read through the same readers as replay uses, so what info counts
 * is what replay will see. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "calib.h"
#include "command.h"
#include "config_yaml.h"
#include "decimal.h"
#include "detect.h"
#include "events_text.h"
#include "imu_text.h"
#include "options.h"
#include "poses_text.h"
#include "progress.h"
#include "recording.h"

#define BLOCK_EVENTS 16384u

static const char *opt_size;
static const char *opt_order;
static bool opt_quiet;

static const evt_option_t OPTIONS[] = {
    {"size", '\0', "WxH",
     "Sensor size in pixels: events outside it are counted.\nDefault: any pixel up to 2048 counts.", &opt_size, NULL},
    {"imu-order", '\0', "ORDER",
     "accel-first, gyro-first or a list of columns\nsuch as t,gx,gy,gz,ax,ay,az (\"_\" skips one).", &opt_order, NULL},
    {"quiet", 'q', NULL, "No progress and no notes.", NULL, &opt_quiet},
};

static const evt_usage_t USAGE = {
    .command = "info",
    .synopsis = "FILE|FOLDER [options]",
    .about = "Tells what a recording holds: format, counts, duration, rates, and every line that cannot be used.\n"
             "FOLDER is in ECD form (events.txt imu.txt groundtruth.txt calib.txt images.txt) or EuRoC form;\n"
             "FILE is one of these, events or samples in text, plain or gzip, or a YAML parameter file.",
    .examples = "  evstab info slider_depth\n  evstab info shapes_rotation/imu.txt",
    .options = OPTIONS,
    .n_options = sizeof OPTIONS / sizeof OPTIONS[0],
    .n_words_min = 1u,
    .n_words_max = 1u,
};

static void print_label(const char *label, const char *path) { (void)printf("%-9s %s", label, path); }

static void print_span(int64_t first_us, int64_t last_us)
{
    char text[32];
    size_t n = evh_decimal_format(text, last_us - first_us, 6u);
    (void)printf(", %.*s s", (int)n, text);
    n = evh_decimal_format(text, first_us, 6u);
    (void)printf(" (%.*s ..", (int)n, text);
    n = evh_decimal_format(text, last_us, 6u);
    (void)printf(" %.*s)", (int)n, text);
}

static void print_skipped(const evh_tally_t *tally)
{
    char text[1024];
    evh_tally_text(tally, "it", text, sizeof text);
    if (text[0] != '\0') { (void)printf("          %s\n", text); }
}

static bool info_events(const char *path, uint16_t width_px, uint16_t height_px, evh_error_t *err)
{
    static evs_event_t ev[BLOCK_EVENTS];
    static int64_t t_us[BLOCK_EVENTS];
    evh_event_source_t *const source = evh_events_text_open(path, width_px, height_px, err);
    evt_progress_t progress;
    uint64_t n = 0u;
    uint64_t n_on = 0u;
    uint64_t n_same_time = 0u;
    int64_t first_us = 0;
    int64_t last_us = 0;
    uint16_t x_max = 0u;
    uint16_t y_max = 0u;
    ssize_t got;

    if (source == NULL) { return false; }
    evt_progress_start(&progress);
    while ((got = source->read(source, ev, t_us, BLOCK_EVENTS, err)) > 0) {
        if (n == 0u) { first_us = t_us[0]; }
        for (size_t i = 0u; i < (size_t)got; i++) {
            const uint16_t x = evs_event_x_px(ev[i]);
            const uint16_t y = evs_event_y_px(ev[i]);
            x_max = (x > x_max) ? x : x_max;
            y_max = (y > y_max) ? y : y_max;
            n_on += evs_event_brighter(ev[i]) ? 1u : 0u;
            n_same_time += ((n + i > 0u) && (t_us[i] == last_us)) ? 1u : 0u;
            last_us = t_us[i];
        }
        n += (uint64_t)got;
        evt_progress_update(&progress, source->fraction(source), n, "events");
    }
    evt_progress_end(&progress);
    print_label("events", path);
    (void)printf(": %s, %" PRIu64 " events", source->format, n);
    if (n > 0u) {
        print_span(first_us, last_us);
        if (last_us > first_us) { (void)printf(", %.0f events/s", (double)n * 1e6 / (double)(last_us - first_us)); }
        (void)printf(
            "\n          x up to %u, y up to %u; %.1f %% brighter; %.1f %% share their time with the one before",
            (unsigned)x_max, (unsigned)y_max, 100.0 * (double)n_on / (double)n,
            100.0 * (double)n_same_time / (double)n);
    }
    (void)printf("\n");
    print_skipped(&source->tally);
    source->close(source);
    if ((got == 0) && (n == 0u)) { return evh_fail(err, "%s: holds no event", path); }
    return got == 0;
}

static bool info_imu(const char *path, const evh_imu_order_t *order, evh_error_t *err)
{
    evh_imu_t imu;
    evh_imu_sample_t s;
    double sum_a = 0.0;
    double max_g = 0.0;
    uint64_t n = 0u;
    uint64_t n_mag = 0u;
    int64_t first_us = 0;
    int64_t last_us = 0;
    int64_t gap_us = 0;

    if (!evh_imu_open(&imu, path, order, err)) { return false; }
    while (evh_imu_next(&imu, &s, err)) {
        const double g = sqrt(s.gyro_rad_s[0] * s.gyro_rad_s[0] + s.gyro_rad_s[1] * s.gyro_rad_s[1] +
                              s.gyro_rad_s[2] * s.gyro_rad_s[2]);
        sum_a += sqrt(s.accel_m_s2[0] * s.accel_m_s2[0] + s.accel_m_s2[1] * s.accel_m_s2[1] +
                      s.accel_m_s2[2] * s.accel_m_s2[2]);
        max_g = (g > max_g) ? g : max_g;
        n_mag += s.has_mag ? 1u : 0u;
        if (n == 0u) { first_us = s.t_us; }
        if ((n > 0u) && (s.t_us - last_us > gap_us)) { gap_us = s.t_us - last_us; }
        last_us = s.t_us;
        n++;
    }
    print_label("imu", path);
    (void)printf(": %" PRIu64 " samples", n);
    if (n > 0u) {
        print_span(first_us, last_us);
        if (last_us > first_us) { (void)printf(", %.1f Hz", (double)(n - 1u) * 1e6 / (double)(last_us - first_us)); }
        (void)printf("\n          longest gap %.1f ms; mean |a| %.2f m/s^2; largest rate %.2f rad/s; %s",
                     (double)gap_us * 1e-3, sum_a / (double)n, max_g,
                     (n_mag > 0u) ? "with magnetometer" : "no magnetometer");
    }
    (void)printf("\n");
    print_skipped(&imu.rows.tally);
    evh_imu_close(&imu);
    if (err->text[0] != '\0') { return false; }
    return (n > 0u) || evh_fail(err, "%s: holds no usable sample", path);
}

static bool info_poses(const char *path, evh_error_t *err)
{
    evh_poses_t poses;
    if (!evh_poses_read(&poses, path, err)) { return false; }
    print_label("poses", path);
    (void)printf(": %zu poses", poses.n);
    if (poses.n > 0u) {
        const int64_t first_us = poses.pose[0].t_us;
        const int64_t last_us = poses.pose[poses.n - 1u].t_us;
        print_span(first_us, last_us);
        if (last_us > first_us) {
            (void)printf(", %.1f Hz", (double)(poses.n - 1u) * 1e6 / (double)(last_us - first_us));
        }
    }
    (void)printf("\n");
    print_skipped(&poses.tally);
    evh_poses_free(&poses);
    return true;
}

static void print_calib(const evh_calib_t *c)
{
    (void)printf(": %s, fx %g fy %g cx %g cy %g", c->fisheye ? "equidistant fisheye" : "pinhole", c->fx_px, c->fy_px,
                 c->cx_px, c->cy_px);
    if (c->width_px > 0u) { (void)printf(", %ux%u px", (unsigned)c->width_px, (unsigned)c->height_px); }
    (void)printf("\n          distortion %g %g %g %g %g\n", c->dist[0], c->dist[1], c->dist[2], c->dist[3], c->dist[4]);
}

static bool info_calib(const char *path, evh_error_t *err)
{
    evh_calib_t calib;
    if (!evh_calib_text_read(&calib, path, err)) { return false; }
    print_label("calib", path);
    print_calib(&calib);
    return true;
}

static bool info_config(const char *path, evh_error_t *err)
{
    evh_config_t config;
    if (!evh_config_read(&config, path, err)) { return false; }
    print_label("config", path);
    if (config.has_calib) {
        print_calib(&config.calib);
    } else {
        (void)printf(": no camera in it\n");
    }
    if (config.has_q_ci) {
        (void)printf("          camera from IMU (w x y z): %.6f %.6f %.6f %.6f\n", config.q_ci_wxyz[0],
                     config.q_ci_wxyz[1], config.q_ci_wxyz[2], config.q_ci_wxyz[3]);
    }
    return true;
}

static bool info_images(const char *path, evh_error_t *err)
{
    evh_lines_t lines;
    evh_line_t line;
    uint64_t n = 0u;
    if (!evh_lines_open(&lines, path, err)) { return false; }
    while (evh_lines_next(&lines, &line, err)) { n += ((line.length > 0u) && (line.text[0] != '#')) ? 1u : 0u; }
    evh_lines_close(&lines);
    print_label("images", path);
    (void)printf(": %" PRIu64 " listed\n", n);
    return err->text[0] == '\0';
}

static bool info_file(const char *path, uint16_t width_px, uint16_t height_px, const evh_imu_order_t *order,
                      evh_error_t *err)
{
    evh_kind_t kind = EVH_KIND_UNKNOWN;
    if (!evh_detect(path, &kind, err)) { return false; }
    switch (kind) {
    case EVH_KIND_EVENTS:
        return info_events(path, width_px, height_px, err);
    case EVH_KIND_IMU:
        return info_imu(path, order, err);
    case EVH_KIND_POSES:
        return info_poses(path, err);
    case EVH_KIND_CALIB:
        return info_calib(path, err);
    case EVH_KIND_CONFIG:
        return info_config(path, err);
    case EVH_KIND_IMAGES:
        return info_images(path, err);
    case EVH_KIND_EMPTY:
        return evh_fail(err, "%s: the file is empty", path);
    case EVH_KIND_UNKNOWN:
        break;
    }
    return evh_fail(err, "%s: unknown format; known are event text (t x y p), IMU and pose tables, calib.txt and YAML",
                    path);
}

/* Each part on its own: one that is damaged does not hide the others. */
static int finish_part(bool ok, evh_error_t *err)
{
    if (ok) { return EVT_EXIT_OK; }
    (void)fflush(stdout);
    (void)fprintf(stderr, "evstab info: %s\n", err->text);
    err->text[0] = '\0';
    return EVT_EXIT_FAILED;
}

static void print_missing(const evh_recording_t *rec)
{
    const struct {
        bool missing;
        const char *name;
    } parts[] = {{rec->events == NULL, "events"},
                 {rec->imu == NULL, "imu"},
                 {rec->poses == NULL, "poses"},
                 {(rec->calib == NULL) && (rec->config == NULL), "calibration"},
                 {rec->images == NULL, "images"}};
    const char *before = "not there ";
    for (size_t i = 0u; i < sizeof parts / sizeof parts[0]; i++) {
        if (!parts[i].missing) { continue; }
        (void)printf("%s%s", before, parts[i].name);
        before = ", ";
    }
    if (before[0] == ',') { (void)printf("\n"); }
}

static int info_folder(const evh_recording_t *rec, uint16_t width_px, uint16_t height_px, const evh_imu_order_t *order)
{
    evh_error_t err = {""};
    int status = EVT_EXIT_OK;
    if (rec->events != NULL) { status |= finish_part(info_events(rec->events, width_px, height_px, &err), &err); }
    if (rec->imu != NULL) { status |= finish_part(info_imu(rec->imu, order, &err), &err); }
    if (rec->poses != NULL) { status |= finish_part(info_poses(rec->poses, &err), &err); }
    if (rec->calib != NULL) { status |= finish_part(info_calib(rec->calib, &err), &err); }
    if (rec->config != NULL) { status |= finish_part(info_config(rec->config, &err), &err); }
    if (rec->images != NULL) { status |= finish_part(info_images(rec->images, &err), &err); }
    print_missing(rec);
    return status;
}

int evt_info_main(int argc, char **argv)
{
    const char *words[1];
    uint16_t width_px = EVS_SENSOR_MAX_PX;
    uint16_t height_px = EVS_SENSOR_MAX_PX;
    evh_imu_order_t order = {.kind = EVH_IMU_ORDER_AUTO};
    evh_recording_t rec;
    evh_error_t err = {""};
    int status = EVT_EXIT_OK;

    if (!evt_options_parse(&USAGE, argc, argv, words, &status)) { return status; }
    if ((opt_size != NULL) && !evt_parse_size(opt_size, &width_px, &height_px)) {
        return evt_usage_error(&USAGE, "--size is '%s'; expected WIDTHxHEIGHT, such as 240x180, up to 2048x2048",
                               opt_size);
    }
    if ((opt_order != NULL) && !evh_imu_order_parse(opt_order, &order)) {
        return evt_usage_error(
            &USAGE, "--imu-order is '%s'; expected accel-first, gyro-first or columns t,ax,ay,az,gx,gy,gz in any order",
            opt_order);
    }
    evh_set_quiet(opt_quiet);
    if (!evh_is_folder(words[0])) { return finish_part(info_file(words[0], width_px, height_px, &order, &err), &err); }
    if (!evh_recording_find(&rec, words[0], &err)) { return finish_part(false, &err); }
    if ((rec.events == NULL) && (rec.images == NULL) && (rec.imu == NULL) && (rec.poses == NULL)) {
        evh_fail(&err,
                 "%s: no recording in this folder; expected events.txt or images.txt (ECD form) or cam0 and imu0 "
                 "(EuRoC form)",
                 words[0]);
        status = finish_part(false, &err);
    } else {
        status = info_folder(&rec, width_px, height_px, &order);
    }
    evh_recording_free(&rec);
    return status;
}
