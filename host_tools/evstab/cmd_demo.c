/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* evstab demo: a flight that shakes, simulated, replayed, and shown. For whoever has no recording at hand. */
#define _POSIX_C_SOURCE 200809L
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "command.h"
#include "options.h"
#include "pool.h"
#include "progress.h"
#include "replay.h"
#include "sim.h"

#define DURATION_MAX_US INT64_C(60000000)
#define SMEAR_S         0.02
#define DEG             57.295779513082320877

static struct {
    const char *output, *duration, *seed;
    bool quiet;
} opt;

static const evt_option_t OPTIONS[] = {
    {"output", 'o', "DIR", "Folder for the flight and the results; made if need be.\nDefault: evstab_demo.",
     &opt.output, NULL},
    {"duration", '\0', "S", "Seconds of flight, up to 60. Default 3.", &opt.duration, NULL},
    {"seed", '\0', "N", "Another seed, another flight. Default 1.", &opt.seed, NULL},
    {"quiet", 'q', NULL, "No progress; only the numbers at the end.", NULL, &opt.quiet},
};

static const evt_usage_t USAGE = {
    .command = "demo",
    .synopsis = "[-o DIR] [options]",
    .about =
        "Simulates a flapping-wing flight through a room ('evstab sim room'), replays its events and IMU samples\n"
        "('evstab replay'), and tells what stabilization did: the same events are measured with and without it, and "
        "the\n"
        "direction of flight is compared with the truth.\n"
        "Writes DIR/flight, the recording, and into DIR what replay writes: report.html to look at, and the files.",
    .examples = "  evstab demo\n"
                "  evstab demo -o /tmp/demo --duration 6",
    .options = OPTIONS,
    .n_options = sizeof OPTIONS / sizeof OPTIONS[0],
};

static void show_progress(void *context, double fraction, uint64_t n_events)
{
    evt_progress_update(context, fraction, n_events, "events");
}

static bool settle(evsim_settings_t *s, int *status)
{
    const long processors = sysconf(_SC_NPROCESSORS_ONLN);
    int64_t seed = 1;
    evsim_settings_default(s, EVSIM_SCENE_ROOM);
    s->frames = false; /* Nothing here looks at them. */
    s->jobs = (processors > 0) ? (unsigned)processors : 1u;
    if (s->jobs > EVSIM_THREADS_MAX) { s->jobs = EVSIM_THREADS_MAX; }
    if ((opt.duration != NULL) && (!evt_parse_seconds(opt.duration, &s->duration_us) || (s->duration_us < 100000) ||
                                   (s->duration_us > DURATION_MAX_US))) {
        *status = evt_usage_error(&USAGE, "--duration is '%s'; expected seconds from 0.1 to 60", opt.duration);
        return false;
    }
    if ((opt.seed != NULL) && !evt_parse_int(opt.seed, 0, INT64_MAX, &seed)) {
        *status = evt_usage_error(&USAGE, "--seed is '%s'; expected a whole number from 0 on", opt.seed);
        return false;
    }
    s->seed = (uint64_t)seed;
    return true;
}

static bool simulate(const evsim_settings_t *s, const char *dir, evsim_result_t *flight, evh_error_t *err)
{
    evt_progress_t progress;
    bool ok;
    if (!evh_is_quiet()) { (void)printf("simulating %.3g s of flapping-wing flight\n", (double)s->duration_us * 1e-6); }
    (void)fflush(stdout); /* Before the progress, which goes to stderr. */
    evt_progress_start(&progress);
    ok = evsim_run(s, dir, show_progress, &progress, flight, err);
    evt_progress_end(&progress);
    return ok;
}

static void print_numbers(const evt_replay_outcome_t *x, const char *flight)
{
    const evr_numbers_t *const n = &x->numbers;
    const double ns = (double)x->result.library_ns / (double)x->result.n_events;
    (void)printf("%s: %" PRIu64 " events in %.3g s of flight\n", flight, x->result.n_events,
                 (double)(x->result.t_last_us - x->result.t_first_us) * 1e-6);
    (void)printf("  sharpness  x%.2f: %.3g without stabilization, %.3g with it\n",
                 (n->sharpness_before > 0.0) ? n->sharpness_after / n->sharpness_before : 0.0, n->sharpness_before,
                 n->sharpness_after);
    (void)printf(
        "  rotation   %.3g deg/s removed on average, %.3g at most: a smear of %.3g px in 20 ms, %.3g at most\n",
        n->rate_rad_s * DEG, n->rate_max_rad_s * DEG, n->motion_px_s * SMEAR_S, n->motion_max_px_s * SMEAR_S);
    if (n->n_directions_true > 0u) {
        (void)printf("  direction  of flight within %.1f deg of the truth in half of %" PRIu64 " measurements\n",
                     n->direction_error_deg, n->n_directions_true);
    }
    (void)printf("  speed      %.3g ns per event in the library: %.3g million events/s on one core\n", ns, 1e3 / ns);
}

static int demo(const evsim_settings_t *settings, const char *flight)
{
    static evt_replay_outcome_t outcome;
    const evt_replay_options_t replay = {.input = flight, .output = opt.output};
    evsim_result_t result;
    evh_error_t err = {""};
    int status;
    if (!evh_make_folder(opt.output, &err) || !simulate(settings, flight, &result, &err)) {
        (void)fprintf(stderr, "evstab demo: %s\n", err.text);
        return EVT_EXIT_FAILED;
    }
    evh_set_quiet(true); /* Only the numbers that matter. */
    status = evt_replay_perform(&replay, &outcome);
    if (status != EVT_EXIT_OK) { return status; }
    print_numbers(&outcome, flight);
    (void)printf("look at %s%sreport.html\n", opt.output, (opt.output[strlen(opt.output) - 1u] == '/') ? "" : "/");
    return EVT_EXIT_OK;
}

int evt_demo_main(int argc, char **argv)
{
    evsim_settings_t settings;
    char *flight;
    int status = EVT_EXIT_OK;
    if (!evt_options_parse(&USAGE, argc, argv, NULL, &status) || !settle(&settings, &status)) { return status; }
    if (opt.output == NULL) { opt.output = "evstab_demo"; }
    evh_set_quiet(opt.quiet);
    flight = evh_path_join(opt.output, "flight");
    if (flight == NULL) {
        (void)fprintf(stderr, "evstab demo: out of memory\n");
        return EVT_EXIT_FAILED;
    }
    status = demo(&settings, flight);
    free(flight);
    return status;
}
