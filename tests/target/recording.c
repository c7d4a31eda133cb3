/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "recording.h"

#include <string.h>

enum { HEAD_BYTES = 64, EVENT_BYTES = 8, IMU_BYTES = 28, KIND_EVENTS = 1, KIND_IMU = 2 };

static uint32_t get_u32(const uint8_t *b)
{
    return (uint32_t)b[0] | ((uint32_t)b[1] << 8) | ((uint32_t)b[2] << 16) | ((uint32_t)b[3] << 24);
}
static uint16_t get_u16(const uint8_t *b) { return (uint16_t)(b[0] | (b[1] << 8)); }
static int32_t get_i32(const uint8_t *b) { return (int32_t)get_u32(b); }
static int64_t get_i64(const uint8_t *b) { return (int64_t)(((uint64_t)get_u32(b + 4) << 32) | get_u32(b)); }

/* All of it or nothing; *at_end tells whether nothing was left to read. */
static bool read_all(recording_t *rec, void *bytes, size_t n_bytes, bool *at_end)
{
    size_t n_got = 0u;
    while (n_got < n_bytes) {
        const int32_t n = rec->read(rec->source, (uint8_t *)bytes + n_got, n_bytes - n_got);
        if (n <= 0) {
            *at_end = (n == 0) && (n_got == 0u);
            return false;
        }
        n_got += (size_t)n;
    }
    return true;
}

bool recording_open(recording_t *rec, recording_read_fn read, void *source, evs_camera_config_t *camera)
{
    uint8_t head[HEAD_BYTES];
    bool at_end;

    memset(rec, 0, sizeof *rec);
    rec->read = read;
    rec->source = source;
    if (!read_all(rec, head, sizeof head, &at_end) || (memcmp(head, "EVR1", 4u) != 0)) { return false; }

    memset(camera, 0, sizeof *camera);
    camera->model = EVS_CAMERA_PINHOLE;
    camera->width_px = get_u16(head + 4);
    camera->height_px = get_u16(head + 6);
    camera->fx_q16 = get_i32(head + 8);
    camera->fy_q16 = get_i32(head + 12);
    camera->cx_q16 = get_i32(head + 16);
    camera->cy_q16 = get_i32(head + 20);
    for (size_t i = 0u; i < EVS_CAMERA_N_DIST; i++) { camera->dist_q32[i] = get_i64(head + 24 + 8u * i); }
    return true;
}

static recording_kind_t next_imu(recording_t *rec)
{
    uint8_t b[IMU_BYTES];
    bool at_end;
    if (!read_all(rec, b, sizeof b, &at_end)) { return RECORDING_BAD; }
    rec->n_imu_left--;
    rec->imu.t_us = get_u32(b);
    for (size_t i = 0u; i < 3u; i++) {
        rec->imu.gyro_rad_s_q24[i] = get_i32(b + 4u + 4u * i);
        rec->imu.accel_m_s2_q20[i] = get_i32(b + 16u + 4u * i);
    }
    return RECORDING_IMU;
}

static recording_kind_t next_events(recording_t *rec, uint32_t n)
{
    bool at_end;
    if ((n > RECORDING_EVENTS_MAX) || !read_all(rec, rec->events, n * EVENT_BYTES, &at_end)) { return RECORDING_BAD; }
    rec->n_events = n;
    /* In place: the bytes of an event lie where its members will be, and each is read before it is written. */
    for (size_t i = 0u; i < n; i++) {
        uint8_t b[EVENT_BYTES];
        memcpy(b, &rec->events[i], sizeof b);
        rec->events[i].t_us = get_u32(b);
        rec->events[i].x_px = get_u16(b + 4);
        rec->events[i].y_px = get_u16(b + 6);
    }
    return RECORDING_EVENTS;
}

recording_kind_t recording_next(recording_t *rec)
{
    uint8_t b[4];
    bool at_end = false;
    if (rec->n_imu_left > 0u) { return next_imu(rec); }
    if (!read_all(rec, b, sizeof b, &at_end)) { return at_end ? RECORDING_END : RECORDING_BAD; }
    const uint32_t kind = get_u32(b) >> 24;
    const uint32_t n = get_u32(b) & 0xFFFFFFu;
    if ((kind == KIND_EVENTS) && (n > 0u)) { return next_events(rec, n); }
    if ((kind == KIND_IMU) && (n > 0u)) {
        rec->n_imu_left = n;
        return next_imu(rec);
    }
    return RECORDING_BAD;
}
