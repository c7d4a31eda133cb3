/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  stats.h
 * @brief A list of errors and what one says about it.
 */
#ifndef EVL_STATS_H
#define EVL_STATS_H

#include <stdbool.h>
#include <stddef.h>

typedef struct {
    double *value;
    size_t n;
    size_t cap;
} evl_list_t;

typedef struct {
    size_t n; /**< 0: nothing else is defined. */
    double mean;
    double rmse;
    double median;
    double p95; /**< 95 % are at most this. */
    double max;
} evl_stats_t;

/** Append. @return false when memory is short. */
bool evl_list_add(evl_list_t *list, double value);
void evl_list_free(evl_list_t *list);

/** Sorts the list. Between two ranks a quantile is interpolated linearly, as numpy does. */
evl_stats_t evl_list_stats(evl_list_t *list);

#endif
