/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <inttypes.h>
#include <cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "decimal.h"
#include "evs/float.h"
#include "evs/version.h"
#include "json.h"
#include "replay.h"
#include "replay_imaging.h"

/* A measured number: a few digits that mean something. */
static void add_measure(cJSON *to, const char *key, double value)
{
    char text[40];
    (void)snprintf(text, sizeof text, "%.4g", value);
    (void)cJSON_AddRawToObject(to, key, text);
}

static void add_faults(cJSON *to, const char *key, const evh_tally_t *tally)
{
    cJSON *const faults = cJSON_AddObjectToObject(to, key);
    for (int i = EVH_FAULT_NONE + 1; i < EVH_FAULT_COUNT; i++) {
        evt_json_count(faults, evh_fault_key((evh_fault_t)i), tally->n_fault[i]);
    }
}

static void add_camera(cJSON *to, const evh_calib_t *c)
{
    cJSON *const camera = cJSON_AddObjectToObject(to, "camera");
    cJSON *dist;
    (void)cJSON_AddNumberToObject(camera, "width_px", c->width_px);
    (void)cJSON_AddNumberToObject(camera, "height_px", c->height_px);
    evt_json_text(camera, "model", c->fisheye ? "fisheye" : "pinhole");
    (void)cJSON_AddNumberToObject(camera, "fx_px", c->fx_px);
    (void)cJSON_AddNumberToObject(camera, "fy_px", c->fy_px);
    (void)cJSON_AddNumberToObject(camera, "cx_px", c->cx_px);
    (void)cJSON_AddNumberToObject(camera, "cy_px", c->cy_px);
    dist = cJSON_AddArrayToObject(camera, "distortion");
    for (int i = 0; i < 5; i++) { (void)cJSON_AddItemToArray(dist, cJSON_CreateNumber(c->dist[i])); }
}

static void add_window(cJSON *to, const evs_pipeline_config_t *p)
{
    char text[64];
    switch (p->window.kind) {
    case EVS_WINDOW_AREA:
        (void)snprintf(text, sizeof text, "area:%ux%u:%" PRIu32, (unsigned)p->n_cols, (unsigned)p->n_rows,
                       p->window.threshold);
        break;
    case EVS_WINDOW_COUNT:
        (void)snprintf(text, sizeof text, "count:%" PRIu32, p->window.threshold);
        break;
    default:
        (void)snprintf(text, sizeof text, "time:%" PRIu32, p->window.duration_us);
        break;
    }
    evt_json_text(to, "window", text);
    if (p->window.kind != EVS_WINDOW_DURATION) {
        const bool unlimited = (p->window.max_duration_us == EVS_WINDOW_DURATION_MAX_US);
        (void)cJSON_AddNumberToObject(to, "window_min_us", p->window.min_duration_us);
        (void)cJSON_AddItemToObject(to, "window_max_us",
                                    unlimited ? cJSON_CreateNull() : cJSON_CreateNumber(p->window.max_duration_us));
    }
}

static void add_imaging(cJSON *to, const evs_pipeline_config_t *p)
{
    const bool searches = (p->warp == EVS_PIPELINE_WARP_GLOBAL) || (p->warp == EVS_PIPELINE_WARP_TILED);
    evt_json_text(to, "image", evt_image_name(p->image));
    evt_json_text(to, "warp", evt_warp_name(p->warp));
    if (searches) { evt_json_count(to, "warp_events_max", p->n_warp_events); }
    evt_json_text(to, "velocity", p->velocity_on ? "on" : "off");
    if (!p->velocity_on) { return; }
    evt_json_text(to, "method", evt_method_name(p->velocity.egomotion.method));
    add_measure(to, "residual_rate_rad_s", evs_q_to_double(p->velocity.residual_rate_rad_s_q24, 24u));
    (void)cJSON_AddNumberToObject(to, "baseline_min_us", p->velocity.keyframes.baseline_min_us);
    (void)cJSON_AddNumberToObject(to, "baseline_max_us", p->velocity.keyframes.baseline_max_us);
    (void)cJSON_AddNumberToObject(to, "flow_target_px", p->velocity.keyframes.target_px_q4 / 16.0);
}

static void add_settings(cJSON *root, const evt_replay_t *r, const evt_replay_options_t *o)
{
    const evs_pipeline_config_t *const p = &r->pipeline;
    const int32_t q[4] = {p->q_ci.w, p->q_ci.x, p->q_ci.y, p->q_ci.z};
    cJSON *const s = cJSON_AddObjectToObject(root, "settings");
    cJSON *q_ci;
    evt_json_text(s, "events", r->rec.events);
    evt_json_text(s, "imu", r->rec.imu);
    evt_json_text(s, "poses", r->rec.poses);
    evt_json_text(s, "calib", r->calib_path);
    evt_json_text(s, "config", (o->config != NULL) ? o->config : r->rec.config);
    evt_json_text(s, "attitude", evt_attitude_name(r->attitude));
    add_window(s, p);
    evt_json_text(s, "rotation", (p->stabilize.rotation == EVS_ROTATION_WINDOW) ? "window" : "slice");
    (void)cJSON_AddNumberToObject(s, "slice_max_us", p->stabilize.slice_max_us);
    (void)cJSON_AddNumberToObject(s, "saccade_px", p->stabilize.saccade_px_q4 / 16.0);
    add_imaging(s, p);
    (void)cJSON_AddBoolToObject(s, "paper", o->paper);
    (void)cJSON_AddNumberToObject(s, "imu_offset_us", p->track.offset_us);
    if (r->gyro_bias.given) {
        (void)cJSON_AddItemToObject(s, "gyro_bias_rad_s", cJSON_CreateDoubleArray(r->gyro_bias.rad_s, 3));
    }
    (void)cJSON_AddNumberToObject(s, "table_step_px", p->table_step_px);
    q_ci = cJSON_AddArrayToObject(s, "q_camera_from_imu_wxyz");
    for (int i = 0; i < 4; i++) { (void)cJSON_AddItemToArray(q_ci, cJSON_CreateNumber(evs_q_to_double(q[i], 30u))); }
    if (r->from_us != INT64_MIN) { evt_json_seconds(s, "from_s", r->from_us); }
    if (r->to_us != INT64_MAX) { evt_json_seconds(s, "to_s", r->to_us); }
    add_camera(s, &r->calib);
}

static void add_events(cJSON *root, const evt_replay_result_t *x)
{
    cJSON *const e = cJSON_AddObjectToObject(root, "events");
    cJSON *outside;
    evt_json_count(e, "in", x->events_tally.n_good + evh_tally_skipped(&x->events_tally));
    evt_json_count(e, "before_from", x->n_before_from);
    evt_json_count(e, "after_to", x->n_after_to);
    evt_json_count(e, "replayed", x->n_events);
    evt_json_count(e, "kept", x->n_kept);
    outside = cJSON_AddObjectToObject(e, "outside");
    evt_json_count(outside, "no_undistorted_position", x->n_no_undistorted);
    evt_json_count(outside, "no_orientation", x->n_unoriented);
    evt_json_count(outside, "rotated_out_of_range", x->n_out_of_range);
    add_faults(e, "bad", &x->events_tally);
    evt_json_count(e, "time_back_in_library", x->counts.n_time_back); /* After a pause of more than 35 min, say. */
    evt_json_count(e, "clock_restarts", x->counts.n_restarts);
}

static void add_attitude(cJSON *root, const evt_replay_t *r, const evt_replay_result_t *x)
{
    cJSON *const a = cJSON_AddObjectToObject(root, "attitude");
    const evs_attitude_faults_t *const f = &x->attitude_faults;
    const int32_t q24[3] = {x->gyro_bias_q24.x, x->gyro_bias_q24.y, x->gyro_bias_q24.z};
    cJSON *bias;
    char text[24];
    evt_json_count(a, "samples", x->n_orientations);
    if (x->n_orientations > 0u) {
        evt_json_seconds(a, "t_first_s", x->orientation_first_us);
        evt_json_seconds(a, "t_last_s", x->orientation_last_us);
    }
    if ((r->attitude == EVT_ATTITUDE_IMU) || (r->attitude == EVT_ATTITUDE_GYRO)) {
        add_faults(a, "bad", &x->imu_tally);
        evt_json_count(a, "gyro_saturated", f->n_gyro_saturated);
        evt_json_count(a, "gyro_spikes", f->n_gyro_spikes);
        evt_json_count(a, "gyro_gaps", f->n_gyro_gaps);
        evt_json_count(a, "accel_left_out", f->n_accel_bad);
        evt_json_count(a, "mag_left_out", f->n_mag_bad);
        (void)cJSON_AddBoolToObject(a, "gyro_bias_known", x->gyro_bias_known);
        bias = cJSON_AddArrayToObject(a, "gyro_bias_rad_s");
        for (int i = 0; i < 3; i++) {
            (void)snprintf(text, sizeof text, "%.6f", evs_q_to_double(q24[i], 24u));
            (void)cJSON_AddItemToArray(bias, cJSON_CreateRaw(text));
        }
    } else if (r->attitude == EVT_ATTITUDE_TRUTH) {
        add_faults(a, "bad", &x->poses_tally);
    }
}

static void add_images(cJSON *root, const evt_replay_t *r, const evt_replay_result_t *x)
{
    const evs_pipeline_config_t *const p = &r->pipeline;
    cJSON *images;
    cJSON *left_out;
    if (p->image == EVS_PIPELINE_IMAGE_NONE) { return; }
    images = cJSON_AddObjectToObject(root, "images");
    evt_json_count(images, "made", x->counts.n_images);
    left_out = cJSON_AddObjectToObject(images, "left_out");
    evt_json_count(left_out, "no_orientation_or_cut_off", x->counts.n_images_incomplete);
    evt_json_count(left_out, "velocity_at_work", x->counts.n_images_busy);
    if (p->n_warp_events > 0u) { evt_json_count(images, "events_beyond_warp_events_max", x->counts.n_unwarped); }
}

static void add_velocity(cJSON *root, const evt_replay_t *r, const evt_replay_result_t *x)
{
    const evt_replay_velocity_counts_t *const c = &x->velocity;
    const double n = (c->n_valid > 0u) ? (double)c->n_valid : 1.0;
    cJSON *v;
    cJSON *invalid;
    if (!r->pipeline.velocity_on) { return; }
    v = cJSON_AddObjectToObject(root, "velocity");
    evt_json_count(v, "pairs", c->n_pairs);
    evt_json_count(v, "valid", c->n_valid);
    invalid = cJSON_AddObjectToObject(v, "invalid");
    evt_json_count(invalid, "few_features", c->n_few);
    evt_json_count(invalid, "too_little_motion", c->n_still);
    evt_json_count(invalid, "no_direction_fits", c->n_unsolved);
    evt_json_count(invalid, "no_orientation", c->n_no_orientation);
    evt_json_count(v, "same_time", c->n_same_time);
    evt_json_count(v, "images_without_an_older_one", c->library.n_unpaired);
    evt_json_count(v, "pairs_across_a_saccade", c->n_turned);
    if (c->n_valid > 0u) {
        cJSON *const mean = cJSON_AddObjectToObject(v, "mean");
        add_measure(mean, "interval_s", 1e-6 * c->interval_us_sum / n);
        add_measure(mean, "flow_px", c->flow_px_sum / n);
        add_measure(mean, "flow_vectors", c->flow_sum / n);
        add_measure(mean, "inliers", c->inlier_sum / n);
    }
    if (x->counts.n_images > 0u) {
        add_measure(v, "library_ns_per_image", (double)x->velocity_ns / (double)x->counts.n_images);
    }
}

static void add_all(cJSON *root, const evt_replay_t *r, const evt_replay_options_t *o, const evt_replay_result_t *x,
                    const char *failure)
{
    const double n = (x->n_events > 0u) ? (double)x->n_events : 1.0;
    evt_json_text(root, "program", "evstab replay");
    evt_json_text(root, "library_version", EVS_VERSION_STRING);
    if (failure != NULL) { evt_json_text(root, "failure", failure); }
    add_settings(root, r, o);
    evt_json_seconds(root, "t_first_s", x->t_first_us);
    evt_json_seconds(root, "t_last_s", x->t_last_us);
    evt_json_seconds(root, "duration_s", x->t_last_us - x->t_first_us);
    add_events(root, x);
    add_attitude(root, r, x);
    evt_json_count(root, "windows", x->n_windows);
    evt_json_count(root, "saccades", x->n_saccades);
    add_images(root, r, x);
    add_velocity(root, r, x);
    evt_json_count(root, "library_memory_bytes", x->library_bytes);
    add_measure(root, "wall_s", (double)x->wall_ns * 1e-9);
    add_measure(root, "ns_per_event", (double)x->wall_ns / n);
    add_measure(root, "library_ns_per_event", (double)x->library_ns / n);
    if (x->n_orientations > 0u) {
        add_measure(root, "library_ns_per_sample", (double)x->attitude_ns / (double)x->n_orientations);
    }
}

char *evt_replay_summary(const evt_replay_t *r, const evt_replay_options_t *options, const evt_replay_result_t *result,
                         const char *failure)
{
    cJSON *const root = cJSON_CreateObject();
    char *text = NULL;
    if (root != NULL) {
        add_all(root, r, options, result, failure);
        text = cJSON_Print(root);
    }
    cJSON_Delete(root);
    return text;
}

bool evt_replay_write_summary(const char *text, const char *dir, evh_error_t *err)
{
    evh_csv_t out;
    return evh_csv_open(&out, dir, "summary.json", text, err) && evh_csv_close(&out, err);
}
