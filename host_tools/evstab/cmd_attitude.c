/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* evstab attitude: the attitude filter alone. One output row per input row, so that outputs line up with whatever else
 * the user has per row: a row that cannot be used repeats the last orientation, and is counted. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "command.h"
#include "csv_writer.h"
#include "evs/attitude.h"
#include "faults.h"
#include "gyro_bias.h"
#include "imu_feed.h"
#include "options.h"
#include "progress.h"
#include "recording.h"

static const char *opt_out;
static const char *opt_mode;
static const char *opt_gyro_bias;
static bool opt_quiet;

static const evt_option_t OPTIONS[] = {
    {"output", 'o', "Q.csv", "Where the orientations go. Needed.", &opt_out, NULL},
    {"mode", '\0', "MODE",
     "filter (default), gyro (integration alone) or valenti\n(the published complementary filter).", &opt_mode, NULL},
    {"gyro-bias", '\0', "X,Y,Z",
     "What the gyro reads at rest about its x, y and z axis, in\nrad/s: subtracted from the start. Default: unknown.",
     &opt_gyro_bias, NULL},
    {"quiet", 'q', NULL, "No progress, no notes, no closing line.", NULL, &opt_quiet},
};

static const evt_usage_t USAGE = {
    .command = "attitude",
    .synopsis = "IMU.csv -o Q.csv [options]",
    .about = "Runs the attitude filter on the samples of an IMU. The header of IMU.csv (plain or .gz) names the "
             "columns, in any\n"
             "order, further ones are ignored:\n"
             "  t_s,gx_rad_s,gy_rad_s,gz_rad_s,ax_m_s2,ay_m_s2,az_m_s2[,mx_ut,my_ut,mz_ut]\n"
             "Q.csv gets one row per input row: t_s,qw,qx,qy,qz, from the sensor to the earth (x east, y north, z up; "
             "without\n"
             "a magnetometer the heading starts at 0). A row that cannot be used repeats the last orientation.",
    .examples = "  evstab attitude imu.csv -o q.csv\n  evstab attitude imu.csv.gz -o q.csv --mode gyro",
    .options = OPTIONS,
    .n_options = sizeof OPTIONS / sizeof OPTIONS[0],
    .n_words_min = 1u,
    .n_words_max = 1u,
};

static void feed_gyro(void *f, uint32_t t_us, evs_vec3_t v) { evs_attitude_push_gyro(f, t_us, v); }
static void feed_accel(void *f, uint32_t t_us, evs_vec3_t v) { evs_attitude_push_accel(f, t_us, v); }
static void feed_mag(void *f, uint32_t t_us, evs_vec3_t v) { evs_attitude_push_mag(f, t_us, v); }

static void put_row(evh_csv_t *out, int64_t t_us, evs_quat_t q)
{
    const int32_t part[4] = {q.w, q.x, q.y, q.z};
    char *p = evh_csv_reserve(out, 128u);
    p = evh_put_time_us(p, t_us);
    for (int i = 0; i < 4; i++) {
        *p++ = ',';
        p = evh_put_q(p, part[i], 30u, 9u);
    }
    *p++ = '\n';
    evh_csv_advance(out, p);
}

static bool run(evh_imu_t *imu, evs_attitude_t *att, evh_csv_t *out, uint64_t *n_rows, evh_error_t *err)
{
    evt_imu_feed_t feed = {att, feed_gyro, feed_accel, feed_mag};
    evh_imu_sample_t s;
    evt_progress_t progress;
    int64_t t_us = 0;
    evt_progress_start(&progress);
    while (evh_imu_next_any(imu, &s, err)) {
        if (s.has_time) { t_us = s.t_us; }
        if (s.fault == EVH_FAULT_NONE) { evt_imu_feed(&feed, &s); }
        put_row(out, t_us, evs_attitude_orientation(att));
        *n_rows += 1u;
        evt_progress_update(&progress, evh_lines_fraction(&imu->rows.lines), *n_rows, "samples");
    }
    evt_progress_end(&progress);
    return err->text[0] == '\0';
}

static bool attitude(const char *in_path, const char *out_path, evs_attitude_mode_t mode, const evt_gyro_bias_t *bias,
                     evh_error_t *err)
{
    evs_attitude_config_t config = evs_attitude_config_default();
    evs_attitude_t att;
    evh_imu_t imu;
    evh_csv_t out;
    uint64_t n_rows = 0u;
    bool ok;

    config.mode = mode;
    evt_gyro_bias_admit(bias, &config);
    if (evs_attitude_init(&att, &config) != EVS_OK) { return evh_fail(err, "the filter refuses its own defaults"); }
    evt_gyro_bias_give(bias, &att);
    if (!evh_imu_open_named(&imu, in_path, err)) { return false; }
    if (!imu.rows.has_ahead) {
        evh_imu_close(&imu);
        return evh_fail(err, "%s: holds no sample", in_path);
    }
    if (evh_same_file(in_path, out_path)) {
        evh_imu_close(&imu);
        return evh_fail(err, "%s: the output would overwrite the input", out_path);
    }
    if (!evh_csv_open_path(&out, out_path, "t_s,qw,qx,qy,qz", err)) {
        evh_imu_close(&imu);
        return false;
    }
    ok = run(&imu, &att, &out, &n_rows, err);
    ok = evh_csv_close(&out, err) && ok;
    evh_tally_report(&imu.rows.tally, evh_path_name(in_path));
    if (ok && (imu.rows.tally.n_good == 0u)) { ok = evh_fail(err, "%s: holds no usable sample", in_path); }
    if (ok) {
        const evs_attitude_faults_t faults = evs_attitude_faults(&att);
        evt_note_attitude_faults(&faults);
        if (!evh_is_quiet()) {
            (void)printf("%s: %" PRIu64 " rows, %" PRIu64 " of them repeat the last orientation\n", out_path, n_rows,
                         evh_tally_skipped(&imu.rows.tally));
        }
    }
    evh_imu_close(&imu);
    return ok;
}

int evt_attitude_main(int argc, char **argv)
{
    static const char *const MODES[] = {"filter", "gyro", "valenti"};
    static const evs_attitude_mode_t MODE_VALUES[] = {EVS_ATTITUDE_FILTER, EVS_ATTITUDE_GYRO_ONLY,
                                                      EVS_ATTITUDE_VALENTI};
    const char *words[1];
    evt_gyro_bias_t bias = {.given = false};
    evh_error_t err = {""};
    size_t mode = 0u;
    int status = EVT_EXIT_OK;

    if (!evt_options_parse(&USAGE, argc, argv, words, &status)) { return status; }
    if (opt_out == NULL) { return evt_usage_error(&USAGE, "-o Q.csv is missing: where the orientations shall go"); }
    if (opt_mode != NULL) {
        while ((mode < 3u) && (strcmp(opt_mode, MODES[mode]) != 0)) { mode++; }
        if (mode == 3u) {
            return evt_usage_error(&USAGE, "--mode is '%s'; expected filter, gyro or valenti", opt_mode);
        }
    }
    if ((opt_gyro_bias != NULL) && !evt_gyro_bias_parse(opt_gyro_bias, &bias)) {
        return evt_usage_error(&USAGE, "--gyro-bias is '%s'; expected " EVT_GYRO_BIAS_EXPECTED, opt_gyro_bias);
    }
    evh_set_quiet(opt_quiet);
    if (!attitude(words[0], opt_out, MODE_VALUES[mode], &bias, &err)) {
        (void)fprintf(stderr, "evstab attitude: %s\n", err.text);
        return EVT_EXIT_FAILED;
    }
    return EVT_EXIT_OK;
}
