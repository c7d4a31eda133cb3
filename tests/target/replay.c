/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "replay.h"

#include "crc32.h"
#include "evs/pipeline.h"

#include <stdio.h>
#include <string.h>

enum {
    WIDTH_MAX = 240,
    HEIGHT_MAX = 180,
    TILES_MAX = 34 * 26,
    FIFO = 2048,
    RING = 32,
    BATCH = 128,
    TRACKS_PER_STEP = 16
};

/* Enough for the largest settings, "full" and "velocity". */
#define BYTES_FULL EVS_PIPELINE_BYTES(WIDTH_MAX, HEIGHT_MAX, 1u, true, TILES_MAX, FIFO, RING, BATCH)
#define BYTES_VELOCITY                                                                                                 \
    (EVS_PIPELINE_BYTES(WIDTH_MAX, HEIGHT_MAX, 8u, false, TILES_MAX, FIFO, RING, BATCH) +                              \
     EVS_PIPELINE_IMAGE_BYTES(WIDTH_MAX, HEIGHT_MAX, EVS_PIPELINE_IMAGE_IWE, EVS_IWE_NEAREST,                          \
                              EVS_PIPELINE_WARP_PREDICTED, true, BATCH) +                                              \
     EVS_VELOCITY_DEFAULT_BYTES(WIDTH_MAX, HEIGHT_MAX))
static uint64_t memory[((BYTES_FULL > BYTES_VELOCITY) ? BYTES_FULL : BYTES_VELOCITY) / 8u];
static evs_pipeline_t pipeline;
static recording_t recording;

static uint32_t crc_point(uint32_t crc, evs_point_t p)
{
    return crc32_u16(crc32_u16(crc, (uint16_t)p.x_q4), (uint16_t)p.y_q4);
}

static uint32_t crc_quat(uint32_t crc, evs_quat_t q)
{
    crc = crc32_u32(crc32_u32(crc, (uint32_t)q.w), (uint32_t)q.x);
    return crc32_u32(crc32_u32(crc, (uint32_t)q.y), (uint32_t)q.z);
}

static uint32_t crc_window(uint32_t crc, const evs_window_end_t *end)
{
    crc = crc32_u32(crc32_u32(crc, end->index), end->n_events);
    crc = crc32_u32(crc32_u32(crc, end->t_first_us), end->t_last_us);
    return crc32_u32(crc, (uint32_t)end->reason);
}

static uint32_t crc_vec3(uint32_t crc, evs_vec3_t v)
{
    return crc32_u32(crc32_u32(crc32_u32(crc, (uint32_t)v.x), (uint32_t)v.y), (uint32_t)v.z);
}

static uint32_t crc_direction(uint32_t crc, const evs_velocity_result_t *v)
{
    crc = crc32_u32(crc32_u32(crc, v->t_us), v->interval_us);
    crc = crc32_u32(crc32_u32(crc, v->baseline_us), v->flags);
    crc = crc_quat(crc_vec3(crc_vec3(crc, v->v_r_q30), v->v_c_q30), v->q_wr);
    crc = crc32_u16(crc32_u16(crc, v->n_corners), v->n_flow);
    crc = crc32_u16(crc32_u32(crc, v->flow_px_q8), v->mismatch_q8);
    crc = crc32_u32(crc32_u32(crc, v->solution.flags), v->solution.n_inliers);
    return crc32_u32(crc, (uint32_t)v->solution.sigma_rad_q28);
}

/* All the work on an image at once, in steps. */
static void work(replay_result_t *r)
{
    evs_velocity_result_t velocity;
    while (evs_pipeline_velocity_busy(&pipeline)) {
        if (!evs_pipeline_velocity(&pipeline, TRACKS_PER_STEP, &velocity)) { continue; }
        r->velocity = crc_direction(r->velocity, &velocity);
        if ((velocity.flags & EVS_VELOCITY_VALID) != 0u) { r->n_directions++; }
    }
}

static void pull_all(replay_result_t *r)
{
    evs_pipeline_chunk_t chunk;
    while (evs_pipeline_pull(&pipeline, &chunk)) {
        for (size_t i = 0u; i < chunk.n; i++) {
            r->undistorted = crc_point(r->undistorted, chunk.undistorted[i]);
            r->stabilized = crc_point(r->stabilized, chunk.stabilized[i]);
            if (evs_point_is_outside(chunk.stabilized[i])) { r->n_outside++; }
        }
        replay_images_add(&r->images, &chunk);
        r->n_events += (uint32_t)chunk.n;
        if (chunk.end.reason != EVS_WINDOW_OPEN) {
            r->windows = crc_quat(crc_window(r->windows, &chunk.end), chunk.q_rc);
            r->n_windows++;
            if (chunk.saccade) { r->n_saccades++; }
        }
        work(r);
    }
}

static void push_events(replay_result_t *r)
{
    size_t n_done = 0u;
    while (n_done < recording.n_events) {
        n_done += evs_pipeline_push_events(&pipeline, recording.events + n_done, recording.n_events - n_done);
        pull_all(r);
    }
}

static void push_imu(replay_result_t *r)
{
    const recording_imu_t *const s = &recording.imu;
    const evs_vec3_t gyro = {s->gyro_rad_s_q24[0], s->gyro_rad_s_q24[1], s->gyro_rad_s_q24[2]};
    const evs_vec3_t accel = {s->accel_m_s2_q20[0], s->accel_m_s2_q20[1], s->accel_m_s2_q20[2]};
    evs_orientation_t newest;

    evs_pipeline_push_accel(&pipeline, s->t_us, accel);
    evs_pipeline_push_gyro(&pipeline, s->t_us, gyro);
    if (evs_pipeline_newest_orientation(&pipeline, &newest) == EVS_OK) {
        r->attitude = crc_quat(r->attitude, newest.q_wc);
    }
    pull_all(r);
}

static bool choose(const char *setting, const evs_camera_config_t *camera, evs_pipeline_config_t *cfg)
{
    const bool velocity = strcmp(setting, "velocity") == 0;
    *cfg = velocity ? evs_pipeline_config_velocity(camera) : evs_pipeline_config_default(camera);
    cfg->n_fifo = FIFO;
    cfg->n_ring = RING;
    cfg->n_batch = BATCH;
    if (strcmp(setting, "full") == 0) {
        cfg->tile_table = true;
    } else if (strcmp(setting, "grid") == 0) {
        cfg->table_step_px = 8u;
        cfg->window.kind = EVS_WINDOW_COUNT;
        cfg->window.threshold = 2000u;
        cfg->stabilize.rotation = EVS_ROTATION_WINDOW;
    } else if (strcmp(setting, "duration") == 0) {
        cfg->table_step_px = 4u;
        cfg->window.kind = EVS_WINDOW_DURATION;
        cfg->window.duration_us = 5000u;
        cfg->stabilize.saccade_px_q4 = EVS_STABILIZE_SACCADE_OFF;
    } else if (velocity) {
        cfg->table_step_px = 8u;
        cfg->warp = EVS_PIPELINE_WARP_PREDICTED;
    } else {
        return false;
    }
    return true;
}

const char *replay_run(recording_read_fn read, void *source, const char *setting, replay_result_t *result)
{
    evs_camera_config_t camera;
    recording_kind_t kind;

    memset(result, 0, sizeof *result);
    if (!recording_open(&recording, read, source, &camera)) { return "not a recording"; }
    evs_pipeline_config_t cfg;
    if (!choose(setting, &camera, &cfg)) { return "unknown setting"; }
    const evs_status_t status = evs_pipeline_init(&pipeline, &cfg, memory, sizeof memory);
    if (status != EVS_OK) { return evs_status_name(status); }
    if (!replay_images_start(camera.width_px, camera.height_px)) { return "images refused"; }

    while ((kind = recording_next(&recording)) != RECORDING_END) {
        if (kind == RECORDING_BAD) { return "the recording is cut off"; }
        if (kind == RECORDING_IMU) {
            push_imu(result);
        } else {
            push_events(result);
        }
    }
    evs_pipeline_finish(&pipeline);
    pull_all(result);

    const evs_pipeline_counts_t n = evs_pipeline_counts(&pipeline);
    const uint32_t counts[] = {n.n_events,     n.n_time_back,  n.n_restarts,
                               n.n_off_sensor, n.n_unoriented, n.n_orientations_back};
    for (size_t i = 0u; i < sizeof counts / sizeof counts[0]; i++) {
        result->counts = crc32_u32(result->counts, counts[i]);
    }
    return NULL;
}

void replay_print(const replay_result_t *r)
{
    printf("events      %lu\n", (unsigned long)r->n_events);
    printf("windows     %lu\n", (unsigned long)r->n_windows);
    printf("saccades    %lu\n", (unsigned long)r->n_saccades);
    printf("outside     %lu\n", (unsigned long)r->n_outside);
    printf("attitude    %08lx\n", (unsigned long)r->attitude);
    printf("undistorted %08lx\n", (unsigned long)r->undistorted);
    printf("boundaries  %08lx\n", (unsigned long)r->windows);
    printf("stabilized  %08lx\n", (unsigned long)r->stabilized);
    printf("iwe         %08lx\n", (unsigned long)r->images.iwe);
    printf("surface     %08lx\n", (unsigned long)r->images.surface);
    printf("warp        %08lx\n", (unsigned long)r->images.warp);
    printf("directions  %lu\n", (unsigned long)r->n_directions);
    printf("velocity    %08lx\n", (unsigned long)r->velocity);
    printf("counters    %08lx\n", (unsigned long)r->counts);
}
