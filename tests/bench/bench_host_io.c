/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* How fast event text is read and events.csv is written: the host program must not be the bottleneck of a replay.
 *
 * usage: bench_host_io [EVENTS.txt]
 *
 * Without a file, one of 4 million events is made in the folder for temporary files. The best of five rounds counts:
 * the others met something else on the machine. */
#define _POSIX_C_SOURCE 200809L
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include "csv_writer.h"
#include "events_text.h"

enum { N_EVENTS = 4000000, N_ROUNDS = 5, BLOCK = 8192 };

static evs_event_t ev[BLOCK];
static int64_t t_us[BLOCK];

static double now_s(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

static void die(const char *what)
{
    (void)fprintf(stderr, "bench_host_io: %s\n", what);
    exit(1);
}

static void make_file(FILE *file)
{
    uint32_t rng = 1u;
    int64_t t_ns = INT64_C(2097134001);
    for (int i = 0; i < N_EVENTS; i++) {
        rng = rng * 1664525u + 1013904223u;
        t_ns += rng >> 23;
        (void)fprintf(file, "%" PRId64 ".%09" PRId64 " %u %u %u\n", t_ns / 1000000000, t_ns % 1000000000,
                      (rng >> 8) % 240u, (rng >> 4) % 180u, rng >> 31);
    }
}

static uint64_t read_all(const char *path)
{
    evh_error_t err = {""};
    evh_event_source_t *const source = evh_events_text_open(path, EVS_SENSOR_MAX_PX, EVS_SENSOR_MAX_PX, &err);
    uint64_t n = 0u;
    ssize_t got;
    if (source == NULL) { die(err.text); }
    while ((got = source->read(source, ev, t_us, BLOCK, &err)) > 0) { n += (uint64_t)got; }
    source->close(source);
    if (got < 0) { die(err.text); }
    return n;
}

/* Rows shaped like those of events.csv. */
static uint64_t write_all(const char *path)
{
    evh_error_t err = {""};
    evh_csv_t out;
    if (!evh_csv_open_path(&out, path, "#t_s,x_px,y_px,p,x_undist_px,y_undist_px,x_stab_px,y_stab_px,window", &err)) {
        die(err.text);
    }
    for (int i = 0; i < N_EVENTS; i++) {
        char *p = evh_csv_reserve(&out, 160u);
        p = evh_put_time_us(p, INT64_C(2097134) + i);
        *p++ = ',';
        p = evh_put_uint(p, (uint64_t)i % 240u);
        *p++ = ',';
        p = evh_put_uint(p, (uint64_t)i % 180u);
        p = evh_put_text(p, ",1");
        for (int k = 0; k < 4; k++) {
            *p++ = ',';
            p = evh_put_q4(p, (int16_t)(i % 3840 - 100 + k));
        }
        *p++ = ',';
        p = evh_put_uint(p, (uint64_t)i / 10000u);
        *p++ = '\n';
        evh_csv_advance(&out, p);
    }
    if (!evh_csv_close(&out, &err)) { die(err.text); }
    return N_EVENTS;
}

static void measure(const char *what, uint64_t (*run)(const char *), const char *path)
{
    double best_s = 1e9;
    uint64_t n = 0u;
    for (int i = 0; i < N_ROUNDS; i++) {
        const double start_s = now_s();
        double s;
        n = run(path);
        s = now_s() - start_s;
        best_s = (s < best_s) ? s : best_s;
    }
    (void)printf("%-22s %8.2f M/s  %6.1f ns each  (%" PRIu64 ", best of %d)\n", what, (double)n / best_s * 1e-6,
                 best_s * 1e9 / (double)n, n, (int)N_ROUNDS);
}

int main(int argc, char **argv)
{
    char path[] = "/tmp/evstab_bench_XXXXXX";
    if (argc > 1) {
        measure("read event text", read_all, argv[1]);
    } else {
        const int fd = mkstemp(path);
        FILE *const file = (fd >= 0) ? fdopen(fd, "wb") : NULL;
        if (file == NULL) { die("cannot make a temporary file"); }
        make_file(file);
        if (fclose(file) != 0) { die("cannot write the temporary file"); }
        measure("read event text", read_all, path);
        (void)unlink(path);
    }
    measure("write events.csv rows", write_all, "/dev/null");
    return 0;
}
