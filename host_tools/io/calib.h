/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  calib.h
 * @brief A camera calibration as files hold it, and the check that every source of one goes through.
 */
#ifndef EVH_CALIB_H
#define EVH_CALIB_H

#include <stdint.h>

#include "error.h"

typedef struct {
    bool fisheye; /**< dist = k1 k2 k3 k4 of the equidistant model; else k1 k2 p1 p2 k3 of Brown-Conrady. */
    double fx_px, fy_px, cx_px, cy_px;
    double dist[5];
    uint16_t width_px; /**< 0 = the file does not say. */
    uint16_t height_px;
} evh_calib_t;

/** ECD calib.txt: fx fy cx cy [k1 k2 p1 p2 [k3]] on one line or several. */
bool evh_calib_text_read(evh_calib_t *calib, const char *path, evh_error_t *err);

/** Refuse a calibration that no camera has: a focal length of zero, an optical axis far off the sensor, NaN. */
bool evh_calib_check(const evh_calib_t *calib, const char *path, evh_error_t *err);

#endif
