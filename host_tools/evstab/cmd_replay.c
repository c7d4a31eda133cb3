/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* evstab replay: a recording through the library, the same code as on a microcontroller. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "decimal.h"
#include "faults.h"
#include "jobs.h"
#include "options.h"
#include "replay.h"
#include "replay_batch.h"

#define WINDOW_LONG_US 100000 /* Of an image that shall be tracked. */

static evt_replay_options_t opt;
static const char *opt_jobs;
static bool opt_quiet;

static const evt_option_t OPTIONS[] = {
    {"output", 'o', "DIR", "Folder for the results; made if need be. Needed.", &opt.output, NULL},
    {"jobs", 'j', "N", "Of several recordings replay N at a time. Default: as many\nas there are processors.",
     &opt_jobs, NULL},
    {"attitude", '\0', "SOURCE",
     "imu: filter on gyro and accelerometer; gyro: integration alone;\n"
     "truth: the recorded poses; none: no rotation.\n"
     "Default: imu, else truth, else none, by what there is.",
     &opt.attitude, NULL},
    {"window", '\0', "WINDOW",
     "When a window of events closes:\n"
     "area:COLSxROWS:N  a tile of the image has more than N events;\n"
     "count:N           N events; time:US  US microseconds.\n"
     "area and count with :MIN-MAX close after MIN ms at the\n"
     "earliest and after MAX at the latest, as 500:5-50 does.\n"
     "Default: area:34x26:N:5-50, N being 12 events per pixel\n"
     "of a tile: 504 at 240x180.",
     &opt.window, NULL},
    {"rotation", '\0', "MODE",
     "slice: follow the attitude within a window (default);\nwindow: one rotation per window, as the paper.",
     &opt.rotation, NULL},
    {"saccade", '\0', "on|off",
     "Move the reference when the view has turned away by a\nsixth of the image width. Default: on.", &opt.saccade,
     NULL},
    {"velocity", '\0', "on|off",
     "Measure the direction of flight, velocity.csv. Default: on\nwhere there are a lens and an attitude.",
     &opt.velocity, NULL},
    {"image", '\0', "KIND",
     "What the direction is measured in:\n"
     "iwe: image of (warped) events, smoothed (default);\n"
     "surface: time surface; count: events per pixel.",
     &opt.image, NULL},
    {"warp", '\0', "MODE",
     "How events move along the flow before they are drawn:\n"
     "none (default); predicted: by the flow of the pair of\n"
     "images before; global, tiled: by the flow that makes the\n"
     "image sharpest, one or per tile.",
     &opt.warp, NULL},
    {"method", '\0', "METHOD",
     "From flow to direction: erlv (default); erlv-paper, as\npublished; erl: also for a rotation that is unknown.",
     &opt.method, NULL},
    {"baseline-ms", '\0', "MIN:MAX",
     "How far apart the two images of a pair may lie; within it\nas far as makes 5 px of flow. Default: 10:250.",
     &opt.baseline, NULL},
    {"calib", '\0', "FILE", "Camera: fx fy cx cy k1 k2 p1 p2 k3, or YAML.", &opt.calib, NULL},
    {"imu", '\0', "FILE", "IMU samples: t ax ay az gx gy gz in text, or CSV\nwith a header.", &opt.imu, NULL},
    {"imu-order", '\0', "ORDER",
     "accel-first, gyro-first or a list of columns such as\nt,gx,gy,gz,ax,ay,az (\"_\" skips one). Default: found out.",
     &opt.imu_order, NULL},
    {"imu-offset-us", '\0', "N",
     "t_event = t_imu + N, in microseconds; with --attitude truth\nthe same for the poses. Default: 0.",
     &opt.imu_offset, NULL},
    {"gyro-bias", '\0', "X,Y,Z",
     "What the gyro reads at rest about its x, y and z axis, in\n"
     "rad/s: subtracted from the start. Default: unknown, learnt\nat rest.",
     &opt.gyro_bias, NULL},
    {"poses", '\0', "FILE", "Poses: t px py pz qx qy qz qw, or CSV with a header.", &opt.poses, NULL},
    {"config", '\0', "FILE.yaml",
     "Camera, extrinsics and window with the paper's names:\n"
     "K D fisheye_distortion q_external accumulation_type\n"
     "roi_threshold number_of_columns number_of_rows ...\n"
     "and ours: image warp velocity method gyro_bias.",
     &opt.config, NULL},
    {"size", '\0', "WxH", "Sensor size in pixels. Default: what the YAML file says,\nelse 240x180.", &opt.size, NULL},
    {"paper", '\0', NULL,
     "The published settings: one rotation per window, 34x26\ntiles, threshold 200, 50 or 500 by sensor, saccade at "
     "W/6,\ntiled warp, Gaussian votes, method erlv-paper.",
     NULL, &opt.paper},
    {"from", '\0', "S", "First time to replay, in seconds of the recording's clock.", &opt.from, NULL},
    {"to", '\0', "S", "Stop before this time.", &opt.to, NULL},
    {"write", '\0', "WHAT",
     "events: also events.csv, a row per event;\nframes: also frames/*.png, the image of each window;\nor both: "
     "events,frames.",
     &opt.write, NULL},
    {"video", '\0', "FILE",
     "Also make a video, .mp4 or .gif, of the events raw,\nstabilized, and on a canvas of twice the size, at half\n"
     "speed. Needs ffmpeg.",
     &opt.video, NULL},
    {"no-report", '\0', NULL, "Do not write report.html.", NULL, &opt.no_report},
    {"quiet", 'q', NULL, "No progress, no notes, no closing line.", NULL, &opt_quiet},
};

static const evt_usage_t USAGE = {
    .command = "replay",
    .synopsis = "INPUT... -o DIR [options]",
    .about =
        "Replays a recording through the library. INPUT is a folder in ECD form (events.txt imu.txt "
        "groundtruth.txt calib.txt,\n"
        "each also .gz) or one event file (\"t x y p\" lines); files outside of it are named by options.\n"
        "Writes into DIR: report.html to look at, summary.json, attitude.csv (world from camera, per sample), "
        "windows.csv,\n"
        "velocity.csv (direction of flight) and pairs.csv (what each pair of images told); events.csv and frames on "
        "demand.\n"
        "Several INPUTs: each is replayed by a process of its own into DIR/NAME, with what it had to say in "
        "log.txt;\n"
        "DIR/summary.csv has a row for each. Exit status 1 if any of them failed.",
    .examples = "  evstab replay slider_depth -o out\n"
                "  evstab replay slider_depth -o out --video out/slider.mp4\n"
                "  evstab replay events_02.097-02.196.txt --calib calib.txt --imu imu.txt -o out --write events\n"
                "  evstab replay slider_depth -o out --image surface --write frames\n"
                "  evstab replay recordings/* -o out -j 4",
    .options = OPTIONS,
    .n_options = sizeof OPTIONS / sizeof OPTIONS[0],
    .n_words_min = 1u,
    .n_words_max = EVT_BATCH_MAX,
};

static void report_unoriented(const evt_replay_result_t *x)
{
    char events[2][32];
    char samples[2][32];
    if (x->n_unoriented == 0u) { return; }
    events[0][evh_decimal_format(events[0], x->t_first_us, 6u)] = '\0';
    events[1][evh_decimal_format(events[1], x->t_last_us, 6u)] = '\0';
    samples[0][evh_decimal_format(samples[0], x->orientation_first_us, 6u)] = '\0';
    samples[1][evh_decimal_format(samples[1], x->orientation_last_us, 6u)] = '\0';
    (void)fprintf(stderr,
                  "evstab: %" PRIu64 " of %" PRIu64
                  " events have no orientation: events span %s .. %s s, orientations %s .. %s s\n",
                  x->n_unoriented, x->n_events, events[0], events[1], samples[0], samples[1]);
}

static void report(const evt_replay_t *r, const evt_replay_options_t *o, const evt_replay_result_t *x)
{
    evh_tally_report(&x->events_tally, evh_path_name(r->rec.events));
    if (r->rec.imu != NULL) { evh_tally_report(&x->imu_tally, evh_path_name(r->rec.imu)); }
    if (r->rec.poses != NULL) { evh_tally_report(&x->poses_tally, evh_path_name(r->rec.poses)); }
    report_unoriented(x);
    evt_note_attitude_faults(&x->attitude_faults);
    if (r->pipeline.velocity_on && (x->window_longest_us > WINDOW_LONG_US)) {
        evh_note("windows last up to %.0f ms, too long to measure the direction of flight often and in sharp images; "
                 "--window area:...:N:5-50 limits them",
                 1e-3 * (double)x->window_longest_us);
    }
    if (r->velocity_told && (x->velocity.n_valid == 0u)) {
        evh_note("no direction of flight: %" PRIu64 " images, %" PRIu64
                 " pairs of them; pairs.csv tells what was in the way",
                 (uint64_t)x->counts.n_images, x->velocity.n_pairs);
    }
    if (x->counts.n_unwarped > 0u) {
        evh_note("%" PRIu64 " events are not in the images: a window held more than the %zu that a warp keeps",
                 (uint64_t)x->counts.n_unwarped, r->pipeline.n_warp_events);
    }
    if (x->n_no_undistorted + x->n_out_of_range > 0u) {
        evh_note("%" PRIu64 " of %" PRIu64 " events have no position: %" PRIu64 " under the lens model, %" PRIu64
                 " rotated out of range",
                 x->n_no_undistorted + x->n_out_of_range, x->n_events, x->n_no_undistorted, x->n_out_of_range);
    }
    if ((x->events_tally.n_fault[EVH_FAULT_OFF_SENSOR] > 0u) && (o->size == NULL)) {
        evh_note("the sensor is taken as %ux%u; --size says otherwise", (unsigned)r->calib.width_px,
                 (unsigned)r->calib.height_px);
    }
}

static void print_velocity(const evt_replay_t *r, const evt_replay_result_t *x, const evr_numbers_t *n)
{
    if (!r->pipeline.velocity_on) { return; }
    (void)printf("direction of flight from %" PRIu64 " of %" PRIu64 " pairs of images", x->velocity.n_valid,
                 x->velocity.n_pairs);
    if (n->n_directions > 0u) { (void)printf(", median uncertainty %.1f deg", n->sigma_deg); }
    if (n->n_directions_true > 0u) { (void)printf(", median angle to the truth %.1f deg", n->direction_error_deg); }
    if (x->counts.n_images > 0u) {
        (void)printf("; %.2f ms per image", 1e-6 * (double)x->velocity_ns / (double)x->counts.n_images);
    }
    (void)printf("\n");
}

static void print_result(const evt_replay_t *r, const evt_replay_options_t *o, const evt_replay_outcome_t *outcome)
{
    const evt_replay_result_t *const x = &outcome->result;
    const evr_numbers_t *const n = &outcome->numbers;
    char duration[32];
    if (evh_is_quiet()) { return; }
    duration[evh_decimal_format(duration, x->t_last_us - x->t_first_us, 6u)] = '\0';
    (void)printf("%s: %" PRIu64 " event%s in %s s, %" PRIu64 " window%s, %" PRIu64
                 " saccade%s; %.1f ns per event in the library, %.1f in all\n",
                 evh_path_name(r->rec.events), x->n_events, (x->n_events == 1u) ? "" : "s", duration, x->n_windows,
                 (x->n_windows == 1u) ? "" : "s", x->n_saccades, (x->n_saccades == 1u) ? "" : "s",
                 (double)x->library_ns / (double)x->n_events, (double)x->wall_ns / (double)x->n_events);
    if (n->sharpness_before > 0.0) {
        (void)printf("sharpness %.3g raw, %.3g stabilized: x%.2f\n", n->sharpness_before, n->sharpness_after,
                     n->sharpness_after / n->sharpness_before);
    }
    print_velocity(r, x, n);
    (void)printf("wrote %s/: %ssummary.json attitude.csv windows.csv%s%s%s\n", o->output,
                 o->no_report ? "" : "report.html ", r->pipeline.velocity_on ? " velocity.csv pairs.csv" : "",
                 r->write_events ? " events.csv" : "", r->write_frames ? " frames/" : "");
    if (o->video != NULL) { (void)printf("wrote %s\n", o->video); }
}

/* After a failure too: what was read is there, and both tell how far that was. */
static bool write_results(const evt_replay_t *r, const evt_replay_options_t *o, evr_report_t *page,
                          evt_replay_outcome_t *outcome, const char *failure, evh_error_t *err)
{
    char *const summary = evt_replay_summary(r, o, &outcome->result, failure);
    bool ok;
    if (summary == NULL) { return evh_fail(err, "%s/summary.json: out of memory", o->output); }
    ok = evt_replay_write_summary(summary, o->output, err);
    if (page != NULL) {
        outcome->numbers = evr_report_finish(page);
        ok = evr_report_write(page, o->output, evh_path_name(o->input), summary, err) && ok;
    }
    free(summary);
    return ok;
}

static bool open_watch(evt_replay_watch_t *watch, const evt_replay_t *r, const evt_replay_options_t *o,
                       evh_error_t *err)
{
    const evh_calib_t *const c = &r->calib;
    watch->report = NULL;
    watch->video = NULL;
    if (!o->no_report) {
        watch->report = evr_report_open(c->width_px, c->height_px, 0.5 * (c->fx_px + c->fy_px));
        if (watch->report == NULL) { return evh_fail(err, "out of memory for the report; --no-report does without"); }
    }
    if (o->video == NULL) { return true; }
    watch->video = evr_video_open(o->video, c->width_px, c->height_px, err);
    return watch->video != NULL;
}

static int replay(const evt_replay_t *r, const evt_replay_options_t *o, evt_replay_outcome_t *outcome)
{
    evt_replay_watch_t watch;
    evh_error_t err = {""};
    evh_error_t write_err = {""};
    bool ok = open_watch(&watch, r, o, &err) && evt_replay_run(r, o->output, &watch, &outcome->result, &err);
    bool written = true;
    ok = evr_video_close(watch.video, &err) && ok;
    if (outcome->result.n_events > 0u) {
        report(r, o, &outcome->result);
        written = write_results(r, o, watch.report, outcome, ok ? NULL : err.text, &write_err);
    }
    evr_report_close(watch.report);
    if (!ok || !written) {
        (void)fprintf(stderr, "evstab replay: %s\n", ok ? write_err.text : err.text);
        return EVT_EXIT_FAILED;
    }
    print_result(r, o, outcome);
    return EVT_EXIT_OK;
}

static bool video_is_no_input(const evt_replay_t *r, const evt_replay_options_t *o, evh_error_t *err)
{
    const char *const inputs[] = {r->rec.events, r->rec.imu, r->rec.poses, r->calib_path};
    for (size_t i = 0u; (o->video != NULL) && (i < sizeof inputs / sizeof inputs[0]); i++) {
        if ((inputs[i] != NULL) && evh_same_file(inputs[i], o->video)) {
            return evh_fail(err, "%s: is an input; name another file for --video", o->video);
        }
    }
    return true;
}

int evt_replay_perform(const evt_replay_options_t *o, evt_replay_outcome_t *outcome)
{
    evt_replay_t r;
    evh_error_t err = {""};
    bool usage_fault = false;
    int status = EVT_EXIT_FAILED;
    memset(outcome, 0, sizeof *outcome);
    memset(&r, 0, sizeof r);
    /* No ffmpeg: told before any work. */
    if (((o->video == NULL) || evr_video_possible(o->video, &err)) && evt_replay_settle(&r, o, &usage_fault, &err) &&
        video_is_no_input(&r, o, &err)) {
        status = replay(&r, o, outcome);
    } else if (usage_fault) {
        status = evt_usage_error(&USAGE, "%s", err.text);
    } else {
        (void)fprintf(stderr, "evstab replay: %s\n", err.text);
    }
    evt_replay_free(&r);
    return status;
}

/* One recording, after the words of the command line have been taken. */
static int replay_one(const char *input, const char *output)
{
    static evt_replay_outcome_t outcome;
    opt.input = input;
    opt.output = output;
    return evt_replay_perform(&opt, &outcome);
}

/* A wrong word is told once, before anything is started, and not in the log of every recording. The first recording
 * that has what it takes shows them all. */
static bool words_are_right(const char *const *inputs, size_t n, int *status)
{
    bool decided = false;
    *status = EVT_EXIT_OK;
    evh_set_quiet(true);
    for (size_t i = 0u; (i < n) && !decided; i++) {
        evt_replay_t r;
        evh_error_t err = {""};
        bool usage_fault = false;
        opt.input = inputs[i];
        decided = evt_replay_settle(&r, &opt, &usage_fault, &err) || usage_fault;
        if (usage_fault) { *status = evt_usage_error(&USAGE, "%s", err.text); }
        evt_replay_free(&r);
    }
    evh_set_quiet(opt_quiet);
    return *status == EVT_EXIT_OK;
}

int evt_replay_main(int argc, char **argv)
{
    static const char *words[EVT_BATCH_MAX];
    int64_t n_jobs = evb_n_processors();
    size_t n = 0u;
    int status = EVT_EXIT_OK;

    if (!evt_options_parse(&USAGE, argc, argv, words, &status)) { return status; }
    while ((n < EVT_BATCH_MAX) && (words[n] != NULL)) { n++; }
    if (opt.output == NULL) { return evt_usage_error(&USAGE, "-o DIR is missing: where the results shall go"); }
    if ((opt_jobs != NULL) && !evt_parse_int(opt_jobs, 1, EVT_BATCH_PARALLEL_MAX, &n_jobs)) {
        return evt_usage_error(&USAGE, "--jobs is '%s'; expected 1 .. %d", opt_jobs, EVT_BATCH_PARALLEL_MAX);
    }
    if ((opt.video != NULL) && !evr_video_name_ok(opt.video)) {
        return evt_usage_error(&USAGE, "--video is '%s'; expected a name that ends in .mp4 or .gif", opt.video);
    }
    if ((opt.video != NULL) && (n > 1u)) { return evt_usage_error(&USAGE, "--video takes a single recording"); }
    evh_set_quiet(opt_quiet);
    if (n == 1u) { return replay_one(words[0], opt.output); }
    if (!words_are_right(words, n, &status)) { return status; }
    return evt_replay_batch(words, n, opt.output, (unsigned)n_jobs, replay_one);
}
