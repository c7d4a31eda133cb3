/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  texture.h
 * @brief Square textures of linear intensity with mip levels; sampling is trilinear, so a texture seen from afar or
 *        moving fast does not flicker, and flicker would be events.
 */
#ifndef EVSIM_TEXTURE_H
#define EVSIM_TEXTURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define EVSIM_TEXTURE_LOG2_MAX 11u

typedef struct {
    unsigned log2_size;
    float *level[EVSIM_TEXTURE_LOG2_MAX + 1u]; /**< Level k has 2^(log2_size - k) texels a side; it repeats. */
    float *storage;
} evsim_texture_t;

/** Allocate; the caller fills level[0], then calls evsim_texture_finish(). */
bool evsim_texture_init(evsim_texture_t *texture, unsigned log2_size);

/** Average level by level. */
void evsim_texture_finish(evsim_texture_t *texture);

/** Level 0 from an image of any size, by the mean over each texel's area. @return false: out of memory. */
bool evsim_texture_from_image(evsim_texture_t *texture, const uint8_t *gray, unsigned width_px, unsigned height_px);

void evsim_texture_free(evsim_texture_t *texture);

/* (u, v) in texels of this level, texel centres at half-integers. */
static inline float evsim_texture_bilinear(const float *texel, unsigned log2_size, float u, float v)
{
    const int mask = (1 << log2_size) - 1;
    const float us = u - 0.5f;
    const float vs = v - 0.5f;
    const int iu = (int)us - ((us < 0.0f) ? 1 : 0);
    const int iv = (int)vs - ((vs < 0.0f) ? 1 : 0);
    const float fu = us - (float)iu;
    const float fv = vs - (float)iv;
    const unsigned u0 = (unsigned)(iu & mask);
    const unsigned u1 = (unsigned)((iu + 1) & mask);
    const float *const row0 = texel + ((size_t)(unsigned)(iv & mask) << log2_size);
    const float *const row1 = texel + ((size_t)(unsigned)((iv + 1) & mask) << log2_size);
    const float top = row0[u0] + fu * (row0[u1] - row0[u0]);
    const float low = row1[u0] + fu * (row1[u1] - row1[u0]);
    return top + fv * (low - top);
}

/**
 * Intensity at (u, v), in texels of level 0, averaged over a footprint of about sqrt(@p footprint2) texels.
 * |u| and |v| below 2^30.
 */
static inline float evsim_texture_sample(const evsim_texture_t *t, float u, float v, float footprint2)
{
    uint32_t bits;
    float lod;
    float scale;
    int level;
    float part;
    float fine;
    float coarse;
    if (!(footprint2 > 1.0f)) { return evsim_texture_bilinear(t->level[0], t->log2_size, u, v); }
    /* log2 by the exponent and, between powers of two, a straight line: continuous, which is all that counts here. */
    memcpy(&bits, &footprint2, sizeof bits);
    lod = 0.5f * ((float)bits * (1.0f / 8388608.0f) - 127.0f);
    level = (int)lod;
    if ((level >= (int)EVSIM_TEXTURE_LOG2_MAX) || (level >= (int)t->log2_size)) { return t->level[t->log2_size][0]; }
    part = lod - (float)level;
    bits = (127u - (uint32_t)level) << 23; /* 2^-level */
    memcpy(&scale, &bits, sizeof scale);
    u *= scale;
    v *= scale;
    fine = evsim_texture_bilinear(t->level[level], t->log2_size - (unsigned)level, u, v);
    coarse = evsim_texture_bilinear(t->level[level + 1], t->log2_size - (unsigned)level - 1u, 0.5f * u, 0.5f * v);
    return fine + part * (coarse - fine);
}

#endif
