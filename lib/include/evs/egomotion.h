/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/egomotion.h
 * @brief Direction of the camera's own velocity from optical flow whose rotation has been removed.
 *
 * Model    u = rho (x Vz - Vx), v = rho (y Vz - Vy), rho > 0: what a still scene at unknown depths shows to a camera
 *          that moves along V without turning. (x, y) is a position in K^-1 px, (u, v) its displacement.
 *          ROBUST: 64 directions spread evenly over a half sphere, each with both signs, are tried on at most 128 of
 *          the vectors; up to three that lie apart are led on by Gauss-Newton steps on the residual across the flow
 *          direction, with weights of Geman and McClure and a scale that stands when half of the vectors are outliers;
 *          the one that explains most vectors to within the noise is refined. The sign is part of the estimate. Sigma
 *          covers halves of the image that disagree, as an object that moves by itself makes them. With a prior on
 *          the residual rotation, V and a rotation are estimated together: for an attitude that is not perfect.
 *          PAPER and ERL: the published estimators [1], [2], for comparison. They are slower and 2 to 7 times less
 *          accurate; they state no sign, here the majority of the vectors gives it.
 *          Never feed it normal flow, that is the component across an edge, as a plane fit to the time surface gives:
 *          with unknown depth such a vector says nothing but a sign, and the answer would be wrong by tens of degrees.
 * Memory   EVS_EGOMOTION_BYTES(n) of the caller's, for the call.
 * Cost     docs/performance.md. All loops are bounded: nothing iterates until it converges.
 * Numeric  integers only, bit-exact on every target. Flow is scaled so that its median length is 2^10 steps.
 * Time     none: the displacements' interval is the caller's.
 * Threads  no state.
 *
 * [1] A. Jaegle, S. Phillips, K. Daniilidis, "Fast, Robust, Continuous Monocular Egomotion Computation", ICRA 2016.
 *     doi:10.1109/ICRA.2016.7487206
 * [2] J. P. Rodriguez-Gomez, J. R. Martinez-de Dios, A. Ollero, G. Gallego, "On the Benefits of Visual Stabilization
 *     for Frame- and Event-based Perception", IEEE RA-L 2024. doi:10.1109/LRA.2024.3450290
 */
#ifndef EVS_EGOMOTION_H
#define EVS_EGOMOTION_H

#include "evs/vec.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_EGOMOTION_N_MAX 65535u /**< Most flow vectors of one call. */

/** Scratch of evs_egomotion_solve() for up to n vectors; aligned to 4 bytes. */
#define EVS_EGOMOTION_BYTES(n) (1536u + (size_t)(n)*10u)
/** The same for the methods PAPER and ERL. */
#define EVS_EGOMOTION_PAPER_BYTES(n) (1536u + (size_t)(n)*16u)

/** One flow vector. Positions off [-8, 8) are left out and counted; any displacement will do. */
typedef struct {
    int32_t x_q24; /**< Where it starts, K^-1 px. */
    int32_t y_q24;
    int32_t u_q24; /**< Displacement over the interval, K^-1 px. */
    int32_t v_q24;
} evs_egomotion_flow_t;

typedef enum {
    EVS_EGOMOTION_ROBUST = 0, /**< The default. */
    EVS_EGOMOTION_PAPER = 1,  /**< ERL-V as published: the rotation is known and removed. */
    EVS_EGOMOTION_ERL = 2     /**< ERL: the rotation is unknown, too. */
} evs_egomotion_method_t;

/** What the vectors are. */
typedef enum {
    EVS_EGOMOTION_FULL_FLOW = 0,  /**< Both components were measured: features that were tracked. */
    EVS_EGOMOTION_NORMAL_FLOW = 1 /**< Refused; see above. */
} evs_egomotion_flow_kind_t;

typedef struct { /** Settings. */
    evs_egomotion_method_t method;
    evs_egomotion_flow_kind_t flow_kind; /**< Default FULL_FLOW. */
    int32_t rotation_sigma_rad_q28;      /**< ROBUST: 1 sigma per axis of the rotation that may be left in the flow over
                                              the interval (rate times interval), [0, 2^28]. Default 0: none is left. */
    uint16_t variance_factor_q8;         /**< The variance of V is multiplied by it, in 1/256: over how many vectors an
                                              error of the flow extends where windows of the tracker overlap. What sigma
                                              is at least, by halves of the image that disagree and by the rounding of
                                              the flow, stays as it is. [256, 65535], default 256: errors are
                                              independent. */
} evs_egomotion_config_t;

/** Flags of a result. Without VALID, v is the best guess and sigma says half a turn. */
enum {
    EVS_EGOMOTION_VALID = 1 << 0,
    EVS_EGOMOTION_FEW = 1 << 1,         /**< Fewer than EVS_EGOMOTION_INLIERS_MIN vectors agree. */
    EVS_EGOMOTION_STILL = 1 << 2,       /**< No vector has a length. */
    EVS_EGOMOTION_CHANCE = 1 << 3,      /**< No more vectors agree than would by chance. */
    EVS_EGOMOTION_SIGN_UNSURE = 1 << 4, /**< V or -V: the vectors that agree point both ways. */
    EVS_EGOMOTION_ROTATION = 1 << 5,    /**< A rotation explains the flow about as well as any translation. */
    EVS_EGOMOTION_DEGENERATE = 1 << 6   /**< The vectors leave a direction open: sigma would exceed a radian. */
};

#define EVS_EGOMOTION_INLIERS_MIN 8u /**< Vectors that must agree. */

typedef struct {
    evs_vec3_t v_q30;               /**< The camera's own velocity: unit vector, signed. */
    evs_vec3_t rotation_rad_q28;    /**< Rotation found in the flow: with a prior, or by ERL; else zero. */
    int32_t sigma_rad_q28;          /**< Expected error of v, an angle (RMS), at most 1 rad; pi if not VALID. */
    int32_t covariance_rad2_q30[6]; /**< Of v: xx, xy, xz, yy, yz, zz; zeros when not VALID. */
    uint32_t flags;                 /**< EVS_EGOMOTION_VALID, ... */
    uint32_t n_flow;                /**< Vectors with a length and a position in range: those used. */
    uint32_t n_rejected;            /**< Vectors with a position out of range. */
    uint32_t n_inliers;             /**< Vectors that agree with v: see evs_egomotion_is_inlier(). */
    uint32_t median_flow_q24;       /**< Median length of the vectors used, K^-1 px; saturates. */
    uint32_t noise_q24;             /**< Robust 1 sigma of the flow's error in one component, K^-1 px; saturates. */
    uint32_t scale_;                /**< Private: how is_inlier() scales a vector, ... */
    uint8_t scale_shift_;           /* ... */
    uint8_t position_shift_;        /* ... */
    uint16_t inlier_limit_;         /* and how far from the line it may end. */
} evs_egomotion_result_t;

evs_egomotion_config_t evs_egomotion_config_default(void);

/**
 * Estimate the direction of the velocity.
 * Data that allow no answer are no error: the result then lacks VALID, and its flags tell why.
 * @param      flow       n vectors, in any order; better an order that is spread over the image, since the search looks
 *                        at every (n/128)-th.
 * @param      scratch    n_scratch bytes, aligned to 4; contents do not matter. EVS_EGOMOTION_BYTES(n) or, for PAPER
 *                        and ERL, EVS_EGOMOTION_PAPER_BYTES(n). May be NULL where n is 0, and so may flow.
 * @param[out] result     Untouched on error.
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (a setting is out of range, or the flow is normal flow) or EVS_ERR_SIZE (n
 *         is above EVS_EGOMOTION_N_MAX, the scratch is too small or misaligned).
 */
EVS_NODISCARD evs_status_t evs_egomotion_solve(const evs_egomotion_config_t *cfg, const evs_egomotion_flow_t *flow,
                                               size_t n, void *scratch, size_t n_scratch,
                                               evs_egomotion_result_t *result);

/**
 * Whether a vector of the solved set agrees with the result: it points the way it should, and ends within 2.5 sigma of
 * the noise from its line. The number of vectors for which this holds is n_inliers.
 */
bool evs_egomotion_is_inlier(const evs_egomotion_result_t *result, const evs_egomotion_flow_t *flow);

#ifdef __cplusplus
}
#endif
#endif
