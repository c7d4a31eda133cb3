/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  lines.h
 * @brief Lines of a plain or gzip text file, in blocks: memory does not grow with the file.
 *
 * A line is handed out without its end (LF or CR LF). The last line needs no end. A line longer than
 * EVH_LINE_MAX_BYTES is handed out cut and flagged, so that binary garbage costs no memory.
 */
#ifndef EVH_LINES_H
#define EVH_LINES_H

#include <stddef.h>
#include <stdint.h>

#include "error.h"

#define EVH_LINE_MAX_BYTES 65536u

typedef struct {
    void *gz;   /**< gzFile: zlib reads plain files too. */
    char *path; /**< As given, for messages. */
    char *buffer;
    size_t begin;          /**< First byte not yet handed out. */
    size_t whole_end;      /**< Just after the last line end in the buffer. */
    size_t end;            /**< Just after the last byte in the buffer. */
    uint64_t line;         /**< Number of the line handed out last; the first line is 1. */
    uint64_t offset_bytes; /**< Of buffer[begin] in the (uncompressed) file. */
    int64_t file_bytes;    /**< On disk. */
    bool at_eof;
    bool failed;
    bool skipping; /**< Inside an overlong line whose start was handed out. */
} evh_lines_t;

bool evh_lines_open(evh_lines_t *lines, const char *path, evh_error_t *err);

/**
 * Refill so that buffer[begin, whole_end) holds at least one whole line; what is left in the buffer moves to its front.
 * Each line there ends in '\n'. For parsers that run over many lines at once: they advance begin, line and
 * offset_bytes.
 * @return false at the end of the file, or when reading failed (then lines->failed and @p err are set).
 */
bool evh_lines_refill(evh_lines_t *lines, evh_error_t *err);

typedef struct {
    const char *text; /**< Not terminated, but text[length] may be read: it is '\n' or '\r'. */
    size_t length;
    bool overlong;
} evh_line_t;

/** The next line. @return false at the end or on failure, see evh_lines_refill(). */
bool evh_lines_next(evh_lines_t *lines, evh_line_t *line, evh_error_t *err);

/** Share of the file on disk that has been read, 0..1. */
double evh_lines_fraction(const evh_lines_t *lines);

void evh_lines_close(evh_lines_t *lines);

/** True when @p path may be opened twice: a file, not a pipe. */
bool evh_file_is_regular(const char *path);

/** True when @p path names something that exists and is no directory. */
bool evh_file_exists(const char *path);

#endif
