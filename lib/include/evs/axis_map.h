/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/axis_map.h
 * @brief From a sensor's axes to the IMU's: mounting, scale, cross-talk and offset of one three-axis sensor.
 *
 * Model    v = M (raw - offset). M takes swapped and mirrored axes, a rotation (how the sensor is mounted), scale factors
 *          and soft iron alike; offset takes what a calibration found at rest, or hard iron.
 * Memory   48 bytes per sensor, yours.
 * Cost     nine multiplications.
 * Numeric  integers only, bit-exact on every target. M in Q28, entries in [-8, 8); vectors in any Q, the same in and out.
 *          Rounds to nearest, saturates.
 * Threads  no state.
 */
#ifndef EVS_AXIS_MAP_H
#define EVS_AXIS_MAP_H

#include "evs/vec.h"

#ifdef __cplusplus
extern "C" {
#endif

/** The map of one sensor. Fill it in, or start from one of the functions below. */
typedef struct {
    int32_t m_q28[3][3]; /**< Row by row; 1.0 = 2^28. */
    evs_vec3_t offset;   /**< In the sensor's own axes, in the Q of its samples. */
} evs_axis_map_t;

/** Changes nothing. */
static inline evs_axis_map_t evs_axis_map_identity(void)
{
    const int32_t one = INT32_C(1) << 28;
    const evs_axis_map_t map = {{{one, 0, 0}, {0, one, 0}, {0, 0, one}}, {0, 0, 0}};
    return map;
}

/** The rotation q_is (IMU from sensor), no offset. */
static inline evs_axis_map_t evs_axis_map_from_quat(evs_quat_t q_is)
{
    const evs_mat3_t r = evs_quat_to_mat3(q_is);
    evs_axis_map_t map = evs_axis_map_identity();
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 3; column++) { map.m_q28[row][column] = evs_shr_r(r.m[row][column], 2u); }
    }
    return map;
}

/** One sample through the map. */
static inline evs_vec3_t evs_axis_map_apply(const evs_axis_map_t *map, evs_vec3_t raw)
{
    /* Products are halved so that three of them, of any size, fit 64 bits. */
    const evs_vec3_t v = evs_vec3_sub(raw, map->offset);
    int32_t out[3];
    for (int row = 0; row < 3; row++) {
        const int32_t *const m = map->m_q28[row];
        const int64_t sum = (((int64_t)m[0] * v.x) >> 1) + (((int64_t)m[1] * v.y) >> 1) + (((int64_t)m[2] * v.z) >> 1);
        out[row] = evs_sat32((sum + (INT64_C(1) << 26)) >> 27);
    }
    const evs_vec3_t mapped = {out[0], out[1], out[2]};
    return mapped;
}

#ifdef __cplusplus
}
#endif
#endif
