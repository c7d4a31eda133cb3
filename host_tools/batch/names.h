/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  names.h
 * @brief A folder name for each recording of a batch, no two alike.
 */
#ifndef EVB_NAMES_H
#define EVB_NAMES_H

#include <stdbool.h>
#include <stddef.h>

/**
 * The last part of each path, without .gz, .txt and .csv: "a/shapes/" and "a/shapes.txt" give "shapes". The second of a
 * name gets "_2" appended, and so on. ".", ".." and "/" take the name of the folder that they stand for.
 * @param[out] name  n new strings; free each. All NULL on failure.
 * @return false when memory is short.
 */
bool evb_names(const char *const *path, size_t n, char **name);

#endif
