/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  output.h
 * @brief The folder that a simulation writes: the form of the Event Camera Dataset, plus velocity.txt and meta.json.
 */
#ifndef EVSIM_OUTPUT_H
#define EVSIM_OUTPUT_H

#include "motion.h"
#include "pixels.h"
#include "text_out.h"

typedef struct {
    const char *dir;
    evsim_text_t events;
    evsim_text_t images;
    bool frames;
    uint64_t n_events;
    uint64_t n_on;
    uint64_t n_frames;
} evsim_output_t;

/** Make the folder and open its files; what an older run left under other names is removed. Close also after a failure.
 */
bool evsim_output_open(evsim_output_t *out, const char *dir, const evsim_settings_t *settings, evh_error_t *err);

/** groundtruth.txt and velocity.txt (200 Hz), imu.txt, calib.txt. */
bool evsim_output_truth(const char *dir, const evsim_settings_t *settings, const evsim_motion_t *motion,
                        evh_error_t *err);

void evsim_output_events(evsim_output_t *out, const evsim_event_t *event, size_t n, int64_t base_us);

/** @param t_ns  Middle of the exposure. */
bool evsim_output_frame(evsim_output_t *out, int64_t t_ns, const uint8_t *gray, unsigned width_px, unsigned height_px,
                        evh_error_t *err);

bool evsim_output_close(evsim_output_t *out, evh_error_t *err);

#endif
