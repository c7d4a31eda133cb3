/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* evstab eval: what a run of evstab replay found, against the truth. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "decimal.h"
#include "eval.h"
#include "evaluation.h"
#include "json.h"
#include "lines.h"
#include "options.h"
#include "progress.h"
#include "recording.h"

#define OFFSET_MAX_US INT64_C(1000000000)

#define BASELINE_MS_DEFAULT 40

static const char *opt_truth, *opt_velocity_truth, *opt_json, *opt_align, *opt_offset, *opt_baseline, *opt_from,
    *opt_to;
static bool opt_sixdof, opt_ninedof, opt_quiet;

static const evt_option_t OPTIONS[] = {
    {"truth", '\0', "FILE", "Poses: t px py pz qx qy qz qw (ECD, TUM) or EuRoC's CSV.", &opt_truth, NULL},
    {"velocity-truth", '\0', "FILE",
     "Velocities in the camera's frame: t vx vy vz ... Default:\nthe poses, differentiated.", &opt_velocity_truth,
     NULL},
    {"sixdof", '\0', NULL, "The estimate has no magnetometer: same as --align heading.\nThe default.", NULL,
     &opt_sixdof},
    {"ninedof", '\0', NULL, "It has: same as --align none.", NULL, &opt_ninedof},
    {"align", '\0', "WHAT",
     "Constant rotations that are no error:\n"
     "none;  heading: one about the vertical;\n"
     "world: one between the worlds (the truth's z is not up);\n"
     "full: that, and one between tracked body and camera,\n"
     "by least squares over all samples.",
     &opt_align, NULL},
    {"poses-offset-us", '\0', "N", "t_event = t_pose + N, in microseconds. Default: 0.", &opt_offset, NULL},
    {"baseline-ms", '\0', "N", "Positions are differentiated over N ms, 2 .. 1000.\nDefault: 40.", &opt_baseline, NULL},
    {"from", '\0', "S", "First time to compare, in seconds of the events' clock.", &opt_from, NULL},
    {"to", '\0', "S", "Stop before this time.", &opt_to, NULL},
    {"json", '\0', "FILE", "Where the numbers go. Default: RUN/eval.json.", &opt_json, NULL},
    {"quiet", 'q', NULL, "No notes, no table.", NULL, &opt_quiet},
};

static const evt_usage_t USAGE = {
    .command = "eval",
    .synopsis = "RUN --truth FILE [options]",
    .about =
        "Compares a run (the output folder of evstab replay) with the truth, prints a table, writes eval.json\n"
        "and adds a section to the run's report.html, if it has one.\n"
        "  attitude   q_est q_ref^-1 in the earth's frame: total, inclination, heading; and the error of the rotation\n"
        "             over 0.1 s and 1 s, which is what stabilization feels. Truth is interpolated in gaps <= 0.1 s.\n"
        "             A heading or world is aligned over one second: the last before the truth starts to turn, if it\n"
        "             rests that long, else the first.\n"
        "  velocity   angle between the directions of velocity.csv and of the truth, in the camera's frame; samples\n"
        "             slower than 0.25 of the mean true speed are left out. How much of the time is covered, and how\n"
        "             many errors are as small as the estimates say they are.\n"
        "  sharpness  of events.csv (replay --write events): variance of the picture of events, blurred by 1 px, from\n"
        "             undistorted and from stabilized positions.",
    .examples = "  evstab eval out --truth groundtruth.txt\n"
                "  evstab eval out --truth groundtruth.txt --align full --poses-offset-us -6000",
    .options = OPTIONS,
    .n_options = sizeof OPTIONS / sizeof OPTIONS[0],
    .n_words_min = 1u,
    .n_words_max = 1u,
};

static bool settle_align(evt_eval_t *e, int *status)
{
    const int n_given = (opt_sixdof ? 1 : 0) + (opt_ninedof ? 1 : 0) + ((opt_align != NULL) ? 1 : 0);
    e->align = opt_ninedof ? EVL_ALIGN_NONE : EVL_ALIGN_HEADING;
    if (n_given > 1) {
        *status = evt_usage_error(&USAGE, "--sixdof, --ninedof and --align exclude each other");
        return false;
    }
    if (opt_align != NULL) {
        int i = 0;
        while ((i <= EVL_ALIGN_FULL) && (strcmp(evt_align_name((evl_align_kind_t)i), opt_align) != 0)) { i++; }
        if (i > EVL_ALIGN_FULL) {
            *status = evt_usage_error(&USAGE, "--align is '%s'; expected none, heading, world or full", opt_align);
            return false;
        }
        e->align = (evl_align_kind_t)i;
    }
    return true;
}

static bool settle(evt_eval_t *e, const char *run, int *status)
{
    int64_t baseline_ms = BASELINE_MS_DEFAULT;
    memset(e, 0, sizeof *e);
    e->run = run;
    e->truth = opt_truth;
    e->velocity_truth = opt_velocity_truth;
    e->from_us = INT64_MIN;
    e->to_us = INT64_MAX;
    *status = EVT_EXIT_OK;
    if ((opt_truth == NULL) && (opt_velocity_truth == NULL)) {
        *status = evt_usage_error(&USAGE, "--truth FILE is missing: what the run shall be compared with");
    } else if ((opt_offset != NULL) && !evt_parse_int(opt_offset, -OFFSET_MAX_US, OFFSET_MAX_US, &e->poses_offset_us)) {
        *status =
            evt_usage_error(&USAGE, "--poses-offset-us is '%s'; expected whole microseconds, up to 1000 s", opt_offset);
    } else if ((opt_baseline != NULL) && !evt_parse_int(opt_baseline, 2, 1000, &baseline_ms)) {
        *status = evt_usage_error(&USAGE, "--baseline-ms is '%s'; expected 2 .. 1000", opt_baseline);
    } else if ((opt_from != NULL) && !evt_parse_seconds(opt_from, &e->from_us)) {
        *status = evt_usage_error(&USAGE, "--from is '%s'; expected seconds, such as 12.5", opt_from);
    } else if ((opt_to != NULL) && !evt_parse_seconds(opt_to, &e->to_us)) {
        *status = evt_usage_error(&USAGE, "--to is '%s'; expected seconds, such as 12.5", opt_to);
    } else if (e->from_us >= e->to_us) {
        *status = evt_usage_error(&USAGE, "--from is not less than --to");
    } else if (settle_align(e, status)) {
        e->baseline_us = baseline_ms * 1000;
    }
    return *status == EVT_EXIT_OK;
}

/* What is in the folder of the run, and what is needed of its summary. */
typedef struct {
    char *attitude, *velocity, *pairs, *events, *windows, *json;
    uint16_t width_px, height_px;
    int64_t t_first_us, t_last_us; /* Of its events; equal when the summary does not tell. */
} run_t;

static void run_free(run_t *run)
{
    free(run->attitude);
    free(run->velocity);
    free(run->pairs);
    free(run->events);
    free(run->windows);
    free(run->json);
}

static bool run_open(run_t *run, const char *dir, evt_eval_result_t *x, evh_error_t *err)
{
    char *const summary = evh_path_join(dir, "summary.json");
    cJSON *root;
    double width;
    double height;
    memset(run, 0, sizeof *run);
    run->attitude = evh_path_join(dir, "attitude.csv");
    run->velocity = evh_path_join(dir, "velocity.csv");
    run->pairs = evh_path_join(dir, "pairs.csv");
    run->events = evh_path_join(dir, "events.csv");
    run->windows = evh_path_join(dir, "windows.csv");
    run->json = evh_path_join(dir, "eval.json");
    if ((summary == NULL) || (run->attitude == NULL) || (run->velocity == NULL) || (run->pairs == NULL) ||
        (run->events == NULL) || (run->windows == NULL) || (run->json == NULL)) {
        free(summary);
        return evh_fail(err, "out of memory");
    }
    if (!evh_is_folder(dir) || !evh_file_exists(summary)) {
        free(summary);
        return evh_fail(err, "%s: no run in it (summary.json is missing); expected the output folder of evstab replay",
                        dir);
    }
    root = evt_json_read(summary, err);
    if (root == NULL) {
        free(summary);
        return false;
    }
    (void)snprintf(x->attitude_source, sizeof x->attitude_source, "%s",
                   evt_json_get_text(root, "settings.attitude", "?"));
    width = evt_json_get_number(root, "settings.camera.width_px", 0.0);
    height = evt_json_get_number(root, "settings.camera.height_px", 0.0);
    run->t_first_us = llround(1e6 * evt_json_get_number(root, "t_first_s", 0.0));
    run->t_last_us = llround(1e6 * evt_json_get_number(root, "t_last_s", 0.0));
    cJSON_Delete(root);
    free(summary);
    if (!(width >= 1.0) || !(height >= 1.0) || (width > 65535.0) || (height > 65535.0)) {
        return evh_fail(err, "%s/summary.json: no sensor size in it; was it written by evstab replay?", dir);
    }
    run->width_px = (uint16_t)width;
    run->height_px = (uint16_t)height;
    return true;
}

static bool read_truth(evh_poses_t *poses, const evt_eval_t *e, evh_error_t *err)
{
    if (e->truth == NULL) { return true; }
    if (!evh_poses_read(poses, e->truth, err)) { return false; }
    evh_tally_report(&poses->tally, evh_path_name(e->truth));
    if (poses->n == 0u) { return evh_fail(err, "%s: holds no pose", e->truth); }
    for (size_t i = 0u; i < poses->n; i++) { poses->pose[i].t_us += e->poses_offset_us; }
    return true;
}

static const char *seconds(char text[32], int64_t t_us)
{
    text[evh_decimal_format(text, t_us, 6u)] = '\0';
    return text;
}

static bool no_overlap(const evt_eval_t *e, const char *estimates, int64_t est_first_us, int64_t est_last_us,
                       const char *truth, int64_t first_us, int64_t last_us, evh_error_t *err)
{
    char t[4][32];
    const bool whole = (e->from_us == INT64_MIN) && (e->to_us == INT64_MAX);
    return evh_fail(err, "%s: no truth at its times: it spans %s .. %s s, %s %s .. %s s%s; see --poses-offset-us%s",
                    estimates, seconds(t[0], est_first_us), seconds(t[1], est_last_us), truth, seconds(t[2], first_us),
                    seconds(t[3], last_us), (e->poses_offset_us != 0) ? " (shifted)" : "",
                    whole ? "" : ", --from, --to");
}

static bool eval_attitude(const evt_eval_t *e, const run_t *run, const evh_poses_t *truth, evt_eval_result_t *x,
                          evh_error_t *err)
{
    evh_poses_t est;
    bool ok = true;
    if (truth->n == 0u) { return true; }
    if (!evh_poses_read(&est, run->attitude, err)) { return false; }
    evh_tally_report(&est.tally, "attitude.csv");
    if (est.n == 0u) {
        evh_note("the run has no attitude: attitude.csv is empty");
        return true;
    }
    if (!evl_attitude_compare(&est, truth, e->from_us, e->to_us, e->align, &x->attitude)) {
        ok = evh_fail(err, "out of memory");
    } else if (x->attitude.total_deg.n == 0u) {
        ok = no_overlap(e, "attitude.csv", est.pose[0].t_us, est.pose[est.n - 1u].t_us, evh_path_name(e->truth),
                        truth->pose[0].t_us, truth->pose[truth->n - 1u].t_us, err);
    } else {
        x->has_attitude = true;
        if (!evl_align_is_told(&x->attitude.align, x->attitude.total_deg.rmse / EVL_DEG_PER_RAD)) {
            evh_note(
                "the motion turns by only %.2f deg about some axis: the mounting that was found is a guess; a longer "
                "run or --align world tells more",
                EVL_DEG_PER_RAD * x->attitude.align.spread_rad);
        }
        if ((strcmp(x->attitude_source, "gyro") == 0) && (e->align <= EVL_ALIGN_HEADING)) {
            evh_note("this run was replayed with --attitude gyro, which does not know where up is; see --align world");
        }
        if (strcmp(x->attitude_source, "truth") == 0) {
            evh_note("this run was replayed with --attitude truth: its attitude is no estimate");
        }
    }
    evh_poses_free(&est);
    return ok;
}

/* Of the time that the run and the comparison share. */
static double coverage(const evt_eval_t *e, const run_t *run, const evl_velocities_t *est)
{
    const int64_t from_us = (e->from_us > run->t_first_us) ? e->from_us : run->t_first_us;
    const int64_t to_us = (e->to_us < run->t_last_us) ? e->to_us : run->t_last_us;
    return (to_us > from_us) ? evl_velocity_coverage(est, from_us, to_us) : (double)NAN;
}

static bool eval_velocity(const evt_eval_t *e, const run_t *run, const evh_poses_t *poses, evt_eval_result_t *x,
                          evh_error_t *err)
{
    evl_velocities_t est;
    evl_velocities_t table;
    evl_velocity_truth_t truth = {NULL, poses, e->baseline_us, x->attitude.align.right};
    bool ok = true;
    if (!evh_file_exists(run->velocity)) {
        if (e->velocity_truth != NULL) { return evh_fail(err, "%s: the run has no velocity", run->velocity); }
        return true;
    }
    memset(&table, 0, sizeof table);
    if (!x->has_attitude) { truth.q_bc = evl_quat_identity(); }
    if (!evl_velocities_read(&est, run->velocity, err)) { return false; }
    x->n_no_estimate = est.tally.n_fault[EVH_FAULT_NOT_FINITE];
    est.tally.n_fault[EVH_FAULT_NOT_FINITE] = 0u; /* No fault of the file. */
    evh_tally_report(&est.tally, "velocity.csv");
    if (evh_file_exists(run->pairs)) { ok = evl_velocities_read_intervals(&est, run->pairs, err); }
    if (ok && (e->velocity_truth != NULL)) {
        ok = evl_velocities_read(&table, e->velocity_truth, err);
        evh_tally_report(&table.tally, evh_path_name(e->velocity_truth));
        truth.table = &table;
        if (ok && (table.n == 0u)) { ok = evh_fail(err, "%s: holds no velocity", e->velocity_truth); }
    }
    if (ok && (est.n == 0u)) {
        evh_note("velocity.csv holds no estimate");
    } else if (ok && !evl_velocity_compare(&est, &truth, e->from_us, e->to_us, &x->velocity)) {
        ok = evh_fail(err, "out of memory");
    } else if (ok && (x->velocity.error_deg.n == 0u)) {
        if (x->velocity.n_estimates == 0u) {
            evh_note("velocity.csv holds no estimate between --from and --to");
        } else if (x->velocity.n_slow > 0u) {
            evh_note("velocity.csv: nothing to compare, the camera does not move");
        } else {
            const bool from_table = (truth.table != NULL);
            ok = no_overlap(e, "velocity.csv", est.at[0].t_us, est.at[est.n - 1u].t_us,
                            evh_path_name(from_table ? e->velocity_truth : e->truth),
                            from_table ? table.at[0].t_us : poses->pose[0].t_us,
                            from_table ? table.at[table.n - 1u].t_us : poses->pose[poses->n - 1u].t_us, err);
        }
    } else {
        x->has_velocity = ok;
        x->coverage = coverage(e, run, &est);
    }
    evl_velocities_free(&table);
    evl_velocities_free(&est);
    return ok;
}

static void show_progress(void *progress, double fraction, uint64_t n_events)
{
    evt_progress_update(progress, fraction, n_events, "events");
}

static bool eval_sharpness(const evt_eval_t *e, const run_t *run, evt_eval_result_t *x, evh_error_t *err)
{
    evt_progress_t progress;
    const evl_waiting_t waiting = {show_progress, &progress};
    bool ok;
    if (!evh_file_exists(run->events)) {
        evh_note("no sharpness: the run has no events.csv; replay it with --write events");
        return true;
    }
    evt_progress_start(&progress);
    ok = evl_run_sharpness(&x->sharpness, run->events, run->windows, run->width_px, run->height_px, e->from_us,
                           e->to_us, &waiting, err);
    evt_progress_end(&progress);
    if (!ok) { return false; }
    if (!evl_gain(&x->sharpness.per_window, &x->per_window) || !evl_gain(&x->sharpness.per_100ms, &x->per_100ms)) {
        return evh_fail(err, "out of memory");
    }
    x->has_sharpness = (x->per_100ms.n > 0u);
    if (!x->has_sharpness) { evh_note("no sharpness: no event of events.csv has a stabilized position in this time"); }
    return true;
}

static bool eval_all(const evt_eval_t *e, const run_t *run, evt_eval_result_t *x, evh_error_t *err)
{
    evh_poses_t truth;
    bool ok;
    memset(&truth, 0, sizeof truth);
    ok = read_truth(&truth, e, err) && eval_attitude(e, run, &truth, x, err) && eval_velocity(e, run, &truth, x, err) &&
         eval_sharpness(e, run, x, err);
    evh_poses_free(&truth);
    if (ok && !x->has_attitude && !x->has_velocity && !x->has_sharpness) {
        ok = evh_fail(err, "%s: nothing in it can be compared with this truth", e->run);
    }
    return ok;
}

/* What stands in the file goes into the report too, without the single pictures: the page has its own plot of them. */
static bool put_into_report(const char *dir, const char *path, bool *found, evh_error_t *err)
{
    cJSON *const root = evt_json_read(path, err);
    char *text;
    bool ok;
    if (root == NULL) { return false; }
    const cJSON *const sharpness = cJSON_GetObjectItem(root, "sharpness");
    for (cJSON *kind = (sharpness != NULL) ? sharpness->child : NULL; kind != NULL; kind = kind->next) {
        cJSON_DeleteItemFromObject(kind, "pictures");
    }
    text = cJSON_PrintUnformatted(root);
    cJSON_Delete(root);
    if (text == NULL) { return evh_fail(err, "out of memory"); }
    ok = evr_put_evaluation(dir, text, found, err);
    cJSON_free(text);
    return ok;
}

int evt_eval_main(int argc, char **argv)
{
    static evt_eval_result_t x;
    const char *words[1];
    evt_eval_t e;
    run_t run;
    evh_error_t err = {""};
    int status = EVT_EXIT_OK;
    bool ok;

    if (!evt_options_parse(&USAGE, argc, argv, words, &status) || !settle(&e, words[0], &status)) { return status; }
    evh_set_quiet(opt_quiet);
    ok = run_open(&run, e.run, &x, &err) && eval_all(&e, &run, &x, &err);
    if (ok) {
        const char *const path = (opt_json != NULL) ? opt_json : run.json;
        bool in_report = false;
        ok = evt_eval_write_json(&e, &x, path, &err) && put_into_report(e.run, path, &in_report, &err);
        if (ok && !evh_is_quiet()) {
            evt_eval_print(&e, &x, stdout);
            (void)printf("wrote %s%s\n", path, in_report ? ", and a section of report.html" : "");
        }
    }
    evl_run_sharpness_free(&x.sharpness);
    run_free(&run);
    if (!ok) {
        (void)fprintf(stderr, "evstab eval: %s\n", err.text);
        return EVT_EXIT_FAILED;
    }
    return EVT_EXIT_OK;
}
