/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include "output.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "csv_writer.h"
#include "decimal.h"
#include "image_file.h"
#include "imu.h"
#include "recording.h"

#define TRUTH_PERIOD_NS INT64_C(5000000)
#define EVENT_BYTES_MAX 64u

static bool remove_old(const char *dir, const char *name)
{
    char *const path = evh_path_join(dir, name);
    const bool removed = (path != NULL) && (unlink(path) == 0);
    free(path);
    return removed;
}

#define FRAME_NAME_MAX 64u

static void frame_name(char name[FRAME_NAME_MAX], uint64_t n)
{
    (void)snprintf(name, FRAME_NAME_MAX, "images/frame_%08" PRIu64 ".png", n);
}

/* Frames of an earlier, longer flight would outlive this one. */
static void remove_old_frames(const char *dir)
{
    char name[FRAME_NAME_MAX];
    uint64_t n = 0u;
    do {
        frame_name(name, n);
        n++;
    } while (remove_old(dir, name));
}

bool evsim_output_open(evsim_output_t *out, const char *dir, const evsim_settings_t *settings, evh_error_t *err)
{
    memset(out, 0, sizeof *out);
    out->dir = dir;
    out->frames = settings->frames;
    if (!evh_make_folder(dir, err)) { return false; }
    (void)remove_old(dir, settings->gz ? "events.txt" : "events.txt.gz"); /* A reader must not find two recordings. */
    (void)remove_old(dir, "images.txt");
    remove_old_frames(dir);
    if (!evsim_text_open(&out->events, dir, settings->gz ? "events.txt.gz" : "events.txt", settings->gz, err)) {
        return false;
    }
    if (settings->frames) {
        char *const images = evh_path_join(dir, "images");
        const bool ok = (images != NULL) && evh_make_folder(images, err);
        free(images);
        return ok && evsim_text_open(&out->images, dir, "images.txt", false, err);
    }
    return true;
}

static bool write_poses(const char *dir, const evsim_settings_t *settings, const evsim_motion_t *motion,
                        evh_error_t *err)
{
    evsim_text_t poses;
    evsim_text_t velocity;
    bool ok;
    if (!evsim_text_open(&poses, dir, "groundtruth.txt", false, err)) { return false; }
    if (!evsim_text_open(&velocity, dir, "velocity.txt", false, err)) {
        (void)evsim_text_close(&poses, err);
        return false;
    }
    for (int64_t t_ns = 0; t_ns <= settings->duration_us * 1000; t_ns += TRUTH_PERIOD_NS) {
        evsim_state_t s;
        evsim_motion_at(motion, (double)t_ns * 1e-9, &s);
        evsim_text_row(&poses, t_ns,
                       (const double[7]){s.p_w_m.v[0], s.p_w_m.v[1], s.p_w_m.v[2], s.q_wc.q[1], s.q_wc.q[2],
                                         s.q_wc.q[3], s.q_wc.q[0]},
                       7u);
        evsim_text_row(&velocity, t_ns,
                       (const double[6]){s.v_c_m_s.v[0], s.v_c_m_s.v[1], s.v_c_m_s.v[2], s.w_c_rad_s.v[0],
                                         s.w_c_rad_s.v[1], s.w_c_rad_s.v[2]},
                       6u);
    }
    ok = evsim_text_close(&poses, err);
    return evsim_text_close(&velocity, err) && ok;
}

static bool write_imu(const char *dir, const evsim_settings_t *settings, const evsim_motion_t *motion, evh_error_t *err)
{
    evsim_text_t text;
    evsim_imu_t imu;
    if (!evsim_text_open(&text, dir, "imu.txt", false, err)) { return false; }
    evsim_imu_init(&imu, &settings->imu, motion, settings->seed);
    for (uint64_t k = 0u;; k++) {
        const int64_t t_ns = (int64_t)((double)k / settings->imu.rate_hz * 1e9 + 0.5);
        evsim_imu_sample_t s;
        if (t_ns > settings->duration_us * 1000) { break; }
        evsim_imu_next(&imu, t_ns, &s);
        evsim_text_row(&text, t_ns,
                       (const double[6]){s.accel_m_s2[0], s.accel_m_s2[1], s.accel_m_s2[2], s.gyro_rad_s[0],
                                         s.gyro_rad_s[1], s.gyro_rad_s[2]},
                       6u);
    }
    return evsim_text_close(&text, err);
}

static bool write_calib(const char *dir, const evh_calib_t *c, evh_error_t *err)
{
    evsim_text_t text;
    char *p;
    if (!evsim_text_open(&text, dir, "calib.txt", false, err)) { return false; }
    p = evsim_text_reserve(&text, 512u);
    p += snprintf(p, 512u, "%.12g %.12g %.12g %.12g %.12g %.12g %.12g %.12g %.12g\n", c->fx_px, c->fy_px, c->cx_px,
                  c->cy_px, c->dist[0], c->dist[1], c->dist[2], c->dist[3], c->dist[4]);
    evsim_text_advance(&text, p);
    return evsim_text_close(&text, err);
}

bool evsim_output_truth(const char *dir, const evsim_settings_t *settings, const evsim_motion_t *motion,
                        evh_error_t *err)
{
    return write_calib(dir, &settings->calib, err) && write_poses(dir, settings, motion, err) &&
           write_imu(dir, settings, motion, err);
}

void evsim_output_events(evsim_output_t *out, const evsim_event_t *event, size_t n, int64_t base_us)
{
    for (size_t i = 0u; i < n; i++) {
        const bool brighter = (event[i].y_px & 0x8000u) != 0u;
        char *p = evsim_text_reserve(&out->events, EVENT_BYTES_MAX);
        p = evh_put_time_us(p, base_us + event[i].t_us);
        p = evh_put_text(p, "000 ");
        p = evh_put_uint(p, event[i].x_px);
        *p++ = ' ';
        p = evh_put_uint(p, event[i].y_px & 0x7FFFu);
        p = evh_put_text(p, brighter ? " 1\n" : " 0\n");
        evsim_text_advance(&out->events, p);
        out->n_on += brighter ? 1u : 0u;
    }
    out->n_events += n;
}

bool evsim_output_frame(evsim_output_t *out, int64_t t_ns, const uint8_t *gray, unsigned width_px, unsigned height_px,
                        evh_error_t *err)
{
    char name[FRAME_NAME_MAX];
    char *path;
    char *p;
    bool ok;
    frame_name(name, out->n_frames);
    path = evh_path_join(out->dir, name);
    if (path == NULL) { return evh_fail(err, "out of memory"); }
    ok = evsim_image_write_png(path, gray, width_px, height_px, err);
    free(path);
    if (!ok) { return false; }
    p = evsim_text_reserve(&out->images, 128u);
    p += evh_decimal_format(p, t_ns, 9u);
    *p++ = ' ';
    p = evh_put_text(p, name);
    *p++ = '\n';
    evsim_text_advance(&out->images, p);
    out->n_frames++;
    return true;
}

bool evsim_output_close(evsim_output_t *out, evh_error_t *err)
{
    bool ok = evsim_text_close(&out->events, err);
    return evsim_text_close(&out->images, err) && ok;
}
