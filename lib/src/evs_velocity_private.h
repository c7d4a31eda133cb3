/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs_velocity_private.h
 * @brief Private: what the parts of velocity share.
 */
#ifndef EVS_VELOCITY_PRIVATE_H
#define EVS_VELOCITY_PRIVATE_H

#include "evs/velocity.h"

static inline evs_image_t evs_velocity_image_of(const evs_velocity_t *v, const uint8_t *px)
{
    const evs_image_t image = {px, v->cfg.keyframes.pinhole.width_px, v->cfg.keyframes.pinhole.height_px};
    return image;
}

/* How much the windows of the tracks differ, over how much the windows of one track and of the track before differ. Q8. */
uint16_t evs_velocity_mismatch_q8(const evs_velocity_t *v);

#endif
