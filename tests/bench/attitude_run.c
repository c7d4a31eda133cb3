/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * Runs the attitude filter over samples in memory, for the scripts that score and time it.
 *
 * usage: attitude_run [--no-mag] [--mode filter|gyro|valenti] [--tau-accel MS] [--tau-mag MS] [--no-bias]
 *                     [--gyro-limit RAD_S] [--delta-us US] [--repeat N] <IN >OUT
 *
 * IN: rows of ten native doubles: time s, rate rad/s x y z, acceleration m/s^2 x y z, field uT x y z. A NaN in the
 * first column of a sensor leaves that sensor out of the row. OUT: per row four doubles, the orientation w x y z.
 * stderr: nanoseconds per row, the median over the repetitions of the whole run; then the counters.
 */
#define _POSIX_C_SOURCE 200809L
#include "evs/attitude.h"
#include "evs/float.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { COLUMNS = 10, REPEAT_MAX = 101 };

typedef struct {
    uint32_t t_us;
    bool has_gyro, has_accel, has_mag;
    evs_vec3_t gyro, accel, mag;
} row_t;

static bool read_rows(row_t **rows, size_t *n)
{
    size_t room = 0;
    double in[COLUMNS];
    *rows = NULL;
    *n = 0;
    while (fread(in, sizeof in[0], COLUMNS, stdin) == COLUMNS) {
        if (*n == room) {
            room = 2u * room + 4096u;
            row_t *more = realloc(*rows, room * sizeof **rows);
            if (more == NULL) { return false; }
            *rows = more;
        }
        row_t *r = &(*rows)[(*n)++];
        r->t_us = (uint32_t)(int64_t)floor(in[0] * 1e6 + 0.5);
        r->has_gyro = !isnan(in[1]);
        r->has_accel = !isnan(in[4]);
        r->has_mag = !isnan(in[7]);
        r->gyro = evs_vec3_from_double(in[1], in[2], in[3], 24);
        r->accel = evs_vec3_from_double(in[4], in[5], in[6], 20);
        r->mag = evs_vec3_from_double(in[7], in[8], in[9], 16);
    }
    return true;
}

static double now_ns(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static int usage(void)
{
    (void)fprintf(stderr, "attitude_run: wrong usage; see the top of tests/bench/attitude_run.c\n");
    return 2;
}

int main(int argc, char **argv)
{
    evs_attitude_config_t cfg = evs_attitude_config_default();
    bool with_mag = true;
    long repeat = 1;
    double delta_us = 0.0;
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--no-mag") == 0) {
            with_mag = false;
        } else if (strcmp(argv[i], "--no-bias") == 0) {
            cfg.learn_bias = false;
        } else if (i + 1 >= argc) {
            return usage();
        } else if (strcmp(argv[i], "--mode") == 0) {
            i++;
            cfg.mode = (strcmp(argv[i], "gyro") == 0)      ? EVS_ATTITUDE_GYRO_ONLY
                       : (strcmp(argv[i], "valenti") == 0) ? EVS_ATTITUDE_VALENTI
                                                           : EVS_ATTITUDE_FILTER;
        } else if (strcmp(argv[i], "--tau-accel") == 0) {
            cfg.tau_accel_ms = (uint16_t)atoi(argv[++i]);
        } else if (strcmp(argv[i], "--tau-mag") == 0) {
            cfg.tau_mag_ms = (uint16_t)atoi(argv[++i]);
        } else if (strcmp(argv[i], "--gyro-limit") == 0) {
            cfg.gyro_limit_rad_s_q24 = evs_q_from_double(atof(argv[++i]), 24);
        } else if (strcmp(argv[i], "--delta-us") == 0) {
            delta_us = atof(argv[++i]);
        } else if (strcmp(argv[i], "--repeat") == 0) {
            repeat = atol(argv[++i]);
        } else {
            return usage();
        }
    }
    row_t *rows;
    size_t n;
    if (!read_rows(&rows, &n) || (n == 0u) || (repeat < 1) || (repeat > REPEAT_MAX)) { return usage(); }
    evs_quat_t *out = malloc(n * sizeof *out);
    if (out == NULL) { return 1; }

    static double ns[REPEAT_MAX];
    evs_attitude_t att;
    for (long k = 0; k < repeat; k++) {
        if (evs_attitude_init(&att, &cfg) != EVS_OK) { return usage(); }
        const double start_ns = now_ns();
        for (size_t i = 0; i < n; i++) {
            const row_t *r = &rows[i];
            if (r->has_gyro && (delta_us > 0.0)) {
                const evs_vec3_t angle = evs_vec3_scale(r->gyro, (int32_t)(delta_us * 67.108864 + 0.5), 20); /* Q30 */
                evs_attitude_push_delta_angle(&att, r->t_us, angle, (uint32_t)delta_us);
            } else if (r->has_gyro) {
                evs_attitude_push_gyro(&att, r->t_us, r->gyro);
            }
            if (r->has_accel) { evs_attitude_push_accel(&att, r->t_us, r->accel); }
            if (with_mag && r->has_mag) { evs_attitude_push_mag(&att, r->t_us, r->mag); }
            out[i] = evs_attitude_orientation(&att);
        }
        ns[k] = (now_ns() - start_ns) / (double)n;
    }
    for (size_t i = 0; i < n; i++) {
        const double q[4] = {evs_q_to_double(out[i].w, 30), evs_q_to_double(out[i].x, 30),
                             evs_q_to_double(out[i].y, 30), evs_q_to_double(out[i].z, 30)};
        if (fwrite(q, sizeof q[0], 4, stdout) != 4u) { return 1; }
    }
    qsort(ns, (size_t)repeat, sizeof ns[0], by_size);
    const evs_attitude_faults_t f = evs_attitude_faults(&att);
    (void)fprintf(stderr,
                  "ns_per_row %.1f\ngyro_saturated %u\ngyro_spikes %u\ngyro_gaps %u\naccel_bad %u\nmag_bad %u\n"
                  "time_bad %u\n",
                  ns[repeat / 2], (unsigned)f.n_gyro_saturated, (unsigned)f.n_gyro_spikes, (unsigned)f.n_gyro_gaps,
                  (unsigned)f.n_accel_bad, (unsigned)f.n_mag_bad, (unsigned)f.n_time_bad);
    free(out);
    free(rows);
    return 0;
}
