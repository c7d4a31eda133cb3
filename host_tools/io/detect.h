/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  detect.h
 * @brief What kind of file this is, from its first lines rather than from its name.
 */
#ifndef EVH_DETECT_H
#define EVH_DETECT_H

#include "error.h"

typedef enum {
    EVH_KIND_UNKNOWN = 0,
    EVH_KIND_EMPTY,
    EVH_KIND_EVENTS, /**< t x y p */
    EVH_KIND_IMU,
    EVH_KIND_POSES,
    EVH_KIND_CALIB,  /**< fx fy cx cy ... */
    EVH_KIND_CONFIG, /**< YAML */
    EVH_KIND_IMAGES  /**< t name */
} evh_kind_t;

/** @return false when the file cannot be read at all. */
bool evh_detect(const char *path, evh_kind_t *kind, evh_error_t *err);

#endif
