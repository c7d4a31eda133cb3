/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  replay_imaging.h
 * @brief evstab replay: what becomes of a window. Which image, which warp, whether the direction of flight is measured.
 */
#ifndef EVT_REPLAY_IMAGING_H
#define EVT_REPLAY_IMAGING_H

#include "replay.h"

/** The words alone. @return false when one is wrong. */
bool evt_imaging_check_words(const evt_replay_options_t *o, bool *usage_fault, evh_error_t *err);

/** The published settings: tiled warp, Gaussian votes, ERL-V as published. */
void evt_imaging_paper(evs_pipeline_config_t *p);

/**
 * After attitude and window are settled.
 * @param lens_known  Without a lens an image position is no direction.
 */
bool evt_imaging_settle(evt_replay_t *r, const evt_replay_options_t *o, const evh_config_t *config, bool lens_known,
                        bool *usage_fault, evh_error_t *err);

const char *evt_image_name(evs_pipeline_image_t image);
const char *evt_warp_name(evs_pipeline_warp_t warp);
const char *evt_method_name(evs_egomotion_method_t method);

#endif
