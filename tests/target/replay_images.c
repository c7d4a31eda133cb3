/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "replay_images.h"

#include "crc32.h"
#include "evs/iwe.h"
#include "evs/surface.h"
#include "evs/warp.h"

/* For an emulator, each window is a lot of work, and a warp of one more than anything else. */
enum { W_MAX = 240, H_MAX = 180, WINDOWS = 12, WARP_WINDOWS = 2, WARP_EVENTS = 8000 };

static evs_iwe_t nearest, gaussian;
static evs_surface_t merged, with_sign;
static uint32_t nearest_memory[EVS_IWE_BYTES(W_MAX, H_MAX, EVS_IWE_NEAREST) / 4u];
static uint32_t gaussian_memory[EVS_IWE_BYTES(W_MAX, H_MAX, EVS_IWE_GAUSSIAN) / 4u];
static uint16_t merged_memory[EVS_SURFACE_BYTES(W_MAX, H_MAX) / 2u];
static uint16_t sign_memory[EVS_SURFACE_BYTES(W_MAX, H_MAX) / 2u];
static uint8_t plane[W_MAX * H_MAX];
static uint8_t half[EVS_IMAGE_HALF(W_MAX) * EVS_IMAGE_HALF(H_MAX)];

static evs_warp_t global, tiled;
static uint16_t global_memory[EVS_WARP_BYTES(W_MAX, H_MAX, EVS_WARP_BUDGET_GLOBAL, EVS_WARP_MAX_PX, 1u) / 2u];
static uint16_t tiled_memory[EVS_WARP_BYTES(W_MAX, H_MAX, EVS_WARP_BUDGET_TILED, EVS_WARP_MAX_PX, 1u) / 2u];
static evs_event_t events[WARP_EVENTS]; /* the first of the open window */
static evs_point_t points[WARP_EVENTS];
static size_t n_events;

static bool start_warp(uint16_t width_px, uint16_t height_px)
{
    const evs_warp_config_t one = evs_warp_config_default(EVS_WARP_GLOBAL, width_px, height_px);
    evs_warp_config_t many = evs_warp_config_default(EVS_WARP_TILED, width_px, height_px);
    many.cost = EVS_WARP_GRADIENT;
    n_events = 0u;
    return (evs_warp_init(&global, &one, global_memory, sizeof global_memory) == EVS_OK) &&
           (evs_warp_init(&tiled, &many, tiled_memory, sizeof tiled_memory) == EVS_OK);
}

bool replay_images_start(uint16_t width_px, uint16_t height_px)
{
    evs_iwe_config_t iwe = evs_iwe_config_default(width_px, height_px);
    evs_surface_config_t surface = evs_surface_config_default(width_px, height_px);
    if ((evs_iwe_init(&nearest, &iwe, nearest_memory, sizeof nearest_memory) != EVS_OK) ||
        (evs_surface_init(&merged, &surface, merged_memory, sizeof merged_memory) != EVS_OK)) {
        return false;
    }
    iwe.vote = EVS_IWE_GAUSSIAN;
    surface.polarity = EVS_SURFACE_SIGNED;
    return (evs_iwe_init(&gaussian, &iwe, gaussian_memory, sizeof gaussian_memory) == EVS_OK) &&
           (evs_surface_init(&with_sign, &surface, sign_memory, sizeof sign_memory) == EVS_OK) &&
           start_warp(width_px, height_px);
}

static uint32_t crc_iwe(uint32_t crc, evs_iwe_t *iwe)
{
    const evs_image_t image = {plane, iwe->cfg.width_px, iwe->cfg.height_px};
    evs_iwe_render(iwe, plane);
    evs_image_halve(&image, half);
    evs_iwe_clear(iwe);
    crc = crc32_bytes(crc, plane, EVS_IMAGE_BYTES(image.width_px, image.height_px));
    return crc32_bytes(crc, half, EVS_IMAGE_BYTES(EVS_IMAGE_HALF(image.width_px), EVS_IMAGE_HALF(image.height_px)));
}

static uint32_t crc_surface(uint32_t crc, evs_surface_t *surface, const evs_window_end_t *end)
{
    evs_surface_end_window(surface, end->t_last_us - end->t_first_us);
    evs_surface_render(surface, end->t_last_us, plane);
    if (end->reason == EVS_WINDOW_BY_RESTART) { evs_surface_clear(surface); }
    return crc32_bytes(crc, plane, EVS_IMAGE_BYTES(surface->cfg.width_px, surface->cfg.height_px));
}

static uint32_t crc_32(uint32_t crc, uint32_t value)
{
    const uint8_t bytes[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16), (uint8_t)(value >> 24)};
    return crc32_bytes(crc, bytes, sizeof bytes);
}

static uint32_t crc_16s(uint32_t crc, int16_t x, int16_t y)
{
    return crc_32(crc, (uint32_t)(uint16_t)x | ((uint32_t)(uint16_t)y << 16));
}

/* An estimate, begun at what the one before has left in the grid, and the events moved by it. */
static uint32_t crc_warp(uint32_t crc, evs_warp_t *warp, evs_flow_grid_t *flow)
{
    evs_warp_result_t result;
    evs_warp_estimate(warp, events, points, n_events, (flow->n_cols > 0u) ? flow : NULL, flow, &result);
    evs_warp_map(flow, events, points, n_events, events[n_events / 2u].t_us, points);
    crc = crc_32(crc_32(crc, result.flags), result.n_evaluations);
    crc = crc_32(crc_32(crc, (uint32_t)result.contrast_after), (uint32_t)(result.contrast_after >> 32));
    for (uint16_t t = 0u; t < flow->n_cols * flow->n_rows; t++) {
        const evs_flow_velocity_t v =
            evs_flow_grid_tile(flow, (uint16_t)(t % flow->n_cols), (uint16_t)(t / flow->n_cols));
        crc = crc_16s(crc, v.x_px_s_q3, v.y_px_s_q3);
    }
    for (size_t i = 0u; i < n_events; i++) { crc = crc_16s(crc, points[i].x_q4, points[i].y_q4); }
    return crc;
}

static void add_warp(replay_images_t *images, const evs_pipeline_chunk_t *chunk)
{
    for (size_t i = 0u; (i < chunk->n) && (n_events < WARP_EVENTS); i++) {
        events[n_events] = chunk->events[i];
        points[n_events++] = chunk->stabilized[i];
    }
    if ((chunk->end.reason == EVS_WINDOW_OPEN) || (n_events == 0u)) { return; }
    evs_flow_grid_t flow = {.n_cols = 0u};
    images->warp = crc_warp(images->warp, &global, &flow);
    images->warp = crc_warp(images->warp, &tiled, &flow);
    n_events = 0u;
}

void replay_images_add(replay_images_t *images, const evs_pipeline_chunk_t *chunk)
{
    if (chunk->window >= WINDOWS) { return; }
    if (chunk->window < WARP_WINDOWS) { add_warp(images, chunk); }
    evs_iwe_add(&nearest, chunk->stabilized, chunk->n);
    evs_iwe_add(&gaussian, chunk->stabilized, chunk->n);
    evs_surface_add(&merged, chunk->events, chunk->stabilized, chunk->n);
    evs_surface_add(&with_sign, chunk->events, chunk->stabilized, chunk->n);
    if (chunk->end.reason != EVS_WINDOW_OPEN) {
        images->iwe = crc_iwe(crc_iwe(images->iwe, &nearest), &gaussian);
        images->surface = crc_surface(crc_surface(images->surface, &merged, &chunk->end), &with_sign, &chunk->end);
    }
}
