/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  rng.h
 * @brief Random numbers by counter: number n of a stream depends on nothing but (seed, stream, index, n), so the order
 *        in which threads draw them cannot change the result.
 *
 * The mixer is the finalizer of SplitMix64: G. L. Steele, D. Lea, C. H. Flood, "Fast Splittable Pseudorandom Number
 * Generators", OOPSLA 2014, doi:10.1145/2660193.2660195.
 */
#ifndef EVSIM_RNG_H
#define EVSIM_RNG_H

#include <math.h>
#include <stdint.h>

/** One stream per use, so that a new draw in one place leaves all others as they were. */
typedef enum {
    EVSIM_STREAM_MOTION = 1,
    EVSIM_STREAM_SCENE,
    EVSIM_STREAM_PATTERN,
    EVSIM_STREAM_CONTRAST,
    EVSIM_STREAM_REFERENCE,
    EVSIM_STREAM_NOISE,
    EVSIM_STREAM_HOT,
    EVSIM_STREAM_IMU_BIAS,
    EVSIM_STREAM_IMU_NOISE
} evsim_stream_t;

static inline uint64_t evsim_mix(uint64_t x)
{
    x += UINT64_C(0x9E3779B97F4A7C15);
    x = (x ^ (x >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    x = (x ^ (x >> 27)) * UINT64_C(0x94D049BB133111EB);
    return x ^ (x >> 31);
}

static inline uint64_t evsim_bits(uint64_t seed, evsim_stream_t stream, uint64_t index, uint64_t n)
{
    return evsim_mix(evsim_mix(evsim_mix(seed ^ ((uint64_t)stream << 56)) ^ index) ^ n);
}

/** In (0, 1): neither end, so that a logarithm of it is finite. */
static inline double evsim_uniform(uint64_t seed, evsim_stream_t stream, uint64_t index, uint64_t n)
{
    return ((double)(evsim_bits(seed, stream, index, n) >> 12) + 0.5) / 4503599627370496.0;
}

/** Normal with mean 0 and variance 1; uses the numbers 2n and 2n + 1. */
static inline double evsim_gauss(uint64_t seed, evsim_stream_t stream, uint64_t index, uint64_t n)
{
    const double u = evsim_uniform(seed, stream, index, 2u * n);
    const double v = evsim_uniform(seed, stream, index, 2u * n + 1u);
    return sqrt(-2.0 * log(u)) * cos(6.283185307179586 * v);
}

/** Draws one after the other, for the set-up that runs on one thread. */
typedef struct {
    uint64_t seed;
    evsim_stream_t stream;
    uint64_t n;
} evsim_draw_t;

static inline double evsim_draw(evsim_draw_t *draw, double low, double high)
{
    return low + (high - low) * evsim_uniform(draw->seed, draw->stream, 0u, draw->n++);
}

static inline unsigned evsim_draw_below(evsim_draw_t *draw, unsigned n)
{
    return (unsigned)(evsim_bits(draw->seed, draw->stream, 0u, draw->n++) % n);
}

#endif
