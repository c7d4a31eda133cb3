/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_pipeline_private.h"

#include <string.h>

#if EVS_NO_IMAGES

size_t evs_pipeline_imaging_bytes(const evs_pipeline_config_t *cfg)
{
    (void)cfg;
    return 0u; /* such settings are out of range */
}

evs_status_t evs_pipeline_imaging_init(evs_pipeline_imaging_t *imaging, const evs_pipeline_config_t *cfg,
                                       unsigned char **cursor)
{
    (void)imaging;
    (void)cfg;
    (void)cursor;
    return EVS_ERR_ARG;
}

void evs_pipeline_imaging_push_orientation(evs_pipeline_t *p, const evs_orientation_t *sample)
{
    (void)p;
    (void)sample;
}

void evs_pipeline_imaging_add(evs_pipeline_t *p, const evs_event_t *ev, const evs_point_t *points, size_t n)
{
    (void)p;
    (void)ev;
    (void)points;
    (void)n;
}

void evs_pipeline_imaging_finish(evs_pipeline_t *p, evs_pipeline_chunk_t *chunk)
{
    (void)p;
    (void)chunk;
}

bool evs_pipeline_velocity(evs_pipeline_t *p, size_t max_tracks, evs_velocity_result_t *result)
{
    (void)p;
    (void)max_tracks;
    (void)result;
    return false;
}

bool evs_pipeline_velocity_busy(const evs_pipeline_t *p)
{
    (void)p;
    return false;
}

const evs_velocity_t *evs_pipeline_velocity_part(const evs_pipeline_t *p)
{
    (void)p;
    return NULL;
}

#else

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

static bool warps_afterwards(const evs_pipeline_config_t *cfg)
{
    return (cfg->warp == EVS_PIPELINE_WARP_GLOBAL) || (cfg->warp == EVS_PIPELINE_WARP_TILED);
}

static evs_warp_config_t warp_config(const evs_pipeline_config_t *cfg)
{
    evs_warp_config_t warp = cfg->warp_search;
    warp.kind = (cfg->warp == EVS_PIPELINE_WARP_GLOBAL) ? EVS_WARP_GLOBAL : EVS_WARP_TILED;
    warp.width_px = cfg->camera.width_px;
    warp.height_px = cfg->camera.height_px;
    return warp;
}

/* Whether the settings that sizes are computed from fit each other; the modules judge the rest. */
static bool sizes_ok(const evs_pipeline_config_t *cfg)
{
    const bool image_ok = ((uint32_t)cfg->image >= EVS_PIPELINE_IMAGE_COUNT) &&
                          ((uint32_t)cfg->image <= EVS_PIPELINE_IMAGE_SURFACE) &&
                          ((uint32_t)cfg->iwe.vote <= EVS_IWE_GAUSSIAN);
    if (!image_ok || ((uint32_t)cfg->warp > EVS_PIPELINE_WARP_TILED)) { return false; }
    if (cfg->warp == EVS_PIPELINE_WARP_NONE) { return true; }
    if (cfg->image == EVS_PIPELINE_IMAGE_SURFACE) { return false; }
    if (cfg->warp == EVS_PIPELINE_WARP_PREDICTED) { return cfg->velocity_on; }
    const evs_warp_config_t *const warp = &cfg->warp_search;
    return (cfg->n_warp_events >= 1u) && (warp->n_budget <= EVS_WARP_BUDGET_MAX) && (warp->max_px <= EVS_WARP_MAX_PX) &&
           (warp->shift <= EVS_WARP_SHIFT_MAX);
}

size_t evs_pipeline_imaging_bytes(const evs_pipeline_config_t *cfg)
{
    if (!sizes_ok(cfg)) { return 0u; }
    const evs_iwe_config_t iwe = iwe_config(cfg);
    size_t bytes = EVS_PIPELINE_IMAGE_BYTES(iwe.width_px, iwe.height_px, cfg->image, iwe.vote, cfg->warp,
                                            cfg->velocity_on, cfg->n_batch);
    if (warps_afterwards(cfg)) {
        const evs_warp_config_t *const warp = &cfg->warp_search;
        bytes += EVS_PIPELINE_WARP_BYTES(iwe.width_px, iwe.height_px, cfg->n_warp_events, warp->n_budget, warp->max_px,
                                         warp->shift);
    }
    if (!cfg->velocity_on) { return bytes; }
    const evs_velocity_config_t velocity = velocity_config(cfg);
    const size_t n_velocity = evs_velocity_bytes(&velocity);
    return (n_velocity > 0u) ? bytes + EVS_PIPELINE_PART(n_velocity) : 0u;
}

static evs_status_t init_warp(evs_pipeline_imaging_t *m, const evs_pipeline_config_t *cfg, unsigned char **cursor)
{
    if (cfg->warp == EVS_PIPELINE_WARP_PREDICTED) {
        m->warped = evs_pipeline_take(cursor, cfg->n_batch * sizeof m->warped[0]);
    }
    if (!warps_afterwards(cfg)) { return EVS_OK; }
    const evs_warp_config_t warp = warp_config(cfg);
    const size_t n_bytes = EVS_WARP_BYTES(warp.width_px, warp.height_px, warp.n_budget, warp.max_px, warp.shift);
    m->events = evs_pipeline_take(cursor, cfg->n_warp_events * sizeof m->events[0]);
    m->warped = evs_pipeline_take(cursor, cfg->n_warp_events * sizeof m->warped[0]);
    return evs_warp_init(&m->search, &warp, evs_pipeline_take(cursor, n_bytes), n_bytes);
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
    if (status == EVS_OK) { status = init_warp(imaging, cfg, cursor); }
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

void evs_pipeline_imaging_push_orientation(evs_pipeline_t *p, const evs_orientation_t *sample)
{
    if (p->cfg.velocity_on) { evs_velocity_push_orientation(&p->imaging->velocity, sample); }
}

/* The first event of a window: an old surface is of no use after a saccade, nor is a flow seen from elsewhere. */
static void begin_window(evs_pipeline_t *p, uint32_t t_us)
{
    evs_pipeline_imaging_t *const m = p->imaging;
    m->empty = false;
    if ((p->cfg.image == EVS_PIPELINE_IMAGE_SURFACE) && p->window_saccade) { evs_surface_clear(&m->surface); }
    /* A warp to the middle of the window displaces edges least where the flow is wrong. It is not known yet where that
     * will be: as late as in the window before. */
    m->t_warp_us = t_us + m->duration_us / 2u;
    m->warping = (p->cfg.warp == EVS_PIPELINE_WARP_PREDICTED) && p->slice_oriented &&
                 same_rotation(m->flow_q_wr, reference_of(p)) && (evs_flow_grid_n_measured(&m->flow) > 0u);
}

/* Keep events until the window has closed. */
static void keep(evs_pipeline_t *p, const evs_event_t *ev, const evs_point_t *points, size_t n)
{
    evs_pipeline_imaging_t *const m = p->imaging;
    const size_t room = p->cfg.n_warp_events - m->n_kept;
    const size_t n_new = (n < room) ? n : room;
    memcpy(&m->events[m->n_kept], ev, n_new * sizeof ev[0]);
    memcpy(&m->warped[m->n_kept], points, n_new * sizeof points[0]);
    m->n_kept += n_new;
    evs_count_add(&p->counts.n_unwarped, n - n_new);
}

void evs_pipeline_imaging_add(evs_pipeline_t *p, const evs_event_t *ev, const evs_point_t *points, size_t n)
{
    evs_pipeline_imaging_t *const m = p->imaging;
    if (m->empty) { begin_window(p, ev[0].t_us); }
    if (p->cfg.image == EVS_PIPELINE_IMAGE_SURFACE) {
        evs_surface_add(&m->surface, ev, points, n);
    } else if (warps_afterwards(&p->cfg)) {
        keep(p, ev, points, n);
    } else if (m->warping) {
        evs_warp_map(&m->flow, ev, points, n, m->t_warp_us, m->warped);
        evs_iwe_add(&m->iwe, m->warped, n);
    } else {
        evs_iwe_add(&m->iwe, points, n);
    }
}

/* --- images ------------------------------------------------------------------------------------------------------- */

/* Find the flow of the window's events, and let them vote from where it takes them. */
static void warp_kept(evs_pipeline_imaging_t *m, uint32_t t_us)
{
    evs_warp_result_t result;
    evs_warp_estimate(&m->search, m->events, m->warped, m->n_kept, NULL, &m->flow, &result);
    evs_warp_map(&m->flow, m->events, m->warped, m->n_kept, t_us, m->warped);
    evs_iwe_add(&m->iwe, m->warped, m->n_kept);
}

/*
 * The time that an image belongs to: what its events were warped to, or the middle of the window. Where all its events were
 * rotated as the first one, a warp must take them back to that one's time: rotation is part of the flow then.
 */
static uint32_t image_time(const evs_pipeline_t *p, const evs_window_end_t *end)
{
    if (p->imaging->warping) { return p->imaging->t_warp_us; }
    const bool first = warps_afterwards(&p->cfg) && (p->cfg.stabilize.rotation == EVS_ROTATION_WINDOW);
    return first ? end->t_first_us : end->t_first_us + (end->t_last_us - end->t_first_us) / 2u;
}

static void render(evs_pipeline_t *p, const evs_window_end_t *end, uint8_t *plane, evs_pipeline_chunk_t *chunk)
{
    evs_pipeline_imaging_t *const m = p->imaging;
    const uint32_t duration_us = end->t_last_us - end->t_first_us;
    chunk->image_t_us = image_time(p, end);
    if (p->cfg.image == EVS_PIPELINE_IMAGE_SURFACE) {
        evs_surface_end_window(&m->surface, duration_us);
        evs_surface_render(&m->surface, end->t_last_us, plane);
    } else {
        if (warps_afterwards(&p->cfg)) { warp_kept(m, chunk->image_t_us); }
        evs_iwe_render(&m->iwe, plane);
    }
    chunk->image = (evs_image_t){plane, p->cfg.camera.width_px, p->cfg.camera.height_px};
    evs_count(&p->counts.n_images);
}

/* Begin with the velocity of an image, which no work is under way to hinder. */
static void begin_velocity(evs_pipeline_t *p, const evs_pipeline_chunk_t *chunk)
{
    evs_pipeline_imaging_t *const m = p->imaging;
    if (p->cfg.warp == EVS_PIPELINE_WARP_PREDICTED) {
        /* The flow of the last pair is final now, whenever its steps were made: the next window may be warped by it. */
        m->flow = m->velocity.grid;
        m->flow_q_wr = m->velocity.grid_q_wr;
    }
    /* A bias that the filter knows is in the view no longer. */
    m->bias_known = m->bias_known || (p->bias_known && (evs_time_diff_us(chunk->image_t_us, p->bias_known_us) >= 0));
    evs_velocity_learn_bias(&m->velocity,
                            p->cfg.velocity.learn_bias && (p->cfg.source == EVS_PIPELINE_IMU) && !m->bias_known);
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
    if (!m->empty) { m->duration_us = chunk->end.t_last_us - chunk->end.t_first_us; }
    m->n_kept = 0u;
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

#endif
