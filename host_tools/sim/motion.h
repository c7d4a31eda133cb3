/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  motion.h
 * @brief Closed-form motion of the camera: position and attitude are sums of sinusoids and a linear term, so velocity,
 *        rate and acceleration come from exact derivatives, at any time, also before 0.
 *
 * World: x, y level, z up, metres. The body (x forward, y left, z up) is turned from the world by yaw, pitch, roll
 * (R = Rz Ry Rx); the camera (x right, y down, z forward) looks along the body's x.
 */
#ifndef EVSIM_MOTION_H
#define EVSIM_MOTION_H

#include "linalg.h"
#include "settings.h"

#define EVSIM_GRAVITY_M_S2 9.81
#define EVSIM_TERMS_MAX    8u

/** amplitude * sin(omega t + phase) */
typedef struct {
    double amplitude;
    double omega_rad_s;
    double phase_rad;
} evsim_term_t;

typedef struct {
    double offset;
    double slope; /**< Per second. */
    evsim_term_t term[EVSIM_TERMS_MAX];
    unsigned n_terms;
} evsim_channel_t;

enum { EVSIM_X = 0, EVSIM_Y, EVSIM_Z, EVSIM_ROLL, EVSIM_PITCH, EVSIM_YAW, EVSIM_CHANNELS };

typedef struct {
    evsim_channel_t channel[EVSIM_CHANNELS];
} evsim_motion_t;

/** The camera at one moment. */
typedef struct {
    evsim_vec_t p_w_m;     /**< World. */
    evsim_vec_t v_w_m_s;   /**< World. */
    evsim_vec_t a_w_m_s2;  /**< World, without gravity. */
    evsim_quat_t q_wc;     /**< World from camera, w >= 0. */
    evsim_mat_t r_wc;      /**< The same. */
    evsim_vec_t w_c_rad_s; /**< Camera frame. */
    evsim_vec_t v_c_m_s;   /**< Camera frame. */
    evsim_vec_t f_c_m_s2;  /**< Specific force in the camera frame: what an ideal accelerometer reads. */
} evsim_state_t;

/** Draw the motion that the settings name. */
void evsim_motion_init(evsim_motion_t *motion, const evsim_settings_t *settings);

void evsim_motion_at(const evsim_motion_t *motion, double t_s, evsim_state_t *state);

#endif
