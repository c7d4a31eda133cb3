/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The loops over a window. Private to the kernels; every variant must give these bits. */
#ifndef EVS_FLOW_KERNEL_H
#define EVS_FLOW_KERNEL_H

#include "evs/fixed.h"
#include "evs/flow.h"
#include "evs_simd.h"

/*
 * The template is kept in groups of eight samples of a row: their greys Q7, then their gradients along x, then along y, Q1.
 * Groups follow each other along a row and then row by row. Gradients of the samples past n_side are 0, and their greys
 * of no account.
 */
#define EVS_FLOW_GROUP 24 /* int16_t in a group */
enum { EVS_FLOW_DX = 8, EVS_FLOW_DY = 16 };

/* Sample c of row i: its grey; its gradients are EVS_FLOW_DX and EVS_FLOW_DY behind. */
static inline int16_t *evs_flow_sample(const evs_flow_t *flow, size_t i, size_t c)
{
    return flow->samples + (i * (flow->n_pitch / 8u) + c / 8u) * EVS_FLOW_GROUP + c % 8u;
}

/* Where a window lies: its first sample is between px[0], px[1] and the two below, at weights that add up to 128. */
typedef struct {
    const uint8_t *px;
    size_t pitch; /* from one row to the next */
    uint32_t w00, w01, w10, w11;
} evs_flow_place_t;

/* Sums of products of gradients over the window, in (grey/px)^2 * 4: at most 31^2 * 255^2 < 2^26. */
typedef struct {
    int32_t xx, xy, yy;
} evs_flow_texture_t;

/* Sums of gradient times difference, * 256: at most 31^2 * 255 * 32640 < 2^33. */
typedef struct {
    int64_t x, y;
} evs_flow_pull_t;

/* Interpolate the window and the pixels around it, store template and gradients in `flow`, and sum their products.
 * Reads window_px + 3 rows and columns, from px[-pitch - 1] on. */
void evs_flow_template_plain(evs_flow_t *flow, evs_flow_place_t at, evs_flow_texture_t *texture);

/* The window less the template, against the gradients. Reads window_px + 1 rows of n_pitch * stride_px + 1 columns. */
void evs_flow_pull_plain(const evs_flow_t *flow, evs_flow_place_t at, evs_flow_pull_t *pull);

/* Sum of the absolute differences of the window and the template, Q7: at most 31^2 * 32640. */
uint32_t evs_flow_difference_plain(const evs_flow_t *flow, evs_flow_place_t at);

/* The same, eight samples at a time: SSE2, which every x86-64 has. They read up to EVS_FLOW_PATCH_COLUMNS() less the spare
 * columns in a row, and store what they like past n_side. */
void evs_flow_template_sse2(evs_flow_t *flow, evs_flow_place_t at, evs_flow_texture_t *texture);
void evs_flow_pull_sse2(const evs_flow_t *flow, evs_flow_place_t at, evs_flow_pull_t *pull);
uint32_t evs_flow_difference_sse2(const evs_flow_t *flow, evs_flow_place_t at);

/* Two samples at a time, for stride 2: in halves of registers, with or without Arm's DSP extension. */
void evs_flow_template_pairs(evs_flow_t *flow, evs_flow_place_t at, evs_flow_texture_t *texture);
void evs_flow_pull_pairs(const evs_flow_t *flow, evs_flow_place_t at, evs_flow_pull_t *pull);
uint32_t evs_flow_difference_pairs(const evs_flow_t *flow, evs_flow_place_t at);

/* Eight samples at a time: Helium. */
void evs_flow_template_mve(evs_flow_t *flow, evs_flow_place_t at, evs_flow_texture_t *texture);
void evs_flow_pull_mve(const evs_flow_t *flow, evs_flow_place_t at, evs_flow_pull_t *pull);
uint32_t evs_flow_difference_mve(const evs_flow_t *flow, evs_flow_place_t at);

/* The one of this build. */
static inline void evs_flow_template(evs_flow_t *flow, evs_flow_place_t at, evs_flow_texture_t *texture)
{
#if EVS_SIMD_X86
    evs_flow_template_sse2(flow, at, texture);
#elif EVS_SIMD_MVE
    evs_flow_template_mve(flow, at, texture);
#else
    if (flow->cfg.stride_px == 2u) {
        evs_flow_template_pairs(flow, at, texture);
        return;
    }
    evs_flow_template_plain(flow, at, texture);
#endif
}
static inline void evs_flow_pull(const evs_flow_t *flow, evs_flow_place_t at, evs_flow_pull_t *pull)
{
#if EVS_SIMD_X86
    evs_flow_pull_sse2(flow, at, pull);
#elif EVS_SIMD_MVE
    evs_flow_pull_mve(flow, at, pull);
#else
    if (flow->cfg.stride_px == 2u) {
        evs_flow_pull_pairs(flow, at, pull);
        return;
    }
    evs_flow_pull_plain(flow, at, pull);
#endif
}
static inline uint32_t evs_flow_difference(const evs_flow_t *flow, evs_flow_place_t at)
{
#if EVS_SIMD_X86
    return evs_flow_difference_sse2(flow, at);
#elif EVS_SIMD_MVE
    return evs_flow_difference_mve(flow, at);
#else
    return (flow->cfg.stride_px == 2u) ? evs_flow_difference_pairs(flow, at) : evs_flow_difference_plain(flow, at);
#endif
}

/*
 * Bilinear weights of a fraction in [0, 128). Rows and columns add up to what they must: position is exact along both
 * axes, and only the mixed term is rounded. None is negative: 128 w00 = (128 - fx)(128 - fy) within 64.
 */
static inline void evs_flow_set_weights(evs_flow_place_t *at, uint32_t fx, uint32_t fy)
{
    at->w11 = (fx * fy + 64u) >> 7;
    at->w01 = fx - at->w11;
    at->w10 = fy - at->w11;
    at->w00 = 128u - fx - fy + at->w11;
}

#define EVS_FLOW_GREY_MAX     (255 * 128) /* Q7: differences fit 16 bits, too */
#define EVS_FLOW_GRADIENT_MAX 255         /* Q1: half the difference of two neighbours */
EVS_STATIC_ASSERT(EVS_FLOW_GREY_MAX <= INT16_MAX, "greys and their differences are int16_t");

/* Grey value Q7 between four pixels. */
static inline int32_t evs_flow_blend(const uint8_t *px, const evs_flow_place_t *at)
{
    const uint8_t *const below = px + at->pitch;
    return (int32_t)(px[0] * at->w00 + px[1] * at->w01 + below[0] * at->w10 + below[1] * at->w11);
}

/* Gradient Q1 from the greys Q7 before and after. */
static inline int32_t evs_flow_gradient(int32_t before, int32_t after) { return (after - before + 64) >> 7; }

#endif
