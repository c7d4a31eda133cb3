/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* evstab bench: how fast the library is here, step by step. */
#include <stdio.h>
#include <string.h>

#include "bench.h"
#include "bench_events.h"
#include "command.h"
#include "evs/version.h"
#include "json.h"
#include "options.h"

static const char *opt_size, *opt_events, *opt_rounds, *opt_json;
static bool opt_quiet;

static const evt_option_t OPTIONS[] = {
    {"size", '\0', "WxH", "Sensor size, up to 2048x2048. Default: 240x180.", &opt_size, NULL},
    {"events", '\0', "N", "Events in a pass, 1000 .. 100000000. Default: 1000000.", &opt_events, NULL},
    {"rounds", '\0', "N", "Passes of each step, 1 .. 1000; the median counts. Default: 7.", &opt_rounds, NULL},
    {"json", '\0', "FILE", "Write the figures as JSON too.", &opt_json, NULL},
    {"quiet", 'q', NULL, "No notes, no table.", NULL, &opt_quiet},
};

static const evt_usage_t USAGE = {
    .command = "bench",
    .synopsis = "[options]",
    .about =
        "Times the hot path of the library on this computer, in one thread: nanoseconds per event of each step and of\n"
        "the whole pipeline, beside a plain copy of the events (memcpy), which no pass over them can beat. The\n"
        "events lie on 24 moving edges, 4 million a second; the undistortion table has a point per pixel, windows\n"
        "close by area count (34x26 tiles, 200 events), the camera swings by 6 degrees. All steps take turns, so\n"
        "that a busy moment of the computer hits all of them; the ratio to memcpy is what can be compared.",
    .examples = "  evstab bench\n  evstab bench --size 640x480 --events 5000000 --json bench.json",
    .options = OPTIONS,
    .n_options = sizeof OPTIONS / sizeof OPTIONS[0],
    .n_words_min = 0u,
    .n_words_max = 0u,
};

static const struct {
    const char *name;
    const char *key;
} STEPS[EVT_BENCH_STEPS] = {
    [EVT_BENCH_MEMCPY] = {"memcpy of the events", "memcpy"},
    [EVT_BENCH_UNDISTORT] = {"undistort, with tile", "undistort"},
    [EVT_BENCH_WINDOW] = {"window, area count", "window"},
    [EVT_BENCH_ROTATE] = {"rotate", "rotate"},
    [EVT_BENCH_PIPELINE] = {"whole pipeline", "pipeline"},
};

static void print(const evt_bench_t *b, const evt_bench_result_t *x, const char *cpu)
{
    (void)printf("evstab %s, commit %s, %s\n%s, one thread\n", EVS_VERSION_STRING, evt_build_commit(),
                 evt_build_compiler(), cpu);
    (void)printf("%ux%u, %zu events, medians of %u rounds\n\n", (unsigned)b->width_px, (unsigned)b->height_px,
                 b->n_events, b->n_rounds);
    (void)printf("%-22s %12s %12s %12s %10s\n", "", "ns per event", "least", "M events/s", "x memcpy");
    for (int i = 0; i < EVT_BENCH_STEPS; i++) {
        (void)printf("%-22s %12.2f %12.2f %12.1f %10.1f\n", STEPS[i].name, x->median_ns[i], x->least_ns[i],
                     1e3 / x->median_ns[i], x->median_ns[i] / x->median_ns[EVT_BENCH_MEMCPY]);
    }
}

static bool write_json(const evt_bench_t *b, const evt_bench_result_t *x, const char *cpu, evh_error_t *err)
{
    cJSON *const root = cJSON_CreateObject();
    cJSON *steps;
    evt_json_text(root, "program", "evstab bench");
    evt_json_text(root, "library_version", EVS_VERSION_STRING);
    evt_json_text(root, "commit", evt_build_commit());
    evt_json_text(root, "compiler", evt_build_compiler());
    evt_json_text(root, "flaw", evt_build_flaw());
    evt_json_text(root, "cpu", cpu);
    evt_json_count(root, "width_px", b->width_px);
    evt_json_count(root, "height_px", b->height_px);
    evt_json_count(root, "events", b->n_events);
    evt_json_count(root, "rounds", b->n_rounds);
    evt_json_count(root, "windows", x->n_windows);
    evt_json_count(root, "kept", x->n_kept);
    steps = cJSON_AddObjectToObject(root, "steps");
    for (int i = 0; i < EVT_BENCH_STEPS; i++) {
        cJSON *const step = cJSON_AddObjectToObject(steps, STEPS[i].key);
        evt_json_number(step, "ns_per_event", x->median_ns[i]);
        evt_json_number(step, "least_ns_per_event", x->least_ns[i]);
        evt_json_number(step, "events_per_s", 1e9 / x->median_ns[i]);
        evt_json_number(step, "ratio_to_memcpy", x->median_ns[i] / x->median_ns[EVT_BENCH_MEMCPY]);
    }
    return evt_json_write(root, opt_json, err);
}

static bool settle(evt_bench_t *b, int *status)
{
    int64_t n_events = 1000000;
    int64_t n_rounds = 7;
    b->width_px = 240u;
    b->height_px = 180u;
    *status = EVT_EXIT_OK;
    if ((opt_size != NULL) && !evt_parse_size(opt_size, &b->width_px, &b->height_px)) {
        *status = evt_usage_error(&USAGE, "--size is '%s'; expected WIDTHxHEIGHT, such as 240x180, up to 2048x2048",
                                  opt_size);
    } else if ((opt_events != NULL) && !evt_parse_int(opt_events, 1000, 100000000, &n_events)) {
        *status = evt_usage_error(&USAGE, "--events is '%s'; expected 1000 .. 100000000", opt_events);
    } else if ((opt_rounds != NULL) && !evt_parse_int(opt_rounds, 1, 1000, &n_rounds)) {
        *status = evt_usage_error(&USAGE, "--rounds is '%s'; expected 1 .. 1000", opt_rounds);
    }
    b->n_events = (size_t)n_events;
    b->n_rounds = (unsigned)n_rounds;
    return *status == EVT_EXIT_OK;
}

int evt_bench_main(int argc, char **argv)
{
    evt_bench_t b;
    evt_bench_result_t result;
    evh_error_t err = {""};
    char cpu[128];
    int status = EVT_EXIT_OK;

    if (!evt_options_parse(&USAGE, argc, argv, NULL, &status) || !settle(&b, &status)) { return status; }
    evh_set_quiet(opt_quiet);
    evt_cpu_name(cpu, sizeof cpu);
    if (evt_build_flaw() != NULL) { evh_note("this program is no measure: %s", evt_build_flaw()); }
    if (evt_bench_run(&b, &result, &err)) {
        if (!evh_is_quiet()) { print(&b, &result, cpu); }
        if ((opt_json == NULL) || write_json(&b, &result, cpu, &err)) { return EVT_EXIT_OK; }
    }
    (void)fprintf(stderr, "evstab bench: %s\n", err.text);
    return EVT_EXIT_FAILED;
}
