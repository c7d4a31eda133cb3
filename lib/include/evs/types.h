/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/types.h
 * @brief The types that every module shares: status, time, event, point.
 *
 * Time is a free-running microsecond counter that wraps after 71.6 min (2^32 us). Compare two times only with
 * evs_time_diff_us(), which is right while they lie less than 2^31 us (35.7 min) apart.
 * Pixel centres lie at integer coordinates; x runs right, y runs down.
 */
#ifndef EVS_TYPES_H
#define EVS_TYPES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "evs/config.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What a call that can be refused returns. On any error its outputs are untouched. */
typedef enum {
    EVS_OK = 0,
    EVS_ERR_NULL = -1,    /**< A required pointer is NULL. */
    EVS_ERR_ARG = -2,     /**< A setting or an argument is outside its documented range. */
    EVS_ERR_SIZE = -3,    /**< A buffer of the caller is too small or misaligned. */
    EVS_ERR_TIME = -4,    /**< A time runs back or jumps further than the module allows. */
    EVS_ERR_STATE = -5,   /**< The call does not fit the state, e.g. nothing was pushed yet. */
    EVS_ERR_NUMERIC = -6, /**< No answer exists: no preimage, a zero vector, an overflow. */
    EVS_ERR_TOO_OLD = -7, /**< The time asked for has left the ring. */
    EVS_ERR_TOO_NEW = -8, /**< The time asked for is further ahead than may be predicted. */
    EVS_ERR_GAP = -9      /**< The samples around the time asked for are too far apart. */
} evs_status_t;

/** Constant text of a status, e.g. "EVS_ERR_ARG"; "EVS_ERR_?" for a value that is none. */
const char *evs_status_name(evs_status_t status);

#define EVS_SENSOR_MAX_PX 2048u /**< Largest width and height of a sensor. */

/** One event: 8 bytes. Build and read it with the helpers below. */
typedef struct {
    uint32_t t_us;
    uint16_t x_px;
    uint16_t y_px; /**< Bits 0..14 the row, bit 15 the polarity (1 = brighter): read it with the helpers. */
} evs_event_t;

EVS_STATIC_ASSERT(sizeof(evs_event_t) == 8u, "an event is 8 bytes");

#define EVS_EVENT_POLARITY_BIT 0x8000u

static inline evs_event_t evs_event_make(uint32_t t_us, uint16_t x_px, uint16_t y_px, bool brighter)
{
    const evs_event_t ev = {t_us, x_px, (uint16_t)((y_px & 0x7FFFu) | (brighter ? EVS_EVENT_POLARITY_BIT : 0u))};
    return ev;
}
static inline uint16_t evs_event_x_px(evs_event_t ev) { return ev.x_px; }
static inline uint16_t evs_event_y_px(evs_event_t ev) { return (uint16_t)(ev.y_px & 0x7FFFu); }
static inline bool evs_event_brighter(evs_event_t ev) { return (ev.y_px & EVS_EVENT_POLARITY_BIT) != 0u; }

/** An image position in 1/16 px. Valid coordinates lie in [-EVS_POINT_MAX_Q4, EVS_POINT_MAX_Q4]. */
typedef struct {
    int16_t x_q4;
    int16_t y_q4;
} evs_point_t;

EVS_STATIC_ASSERT(sizeof(evs_point_t) == 4u, "a point is 4 bytes");

#define EVS_POINT_MAX_Q4     32752     /**< 2047 px. */
#define EVS_POINT_OUTSIDE_Q4 INT16_MIN /**< Both coordinates of the marker. */

/** The marker for "no position": off the sensor, no preimage, behind the camera, or out of range. */
static inline evs_point_t evs_point_outside(void)
{
    const evs_point_t p = {EVS_POINT_OUTSIDE_Q4, EVS_POINT_OUTSIDE_Q4};
    return p;
}
static inline bool evs_point_is_outside(evs_point_t p) { return p.x_q4 == EVS_POINT_OUTSIDE_Q4; }

/** later - earlier on the wrapping clock, in [-2^31, 2^31). */
static inline int32_t evs_time_diff_us(uint32_t later_us, uint32_t earlier_us)
{
    return (int32_t)(later_us - earlier_us);
}

/** Add to a counter that saturates instead of wrapping. */
static inline void evs_count_add(uint32_t *counter, size_t n)
{
    *counter = (n < UINT32_MAX - *counter) ? *counter + (uint32_t)n : UINT32_MAX;
}
static inline void evs_count(uint32_t *counter) { evs_count_add(counter, 1u); }

#ifdef __cplusplus
}
#endif
#endif
