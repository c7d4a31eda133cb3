/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include "replay_batch.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "command.h"
#include "jobs.h"
#include "json.h"
#include "lines.h"
#include "names.h"
#include "recording.h"

#define HEADER       "#recording,input,status,events,windows,saccades,kept,ns_per_event,message"
#define ERROR_PREFIX "evstab replay: "

typedef struct {
    const char *const *inputs;
    size_t n;
    const char *output;
    int (*replay_one)(const char *input, const char *output);
    char **names;
    FILE *table;
    size_t n_failed;
    bool quiet;
} batch_t;

/* OUT/NAME/FILE, or OUT/NAME when file is NULL. NULL when memory is short. */
static char *path_of(const batch_t *b, size_t i, const char *file)
{
    char *const dir = evh_path_join(b->output, b->names[i]);
    char *path = dir;
    if ((dir != NULL) && (file != NULL)) {
        path = evh_path_join(dir, file);
        free(dir);
    }
    return path;
}

/* --- in the process of a recording ----------------------------------------------------------------------------------
 */

static int run_one(void *user, size_t i)
{
    const batch_t *const b = user;
    char *const dir = path_of(b, i, NULL);
    char *const log = path_of(b, i, "log.txt");
    char *const summary = path_of(b, i, "summary.json");
    evh_error_t err = {""};
    int status = EVT_EXIT_FAILED;
    if ((dir != NULL) && (log != NULL) && (summary != NULL) && evh_make_folder(dir, &err)) {
        (void)unlink(summary); /* What an earlier run found must not stand beside what this one failed at. */
        if ((freopen(log, "w", stdout) != NULL) && (dup2(STDOUT_FILENO, STDERR_FILENO) >= 0)) {
            (void)setvbuf(stdout, NULL, _IOLBF, 0u);
            (void)printf("input: %s\n", b->inputs[i]);
            evh_set_quiet(false); /* --quiet is about the terminal. */
            status = b->replay_one(b->inputs[i], dir);
        }
    }
    free(summary);
    free(log);
    free(dir);
    return status;
}

/* --- in the process of the batch ------------------------------------------------------------------------------------
 */

/* The last error in the log, without its prefix. */
static void error_from_log(const batch_t *b, size_t i, char *message, size_t bytes)
{
    char *const path = path_of(b, i, "log.txt");
    evh_lines_t lines;
    evh_line_t line;
    evh_error_t ignored = {""};
    const size_t skip = strlen(ERROR_PREFIX);
    (void)snprintf(message, bytes, "no log: cannot write into %s/%s", b->output, b->names[i]);
    if ((path != NULL) && evh_lines_open(&lines, path, &ignored)) {
        (void)snprintf(message, bytes, "failed; see its log.txt");
        while (evh_lines_next(&lines, &line, &ignored)) {
            if ((line.length > skip) && (memcmp(line.text, ERROR_PREFIX, skip) == 0)) {
                const size_t n = line.length - skip;
                (void)snprintf(message, bytes, "%.*s", (int)((n < bytes) ? n : bytes - 1u), line.text + skip);
            }
        }
        evh_lines_close(&lines);
    }
    free(path);
}

static void put_quoted(FILE *out, const char *text)
{
    (void)fputc('"', out);
    for (; *text != '\0'; text++) {
        if (*text == '"') { (void)fputc('"', out); }
        (void)fputc(*text, out);
    }
    (void)fputc('"', out);
}

/* Numbers of the recording's own summary; what is not known stays empty. */
static void put_numbers(FILE *out, const cJSON *summary)
{
    static const char *const KEYS[] = {"events.replayed", "windows", "saccades", "events.kept", "ns_per_event"};
    for (size_t k = 0u; k < sizeof KEYS / sizeof KEYS[0]; k++) {
        const double value = evt_json_get_number(summary, KEYS[k], -1.0);
        (void)fputc(',', out);
        if (value >= 0.0) { (void)fprintf(out, (k == 4u) ? "%.4g" : "%.0f", value); }
    }
}

static void tell(const batch_t *b, size_t i, bool ok, const cJSON *summary, const char *message)
{
    if (b->quiet) { return; }
    (void)printf("[%zu/%zu] %s: ", i + 1u, b->n, b->names[i]);
    if (ok) {
        (void)printf("%.0f events, %.0f windows, %.0f saccades, %.4g ns per event\n",
                     evt_json_get_number(summary, "events.replayed", 0.0), evt_json_get_number(summary, "windows", 0.0),
                     evt_json_get_number(summary, "saccades", 0.0), evt_json_get_number(summary, "ns_per_event", 0.0));
    } else {
        (void)printf("FAILED: %s\n", message);
    }
    (void)fflush(stdout);
}

static void done(void *user, size_t i, int status)
{
    batch_t *const b = user;
    char *const path = path_of(b, i, "summary.json");
    char message[1024] = "";
    evh_error_t ignored = {""};
    cJSON *summary = NULL;
    const bool crashed = (status >= EVB_JOBS_CRASHED);
    bool ok = (status == EVT_EXIT_OK);
    if ((path != NULL) && evh_file_exists(path)) { summary = evt_json_read(path, &ignored); }
    if (crashed) {
        (void)snprintf(message, sizeof message, "ended by signal %d; see its log.txt", status - EVB_JOBS_CRASHED);
    } else if (!ok) {
        error_from_log(b, i, message, sizeof message);
    } else if (summary == NULL) {
        ok = false;
        (void)snprintf(message, sizeof message, "wrote no summary.json; see its log.txt");
    }
    b->n_failed += ok ? 0u : 1u;
    put_quoted(b->table, b->names[i]);
    (void)fputc(',', b->table);
    put_quoted(b->table, b->inputs[i]);
    (void)fprintf(b->table, ",%s", ok ? "ok" : crashed ? "crashed" : "failed");
    put_numbers(b->table, summary);
    (void)fputc(',', b->table);
    put_quoted(b->table, message);
    (void)fputc('\n', b->table);
    (void)fflush(b->table); /* A batch may run for hours: what is known can be read already. */
    tell(b, i, ok, summary, message);
    cJSON_Delete(summary);
    free(path);
}

/* evstab replay rec/... -o rec would write each recording's results beside its inputs. */
static bool check_folders(const batch_t *b, evh_error_t *err)
{
    for (size_t i = 0u; i < b->n; i++) {
        char *const dir = path_of(b, i, NULL);
        const bool same = (dir != NULL) && evh_same_file(dir, b->inputs[i]);
        free(dir);
        if (dir == NULL) { return evh_fail(err, "out of memory"); }
        if (same) {
            return evh_fail(err, "%s: its results would go into itself; choose another folder with -o", b->inputs[i]);
        }
    }
    return true;
}

static bool run(batch_t *b, unsigned n_parallel, evh_error_t *err)
{
    const evb_jobs_t jobs = {b->n, n_parallel, run_one, done, b};
    char *path;
    bool ok;
    if (!check_folders(b, err) || !evh_make_folder(b->output, err)) { return false; }
    path = evh_path_join(b->output, "summary.csv");
    if (path == NULL) { return evh_fail(err, "out of memory"); }
    b->table = fopen(path, "w");
    if (b->table == NULL) {
        ok = evh_fail(err, "%s: cannot write: %s", path, strerror(errno));
    } else {
        (void)fprintf(b->table, "%s\n", HEADER);
        ok = evb_jobs_run(&jobs, err);
        ok = ((ferror(b->table) == 0) || evh_fail(err, "%s: cannot write", path)) && ok;
        ok = ((fclose(b->table) == 0) || evh_fail(err, "%s: cannot write: %s", path, strerror(errno))) && ok;
    }
    free(path);
    return ok;
}

int evt_replay_batch(const char *const *inputs, size_t n, const char *output, unsigned n_parallel,
                     int (*replay_one)(const char *input, const char *output))
{
    batch_t b = {inputs, n, output, replay_one, NULL, NULL, 0u, evh_is_quiet()};
    evh_error_t err = {""};
    bool ok;
    b.names = malloc(n * sizeof *b.names);
    ok = (b.names != NULL) && evb_names(inputs, n, b.names);
    if (!ok) {
        (void)evh_fail(&err, "out of memory");
    } else {
        ok = run(&b, n_parallel, &err);
        for (size_t i = 0u; i < n; i++) { free(b.names[i]); }
    }
    free(b.names);
    if (!ok) {
        (void)fprintf(stderr, "evstab replay: %s\n", err.text);
    } else if (b.n_failed > 0u) {
        (void)fprintf(stderr, "evstab replay: %zu of %zu recordings failed; %s/summary.csv tells why\n", b.n_failed, n,
                      output);
    } else if (!b.quiet) {
        (void)printf("wrote %s/: summary.csv and a folder for each of %zu recordings\n", output, n);
    }
    return (ok && (b.n_failed == 0u)) ? EVT_EXIT_OK : EVT_EXIT_FAILED;
}
