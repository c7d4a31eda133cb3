/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evaluation.h
 * @brief Adds what evstab eval found to a report that evstab replay wrote.
 */
#ifndef EVR_EVALUATION_H
#define EVR_EVALUATION_H

#include <stdbool.h>

#include "error.h"

/**
 * Put the numbers into DIR/report.html, in the place of earlier ones. The page is replaced as a whole or not at all.
 * @param json   Valid JSON, as in eval.json.
 * @param found  [out] false: the run has no report (not an error).
 */
bool evr_put_evaluation(const char *dir, const char *json, bool *found, evh_error_t *err);

#endif
