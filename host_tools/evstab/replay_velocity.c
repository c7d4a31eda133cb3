/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include "replay_velocity.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "decimal.h"
#include "evs/float.h"
#include "lines.h"
#include "png_bytes.h"
#include "to_device.h"
#include "velocity_error.h"

#define FRAME_NAME_MAX 24u

/* --- opening --------------------------------------------------------------------------------------------------------
 */

static void frame_name(char name[FRAME_NAME_MAX], uint32_t window)
{
    (void)snprintf(name, FRAME_NAME_MAX, "%08" PRIu32 ".png", window);
}

/* Those of an earlier run: beside the new ones nobody could tell them apart. Not every window had one. */
static void remove_old_frames(const char *dir)
{
    char *const list = evh_path_join(dir, "frames.csv");
    evh_lines_t lines;
    evh_line_t line;
    evh_error_t ignored = {""};
    if ((list != NULL) && evh_file_exists(list) && evh_lines_open(&lines, list, &ignored)) {
        while (evh_lines_next(&lines, &line, &ignored)) {
            char name[FRAME_NAME_MAX];
            const char *number = line.text;
            int64_t window = 0;
            if (evh_decimal_parse(&number, line.text + line.length, 0, &window, NULL) && (window >= 0) &&
                (window <= (int64_t)UINT32_MAX)) {
                char *path;
                frame_name(name, (uint32_t)window);
                path = evh_path_join(dir, name);
                if (path != NULL) { (void)unlink(path); }
                free(path);
            }
        }
        evh_lines_close(&lines);
    }
    free(list);
}

static bool open_frames(evt_velocity_log_t *log, const char *dir, evh_error_t *err)
{
    log->frames_dir = evh_path_join(dir, "frames");
    if (log->frames_dir == NULL) { return evh_fail(err, "out of memory"); }
    if (!evh_make_folder(log->frames_dir, err)) { return false; }
    remove_old_frames(log->frames_dir);
    log->has_frames = evh_csv_open(&log->frames, log->frames_dir, "frames.csv", "#window,t_s,file", err);
    return log->has_frames;
}

/* The poses of the recording, for the report alone: without them it has no truth. */
static void read_truth(evt_velocity_log_t *log)
{
    const evt_replay_t *const r = log->r;
    evh_error_t why = {""};
    if ((log->report == NULL) || (r->rec.poses == NULL) || !evh_file_is_regular(r->rec.poses)) { return; }
    if (!evh_poses_read(&log->truth, r->rec.poses, &why)) {
        evh_note("no truth in the report: %s", why.text);
        return;
    }
    if (r->attitude == EVT_ATTITUDE_TRUTH) {
        for (size_t i = 0u; i < log->truth.n; i++) { log->truth.pose[i].t_us += r->pipeline.track.offset_us; }
    }
}

/* What an earlier run measured must not stand beside what this one did not. */
static void remove_old(const char *dir, const char *name)
{
    char *const path = evh_path_join(dir, name);
    if (path != NULL) { (void)unlink(path); }
    free(path);
}

bool evt_velocity_log_open(evt_velocity_log_t *log, const evt_replay_t *r, const char *dir, evr_report_t *report,
                           evt_replay_velocity_counts_t *counts, evh_error_t *err)
{
    const evs_pipeline_config_t *const p = &r->pipeline;
    memset(log, 0, sizeof *log);
    log->r = r;
    log->report = report;
    log->counts = counts;
    remove_old(dir, "velocity.csv");
    remove_old(dir, "pairs.csv");
    if (r->write_frames && !open_frames(log, dir, err)) { return false; }
    if (!p->velocity_on) { return true; }
    log->image = malloc((size_t)p->camera.width_px * p->camera.height_px);
    log->arrows = malloc(EVS_EGOMOTION_N_MAX * sizeof *log->arrows);
    if ((log->image == NULL) || (log->arrows == NULL)) { return evh_fail(err, "out of memory"); }
    log->has_velocity =
        evh_csv_open(&log->velocity, dir, "velocity.csv", "#t_s,vx,vy,vz,sigma_deg,n_flow,n_inliers", err);
    if (!log->has_velocity) { return false; }
    log->has_pairs = evh_csv_open(&log->pairs, dir, "pairs.csv",
                                  "#t_s,interval_s,result,flow_px,n_corners,n_flow,n_inliers,saccade", err);
    if (log->has_pairs) { read_truth(log); }
    return log->has_pairs;
}

/* --- windows --------------------------------------------------------------------------------------------------------
 */

static bool write_file(const char *path, const uint8_t *bytes, size_t n, evh_error_t *err)
{
    FILE *const f = fopen(path, "wb");
    bool ok;
    if (f == NULL) { return evh_fail(err, "%s: cannot write: %s", path, strerror(errno)); }
    ok = (fwrite(bytes, 1u, n, f) == n);
    ok = (fclose(f) == 0) && ok;
    return ok || evh_fail(err, "%s: cannot write: %s", path, strerror(errno));
}

static bool write_frame(evt_velocity_log_t *log, const evs_pipeline_chunk_t *chunk, int64_t t_us, evh_error_t *err)
{
    char name[FRAME_NAME_MAX];
    char *path;
    evr_png_t png;
    char *p;
    bool ok;
    frame_name(name, chunk->end.index);
    path = evh_path_join(log->frames_dir, name);
    if ((path == NULL) || !evr_png_encode(&png, chunk->image.px, chunk->image.width_px, chunk->image.height_px, 8)) {
        free(path);
        return evh_fail(err, "%s/%s: out of memory", log->frames_dir, name);
    }
    ok = write_file(path, png.bytes, png.n, err);
    free(png.bytes);
    free(path);
    p = evh_put_uint(evh_csv_reserve(&log->frames, 96u), chunk->end.index);
    *p++ = ',';
    p = evh_put_time_us(p, t_us);
    *p++ = ',';
    p = evh_put_text(p, name);
    *p++ = '\n';
    evh_csv_advance(&log->frames, p);
    return ok;
}

/* Host time of a device time that is less than 35 min from a known one. */
static int64_t near(int64_t known_us, uint32_t t_us)
{
    return known_us + evs_time_diff_us(t_us, evt_time_us(known_us));
}

bool evt_velocity_log_window(evt_velocity_log_t *log, const evs_pipeline_chunk_t *chunk, int64_t t_last_us,
                             evh_error_t *err)
{
    if (chunk->image.px == NULL) { return true; }
    log->image_us = near(t_last_us, chunk->image_t_us);
    if (log->image != NULL) {
        memcpy(log->image, chunk->image.px, (size_t)chunk->image.width_px * chunk->image.height_px);
    }
    return !log->has_frames || write_frame(log, chunk, log->image_us, err);
}

/* --- pairs ----------------------------------------------------------------------------------------------------------
 */

static bool is_good(const evs_velocity_result_t *pair)
{
    return ((pair->flags & EVS_VELOCITY_VALID) != 0u) && ((pair->flags & EVS_VELOCITY_NO_ORIENTATION) == 0u);
}

/* The first thing that is in the way. */
static const char *result_name(const evs_velocity_result_t *pair)
{
    if (is_good(pair)) { return "valid"; }
    if ((pair->flags & EVS_VELOCITY_FEW) != 0u) { return "few"; }
    if ((pair->flags & EVS_VELOCITY_STILL) != 0u) { return "still"; }
    if ((pair->flags & EVS_VELOCITY_UNSOLVED) == 0u) { return "no_orientation"; }
    if ((pair->solution.flags & EVS_EGOMOTION_CHANCE) != 0u) { return "chance"; }
    if ((pair->solution.flags & EVS_EGOMOTION_ROTATION) != 0u) { return "rotation"; }
    if ((pair->solution.flags & EVS_EGOMOTION_SIGN_UNSURE) != 0u) { return "sign_unsure"; }
    if ((pair->solution.flags & EVS_EGOMOTION_DEGENERATE) != 0u) { return "degenerate"; }
    return "unsolved";
}

static void count(evt_replay_velocity_counts_t *c, const evs_velocity_result_t *pair)
{
    c->n_pairs++;
    c->n_turned += ((pair->flags & EVS_VELOCITY_TURNED) != 0u) ? 1u : 0u;
    if (is_good(pair)) {
        c->n_valid++;
        c->flow_sum += pair->n_flow;
        c->inlier_sum += pair->solution.n_inliers;
        c->flow_px_sum += pair->flow_px_q8 / 256.0;
        c->interval_us_sum += pair->interval_us;
    } else if ((pair->flags & EVS_VELOCITY_FEW) != 0u) {
        c->n_few++;
    } else if ((pair->flags & EVS_VELOCITY_STILL) != 0u) {
        c->n_still++;
    } else if ((pair->flags & EVS_VELOCITY_UNSOLVED) != 0u) {
        c->n_unsolved++;
    } else {
        c->n_no_orientation++;
    }
}

static char *put_comma_uint(char *p, uint64_t value)
{
    *p++ = ',';
    return evh_put_uint(p, value);
}

static void write_velocity(evh_csv_t *csv, const evt_velocity_row_t *row)
{
    const evs_vec3_t v = row->pair.v_c_q30;
    const int32_t part[3] = {v.x, v.y, v.z};
    char sigma[32];
    char *p = evh_put_time_us(evh_csv_reserve(csv, 192u), row->t_us);
    for (int i = 0; i < 3; i++) {
        *p++ = ',';
        p = evh_put_q(p, part[i], 30u, 9u);
    }
    (void)snprintf(sigma, sizeof sigma, ",%.4f",
                   evs_q_to_double(row->pair.solution.sigma_rad_q28, 28u) * EVL_DEG_PER_RAD);
    p = evh_put_text(p, sigma);
    p = put_comma_uint(p, row->pair.n_flow);
    p = put_comma_uint(p, row->pair.solution.n_inliers);
    *p++ = '\n';
    evh_csv_advance(csv, p);
}

static void write_pair(evh_csv_t *csv, const evt_velocity_row_t *row)
{
    const evs_velocity_result_t *const pair = &row->pair;
    char flow[32];
    char *p = evh_put_time_us(evh_csv_reserve(csv, 192u), row->t_us);
    *p++ = ',';
    p = evh_put_time_us(p, pair->interval_us);
    *p++ = ',';
    p = evh_put_text(p, result_name(pair));
    (void)snprintf(flow, sizeof flow, ",%.3f", pair->flow_px_q8 / 256.0);
    p = evh_put_text(p, flow);
    p = put_comma_uint(p, pair->n_corners);
    p = put_comma_uint(p, pair->n_flow);
    p = put_comma_uint(p, pair->solution.n_inliers);
    p = put_comma_uint(p, ((pair->flags & EVS_VELOCITY_TURNED) != 0u) ? 1u : 0u);
    *p++ = '\n';
    evh_csv_advance(csv, p);
}

/* Write what waits and is older than `until_us`: nothing earlier can come. */
static void write_until(evt_velocity_log_t *log, int64_t until_us)
{
    size_t n = 0u;
    while ((n < log->n_waiting) && (log->waiting[n].t_us < until_us)) {
        write_pair(&log->pairs, &log->waiting[n]);
        if (is_good(&log->waiting[n].pair)) { write_velocity(&log->velocity, &log->waiting[n]); }
        n++;
    }
    log->n_waiting -= n;
    if (n > 0u) { memmove(log->waiting, log->waiting + n, log->n_waiting * sizeof *log->waiting); }
}

/* Two of the same microsecond would be no order: the newer one counts. */
static bool wait_for_order(evt_velocity_log_t *log, const evt_velocity_row_t *row, evh_error_t *err)
{
    size_t at = log->n_waiting;
    while ((at > 0u) && (log->waiting[at - 1u].t_us >= row->t_us)) { at--; }
    if ((at < log->n_waiting) && (log->waiting[at].t_us == row->t_us)) {
        log->waiting[at] = *row;
        log->counts->n_same_time++;
        return true;
    }
    if (log->n_waiting == log->cap_waiting) {
        const size_t larger = (log->cap_waiting == 0u) ? 64u : 2u * log->cap_waiting;
        evt_velocity_row_t *const grown = realloc(log->waiting, larger * sizeof *grown);
        if (grown == NULL) { return evh_fail(err, "out of memory"); }
        log->waiting = grown;
        log->cap_waiting = larger;
    }
    memmove(log->waiting + at + 1u, log->waiting + at, (log->n_waiting - at) * sizeof *log->waiting);
    log->waiting[at] = *row;
    log->n_waiting++;
    return true;
}

/* --- the report -----------------------------------------------------------------------------------------------------
 */

static void to_doubles(evs_vec3_t v, double out[3])
{
    out[0] = evs_q_to_double(v.x, 30u);
    out[1] = evs_q_to_double(v.y, 30u);
    out[2] = evs_q_to_double(v.z, 30u);
}

static void report_direction(const evt_velocity_log_t *log, const evt_velocity_row_t *row)
{
    evr_direction_t d = {.t_us = row->t_us};
    evl_vec3_t truth = {0.0, 0.0, 0.0};
    to_doubles(row->pair.v_c_q30, d.v);
    d.sigma_rad = evs_q_to_double(row->pair.solution.sigma_rad_q28, 28u);
    if (evl_velocity_over(&log->truth, evl_quat_identity(), row->t_us, row->pair.interval_us, &truth)) {
        d.truth[0] = truth.x;
        d.truth[1] = truth.y;
        d.truth[2] = truth.z;
    }
    evr_report_direction(log->report, &d);
}

/* A track goes from the newest image back to the older one; the arrow shows how the scene came here. */
static void report_flow(const evt_velocity_log_t *log, const evs_pipeline_t *pipeline, const evt_velocity_row_t *row)
{
    const evs_velocity_t *const part = evs_pipeline_velocity_part(pipeline);
    const evs_flow_track_t *tracks = NULL;
    const size_t n_tracks = evs_velocity_tracks(part, &tracks);
    const evh_calib_t *const c = &log->r->calib;
    evr_flow_t flow = {.px = log->image,
                       .t_us = log->image_us,
                       .interval_us = row->pair.interval_us,
                       .fx_px = c->fx_px,
                       .fy_px = c->fy_px,
                       .cx_px = c->cx_px,
                       .cy_px = c->cy_px,
                       .arrows = log->arrows};
    to_doubles(row->pair.v_r_q30, flow.v);
    flow.sigma_rad = evs_q_to_double(row->pair.solution.sigma_rad_q28, 28u);
    for (size_t i = 0u; (i < n_tracks) && (flow.n < EVS_EGOMOTION_N_MAX); i++) {
        const evs_flow_track_t *const track = &tracks[i];
        evr_arrow_t *const a = &log->arrows[flow.n];
        if (track->status != EVS_FLOW_OK) { continue; }
        a->x = track->from.x_q8 / 256.0;
        a->y = track->from.y_q8 / 256.0;
        a->dx = (track->from.x_q8 - track->to.x_q8) / 256.0;
        a->dy = (track->from.y_q8 - track->to.y_q8) / 256.0;
        a->inlier = evs_velocity_track_is_inlier(part, &row->pair, track);
        flow.n++;
    }
    evr_report_flow(log->report, &flow);
}

bool evt_velocity_log_pair(evt_velocity_log_t *log, const evs_pipeline_t *pipeline, const evs_velocity_result_t *pair,
                           evh_error_t *err)
{
    const evt_velocity_row_t row = {near(log->image_us, pair->t_us), *pair};
    count(log->counts, pair);
    if ((log->report != NULL) && is_good(pair)) {
        report_direction(log, &row);
        report_flow(log, pipeline, &row);
    }
    /* The interval of a later pair begins no earlier than the oldest image that may be kept. */
    write_until(log, log->image_us - (int64_t)log->r->pipeline.velocity.keyframes.age_max_us / 2);
    return wait_for_order(log, &row, err);
}

bool evt_velocity_log_close(evt_velocity_log_t *log, evh_error_t *err)
{
    bool ok = true;
    if (log->has_pairs) {
        write_until(log, INT64_MAX);
        ok = evh_csv_close(&log->pairs, err) && ok;
    }
    if (log->has_velocity) { ok = evh_csv_close(&log->velocity, err) && ok; }
    if (log->has_frames) { ok = evh_csv_close(&log->frames, err) && ok; }
    evh_poses_free(&log->truth);
    free(log->waiting);
    free(log->image);
    free(log->arrows);
    free(log->frames_dir);
    return ok;
}
