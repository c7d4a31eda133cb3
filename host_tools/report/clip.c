/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "clip.h"

#include <stdlib.h>
#include <string.h>

#define FIRST_US 625 /* 20 ms after five doublings. */
#define LAST_US  20000

bool evr_clip_open(evr_clip_t *c, uint16_t width_px, uint16_t height_px)
{
    memset(c, 0, sizeof *c);
    c->panes = evr_panes_layout(width_px, height_px);
    c->now.pictures = calloc(EVR_CLIP_PICTURES, c->panes.n_cells);
    c->now.picture_us = FIRST_US;
    c->now.start_us = INT64_MIN;
    return c->now.pictures != NULL;
}

void evr_clip_close(evr_clip_t *c)
{
    free(c->now.pictures);
    free(c->best.pictures);
    memset(c, 0, sizeof *c);
}

static uint8_t *picture(const evr_clip_t *c, const evr_take_t *take, int i)
{
    return take->pictures + (size_t)i * c->panes.n_cells;
}

static void double_pictures(evr_clip_t *c)
{
    evr_take_t *const now = &c->now;
    for (int i = 0; i < EVR_CLIP_PICTURES / 2; i++) {
        evr_panes_merge(&c->panes, picture(c, now, 2 * i), picture(c, now, 2 * i + 1));
        if (i > 0) { memcpy(picture(c, now, i), picture(c, now, 2 * i), c->panes.n_cells); }
    }
    memset(picture(c, now, EVR_CLIP_PICTURES / 2), 0, EVR_CLIP_PICTURES / 2 * c->panes.n_cells);
    now->picture_us *= 2;
    now->n = (now->n + 1) / 2;
}

/* The clip is full, or the recording is over. A short rest at the end is no rival of a full clip. */
static void end_take(evr_clip_t *c, const evr_shake_t *shake)
{
    evr_take_t *const now = &c->now;
    const int64_t end_us = now->start_us + now->n * now->picture_us;
    evr_take_t old = c->best;
    now->rate_rad_s = evr_shake_between(shake, now->start_us, end_us).rate_rad_s;
    if (!c->has_best || ((now->n >= EVR_CLIP_PICTURES * 3 / 4) && (now->rate_rad_s > c->best.rate_rad_s))) {
        c->best = *now;
        c->has_best = true;
        now->pictures = old.pictures; /* The old best's memory is free for the next clip. */
    }
    if (now->pictures != NULL) { memset(now->pictures, 0, EVR_CLIP_PICTURES * c->panes.n_cells); }
    now->n = 0;
    now->start_us = INT64_MIN;
}

/* The picture that an event at this time belongs to, NULL when memory is short. */
static uint8_t *picture_at(evr_clip_t *c, const evr_shake_t *shake, int64_t t_us)
{
    evr_take_t *const now = &c->now;
    const int64_t length_us = (int64_t)EVR_CLIP_PICTURES * LAST_US;
    if ((now->start_us != INT64_MIN) && ((t_us < now->start_us) || (t_us - now->start_us >= length_us))) {
        end_take(c, shake);
    }
    if (now->pictures == NULL) { now->pictures = calloc(EVR_CLIP_PICTURES, c->panes.n_cells); }
    if (now->pictures == NULL) { return NULL; }
    if (now->start_us == INT64_MIN) { now->start_us = t_us; }
    while (t_us - now->start_us >= EVR_CLIP_PICTURES * now->picture_us) { double_pictures(c); }
    if ((t_us - now->start_us) / now->picture_us >= now->n) {
        now->n = (int)((t_us - now->start_us) / now->picture_us) + 1;
    }
    return picture(c, now, (int)((t_us - now->start_us) / now->picture_us));
}

void evr_clip_add(evr_clip_t *c, const evr_shake_t *shake, const int64_t *t_us, const evs_event_t *ev,
                  const evs_point_t *undistorted, const evs_point_t *stabilized, size_t n)
{
    size_t i = 0u;
    while (i < n) {
        uint8_t *const to = picture_at(c, shake, t_us[i]);
        const int64_t start_us = t_us[i] - (t_us[i] - c->now.start_us) % c->now.picture_us;
        size_t end = i + 1u;
        while ((end < n) && (t_us[end] >= start_us) && (t_us[end] < start_us + c->now.picture_us)) { end++; }
        if (to != NULL) { evr_panes_add(&c->panes, to, ev + i, undistorted + i, stabilized + i, end - i); }
        i = end;
    }
}

const evr_take_t *evr_clip_finish(evr_clip_t *c, const evr_shake_t *shake)
{
    if (c->now.start_us != INT64_MIN) { end_take(c, shake); }
    return c->has_best ? &c->best : NULL;
}
