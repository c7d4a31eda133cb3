/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  config_yaml.h
 * @brief Parameter files: the paper's own names, EuRoC sensor.yaml, and ROS / OpenCV / Kalibr camera files, by libyaml.
 *
 * Keys may be nested at any depth (a ROS parameter file names its node first). Keys that nothing here uses are named in
 * one note, so that a misspelt one does not pass unseen.
 */
#ifndef EVH_CONFIG_YAML_H
#define EVH_CONFIG_YAML_H

#include <stddef.h>

#include "calib.h"

typedef enum {
    EVH_WINDOW_UNSET = 0,
    EVH_WINDOW_AREA,  /**< accumulation_type: area */
    EVH_WINDOW_COUNT, /**< accumulation_type: number_of_events */
    EVH_WINDOW_TIME   /**< accumulation_type: time */
} evh_window_kind_t;

#define EVH_GYRO_BIAS_MAX_RAD_S 0.5

/** Room for a word with its end. */
#define EVH_CONFIG_WORD_MAX 24

/** What a file said; each value counts only where its has_ flag is set. */
typedef struct {
    bool has_calib; /**< K or intrinsics were there. The size may be there without. */
    evh_calib_t calib;

    bool has_q_ci; /**< Camera from IMU: q_external, unless use_external_extrinsic_rotation is false; or T_BS. */
    double q_ci_wxyz[4];

    evh_window_kind_t window_kind;
    bool has_roi_threshold;
    int64_t roi_threshold;
    bool has_columns, has_rows;
    int64_t n_columns, n_rows;
    bool has_count;
    int64_t n_events;
    bool has_window_time;
    int64_t window_time_us;

    bool has_saccades, saccades;

    char image[EVH_CONFIG_WORD_MAX]; /**< Ours; "" = not told. The words are those of replay's options. */
    char warp[EVH_CONFIG_WORD_MAX];
    char method[EVH_CONFIG_WORD_MAX];
    bool has_velocity, velocity;
    bool has_gyro_bias; /**< gyro_bias: rad/s, in the IMU's axes. */
    double gyro_bias_rad_s[3];
    bool has_from_imu, from_imu; /**< get_orientation_from_imu */
} evh_config_t;

bool evh_config_read(evh_config_t *config, const char *path, evh_error_t *err);

/** The same from memory (for tests); @p name is for messages. @p text need not be terminated. */
bool evh_config_parse(evh_config_t *config, const char *text, size_t length, const char *name, evh_error_t *err);

#endif
