/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  direction.h
 * @brief The direction of flight: its curves, and the picture of the pair of images whose direction is surest.
 */
#ifndef EVR_DIRECTION_H
#define EVR_DIRECTION_H

#include <stdbool.h>

#include "report.h"
#include "series.h"

#define EVR_ARROWS_MAX 4096u

/* Angles are counted in steps: a median in fixed memory. */
#define EVR_ANGLE_STEP_DEG 0.05
#define EVR_ANGLE_STEPS    3601u

typedef struct {
    uint32_t n[EVR_ANGLE_STEPS];
    uint64_t total;
} evr_angles_t;

typedef struct {
    evr_series_t component[3];
    evr_series_t truth[3];
    evr_angles_t sigma_deg, error_deg;

    evr_flow_t best; /* px and arrows are those below */
    bool has_best;
    uint8_t *px;
    evr_arrow_t *arrows;
} evr_flight_t;

/** @return false when memory is short. */
bool evr_flight_open(evr_flight_t *f, uint16_t width_px, uint16_t height_px);
void evr_flight_close(evr_flight_t *f);

/** @param start_us  0 of the curves. */
void evr_flight_add(evr_flight_t *f, const evr_direction_t *d, int64_t start_us);

/** Keep it if it is the best so far. */
void evr_flight_add_flow(evr_flight_t *f, const evr_flow_t *flow, size_t n_pixels);

void evr_angles_add(evr_angles_t *a, double deg);

/** To half a step; NaN of none. */
double evr_angles_median(const evr_angles_t *a);

#endif
