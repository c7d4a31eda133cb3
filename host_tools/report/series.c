/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "series.h"

#include <string.h>

void evr_series_clear(evr_series_t *s)
{
    memset(s, 0, sizeof *s);
    s->width_us = EVR_SERIES_WIDTH_US;
}

static void merge(evr_bin_t *into, const evr_bin_t *from)
{
    if (from->n == 0u) { return; }
    if ((into->n == 0u) || (from->low.value < into->low.value)) { into->low = from->low; }
    if ((into->n == 0u) || (from->high.value > into->high.value)) { into->high = from->high; }
    into->n += from->n;
}

static void halve(evr_series_t *s)
{
    for (size_t i = 0u; i < EVR_SERIES_BINS / 2u; i++) {
        evr_bin_t both = s->bin[2u * i];
        merge(&both, &s->bin[2u * i + 1u]);
        s->bin[i] = both;
    }
    memset(&s->bin[EVR_SERIES_BINS / 2u], 0, EVR_SERIES_BINS / 2u * sizeof s->bin[0]);
    s->width_us *= 2;
}

void evr_series_put(evr_series_t *s, int64_t t_us, double value) { evr_series_put_spread(s, t_us, value, 0.0); }

void evr_series_put_spread(evr_series_t *s, int64_t t_us, double value, double spread)
{
    const evr_bin_t one = {{t_us, value, spread}, {t_us, value, spread}, 1u};
    if (t_us < 0) { return; }
    while (t_us / s->width_us >= (int64_t)EVR_SERIES_BINS) { halve(s); }
    merge(&s->bin[t_us / s->width_us], &one);
}

size_t evr_series_samples(const evr_bin_t *bin, evr_sample_t out[2])
{
    if (bin->n == 0u) { return 0u; }
    out[0] = (bin->low.t_us <= bin->high.t_us) ? bin->low : bin->high;
    out[1] = (bin->low.t_us <= bin->high.t_us) ? bin->high : bin->low;
    return (out[0].t_us == out[1].t_us) ? 1u : 2u;
}

void evr_counts_clear(evr_counts_t *c)
{
    memset(c, 0, sizeof *c);
    c->width_us = EVR_SERIES_WIDTH_US;
}

static void halve_counts(evr_counts_t *c)
{
    for (size_t i = 0u; i < EVR_SERIES_BINS / 2u; i++) { c->n[i] = c->n[2u * i] + c->n[2u * i + 1u]; }
    memset(&c->n[EVR_SERIES_BINS / 2u], 0, EVR_SERIES_BINS / 2u * sizeof c->n[0]);
    c->width_us *= 2;
}

void evr_counts_add(evr_counts_t *c, int64_t start_us, const int64_t *t_us, size_t n)
{
    size_t i = 0u;
    while (i < n) { /* A bin at a time, not a division for every event. */
        const int64_t t = t_us[i] - start_us;
        size_t end = i + 1u;
        if (t >= 0) {
            int64_t from_us;
            while (t / c->width_us >= (int64_t)EVR_SERIES_BINS) { halve_counts(c); }
            from_us = t_us[i] - t % c->width_us;
            while ((end < n) && (t_us[end] >= from_us) && (t_us[end] - from_us < c->width_us)) { end++; }
            c->n[t / c->width_us] += end - i;
        }
        i = end;
    }
}
