/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  settings.h
 * @brief Everything that determines a simulated recording. Same settings, same bytes, whatever the number of threads.
 */
#ifndef EVSIM_SETTINGS_H
#define EVSIM_SETTINGS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "calib.h"

#define EVSIM_SIZE_MAX_PX  2048
#define EVSIM_TEXTURES_MAX 32u

typedef enum {
    EVSIM_SCENE_ROOM = 0, /**< Box room, textured walls, floating panels at several depths. */
    EVSIM_SCENE_POSTER,   /**< One textured plane in front of the camera. */
    EVSIM_SCENE_SHAPES,   /**< White room with a few dark shapes on its walls. */
    EVSIM_SCENE_PANORAMA, /**< Everything infinitely far: the camera only rotates. */
    EVSIM_SCENES
} evsim_scene_kind_t;

typedef enum {
    EVSIM_MOTION_HANDHELD = 0, /**< Moderate motion in all six degrees of freedom. */
    EVSIM_MOTION_HOVER,        /**< Drone: slow drift and sway, rotor vibration. */
    EVSIM_MOTION_SWEEP,        /**< Fast hand-held swings. */
    EVSIM_MOTION_FLAP,         /**< Flapping wings: 5 Hz pitch and heave, forward flight. */
    EVSIM_MOTION_ROTATE,       /**< Rotation only. */
    EVSIM_MOTION_STATIC,
    EVSIM_MOTIONS
} evsim_motion_kind_t;

typedef struct {
    double rate_hz;
    double gyro_bias_rad_s[3];
    double accel_bias_m_s2[3];
    double gyro_noise;       /**< White noise density, rad/s/sqrt(Hz). */
    double accel_noise;      /**< m/s^2/sqrt(Hz) */
    double gyro_walk;        /**< Random walk of the bias, rad/s^2/sqrt(Hz). */
    double accel_walk;       /**< m/s^3/sqrt(Hz) */
    double gyro_range_rad_s; /**< Readings are clipped at plus and minus this. */
    double accel_range_m_s2;
    int64_t offset_us; /**< t_event = t_imu + offset. */
} evsim_imu_settings_t;

typedef struct {
    evsim_scene_kind_t scene;
    evsim_motion_kind_t motion;
    int64_t duration_us;
    uint64_t seed;
    evh_calib_t calib; /**< Also the size. */

    bool frames;
    double fps_hz;
    int64_t exposure_us; /**< At most one frame period. */

    double contrast_on;  /**< Log-intensity step of an ON event. */
    double contrast_off; /**< And of an OFF event. */
    double contrast_sigma;
    int64_t refractory_us;
    double noise_hz; /**< Background events per pixel. */
    uint32_t n_hot;
    double hot_hz;

    evsim_imu_settings_t imu;

    const char *texture[EVSIM_TEXTURES_MAX]; /**< PNG or JPEG files in place of the procedural textures. */
    size_t n_textures;

    bool gz;       /**< events.txt.gz instead of events.txt. */
    unsigned jobs; /**< Threads. */
} evsim_settings_t;

extern const char *const evsim_scene_names[EVSIM_SCENES];
extern const char *const evsim_motion_names[EVSIM_MOTIONS];

/** A DAVIS240-like sensor and a usual MEMS IMU in the scene's default motion, one thread. */
void evsim_settings_default(evsim_settings_t *settings, evsim_scene_kind_t scene);

/** The default lens for a sensor of this size: 62 degrees wide, barrel distortion. Keeps nothing of @p calib. */
void evsim_default_calib(evh_calib_t *calib, uint16_t width_px, uint16_t height_px);

/** A vector of this length whose direction depends on the seed: for biases given as one number. */
void evsim_random_direction(double length, uint64_t seed, unsigned index, double out[3]);

#endif
