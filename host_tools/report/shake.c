/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "shake.h"

#include <math.h>
#include <string.h>

void evr_shake_clear(evr_shake_t *s)
{
    memset(s, 0, sizeof *s);
    for (int i = 0; i < EVR_SHAKE_MS; i++) { s->cell[i].ms = INT64_MIN; }
}

static int64_t ms_of(int64_t t_us) { return (t_us >= 0) ? t_us / 1000 : -((999 - t_us) / 1000); }

static int place_of(int64_t ms) { return (int)(((ms % EVR_SHAKE_MS) + EVR_SHAKE_MS) % EVR_SHAKE_MS); }

void evr_shake_put(evr_shake_t *s, int64_t t_us, double rate_rad_s, double motion_px_s)
{
    const int64_t ms = ms_of(t_us);
    evr_shake_cell_t *const c = &s->cell[place_of(ms)];
    if (c->ms != ms) { *c = (evr_shake_cell_t){ms, 0.0, 0.0, 0.0, 0.0, 0u}; }
    c->rate_sum += rate_rad_s;
    c->motion_sum += motion_px_s;
    c->rate_max = fmax(c->rate_max, rate_rad_s);
    c->motion_max = fmax(c->motion_max, motion_px_s);
    c->n++;
}

evr_shake_mean_t evr_shake_between(const evr_shake_t *s, int64_t from_us, int64_t to_us)
{
    evr_shake_mean_t m = {0.0, 0.0, 0.0, 0.0, 0u};
    const int64_t last = ms_of(to_us);
    int64_t ms = ms_of(from_us);
    if (last - ms >= EVR_SHAKE_MS) { ms = last - EVR_SHAKE_MS + 1; }
    for (; ms <= last; ms++) {
        const evr_shake_cell_t *const c = &s->cell[place_of(ms)];
        if (c->ms != ms) { continue; }
        m.rate_rad_s += c->rate_sum;
        m.motion_px_s += c->motion_sum;
        m.rate_max_rad_s = fmax(m.rate_max_rad_s, c->rate_max);
        m.motion_max_px_s = fmax(m.motion_max_px_s, c->motion_max);
        m.n += c->n;
    }
    if (m.n > 0u) {
        m.rate_rad_s /= m.n;
        m.motion_px_s /= m.n;
    }
    return m;
}
