/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "replay_imaging.h"

#include <string.h>

#include "decimal.h"
#include "options.h"

/* Events of a window that a warp by search can keep: more than windows by area hold. */
#define N_WARP_EVENTS ((size_t)1u << 18)

#define BASELINE_MAX_US 2000000

static const char *const IMAGES[] = {[EVS_PIPELINE_IMAGE_NONE] = "none",
                                     [EVS_PIPELINE_IMAGE_COUNT] = "count",
                                     [EVS_PIPELINE_IMAGE_IWE] = "iwe",
                                     [EVS_PIPELINE_IMAGE_SURFACE] = "surface"};
static const char *const WARPS[] = {[EVS_PIPELINE_WARP_NONE] = "none",
                                    [EVS_PIPELINE_WARP_PREDICTED] = "predicted",
                                    [EVS_PIPELINE_WARP_GLOBAL] = "global",
                                    [EVS_PIPELINE_WARP_TILED] = "tiled"};
static const char *const METHODS[] = {
    [EVS_EGOMOTION_ROBUST] = "erlv", [EVS_EGOMOTION_PAPER] = "erlv-paper", [EVS_EGOMOTION_ERL] = "erl"};

const char *evt_image_name(evs_pipeline_image_t image) { return IMAGES[image]; }
const char *evt_warp_name(evs_pipeline_warp_t warp) { return WARPS[warp]; }
const char *evt_method_name(evs_egomotion_method_t method) { return METHODS[method]; }

/* The index of a word, from `first` on; n when it is none of them. */
static size_t find(const char *const *words, size_t first, size_t n, const char *text)
{
    size_t i = first;
    while ((i < n) && (strcmp(words[i], text) != 0)) { i++; }
    return i;
}

#define N_IMAGES  (sizeof IMAGES / sizeof IMAGES[0])
#define N_WARPS   (sizeof WARPS / sizeof WARPS[0])
#define N_METHODS (sizeof METHODS / sizeof METHODS[0])

static bool usage(bool *usage_fault, evh_error_t *err, const char *option, const char *text, const char *expected)
{
    *usage_fault = true;
    return evh_fail(err, "%s is '%s'; expected %s", option, text, expected);
}

/* "30:250" */
static bool parse_baseline(const char *text, evs_keyframes_config_t *k)
{
    const char *const end = text + strlen(text);
    int64_t low_us = 0;
    int64_t high_us = 0;
    if (!evh_decimal_parse(&text, end, 3, &low_us, NULL) || (text == end) || (*text != ':')) { return false; }
    text++;
    if (!evh_decimal_parse(&text, end, 3, &high_us, NULL) || (text != end)) { return false; }
    if ((low_us < 1000) || (high_us < low_us) || (high_us > BASELINE_MAX_US)) { return false; }
    k->baseline_min_us = (uint32_t)low_us;
    k->baseline_max_us = (uint32_t)high_us;
    if (k->baseline_first_us < k->baseline_min_us) { k->baseline_first_us = k->baseline_min_us; }
    if (k->baseline_first_us > k->baseline_max_us) { k->baseline_first_us = k->baseline_max_us; }
    if (k->age_max_us < 2u * k->baseline_max_us) { k->age_max_us = 2u * k->baseline_max_us; }
    return true;
}

bool evt_imaging_check_words(const evt_replay_options_t *o, bool *usage_fault, evh_error_t *err)
{
    evs_keyframes_config_t ignored = {0};
    bool on = false;
    if ((o->image != NULL) && (find(IMAGES, 1u, N_IMAGES, o->image) == N_IMAGES)) {
        return usage(usage_fault, err, "--image", o->image, "iwe, surface or count");
    }
    if ((o->warp != NULL) && (find(WARPS, 0u, N_WARPS, o->warp) == N_WARPS)) {
        return usage(usage_fault, err, "--warp", o->warp, "none, global, tiled or predicted");
    }
    if ((o->method != NULL) && (find(METHODS, 0u, N_METHODS, o->method) == N_METHODS)) {
        return usage(usage_fault, err, "--method", o->method, "erlv, erlv-paper or erl");
    }
    if ((o->velocity != NULL) && !evt_parse_on_off(o->velocity, &on)) {
        return usage(usage_fault, err, "--velocity", o->velocity, "on or off");
    }
    if ((o->baseline != NULL) && !parse_baseline(o->baseline, &ignored)) {
        return usage(usage_fault, err, "--baseline-ms", o->baseline,
                     "MIN:MAX in milliseconds, 1 <= MIN <= MAX <= 2000");
    }
    return true;
}

void evt_imaging_paper(evs_pipeline_config_t *p)
{
    p->warp = EVS_PIPELINE_WARP_TILED;
    p->iwe.vote = EVS_IWE_GAUSSIAN;
    p->iwe.smooth = false; /* The Gaussian is smooth. */
    p->velocity.egomotion.method = EVS_EGOMOTION_PAPER;
}

/* What the option says, else the parameter file, else what stands. Both were checked when they were read. */
static size_t choose(const char *const *words, size_t n, const char *option, const char *file, size_t otherwise)
{
    const char *const text = (option != NULL) ? option : file;
    const size_t i = find(words, 0u, n, text);
    return (i < n) ? i : otherwise;
}

/* Whether it is measured when nobody says: where an image position is a direction and the view is stabilized. */
static bool settle_on(evt_replay_t *r, const evt_replay_options_t *o, const evh_config_t *config, bool lens_known,
                      evh_error_t *err)
{
    bool on = lens_known && (r->attitude != EVT_ATTITUDE_NONE);
    bool told = false;
    if (config->has_velocity) {
        on = config->velocity;
        told = true;
    }
    if (o->velocity != NULL) {
        (void)evt_parse_on_off(o->velocity, &on);
        told = true;
    }
    r->pipeline.velocity_on = on;
    r->velocity_told = told && on;
    if (on && !lens_known) {
        return evh_fail(err, "--velocity on needs the lens; give --calib FILE (fx fy cx cy k1 k2 p1 p2 k3)");
    }
    if (on && (r->attitude == EVT_ATTITUDE_NONE) && (r->pipeline.velocity.egomotion.method != EVS_EGOMOTION_ERL)) {
        evh_note("nothing is rotated: the direction of flight holds only while the camera does not turn");
    }
    return true;
}

bool evt_imaging_settle(evt_replay_t *r, const evt_replay_options_t *o, const evh_config_t *config, bool lens_known,
                        bool *usage_fault, evh_error_t *err)
{
    evs_pipeline_config_t *const p = &r->pipeline;
    const size_t image = choose(IMAGES, N_IMAGES, o->image, config->image, EVS_PIPELINE_IMAGE_IWE);
    size_t warp = choose(WARPS, N_WARPS, o->warp, config->warp, p->warp);
    const bool wants_image = (o->image != NULL) || (config->image[0] != '\0') || r->write_frames;
    const bool wants_warp = (o->warp != NULL) || (config->warp[0] != '\0');
    p->velocity.egomotion.method = (evs_egomotion_method_t)choose(METHODS, N_METHODS, o->method, config->method,
                                                                  (size_t)p->velocity.egomotion.method);
    if (o->baseline != NULL) { (void)parse_baseline(o->baseline, &p->velocity.keyframes); }
    if (!settle_on(r, o, config, lens_known, err)) { return false; }

    /* Recorded poses leave nothing of the rotation; that nothing is rotated at all is not told by a small rate. */
    if ((r->attitude == EVT_ATTITUDE_TRUTH) || (r->attitude == EVT_ATTITUDE_NONE)) {
        p->velocity.residual_rate_rad_s_q24 = 0;
    }
    p->image = (p->velocity_on || wants_image) ? (evs_pipeline_image_t)image : EVS_PIPELINE_IMAGE_NONE;
    if (p->image == EVS_PIPELINE_IMAGE_SURFACE) {
        if (wants_warp && (warp != EVS_PIPELINE_WARP_NONE)) {
            return usage(usage_fault, err, "--warp", WARPS[warp],
                         "none with --image surface, which keeps single times");
        }
        warp = EVS_PIPELINE_WARP_NONE;
    }
    if (p->image == EVS_PIPELINE_IMAGE_NONE) { warp = EVS_PIPELINE_WARP_NONE; }
    if ((warp == EVS_PIPELINE_WARP_PREDICTED) && !p->velocity_on) {
        return usage(usage_fault, err, "--warp", "predicted", "another without --velocity on, whose flow it goes by");
    }
    p->warp = (evs_pipeline_warp_t)warp;
    if ((warp == EVS_PIPELINE_WARP_GLOBAL) || (warp == EVS_PIPELINE_WARP_TILED)) {
        p->warp_search = evs_warp_config_default((warp == EVS_PIPELINE_WARP_GLOBAL) ? EVS_WARP_GLOBAL : EVS_WARP_TILED,
                                                 r->calib.width_px, r->calib.height_px);
        p->n_warp_events = N_WARP_EVENTS;
    }
    return true;
}
