/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "decimal.h"
#include "detect.h"
#include "evs/float.h"
#include "lines.h"
#include "options.h"
#include "replay.h"
#include "replay_imaging.h"
#include "to_device.h"

#define DEFAULT_WIDTH_PX  240u /* The DAVIS240C of the Event Camera Dataset. */
#define DEFAULT_HEIGHT_PX 180u

/* Room to work in. The output does not depend on it: orientations are always pushed ahead of the events. */
#define N_FIFO  16384u
#define N_RING  1024u
#define N_BATCH 1024u

#define IMU_OFFSET_MAX_US 10000000

static const char *const ATTITUDES[] = {[EVT_ATTITUDE_NONE] = "none",
                                        [EVT_ATTITUDE_IMU] = "imu",
                                        [EVT_ATTITUDE_GYRO] = "gyro",
                                        [EVT_ATTITUDE_TRUTH] = "truth"};

const char *evt_attitude_name(evt_attitude_t attitude) { return ATTITUDES[attitude]; }

/* A window that somebody asked for closes when they said, and not for its length. */
static void no_limits(evs_window_config_t *w)
{
    w->min_duration_us = 0u;
    w->max_duration_us = EVS_WINDOW_DURATION_MAX_US;
}

/* "200" or "200:5-50": the number, and the shortest and longest duration in ms. */
static bool parse_threshold(const char *text, int64_t most, evs_window_config_t *w)
{
    const char *const end = text + strlen(text);
    bool exact = false;
    int64_t value = 0;
    int64_t low_us = 0;
    int64_t high_us = EVS_WINDOW_DURATION_MAX_US;
    if (!evh_decimal_parse(&text, end, 0, &value, &exact) || !exact || (value < 1) || (value > most)) { return false; }
    if (text != end) {
        if (*text++ != ':') { return false; }
        if (!evh_decimal_parse(&text, end, 3, &low_us, NULL) || (text == end) || (*text++ != '-')) { return false; }
        if (!evh_decimal_parse(&text, end, 3, &high_us, NULL) || (text != end)) { return false; }
        if ((low_us < 0) || (high_us < 1) || (high_us < low_us) || (high_us > (int64_t)EVS_WINDOW_DURATION_MAX_US)) {
            return false;
        }
    }
    w->threshold = (uint32_t)value;
    w->min_duration_us = (uint32_t)low_us;
    w->max_duration_us = (uint32_t)high_us;
    return true;
}

/* "area:34x26:200", "area:34x26:500:5-50", "count:30000", "time:10000" */
static bool parse_window(const char *text, evs_pipeline_config_t *p)
{
    char size[24];
    int64_t value = 0;
    if (strncmp(text, "count:", 6u) == 0) {
        p->window.kind = EVS_WINDOW_COUNT;
        return parse_threshold(text + 6, EVS_WINDOW_COUNT_MAX, &p->window);
    }
    if (strncmp(text, "time:", 5u) == 0) {
        if (!evt_parse_int(text + 5, 1, EVS_WINDOW_DURATION_MAX_US, &value)) { return false; }
        p->window.kind = EVS_WINDOW_DURATION;
        p->window.duration_us = (uint32_t)value;
        return true;
    }
    if (strncmp(text, "area:", 5u) == 0) {
        const size_t length = strcspn(text + 5, ":");
        if ((length >= sizeof size) || (text[5u + length] != ':')) { return false; }
        memcpy(size, text + 5, length);
        size[length] = '\0';
        p->window.kind = EVS_WINDOW_AREA;
        return evt_parse_size(size, &p->n_cols, &p->n_rows) &&
               parse_threshold(text + 6u + length, EVS_WINDOW_AREA_MAX, &p->window);
    }
    return false;
}

static void apply_config_window(const evh_config_t *c, evs_pipeline_config_t *p)
{
    const uint64_t n_before = (uint64_t)p->n_cols * p->n_rows;
    if (c->has_columns) { p->n_cols = (uint16_t)c->n_columns; }
    if ((c->window_kind == EVH_WINDOW_COUNT) || (c->window_kind == EVH_WINDOW_TIME) || c->has_roi_threshold) {
        no_limits(&p->window);
    }
    if (c->has_rows) { p->n_rows = (uint16_t)c->n_rows; }
    switch (c->window_kind) {
    case EVH_WINDOW_COUNT:
        p->window.kind = EVS_WINDOW_COUNT;
        break;
    case EVH_WINDOW_TIME:
        p->window.kind = EVS_WINDOW_DURATION;
        break;
    case EVH_WINDOW_AREA:
        p->window.kind = EVS_WINDOW_AREA;
        break;
    case EVH_WINDOW_UNSET:
        break;
    }
    if ((p->window.kind == EVS_WINDOW_AREA) && !c->has_roi_threshold) { /* As many events per pixel of a tile. */
        const uint64_t scaled = p->window.threshold * n_before / ((uint64_t)p->n_cols * p->n_rows);
        p->window.threshold = (uint32_t)((scaled < 1u)                    ? 1u
                                         : (scaled > EVS_WINDOW_AREA_MAX) ? EVS_WINDOW_AREA_MAX
                                                                          : scaled);
    }
    if ((p->window.kind == EVS_WINDOW_AREA) && c->has_roi_threshold) {
        p->window.threshold =
            (uint32_t)((c->roi_threshold > EVS_WINDOW_AREA_MAX) ? EVS_WINDOW_AREA_MAX : c->roi_threshold);
    }
    if ((p->window.kind == EVS_WINDOW_COUNT) && c->has_count) { p->window.threshold = (uint32_t)c->n_events; }
    if ((p->window.kind == EVS_WINDOW_DURATION) && c->has_window_time) {
        p->window.duration_us = (uint32_t)c->window_time_us;
    }
}

/* The published settings: rotation once per window, 34 x 26 tiles, the threshold of the paper's three sensors, saccades
 * at W / 6. */
static void apply_paper(evs_pipeline_config_t *p, uint16_t width_px, uint16_t height_px)
{
    static const struct {
        uint16_t width_px, height_px;
        uint32_t threshold;
    } PUBLISHED[] = {{240u, 180u, 200u}, {346u, 260u, 50u}, {640u, 480u, 500u}};
    bool found = false;
    p->stabilize.rotation = EVS_ROTATION_WINDOW;
    p->window.kind = EVS_WINDOW_AREA;
    p->window.threshold = PUBLISHED[0].threshold;
    no_limits(&p->window);
    evt_imaging_paper(p);
    p->n_cols = 34u;
    p->n_rows = 26u;
    for (size_t i = 0u; i < sizeof PUBLISHED / sizeof PUBLISHED[0]; i++) {
        if ((PUBLISHED[i].width_px == width_px) && (PUBLISHED[i].height_px == height_px)) {
            p->window.threshold = PUBLISHED[i].threshold;
            found = true;
        }
    }
    if (!found) {
        evh_note("--paper: no threshold is published for %ux%u; that of 240x180 is taken: 200", (unsigned)width_px,
                 (unsigned)height_px);
    }
}

static bool usage(bool *usage_fault, evh_error_t *err, const char *option, const char *text, const char *expected)
{
    *usage_fault = true;
    return evh_fail(err, "%s is '%s'; expected %s", option, text, expected);
}

/* Whether nothing will be rotated, asked for or for want of anything to rotate by. Only then the lens may be unknown.
 */
static bool rotates_nothing(const evt_replay_t *r, const evt_replay_options_t *o)
{
    if (o->attitude != NULL) { return strcmp(o->attitude, ATTITUDES[EVT_ATTITUDE_NONE]) == 0; }
    return (r->rec.imu == NULL) && (r->rec.poses == NULL);
}

/* The camera of events that are left where they are: no distortion, the axis in the middle. */
static void assume_no_lens(evh_calib_t *calib)
{
    calib->fx_px = calib->width_px;
    calib->fy_px = calib->width_px;
    calib->cx_px = (calib->width_px - 1.0) / 2.0;
    calib->cy_px = (calib->height_px - 1.0) / 2.0;
}

static bool settle_calib(evt_replay_t *r, const evt_replay_options_t *o, const evh_config_t *config, bool *usage_fault,
                         evh_error_t *err)
{
    evh_kind_t kind = EVH_KIND_CALIB;
    uint16_t width_px = 0u;
    uint16_t height_px = 0u;
    bool no_lens = false;
    if ((o->size != NULL) && !evt_parse_size(o->size, &width_px, &height_px)) {
        return usage(usage_fault, err, "--size", o->size, "WIDTHxHEIGHT, such as 240x180, up to 2048x2048");
    }
    if ((o->calib != NULL) && !evh_detect(o->calib, &kind, err)) { return false; }
    if (kind == EVH_KIND_CONFIG) {
        evh_config_t other;
        if (!evh_config_read(&other, o->calib, err)) { return false; }
        if (!other.has_calib) {
            return evh_fail(err, "%s: no camera in it; needed are K and D, or intrinsics", o->calib);
        }
        r->calib = other.calib;
        r->calib_path = o->calib;
    } else if ((o->calib != NULL) || (!config->has_calib && (r->rec.calib != NULL))) {
        if (!evh_calib_text_read(&r->calib, r->rec.calib, err)) { return false; }
        r->calib_path = r->rec.calib;
        r->calib.width_px = config->calib.width_px; /* A size without K still helps. */
        r->calib.height_px = config->calib.height_px;
    } else if (config->has_calib) {
        r->calib = config->calib;
        r->calib_path = (o->config != NULL) ? o->config : r->rec.config;
    } else if (rotates_nothing(r, o)) {
        no_lens = true;
        r->calib.width_px = config->calib.width_px;
        r->calib.height_px = config->calib.height_px;
        evh_note("no calibration: events are cut into windows, but neither undistorted nor rotated");
    } else {
        return evh_fail(
            err,
            "%s: no calibration; give --calib FILE (fx fy cx cy k1 k2 p1 p2 k3), --config FILE.yaml with K and D, "
            "or --attitude none",
            o->input);
    }
    if (o->size != NULL) {
        r->calib.width_px = width_px;
        r->calib.height_px = height_px;
    } else if ((r->calib.width_px == 0u) || (r->calib.height_px == 0u)) {
        r->calib.width_px = DEFAULT_WIDTH_PX;
        r->calib.height_px = DEFAULT_HEIGHT_PX;
        evh_note("no file says the sensor size: %ux%u is taken; --size says otherwise", DEFAULT_WIDTH_PX,
                 DEFAULT_HEIGHT_PX);
    }
    if (no_lens) { assume_no_lens(&r->calib); }
    return true;
}

/* Over what the YAML file says. */
static bool parse_gyro_bias(const evt_replay_options_t *o, evt_gyro_bias_t *bias, bool *usage_fault, evh_error_t *err)
{
    if ((o->gyro_bias == NULL) || evt_gyro_bias_parse(o->gyro_bias, bias)) { return true; }
    return usage(usage_fault, err, "--gyro-bias", o->gyro_bias, EVT_GYRO_BIAS_EXPECTED);
}

static bool settle_gyro_bias(evt_replay_t *r, const evt_replay_options_t *o, const evh_config_t *config, bool by_imu,
                             bool *usage_fault, evh_error_t *err)
{
    r->gyro_bias.given = config->has_gyro_bias;
    memcpy(r->gyro_bias.rad_s, config->gyro_bias_rad_s, sizeof r->gyro_bias.rad_s);
    if (!parse_gyro_bias(o, &r->gyro_bias, usage_fault, err)) { return false; }
    if (r->gyro_bias.given && !by_imu) {
        evh_note("the gyro bias is not used: the attitude is not from the IMU");
        r->gyro_bias.given = false;
    }
    evt_gyro_bias_admit(&r->gyro_bias, &r->pipeline.attitude);
    return true;
}

static bool settle_attitude(evt_replay_t *r, const evt_replay_options_t *o, const evh_config_t *config,
                            bool *usage_fault, evh_error_t *err)
{
    const bool has_imu = (r->rec.imu != NULL);
    const bool has_poses = (r->rec.poses != NULL);
    if (o->attitude != NULL) {
        int i = 0;
        while ((i < 4) && (strcmp(ATTITUDES[i], o->attitude) != 0)) { i++; }
        if (i == 4) { return usage(usage_fault, err, "--attitude", o->attitude, "imu, gyro, truth or none"); }
        r->attitude = (evt_attitude_t)i;
    } else {
        const bool prefer_truth = config->has_from_imu && !config->from_imu && has_poses;
        r->attitude = (has_imu && !prefer_truth) ? EVT_ATTITUDE_IMU
                      : has_poses                ? EVT_ATTITUDE_TRUTH
                                                 : EVT_ATTITUDE_NONE;
        evh_note("attitude: %s", (r->attitude == EVT_ATTITUDE_IMU) ? "imu"
                                 : (r->attitude == EVT_ATTITUDE_TRUTH)
                                     ? "truth (the recorded poses)"
                                     : "none (no IMU and no poses): nothing is rotated");
    }
    const bool by_imu = (r->attitude == EVT_ATTITUDE_IMU) || (r->attitude == EVT_ATTITUDE_GYRO);
    if (by_imu && !has_imu) {
        return evh_fail(err, "%s: no IMU file; give --imu FILE, or --attitude truth or none", o->input);
    }
    if ((r->attitude == EVT_ATTITUDE_TRUTH) && !has_poses) {
        return evh_fail(err, "%s: no pose file; give --poses FILE, or --attitude imu or none", o->input);
    }
    r->pipeline.source = (r->attitude == EVT_ATTITUDE_NONE)    ? EVS_PIPELINE_NONE
                         : (r->attitude == EVT_ATTITUDE_TRUTH) ? EVS_PIPELINE_ORIENTATION
                                                               : EVS_PIPELINE_IMU;
    if (r->attitude == EVT_ATTITUDE_GYRO) { r->pipeline.attitude.mode = EVS_ATTITUDE_GYRO_ONLY; }
    return settle_gyro_bias(r, o, config, by_imu, usage_fault, err);
}

static bool settle_times(evt_replay_t *r, const evt_replay_options_t *o, bool *usage_fault, evh_error_t *err)
{
    int64_t offset_us = 0;
    r->from_us = INT64_MIN;
    r->to_us = INT64_MAX;
    if ((o->imu_offset != NULL) && !evt_parse_int(o->imu_offset, -IMU_OFFSET_MAX_US, IMU_OFFSET_MAX_US, &offset_us)) {
        return usage(usage_fault, err, "--imu-offset-us", o->imu_offset, "whole microseconds, -10000000 .. 10000000");
    }
    r->pipeline.track.offset_us = (int32_t)offset_us;
    if ((o->from != NULL) && !evt_parse_seconds(o->from, &r->from_us)) {
        return usage(usage_fault, err, "--from", o->from, "seconds of the recording's own clock, such as 12.5");
    }
    if ((o->to != NULL) && !evt_parse_seconds(o->to, &r->to_us)) {
        return usage(usage_fault, err, "--to", o->to, "seconds of the recording's own clock, such as 12.5");
    }
    if (r->from_us >= r->to_us) { return usage(usage_fault, err, "--from", o->from, "less than --to"); }
    return true;
}

static bool settle_window(evt_replay_t *r, const evt_replay_options_t *o, const evh_config_t *config, bool *usage_fault,
                          evh_error_t *err)
{
    evs_pipeline_config_t *const p = &r->pipeline;
    bool on = true;
    if (o->paper) { apply_paper(p, r->calib.width_px, r->calib.height_px); }
    apply_config_window(config, p);
    if ((o->window != NULL) && !parse_window(o->window, p)) {
        return usage(usage_fault, err, "--window", o->window,
                     "area:COLSxROWS:EVENTS, count:EVENTS, either with :MIN-MAX in ms, or time:MICROSECONDS");
    }
    if ((p->n_cols > r->calib.width_px) || (p->n_rows > r->calib.height_px) ||
        ((uint32_t)p->n_cols * p->n_rows > EVS_TILES_MAX)) {
        return evh_fail(err, "%ux%u tiles do not fit a sensor of %ux%u (at most %u in all)", (unsigned)p->n_cols,
                        (unsigned)p->n_rows, (unsigned)r->calib.width_px, (unsigned)r->calib.height_px,
                        (unsigned)EVS_TILES_MAX);
    }
    if (o->rotation != NULL) {
        if ((strcmp(o->rotation, "window") != 0) && (strcmp(o->rotation, "slice") != 0)) {
            return usage(usage_fault, err, "--rotation", o->rotation, "window or slice");
        }
        p->stabilize.rotation = (o->rotation[0] == 'w') ? EVS_ROTATION_WINDOW : EVS_ROTATION_SLICE;
    }
    if (config->has_saccades) { on = config->saccades; }
    if ((o->saccade != NULL) && !evt_parse_on_off(o->saccade, &on)) {
        return usage(usage_fault, err, "--saccade", o->saccade, "on or off");
    }
    if (!on) { p->stabilize.saccade_px_q4 = EVS_STABILIZE_SACCADE_OFF; }
    return true;
}

static bool settle_write(evt_replay_t *r, const evt_replay_options_t *o, bool *usage_fault, evh_error_t *err)
{
    if (o->write == NULL) { return true; }
    for (const char *word = o->write;; word++) {
        const size_t length = strcspn(word, ",");
        if ((length == 6u) && (memcmp(word, "events", length) == 0)) {
            r->write_events = true;
        } else if ((length == 6u) && (memcmp(word, "frames", length) == 0)) {
            r->write_frames = true;
        } else {
            return usage(usage_fault, err, "--write", o->write, "events, frames or events,frames");
        }
        word += length;
        if (*word == '\0') { return true; }
    }
}

static void settle_pipeline(evt_replay_t *r, const evh_config_t *config)
{
    const evs_camera_config_t camera = evt_camera_config(&r->calib, r->calib.width_px, r->calib.height_px);
    evs_pipeline_config_t *const p = &r->pipeline;
    *p = evs_pipeline_config_velocity(&camera);
    p->tile_table = true; /* Same numbers, less time. */
    p->n_fifo = N_FIFO;
    p->n_ring = N_RING;
    p->n_batch = N_BATCH;
    if (config->has_q_ci) {
        evs_quat_t unit;
        const double *const q = config->q_ci_wxyz;
        if (evs_quat_normalize(evs_quat_from_double(q[0], q[1], q[2], q[3]), &unit) == EVS_OK) { p->q_ci = unit; }
    }
}

/* An IMU file in the place of the events, say. What cannot be told at once, the reader finds out. */
static bool check_input_kind(const evt_replay_t *r, evh_error_t *err)
{
    static const char *const WHAT[] = {[EVH_KIND_IMU] = "IMU samples",
                                       [EVH_KIND_POSES] = "poses",
                                       [EVH_KIND_CALIB] = "a calibration",
                                       [EVH_KIND_CONFIG] = "a YAML file",
                                       [EVH_KIND_IMAGES] = "a list of images"};
    evh_kind_t kind = EVH_KIND_UNKNOWN;
    if (!evh_file_is_regular(r->rec.events)) { return true; } /* A pipe can be read only once. */
    if (!evh_detect(r->rec.events, &kind, err)) { return false; }
    if (((size_t)kind < sizeof WHAT / sizeof WHAT[0]) && (WHAT[kind] != NULL)) {
        return evh_fail(err, "%s: looks like %s; expected events, \"t x y p\" lines, or a folder", r->rec.events,
                        WHAT[kind]);
    }
    return true;
}

static bool settle(evt_replay_t *r, const evt_replay_options_t *o, bool *usage_fault, evh_error_t *err)
{
    evh_config_t config;
    const char *config_path;
    memset(&config, 0, sizeof config);
    if ((o->imu_order != NULL) && !evh_imu_order_parse(o->imu_order, &r->imu_order)) {
        return usage(usage_fault, err, "--imu-order", o->imu_order,
                     "accel-first, gyro-first or columns such as t,gx,gy,gz,ax,ay,az");
    }
    if (!evh_recording_find(&r->rec, o->input, err) || !evh_recording_override(&r->rec.calib, o->calib, err) ||
        !evh_recording_override(&r->rec.imu, o->imu, err) || !evh_recording_override(&r->rec.poses, o->poses, err)) {
        return false;
    }
    if (r->rec.events == NULL) {
        return evh_fail(err, "%s: no events in this folder; expected events.txt or events.txt.gz", o->input);
    }
    if (!check_input_kind(r, err)) { return false; }
    config_path = (o->config != NULL) ? o->config : r->rec.config;
    if ((config_path != NULL) && !evh_config_read(&config, config_path, err)) { return false; }
    if (!settle_calib(r, o, &config, usage_fault, err)) { return false; }
    settle_pipeline(r, &config);
    return settle_attitude(r, o, &config, usage_fault, err) && settle_times(r, o, usage_fault, err) &&
           settle_window(r, o, &config, usage_fault, err) && settle_write(r, o, usage_fault, err) &&
           evt_imaging_settle(r, o, &config, r->calib_path != NULL, usage_fault, err);
}

/* Wrong words are told before missing files: the second attempt shall not fail on them. */
static bool check_words(const evt_replay_options_t *o, bool *usage_fault, evh_error_t *err)
{
    evt_replay_t dummy;
    uint16_t ignored_w = 0u;
    uint16_t ignored_h = 0u;
    evs_pipeline_config_t pipeline;
    bool on = false;
    memset(&dummy, 0, sizeof dummy);
    memset(&pipeline, 0, sizeof pipeline);
    if ((o->size != NULL) && !evt_parse_size(o->size, &ignored_w, &ignored_h)) {
        return usage(usage_fault, err, "--size", o->size, "WIDTHxHEIGHT, such as 240x180, up to 2048x2048");
    }
    if ((o->window != NULL) && !parse_window(o->window, &pipeline)) {
        return usage(usage_fault, err, "--window", o->window,
                     "area:COLSxROWS:EVENTS, count:EVENTS, either with :MIN-MAX in ms, or time:MICROSECONDS");
    }
    if ((o->saccade != NULL) && !evt_parse_on_off(o->saccade, &on)) {
        return usage(usage_fault, err, "--saccade", o->saccade, "on or off");
    }
    return settle_times(&dummy, o, usage_fault, err) && parse_gyro_bias(o, &dummy.gyro_bias, usage_fault, err) &&
           settle_write(&dummy, o, usage_fault, err) && evt_imaging_check_words(o, usage_fault, err);
}

bool evt_replay_settle(evt_replay_t *r, const evt_replay_options_t *options, bool *usage_fault, evh_error_t *err)
{
    memset(r, 0, sizeof *r);
    *usage_fault = false;
    return check_words(options, usage_fault, err) && settle(r, options, usage_fault, err);
}

void evt_replay_free(evt_replay_t *r) { evh_recording_free(&r->rec); }
