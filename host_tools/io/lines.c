/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include "lines.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <zlib.h>

#define BUFFER_BYTES (4u * EVH_LINE_MAX_BYTES)

bool evh_file_exists(const char *path)
{
    struct stat st;
    return (stat(path, &st) == 0) && !S_ISDIR(st.st_mode);
}

bool evh_file_is_regular(const char *path)
{
    struct stat st;
    return (stat(path, &st) == 0) && S_ISREG(st.st_mode);
}

bool evh_lines_open(evh_lines_t *lines, const char *path, evh_error_t *err)
{
    struct stat st;
    gzFile gz;

    memset(lines, 0, sizeof *lines);
    if (stat(path, &st) != 0) { return evh_fail(err, "%s: %s; check the path", path, strerror(errno)); }
    if (S_ISDIR(st.st_mode)) { return evh_fail(err, "%s: is a folder, but a file is needed here", path); }
    gz = gzopen(path, "rb");
    if (gz == NULL) {
        return evh_fail(err, "%s: %s; check that you may read it", path,
                        (errno != 0) ? strerror(errno) : "out of memory");
    }
    lines->gz = gz;
    lines->file_bytes = (int64_t)st.st_size;
    lines->path = strdup(path);
    lines->buffer = malloc(BUFFER_BYTES + 1u); /* One more: a missing last line end is added. */
    if ((lines->path == NULL) || (lines->buffer == NULL)) {
        evh_lines_close(lines);
        return evh_fail(err, "%s: out of memory", path);
    }
    (void)gzbuffer(gz, 1u << 17);
    return true;
}

static bool read_failed(evh_lines_t *lines, evh_error_t *err)
{
    int code = Z_OK;
    const char *const text = gzerror((gzFile)lines->gz, &code);
    const unsigned long long at = (unsigned long long)(lines->offset_bytes + (lines->end - lines->begin));
    lines->failed = true;
    if (code == Z_BUF_ERROR) {
        return evh_fail(
            err, "%s: the gzip data ends early, after %llu uncompressed bytes; the file is truncated, copy it again",
            lines->path, at);
    }
    if (code == Z_ERRNO) { return evh_fail(err, "%s: %s at byte %llu", lines->path, strerror(errno), at); }
    return evh_fail(err, "%s: damaged gzip data near uncompressed byte %llu (%s); copy it again", lines->path, at,
                    text);
}

/* The end of the last whole line in buffer[from, end), or `otherwise`. */
static size_t last_line_end(const evh_lines_t *lines, size_t from, size_t otherwise)
{
    for (size_t i = lines->end; i > from; i--) {
        if (lines->buffer[i - 1u] == '\n') { return i; }
    }
    return otherwise;
}

bool evh_lines_refill(evh_lines_t *lines, evh_error_t *err)
{
    if (lines->failed) { return false; }
    if (lines->begin > 0u) {
        memmove(lines->buffer, lines->buffer + lines->begin, lines->end - lines->begin);
        lines->end -= lines->begin;
        lines->whole_end -= lines->begin;
        lines->begin = 0u;
    }
    while ((lines->whole_end == 0u) && !lines->at_eof) {
        const size_t old_end = lines->end;
        int n;
        if (lines->end == BUFFER_BYTES) { /* Not one line end in all of it. */
            lines->whole_end = lines->end;
            break;
        }
        n = gzread((gzFile)lines->gz, lines->buffer + lines->end, (unsigned)(BUFFER_BYTES - lines->end));
        if (n < 0) { return read_failed(lines, err); }
        if (n == 0) {
            int code = Z_OK;
            (void)gzerror((gzFile)lines->gz, &code);
            if (code == Z_BUF_ERROR) { return read_failed(lines, err); }
            lines->at_eof = true;
            if (lines->end > 0u) { lines->buffer[lines->end++] = '\n'; }
            lines->whole_end = lines->end;
            break;
        }
        lines->end += (size_t)n;
        lines->whole_end = last_line_end(lines, old_end, 0u);
    }
    return lines->whole_end > 0u;
}

bool evh_lines_next(evh_lines_t *lines, evh_line_t *line, evh_error_t *err)
{
    for (;;) {
        const char *start;
        const char *stop;
        size_t bytes;
        if ((lines->begin == lines->whole_end) && !evh_lines_refill(lines, err)) { return false; }
        start = lines->buffer + lines->begin;
        stop = memchr(start, '\n', lines->whole_end - lines->begin);
        bytes = (stop != NULL) ? (size_t)(stop - start) + 1u : lines->whole_end - lines->begin;
        lines->begin += bytes;
        lines->offset_bytes += bytes;
        if (lines->skipping) {
            lines->skipping = (stop == NULL);
            continue;
        }
        lines->line++;
        lines->skipping = (stop == NULL);
        line->overlong = (bytes > EVH_LINE_MAX_BYTES) || (stop == NULL);
        line->text = start;
        line->length = bytes - 1u; /* text[length] stays readable: the line end, or the last byte of a cut line. */
        if ((line->length > 0u) && (line->text[line->length - 1u] == '\r')) { line->length--; }
        return true;
    }
}

double evh_lines_fraction(const evh_lines_t *lines)
{
    const double at = (double)gzoffset((gzFile)lines->gz);
    if (lines->at_eof || (lines->file_bytes <= 0)) { return 1.0; }
    return (at < (double)lines->file_bytes) ? at / (double)lines->file_bytes : 1.0;
}

void evh_lines_close(evh_lines_t *lines)
{
    if (lines->gz != NULL) { (void)gzclose((gzFile)lines->gz); }
    free(lines->buffer);
    free(lines->path);
    memset(lines, 0, sizeof *lines);
}
