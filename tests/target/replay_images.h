/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  replay_images.h
 * @brief Images of the first windows of a recording, condensed into a CRC for each kind.
 */
#ifndef EVS_TESTS_REPLAY_IMAGES_H
#define EVS_TESTS_REPLAY_IMAGES_H

#include "evs/pipeline.h"

typedef struct {
    uint32_t iwe;     /**< CRC-32 of images by nearest and by Gaussian votes, and of half of them. */
    uint32_t surface; /**< CRC-32 of images with and without polarity. */
    uint32_t warp;    /**< CRC-32 of contrast maximization: both kinds, each with another cost, and moved events. */
} replay_images_t;

/** Begin anew; the images go on from one recording to the next otherwise. Returns false when a setting is refused. */
bool replay_images_start(uint16_t width_px, uint16_t height_px);

/** Take a chunk in. */
void replay_images_add(replay_images_t *images, const evs_pipeline_chunk_t *chunk);

#endif
