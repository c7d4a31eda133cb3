/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/surface.h"

#include "evs_tables.h"

#include <string.h>

/*
 * A stamp holds 15 bits of a time in ticks. Its age, modulo 2^15 ticks (2.1 s), is right as long as it is less. A sweep
 * visits every row once in SWEEP_TICKS and moves stamps older than OLD_TICKS up to that age; between two visits a stamp
 * ages by at most SWEEP_TICKS and one gap of at most GAP_TICKS. A longer gap is a visit of all rows.
 */
#define TICK_BITS   6
#define TICK_MASK   UINT32_C(0x7FFF)
#define OLD_TICKS   UINT32_C(24576) /* 1.57 s */
#define SWEEP_TICKS UINT32_C(4096)  /* 0.26 s */
#define GAP_TICKS   UINT32_C(2048)

EVS_STATIC_ASSERT((1u << TICK_BITS) == EVS_SURFACE_TICK_US, "a tick is a power of two");
EVS_STATIC_ASSERT(OLD_TICKS + SWEEP_TICKS + GAP_TICKS <= TICK_MASK, "an age comes round between two visits");
/* 255 exp(-old / tau) < 1/2, that is old > 6.24 tau. */
EVS_STATIC_ASSERT(OLD_TICKS *EVS_SURFACE_TICK_US * 100u > EVS_SURFACE_TAU_MAX_US * 624u, "an old pixel is not dark");

/* x = age / tau / ln 2 in Q28: 64 / (tau ln 2) 2^28 = this / tau. From x = 9 on, 255 * 2^-x rounds to 0. */
#define X_BITS     28
#define RATE_TO_X  UINT64_C(24785312075) /* 64 / ln(2) * 2^28 */
#define X_IS_BLACK 9u

evs_surface_config_t evs_surface_config_default(uint16_t width_px, uint16_t height_px)
{
    const evs_surface_config_t cfg = {.width_px = width_px,
                                      .height_px = height_px,
                                      .polarity = EVS_SURFACE_MERGED,
                                      .alpha_q15 = 9830u,
                                      .tau_min_us = 1000u,
                                      .tau_max_us = EVS_SURFACE_TAU_MAX_US,
                                      .tau_start_us = 20000u};
    return cfg;
}

static bool side_ok(uint16_t side_px) { return (side_px >= 1u) && (side_px <= EVS_SENSOR_MAX_PX); }

static bool config_ok(const evs_surface_config_t *cfg)
{
    return side_ok(cfg->width_px) && side_ok(cfg->height_px) &&
           ((cfg->polarity == EVS_SURFACE_MERGED) || (cfg->polarity == EVS_SURFACE_SIGNED)) &&
           (cfg->alpha_q15 <= 32768u) && (cfg->tau_min_us >= EVS_SURFACE_TAU_MIN_US) &&
           (cfg->tau_min_us <= cfg->tau_start_us) && (cfg->tau_start_us <= cfg->tau_max_us) &&
           (cfg->tau_max_us <= EVS_SURFACE_TAU_MAX_US);
}

evs_status_t evs_surface_init(evs_surface_t *surface, const evs_surface_config_t *cfg, void *memory, size_t n_bytes)
{
    if ((surface == NULL) || (cfg == NULL) || (memory == NULL)) { return EVS_ERR_NULL; }
    if (!config_ok(cfg)) { return EVS_ERR_ARG; }
    const size_t needed = EVS_SURFACE_BYTES(cfg->width_px, cfg->height_px);
    if ((n_bytes < needed) || (((uintptr_t)memory & 1u) != 0u)) { return EVS_ERR_SIZE; }

    *surface = (evs_surface_t){.cfg = *cfg, .stamps = memory, .tau_us = cfg->tau_start_us};
    return EVS_OK;
}

void evs_surface_clear(evs_surface_t *surface)
{
    EVS_ASSERT(surface != NULL);
    surface->started = false;
}

/* The stamp of a darker event in the tick that is n_ticks after the newest. */
static uint16_t stamp(const evs_surface_t *s, uint32_t n_ticks)
{
    return (uint16_t)(((s->tick_us >> TICK_BITS) + n_ticks) << 1);
}

/* Move the stamps up that are older than OLD_TICKS, seen n_ticks after the newest tick. */
static void visit_rows(const evs_surface_t *s, uint32_t from, uint32_t to, uint32_t n_ticks)
{
    /* Odd, so that the difference is twice the age, or 1 more, for any polarity. At the limit it is too old. */
    const uint16_t newest = (uint16_t)(stamp(s, 0u) | 1u);
    const uint16_t limit = (uint16_t)((n_ticks < OLD_TICKS) ? 2u * (OLD_TICKS - n_ticks) + 2u : 0u);
    const uint16_t old = stamp(s, n_ticks - OLD_TICKS);
    uint16_t *const end = s->stamps + (size_t)to * s->cfg.width_px;
    for (uint16_t *at = s->stamps + (size_t)from * s->cfg.width_px; at < end; at++) {
        const uint16_t twice_age = (uint16_t)(newest - *at);
        *at = (twice_age >= limit) ? old : *at;
    }
}

/* The rows up to which a sweep is due. */
static uint32_t rows_due(const evs_surface_t *s)
{
    const uint32_t ticks = (s->sweep_ticks < SWEEP_TICKS) ? s->sweep_ticks : SWEEP_TICKS;
    return ticks * s->cfg.height_px / SWEEP_TICKS;
}

static void sweep(evs_surface_t *s)
{
    const uint32_t due = rows_due(s);
    if (due > s->n_swept_rows) {
        visit_rows(s, s->n_swept_rows, due, 0u);
        s->n_swept_rows = due;
    }
}

static void advance(evs_surface_t *s, uint32_t n_ticks)
{
    if (n_ticks > GAP_TICKS) {
        visit_rows(s, 0u, s->cfg.height_px, n_ticks);
        s->tick_us += n_ticks << TICK_BITS;
        s->sweep_ticks = 0u;
        s->n_swept_rows = 0u;
        return;
    }
    s->tick_us += n_ticks << TICK_BITS;
    s->sweep_ticks += n_ticks;
    sweep(s);
    if (s->sweep_ticks >= SWEEP_TICKS) {
        s->sweep_ticks -= SWEEP_TICKS;
        s->n_swept_rows = 0u;
        sweep(s);
    }
}

static void start(evs_surface_t *s, uint32_t t_us)
{
    s->tick_us = t_us & ~(EVS_SURFACE_TICK_US - 1u);
    s->sweep_ticks = 0u;
    s->n_swept_rows = 0u;
    s->started = true;
    const uint16_t old = stamp(s, 0u - OLD_TICKS);
    const size_t n_px = EVS_IMAGE_BYTES(s->cfg.width_px, s->cfg.height_px);
    for (size_t i = 0u; i < n_px; i++) { s->stamps[i] = old; }
}

/* An event that is not in the newest tick; false when it is in an earlier one. */
static bool enter_tick(evs_surface_t *s, uint32_t since_us)
{
    if (since_us > (uint32_t)INT32_MAX) {
        evs_count(&s->n_time_back);
        return false;
    }
    advance(s, since_us >> TICK_BITS);
    return true;
}

void evs_surface_add(evs_surface_t *surface, const evs_event_t *ev, const evs_point_t *points, size_t n)
{
    EVS_ASSERT((surface != NULL) && (((ev != NULL) && (points != NULL)) || (n == 0u)));
    if (n == 0u) { return; }
    if (!surface->started) { start(surface, ev[0].t_us); }
    const uint32_t width = surface->cfg.width_px;
    const uint32_t height = surface->cfg.height_px;
    uint16_t *const stamps = surface->stamps;
    const evs_event_t *const end = ev + n;
    uint32_t tick_us = surface->tick_us;
    uint32_t now = stamp(surface, 0u);
    size_t n_off = 0u;
    for (; ev != end; ev++, points++) {
        const uint32_t since_us = ev->t_us - tick_us;
        if (since_us >= EVS_SURFACE_TICK_US) {
            if (!enter_tick(surface, since_us)) { continue; }
            tick_us = surface->tick_us;
            now = stamp(surface, 0u);
        }
        /* The nearest pixel, as evs/tiles.h rounds; negative ones are beyond any width. */
        const uint32_t x = (uint32_t)((points->x_q4 + 8) >> 4);
        const uint32_t y = (uint32_t)((points->y_q4 + 8) >> 4);
        if ((x < width) && (y < height)) {
            stamps[y * width + x] = (uint16_t)(now | ((uint32_t)ev->y_px >> 15));
        } else {
            n_off++;
        }
    }
    evs_count_add(&surface->n_outside, n_off);
}

void evs_surface_end_window(evs_surface_t *surface, uint32_t duration_us)
{
    EVS_ASSERT(surface != NULL);
    const evs_surface_config_t *const cfg = &surface->cfg;
    const uint64_t sum_q15 =
        (uint64_t)(32768u - cfg->alpha_q15) * duration_us + (uint64_t)cfg->alpha_q15 * surface->tau_us;
    const uint64_t tau_us = (sum_q15 + 16384u) >> 15;
    surface->tau_us = (tau_us < cfg->tau_min_us)   ? cfg->tau_min_us
                      : (tau_us > cfg->tau_max_us) ? cfg->tau_max_us
                                                   : (uint32_t)tau_us;
}

/* full * 2^-x, rounded; x in Q28, below X_IS_BLACK. */
static inline uint32_t decay(uint32_t x_q28, uint32_t full)
{
    const unsigned halvings = x_q28 >> X_BITS;
    const uint32_t value_q16 = evs_decay_q16[(x_q28 >> (X_BITS - 8)) & 0xFFu] * full;
    return (value_q16 + (UINT32_C(0x8000) << halvings)) >> (16u + halvings);
}

void evs_surface_render(const evs_surface_t *surface, uint32_t t_us, uint8_t *px)
{
    EVS_ASSERT((surface != NULL) && (px != NULL));
    const bool with_sign = surface->cfg.polarity == EVS_SURFACE_SIGNED;
    const uint32_t black = with_sign ? 128u : 0u;
    const size_t n_px = EVS_IMAGE_BYTES(surface->cfg.width_px, surface->cfg.height_px);
    /* Ages from here on are black; the product with the rate stays below 2^32. */
    const uint32_t rate_q28 = (uint32_t)(RATE_TO_X / surface->tau_us);
    const uint32_t young = (uint32_t)((((uint64_t)X_IS_BLACK << X_BITS) - 1u) / rate_q28) + 1u;
    const uint32_t late_us = t_us - surface->tick_us;
    const uint32_t late = (late_us > (uint32_t)INT32_MAX) ? 0u : late_us >> TICK_BITS;
    const uint32_t newest = stamp(surface, 0u) | 1u;
    const uint32_t limit = (surface->started && (late < young)) ? young - late : 0u;
    if (limit == 0u) { /* nor are there stamps before the first event */
        memset(px, (int)black, n_px);
        return;
    }
    for (size_t i = 0u; i < n_px; i++) {
        const uint32_t age = ((newest - surface->stamps[i]) & 0xFFFFu) >> 1;
        if (age >= limit) {
            px[i] = (uint8_t)black;
        } else if (with_sign) {
            const uint32_t level = decay((age + late) * rate_q28, 127u);
            px[i] = (uint8_t)(((surface->stamps[i] & 1u) != 0u) ? 128u + level : 128u - level);
        } else {
            px[i] = (uint8_t)decay((age + late) * rate_q28, 255u);
        }
    }
}
