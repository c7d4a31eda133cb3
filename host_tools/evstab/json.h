/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  json.h
 * @brief Small additions to cJSON: numbers that are written as they are meant, and whole files.
 */
#ifndef EVT_JSON_H
#define EVT_JSON_H

#include <cJSON.h>
#include <stdint.h>

#include "error.h"

void evt_json_text(cJSON *to, const char *key, const char *text); /**< NULL becomes null. */
void evt_json_count(cJSON *to, const char *key, uint64_t value);  /**< All digits: a double would round. */
void evt_json_seconds(cJSON *to, const char *key, int64_t t_us);  /**< Six decimals, exact. */
void evt_json_number(cJSON *to, const char *key, double value);   /**< Nine digits; null when not finite. */
void evt_json_numbers(cJSON *to, const char *key, const double *value, int n);

/** The file as an object. @return NULL on failure; free with cJSON_Delete(). */
cJSON *evt_json_read(const char *path, evh_error_t *err);

/** Write and free @p root, also on failure. NULL = memory was short. */
bool evt_json_write(cJSON *root, const char *path, evh_error_t *err);

/** root.a.b as text or number, or the default. Keys parted by dots. */
const char *evt_json_get_text(const cJSON *root, const char *keys, const char *otherwise);
double evt_json_get_number(const cJSON *root, const char *keys, double otherwise);

#endif
