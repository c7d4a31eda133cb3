/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "image_file.h"

#include <errno.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h> /* Needs stdio.h first. */
#include <png.h>

#define SIDE_MAX_PX 16384u

static bool size_ok(evsim_image_t *image, unsigned width_px, unsigned height_px, const char *path, evh_error_t *err)
{
    if ((width_px < 1u) || (height_px < 1u) || (width_px > SIDE_MAX_PX) || (height_px > SIDE_MAX_PX)) {
        return evh_fail(err, "%s: %ux%u pixels; a texture has at most %u a side", path, width_px, height_px,
                        SIDE_MAX_PX);
    }
    image->width_px = width_px;
    image->height_px = height_px;
    image->gray = malloc((size_t)width_px * height_px);
    if (image->gray == NULL) { return evh_fail(err, "%s: out of memory", path); }
    return true;
}

static bool read_png(evsim_image_t *image, FILE *file, const char *path, evh_error_t *err)
{
    static const png_color WHITE = {255u, 255u, 255u};
    png_image png;
    bool ok;
    memset(&png, 0, sizeof png);
    png.version = PNG_IMAGE_VERSION;
    if (png_image_begin_read_from_stdio(&png, file) == 0) {
        return evh_fail(err, "%s: not a good PNG file: %s", path, png.message);
    }
    png.format = PNG_FORMAT_GRAY;
    ok = size_ok(image, png.width, png.height, path, err);
    if (ok && (png_image_finish_read(&png, &WHITE, image->gray, 0, NULL) == 0)) {
        ok = evh_fail(err, "%s: not a good PNG file: %s", path, png.message);
    }
    png_image_free(&png);
    return ok;
}

typedef struct {
    struct jpeg_error_mgr manager; /* First: libjpeg knows this address only. */
    jmp_buf back;
    char text[JMSG_LENGTH_MAX];
} jpeg_failure_t;

static void jpeg_fail(j_common_ptr info)
{
    jpeg_failure_t *const failure = (jpeg_failure_t *)(void *)info->err;
    info->err->format_message(info, failure->text);
    longjmp(failure->back, 1);
}

static void jpeg_be_silent(j_common_ptr info, int level)
{
    (void)info;
    (void)level;
}

static bool read_jpeg(evsim_image_t *image, FILE *file, const char *path, evh_error_t *err)
{
    struct jpeg_decompress_struct jpeg;
    jpeg_failure_t failure;
    bool ok;
    jpeg.err = jpeg_std_error(&failure.manager);
    failure.manager.error_exit = jpeg_fail;
    failure.manager.emit_message = jpeg_be_silent;
    if (setjmp(failure.back) != 0) {
        jpeg_destroy_decompress(&jpeg);
        return evh_fail(err, "%s: not a good JPEG file: %s", path, failure.text);
    }
    jpeg_create_decompress(&jpeg);
    jpeg_stdio_src(&jpeg, file);
    (void)jpeg_read_header(&jpeg, TRUE);
    jpeg.out_color_space = JCS_GRAYSCALE;
    (void)jpeg_start_decompress(&jpeg);
    ok = size_ok(image, jpeg.output_width, jpeg.output_height, path, err);
    while (ok && (jpeg.output_scanline < jpeg.output_height)) {
        JSAMPROW row = image->gray + (size_t)jpeg.output_scanline * image->width_px;
        (void)jpeg_read_scanlines(&jpeg, &row, 1u);
    }
    if (ok) { (void)jpeg_finish_decompress(&jpeg); }
    jpeg_destroy_decompress(&jpeg);
    return ok;
}

bool evsim_image_read(evsim_image_t *image, const char *path, evh_error_t *err)
{
    uint8_t magic[2] = {0u, 0u};
    bool ok = false;
    FILE *const file = fopen(path, "rb");
    memset(image, 0, sizeof *image);
    if (file == NULL) { return evh_fail(err, "%s: cannot read: %s", path, strerror(errno)); }
    if (fread(magic, 1u, sizeof magic, file) != sizeof magic) { magic[0] = 0u; }
    rewind(file);
    if ((magic[0] == 0x89u) && (magic[1] == 'P')) {
        ok = read_png(image, file, path, err);
    } else if ((magic[0] == 0xFFu) && (magic[1] == 0xD8u)) {
        ok = read_jpeg(image, file, path, err);
    } else {
        ok = evh_fail(err, "%s: neither a PNG nor a JPEG file", path);
    }
    (void)fclose(file);
    if (!ok) {
        free(image->gray);
        image->gray = NULL;
    }
    return ok;
}

bool evsim_image_write_png(const char *path, const uint8_t *gray, unsigned width_px, unsigned height_px,
                           evh_error_t *err)
{
    png_image png;
    memset(&png, 0, sizeof png);
    png.version = PNG_IMAGE_VERSION;
    png.format = PNG_FORMAT_GRAY;
    png.width = width_px;
    png.height = height_px;
    png.flags = PNG_IMAGE_FLAG_FAST;
    if (png_image_write_to_file(&png, path, 0, gray, 0, NULL) == 0) {
        return evh_fail(err, "%s: cannot write: %s", path, png.message);
    }
    return true;
}
