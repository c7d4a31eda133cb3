/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* A soft grey texture without end, for the bench programs that look at images. */
#ifndef EVS_BENCH_TEXTURE_H
#define EVS_BENCH_TEXTURE_H

#include <stdint.h>

enum { LATTICE = 9 }; /* px between its random values */

static inline uint32_t texture_hash(uint32_t x, uint32_t y)
{
    uint32_t h = x * 0x9E3779B1u ^ y * 0x85EBCA77u;
    h ^= h >> 15;
    h *= 0x2C1B3C6Du;
    return h ^ (h >> 13);
}

/* Grey of a lattice of random values, interpolated; positions in 1/256 px. */
static inline uint32_t texture_at(uint32_t x_q8, uint32_t y_q8)
{
    const uint32_t u = x_q8 / LATTICE, v = y_q8 / LATTICE;
    const uint32_t i = u >> 8, j = v >> 8, fx = u & 255u, fy = v & 255u;
    const uint32_t above = (texture_hash(i, j) & 255u) * (256u - fx) + (texture_hash(i + 1u, j) & 255u) * fx;
    const uint32_t below = (texture_hash(i, j + 1u) & 255u) * (256u - fx) + (texture_hash(i + 1u, j + 1u) & 255u) * fx;
    return (above * (256u - fy) + below * fy) >> 16;
}

#endif
