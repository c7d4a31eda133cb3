/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  decimal.h
 * @brief Exact decimal text to scaled integers and back. Time never passes through a float: an epoch-sized time in
 *        nanoseconds has 19 digits, a double holds 15.9.
 */
#ifndef EVH_DECIMAL_H
#define EVH_DECIMAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/**
 * Read a decimal number (sign, digits, point, exponent) as an integer of 10^-decimals units, rounded half away from
 * zero. @p decimals may be negative: -3 turns nanoseconds into microseconds.
 * @param[in,out] text   Moved to the first character that does not belong to the number.
 * @param[out]    exact  May be NULL; false where digits were rounded away.
 * @return false when there is no number, or when it does not fit.
 */
bool evh_decimal_parse(const char **text, const char *end, int decimals, int64_t *value, bool *exact);

/** Write value / 10^decimals with exactly that many digits after the point. Returns the length; needs <= 24 bytes. */
size_t evh_decimal_format(char *out, int64_t value, unsigned decimals);

#endif
