/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "imu_text.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* No sensor goes further: +-4000 deg/s is 70 rad/s, +-200 g is 1961 m/s^2; a magnet at the sensor reaches some mT. */
#define GYRO_LIMIT_RAD_S 100.0
#define ACCEL_LIMIT_M_S2 2000.0
#define MAG_LIMIT_UT     20000.0

#define PROBE_ROWS        500u
#define GRAVITY_LOW_M_S2  7.5
#define GRAVITY_HIGH_M_S2 12.5

#define REQUIRED                                                                                                       \
    (EVH_BIT(EVH_Q_T) | EVH_BIT(EVH_Q_GX) | EVH_BIT(EVH_Q_GY) | EVH_BIT(EVH_Q_GZ) | EVH_BIT(EVH_Q_AX) |                \
     EVH_BIT(EVH_Q_AY) | EVH_BIT(EVH_Q_AZ))
#define MAG_BITS (EVH_BIT(EVH_Q_MX) | EVH_BIT(EVH_Q_MY) | EVH_BIT(EVH_Q_MZ))

static const evh_layout_t ACCEL_FIRST = {
    .column = {EVH_Q_T, EVH_Q_AX, EVH_Q_AY, EVH_Q_AZ, EVH_Q_GX, EVH_Q_GY, EVH_Q_GZ}, .n_columns = 7u};
static const evh_layout_t GYRO_FIRST = {.column = {EVH_Q_T, EVH_Q_GX, EVH_Q_GY, EVH_Q_GZ, EVH_Q_AX, EVH_Q_AY, EVH_Q_AZ},
                                        .n_columns = 7u};

bool evh_imu_order_parse(const char *text, evh_imu_order_t *order)
{
    uint32_t seen = 0u;
    memset(order, 0, sizeof *order);
    if ((strcmp(text, "accel-first") == 0) || (strcmp(text, "gyro-first") == 0)) {
        order->kind = (text[0] == 'a') ? EVH_IMU_ORDER_ACCEL_FIRST : EVH_IMU_ORDER_GYRO_FIRST;
        return true;
    }
    order->kind = EVH_IMU_ORDER_COLUMNS;
    for (;;) {
        const size_t length = strcspn(text, ",");
        evh_quantity_t q = evh_quantity_from_name(text, length);
        if (order->columns.n_columns == EVH_ROWS_COLUMNS_MAX) { return false; }
        if ((q == EVH_Q_SKIP) && !((length == 1u) && (text[0] == '_'))) { return false; }
        if (q != EVH_Q_SKIP) {
            if ((seen & EVH_BIT(q)) != 0u) { return false; }
            seen |= EVH_BIT(q);
        }
        order->columns.column[order->columns.n_columns++] = q;
        if (text[length] == '\0') { break; }
        text += length + 1u;
    }
    return (seen & REQUIRED) == REQUIRED;
}

static void set_limits(evh_rows_t *rows)
{
    for (int q = EVH_Q_GX; q <= EVH_Q_GZ; q++) { rows->limit[q] = GYRO_LIMIT_RAD_S; }
    for (int q = EVH_Q_AX; q <= EVH_Q_AZ; q++) { rows->limit[q] = ACCEL_LIMIT_M_S2; }
    for (int q = EVH_Q_MX; q <= EVH_Q_MZ; q++) { rows->limit[q] = MAG_LIMIT_UT; }
}

/* The limits belong to evh_rows_t but the first row is parsed while opening: check that one here. */
static void check_first_row(evh_rows_t *rows)
{
    if (!rows->has_ahead || (rows->ahead.fault != EVH_FAULT_NONE)) { return; }
    for (int q = 0; q < EVH_Q_COUNT; q++) {
        if ((rows->limit[q] > 0.0) && (fabs(rows->ahead.value[q]) > rows->limit[q])) {
            rows->ahead.fault = EVH_FAULT_RANGE;
        }
    }
}

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a;
    const double y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Median length of a triple over the first rows. */
static double median(double *value, size_t n)
{
    qsort(value, n, sizeof *value, compare_doubles);
    return (n > 0u) ? value[n / 2u] : 0.0;
}

static double length_of(const double *v) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }
static bool is_like_gravity(double length) { return (length >= GRAVITY_LOW_M_S2) && (length <= GRAVITY_HIGH_M_S2); }

/* Median lengths of what @p layout calls accelerometer and gyro. @return the rows used, 0 when there is nothing to
 * judge. */
static size_t probe(const char *path, const evh_layout_t *layout, double *accel, double *gyro, evh_error_t *err)
{
    double a[PROBE_ROWS];
    double g[PROBE_ROWS];
    size_t n = 0u;
    evh_rows_t rows;
    evh_row_t row;
    if (!evh_rows_open(&rows, path, layout, REQUIRED, err)) { return 0u; }
    if (!rows.from_header) {
        while ((n < PROBE_ROWS) && evh_rows_next(&rows, &row, err)) {
            a[n] = length_of(&row.value[EVH_Q_AX]);
            g[n++] = length_of(&row.value[EVH_Q_GX]);
        }
    }
    evh_rows_close(&rows);
    *accel = median(a, n);
    *gyro = median(g, n);
    return n;
}

/* Which layout a file without header has, from its own numbers, with a note unless it is the one expected. */
static const evh_layout_t *judge_layout(const char *path, const evh_layout_t *layout, bool may_swap, evh_error_t *err)
{
    double accel = 0.0;
    double gyro = 0.0;
    const size_t n = probe(path, layout, &accel, &gyro, err);
    if ((n == 0u) || is_like_gravity(accel)) { return layout; }
    if (is_like_gravity(gyro)) {
        if (may_swap) {
            evh_note("%s: the last three of the columns look like gravity (median %.2f m/s^2), so the order is taken "
                     "as t gx gy gz ax "
                     "ay az; --imu-order says otherwise",
                     path, gyro);
            return &GYRO_FIRST;
        }
        evh_note(
            "%s: with this --imu-order the gyro reads %.2f and the accelerometer %.2f (medians): are they swapped?",
            path, gyro, accel);
        return layout;
    }
    evh_note(
        "%s: the accelerometer reads %.3g (median), not about 9.8 m/s^2; check units (m/s^2, rad/s) and --imu-order",
        path, accel);
    return layout;
}

static bool open_rows(evh_imu_t *imu, const char *path, const evh_layout_t *layout, evh_error_t *err)
{
    if (!evh_rows_open(&imu->rows, path, layout, REQUIRED, err)) { return false; }
    set_limits(&imu->rows);
    check_first_row(&imu->rows);
    return true;
}

bool evh_imu_open(evh_imu_t *imu, const char *path, const evh_imu_order_t *order, evh_error_t *err)
{
    const evh_imu_order_kind_t kind = (order != NULL) ? order->kind : EVH_IMU_ORDER_AUTO;
    const evh_layout_t *layout = (kind == EVH_IMU_ORDER_COLUMNS)      ? &order->columns
                                 : (kind == EVH_IMU_ORDER_GYRO_FIRST) ? &GYRO_FIRST
                                                                      : &ACCEL_FIRST;
    /* A pipe can be read only once. */
    if (evh_file_is_regular(path)) { layout = judge_layout(path, layout, kind == EVH_IMU_ORDER_AUTO, err); }
    return (err->text[0] == '\0') && open_rows(imu, path, layout, err);
}

bool evh_imu_open_named(evh_imu_t *imu, const char *path, evh_error_t *err) { return open_rows(imu, path, NULL, err); }

static void to_sample(const evh_row_t *row, evh_imu_sample_t *sample)
{
    sample->t_us = row->t_us;
    sample->has_time = row->has_time;
    sample->fault = row->fault;
    sample->has_mag = (row->present & MAG_BITS) == MAG_BITS;
    memcpy(sample->gyro_rad_s, &row->value[EVH_Q_GX], sizeof sample->gyro_rad_s);
    memcpy(sample->accel_m_s2, &row->value[EVH_Q_AX], sizeof sample->accel_m_s2);
    memcpy(sample->mag_ut, &row->value[EVH_Q_MX], sizeof sample->mag_ut);
}

bool evh_imu_next(evh_imu_t *imu, evh_imu_sample_t *sample, evh_error_t *err)
{
    evh_row_t row;
    if (!evh_rows_next(&imu->rows, &row, err)) { return false; }
    to_sample(&row, sample);
    return true;
}

bool evh_imu_next_any(evh_imu_t *imu, evh_imu_sample_t *sample, evh_error_t *err)
{
    evh_row_t row;
    if (!evh_rows_next_any(&imu->rows, &row, err)) { return false; }
    to_sample(&row, sample);
    return true;
}

void evh_imu_close(evh_imu_t *imu) { evh_rows_close(&imu->rows); }
