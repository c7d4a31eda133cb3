/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "direction.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "rotation.h"

bool evr_flight_open(evr_flight_t *f, uint16_t width_px, uint16_t height_px)
{
    memset(f, 0, sizeof *f);
    for (int i = 0; i < 3; i++) {
        evr_series_clear(&f->component[i]);
        evr_series_clear(&f->truth[i]);
    }
    f->px = malloc((size_t)width_px * height_px);
    f->arrows = malloc(EVR_ARROWS_MAX * sizeof *f->arrows);
    return (f->px != NULL) && (f->arrows != NULL);
}

void evr_flight_close(evr_flight_t *f)
{
    free(f->px);
    free(f->arrows);
}

void evr_angles_add(evr_angles_t *a, double deg)
{
    const double step = deg / EVR_ANGLE_STEP_DEG;
    const size_t last = EVR_ANGLE_STEPS - 1u;
    if (!(step >= 0.0)) { return; }
    a->n[(step < (double)last) ? (size_t)step : last]++;
    a->total++;
}

double evr_angles_median(const evr_angles_t *a)
{
    uint64_t below = 0u;
    size_t i = 0u;
    if (a->total == 0u) { return (double)NAN; }
    while (2u * (below + a->n[i]) < a->total) { below += a->n[i++]; }
    return ((double)i + 0.5) * EVR_ANGLE_STEP_DEG;
}

void evr_flight_add(evr_flight_t *f, const evr_direction_t *d, int64_t start_us)
{
    const int64_t t_us = d->t_us - start_us;
    const evl_vec3_t v = {d->v[0], d->v[1], d->v[2]};
    const evl_vec3_t truth = {d->truth[0], d->truth[1], d->truth[2]};
    const double length = evl_norm(truth);
    for (int i = 0; i < 3; i++) {
        /* An angle has two components: along each, sigma / sqrt 2, of which an axis sees what lies across it. */
        const double across = 1.0 - d->v[i] * d->v[i];
        const double spread = d->sigma_rad * sqrt(0.5 * ((across > 0.0) ? across : 0.0));
        evr_series_put_spread(&f->component[i], t_us, d->v[i], spread);
        if (length > 0.0) { evr_series_put(&f->truth[i], t_us, d->truth[i] / length); }
    }
    evr_angles_add(&f->sigma_deg, d->sigma_rad * EVL_DEG_PER_RAD);
    if (length > 0.0) { evr_angles_add(&f->error_deg, EVL_DEG_PER_RAD * evl_angle_between(v, truth)); }
}

void evr_flight_add_flow(evr_flight_t *f, const evr_flow_t *flow, size_t n_pixels)
{
    if (f->has_best && (flow->sigma_rad >= f->best.sigma_rad)) { return; }
    f->best = *flow;
    f->best.n = (flow->n < EVR_ARROWS_MAX) ? flow->n : EVR_ARROWS_MAX;
    memcpy(f->px, flow->px, n_pixels);
    memcpy(f->arrows, flow->arrows, f->best.n * sizeof *f->arrows);
    f->best.px = f->px;
    f->best.arrows = f->arrows;
    f->has_best = true;
}
