/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/orientation_track.h
 * @brief The recent orientations of the camera, and its orientation at the time of any event.
 *
 * Model    Between two samples a cubic Hermite curve in the rotation vector, whose ends have the samples' orientations
 *          and rates. Past the newest sample rate and angular acceleration are held, up to max_predict_us.
 * Memory   caller-owned: one evs_orientation_track_t and a ring of at least EVS_ORIENTATION_TRACK_MIN samples of 32 B.
 * Cost     push O(1); query O(samples newer than t) and one logarithm and one exponential: the larger part of the new
 *          orientation that docs/performance.md counts.
 * Numeric  integers only, bit-exact on every target. Orientation error against the same curve in double <= 1e-6 rad.
 * Time     samples carry the time of their own clock; queries are in event time: t_event = t_sample + offset_us.
 *          Both wrap; a query must lie within 2^31 us (35 min) of the samples in the ring.
 * Threads  no shared state; one context must not be entered from two threads or ISRs at once.
 */
#ifndef EVS_ORIENTATION_TRACK_H
#define EVS_ORIENTATION_TRACK_H

#include "evs/clock.h"
#include "evs/vec.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_ORIENTATION_TRACK_MIN 4u /**< Fewest samples in a ring. */

/** One sample, or the answer to a query. */
typedef struct {
    uint32_t t_us;
    evs_quat_t q_wc;           /**< World from camera, unit, Q30. */
    evs_vec3_t rate_rad_s_q24; /**< Angular rate of the camera, seen in the camera. */
} evs_orientation_t;

typedef struct {             /** Settings; copied by evs_orientation_track_init(). */
    int32_t offset_us;       /**< t_event - t_sample, constant. [-10^7, 10^7], default 0. */
    uint32_t max_gap_us;     /**< Samples further apart are not interpolated. [1, 10^6], default 100000. */
    uint32_t max_predict_us; /**< Furthest prediction past the newest sample. [0, 50000], default 5000. */
} evs_orientation_track_config_t;

typedef struct { /** Context. A complete type only so that you can place it: every member is private. */
    evs_orientation_track_config_t cfg;
    evs_clock_t clock;
    evs_orientation_t *ring;
    size_t n_ring;
    size_t n_used;
    size_t newest; /* index into ring */
} evs_orientation_track_t;

evs_orientation_track_config_t evs_orientation_track_config_default(void);

/**
 * Bind a context to a ring of caller memory and empty it.
 * @param[out] track   Untouched on error.
 * @param      ring    Kept by reference; contents on entry do not matter.
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (a setting is out of range) or EVS_ERR_SIZE (fewer than 4 samples).
 */
EVS_NODISCARD evs_status_t evs_orientation_track_init(evs_orientation_track_t *track,
                                                      const evs_orientation_track_config_t *cfg,
                                                      evs_orientation_t *ring, size_t n_ring);

/**
 * Add a sample newer than all before; the oldest leaves a full ring. A sample that is not newer is dropped and counted;
 * when EVS_CLOCK_RESTART_AFTER of them follow each other the clock has restarted, and the ring with it.
 * @return EVS_OK, or EVS_ERR_TIME (dropped).
 */
evs_status_t evs_orientation_track_push(evs_orientation_track_t *track, const evs_orientation_t *sample);

/**
 * The orientation at event time t_us.
 * @param[out] at  t_us, orientation, and the rate (interpolated linearly). Untouched on error.
 * @return EVS_OK; EVS_ERR_STATE (no sample yet), EVS_ERR_TOO_OLD (before the oldest sample in the ring),
 * EVS_ERR_TOO_NEW (more than max_predict_us past the newest), or EVS_ERR_GAP (between samples more than max_gap_us
 * apart).
 */
EVS_NODISCARD evs_status_t evs_orientation_track_at(const evs_orientation_track_t *track, uint32_t t_us,
                                                    evs_orientation_t *at);

/** Event time of the newest sample: up to here nothing is predicted. @return EVS_OK or EVS_ERR_STATE. */
EVS_NODISCARD evs_status_t evs_orientation_track_newest(const evs_orientation_track_t *track, uint32_t *t_us);

/** Samples dropped because their time ran back, since init; saturates. */
uint32_t evs_orientation_track_n_dropped(const evs_orientation_track_t *track);

#ifdef __cplusplus
}
#endif
#endif
