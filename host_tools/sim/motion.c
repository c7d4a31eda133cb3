/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "motion.h"

#include <string.h>

#include "rng.h"

#define DEG          (EVSIM_PI / 180.0)
#define EYE_HEIGHT_M 1.4

static void add_term(evsim_channel_t *channel, double amplitude, double hz, double phase_rad)
{
    channel->term[channel->n_terms++] = (evsim_term_t){amplitude, 2.0 * EVSIM_PI * hz, phase_rad};
}

/* Three sinusoids spread over the band whose amplitudes add up to the given one: a bound that holds for ever. */
static void add_band(evsim_channel_t *channel, evsim_draw_t *draw, double amplitude, double low_hz, double high_hz)
{
    double weight[3];
    double sum = 0.0;
    for (unsigned i = 0u; i < 3u; i++) {
        weight[i] = evsim_draw(draw, 0.5, 1.0);
        sum += weight[i];
    }
    for (unsigned i = 0u; i < 3u; i++) {
        const double hz = low_hz + (high_hz - low_hz) * ((double)i + evsim_draw(draw, 0.0, 1.0)) / 3.0;
        add_term(channel, amplitude * weight[i] / sum, hz, evsim_draw(draw, 0.0, 2.0 * EVSIM_PI));
    }
}

static void add_bands(evsim_motion_t *m, evsim_draw_t *draw, unsigned first, const double amplitude[3], double low_hz,
                      double high_hz)
{
    for (unsigned i = 0u; i < 3u; i++) { add_band(&m->channel[first + i], draw, amplitude[i], low_hz, high_hz); }
}

static void init_handheld(evsim_motion_t *m, evsim_draw_t *draw)
{
    add_bands(m, draw, EVSIM_X, (const double[3]){0.45, 0.35, 0.3}, 0.3, 0.6);
    add_bands(m, draw, EVSIM_ROLL, (const double[3]){14.0 * DEG, 16.0 * DEG, 16.0 * DEG}, 0.4, 0.9);
}

static void init_sweep(evsim_motion_t *m, evsim_draw_t *draw)
{
    add_bands(m, draw, EVSIM_X, (const double[3]){0.4, 0.35, 0.3}, 0.5, 1.1);
    add_bands(m, draw, EVSIM_ROLL, (const double[3]){16.0 * DEG, 20.0 * DEG, 24.0 * DEG}, 1.2, 2.6);
}

static void init_rotate(evsim_motion_t *m, evsim_draw_t *draw)
{
    add_bands(m, draw, EVSIM_ROLL, (const double[3]){15.0 * DEG, 25.0 * DEG, 40.0 * DEG}, 0.3, 1.2);
}

/* The vibration is what a 90 to 130 Hz rotor leaves behind soft mounts: 0.1 degrees, 20 um (about 1 g). */
static void init_hover(evsim_motion_t *m, evsim_draw_t *draw)
{
    add_bands(m, draw, EVSIM_X, (const double[3]){0.35, 0.35, 0.2}, 0.1, 0.45);
    add_bands(m, draw, EVSIM_ROLL, (const double[3]){5.0 * DEG, 5.0 * DEG, 4.0 * DEG}, 0.4, 1.3);
    add_bands(m, draw, EVSIM_X, (const double[3]){20e-6, 20e-6, 30e-6}, 90.0, 130.0);
    add_bands(m, draw, EVSIM_ROLL, (const double[3]){0.1 * DEG, 0.1 * DEG, 0.05 * DEG}, 90.0, 130.0);
}

/* In a room the flight is a circle, so that it can go on for ever; before a poster it goes to and fro. */
static void init_flap(evsim_motion_t *m, evsim_draw_t *draw, bool circle)
{
    const double beat_hz = 5.0;
    const double phase = evsim_draw(draw, 0.0, 2.0 * EVSIM_PI);
    add_term(&m->channel[EVSIM_PITCH], 6.0 * DEG, beat_hz, phase);
    add_term(&m->channel[EVSIM_PITCH], 0.7 * DEG, 2.0 * beat_hz, evsim_draw(draw, 0.0, 2.0 * EVSIM_PI));
    add_term(&m->channel[EVSIM_Z], 0.010, beat_hz, phase + 0.5 * EVSIM_PI); /* The body rises as the wings go down. */
    add_term(&m->channel[EVSIM_X], 0.003, beat_hz, phase + EVSIM_PI);       /* Thrust comes in beats too. */
    add_band(&m->channel[EVSIM_Z], draw, 0.15, 0.15, 0.4);
    add_band(&m->channel[EVSIM_ROLL], draw, 4.0 * DEG, 0.3, 0.9);
    add_band(&m->channel[EVSIM_YAW], draw, 5.0 * DEG, 0.2, 0.7);
    if (circle) {
        const double radius_m = 1.2;
        const double turn_hz = 0.75 / (2.0 * EVSIM_PI * radius_m); /* 0.75 m/s */
        const double start = evsim_draw(draw, 0.0, 2.0 * EVSIM_PI);
        m->channel[EVSIM_YAW].offset = start;
        m->channel[EVSIM_YAW].slope = 2.0 * EVSIM_PI * turn_hz;
        add_term(&m->channel[EVSIM_X], radius_m, turn_hz, start);
        add_term(&m->channel[EVSIM_Y], radius_m, turn_hz, start - 0.5 * EVSIM_PI);
    } else {
        add_term(&m->channel[EVSIM_X], 0.8, 0.1, 0.0);
    }
}

void evsim_motion_init(evsim_motion_t *motion, const evsim_settings_t *settings)
{
    evsim_draw_t draw = {settings->seed, EVSIM_STREAM_MOTION, 0u};
    memset(motion, 0, sizeof *motion);
    switch (settings->motion) {
    case EVSIM_MOTION_HANDHELD:
        init_handheld(motion, &draw);
        break;
    case EVSIM_MOTION_HOVER:
        init_hover(motion, &draw);
        break;
    case EVSIM_MOTION_SWEEP:
        init_sweep(motion, &draw);
        break;
    case EVSIM_MOTION_FLAP:
        init_flap(motion, &draw, settings->scene != EVSIM_SCENE_POSTER);
        break;
    case EVSIM_MOTION_ROTATE:
        init_rotate(motion, &draw);
        break;
    case EVSIM_MOTION_STATIC:
    case EVSIM_MOTIONS:
    default:
        break;
    }
    if (settings->scene == EVSIM_SCENE_PANORAMA) { /* Infinitely far: there is nothing to move towards. */
        for (unsigned i = EVSIM_X; i <= EVSIM_Z; i++) { motion->channel[i].n_terms = 0u; }
    }
    motion->channel[EVSIM_Z].offset = EYE_HEIGHT_M;
}

/* Value and the first two derivatives. */
static void channel_at(const evsim_channel_t *c, double t_s, double d[3])
{
    d[0] = c->offset + c->slope * t_s;
    d[1] = c->slope;
    d[2] = 0.0;
    for (unsigned i = 0u; i < c->n_terms; i++) {
        const evsim_term_t *const term = &c->term[i];
        const double angle = term->omega_rad_s * t_s + term->phase_rad;
        const double s = term->amplitude * sin(angle);
        d[0] += s;
        d[1] += term->amplitude * term->omega_rad_s * cos(angle);
        d[2] -= s * term->omega_rad_s * term->omega_rad_s;
    }
}

void evsim_motion_at(const evsim_motion_t *motion, double t_s, evsim_state_t *state)
{
    /* Camera axes in the body: right = -y, down = -z, forward = x. */
    static const evsim_quat_t Q_BODY_CAMERA = {{0.5, -0.5, 0.5, -0.5}};
    double d[EVSIM_CHANNELS][3];
    evsim_quat_t q;
    double rate[3];
    for (unsigned i = 0u; i < EVSIM_CHANNELS; i++) { channel_at(&motion->channel[i], t_s, d[i]); }

    {
        const double half_roll = 0.5 * d[EVSIM_ROLL][0];
        const double half_pitch = 0.5 * d[EVSIM_PITCH][0];
        const double half_yaw = 0.5 * d[EVSIM_YAW][0];
        const evsim_quat_t roll = {{cos(half_roll), sin(half_roll), 0.0, 0.0}};
        const evsim_quat_t pitch = {{cos(half_pitch), 0.0, sin(half_pitch), 0.0}};
        const evsim_quat_t yaw = {{cos(half_yaw), 0.0, 0.0, sin(half_yaw)}};
        q = evsim_quat_mul(evsim_quat_mul(evsim_quat_mul(yaw, pitch), roll), Q_BODY_CAMERA);
    }
    if (q.q[0] < 0.0) {
        for (unsigned i = 0u; i < 4u; i++) { q.q[i] = -q.q[i]; }
    }
    state->q_wc = q;
    state->r_wc = evsim_quat_to_mat(q);

    { /* Rate of the body in its own axes from the rates of yaw, pitch and roll. */
        const double cr = cos(d[EVSIM_ROLL][0]);
        const double sr = sin(d[EVSIM_ROLL][0]);
        const double cp = cos(d[EVSIM_PITCH][0]);
        const double sp = sin(d[EVSIM_PITCH][0]);
        rate[0] = d[EVSIM_ROLL][1] - d[EVSIM_YAW][1] * sp;
        rate[1] = d[EVSIM_PITCH][1] * cr + d[EVSIM_YAW][1] * cp * sr;
        rate[2] = -d[EVSIM_PITCH][1] * sr + d[EVSIM_YAW][1] * cp * cr;
    }
    state->w_c_rad_s = evsim_vec(-rate[1], -rate[2], rate[0]);

    state->p_w_m = evsim_vec(d[EVSIM_X][0], d[EVSIM_Y][0], d[EVSIM_Z][0]);
    state->v_w_m_s = evsim_vec(d[EVSIM_X][1], d[EVSIM_Y][1], d[EVSIM_Z][1]);
    state->a_w_m_s2 = evsim_vec(d[EVSIM_X][2], d[EVSIM_Y][2], d[EVSIM_Z][2]);
    state->v_c_m_s = evsim_rotate_back(&state->r_wc, state->v_w_m_s);
    state->f_c_m_s2 =
        evsim_rotate_back(&state->r_wc, evsim_add(state->a_w_m_s2, evsim_vec(0.0, 0.0, EVSIM_GRAVITY_M_S2)));
}
