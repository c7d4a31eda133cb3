/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  replay.h
 * @brief evstab replay, in four parts: settings from the command line and files, the run, the output files, the
 * summary. The report and the video look on while it runs.
 */
#ifndef EVT_REPLAY_H
#define EVT_REPLAY_H

#include "config_yaml.h"
#include "csv_writer.h"
#include "event_source.h"
#include "evs/pipeline.h"
#include "gyro_bias.h"
#include "imu_text.h"
#include "poses_text.h"
#include "recording.h"
#include "report.h"
#include "video.h"

typedef enum { EVT_ATTITUDE_NONE = 0, EVT_ATTITUDE_IMU, EVT_ATTITUDE_GYRO, EVT_ATTITUDE_TRUTH } evt_attitude_t;

/** What the command line said; NULL or false where it said nothing. */
typedef struct {
    const char *input;
    const char *output;
    const char *calib, *imu, *poses, *config;
    const char *size, *imu_order;
    const char *attitude, *window, *rotation, *saccade;
    const char *image, *warp, *velocity, *method, *baseline;
    const char *imu_offset, *gyro_bias, *from, *to, *write, *video;
    bool paper, no_report;
} evt_replay_options_t;

/** What will be done: every default resolved. */
typedef struct {
    evh_recording_t rec;
    const char *calib_path; /**< The file that it came from. */
    evh_calib_t calib;      /**< With the sensor size that counts. */
    evt_attitude_t attitude;
    evh_imu_order_t imu_order;
    evt_gyro_bias_t gyro_bias;
    evs_pipeline_config_t pipeline;
    int64_t from_us, to_us; /**< Events in [from, to). */
    bool write_events, write_frames;
    bool velocity_told; /**< Somebody asked for it: a failure must not pass silently. */
} evt_replay_t;

/**
 * The command line checked and completed by the files that it names.
 * @param[out] usage_fault  Set when the fault is in the words themselves (exit status 2), not in the files.
 */
bool evt_replay_settle(evt_replay_t *r, const evt_replay_options_t *options, bool *usage_fault, evh_error_t *err);
void evt_replay_free(evt_replay_t *r);

const char *evt_attitude_name(evt_attitude_t attitude);

/** What became of the pairs of images. */
typedef struct {
    uint64_t n_pairs, n_valid;
    uint64_t n_few, n_still, n_unsolved, n_no_orientation;     /**< The others, by the first thing in the way. */
    uint64_t n_turned;                                         /**< With a saccade between the two images. */
    uint64_t n_same_time;                                      /**< Replaced by a newer one of the same microsecond. */
    double flow_sum, inlier_sum, flow_px_sum, interval_us_sum; /**< Over the valid ones. */
    evs_velocity_counts_t library;
} evt_replay_velocity_counts_t;

/** What happened, for the summary. */
typedef struct {
    uint64_t n_before_from, n_after_to;
    uint64_t n_events;         /**< Given to the library. */
    uint64_t n_out;            /**< Came out of it again. */
    uint64_t n_kept;           /**< Have a stabilized position. */
    uint64_t n_no_undistorted; /**< The lens model reaches no such pixel. */
    uint64_t n_unoriented;
    uint64_t n_out_of_range; /**< Rotated out of what a point can hold, or behind the camera. */
    uint64_t n_windows, n_saccades;
    int64_t window_longest_us;
    uint64_t n_orientations;
    int64_t t_first_us, t_last_us;
    int64_t orientation_first_us, orientation_last_us; /**< By the events' clock. */
    int64_t library_ns;                                /**< In the library, for events. */
    int64_t attitude_ns;                               /**< In the library, for IMU samples or poses. */
    int64_t velocity_ns;                               /**< In the library, for pairs of images. */
    int64_t wall_ns;
    size_t library_bytes; /**< Context and memory of the pipeline. */
    evt_replay_velocity_counts_t velocity;
    evh_tally_t events_tally, imu_tally, poses_tally;
    evs_pipeline_counts_t counts;
    evs_attitude_faults_t attitude_faults;
    bool gyro_bias_known;     /**< In the end: told or learnt at rest. */
    evs_vec3_t gyro_bias_q24; /**< In the end, rad/s. */
} evt_replay_result_t;

/** The output files of a run. */
typedef struct {
    evh_csv_t attitude, windows, events;
    bool has_attitude, has_windows, has_events;
    uint64_t n_events; /**< Written so far: the first_event of the next window. */
    uint64_t window_first_event;
    bool window_saccade;
} evt_replay_output_t;

bool evt_replay_output_open(evt_replay_output_t *out, const evt_replay_t *r, const char *dir, evh_error_t *err);
void evt_replay_put_orientation(evt_replay_output_t *out, int64_t t_us, const evs_orientation_t *o, uint32_t flags);
/** @param t_us  Host time of each event of the chunk; t_first_us, t_last_us those of the window, when it ends here. */
void evt_replay_put_chunk(evt_replay_output_t *out, const evs_pipeline_chunk_t *chunk, const int64_t *t_us,
                          int64_t t_first_us, int64_t t_last_us);
bool evt_replay_output_close(evt_replay_output_t *out, evh_error_t *err);

/** Who looks on; NULL = nobody. */
typedef struct {
    evr_report_t *report;
    evr_video_t *video;
} evt_replay_watch_t;

/** Run it all. @p result is filled as far as the run came, also when it fails. */
bool evt_replay_run(const evt_replay_t *r, const char *dir, const evt_replay_watch_t *watch,
                    evt_replay_result_t *result, evh_error_t *err);

/** The text of summary.json, for free(), or NULL. @param failure  Text of what ended the run early, or NULL. */
char *evt_replay_summary(const evt_replay_t *r, const evt_replay_options_t *options, const evt_replay_result_t *result,
                         const char *failure);

/** summary.json. */
bool evt_replay_write_summary(const char *text, const char *dir, evh_error_t *err);

/** What a whole replay came to. */
typedef struct {
    evt_replay_result_t result;
    evr_numbers_t numbers; /**< Zeros without a report. */
} evt_replay_outcome_t;

/** All of evstab replay, its messages too. @return the exit status. */
int evt_replay_perform(const evt_replay_options_t *options, evt_replay_outcome_t *outcome);

const char *evt_window_reason_name(evs_window_reason_t reason);

#endif
