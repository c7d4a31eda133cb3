/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_pipeline_private.h"

/* --- settings and memory ------------------------------------------------------------------------------------------ */

/* The settings of the modules, as far as the pipeline decides them. */
static evs_iwe_config_t iwe_config(const evs_pipeline_config_t *cfg)
{
    evs_iwe_config_t iwe = cfg->iwe;
    iwe.width_px = cfg->camera.width_px;
    iwe.height_px = cfg->camera.height_px;
    if (cfg->image == EVS_PIPELINE_IMAGE_COUNT) {
        iwe.vote = EVS_IWE_NEAREST;
        iwe.smooth = false;
    }
    return iwe;
}

static evs_surface_config_t surface_config(const evs_pipeline_config_t *cfg)
{
    evs_surface_config_t surface = cfg->surface;
    surface.width_px = cfg->camera.width_px;
    surface.height_px = cfg->camera.height_px;
    return surface;
}

static evs_velocity_config_t velocity_config(const evs_pipeline_config_t *cfg)
{
    evs_velocity_config_t velocity = cfg->velocity;
    velocity.keyframes.pinhole = evs_pipeline_pinhole(&cfg->camera);
    velocity.track.offset_us = cfg->track.offset_us;
    return velocity;
}

size_t evs_pipeline_imaging_bytes(const evs_pipeline_config_t *cfg)
{
    const bool image_ok = ((uint32_t)cfg->image >= EVS_PIPELINE_IMAGE_COUNT) &&
                          ((uint32_t)cfg->image <= EVS_PIPELINE_IMAGE_SURFACE) &&
                          ((uint32_t)cfg->iwe.vote <= EVS_IWE_GAUSSIAN);
    const bool warp_ok =
        (cfg->warp == EVS_PIPELINE_WARP_NONE) ||
        ((cfg->warp == EVS_PIPELINE_WARP_PREDICTED) && cfg->velocity_on && (cfg->image != EVS_PIPELINE_IMAGE_SURFACE));
    if (!image_ok || !warp_ok) { return 0u; }
    const evs_iwe_config_t iwe = iwe_config(cfg);
    const size_t bytes = EVS_PIPELINE_IMAGE_BYTES(iwe.width_px, iwe.height_px, cfg->image, iwe.vote, cfg->warp,
                                                  cfg->velocity_on, cfg->n_batch);
    if (!cfg->velocity_on) { return bytes; }
    const evs_velocity_config_t velocity = velocity_config(cfg);
    const size_t n_velocity = evs_velocity_bytes(&velocity);
    return (n_velocity > 0u) ? bytes + EVS_PIPELINE_PART(n_velocity) : 0u;
}

evs_status_t evs_pipeline_imaging_init(evs_pipeline_imaging_t *imaging, const evs_pipeline_config_t *cfg,
                                       unsigned char **cursor)
{
    *imaging = (evs_pipeline_imaging_t){.empty = true};
    const size_t n_px = EVS_IMAGE_BYTES(cfg->camera.width_px, cfg->camera.height_px);
    const bool surface_on = cfg->image == EVS_PIPELINE_IMAGE_SURFACE;
    evs_status_t status;
    if (surface_on) {
        const evs_surface_config_t surface = surface_config(cfg);
        const size_t n_bytes = EVS_SURFACE_BYTES(surface.width_px, surface.height_px);
        status = evs_surface_init(&imaging->surface, &surface, evs_pipeline_take(cursor, n_bytes), n_bytes);
    } else {
        const evs_iwe_config_t iwe = iwe_config(cfg);
        const size_t n_bytes = EVS_IWE_BYTES(iwe.width_px, iwe.height_px, iwe.vote);
        imaging->votes = evs_pipeline_take(cursor, n_bytes);
        status = evs_iwe_init(&imaging->iwe, &iwe, imaging->votes, n_bytes);
    }
    if (surface_on || !cfg->velocity_on) { imaging->plane = evs_pipeline_take(cursor, n_px); }
    if (cfg->warp == EVS_PIPELINE_WARP_PREDICTED) {
        imaging->warped = evs_pipeline_take(cursor, cfg->n_batch * sizeof imaging->warped[0]);
    }
    if ((status == EVS_OK) && cfg->velocity_on) {
        const evs_velocity_config_t velocity = velocity_config(cfg);
        const size_t n_bytes = evs_velocity_bytes(&velocity);
        status = evs_velocity_init(&imaging->velocity, &velocity, evs_pipeline_take(cursor, n_bytes), n_bytes);
    }
    return status;
}

/* --- events ------------------------------------------------------------------------------------------------------- */

static bool same_rotation(evs_quat_t a, evs_quat_t b)
{
    return (a.w == b.w) && (a.x == b.x) && (a.y == b.y) && (a.z == b.z);
}

/* World from the reference that points are stabilized to. */
static evs_quat_t reference_of(const evs_pipeline_t *p)
{
    return (p->cfg.source == EVS_PIPELINE_NONE) ? evs_quat_identity() : evs_stabilize_reference(&p->stabilize);
}

/* The first event of a window: an old surface is of no use after a saccade, nor is a flow seen from elsewhere. */
static void begin_window(evs_pipeline_t *p, uint32_t t_us)
{
    evs_pipeline_imaging_t *const m = p->imaging;
    m->empty = false;
    if ((p->cfg.image == EVS_PIPELINE_IMAGE_SURFACE) && p->window_saccade) { evs_surface_clear(&m->surface); }
    m->t_warp_us = t_us;
    m->warping = (p->cfg.warp == EVS_PIPELINE_WARP_PREDICTED) && p->slice_oriented &&
                 same_rotation(m->flow_q_wr, reference_of(p)) && (evs_flow_grid_n_measured(&m->flow) > 0u);
}

/* Take points back along the flow to where they were at the beginning of their window. */
static void warp(evs_pipeline_imaging_t *m, const evs_event_t *ev, const evs_point_t *points, size_t n)
{
    for (size_t i = 0u; i < n; i++) {
        m->warped[i] = points[i];
        if (evs_point_is_outside(points[i])) { continue; }
        const evs_flow_velocity_t flow = evs_flow_grid_at(&m->flow, points[i]);
        const int32_t back_us = evs_time_diff_us(m->t_warp_us, ev[i].t_us);
        const int32_t x_q4 = points[i].x_q4 + evs_flow_displacement_q4(flow.x_px_s_q3, back_us);
        const int32_t y_q4 = points[i].y_q4 + evs_flow_displacement_q4(flow.y_px_s_q3, back_us);
        const bool inside = (x_q4 >= -EVS_POINT_MAX_Q4) && (x_q4 <= EVS_POINT_MAX_Q4) && (y_q4 >= -EVS_POINT_MAX_Q4) &&
                            (y_q4 <= EVS_POINT_MAX_Q4);
        m->warped[i] = inside ? (evs_point_t){(int16_t)x_q4, (int16_t)y_q4} : evs_point_outside();
    }
}

void evs_pipeline_imaging_add(evs_pipeline_t *p, const evs_event_t *ev, const evs_point_t *points, size_t n)
{
    evs_pipeline_imaging_t *const m = p->imaging;
    if (m->empty) { begin_window(p, ev[0].t_us); }
    if (p->cfg.image == EVS_PIPELINE_IMAGE_SURFACE) {
        evs_surface_add(&m->surface, ev, points, n);
    } else if (m->warping) {
        warp(m, ev, points, n);
        evs_iwe_add(&m->iwe, m->warped, n);
    } else {
        evs_iwe_add(&m->iwe, points, n);
    }
}

/* --- images ------------------------------------------------------------------------------------------------------- */

static void render(evs_pipeline_t *p, const evs_window_end_t *end, uint8_t *plane, evs_pipeline_chunk_t *chunk)
{
    evs_pipeline_imaging_t *const m = p->imaging;
    const uint32_t duration_us = end->t_last_us - end->t_first_us;
    chunk->image_t_us = m->warping ? m->t_warp_us : end->t_first_us + duration_us / 2u;
    if (p->cfg.image == EVS_PIPELINE_IMAGE_SURFACE) {
        evs_surface_end_window(&m->surface, duration_us);
        evs_surface_render(&m->surface, end->t_last_us, plane);
    } else {
        evs_iwe_render(&m->iwe, plane);
    }
    chunk->image = (evs_image_t){plane, p->cfg.camera.width_px, p->cfg.camera.height_px};
    evs_count(&p->counts.n_images);
}

/* Begin with the velocity of an image, which no work is under way to hinder. */
static void begin_velocity(evs_pipeline_t *p, const evs_pipeline_chunk_t *chunk)
{
    evs_pipeline_imaging_t *const m = p->imaging;
    /* The flow of the last pair is final now, whenever its steps were made: the next window may be warped by it. */
    m->flow = m->velocity.grid;
    m->flow_q_wr = m->velocity.grid_q_wr;
    const evs_velocity_image_t image = {.px = chunk->image.px, .t_us = chunk->image_t_us, .q_wr = reference_of(p)};
    uint8_t *const scratch = (m->plane != NULL) ? m->plane : m->votes; /* the votes have been rendered */
    const evs_status_t status = evs_velocity_begin(&m->velocity, &image, scratch);
    EVS_ASSERT(status == EVS_OK);
    (void)status;
}

void evs_pipeline_imaging_finish(evs_pipeline_t *p, evs_pipeline_chunk_t *chunk)
{
    evs_pipeline_imaging_t *const m = p->imaging;
    const bool restarted = chunk->end.reason == EVS_WINDOW_BY_RESTART;
    const bool complete = !restarted && (chunk->end.reason != EVS_WINDOW_BY_FLUSH) &&
                          (p->window_oriented || (p->cfg.source == EVS_PIPELINE_NONE));
    uint8_t *const plane = p->cfg.velocity_on ? evs_velocity_plane(&m->velocity) : m->plane;
    if (m->empty) {
        /* the stream ended or restarted between two windows */
    } else if (!complete) {
        evs_count(&p->counts.n_images_incomplete);
    } else if (plane == NULL) {
        evs_count(&p->counts.n_images_busy);
    } else {
        render(p, &chunk->end, plane, chunk);
        if (p->cfg.velocity_on) { begin_velocity(p, chunk); }
    }
    if (p->cfg.image != EVS_PIPELINE_IMAGE_SURFACE) { evs_iwe_clear(&m->iwe); }
    if (restarted) {
        if (p->cfg.image == EVS_PIPELINE_IMAGE_SURFACE) { evs_surface_clear(&m->surface); }
        if (p->cfg.velocity_on) { evs_velocity_reset(&m->velocity); }
    }
    m->empty = true;
}

bool evs_pipeline_velocity(evs_pipeline_t *p, size_t max_tracks, evs_velocity_result_t *result)
{
    EVS_ASSERT((p != NULL) && (result != NULL));
    if (!p->cfg.velocity_on || !evs_velocity_step(&p->imaging->velocity, max_tracks, result)) { return false; }
    if (p->cfg.source == EVS_PIPELINE_NONE) { /* what does not turn is its own reference */
        result->v_c_q30 = result->v_r_q30;
        result->flags &= ~EVS_VELOCITY_NO_ORIENTATION;
    }
    return true;
}

bool evs_pipeline_velocity_busy(const evs_pipeline_t *p)
{
    EVS_ASSERT(p != NULL);
    return p->cfg.velocity_on && evs_velocity_busy(&p->imaging->velocity);
}

const evs_velocity_t *evs_pipeline_velocity_part(const evs_pipeline_t *p)
{
    EVS_ASSERT(p != NULL);
    return p->cfg.velocity_on ? &p->imaging->velocity : NULL;
}
