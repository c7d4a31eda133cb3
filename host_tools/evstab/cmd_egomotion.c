/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* evstab egomotion: the direction of velocity alone, from flow vectors in a file. One output row per frame, also for
 * those that tell nothing, so that outputs line up with whatever else the user has per frame. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "csv_writer.h"
#include "decimal.h"
#include "evs/egomotion.h"
#include "evs/float.h"
#include "faults.h"
#include "flow_text.h"
#include "options.h"
#include "progress.h"
#include "recording.h"

#define HEADER "frame,vx,vy,vz,sigma_deg,n_inliers"

static const char *opt_out;
static const char *opt_method;
static const char *opt_rotation;
static bool opt_quiet;

static const evt_option_t OPTIONS[] = {
    {"method", '\0', "METHOD",
     "erlv (default: robust, signed), erlv-paper (as published)\nor erl (the rotation is unknown, as published).",
     &opt_method, NULL},
    {"rotation-sigma-deg", '\0', "S",
     "erlv: the flow still holds a rotation of about S degrees\nper axis (1 sigma, over the interval); it is "
     "estimated, too.\nDefault 0: none.",
     &opt_rotation, NULL},
    {"output", 'o', "FILE", "Write there instead of to the standard output.", &opt_out, NULL},
    {"quiet", 'q', NULL, "No progress, no notes, no closing line.", NULL, &opt_quiet},
};

static const evt_usage_t USAGE = {
    .command = "egomotion",
    .synopsis = "FLOW.csv [options]",
    .about =
        "Estimates the direction of the camera's own velocity from optical flow whose rotation has been removed. "
        "The header\n"
        "of FLOW.csv (plain or .gz) names the columns, in any order, further ones are ignored:\n"
        "  x,y,u,v[,frame]   position and displacement in calibrated units (K^-1 px); u = rho (x Vz - Vx), v = rho "
        "(y Vz - Vy)\n"
        "The lines of a frame are one problem and stand together; a file without that column is frame 0. Normal "
        "flow (the\n"
        "component across an edge) will not do. Output, one line per frame:\n"
        "  " HEADER "\n"
        "V is a unit vector. Where it cannot be told, sigma_deg is 180 and V the best guess.",
    .examples = "  evstab egomotion flow.csv\n  evstab egomotion flow.csv.gz --method erlv-paper -o v.csv",
    .options = OPTIONS,
    .n_options = sizeof OPTIONS / sizeof OPTIONS[0],
    .n_words_min = 1u,
    .n_words_max = 1u,
};

/* --- vectors of the frame being read ---------------------------------------------------------------------------- */

typedef struct {
    evh_flow_row_t *row;
    size_t n;
    size_t cap;
    int64_t frame;
    bool open;
} problem_t;

static bool keep(problem_t *p, const evh_flow_row_t *row, const char *path, evh_error_t *err)
{
    if (p->n == EVS_EGOMOTION_N_MAX) {
        return evh_fail(err, "%s: line %" PRIu64 ": more than %u vectors in frame %" PRId64, path, row->line,
                        EVS_EGOMOTION_N_MAX, p->frame);
    }
    if (p->n == p->cap) {
        const size_t cap = (p->cap == 0u) ? 1024u : 2u * p->cap;
        evh_flow_row_t *const more = realloc(p->row, cap * sizeof more[0]);
        if (more == NULL) { return evh_fail(err, "out of memory"); }
        p->row = more;
        p->cap = cap;
    }
    p->row[p->n++] = *row;
    return true;
}

/* --- frames that have been ---------------------------------------------------------------------------------------- */

typedef struct {
    int64_t *frame; /* ascending */
    size_t n;
    size_t cap;
} seen_t;

/* @return false when the frame was there before, or there is no memory (see err). */
static bool add_frame(seen_t *seen, int64_t frame, evh_error_t *err)
{
    size_t at = seen->n;
    if ((at > 0u) && (frame <= seen->frame[at - 1u])) { /* usually they ascend */
        size_t low = 0u;
        while (low < at) {
            const size_t middle = low + (at - low) / 2u;
            if (seen->frame[middle] < frame) {
                low = middle + 1u;
            } else {
                at = middle;
            }
        }
        if (seen->frame[at] == frame) { return false; }
    }
    if (seen->n == seen->cap) {
        const size_t cap = (seen->cap == 0u) ? 256u : 2u * seen->cap;
        int64_t *const more = realloc(seen->frame, cap * sizeof more[0]);
        if (more == NULL) { return evh_fail(err, "out of memory"); }
        seen->frame = more;
        seen->cap = cap;
    }
    memmove(&seen->frame[at + 1u], &seen->frame[at], (seen->n - at) * sizeof seen->frame[0]);
    seen->frame[at] = frame;
    seen->n++;
    return true;
}

/* --- solving ------------------------------------------------------------------------------------------------------ */

/* Displacements count relative to each other: scaled by a power of two such that the largest just fits, none of their
 * digits is lost. Positions are what they are. With a prior in radians they must be, too. */
static double scale_of(const problem_t *p, const evs_egomotion_config_t *cfg)
{
    double most = 0.0;
    int exponent = 0;
    if (cfg->rotation_sigma_rad_q28 > 0) { return 1.0; }
    for (size_t i = 0u; i < p->n; i++) { most = fmax(most, fmax(fabs(p->row[i].u), fabs(p->row[i].v))); }
    (void)frexp(most, &exponent); /* most < 2^exponent */
    return (most > 0.0) ? ldexp(1.0, 6 - exponent) : 1.0;
}

static bool solve(const problem_t *p, const evs_egomotion_config_t *cfg, evs_egomotion_result_t *result,
                  evh_error_t *err)
{
    const size_t n = (p->n > 0u) ? p->n : 1u; /* malloc(0) may be NULL */
    evs_egomotion_flow_t *const flow = malloc(n * sizeof flow[0]);
    void *const scratch = malloc(EVS_EGOMOTION_PAPER_BYTES(n));
    bool ok = (flow != NULL) && (scratch != NULL);
    if (ok) {
        const double scale = scale_of(p, cfg);
        for (size_t i = 0u; i < p->n; i++) {
            const evh_flow_row_t *const r = &p->row[i];
            flow[i] =
                (evs_egomotion_flow_t){evs_q_from_double(r->x, 24u), evs_q_from_double(r->y, 24u),
                                       evs_q_from_double(r->u * scale, 24u), evs_q_from_double(r->v * scale, 24u)};
        }
        ok = evs_egomotion_solve(cfg, flow, p->n, scratch, EVS_EGOMOTION_PAPER_BYTES(n), result) == EVS_OK;
        if (!ok) { (void)evh_fail(err, "the solver refuses its settings"); }
    } else {
        (void)evh_fail(err, "out of memory");
    }
    free(flow);
    free(scratch);
    return ok;
}

static char *put_row(char *p, int64_t frame, const evs_egomotion_result_t *r)
{
    const int32_t v[3] = {r->v_q30.x, r->v_q30.y, r->v_q30.z};
    const bool valid = (r->flags & (uint32_t)EVS_EGOMOTION_VALID) != 0u;
    p = evh_put_int(p, frame);
    for (int i = 0; i < 3; i++) {
        *p++ = ',';
        p = evh_put_q(p, v[i], 30u, 9u);
    }
    *p++ = ',';
    /* rad Q28 to deg Q20: 180 / pi * 2^-8 */
    const int32_t sigma_deg_q20 =
        valid ? (int32_t)(((int64_t)r->sigma_rad_q28 * INT64_C(240302) + (INT64_C(1) << 19)) >> 20) : (180 << 20);
    p = evh_put_q(p, sigma_deg_q20, 20u, 4u);
    *p++ = ',';
    p = evh_put_uint(p, r->n_inliers);
    *p++ = '\n';
    return p;
}

/* --- the run ------------------------------------------------------------------------------------------------------ */

typedef struct {
    evh_flow_t flow;
    evs_egomotion_config_t cfg;
    problem_t problem;
    seen_t seen;
    evh_csv_t *csv; /* NULL: the standard output */
    uint64_t n_frames;
    uint64_t n_unsolved;
    const char *path;
} run_t;

static bool finish_problem(run_t *run, evh_error_t *err)
{
    evs_egomotion_result_t result;
    char line[160];
    if (!run->problem.open) { return true; }
    if (!solve(&run->problem, &run->cfg, &result, err)) { return false; }
    if (run->csv != NULL) {
        evh_csv_advance(run->csv, put_row(evh_csv_reserve(run->csv, sizeof line), run->problem.frame, &result));
    } else {
        (void)fwrite(line, 1u, (size_t)(put_row(line, run->problem.frame, &result) - line), stdout);
    }
    run->n_frames++;
    if ((result.flags & (uint32_t)EVS_EGOMOTION_VALID) == 0u) { run->n_unsolved++; }
    run->problem.open = false;
    run->problem.n = 0u;
    return true;
}

static bool take(run_t *run, const evh_flow_row_t *row, evh_error_t *err)
{
    problem_t *const p = &run->problem;
    if (!row->has_frame) { return true; } /* nobody knows whose it is; it is counted */
    if (!p->open || (row->frame != p->frame)) {
        if (!finish_problem(run, err)) { return false; }
        if (!add_frame(&run->seen, row->frame, err)) {
            return evh_fail(err,
                            "%s: line %" PRIu64 ": frame %" PRId64 " was there before; the lines of a frame must "
                            "stand together: sort the file by frame",
                            run->path, row->line, row->frame);
        }
        p->frame = row->frame;
        p->open = true;
    }
    return (row->fault != EVH_FAULT_NONE) || keep(p, row, run->path, err);
}

static bool run_all(run_t *run, evh_error_t *err)
{
    evh_flow_row_t row;
    evt_progress_t progress;
    bool ok = true;
    if (run->csv == NULL) { (void)puts(HEADER); }
    evt_progress_start(&progress);
    while (ok && evh_flow_next(&run->flow, &row, err)) {
        ok = take(run, &row, err);
        if (run->csv != NULL) {
            evt_progress_update(&progress, evh_lines_fraction(&run->flow.lines), run->n_frames, "frames");
        }
    }
    ok = ok && finish_problem(run, err); /* of a damaged file, too: what could be read counts */
    evt_progress_end(&progress);
    return ok && (err->text[0] == '\0');
}

static bool egomotion(const char *in_path, const char *out_path, const evs_egomotion_config_t *cfg, evh_error_t *err)
{
    run_t run = {.cfg = *cfg, .path = in_path};
    evh_csv_t csv;
    bool ok;
    if (!evh_flow_open(&run.flow, in_path, err)) { return false; }
    if (out_path != NULL) {
        if (evh_same_file(in_path, out_path)) {
            evh_flow_close(&run.flow);
            return evh_fail(err, "%s: the output would overwrite the input", out_path);
        }
        if (!evh_csv_open_path(&csv, out_path, HEADER, err)) {
            evh_flow_close(&run.flow);
            return false;
        }
        run.csv = &csv;
    }
    ok = run_all(&run, err);
    if (run.csv != NULL) { ok = evh_csv_close(&csv, err) && ok; }
    evh_tally_report(&run.flow.tally, evh_path_name(in_path));
    if (ok && (run.flow.tally.n_good == 0u)) { ok = evh_fail(err, "%s: holds no flow vector", in_path); }
    if (ok && (run.n_unsolved > 0u)) {
        evh_note("%" PRIu64 " of %" PRIu64 " frames tell no direction: sigma_deg is 180 there", run.n_unsolved,
                 run.n_frames);
    }
    if (ok && (out_path != NULL) && !evh_is_quiet()) {
        (void)printf("%s: %" PRIu64 " frames, %" PRIu64 " of them tell no direction\n", out_path, run.n_frames,
                     run.n_unsolved);
    }
    free(run.problem.row);
    free(run.seen.frame);
    evh_flow_close(&run.flow);
    return ok;
}

/* Degrees, to 2^28 per rad. */
static bool parse_rotation(const char *text, int32_t *sigma_rad_q28)
{
    const char *p = text;
    const char *const end = text + strlen(text);
    int64_t micro_deg = 0;
    if (!evh_decimal_parse(&p, end, 6, &micro_deg, NULL) || (p != end) || (micro_deg < 0) || (micro_deg > 50000000)) {
        return false;
    }
    *sigma_rad_q28 = evs_q_from_double((double)micro_deg * 1e-6 * 0.017453292519943295, 28u);
    return true;
}

int evt_egomotion_main(int argc, char **argv)
{
    static const char *const METHODS[] = {"erlv", "erlv-paper", "erl"};
    static const evs_egomotion_method_t METHOD_VALUES[] = {EVS_EGOMOTION_ROBUST, EVS_EGOMOTION_PAPER,
                                                           EVS_EGOMOTION_ERL};
    const char *words[1];
    evs_egomotion_config_t cfg = evs_egomotion_config_default();
    evh_error_t err = {""};
    int status = EVT_EXIT_OK;

    if (!evt_options_parse(&USAGE, argc, argv, words, &status)) { return status; }
    if (opt_method != NULL) {
        size_t method = 0u;
        while ((method < 3u) && (strcmp(opt_method, METHODS[method]) != 0)) { method++; }
        if (method == 3u) {
            return evt_usage_error(&USAGE, "--method is '%s'; expected erlv, erlv-paper or erl", opt_method);
        }
        cfg.method = METHOD_VALUES[method];
    }
    if (opt_rotation != NULL) {
        if (!parse_rotation(opt_rotation, &cfg.rotation_sigma_rad_q28)) {
            return evt_usage_error(&USAGE, "--rotation-sigma-deg is '%s'; expected degrees from 0 to 50", opt_rotation);
        }
        if (cfg.method != EVS_EGOMOTION_ROBUST) {
            return evt_usage_error(&USAGE, "--rotation-sigma-deg is for --method erlv");
        }
    }
    evh_set_quiet(opt_quiet);
    if (!egomotion(words[0], opt_out, &cfg, &err)) {
        (void)fprintf(stderr, "evstab egomotion: %s\n", err.text);
        return EVT_EXIT_FAILED;
    }
    return EVT_EXIT_OK;
}
