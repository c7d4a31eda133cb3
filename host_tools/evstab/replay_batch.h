/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  replay_batch.h
 * @brief evstab replay of several recordings: each in a process and a folder of its own, one table over all.
 */
#ifndef EVT_REPLAY_BATCH_H
#define EVT_REPLAY_BATCH_H

#include <stddef.h>

#define EVT_BATCH_MAX          4096u /**< Recordings on one command line. */
#define EVT_BATCH_PARALLEL_MAX 1024

/**
 * @param output      Gets a folder per recording, with its results and log.txt, and summary.csv.
 * @param replay_one  Replays one recording into a folder; runs in a process of its own. @return exit status.
 * @return exit status: 1 if any recording failed.
 */
int evt_replay_batch(const char *const *inputs, size_t n, const char *output, unsigned n_parallel,
                     int (*replay_one)(const char *input, const char *output));

#endif
