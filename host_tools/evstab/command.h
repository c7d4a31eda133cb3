/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  command.h
 * @brief What a subcommand of evstab is: a line in the table of main.c and a function.
 */
#ifndef EVT_COMMAND_H
#define EVT_COMMAND_H

#define EVT_EXIT_OK     0
#define EVT_EXIT_FAILED 1 /**< Bad input, or the run failed. */
#define EVT_EXIT_USAGE  2 /**< Bad usage: a word on the command line is wrong. */

/** @param argv  argv[0] is the command's own name. @return the exit status. */
int evt_attitude_main(int argc, char **argv);
int evt_bench_main(int argc, char **argv);
int evt_demo_main(int argc, char **argv);
int evt_egomotion_main(int argc, char **argv);
int evt_eval_main(int argc, char **argv);
int evt_info_main(int argc, char **argv);
int evt_lut_main(int argc, char **argv);
int evt_replay_main(int argc, char **argv);
int evt_sim_main(int argc, char **argv);

#endif
