/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "png_bytes.h"

#include <png.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>

#define LEVEL 6

static void append(png_structp writer, png_bytep bytes, png_size_t n)
{
    evr_png_t *const png = png_get_io_ptr(writer);
    uint8_t *const more = realloc(png->bytes, png->n + n);
    if (more == NULL) { png_error(writer, "out of memory"); }
    memcpy(more + png->n, bytes, n);
    png->bytes = more;
    png->n += n;
}

static void nothing_to_flush(png_structp writer) { (void)writer; }

static void silent(png_structp writer, png_const_charp message)
{
    (void)message;
    png_longjmp(writer, 1);
}

/* libpng leaves by longjmp: nothing here changes between setjmp and that but what pointers reach. */
static bool write_image(png_structp writer, png_infop info, const uint8_t *grey, int width, int height, int bits)
{
    if (setjmp(png_jmpbuf(writer)) != 0) { return false; }
    png_set_IHDR(writer, info, (png_uint_32)width, (png_uint_32)height, bits, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    /* Few events, many zeros: filters cost time and gain nothing. */
    png_set_filter(writer, PNG_FILTER_TYPE_BASE, PNG_FILTER_NONE);
    png_set_compression_level(writer, LEVEL);
    png_write_info(writer, info);
    png_set_packing(writer);
    for (int y = 0; y < height; y++) { png_write_row(writer, grey + (size_t)y * (size_t)width); }
    png_write_end(writer, info);
    return true;
}

bool evr_png_encode(evr_png_t *png, const uint8_t *grey, int width, int height, int bits)
{
    png_structp writer = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, silent, NULL);
    png_infop info = (writer != NULL) ? png_create_info_struct(writer) : NULL;
    bool ok = false;
    memset(png, 0, sizeof *png);
    if (info != NULL) {
        png_set_write_fn(writer, png, append, nothing_to_flush);
        ok = write_image(writer, info, grey, width, height, bits);
    }
    png_destroy_write_struct(&writer, &info);
    if (!ok) {
        free(png->bytes);
        memset(png, 0, sizeof *png);
    }
    return ok;
}
