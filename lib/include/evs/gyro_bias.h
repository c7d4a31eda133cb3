/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/gyro_bias.h
 * @brief A gyro's bias, learnt in flight from the flow in images that were stabilized by that gyro.
 *
 * Model    Stabilization by a gyro of bias b leaves the rotation -b dt in the flow. A single pair of images can hardly
 *          tell it from a motion sideways; but the direction of flight changes, and the bias does not. For each pair
 *          the information on b that remains when the direction is unknown, too (a Schur complement of the
 *          Gauss-Newton Hessian at the direction found), and the slope of the cost are added up, with a memory of
 *          memory_ms. The prior is normal with zero mean; its width is estimated along (empirical Bayes), so that a
 *          small bias stays near zero and a large one is not held back.
 *          Give it pairs whose direction is valid only.
 * Memory   one evs_gyro_bias_t.
 * Cost     68,000 instructions per pair and 800 per flow vector on a Cortex-M4F (docs/performance.md): one percent of what
 *          the flow of the pair has cost.
 * Numeric  integers only, bit-exact on every target. Rates Q24 rad/s, in the camera's frame.
 * Time     wraps.
 * Threads  no shared state.
 */
#ifndef EVS_GYRO_BIAS_H
#define EVS_GYRO_BIAS_H

#include "evs/egomotion.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct { /** Context. Zero it, or reset it, to begin. Every member is private. */
    evs_vec3_t bias_q24;
    int32_t sigma_q24;  /* of an axis, RMS; 0: nothing learnt yet */
    int32_t prior_q24;  /* width of the prior; 0: not estimated yet */
    int32_t info_q4[6]; /* (rad/s)^-2, lower triangle by rows */
    int32_t pull_q8[3]; /* information times bias */
    uint32_t t_us;      /* of the newest pair */
} evs_gyro_bias_t;

/** A pair of images. */
typedef struct {
    const evs_egomotion_flow_t *flow; /**< What is left when evs_gyro_bias_left() is taken out of it. */
    size_t n;
    evs_vec3_t v_q30;   /**< The direction that was found in it. */
    uint32_t noise_q24; /**< 1 sigma of the flow, K^-1 px. */
    evs_quat_t q_cr;    /**< Camera, in the middle of the interval, from the frame of the flow. */
    uint32_t t_us;      /**< The middle. */
    uint32_t interval_us;
} evs_gyro_bias_pair_t;

void evs_gyro_bias_reset(evs_gyro_bias_t *b);

/** The rotation that stabilization has left over an interval, by what is known of the bias, in the frame of the flow. */
evs_vec3_t evs_gyro_bias_left(const evs_gyro_bias_t *b, evs_quat_t q_cr, uint32_t interval_us);

/** Take the flow of a small rotation out of a vector. */
evs_egomotion_flow_t evs_gyro_bias_take_out(evs_egomotion_flow_t flow, evs_vec3_t rotation_rad_q28);

/** Learn from a pair. */
void evs_gyro_bias_learn(evs_gyro_bias_t *b, const evs_gyro_bias_pair_t *pair);

#ifdef __cplusplus
}
#endif
#endif
