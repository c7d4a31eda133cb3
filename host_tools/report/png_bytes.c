/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "png_bytes.h"

#include <png.h>
#include <stdlib.h>
#include <string.h>

bool evr_png_encode(evr_png_t *png, const uint8_t *grey, int width, int height)
{
    png_image image;
    png_alloc_size_t n = 0u;
    memset(png, 0, sizeof *png);
    memset(&image, 0, sizeof image);
    image.version = PNG_IMAGE_VERSION;
    image.width = (png_uint_32)width;
    image.height = (png_uint_32)height;
    image.format = PNG_FORMAT_GRAY;
    image.flags = PNG_IMAGE_FLAG_FAST; /* Few events, many zeros: filters cost time and gain nothing. */
    if (png_image_write_to_memory(&image, NULL, &n, 0, grey, 0, NULL) == 0) { return false; }
    png->bytes = malloc(n);
    if (png->bytes == NULL) { return false; }
    if (png_image_write_to_memory(&image, png->bytes, &n, 0, grey, 0, NULL) == 0) {
        free(png->bytes);
        png->bytes = NULL;
        return false;
    }
    png->n = n;
    return true;
}
