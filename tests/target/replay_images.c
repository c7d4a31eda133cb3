/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "replay_images.h"

#include "crc32.h"
#include "evs/iwe.h"
#include "evs/surface.h"

enum { W_MAX = 240, H_MAX = 180, WINDOWS = 12 /* for an emulator, each is a lot of work */ };

static evs_iwe_t nearest, gaussian;
static evs_surface_t merged, with_sign;
static uint32_t nearest_memory[EVS_IWE_BYTES(W_MAX, H_MAX, EVS_IWE_NEAREST) / 4u];
static uint32_t gaussian_memory[EVS_IWE_BYTES(W_MAX, H_MAX, EVS_IWE_GAUSSIAN) / 4u];
static uint16_t merged_memory[EVS_SURFACE_BYTES(W_MAX, H_MAX) / 2u];
static uint16_t sign_memory[EVS_SURFACE_BYTES(W_MAX, H_MAX) / 2u];
static uint8_t plane[W_MAX * H_MAX];
static uint8_t half[EVS_IMAGE_HALF(W_MAX) * EVS_IMAGE_HALF(H_MAX)];

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
           (evs_surface_init(&with_sign, &surface, sign_memory, sizeof sign_memory) == EVS_OK);
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

void replay_images_add(replay_images_t *images, const evs_pipeline_chunk_t *chunk)
{
    if (chunk->window >= WINDOWS) { return; }
    evs_iwe_add(&nearest, chunk->stabilized, chunk->n);
    evs_iwe_add(&gaussian, chunk->stabilized, chunk->n);
    evs_surface_add(&merged, chunk->events, chunk->stabilized, chunk->n);
    evs_surface_add(&with_sign, chunk->events, chunk->stabilized, chunk->n);
    if (chunk->end.reason != EVS_WINDOW_OPEN) {
        images->iwe = crc_iwe(crc_iwe(images->iwe, &nearest), &gaussian);
        images->surface = crc_surface(crc_surface(images->surface, &merged, &chunk->end), &with_sign, &chunk->end);
    }
}
