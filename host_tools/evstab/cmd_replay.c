/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* evstab replay: a recording through the library, the same code as on a microcontroller. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "command.h"
#include "decimal.h"
#include "faults.h"
#include "jobs.h"
#include "options.h"
#include "replay.h"
#include "replay_batch.h"

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
     "Default: area:34x26:200.",
     &opt.window, NULL},
    {"rotation", '\0', "MODE",
     "slice: follow the attitude within a window (default);\nwindow: one rotation per window, as the paper.",
     &opt.rotation, NULL},
    {"saccade", '\0', "on|off",
     "Move the reference when the view has turned away by a\nsixth of the image width. Default: on.", &opt.saccade,
     NULL},
    {"calib", '\0', "FILE", "Camera: fx fy cx cy k1 k2 p1 p2 k3, or YAML.", &opt.calib, NULL},
    {"imu", '\0', "FILE", "IMU samples: t ax ay az gx gy gz in text, or CSV\nwith a header.", &opt.imu, NULL},
    {"imu-order", '\0', "ORDER",
     "accel-first, gyro-first or a list of columns such as\nt,gx,gy,gz,ax,ay,az (\"_\" skips one). Default: found out.",
     &opt.imu_order, NULL},
    {"imu-offset-us", '\0', "N",
     "t_event = t_imu + N, in microseconds; with --attitude truth\nthe same for the poses. Default: 0.",
     &opt.imu_offset, NULL},
    {"poses", '\0', "FILE", "Poses: t px py pz qx qy qz qw, or CSV with a header.", &opt.poses, NULL},
    {"config", '\0', "FILE.yaml",
     "Camera, extrinsics and window with the paper's names:\n"
     "K D fisheye_distortion q_external accumulation_type\n"
     "roi_threshold number_of_columns number_of_rows ...",
     &opt.config, NULL},
    {"size", '\0', "WxH", "Sensor size in pixels. Default: what the YAML file says,\nelse 240x180.", &opt.size, NULL},
    {"paper", '\0', NULL,
     "The published settings: one rotation per window, 34x26\ntiles, threshold 200, 50 or 500 by sensor, saccade at "
     "W/6.",
     NULL, &opt.paper},
    {"from", '\0', "S", "First time to replay, in seconds of the recording's clock.", &opt.from, NULL},
    {"to", '\0', "S", "Stop before this time.", &opt.to, NULL},
    {"write", '\0', "events", "Also write events.csv, a row per event.", &opt.write, NULL},
    {"quiet", 'q', NULL, "No progress, no notes, no closing line.", NULL, &opt_quiet},
};

static const evt_usage_t USAGE = {
    .command = "replay",
    .synopsis = "INPUT... -o DIR [options]",
    .about = "Replays a recording through the library. INPUT is a folder in ECD form (events.txt imu.txt "
             "groundtruth.txt calib.txt,\n"
             "each also .gz) or one event file (\"t x y p\" lines); files outside of it are named by options.\n"
             "Writes into DIR: summary.json, attitude.csv (world from camera, per sample), windows.csv, and events.csv "
             "on demand.\n"
             "Several INPUTs: each is replayed by a process of its own into DIR/NAME, with what it had to say in "
             "log.txt;\n"
             "DIR/summary.csv has a row for each. Exit status 1 if any of them failed.",
    .examples = "  evstab replay slider_depth -o out\n"
                "  evstab replay events_02.097-02.196.txt --calib calib.txt --imu imu.txt -o out --write events\n"
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

static void report(const evt_replay_t *r, const evt_replay_result_t *x)
{
    evh_tally_report(&x->events_tally, evh_path_name(r->rec.events));
    if (r->rec.imu != NULL) { evh_tally_report(&x->imu_tally, evh_path_name(r->rec.imu)); }
    if (r->rec.poses != NULL) { evh_tally_report(&x->poses_tally, evh_path_name(r->rec.poses)); }
    report_unoriented(x);
    evt_note_attitude_faults(&x->attitude_faults);
    if (x->n_no_undistorted + x->n_out_of_range > 0u) {
        evh_note("%" PRIu64 " of %" PRIu64 " events have no position: %" PRIu64 " under the lens model, %" PRIu64
                 " rotated out of range",
                 x->n_no_undistorted + x->n_out_of_range, x->n_events, x->n_no_undistorted, x->n_out_of_range);
    }
    if ((x->events_tally.n_fault[EVH_FAULT_OFF_SENSOR] > 0u) && (opt.size == NULL)) {
        evh_note("the sensor is taken as %ux%u; --size says otherwise", (unsigned)r->calib.width_px,
                 (unsigned)r->calib.height_px);
    }
}

static void print_result(const evt_replay_t *r, const evt_replay_result_t *x)
{
    char duration[32];
    if (evh_is_quiet()) { return; }
    duration[evh_decimal_format(duration, x->t_last_us - x->t_first_us, 6u)] = '\0';
    (void)printf("%s: %" PRIu64 " events in %s s, %" PRIu64 " windows, %" PRIu64
                 " saccades; %.1f ns per event in the library, %.1f in all\n"
                 "wrote %s/: summary.json attitude.csv windows.csv%s\n",
                 evh_path_name(r->rec.events), x->n_events, duration, x->n_windows, x->n_saccades,
                 (double)x->library_ns / (double)x->n_events, (double)x->wall_ns / (double)x->n_events, opt.output,
                 r->write_events ? " events.csv" : "");
}

static int replay(const evt_replay_t *r)
{
    evt_replay_result_t result;
    evh_error_t err = {""};
    evh_error_t summary_err = {""};
    const bool ok = evt_replay_run(r, opt.output, &result, &err);
    bool written = true;
    if (result.n_events > 0u) {
        report(r, &result); /* Also after a failure: what was read is there, and the summary says how far. */
        written = evt_replay_write_summary(r, &opt, &result, opt.output, ok ? NULL : err.text, &summary_err);
    }
    if (!ok || !written) {
        (void)fprintf(stderr, "evstab replay: %s\n", ok ? summary_err.text : err.text);
        return EVT_EXIT_FAILED;
    }
    print_result(r, &result);
    return EVT_EXIT_OK;
}

/* One recording, after the words of the command line have been taken. */
static int replay_one(const char *input, const char *output)
{
    evt_replay_t r;
    evh_error_t err = {""};
    bool usage_fault = false;
    int status = EVT_EXIT_OK;
    opt.input = input;
    opt.output = output;
    if (!evt_replay_settle(&r, &opt, &usage_fault, &err)) {
        status = EVT_EXIT_FAILED;
        if (usage_fault) {
            status = evt_usage_error(&USAGE, "%s", err.text);
        } else {
            (void)fprintf(stderr, "evstab replay: %s\n", err.text);
        }
    } else {
        status = replay(&r);
    }
    evt_replay_free(&r);
    return status;
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
    evh_set_quiet(opt_quiet);
    if (n == 1u) { return replay_one(words[0], opt.output); }
    if (!words_are_right(words, n, &status)) { return status; }
    return evt_replay_batch(words, n, opt.output, (unsigned)n_jobs, replay_one);
}
