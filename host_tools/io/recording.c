/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include "recording.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "lines.h"

char *evh_path_join(const char *dir, const char *name)
{
    const size_t n = strlen(dir);
    const size_t bytes = n + strlen(name) + 2u;
    char *const path = malloc(bytes);
    if (path != NULL) {
        (void)snprintf(path, bytes, "%s%s%s", dir, ((n > 0u) && (dir[n - 1u] == '/')) ? "" : "/", name);
    }
    return path;
}

const char *evh_path_name(const char *path)
{
    const char *const slash = strrchr(path, '/');
    return ((slash != NULL) && (slash[1] != '\0')) ? slash + 1 : path;
}

bool evh_is_folder(const char *path)
{
    struct stat st;
    return (stat(path, &st) == 0) && S_ISDIR(st.st_mode);
}

bool evh_same_file(const char *a, const char *b)
{
    struct stat first;
    struct stat second;
    return (stat(a, &first) == 0) && (stat(b, &second) == 0) && (first.st_dev == second.st_dev) &&
           (first.st_ino == second.st_ino);
}

/* DIR/NAME or DIR/NAME.gz, whichever exists; NULL for none. */
static char *find_file(const char *dir, const char *name)
{
    char *path = evh_path_join(dir, name);
    if ((path != NULL) && !evh_file_exists(path)) {
        char with_gz[256];
        free(path);
        path = NULL;
        if (strlen(name) + 4u < sizeof with_gz) {
            (void)snprintf(with_gz, sizeof with_gz, "%s.gz", name);
            path = evh_path_join(dir, with_gz);
            if ((path != NULL) && !evh_file_exists(path)) {
                free(path);
                path = NULL;
            }
        }
    }
    return path;
}

static char *find_first(const char *dir, const char *const *names, size_t n)
{
    char *path = NULL;
    for (size_t i = 0u; (i < n) && (path == NULL); i++) { path = find_file(dir, names[i]); }
    return path;
}

static bool is_event_window(const char *name)
{
    const size_t n = strlen(name);
    if (strncmp(name, "events_", 7u) != 0) { return false; }
    return ((n > 4u) && (strcmp(name + n - 4u, ".txt") == 0)) || ((n > 7u) && (strcmp(name + n - 7u, ".txt.gz") == 0));
}

/* A folder of cut-out windows, events_FROM-TO.txt: usable when there is exactly one. */
static bool find_only_window(evh_recording_t *rec, const char *dir, evh_error_t *err)
{
    DIR *const folder = opendir(dir);
    const struct dirent *entry;
    char *found = NULL;
    bool ok = true;
    if (folder == NULL) { return evh_fail(err, "%s: %s", dir, strerror(errno)); }
    while (ok && ((entry = readdir(folder)) != NULL)) {
        if (!is_event_window(entry->d_name)) { continue; }
        if (found != NULL) {
            ok = evh_fail(err, "%s: holds several event files (%s, ...); name one of them instead of the folder", dir,
                          entry->d_name);
            break;
        }
        found = evh_path_join(dir, entry->d_name);
    }
    (void)closedir(folder);
    if (!ok) {
        free(found);
        return false;
    }
    rec->events = found;
    return true;
}

static bool find_in_folder(evh_recording_t *rec, const char *dir, evh_error_t *err)
{
    static const char *const IMU[] = {"imu.txt", "imu0/data.csv", "mav0/imu0/data.csv"};
    static const char *const POSES[] = {"groundtruth.txt", "state_groundtruth_estimate0/data.csv",
                                        "mav0/state_groundtruth_estimate0/data.csv"};
    static const char *const IMAGES[] = {"images.txt", "cam0/data.csv", "mav0/cam0/data.csv"};
    static const char *const CONFIG[] = {"cam0/sensor.yaml", "mav0/cam0/sensor.yaml"};
    static const char *const EVENTS[] = {"events.txt"};
    static const char *const CALIB[] = {"calib.txt"};

    rec->is_folder = true;
    rec->events = find_first(dir, EVENTS, 1u);
    rec->imu = find_first(dir, IMU, 3u);
    rec->poses = find_first(dir, POSES, 3u);
    rec->images = find_first(dir, IMAGES, 3u);
    rec->calib = find_first(dir, CALIB, 1u);
    if (rec->calib == NULL) { rec->config = find_first(dir, CONFIG, 2u); }
    return (rec->events != NULL) || find_only_window(rec, dir, err);
}

bool evh_recording_find(evh_recording_t *rec, const char *input, evh_error_t *err)
{
    struct stat st;
    memset(rec, 0, sizeof *rec);
    if (stat(input, &st) != 0) { return evh_fail(err, "%s: %s; check the path", input, strerror(errno)); }
    if (S_ISDIR(st.st_mode)) { return find_in_folder(rec, input, err); }
    rec->events = strdup(input);
    return (rec->events != NULL) || evh_fail(err, "%s: out of memory", input);
}

bool evh_recording_override(char **path, const char *given, evh_error_t *err)
{
    if (given == NULL) { return true; }
    free(*path);
    *path = strdup(given);
    if (*path == NULL) { return evh_fail(err, "out of memory"); }
    if (evh_is_folder(given)) { return evh_fail(err, "%s: is a folder, but a file is needed here", given); }
    return evh_file_exists(given) || evh_fail(err, "%s: no such file; check the path", given);
}

void evh_recording_free(evh_recording_t *rec)
{
    free(rec->events);
    free(rec->imu);
    free(rec->poses);
    free(rec->calib);
    free(rec->config);
    free(rec->images);
    memset(rec, 0, sizeof *rec);
}

bool evh_make_folder(const char *path, evh_error_t *err)
{
    char *const copy = strdup(path);
    bool ok = (copy != NULL);
    for (char *p = copy; ok && (p != NULL);) {
        p = strchr(p + 1, '/');
        if (p != NULL) { *p = '\0'; }
        if ((mkdir(copy, 0777) != 0) && (errno != EEXIST)) { break; }
        if (p != NULL) { *p = '/'; }
    }
    free(copy);
    if (!evh_is_folder(path)) {
        return evh_fail(err, "%s: cannot create the output folder: %s", path,
                        (errno == EEXIST) ? "a file of that name exists" : strerror(errno));
    }
    return true;
}
