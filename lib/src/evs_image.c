/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/image.h"

static void halve_row(const uint8_t *restrict top, const uint8_t *restrict bottom, size_t width, uint8_t *restrict out)
{
    const size_t pairs = width / 2u;
    for (size_t x = 0u; x < pairs; x++) {
        const uint32_t sum = (uint32_t)top[2u * x] + top[2u * x + 1u] + bottom[2u * x] + bottom[2u * x + 1u];
        out[x] = (uint8_t)((sum + 2u) >> 2);
    }
    if ((width & 1u) != 0u) { out[pairs] = (uint8_t)(((uint32_t)top[width - 1u] + bottom[width - 1u] + 1u) >> 1); }
}

void evs_image_halve(const evs_image_t *in, uint8_t *out)
{
    EVS_ASSERT((in != NULL) && (in->px != NULL) && (out != NULL));
    const size_t width = in->width_px;
    for (size_t y = 0u; y < in->height_px; y += 2u) {
        const uint8_t *const top = in->px + y * width;
        halve_row(top, (y + 1u < in->height_px) ? top + width : top, width, out);
        out += EVS_IMAGE_HALF(width);
    }
}
