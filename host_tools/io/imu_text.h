/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  imu_text.h
 * @brief IMU samples in text: ECD imu.txt, EuRoC imu0/data.csv, the CSV of `evstab attitude`, or columns named by the
 * user.
 *
 * Data sets disagree on the order of the two triples. Unless the file or the user names the columns, the first rows
 * tell: the triple whose length is near 9.8 is the accelerometer. What was found is said in a note.
 */
#ifndef EVH_IMU_TEXT_H
#define EVH_IMU_TEXT_H

#include "rows.h"

typedef enum {
    EVH_IMU_ORDER_AUTO = 0,    /**< Accelerometer first (ECD) unless the numbers say otherwise. */
    EVH_IMU_ORDER_ACCEL_FIRST, /**< t ax ay az gx gy gz */
    EVH_IMU_ORDER_GYRO_FIRST,  /**< t gx gy gz ax ay az */
    EVH_IMU_ORDER_COLUMNS      /**< As in evh_imu_order_t.columns. */
} evh_imu_order_kind_t;

typedef struct {
    evh_imu_order_kind_t kind;
    evh_layout_t columns;
} evh_imu_order_t;

typedef struct {
    int64_t t_us;
    double gyro_rad_s[3];
    double accel_m_s2[3];
    double mag_ut[3];
    bool has_mag;
    evh_fault_t fault;
    bool has_time;
} evh_imu_sample_t;

typedef struct {
    evh_rows_t rows;
} evh_imu_t;

/** Parse "accel-first", "gyro-first" or a list such as "t,gx,gy,gz,ax,ay,az" ("_" skips a column). */
bool evh_imu_order_parse(const char *text, evh_imu_order_t *order);

/** @param order  NULL = automatic. */
bool evh_imu_open(evh_imu_t *imu, const char *path, const evh_imu_order_t *order, evh_error_t *err);

/** As evh_imu_open(), but the file must name its columns itself: the contract of `evstab attitude`. */
bool evh_imu_open_named(evh_imu_t *imu, const char *path, evh_error_t *err);

/** The next good sample. @return false at the end or on failure (see @p err). */
bool evh_imu_next(evh_imu_t *imu, evh_imu_sample_t *sample, evh_error_t *err);

/** The next sample even if faulty (sample->fault): for outputs with one row per input row. */
bool evh_imu_next_any(evh_imu_t *imu, evh_imu_sample_t *sample, evh_error_t *err);

void evh_imu_close(evh_imu_t *imu);

#endif
