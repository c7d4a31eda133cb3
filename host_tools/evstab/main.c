/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <stdio.h>
#include <string.h>

#include "command.h"
#include "evs/version.h"

static const struct {
    const char *name;
    const char *summary;
    int (*run)(int argc, char **argv);
} COMMANDS[] = {
    {"demo", "a simulated flight, stabilized, as a page to look at", evt_demo_main},
    {"replay", "a recording through the library: stabilized events, windows, attitude", evt_replay_main},
    {"attitude", "the attitude filter alone, on the samples of an IMU", evt_attitude_main},
    {"egomotion", "the direction of velocity alone, from flow vectors", evt_egomotion_main},
    {"eval", "what a run found against the truth: attitude, velocity, sharpness", evt_eval_main},
    {"lut", "the undistortion table of a camera as a C header for flash", evt_lut_main},
    {"info", "what a file or a folder holds, and what is wrong with it", evt_info_main},
    {"sim", "simulates an event camera in flight: events, IMU, frames and the truth", evt_sim_main},
    {"bench", "how fast the library is on this computer, step by step", evt_bench_main},
};

static void print_help(FILE *out)
{
    (void)fprintf(
        out,
        "evstab %s: stabilizes the view of a shaken event camera.\n\nUsage: evstab COMMAND [options]\n\nCommands:\n",
        EVS_VERSION_STRING);
    for (size_t i = 0; i < sizeof COMMANDS / sizeof COMMANDS[0]; i++) {
        (void)fprintf(out, "  %-10s %s\n", COMMANDS[i].name, COMMANDS[i].summary);
    }
    (void)fprintf(out,
                  "\n'evstab COMMAND --help' tells more about one of them; 'evstab --version' prints the version.\n");
}

/* What was printed must have arrived: on a full disk, say, it has not. */
static int finish(int status)
{
    if ((fflush(stdout) == 0) && (ferror(stdout) == 0)) { return status; }
    (void)fprintf(stderr, "evstab: cannot write to the standard output\n");
    return (status != EVT_EXIT_OK) ? status : EVT_EXIT_FAILED;
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        print_help(stderr);
        return EVT_EXIT_USAGE;
    }
    if ((strcmp(argv[1], "--help") == 0) || (strcmp(argv[1], "-h") == 0) || (strcmp(argv[1], "help") == 0)) {
        print_help(stdout);
        return finish(EVT_EXIT_OK);
    }
    if (strcmp(argv[1], "--version") == 0) {
        (void)printf("evstab %s\n", EVS_VERSION_STRING);
        return finish(EVT_EXIT_OK);
    }
    for (size_t i = 0; i < sizeof COMMANDS / sizeof COMMANDS[0]; i++) {
        if (strcmp(argv[1], COMMANDS[i].name) == 0) { return finish(COMMANDS[i].run(argc - 1, argv + 1)); }
    }
    (void)fprintf(stderr, "evstab: unknown command '%s'; 'evstab --help' lists them\n", argv[1]);
    return EVT_EXIT_USAGE;
}
