/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "stats.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

bool evl_list_add(evl_list_t *list, double value)
{
    if (list->n == list->cap) {
        const size_t larger = (list->cap == 0u) ? 1024u : 2u * list->cap;
        double *const grown = realloc(list->value, larger * sizeof *grown);
        if (grown == NULL) { return false; }
        list->value = grown;
        list->cap = larger;
    }
    list->value[list->n++] = value;
    return true;
}

void evl_list_free(evl_list_t *list)
{
    free(list->value);
    memset(list, 0, sizeof *list);
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a;
    const double y = *(const double *)b;
    return (x > y) - (x < y);
}

static double quantile(const evl_list_t *sorted, double share)
{
    const double at = share * (double)(sorted->n - 1u);
    const size_t below = (size_t)floor(at);
    const size_t above = (below + 1u < sorted->n) ? below + 1u : below;
    return sorted->value[below] + (at - (double)below) * (sorted->value[above] - sorted->value[below]);
}

evl_stats_t evl_list_stats(evl_list_t *list)
{
    evl_stats_t s = {0};
    double sum = 0.0;
    double squares = 0.0;
    if (list->n == 0u) { return s; }
    qsort(list->value, list->n, sizeof list->value[0], by_value);
    for (size_t i = 0u; i < list->n; i++) {
        sum += list->value[i];
        squares += list->value[i] * list->value[i];
    }
    s.n = list->n;
    s.mean = sum / (double)list->n;
    s.rmse = sqrt(squares / (double)list->n);
    s.median = quantile(list, 0.5);
    s.p95 = quantile(list, 0.95);
    s.max = list->value[list->n - 1u];
    return s;
}
