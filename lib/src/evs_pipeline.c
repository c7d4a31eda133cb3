/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_pipeline_private.h"

#include <string.h>

#define FIFO_MAX    (UINT32_C(1) << 24)
#define WAIT_MAX_US UINT32_C(1000000)
#define TAU_MAX_MS  UINT32_C(100000)

#define VIEW_RATE_MAX_MRAD_S 1000u

/* For the direction of flight: votes per pixel of the tile that closes a window; and what is left of the rotation by a gyro
 * whose bias is known, 0.002 rad/s. Allowing for it costs next to nothing where there is less. */
#define VOTES_PER_PX      12u
#define RESIDUAL_RATE_Q24 33554

evs_pipeline_config_t evs_pipeline_config_default(const evs_camera_config_t *camera)
{
    EVS_ASSERT(camera != NULL);
    const evs_pinhole_t pinhole = evs_pipeline_pinhole(camera);
    const evs_pipeline_config_t cfg = {.camera = *camera,
                                       .table_step_px = 1u,
                                       .n_cols = 34u,
                                       .n_rows = 26u,
                                       .window = evs_window_config_default(),
                                       .source = EVS_PIPELINE_IMU,
                                       .attitude = evs_attitude_config_default(),
                                       .q_ci = evs_quat_identity(),
                                       .view_tau_ms = 10000u,
                                       .view_rate_max_mrad_s = 4u,
                                       .track = evs_orientation_track_config_default(),
                                       .stabilize = evs_stabilize_config_default(&pinhole),
                                       .max_wait_us = 20000u,
                                       .n_fifo = 2048u,
                                       .n_ring = 32u,
                                       .n_batch = 128u,
                                       .image = EVS_PIPELINE_IMAGE_NONE,
                                       .iwe = evs_iwe_config_default(camera->width_px, camera->height_px),
                                       .surface = evs_surface_config_default(camera->width_px, camera->height_px),
                                       .warp = EVS_PIPELINE_WARP_NONE,
                                       .warp_search =
                                           evs_warp_config_default(EVS_WARP_TILED, camera->width_px, camera->height_px),
                                       .velocity_on = false,
                                       .velocity = evs_velocity_config_default(&pinhole)};
    return cfg;
}

evs_pipeline_config_t evs_pipeline_config_velocity(const evs_camera_config_t *camera)
{
    evs_pipeline_config_t cfg = evs_pipeline_config_default(camera);
    const uint32_t n_tile_px = (uint32_t)(camera->width_px / cfg.n_cols) * (camera->height_px / cfg.n_rows);
    const uint32_t threshold = VOTES_PER_PX * ((n_tile_px > 0u) ? n_tile_px : 1u);
    cfg.window.threshold = (threshold < EVS_WINDOW_AREA_MAX) ? threshold : EVS_WINDOW_AREA_MAX;
    cfg.window.min_duration_us = 5000u;
    cfg.window.max_duration_us = 50000u;
    cfg.image = EVS_PIPELINE_IMAGE_IWE;
    cfg.velocity_on = true;
    cfg.velocity.residual_rate_rad_s_q24 = RESIDUAL_RATE_Q24;
    cfg.velocity.learn_bias = true;
    return cfg;
}

static bool capacities_ok(const evs_pipeline_config_t *cfg)
{
    const uint16_t step = cfg->table_step_px;
    return (step >= 1u) && (step <= EVS_UNDISTORT_STEP_MAX_PX) && ((step & (step - 1u)) == 0u) &&
           (cfg->camera.width_px >= 1u) && (cfg->camera.width_px <= EVS_SENSOR_MAX_PX) &&
           (cfg->camera.height_px >= 1u) && (cfg->camera.height_px <= EVS_SENSOR_MAX_PX) && (cfg->n_fifo >= 2u) &&
           (cfg->n_fifo <= FIFO_MAX) && (cfg->n_ring >= EVS_ORIENTATION_TRACK_MIN) && (cfg->n_ring <= FIFO_MAX) &&
           (cfg->n_batch >= 1u) && (cfg->n_batch <= cfg->n_fifo) && (cfg->max_wait_us <= WAIT_MAX_US) &&
           (cfg->view_tau_ms <= TAU_MAX_MS) && (cfg->view_rate_max_mrad_s <= VIEW_RATE_MAX_MRAD_S) &&
           (cfg->n_warp_events <= FIFO_MAX);
}

static size_t n_tiles_of(const evs_pipeline_config_t *cfg)
{
    return (cfg->window.kind == EVS_WINDOW_AREA) ? (size_t)cfg->n_cols * cfg->n_rows : 0u;
}

size_t evs_pipeline_bytes(const evs_pipeline_config_t *cfg)
{
    if ((cfg == NULL) || !capacities_ok(cfg)) { return 0u; }
    const size_t step = (cfg->table != NULL) ? 0u : cfg->table_step_px;
    const size_t bytes = EVS_PIPELINE_BYTES(cfg->camera.width_px, cfg->camera.height_px, step, cfg->tile_table,
                                            n_tiles_of(cfg), cfg->n_fifo, cfg->n_ring, cfg->n_batch);
    if (cfg->image == EVS_PIPELINE_IMAGE_NONE) { return bytes; }
    const size_t n_imaging = evs_pipeline_imaging_bytes(cfg);
    return (n_imaging > 0u) ? bytes + n_imaging : 0u;
}

/*
 * Every setting is judged by the module that it belongs to, on a context that is thrown away, before the caller's
 * context is touched: one such context at a time on the stack, not the whole pipeline.
 */
static evs_status_t check_attitude(const evs_attitude_config_t *cfg)
{
    evs_attitude_t scratch;
    return evs_attitude_init(&scratch, cfg);
}

static evs_status_t check_stabilize(const evs_pipeline_config_t *cfg, evs_pinhole_t pinhole)
{
    evs_stabilize_t scratch;
    evs_stabilize_config_t own = cfg->stabilize;
    own.pinhole = pinhole;
    return evs_stabilize_init(&scratch, &own);
}

static evs_status_t check_table(const evs_pipeline_config_t *cfg)
{
    if (cfg->table != NULL) {
        evs_undistort_t scratch;
        return evs_undistort_bind(&scratch, cfg->camera.width_px, cfg->camera.height_px, cfg->table_step_px, cfg->table,
                                  cfg->n_table);
    }
    evs_camera_t scratch;
    return evs_camera_init(&scratch, &cfg->camera);
}

/* What an image needs is set up in the memory block at once: that is not the caller's context. */
static evs_status_t init_imaging(const evs_pipeline_config_t *cfg, evs_pipeline_imaging_t **imaging,
                                 unsigned char **cursor)
{
    *imaging = NULL;
    if (cfg->image == EVS_PIPELINE_IMAGE_NONE) {
        return (cfg->velocity_on || (cfg->warp != EVS_PIPELINE_WARP_NONE)) ? EVS_ERR_ARG : EVS_OK;
    }
    *imaging = evs_pipeline_take(cursor, sizeof **imaging);
    return evs_pipeline_imaging_init(*imaging, cfg, cursor);
}

static evs_status_t check(const evs_pipeline_config_t *cfg, evs_orientation_t *ring, uint16_t *tile_counts)
{
    evs_orientation_track_t track;
    evs_window_t window;
    evs_tile_grid_t grid;
    evs_quat_t q_ci;
    evs_status_t status = check_attitude(&cfg->attitude);
    if (status == EVS_OK) { status = check_table(cfg); }
    if (status == EVS_OK) { status = check_stabilize(cfg, evs_pipeline_pinhole(&cfg->camera)); }
    if (status == EVS_OK) { status = evs_orientation_track_init(&track, &cfg->track, ring, cfg->n_ring); }
    if (status == EVS_OK) { status = evs_window_init(&window, &cfg->window, tile_counts, n_tiles_of(cfg)); }
    if (status == EVS_OK) {
        status = evs_tile_grid_init(&grid, cfg->camera.width_px, cfg->camera.height_px, cfg->n_cols, cfg->n_rows);
    }
    if ((status == EVS_OK) && (evs_quat_normalize(cfg->q_ci, &q_ci) != EVS_OK)) { status = EVS_ERR_ARG; }
    return status;
}

static evs_status_t init_undistort(evs_pipeline_t *p, unsigned char **cursor)
{
    const evs_pipeline_config_t *const cfg = &p->cfg;
    const uint16_t width_px = cfg->camera.width_px;
    const uint16_t height_px = cfg->camera.height_px;
    evs_status_t status;
    if (cfg->table != NULL) {
        status = evs_undistort_bind(&p->undistort, width_px, height_px, cfg->table_step_px, cfg->table, cfg->n_table);
    } else {
        evs_camera_t camera;
        status = evs_camera_init(&camera, &cfg->camera);
        const size_t n_points = EVS_UNDISTORT_POINTS(width_px, height_px, cfg->table_step_px);
        evs_point_t *const points = evs_pipeline_take(cursor, n_points * sizeof points[0]);
        if (status == EVS_OK) {
            status = evs_undistort_build(&p->undistort, &camera, cfg->table_step_px, points, n_points);
        }
    }
    evs_tile_grid_t grid;
    if (status == EVS_OK) { status = evs_tile_grid_init(&grid, width_px, height_px, cfg->n_cols, cfg->n_rows); }
    if (status != EVS_OK) { return status; }
    if (!cfg->tile_table) { return evs_undistort_bind_tiles(&p->undistort, &grid, NULL, 0u); }
    const size_t n_pixels = EVS_UNDISTORT_TILES(width_px, height_px);
    uint16_t *const tiles = evs_pipeline_take(cursor, n_pixels * sizeof tiles[0]);
    return evs_undistort_build_tiles(&p->undistort, &grid, tiles, n_pixels);
}

evs_status_t evs_pipeline_init(evs_pipeline_t *p, const evs_pipeline_config_t *cfg, void *memory, size_t n_bytes)
{
    if ((p == NULL) || (cfg == NULL) || (memory == NULL)) { return EVS_ERR_NULL; }
    if (!capacities_ok(cfg) || ((uint32_t)cfg->source > EVS_PIPELINE_NONE)) { return EVS_ERR_ARG; }
    const size_t n_needed = evs_pipeline_bytes(cfg);
    if (n_needed == 0u) { return EVS_ERR_ARG; }
    if ((n_bytes < n_needed) || (((uintptr_t)memory & 7u) != 0u)) { return EVS_ERR_SIZE; }

    unsigned char *cursor = memory;
    evs_orientation_t *const ring = evs_pipeline_take(&cursor, cfg->n_ring * sizeof ring[0]);
    uint16_t *const tile_counts = evs_pipeline_take(&cursor, n_tiles_of(cfg) * sizeof tile_counts[0]);
    evs_pipeline_imaging_t *imaging;
    evs_status_t verdict = check(cfg, ring, tile_counts);
    if (verdict == EVS_OK) { verdict = init_imaging(cfg, &imaging, &cursor); }
    if (verdict != EVS_OK) { return verdict; }

    memset(p, 0, sizeof *p);
    p->cfg = *cfg;
    p->imaging = imaging;
    p->cfg.stabilize.pinhole = evs_pipeline_pinhole(&cfg->camera);
    p->fifo = evs_pipeline_take(&cursor, cfg->n_fifo * sizeof p->fifo[0]);
    p->undistorted = evs_pipeline_take(&cursor, cfg->n_batch * sizeof p->undistorted[0]);
    p->stabilized = evs_pipeline_take(&cursor, cfg->n_batch * sizeof p->stabilized[0]);
    p->tiles = evs_pipeline_take(&cursor, cfg->n_batch * sizeof p->tiles[0]);
    p->window_q_rc = evs_quat_identity();
    if (cfg->view_tau_ms > 0u) { p->view_per_us_q50 = (UINT64_C(1) << 50) / (cfg->view_tau_ms * UINT64_C(1000)); }
    p->view_max_per_us_q62 = cfg->view_rate_max_mrad_s * ((UINT64_C(1) << 61) / UINT64_C(1000000000));

    evs_status_t status = evs_quat_normalize(cfg->q_ci, &p->cfg.q_ci);
    if (status == EVS_OK) { status = evs_attitude_init(&p->attitude, &cfg->attitude); }
    if (status == EVS_OK) { status = evs_orientation_track_init(&p->track, &cfg->track, ring, cfg->n_ring); }
    if (status == EVS_OK) { status = evs_window_init(&p->window, &cfg->window, tile_counts, n_tiles_of(cfg)); }
    if (status == EVS_OK) { status = evs_stabilize_init(&p->stabilize, &p->cfg.stabilize); }
    if (status == EVS_OK) { status = init_undistort(p, &cursor); }
    return status; /* all were judged above */
}

static int32_t mean(int32_t a, int32_t b) { return (int32_t)evs_shr_r64((int64_t)a + b, 1); }

/* Move q by the part step_q30 of its way to identity, but no component of its vector part by more than max_q30. */
static evs_quat_t towards_identity(evs_quat_t q, int32_t step_q30, int32_t max_q30)
{
    const int32_t back_q30 = (q.w < 0) ? step_q30 : -step_q30; /* the shorter way round */
    const evs_quat_t step = {EVS_ONE_Q30, evs_clamp(evs_q_mul(q.x, back_q30, 30), -max_q30, max_q30),
                             evs_clamp(evs_q_mul(q.y, back_q30, 30), -max_q30, max_q30),
                             evs_clamp(evs_q_mul(q.z, back_q30, 30), -max_q30, max_q30)};
    evs_quat_t moved;
    return (evs_quat_normalize(evs_quat_mul(step, q), &moved) == EVS_OK) ? moved : evs_quat_identity();
}

/*
 * Carry the view on by the mean of this rate and the one before, then move it towards the attitude by dt / tau of what is
 * between them. What has come between them while the filter settled is a matter of where it began: the view keeps it, and
 * gives it up slowly, since to a camera that flies a turn that never happened looks like a motion. The view takes over
 * the attitude as it is when horizon or north have just been found, and after a gap in the gyro.
 */
static void follow_attitude(evs_pipeline_t *p, uint32_t t_us, evs_quat_t attitude_wc, evs_vec3_t rate_rad_s_q24)
{
    const int32_t dt_us = evs_time_diff_us(t_us, p->view_t_us);
    const uint32_t flags = evs_attitude_flags(&p->attitude);
    const uint32_t known = flags & (EVS_ATTITUDE_TILT_KNOWN | EVS_ATTITUDE_HEADING_KNOWN);
    const bool follow = (p->cfg.view_tau_ms > 0u) && (known == p->view_known) && (dt_us > 0) &&
                        ((uint32_t)dt_us <= p->cfg.track.max_gap_us);
    const evs_vec3_t rate = {mean(p->view_rate_q24.x, rate_rad_s_q24.x), mean(p->view_rate_q24.y, rate_rad_s_q24.y),
                             mean(p->view_rate_q24.z, rate_rad_s_q24.z)};
    p->view_t_us = t_us;
    p->view_known = known;
    p->view_rate_q24 = rate_rad_s_q24;
    if (!follow) {
        p->view_q_wc = attitude_wc;
        p->view_kept_q = evs_quat_identity();
        return;
    }
    const evs_quat_t carried = evs_quat_mul(p->view_q_wc, evs_quat_from_rotvec(evs_rotvec_of_rate(rate, dt_us)));
    const uint64_t part_q30 = ((uint64_t)(uint32_t)dt_us * p->view_per_us_q50) >> 20;
    const int32_t step_q30 = (part_q30 < (uint32_t)EVS_ONE_Q30) ? (int32_t)part_q30 : EVS_ONE_Q30;
    if ((flags & EVS_ATTITUDE_SETTLING) != 0u) {
        p->view_kept_q = evs_quat_mul(attitude_wc, evs_quat_conj(carried));
    } else if (p->cfg.view_rate_max_mrad_s == 0u) {
        p->view_kept_q = evs_quat_identity();
    } else {
        const uint64_t max_q30 = ((uint64_t)(uint32_t)dt_us * p->view_max_per_us_q62) >> 32;
        p->view_kept_q = towards_identity(p->view_kept_q, step_q30,
                                          (max_q30 < (uint32_t)EVS_ONE_Q30) ? (int32_t)max_q30 : EVS_ONE_Q30);
    }
    const evs_quat_t goal_wc = evs_quat_mul(evs_quat_conj(p->view_kept_q), attitude_wc);
    const evs_quat_t behind = evs_quat_mul(carried, evs_quat_conj(goal_wc));
    const evs_quat_t view_wc = evs_quat_mul(towards_identity(behind, step_q30, EVS_ONE_Q30), goal_wc);
    if (evs_quat_normalize(view_wc, &p->view_q_wc) != EVS_OK) { p->view_q_wc = attitude_wc; }
}

static evs_status_t push_orientation(evs_pipeline_t *p, const evs_orientation_t *sample)
{
    const evs_status_t status = evs_orientation_track_push(&p->track, sample);
    if ((status == EVS_OK) && (p->imaging != NULL)) { evs_pipeline_imaging_push_orientation(p, sample); }
    return status;
}

void evs_pipeline_push_gyro(evs_pipeline_t *p, uint32_t t_us, evs_vec3_t rate_rad_s_q24)
{
    EVS_ASSERT((p != NULL) && (p->cfg.source == EVS_PIPELINE_IMU));
    evs_attitude_push_gyro(&p->attitude, t_us, rate_rad_s_q24);
    if (!p->bias_known && ((evs_attitude_flags(&p->attitude) & EVS_ATTITUDE_BIAS_KNOWN) != 0u)) {
        p->bias_known = true;
        p->bias_known_us = t_us + (uint32_t)p->cfg.track.offset_us;
    }
    const evs_vec3_t rate_c = evs_quat_rotate(p->cfg.q_ci, evs_attitude_rate(&p->attitude));
    follow_attitude(p, t_us, evs_quat_mul(evs_attitude_orientation(&p->attitude), evs_quat_conj(p->cfg.q_ci)), rate_c);
    const evs_orientation_t sample = {.t_us = t_us, .q_wc = p->view_q_wc, .rate_rad_s_q24 = rate_c};
    (void)push_orientation(p, &sample);
}

void evs_pipeline_push_accel(evs_pipeline_t *p, uint32_t t_us, evs_vec3_t accel_m_s2_q20)
{
    EVS_ASSERT((p != NULL) && (p->cfg.source == EVS_PIPELINE_IMU));
    evs_attitude_push_accel(&p->attitude, t_us, accel_m_s2_q20);
}

void evs_pipeline_push_mag(evs_pipeline_t *p, uint32_t t_us, evs_vec3_t field_ut_q16)
{
    EVS_ASSERT((p != NULL) && (p->cfg.source == EVS_PIPELINE_IMU));
    evs_attitude_push_mag(&p->attitude, t_us, field_ut_q16);
}

evs_status_t evs_pipeline_push_orientation(evs_pipeline_t *p, const evs_orientation_t *sample)
{
    EVS_ASSERT((p != NULL) && (p->cfg.source == EVS_PIPELINE_ORIENTATION));
    return push_orientation(p, sample);
}

/* --- the FIFO: a ring whose head is the block ------------------------------------------------------------------- */

static size_t wrapped(const evs_pipeline_t *p, size_t i) { return (i >= p->cfg.n_fifo) ? i - p->cfg.n_fifo : i; }

/* Once a block has been handed out whole, its events leave the FIFO. */
static void release_block(evs_pipeline_t *p)
{
    if (p->block_at < p->block_used) { return; }
    p->fifo_first = wrapped(p, p->fifo_first + p->block_used);
    p->fifo_used -= p->block_used;
    p->block_used = 0u;
    p->block_at = 0u;
}

/* Undistort the next events at the head of the FIFO, as many as lie in one piece and fit a batch. */
static bool fill_block(evs_pipeline_t *p)
{
    release_block(p);
    if (p->block_used > 0u) { return true; }
    size_t n = p->cfg.n_fifo - p->fifo_first;
    n = (n < p->fifo_used) ? n : p->fifo_used;
    n = (n < p->cfg.n_batch) ? n : p->cfg.n_batch;
    if (n == 0u) { return false; }
    evs_undistort_map_tiles(&p->undistort, &p->fifo[p->fifo_first], n, p->undistorted, p->tiles);
    p->block_used = n;
    return true;
}

/* Copy events while their times do not run back; returns how many. This is every event's way in: the clock's newest time
 * stays in a register. */
static size_t copy_forward(evs_clock_t *clock, const evs_event_t *ev, size_t n, evs_event_t *to)
{
    uint32_t newest_us = clock->newest_us;
    size_t k = 0u;
    while ((k < n) && (evs_time_diff_us(ev[k].t_us, newest_us) >= 0)) {
        newest_us = ev[k].t_us;
        to[k] = ev[k];
        k++;
    }
    if (k > 0u) { evs_clock_accept(clock, newest_us); }
    return k;
}

size_t evs_pipeline_push_events(evs_pipeline_t *p, const evs_event_t *ev, size_t n)
{
    EVS_ASSERT((p != NULL) && ((ev != NULL) || (n == 0u)));
    release_block(p);
    const size_t used_before = p->fifo_used;
    size_t i = 0u;
    while ((i < n) && !p->restarting && (p->fifo_used < p->cfg.n_fifo)) {
        /* As many as come next, fit, and lie in one piece of the ring. */
        const size_t to = wrapped(p, p->fifo_first + p->fifo_used);
        size_t room = (to < p->fifo_first) ? p->fifo_first - to : p->cfg.n_fifo - to;
        room = (room < n - i) ? room : n - i;
        if (!p->clock.started) { evs_clock_accept(&p->clock, ev[i].t_us); }
        const size_t copied = copy_forward(&p->clock, &ev[i], room, &p->fifo[to]);
        p->fifo_used += copied;
        i += copied;
        if (copied == room) { continue; }

        if (evs_clock_step(&p->clock, ev[i].t_us, true) == EVS_CLOCK_RESTART) {
            evs_count(&p->counts.n_restarts);
            p->restarting = true; /* the event itself comes again, after what is older has been pulled */
        } else {
            i++; /* counted by the clock, and left out */
        }
    }
    evs_count_add(&p->counts.n_events, p->fifo_used - used_before);
    return i;
}

/* --- slices and windows ----------------------------------------------------------------------------------------- */

static bool may_wait(const evs_pipeline_t *p, uint32_t t_us)
{
    const int32_t waited_us = evs_time_diff_us(p->clock.newest_us, t_us);
    return !p->finishing && !p->restarting && (p->fifo_used < p->cfg.n_fifo) &&
           ((uint32_t)waited_us < p->cfg.max_wait_us);
}

/* Whether the orientations reach as far as the middle of a slice that begins at t_us. */
static bool orientation_arrived(const evs_pipeline_t *p, uint32_t t_us)
{
    uint32_t newest_us;
    const uint32_t half_us =
        (p->cfg.stabilize.rotation == EVS_ROTATION_SLICE) ? p->cfg.stabilize.slice_max_us / 2u : 0u;
    return (evs_orientation_track_newest(&p->track, &newest_us) == EVS_OK) &&
           (evs_time_diff_us(newest_us, t_us + half_us) >= 0);
}

/* The first event of the open window that has an orientation: does the window begin with a saccade? */
static bool begin_window(evs_pipeline_t *p, uint32_t t_us)
{
    evs_orientation_t at;
    if (evs_orientation_track_at(&p->track, t_us, &at) != EVS_OK) { return false; }
    p->window_saccade = evs_stabilize_begin_window(&p->stabilize, at.q_wc);
    p->window_q_rc = evs_stabilize_rotation(&p->stabilize);
    p->window_oriented = true;
    p->slice_rate_rad_s_q24 = at.rate_rad_s_q24;
    return true;
}

/*
 * Begin a slice with the event at t_us, which belongs to the open window. How long it may be is told by the rate in the
 * middle of the slice before, at most a slice ago: a query that costs nothing.
 */
static void start_slice(evs_pipeline_t *p, uint32_t t_us)
{
    p->slice_first_us = t_us;
    p->slice_us = p->cfg.stabilize.slice_max_us;
    p->slice_oriented = p->window_oriented || begin_window(p, t_us);
    if (!p->slice_oriented) { return; }
    if (p->cfg.stabilize.rotation == EVS_ROTATION_WINDOW) {
        p->slice_us = UINT32_MAX; /* until the window closes */
        return;
    }
    p->slice_us = evs_stabilize_slice_us(&p->stabilize, p->slice_rate_rad_s_q24);
    evs_orientation_t at;
    p->slice_oriented = (evs_orientation_track_at(&p->track, t_us + p->slice_us / 2u, &at) == EVS_OK) ||
                        (evs_orientation_track_at(&p->track, t_us, &at) == EVS_OK);
    if (!p->slice_oriented) { return; }
    p->slice_rate_rad_s_q24 = at.rate_rad_s_q24;
    evs_stabilize_set_orientation(&p->stabilize, at.q_wc);
}

/* A window has closed: its image, if any, and then nothing is left of it. */
static void finish_window(evs_pipeline_t *p, evs_pipeline_chunk_t *chunk)
{
    if (p->imaging != NULL) { evs_pipeline_imaging_finish(p, chunk); }
    p->window_oriented = false;
    p->window_saccade = false;
    p->window_q_rc = evs_quat_identity();
    p->slice_us = 0u;
}

/* A chunk of the open window; the caller adds the events. */
static evs_pipeline_chunk_t describe_window(const evs_pipeline_t *p)
{
    const evs_pipeline_chunk_t chunk = {.window = evs_window_index(&p->window),
                                        .oriented = p->slice_oriented,
                                        .saccade = p->window_saccade,
                                        .q_rc = p->window_q_rc,
                                        .end = {.reason = EVS_WINDOW_OPEN}};
    return chunk;
}

/* The stream has ended or restarted, and the FIFO is empty: close what is open. */
static bool pull_end(evs_pipeline_t *p, evs_pipeline_chunk_t *chunk)
{
    if (!p->finishing && !p->restarting) { return false; }
    const evs_window_reason_t reason = p->restarting ? EVS_WINDOW_BY_RESTART : EVS_WINDOW_BY_FLUSH;
    p->finishing = false;
    p->restarting = false;
    evs_pipeline_chunk_t last = describe_window(p);
    last.end.reason = reason; /* even of a window without an event, whose images may know older ones */
    const bool closed = evs_window_close(&p->window, reason, &last.end);
    finish_window(p, &last);
    if (closed) { *chunk = last; }
    return closed;
}

/* How many of n events, at least one, belong to the current slice. */
static size_t count_in_slice(const evs_pipeline_t *p, const evs_event_t *ev, size_t n)
{
    if (ev[n - 1u].t_us - p->slice_first_us < p->slice_us) { return n; }
    size_t in = 0u; /* belongs to the slice, as all before it do */
    size_t out = n - 1u;
    while (out - in > 1u) {
        const size_t middle = in + (out - in) / 2u;
        if (ev[middle].t_us - p->slice_first_us < p->slice_us) {
            in = middle;
        } else {
            out = middle;
        }
    }
    return out;
}

static void rotate(evs_pipeline_t *p, const evs_point_t *in, size_t n, evs_point_t *out)
{
    if (p->cfg.source == EVS_PIPELINE_NONE) {
        memcpy(out, in, n * sizeof out[0]);
    } else if (p->slice_oriented) {
        evs_stabilize_map(&p->stabilize, in, n, out);
    } else {
        for (size_t i = 0u; i < n; i++) { out[i] = evs_point_outside(); }
        evs_count_add(&p->counts.n_unoriented, n);
    }
}

bool evs_pipeline_pull(evs_pipeline_t *p, evs_pipeline_chunk_t *chunk)
{
    EVS_ASSERT((p != NULL) && (chunk != NULL));
    if (!fill_block(p)) { return pull_end(p, chunk); }

    const evs_event_t *const ev = &p->fifo[p->fifo_first + p->block_at];
    evs_pipeline_chunk_t next = describe_window(p);
    if (evs_window_expire(&p->window, ev[0].t_us, &next.end)) {
        finish_window(p, &next);
        *chunk = next;
        return true;
    }

    const size_t n_block = p->block_used - p->block_at;
    size_t n = n_block;
    if (p->cfg.source == EVS_PIPELINE_NONE) {
        p->slice_oriented = true;
    } else {
        const bool in_slice = (p->slice_us > 0u) && (ev[0].t_us - p->slice_first_us < p->slice_us);
        if (!in_slice) {
            if (!orientation_arrived(p, ev[0].t_us) && may_wait(p, ev[0].t_us)) { return false; }
            start_slice(p, ev[0].t_us);
        }
        n = count_in_slice(p, ev, n_block);
    }
    next = describe_window(p);
    n = evs_window_push(&p->window, ev, &p->tiles[p->block_at], n, &next.end);
    EVS_ASSERT(n > 0u);

    next.events = ev;
    next.undistorted = &p->undistorted[p->block_at];
    next.stabilized = &p->stabilized[p->block_at];
    next.n = n;
    rotate(p, next.undistorted, n, &p->stabilized[p->block_at]);
    p->block_at += n;
    if (p->imaging != NULL) { evs_pipeline_imaging_add(p, ev, next.stabilized, n); }
    if (next.end.reason != EVS_WINDOW_OPEN) { finish_window(p, &next); }
    *chunk = next;
    return true;
}

void evs_pipeline_finish(evs_pipeline_t *p)
{
    EVS_ASSERT(p != NULL);
    p->finishing = true;
}

evs_status_t evs_pipeline_newest_orientation(const evs_pipeline_t *p, evs_orientation_t *newest)
{
    if ((p == NULL) || (newest == NULL)) { return EVS_ERR_NULL; }
    uint32_t t_us;
    evs_status_t status = evs_orientation_track_newest(&p->track, &t_us);
    if (status == EVS_OK) { status = evs_orientation_track_at(&p->track, t_us, newest); }
    if (status == EVS_OK) { newest->t_us = t_us - (uint32_t)p->cfg.track.offset_us; }
    return status;
}

evs_vec3_t evs_pipeline_gyro_bias(const evs_pipeline_t *p)
{
    EVS_ASSERT(p != NULL);
    const evs_velocity_t *const v = evs_pipeline_velocity_part(p);
    const evs_vec3_t by_filter = evs_attitude_bias(&p->attitude);
    if (v == NULL) { return by_filter; }
    return evs_vec3_add(by_filter, evs_quat_rotate(evs_quat_conj(p->cfg.q_ci), evs_velocity_bias(v)));
}

evs_pipeline_counts_t evs_pipeline_counts(const evs_pipeline_t *p)
{
    EVS_ASSERT(p != NULL);
    evs_pipeline_counts_t counts = p->counts;
    counts.n_time_back = p->clock.n_back;
    counts.n_off_sensor = evs_undistort_n_rejected(&p->undistort);
    counts.n_orientations_back = evs_orientation_track_n_dropped(&p->track);
    return counts;
}
