/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/velocity.h"

#include "evs_velocity_private.h"

#include <string.h>

#define MAX_SIGMA_Q28    INT32_C(105414357) /* pi / 8: less sure than that is no direction to steer by */
#define SPACING_MAX_US   UINT32_C(100000)
#define RATE_MAX_Q24     (INT32_C(1) << 24)
#define ROTATION_MAX_Q28 (INT32_C(1) << 28) /* of evs/egomotion.h */
#define PREDICT_US       INT32_C(65536)     /* how long points follow the flow when the grid is turned */

#define INVALID (EVS_VELOCITY_FEW | EVS_VELOCITY_STILL | EVS_VELOCITY_UNSOLVED | EVS_VELOCITY_UNLIKE)

#define ROWS_PER_TRACK 3u /* of the search for corners: they take as long as a track */

enum { STAGE_IDLE = 0, STAGE_CORNERS, STAGE_PYRAMIDS, STAGE_TRACKS, STAGE_SOLVE };

/* --- settings and memory ------------------------------------------------------------------------------------------ */

evs_velocity_config_t evs_velocity_config_default(const evs_pinhole_t *pinhole)
{
    EVS_ASSERT(pinhole != NULL);
    evs_velocity_config_t cfg = {.keyframes = evs_keyframes_config_default(pinhole),
                                 .corners = evs_corners_config_default(pinhole->width_px, pinhole->height_px),
                                 .flow = evs_flow_config_default(),
                                 .egomotion = evs_egomotion_config_default(),
                                 .n_levels = 2u,
                                 .grid_cols = EVS_FLOW_GRID_COLS,
                                 .grid_rows = EVS_FLOW_GRID_ROWS,
                                 .min_features = 20u,
                                 .min_flow_px_q8 = 256u,
                                 .max_sigma_rad_q28 = MAX_SIGMA_Q28,
                                 .max_mismatch_q8 = 218u,
                                 .n_orientations = 64u,
                                 .orientation_spacing_us = 5000u,
                                 .track = evs_orientation_track_config_default()};
    /* Windows overlap, so that neighbours err alike: measured over 20 flights, five of them are worth one. */
    cfg.egomotion.variance_factor_q8 = 1280u;
    return cfg;
}

/* The settings that sizes are computed from; every other one is judged by the module that it belongs to. */
static bool sizes_ok(const evs_velocity_config_t *cfg)
{
    return (evs_pinhole_check(&cfg->keyframes.pinhole) == EVS_OK) && (cfg->keyframes.n_stored >= 1u) &&
           (cfg->keyframes.n_stored <= EVS_KEYFRAMES_MAX) && (cfg->corners.cell_px >= EVS_CORNERS_CELL_MIN_PX) &&
           (cfg->corners.cell_px <= EVS_CORNERS_CELL_MAX_PX) &&
           ((cfg->n_tracks == 0u) || (cfg->n_tracks >= EVS_VELOCITY_TRACKS_MIN)) &&
           (cfg->n_tracks <= EVS_VELOCITY_TRACKS_MAX) && (cfg->n_levels >= 1u) &&
           (cfg->n_levels <= EVS_FLOW_LEVELS_MAX) && (cfg->flow.window_px >= EVS_FLOW_WINDOW_MIN_PX) &&
           (cfg->flow.window_px <= EVS_FLOW_WINDOW_MAX_PX) && (cfg->flow.stride_px >= 1u) &&
           (cfg->flow.stride_px <= 2u) && (cfg->n_orientations >= EVS_ORIENTATION_TRACK_MIN);
}

static size_t n_tracks_of(const evs_velocity_config_t *cfg)
{
    const evs_pinhole_t *const k = &cfg->keyframes.pinhole;
    const size_t n = EVS_VELOCITY_TRACKS(k->width_px, k->height_px, cfg->corners.cell_px, cfg->n_tracks);
    return (n < EVS_VELOCITY_TRACKS_MAX) ? n : EVS_VELOCITY_TRACKS_MAX;
}

size_t evs_velocity_bytes(const evs_velocity_config_t *cfg)
{
    if ((cfg == NULL) || !sizes_ok(cfg)) { return 0u; }
    const evs_pinhole_t *const k = &cfg->keyframes.pinhole;
    return EVS_VELOCITY_BYTES(k->width_px, k->height_px, cfg->keyframes.n_stored, cfg->corners.cell_px,
                              n_tracks_of(cfg), cfg->n_levels, cfg->flow.window_px, cfg->flow.stride_px,
                              cfg->n_orientations);
}

/* Cut the next part off the memory block. */
static void *take(unsigned char **cursor, size_t bytes)
{
    unsigned char *const part = *cursor;
    *cursor += EVS_VELOCITY_PART(bytes);
    return part;
}

/* Bind the modules; each judges its settings. */
static evs_status_t init_modules(evs_velocity_t *v, unsigned char *cursor)
{
    const evs_velocity_config_t *const cfg = &v->cfg;
    const uint16_t width_px = cfg->keyframes.pinhole.width_px;
    const uint16_t height_px = cfg->keyframes.pinhole.height_px;

    const size_t n_planes = EVS_KEYFRAMES_BYTES(width_px, height_px, cfg->keyframes.n_stored);
    void *const planes = take(&cursor, n_planes);
    v->n_tracks_max = n_tracks_of(cfg);
    v->work = take(&cursor,
                   EVS_VELOCITY_WORK_BYTES(width_px, height_px, cfg->corners.cell_px, v->n_tracks_max, cfg->n_levels));
    v->tracks = take(&cursor, v->n_tracks_max * sizeof v->tracks[0]);
    const size_t n_flow = EVS_FLOW_BYTES(cfg->flow.window_px, cfg->flow.stride_px);
    void *const flow = take(&cursor, n_flow);
    evs_orientation_t *const ring = take(&cursor, cfg->n_orientations * sizeof ring[0]);
    /* Corners come first in the shared memory, the scratch of their search behind them. */
    unsigned char *const scratch = v->work + EVS_VELOCITY_PART(v->n_tracks_max * sizeof(evs_corner_t));
    const evs_egomotion_flow_t no_flow = {0, 0, 0, 0};
    evs_egomotion_result_t no_result;

    evs_status_t status = evs_keyframes_init(&v->keyframes, &cfg->keyframes, planes, n_planes);
    if (status == EVS_OK) {
        status = evs_corners_init(&v->corners, &cfg->corners, scratch,
                                  EVS_CORNERS_BYTES(width_px, height_px, cfg->corners.cell_px));
    }
    if (status == EVS_OK) { status = evs_flow_init(&v->flow, &cfg->flow, flow, n_flow); }
    if (status == EVS_OK) {
        status = evs_flow_grid_init(&v->grid, width_px, height_px, cfg->grid_cols, cfg->grid_rows);
    }
    if (status == EVS_OK) {
        status = evs_orientation_track_init(&v->orientations, &cfg->track, ring, cfg->n_orientations);
    }
    if (status == EVS_OK) { status = evs_egomotion_solve(&cfg->egomotion, &no_flow, 0u, v->work, 0u, &no_result); }
    return status;
}

static uint32_t per_focal_q32(int32_t focal_q16) { return (uint32_t)((UINT64_C(1) << 48) / (uint32_t)focal_q16); }

evs_status_t evs_velocity_init(evs_velocity_t *v, const evs_velocity_config_t *cfg, void *memory, size_t n_bytes)
{
    if ((v == NULL) || (cfg == NULL) || (memory == NULL)) { return EVS_ERR_NULL; }
    if (!sizes_ok(cfg) || (cfg->min_features < 1u) || !evs_in_range(cfg->max_sigma_rad_q28, 1, INT32_C(1) << 30) ||
        (cfg->orientation_spacing_us > SPACING_MAX_US) || (cfg->residual_rate_rad_s_q24 < 0) ||
        (cfg->residual_rate_rad_s_q24 > RATE_MAX_Q24)) {
        return EVS_ERR_ARG;
    }
    if ((n_bytes < evs_velocity_bytes(cfg)) || (((uintptr_t)memory & 7u) != 0u)) { return EVS_ERR_SIZE; }

    const evs_pinhole_t *const k = &cfg->keyframes.pinhole;
    evs_velocity_t fresh = {.cfg = *cfg,
                            .grid_q_wr = evs_quat_identity(),
                            .per_fx_q32 = per_focal_q32(k->fx_q16),
                            .per_fy_q32 = per_focal_q32(k->fy_q16)};
    fresh.cfg.corners.width_px = k->width_px;
    fresh.cfg.corners.height_px = k->height_px;
    const evs_status_t status = init_modules(&fresh, memory);
    if (status == EVS_OK) { *v = fresh; }
    return status;
}

void evs_velocity_reset(evs_velocity_t *v)
{
    EVS_ASSERT(v != NULL);
    evs_orientation_t *const ring = v->orientations.ring;
    evs_keyframes_clear(&v->keyframes);
    evs_flow_grid_clear(&v->grid);
    v->orientation_known = false;
    v->n_tracks = 0u;
    v->stage = STAGE_IDLE;
    if (evs_orientation_track_init(&v->orientations, &v->cfg.track, ring, v->cfg.n_orientations) != EVS_OK) { return; }
}

/* --- what is known beforehand ------------------------------------------------------------------------------------- */

void evs_velocity_push_orientation(evs_velocity_t *v, const evs_orientation_t *sample)
{
    EVS_ASSERT((v != NULL) && (sample != NULL));
    const int32_t since_us = evs_time_diff_us(sample->t_us, v->orientation_t_us);
    const bool close = (since_us >= 0) && ((uint32_t)since_us < v->cfg.orientation_spacing_us);
    if (v->orientation_known && close) { return; }
    if (evs_orientation_track_push(&v->orientations, sample) != EVS_OK) { return; }
    v->orientation_t_us = sample->t_us;
    v->orientation_known = true;
}

void evs_velocity_learn_bias(evs_velocity_t *v, bool on)
{
    EVS_ASSERT(v != NULL);
    v->cfg.learn_bias = on;
    if (!on) { evs_gyro_bias_reset(&v->bias); }
}

static bool same_rotation(evs_quat_t a, evs_quat_t b)
{
    return (a.w == b.w) && (a.x == b.x) && (a.y == b.y) && (a.z == b.z);
}

/* Where a point is after following the flow for a while. */
static evs_point_t follow(evs_point_t at, evs_flow_velocity_t flow)
{
    const int32_t x_q4 = at.x_q4 + evs_flow_displacement_q4(flow.x_px_s_q3, PREDICT_US);
    const int32_t y_q4 = at.y_q4 + evs_flow_displacement_q4(flow.y_px_s_q3, PREDICT_US);
    return (evs_point_t){(int16_t)evs_clamp(x_q4, -EVS_POINT_MAX_Q4, EVS_POINT_MAX_Q4),
                         (int16_t)evs_clamp(y_q4, -EVS_POINT_MAX_Q4, EVS_POINT_MAX_Q4)};
}

/*
 * After a saccade the image velocities are seen in the old reference. Each tile of the new one looks up where its centre
 * lay there, lets the point follow the flow, and sees where it arrives.
 */
static void turn_grid(evs_velocity_t *v, evs_quat_t q_wr)
{
    if (same_rotation(v->grid_q_wr, q_wr)) { return; }
    const evs_quat_t q_old_new = evs_quat_mul(evs_quat_conj(v->grid_q_wr), q_wr);
    const evs_flow_grid_t old = v->grid;
    evs_homography_t to_old;
    evs_homography_t to_new;
    evs_homography_set(&to_old, &v->cfg.keyframes.pinhole, q_old_new);
    evs_homography_set(&to_new, &v->cfg.keyframes.pinhole, evs_quat_conj(q_old_new));
    for (uint16_t row = 0u; row < v->cfg.grid_rows; row++) {
        for (uint16_t col = 0u; col < v->cfg.grid_cols; col++) {
            const evs_point_t centre = {(int16_t)((2u * col + 1u) * 8u * old.width_px / v->cfg.grid_cols),
                                        (int16_t)((2u * row + 1u) * 8u * old.height_px / v->cfg.grid_rows)};
            evs_point_t at[2];
            evs_homography_map(&to_old, &centre, 1u, at);
            at[1] = follow(at[0], evs_flow_grid_at(&old, at[0]));
            evs_homography_map(&to_new, at, 2u, at);
            evs_flow_velocity_t flow = {0, 0};
            if (!evs_point_is_outside(at[0]) && !evs_point_is_outside(at[1])) {
                flow = evs_flow_velocity_from((at[1].x_q4 - at[0].x_q4) * 16, (at[1].y_q4 - at[0].y_q4) * 16,
                                              (uint32_t)PREDICT_US);
            }
            evs_flow_grid_set_tile(&v->grid, col, row, flow);
        }
    }
    v->grid_q_wr = q_wr;
}

/* --- stages ------------------------------------------------------------------------------------------------------- */

/* The camera's orientation in the middle of the interval. It is asked for at once: later the ring may know more, and the
 * result must not depend on when the steps are made. */
static void look_up_orientation(evs_velocity_t *v)
{
    evs_orientation_t middle;
    if (evs_orientation_track_at(&v->orientations, v->pair.t_us, &middle) == EVS_OK) {
        v->middle_q_cr = evs_quat_mul(evs_quat_conj(middle.q_wc), v->pair.q_wr);
    } else {
        v->pair.flags |= EVS_VELOCITY_NO_ORIENTATION;
    }
}

evs_status_t evs_velocity_begin(evs_velocity_t *v, const evs_velocity_image_t *image, uint8_t *scratch)
{
    if ((v == NULL) || (image == NULL) || (image->px == NULL)) { return EVS_ERR_NULL; }
    if (v->stage != STAGE_IDLE) { return EVS_ERR_STATE; }

    uint8_t *const plane = evs_keyframes_plane(&v->keyframes);
    const evs_image_t newest = evs_velocity_image_of(v, plane);
    if (image->px != plane) { memcpy(plane, image->px, EVS_IMAGE_BYTES(newest.width_px, newest.height_px)); }
    evs_count(&v->counts.n_images);
    v->n_tracks = 0u;
    v->t_us = image->t_us;

    size_t partner = evs_keyframes_choose(&v->keyframes, image->t_us);
    bool turned = false;
    if ((partner != EVS_KEYFRAMES_NONE) &&
        !same_rotation(evs_keyframes_get(&v->keyframes, partner)->q_wr, image->q_wr)) {
        if (scratch != NULL) {
            turned = evs_keyframes_turn(&v->keyframes, partner, image->q_wr, scratch);
            evs_count(&v->counts.n_turned);
        } else {
            evs_keyframes_clear(&v->keyframes);
            partner = EVS_KEYFRAMES_NONE;
        }
    }
    if (partner == EVS_KEYFRAMES_NONE) {
        evs_count(&v->counts.n_unpaired);
        (void)evs_keyframes_store(&v->keyframes, image->t_us, image->q_wr);
        return EVS_OK;
    }
    turn_grid(v, image->q_wr);

    const evs_keyframe_t *const frame = evs_keyframes_get(&v->keyframes, partner);
    const uint32_t interval_us = image->t_us - frame->t_us;
    v->older_px = frame->px;
    v->pair = (evs_velocity_result_t){.t_us = frame->t_us + interval_us / 2u,
                                      .interval_us = interval_us,
                                      .baseline_us = evs_keyframes_baseline_us(&v->keyframes),
                                      .flags = turned ? EVS_VELOCITY_TURNED : 0u,
                                      .q_wr = image->q_wr};
    look_up_orientation(v);
    evs_corners_begin(&v->corners, &newest);
    v->stage = STAGE_CORNERS;
    return EVS_OK;
}

/* Some rows more in search of corners, about as much work as max_tracks tracks; true when all are done. */
static bool scan_some(evs_velocity_t *v, size_t max_tracks)
{
    const size_t height_px = v->cfg.keyframes.pinhole.height_px;
    return evs_corners_scan(&v->corners, (max_tracks < height_px) ? max_tracks * ROWS_PER_TRACK : height_px);
}

/* The corners of the newest image, and for each where it was in the older one if the flow has stayed what it was. */
static void take_corners(evs_velocity_t *v)
{
    evs_corner_t *const corners = (void *)v->work;
    const int32_t back_us = -(int32_t)v->pair.interval_us;
    v->n_tracks = evs_corners_take(&v->corners, corners, v->n_tracks_max);
    v->n_tracked = 0u;
    v->pair.n_corners = (uint16_t)v->n_tracks;
    for (size_t i = 0u; i < v->n_tracks; i++) {
        const evs_point_t at = {(int16_t)(corners[i].x_px * 16u), (int16_t)(corners[i].y_px * 16u)};
        const evs_flow_velocity_t flow = evs_flow_grid_at(&v->grid, at);
        evs_flow_track_t *const track = &v->tracks[i];
        track->from = (evs_position_t){at.x_q4 * 16, at.y_q4 * 16};
        track->to.x_q8 = track->from.x_q8 + evs_flow_displacement_q8(flow.x_px_s_q3, back_us);
        track->to.y_q8 = track->from.y_q8 + evs_flow_displacement_q8(flow.y_px_s_q3, back_us);
    }
}

static void build_pyramids(evs_velocity_t *v)
{
    const evs_image_t newest = evs_velocity_image_of(v, evs_keyframes_plane(&v->keyframes));
    const evs_image_t older = evs_velocity_image_of(v, v->older_px);
    const size_t n_bytes = EVS_PYRAMID_BYTES(newest.width_px, newest.height_px, v->cfg.n_levels);
    evs_status_t status = evs_pyramid_build(&v->newest, &newest, v->cfg.n_levels, v->work, n_bytes);
    if (status == EVS_OK) {
        status = evs_pyramid_build(&v->older, &older, v->cfg.n_levels, v->work + EVS_VELOCITY_PART(n_bytes), n_bytes);
    }
    EVS_ASSERT(status == EVS_OK);
    (void)status;
}

/* Up to max_tracks tracks; true when all are done. */
static bool track_some(evs_velocity_t *v, size_t max_tracks)
{
    const size_t left = v->n_tracks - v->n_tracked;
    const size_t n = (max_tracks < left) ? max_tracks : left;
    evs_flow_track(&v->flow, &v->newest, &v->older, &v->tracks[v->n_tracked], n);
    v->n_tracked += n;
    return v->n_tracked == v->n_tracks;
}

/* (position - centre) / focal length, where the position is given as the sum of two in Q8 px. */
static int32_t calibrated_q24(int32_t sum_px_q8, int32_t centre_q16, uint32_t per_focal_q32)
{
    return evs_sat32(evs_shr_r64(((int64_t)sum_px_q8 * 128 - centre_q16) * per_focal_q32, 24));
}

evs_egomotion_flow_t evs_velocity_flow_of(const evs_velocity_t *v, const evs_flow_track_t *track)
{
    EVS_ASSERT((v != NULL) && (track != NULL));
    const evs_pinhole_t *const k = &v->cfg.keyframes.pinhole;
    /* The line through both ends is what counts; its middle is where the speed belongs to. */
    const evs_egomotion_flow_t flow = {
        .x_q24 = calibrated_q24(track->from.x_q8 + track->to.x_q8, k->cx_q16, v->per_fx_q32),
        .y_q24 = calibrated_q24(track->from.y_q8 + track->to.y_q8, k->cy_q16, v->per_fy_q32),
        .u_q24 = evs_sat32(evs_shr_r64((int64_t)(track->from.x_q8 - track->to.x_q8) * v->per_fx_q32, 16)),
        .v_q24 = evs_sat32(evs_shr_r64((int64_t)(track->from.y_q8 - track->to.y_q8) * v->per_fy_q32, 16))};
    return evs_gyro_bias_take_out(flow, v->left_rad_q28);
}

/* The median by halving the range of values: needs no order and no memory. Of an even number the lower one. */
static uint32_t median(const uint32_t *values, size_t n)
{
    uint32_t low = 0u;
    uint32_t high = 0u;
    for (size_t i = 0u; i < n; i++) { high = (values[i] > high) ? values[i] : high; }
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2u;
        size_t n_below = 0u;
        for (size_t i = 0u; i < n; i++) { n_below += (values[i] <= middle) ? 1u : 0u; }
        if (2u * n_below >= n) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

/* Keep what this pair tells about the next: where patches will be, and how far back to look. */
static void learn(evs_velocity_t *v, const evs_flow_sample_t *samples, size_t n)
{
    const bool lost = (v->pair.n_flow < v->cfg.min_features) || ((v->pair.flags & EVS_VELOCITY_UNLIKE) != 0u);
    if (!lost) {
        const uint64_t speed_px_s_q4 = (uint64_t)v->pair.flow_px_q8 * 62500u / v->pair.interval_us;
        (void)evs_flow_grid_fill(&v->grid, samples, n);
        evs_keyframes_learn(&v->keyframes, (speed_px_s_q4 < UINT32_MAX) ? (uint32_t)speed_px_s_q4 : UINT32_MAX);
    } else if (v->n_tracks >= v->cfg.min_features) { /* there is texture, but it was lost on the way */
        evs_flow_grid_clear(&v->grid);
        evs_keyframes_shorten(&v->keyframes);
    }
}

/* Flow vectors and lengths of the tracks that were found; returns how many. */
static size_t collect_flow(const evs_velocity_t *v, evs_egomotion_flow_t *flow, uint32_t *lengths_q8)
{
    size_t n = 0u;
    for (size_t i = 0u; i < v->n_tracks; i++) {
        const evs_flow_track_t *const track = &v->tracks[i];
        if (track->status != EVS_FLOW_OK) { continue; }
        const int64_t dx_q8 = track->from.x_q8 - track->to.x_q8;
        const int64_t dy_q8 = track->from.y_q8 - track->to.y_q8;
        flow[n] = evs_velocity_flow_of(v, track);
        lengths_q8[n] = evs_sqrt_u64((uint64_t)(dx_q8 * dx_q8) + (uint64_t)(dy_q8 * dy_q8));
        n++;
    }
    return n;
}

/* Image velocities of the tracks that were found; only of those that agree, if there is a solution: a track that slides
 * along an edge would go on being told to start where it was. */
static size_t collect_samples(const evs_velocity_t *v, evs_flow_sample_t *samples)
{
    const bool solved = (v->pair.solution.flags & EVS_EGOMOTION_VALID) != 0u;
    size_t n = 0u;
    for (size_t i = 0u; i < v->n_tracks; i++) {
        const evs_flow_track_t *const track = &v->tracks[i];
        if ((track->status != EVS_FLOW_OK) || (solved && !evs_velocity_track_is_inlier(v, &v->pair, track))) {
            continue;
        }
        samples[n].at = (evs_point_t){(int16_t)(track->from.x_q8 / 16), (int16_t)(track->from.y_q8 / 16)};
        samples[n].v = evs_flow_velocity_from(track->from.x_q8 - track->to.x_q8, track->from.y_q8 - track->to.y_q8,
                                              v->pair.interval_us);
        n++;
    }
    return n;
}

/* The solver's settings for this interval: what stabilization may have left of the rotation grows with it. */
static evs_egomotion_config_t egomotion_config(const evs_velocity_t *v)
{
    evs_egomotion_config_t cfg = v->cfg.egomotion;
    /* Q24 rad/s times us is Q24 urad; 2^28 / (2^24 * 10^6) = 16 / 10^6. */
    const int64_t left_q28 = (int64_t)v->cfg.residual_rate_rad_s_q24 * v->pair.interval_us / 62500;
    if (left_q28 > cfg.rotation_sigma_rad_q28) {
        cfg.rotation_sigma_rad_q28 = (left_q28 < ROTATION_MAX_Q28) ? (int32_t)left_q28 : ROTATION_MAX_Q28;
    }
    return cfg;
}

static void solve(evs_velocity_t *v)
{
    /* The pyramids are done with. */
    evs_egomotion_flow_t *const flow = (void *)v->work;
    evs_flow_sample_t *const samples = (void *)&flow[v->n_tracks_max];
    uint32_t *const lengths_q8 = (void *)&samples[v->n_tracks_max];
    uint32_t *const scratch = &lengths_q8[v->n_tracks_max];
    evs_velocity_result_t *const pair = &v->pair;

    const bool learning = v->cfg.learn_bias && ((pair->flags & EVS_VELOCITY_NO_ORIENTATION) == 0u);
    v->left_rad_q28 = (evs_vec3_t){0, 0, 0};
    if (learning) { v->left_rad_q28 = evs_gyro_bias_left(&v->bias, v->middle_q_cr, pair->interval_us); }
    const size_t n = collect_flow(v, flow, lengths_q8);
    pair->n_flow = (uint16_t)n;
    pair->flow_px_q8 = median(lengths_q8, n);
    pair->mismatch_q8 = evs_velocity_mismatch_q8(v);
    const evs_egomotion_config_t cfg = egomotion_config(v);
    const evs_status_t status =
        evs_egomotion_solve(&cfg, flow, n, scratch, EVS_EGOMOTION_PAPER_BYTES(v->n_tracks_max), &pair->solution);
    EVS_ASSERT(status == EVS_OK);
    (void)status;

    if (n < v->cfg.min_features) { pair->flags |= EVS_VELOCITY_FEW; }
    if (pair->flow_px_q8 < v->cfg.min_flow_px_q8) { pair->flags |= EVS_VELOCITY_STILL; }
    if (pair->mismatch_q8 > v->cfg.max_mismatch_q8) { pair->flags |= EVS_VELOCITY_UNLIKE; }
    if (((pair->solution.flags & EVS_EGOMOTION_VALID) == 0u) ||
        (pair->solution.sigma_rad_q28 > v->cfg.max_sigma_rad_q28)) {
        pair->flags |= EVS_VELOCITY_UNSOLVED;
    }
    if ((pair->flags & INVALID) == 0u) {
        pair->flags |= EVS_VELOCITY_VALID;
        evs_count(&v->counts.n_valid);
        if (learning) {
            const evs_gyro_bias_pair_t told = {.flow = flow,
                                               .n = n,
                                               .v_q30 = pair->solution.v_q30,
                                               .noise_q24 = pair->solution.noise_q24,
                                               .q_cr = v->middle_q_cr,
                                               .t_us = pair->t_us,
                                               .interval_us = pair->interval_us};
            evs_gyro_bias_learn(&v->bias, &told);
        }
    }
    learn(v, samples, collect_samples(v, samples));

    pair->v_r_q30 = pair->solution.v_q30;
    if ((pair->flags & EVS_VELOCITY_NO_ORIENTATION) == 0u) {
        const evs_mat3_t r_cr = evs_quat_to_mat3(v->middle_q_cr);
        pair->v_c_q30 = evs_mat3_apply(&r_cr, pair->v_r_q30);
    }
}

bool evs_velocity_step(evs_velocity_t *v, size_t max_tracks, evs_velocity_result_t *result)
{
    EVS_ASSERT((v != NULL) && (result != NULL) && (max_tracks >= 1u));
    switch (v->stage) {
    case STAGE_CORNERS:
        if (scan_some(v, max_tracks)) { v->stage = STAGE_PYRAMIDS; }
        return false;
    case STAGE_PYRAMIDS:
        take_corners(v); /* their memory is wanted now */
        build_pyramids(v);
        v->stage = STAGE_TRACKS;
        return false;
    case STAGE_TRACKS:
        if (track_some(v, max_tracks)) { v->stage = STAGE_SOLVE; }
        return false;
    case STAGE_SOLVE:
        solve(v);
        (void)evs_keyframes_store(&v->keyframes, v->t_us, v->pair.q_wr);
        v->stage = STAGE_IDLE;
        evs_count(&v->counts.n_results);
        *result = v->pair;
        return true;
    default:
        return false;
    }
}
