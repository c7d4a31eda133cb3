/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  flow_text.h
 * @brief Optical flow in text: a header that names the columns x, y, u, v and perhaps frame, then a vector a line.
 *
 * Columns are parted by commas, semicolons, blanks or tabs, in any order; further ones are ignored. Plain or gzip; one
 * line of memory. A line that is no vector is handed out with its fault, and counted.
 */
#ifndef EVH_FLOW_TEXT_H
#define EVH_FLOW_TEXT_H

#include "lines.h"
#include "tally.h"

#define EVH_FLOW_POSITION_LIMIT 8.0   /**< K^-1 px: 83 degrees off the axis. */
#define EVH_FLOW_LENGTH_LIMIT   128.0 /**< K^-1 px. */

typedef struct {
    int64_t frame;  /**< 0 in a file without that column. */
    bool has_frame; /**< Readable, even where the rest is not. */
    double x;       /**< K^-1 px */
    double y;
    double u; /**< displacement, K^-1 px */
    double v;
    evh_fault_t fault; /**< EVH_FAULT_NONE, or why x to v must not be used. */
    uint64_t line;
} evh_flow_row_t;

enum { EVH_FLOW_X, EVH_FLOW_Y, EVH_FLOW_U, EVH_FLOW_V, EVH_FLOW_FRAME, EVH_FLOW_COLUMNS };

typedef struct {
    evh_lines_t lines;
    size_t column[EVH_FLOW_COLUMNS]; /**< Where each is; SIZE_MAX for a frame that is not there. */
    evh_tally_t tally;
} evh_flow_t;

/** Open and read the header. Fails when x, y, u or v has no column. */
bool evh_flow_open(evh_flow_t *flow, const char *path, evh_error_t *err);

/** The next line that is neither blank nor a comment. @return false at the end, or on failure (see @p err). */
bool evh_flow_next(evh_flow_t *flow, evh_flow_row_t *row, evh_error_t *err);

void evh_flow_close(evh_flow_t *flow);

#endif
