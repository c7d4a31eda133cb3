/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  rows.h
 * @brief Tables of samples in text: a time and numbers a line, as every data set writes IMU samples and poses.
 *
 * Columns are parted by blanks, tabs, commas or semicolons. A header, with or without '#', names them; the names of
 * EuRoC, TUM and evstab are known. Without a header the caller's layout counts. Further columns are ignored.
 * Plain or gzip; one row of memory. A time is read exactly, in seconds, or in ns or us where the header says so or
 * where it is an integer that can be nothing else.
 */
#ifndef EVH_ROWS_H
#define EVH_ROWS_H

#include "lines.h"
#include "tally.h"

typedef enum {
    EVH_Q_T = 0,
    EVH_Q_GX,
    EVH_Q_GY,
    EVH_Q_GZ, /**< rad/s */
    EVH_Q_AX,
    EVH_Q_AY,
    EVH_Q_AZ, /**< m/s^2 */
    EVH_Q_MX,
    EVH_Q_MY,
    EVH_Q_MZ, /**< uT */
    EVH_Q_PX,
    EVH_Q_PY,
    EVH_Q_PZ, /**< m */
    EVH_Q_QW,
    EVH_Q_QX,
    EVH_Q_QY,
    EVH_Q_QZ,
    EVH_Q_VX,
    EVH_Q_VY,
    EVH_Q_VZ,    /**< m/s, or a direction */
    EVH_Q_SIGMA, /**< deg: of a direction */
    EVH_Q_SPAN,  /**< s: the interval that a row stands for */
    EVH_Q_COUNT,
    EVH_Q_SKIP = EVH_Q_COUNT /**< A column that nobody reads. */
} evh_quantity_t;

#define EVH_ROWS_COLUMNS_MAX 64u

#define EVH_BIT(quantity) (1u << (unsigned)(quantity))

typedef struct {
    evh_quantity_t column[EVH_ROWS_COLUMNS_MAX];
    size_t n_columns;
} evh_layout_t;

typedef struct {
    int64_t t_us; /**< Valid where has_time. */
    bool has_time;
    uint32_t present; /**< EVH_BIT of each number that was there; an empty optional field is not. */
    double value[EVH_Q_COUNT];
    evh_fault_t fault; /**< EVH_FAULT_NONE, or why this row must not be used. */
    uint64_t line;
} evh_row_t;

typedef struct {
    evh_lines_t lines;
    evh_layout_t layout;
    bool from_header; /**< The layout was read from the file. */
    uint32_t required;
    double limit[EVH_Q_COUNT]; /**< A larger magnitude is out of range; 0 = no limit. */
    int time_decimals;         /**< Of evh_decimal_parse(): 6 = seconds, -3 = ns, 0 = us; INT_MAX = not known yet. */
    evh_row_t ahead;           /**< The row after the one handed out: it decides whether a jump in time is believed. */
    bool has_ahead;
    bool started;
    int64_t last_us;
    evh_tally_t tally;
} evh_rows_t;

/** The quantity that a column name stands for ("w_RS_S_x [rad s^-1]", "gx_rad_s", "qw", ...); EVH_Q_SKIP if unknown. */
evh_quantity_t evh_quantity_from_name(const char *name, size_t length);
const char *evh_quantity_name(evh_quantity_t quantity);

/**
 * Open, read the header if there is one, and check that all of @p required (EVH_BIT mask) have a column.
 * @param layout  Columns of a file without header; NULL = a header is needed.
 */
bool evh_rows_open(evh_rows_t *rows, const char *path, const evh_layout_t *layout, uint32_t required, evh_error_t *err);

/** The next row, a faulty one too (it is in the tally then). @return false at the end, or on failure (see @p err). */
bool evh_rows_next_any(evh_rows_t *rows, evh_row_t *row, evh_error_t *err);

/** The next row without fault. */
bool evh_rows_next(evh_rows_t *rows, evh_row_t *row, evh_error_t *err);

void evh_rows_close(evh_rows_t *rows);

#endif
