/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  recording.h
 * @brief A recording as a stream of chunks, for a reader with a small buffer and no file system.
 *
 * Written by tests/support/make_recording.py. Little-endian throughout:
 *
 *   head    "EVR1", u16 width, u16 height, i32 fx fy cx cy (px Q16), i64 k1 k2 p1 p2 k3 (Q32)           64 bytes
 *   chunk   u32 kind << 24 | n, then n records
 *     kind 1  events: evs_event_t as it lies in memory (u32 t_us, u16 x, u16 y and polarity), n <= 1024
 *     kind 2  IMU: u32 t_us, i32 gyro[3] (rad/s Q24), i32 accel[3] (m/s^2 Q20)
 *
 * Chunks are in time order: an IMU sample stands before the events that are not older than it.
 */
#ifndef EVS_TESTS_RECORDING_H
#define EVS_TESTS_RECORDING_H

#include "evs/camera.h"
#include "evs/types.h"

#define RECORDING_EVENTS_MAX 1024u

/** Where the bytes come from: returns how many it put into @p bytes, 0 at the end, -1 on an error. */
typedef int32_t (*recording_read_fn)(void *source, void *bytes, size_t n_bytes);

typedef struct {
    uint32_t t_us;
    int32_t gyro_rad_s_q24[3];
    int32_t accel_m_s2_q20[3];
} recording_imu_t;

typedef enum {
    RECORDING_END,
    RECORDING_EVENTS, /**< recording_t.events, .n_events */
    RECORDING_IMU,    /**< recording_t.imu */
    RECORDING_BAD     /**< Not a recording, or cut off. */
} recording_kind_t;

typedef struct {
    recording_read_fn read;
    void *source;
    uint32_t n_imu_left; /**< Samples left in the chunk at hand. */
    evs_event_t events[RECORDING_EVENTS_MAX];
    size_t n_events;
    recording_imu_t imu;
} recording_t;

/** Read the head. @return false if it is not one. */
bool recording_open(recording_t *rec, recording_read_fn read, void *source, evs_camera_config_t *camera);

/** Read the next events or the next IMU sample. */
recording_kind_t recording_next(recording_t *rec);

#endif
