/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  series.h
 * @brief A curve over time in fixed memory: of any number of samples about a thousand bins are kept, each with its
 * lowest and highest sample, so that a peak stays a peak. When the time runs out of bins, neighbours merge and bins
 * double.
 */
#ifndef EVR_SERIES_H
#define EVR_SERIES_H

#include <stddef.h>
#include <stdint.h>

#define EVR_SERIES_BINS 900u

/** First width of a bin; doubled as often as need be. */
#define EVR_SERIES_WIDTH_US 100

typedef struct {
    int64_t t_us; /**< Since the start. */
    double value;
    double spread; /**< Half the width of the band around it; 0 = none. */
} evr_sample_t;

typedef struct {
    evr_sample_t low, high;
    uint64_t n; /**< Samples; 0 = an empty bin. */
} evr_bin_t;

typedef struct {
    int64_t width_us;
    evr_bin_t bin[EVR_SERIES_BINS];
} evr_series_t;

void evr_series_clear(evr_series_t *s);

/** @param t_us  Since the start, in any order; a negative one is ignored. */
void evr_series_put(evr_series_t *s, int64_t t_us, double value);
void evr_series_put_spread(evr_series_t *s, int64_t t_us, double value, double spread);

/** The samples kept of one bin in the order of time: 0, 1 or 2 of them. */
size_t evr_series_samples(const evr_bin_t *bin, evr_sample_t out[2]);

/** The same for counts: how many things happened in each bin. */
typedef struct {
    int64_t width_us;
    uint64_t n[EVR_SERIES_BINS];
} evr_counts_t;

void evr_counts_clear(evr_counts_t *c);

/** n things at times in order, each less start_us. */
void evr_counts_add(evr_counts_t *c, int64_t start_us, const int64_t *t_us, size_t n);

#endif
