/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  patterns.h
 * @brief Procedural textures: functions of a point that give the intensity there, 0..1.
 */
#ifndef EVSIM_PATTERNS_H
#define EVSIM_PATTERNS_H

#include <stdint.h>

/** The plane patterns repeat with period 1 in u and v. */
typedef enum {
    EVSIM_PATTERN_STONES = 0,
    EVSIM_PATTERN_BRICKS,
    EVSIM_PATTERN_CLOUDS,
    EVSIM_PATTERN_TILES,
    EVSIM_PATTERN_COLLAGE,
    EVSIM_PATTERN_PLANKS,
    EVSIM_PATTERN_PRINT,
    EVSIM_PATTERN_SPOTS,
    EVSIM_PATTERNS_ROOM, /**< Those above fill a room. */
    EVSIM_PATTERN_SHAPES = EVSIM_PATTERNS_ROOM,
    EVSIM_PATTERN_WHITE
} evsim_pattern_t;

float evsim_pattern_at(evsim_pattern_t pattern, uint64_t seed, double u, double v);

/** A landscape all around: the intensity in a direction (unit vector). */
float evsim_pattern_sky_at(uint64_t seed, const double direction[3]);

#endif
