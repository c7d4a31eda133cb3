/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  recording.h
 * @brief Which files make up a recording: a folder in ECD or EuRoC form, or one file with the others named beside it.
 */
#ifndef EVH_RECORDING_H
#define EVH_RECORDING_H

#include <stdint.h>

#include "error.h"

/** Paths; NULL = there is none. Free with evh_recording_free(). */
typedef struct {
    char *events;
    char *imu;
    char *poses;
    char *calib;  /**< ECD calib.txt. */
    char *config; /**< A YAML file: EuRoC sensor.yaml. */
    char *images; /**< The list, images.txt or cam0/data.csv. */
    bool is_folder;
} evh_recording_t;

/** Look at @p input. What is missing stays NULL; only an input that cannot be read is an error. */
bool evh_recording_find(evh_recording_t *rec, const char *input, evh_error_t *err);

/** Replace a path by the user's, if one was given. */
bool evh_recording_override(char **path, const char *given, evh_error_t *err);

void evh_recording_free(evh_recording_t *rec);

/** A new string "DIR/NAME", or NULL. */
char *evh_path_join(const char *dir, const char *name);

/** What follows the last '/', for messages. */
const char *evh_path_name(const char *path);

/** Whether two paths name one existing file. */
bool evh_same_file(const char *a, const char *b);

bool evh_is_folder(const char *path);

/** Create the folder and its parents. */
bool evh_make_folder(const char *path, evh_error_t *err);

#endif
