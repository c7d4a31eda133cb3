/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  png_bytes.h
 * @brief A grey picture of 8 or 4 bits as a PNG file in memory.
 */
#ifndef EVR_PNG_BYTES_H
#define EVR_PNG_BYTES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint8_t *bytes; /**< The caller frees them. */
    size_t n;
} evr_png_t;

/**
 * @param grey  Row-major, a byte a pixel.
 * @param bits  8, or 4 for values up to 15.
 * @return false when memory is short.
 */
bool evr_png_encode(evr_png_t *png, const uint8_t *grey, int width, int height, int bits);

#endif
