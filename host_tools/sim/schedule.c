/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "schedule.h"

#include <math.h>
#include <string.h>

#define MOTION_MAX_PX    0.5
#define STEP_MAX_NS      INT64_C(2000000)
#define STEP_MIN_NS      INT64_C(1000)
#define CLEARANCE_MIN_M  0.05
#define SHORTEN_ATTEMPTS 4

void evsim_schedule_init(evsim_schedule_t *schedule, const evsim_settings_t *settings, const evsim_motion_t *motion,
                         const evsim_scene_t *scene, const evsim_camera_t *camera)
{
    memset(schedule, 0, sizeof *schedule);
    schedule->motion = motion;
    schedule->scene = scene;
    schedule->camera = camera;
    schedule->fps_hz = settings->fps_hz;
    schedule->exposure_ns = settings->exposure_us * 1000;
    schedule->end_ns = settings->duration_us * 1000;
}

int64_t evsim_exposure_start_ns(double fps_hz, uint64_t frame) { return (int64_t)((double)frame / fps_hz * 1e9 + 0.5); }

/* The fastest motion in the image, pixels per second, and the nearest depth. */
static double image_speed(const evsim_camera_t *camera, const evsim_view_t *view, const evsim_state_t *state,
                          double *inverse_depth_max)
{
    const double *const v = state->v_c_m_s.v;
    const double *const w = state->w_c_rad_s.v;
    double fastest2 = 0.0;
    *inverse_depth_max = 0.0;
    for (unsigned i = 0u; i < camera->n_probes; i++) {
        const evsim_probe_t *const p = &camera->probe[i];
        const double near = evsim_view_inverse_depth(view, p->x, p->y);
        const double away = near * v[2] + w[0] * p->y - w[1] * p->x; /* Relative change of depth. */
        const double dx = p->x * away - near * v[0] - w[1] + w[2] * p->y;
        const double dy = p->y * away - near * v[1] + w[0] - w[2] * p->x;
        const double px = p->px_per_x[0] * dx + p->px_per_y[0] * dy;
        const double py = p->px_per_x[1] * dx + p->px_per_y[1] * dy;
        fastest2 = fmax(fastest2, px * px + py * py);
        *inverse_depth_max = fmax(*inverse_depth_max, near);
    }
    return sqrt(fastest2);
}

static double look(const evsim_schedule_t *schedule, int64_t t_ns, evsim_view_t *view, double *inverse_depth_max)
{
    evsim_state_t state;
    evsim_motion_at(schedule->motion, (double)t_ns * 1e-9, &state);
    evsim_view_init(view, schedule->scene, &state);
    return image_speed(schedule->camera, view, &state, inverse_depth_max);
}

static bool clear(double inverse_depth, int64_t t_ns, evh_error_t *err)
{
    if (inverse_depth * CLEARANCE_MIN_M < 1.0) { return true; }
    return evh_fail(err, "the camera runs into a surface after %.2f s; use a shorter --duration or another --motion",
                    (double)t_ns * 1e-9);
}

bool evsim_schedule_start(evsim_schedule_t *schedule, evsim_view_t *view, evh_error_t *err)
{
    double inverse_depth;
    schedule->speed_px_s = look(schedule, 0, view, &inverse_depth);
    return clear(inverse_depth, 0, err);
}

static int64_t step_ns(double speed_px_s)
{
    const double step = MOTION_MAX_PX / speed_px_s * 1e9; /* Infinite at rest. */
    if (!(step < (double)STEP_MAX_NS)) { return STEP_MAX_NS; }
    return (step > (double)STEP_MIN_NS) ? (int64_t)step : STEP_MIN_NS;
}

bool evsim_schedule_next(evsim_schedule_t *s, evsim_batch_t *batch, evh_error_t *err)
{
    const int64_t batch_end_ns = s->t_ns + EVSIM_BATCH_SPAN_NS;
    batch->n = 0u;
    batch->ends_frame = false;
    while ((batch->n < EVSIM_BATCH_RENDERS) && (s->t_ns < s->end_ns) && (s->t_ns < batch_end_ns) &&
           !batch->ends_frame) {
        evsim_render_t *const r = &batch->render[batch->n];
        const int64_t open_ns = evsim_exposure_start_ns(s->fps_hz, s->frame);
        const int64_t close_ns = open_ns + s->exposure_ns;
        const bool exposing = s->t_ns >= open_ns;
        int64_t stop_ns = exposing ? close_ns : open_ns;
        double inverse_depth = 0.0;
        double speed = s->speed_px_s;
        int64_t step;
        if (stop_ns > s->end_ns) { stop_ns = s->end_ns; }
        step = step_ns(speed);
        for (int attempt = 0;; attempt++) { /* Speed may grow within the step. */
            int64_t shorter;
            if (step > stop_ns - s->t_ns) { step = stop_ns - s->t_ns; }
            speed = look(s, s->t_ns + step, &r->view, &inverse_depth);
            shorter = step_ns(speed);
            if ((step <= shorter + shorter / 8) || (attempt == SHORTEN_ATTEMPTS)) { break; }
            step = shorter;
        }
        if (!clear(inverse_depth, s->t_ns + step, err)) { return false; }
        r->t0_ns = s->t_ns;
        r->t1_ns = s->t_ns + step;
        r->exposure = exposing ? (float)((double)step / (double)s->exposure_ns) : 0.0f;
        s->t_ns = r->t1_ns;
        s->speed_px_s = speed;
        s->speed_max_px_s = fmax(s->speed_max_px_s, speed);
        if (exposing && (s->t_ns == close_ns)) {
            batch->ends_frame = true;
            batch->frame = s->frame++;
        }
        batch->n++;
    }
    s->n_renders += batch->n;
    return true;
}
