/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  image_file.h
 * @brief Gray images from PNG and JPEG files, and to PNG.
 */
#ifndef EVSIM_IMAGE_FILE_H
#define EVSIM_IMAGE_FILE_H

#include <stdbool.h>
#include <stdint.h>

#include "error.h"

typedef struct {
    unsigned width_px;
    unsigned height_px;
    uint8_t *gray; /**< Row-major; free() it. */
} evsim_image_t;

/** Colours become luminance; what is transparent becomes white. */
bool evsim_image_read(evsim_image_t *image, const char *path, evh_error_t *err);

bool evsim_image_write_png(const char *path, const uint8_t *gray, unsigned width_px, unsigned height_px,
                           evh_error_t *err);

#endif
