/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "sim.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "meta.h"
#include "output.h"
#include "schedule.h"

/* Everything of a run. Large: on the heap. */
typedef struct {
    const evsim_settings_t *settings;
    evsim_pool_t *pool;
    evsim_motion_t motion;
    evsim_camera_t camera;
    evsim_scene_t scene;
    evsim_schedule_t schedule;
    evsim_pixels_t pixels;
    evsim_view_t start;
    evsim_batch_t batch;
    evsim_output_t output;
    evsim_event_list_t *list; /* One a band: the same whoever fills it. */
    float *scratch;           /* One band a thread. */
    float *exposure;          /* The frame being exposed. */
    uint8_t *frame;
    evsim_event_t *sorted;
    size_t n_sorted_max;
    uint32_t *count;
} run_t;

static unsigned band_rows(const evsim_camera_t *camera, unsigned band)
{
    const unsigned left = camera->height_px - band * EVSIM_TILE_H;
    return (left < EVSIM_TILE_H) ? left : EVSIM_TILE_H;
}

static float *scratch_of(const run_t *run, unsigned thread)
{
    return run->scratch + (size_t)thread * EVSIM_TILE_H * run->camera.width_px;
}

static void start_band(void *context, unsigned band, unsigned thread)
{
    run_t *const run = context;
    float *const intensity = scratch_of(run, thread);
    evsim_render_band(&run->start, &run->camera, band, intensity);
    evsim_pixels_start(&run->pixels, band * EVSIM_TILE_H, band_rows(&run->camera, band), intensity);
}

/* The mean of the intensity over the exposure: trapezoids between renders. */
static void expose(run_t *run, unsigned band, const float *intensity, float share)
{
    const size_t first = (size_t)band * EVSIM_TILE_H * run->camera.width_px;
    const size_t n = (size_t)band_rows(&run->camera, band) * run->camera.width_px;
    for (size_t k = 0u; k < n; k++) {
        run->exposure[first + k] += 0.5f * share * (run->pixels.before[first + k] + intensity[k]);
    }
}

static void run_band(void *context, unsigned band, unsigned thread)
{
    run_t *const run = context;
    float *const intensity = scratch_of(run, thread);
    const unsigned rows = band_rows(&run->camera, band);
    const int64_t base_us = (run->batch.render[0].t0_ns + 500) / 1000;
    run->list[band].n = 0u;
    for (unsigned k = 0u; k < run->batch.n; k++) {
        const evsim_render_t *const r = &run->batch.render[k];
        const evsim_interval_t interval = {r->t0_ns, r->t1_ns, base_us};
        evsim_render_band(&r->view, &run->camera, band, intensity);
        if (run->settings->frames && (r->exposure > 0.0f)) { expose(run, band, intensity, r->exposure); }
        evsim_pixels_step(&run->pixels, band * EVSIM_TILE_H, rows, intensity, &interval, &run->list[band]);
    }
}

static bool write_events(run_t *run, evh_error_t *err)
{
    const int64_t base_us = (run->batch.render[0].t0_ns + 500) / 1000;
    const int64_t last_us = (run->batch.render[run->batch.n - 1u].t1_ns + 500) / 1000;
    size_t n = 0u;
    for (unsigned band = 0u; band < run->camera.n_bands; band++) {
        n += run->list[band].n;
        if (run->list[band].out_of_memory) { return evh_fail(err, "out of memory for events"); }
    }
    if (n > run->n_sorted_max) {
        free(run->sorted);
        run->n_sorted_max = n + n / 2u;
        run->sorted = malloc(run->n_sorted_max * sizeof *run->sorted);
        if (run->sorted == NULL) { return evh_fail(err, "out of memory for events"); }
    }
    if (n == 0u) { return true; }
    evsim_events_merge(run->list, run->camera.n_bands, (uint32_t)(last_us - base_us), run->count, run->sorted);
    evsim_output_events(&run->output, run->sorted, n, base_us);
    return true;
}

static bool write_frame(run_t *run, evh_error_t *err)
{
    const size_t n = (size_t)run->camera.width_px * run->camera.height_px;
    const int64_t t_ns =
        evsim_exposure_start_ns(run->settings->fps_hz, run->batch.frame) + run->settings->exposure_us * 500;
    for (size_t i = 0u; i < n; i++) {
        run->frame[i] = (uint8_t)(fminf(fmaxf(run->exposure[i], 0.0f), 1.0f) * 255.0f + 0.5f);
        run->exposure[i] = 0.0f;
    }
    return evsim_output_frame(&run->output, t_ns, run->frame, run->camera.width_px, run->camera.height_px, err);
}

static bool allocate(run_t *run, evh_error_t *err)
{
    const size_t n = (size_t)run->camera.width_px * run->camera.height_px;
    run->list = calloc(run->camera.n_bands, sizeof *run->list);
    run->scratch =
        malloc((size_t)evsim_pool_threads(run->pool) * EVSIM_TILE_H * run->camera.width_px * sizeof *run->scratch);
    run->exposure = calloc(n, sizeof *run->exposure);
    run->frame = malloc(n);
    run->count = malloc(((size_t)((EVSIM_BATCH_SPAN_NS + INT64_C(10000000)) / 1000) + 2u) * sizeof *run->count);
    return ((run->list != NULL) && (run->scratch != NULL) && (run->exposure != NULL) && (run->frame != NULL) &&
            (run->count != NULL)) ||
           evh_fail(err, "out of memory for a sensor of %ux%u pixels", run->camera.width_px, run->camera.height_px);
}

static bool simulate(run_t *run, evsim_progress_t progress, void *context, evh_error_t *err)
{
    evsim_schedule_init(&run->schedule, run->settings, &run->motion, &run->scene, &run->camera);
    if (!evsim_schedule_start(&run->schedule, &run->start, err)) { return false; }
    evsim_pool_run(run->pool, start_band, run, run->camera.n_bands);
    for (;;) {
        if (!evsim_schedule_next(&run->schedule, &run->batch, err)) { return false; }
        if (run->batch.n == 0u) { return true; }
        evsim_pool_run(run->pool, run_band, run, run->camera.n_bands);
        if (!write_events(run, err)) { return false; }
        if (run->batch.ends_frame && run->settings->frames && !write_frame(run, err)) { return false; }
        if (run->output.events.failure != 0) { return false; } /* Reported when it is closed. */
        if (progress != NULL) {
            progress(context, (double)run->schedule.t_ns / (double)run->schedule.end_ns, run->output.n_events);
        }
    }
}

static void measure_motion(const run_t *run, evsim_result_t *result)
{
    const double duration_s = (double)run->settings->duration_us * 1e-6;
    const unsigned n = 1000u;
    for (unsigned i = 0u; i < n; i++) {
        evsim_state_t s;
        double rate;
        evsim_motion_at(&run->motion, duration_s * ((double)i + 0.5) / n, &s);
        rate = evsim_norm(s.w_c_rad_s);
        result->rate_mean_rad_s += rate / n;
        result->rate_max_rad_s = fmax(result->rate_max_rad_s, rate);
        result->velocity_mean_m_s += evsim_norm(s.v_c_m_s) / n;
    }
}

static void release(run_t *run)
{
    for (unsigned band = 0u; (run->list != NULL) && (band < run->camera.n_bands); band++) {
        free(run->list[band].event);
    }
    free(run->list);
    free(run->scratch);
    free(run->exposure);
    free(run->frame);
    free(run->sorted);
    free(run->count);
    evsim_pixels_free(&run->pixels);
    evsim_scene_free(&run->scene);
    evsim_camera_free(&run->camera);
    evsim_pool_stop(run->pool);
    free(run);
}

bool evsim_run(const evsim_settings_t *settings, const char *dir, evsim_progress_t progress, void *context,
               evsim_result_t *result, evh_error_t *err)
{
    run_t *const run = calloc(1u, sizeof *run);
    bool ok;
    memset(result, 0, sizeof *result);
    if (run == NULL) { return evh_fail(err, "out of memory"); }
    run->settings = settings;
    run->pool = evsim_pool_start(settings->jobs);
    ok = (run->pool != NULL) || evh_fail(err, "out of memory");
    ok = ok && evsim_camera_init(&run->camera, &settings->calib, err);
    if (ok) {
        evsim_motion_init(&run->motion, settings);
        ok = evsim_output_open(&run->output, dir, settings, err);
        ok = ok && evsim_output_truth(dir, settings, &run->motion, err) && allocate(run, err) &&
             evsim_scene_init(&run->scene, settings, run->pool, err) &&
             evsim_pixels_init(&run->pixels, settings, err) && simulate(run, progress, context, err);
        ok = evsim_output_close(&run->output, err) && ok;
    }
    if (ok) {
        result->n_events = run->output.n_events;
        result->n_on = run->output.n_on;
        result->n_frames = run->output.n_frames;
        result->n_renders = run->schedule.n_renders;
        result->speed_max_px_s = run->schedule.speed_max_px_s;
        result->jobs = evsim_pool_threads(run->pool);
        measure_motion(run, result);
        ok = evsim_meta_write(dir, settings, result, err);
    }
    release(run);
    return ok;
}
