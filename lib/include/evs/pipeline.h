/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/pipeline.h
 * @brief The modules wired together for the common case: IMU and events in, stabilized events and windows out.
 *
 *          gyro, accel, mag --> attitude --> orientation track --+
 *                                                                v
 *          events --> FIFO --> undistort --> window --> stabilize --> chunks
 *                                                          |
 *                                     (warp) --> image --> velocity: corners, flow, egomotion
 *
 * Model    Push samples as they come; pull chunks until there are none. A chunk is a run of consecutive events of one
 *          window, undistorted and rotated to the reference orientation. An event waits in the FIFO until the
 *          orientation of its time slice is known (half a slice and one gyro sample, about 2 ms); when the gyro falls
 *          behind by max_wait_us or the FIFO is full, a short prediction serves. What is still unknown then comes out
 *          with oriented = false and EVS_POINT_OUTSIDE, and is counted.
 *          The view is held by the gyro. The attitude filter also corrects itself, by tens of degrees a second when it
 *          is switched on in motion; in the view that would be a rotation that never happened. So once horizon and north are
 *          found, the orientation of the view integrates the filter's unbiased rate, and approaches the filter's
 *          orientation with the time constant view_tau_ms. What the filter finds out while it settles would still be a
 *          turn of degrees a second then: that part the view takes over by at most view_rate_max_mrad_s.
 * Memory   one evs_pipeline_t and one block of caller memory: evs_pipeline_bytes(), or for a static array
 *          EVS_PIPELINE_BYTES(). For 240 x 180 with a grid of step 8, 34 x 26 tiles, 2048 events, 32 orientations and
 *          batches of 128: 23432 bytes, and the context of about 1 KB. With images and the direction of flight
 *          EVS_PIPELINE_VELOCITY_BYTES() more: 275 KB in all.
 * Cost     per event undistort + window + rotate, per slice a new orientation; for images a vote per event, and per window
 *          their rendering within the pull that closes it: docs/performance.md counts them.
 * Numeric  integers only, bit-exact on every target. The output does not depend on how the input is split into calls,
 *          as long as no prediction is needed.
 * Time     Events in order (equal times allowed), each sensor in order. An event whose time runs back is dropped and
 *          counted; see evs/clock.h for how a restarted clock is recognized. Gaps up to 35 min.
 * Threads  no shared state; one context must not be entered from two threads or ISRs at once.
 */
#ifndef EVS_PIPELINE_H
#define EVS_PIPELINE_H

#include "evs/attitude.h"
#include "evs/camera.h"
#include "evs/clock.h"
#include "evs/iwe.h"
#include "evs/orientation_track.h"
#include "evs/stabilize.h"
#include "evs/surface.h"
#include "evs/tiles.h"
#include "evs/undistort.h"
#include "evs/velocity.h"
#include "evs/warp.h"
#include "evs/window.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Where orientations come from. */
typedef enum {
    EVS_PIPELINE_IMU = 0,         /**< The attitude filter, from pushed gyro, accelerometer, magnetometer samples. */
    EVS_PIPELINE_ORIENTATION = 1, /**< The caller: an autopilot's estimate, motion capture. */
    EVS_PIPELINE_NONE = 2         /**< Nowhere: events are undistorted and cut into windows, but not rotated. */
} evs_pipeline_source_t;

/** What a window becomes. */
typedef enum {
    EVS_PIPELINE_IMAGE_NONE = 0,
    EVS_PIPELINE_IMAGE_COUNT = 1,  /**< Events per pixel: evs/iwe.h with the nearest vote and no smoothing. */
    EVS_PIPELINE_IMAGE_IWE = 2,    /**< Image of warped events: smoothed and scaled, evs/iwe.h. */
    EVS_PIPELINE_IMAGE_SURFACE = 3 /**< Time surface, evs/surface.h. */
} evs_pipeline_image_t;

/** How the points of a window are moved along the flow, all to one time, before they are voted. */
typedef enum {
    EVS_PIPELINE_WARP_NONE = 0,
    EVS_PIPELINE_WARP_PREDICTED = 1, /**< By the flow of an image pair before: streaming. Needs velocity_on. */
    EVS_PIPELINE_WARP_GLOBAL = 2, /**< By the one flow that makes the window sharpest; needs all its events at once. */
    EVS_PIPELINE_WARP_TILED = 3   /**< By such a flow per tile; needs all its events at once. */
} evs_pipeline_warp_t;

typedef struct {                /** Settings; copied by evs_pipeline_init(). */
    evs_camera_config_t camera; /**< Lens and sensor. */
    uint16_t table_step_px;     /**< Undistortion table: 1 (exact), or a grid of 2, 4, .. 32. Default 1. */
    const evs_point_t *table;   /**< A table in flash (`evstab lut`) for that step; NULL: build one in memory. */
    size_t n_table;             /**< Its points. */
    bool tile_table;            /**< Keep the tile of each pixel too: 2 bytes a pixel, saves 10 instructions
                                     per event. Default false. */
    uint16_t n_cols;            /**< Tiles of the area count. Default 34 x 26. */
    uint16_t n_rows;
    evs_window_config_t window;     /**< Default: area count, threshold 200. */
    evs_pipeline_source_t source;   /**< Default IMU. */
    evs_attitude_config_t attitude; /**< Source IMU. */
    evs_quat_t q_ci;                /**< Source IMU: camera from IMU, unit. Default identity. */
    uint32_t view_tau_ms;           /**< Source IMU: time constant with which the view takes over corrections of
                                               the attitude, see Model. 0: at once. [0, 100000], default 10000. */
    uint16_t view_rate_max_mrad_s;  /**< Source IMU: how fast the view gives up, per axis, what it keeps from before
                                               the attitude had settled, see Model. 0: at once, then by view_tau_ms.
                                               [0, 1000], default 4. */
    evs_orientation_track_config_t track; /**< Among others the time offset of the orientations against the events. */
    evs_stabilize_config_t stabilize;     /**< Its pinhole is set from the camera by evs_pipeline_init(). */
    uint32_t max_wait_us;                 /**< Longest wait for an orientation, by the events' clock. [0, 10^6], default
                                               20000. */
    size_t n_fifo;                        /**< Events that can wait. [2, 2^24], default 2048. */
    size_t n_ring;                        /**< Orientations kept. At least 4, default 32. */
    size_t n_batch;                       /**< Most events in a chunk. [1, n_fifo], default 128. */
    evs_pipeline_image_t image;           /**< Default NONE. */
    evs_iwe_config_t iwe;                 /**< Image COUNT, IWE; its size is set from the camera. */
    evs_surface_config_t surface;         /**< Image SURFACE; its size is set from the camera. */
    evs_pipeline_warp_t warp;             /**< Image COUNT, IWE. Default NONE. */
    evs_warp_config_t warp_search;        /**< Warp GLOBAL, TILED: its kind and size are set by init. Default that of
                                               evs/warp.h for TILED. */
    size_t n_warp_events;           /**< Warp GLOBAL, TILED: events of a window that are kept, [1, 2^24]. Those that
                                               are too many are left out of the image, and counted. Default 0. */
    bool velocity_on;               /**< Measure the direction of flight; needs an image. Default false. */
    evs_velocity_config_t velocity; /**< Its pinhole is set from the camera, its time offset from the track; learn_bias
                                         counts with source IMU while the filter does not know the bias. */
} evs_pipeline_config_t;

/** A run of consecutive events of one window. The arrays stay valid until the next call with this context. */
typedef struct {
    const evs_event_t *events; /**< As pushed. */
    const evs_point_t *undistorted;
    const evs_point_t *stabilized;
    size_t n;             /**< May be 0 when the chunk only tells that a window closed. */
    uint32_t window;      /**< Index of the window that they belong to. */
    bool oriented;        /**< false: orientation unknown, every stabilized point is outside. */
    bool saccade;         /**< The window began with a saccade. */
    evs_quat_t q_rc;      /**< Reference from camera at the window's first event that has an orientation. */
    evs_window_end_t end; /**< reason EVS_WINDOW_OPEN, or the window closed after these events. */
    evs_image_t image;    /**< When the window closed: its image, if there is one; else px is NULL. */
    uint32_t image_t_us;  /**< Its time: the middle of the window, or the time to which a warp has moved the events. */
} evs_pipeline_chunk_t;

/** What happened to the input so far; each counter saturates. */
typedef struct {
    uint32_t n_events;            /**< Taken into the FIFO. */
    uint32_t n_time_back;         /**< Events dropped: time ran back. */
    uint32_t n_restarts;          /**< Restarts of the events' clock. */
    uint32_t n_off_sensor;        /**< Events off the sensor; they come out as outside. */
    uint32_t n_unoriented;        /**< Events whose orientation stayed unknown. */
    uint32_t n_orientations_back; /**< Orientations (gyro samples) dropped: time ran back. */
    uint32_t n_images;            /**< Images made. */
    uint32_t n_images_incomplete; /**< Windows without an image: flushed, restarted, or orientation unknown. */
    uint32_t n_unwarped;          /**< Events left out of an image: n_warp_events were kept already. */
    uint32_t n_images_busy;       /**< Windows without an image: velocity was still at work on the one before. */
} evs_pipeline_counts_t;

typedef struct
{ /** The part of the context that makes images; in the memory block, and only if there is one. Private. */
    evs_iwe_t iwe;
    evs_surface_t surface;
    evs_velocity_t velocity;
    evs_warp_t search;
    evs_flow_grid_t flow; /* what the open window is warped by */
    evs_quat_t flow_q_wr; /* the reference that it is seen from */
    uint8_t *plane;       /* of the image, or for turning keyframes */
    uint8_t *votes;       /* the memory of the IWE */
    evs_point_t *warped;  /* a batch, or the points of a window */
    evs_event_t *events;  /* of that window */
    size_t n_kept;        /* of them */
    uint32_t duration_us; /* of the window before */
    uint32_t t_warp_us;   /* the time to which the open window is warped */
    bool warping;         /* the open window is being warped */
    bool bias_known;      /* what images show is stabilized by a gyro whose bias is known */
    bool empty;           /* no event of the open window has been voted yet */
} evs_pipeline_imaging_t;

typedef struct { /** Context. A complete type only so that you can place it: every member is private. */
    evs_pipeline_config_t cfg;
    evs_attitude_t attitude;
    evs_quat_t view_q_wc; /* newest orientation of the view, and its time */
    uint32_t view_t_us;
    uint32_t view_known;          /* whether horizon and north were, then: flags of the attitude */
    evs_vec3_t view_rate_q24;     /* of the camera, then */
    evs_quat_t view_kept_q;       /* attitude from view: what the view keeps to itself */
    uint64_t view_per_us_q50;     /* 1 / view_tau_ms */
    uint64_t view_max_per_us_q62; /* half of view_rate_max_mrad_s */
    uint32_t bias_known_us;       /* since when the attitude knows the gyro's bias, by the events' clock */
    bool bias_known;
    evs_orientation_track_t track;
    evs_undistort_t undistort;
    evs_window_t window;
    evs_stabilize_t stabilize;
    evs_clock_t clock;
    evs_pipeline_counts_t counts;
    evs_pipeline_imaging_t *imaging; /* NULL: no images */

    evs_event_t *fifo; /* ring */
    size_t fifo_first;
    size_t fifo_used;
    evs_point_t *undistorted; /* of the block: events at the head of the FIFO that are undistorted already */
    evs_point_t *stabilized;
    uint16_t *tiles;
    size_t block_used;
    size_t block_at; /* how many of the block have been handed out */

    uint32_t slice_first_us;
    uint32_t slice_us; /* 0: no slice yet */
    evs_vec3_t slice_rate_rad_s_q24;
    bool slice_oriented;
    bool window_oriented; /* the open window has been given to stabilize */
    bool window_saccade;
    evs_quat_t window_q_rc;
    bool finishing;
    bool restarting;
} evs_pipeline_t;

/* Each part of the memory block begins at a multiple of 8 bytes. */
#define EVS_PIPELINE_PART(bytes) (((size_t)(bytes) + 7u) / 8u * 8u)

/**
 * Bytes of memory for a sensor and capacities. A constant expression: `static uint64_t memory[EVS_PIPELINE_BYTES(...) /
 * 8]`.
 * @p step_px 0 stands for a table in flash. @p n_tiles is n_cols * n_rows, or 0 unless windows are by area.
 */
#define EVS_PIPELINE_BYTES(width_px, height_px, step_px, tile_table, n_tiles, n_fifo, n_ring, n_batch)                 \
    (EVS_PIPELINE_PART((n_fifo) * sizeof(evs_event_t)) + EVS_PIPELINE_PART((n_ring) * sizeof(evs_orientation_t)) +     \
     2u * EVS_PIPELINE_PART((n_batch) * sizeof(evs_point_t)) + EVS_PIPELINE_PART((n_batch) * sizeof(uint16_t)) +       \
     EVS_PIPELINE_PART((n_tiles) * sizeof(uint16_t)) +                                                                 \
     EVS_PIPELINE_PART(((step_px) == 0u)                                                                               \
                           ? 0u                                                                                        \
                           : EVS_UNDISTORT_POINTS(width_px, height_px, ((step_px) == 0u) ? 1u : (step_px)) *           \
                                 sizeof(evs_point_t)) +                                                                \
     EVS_PIPELINE_PART((tile_table) ? EVS_UNDISTORT_TILES(width_px, height_px) * sizeof(uint16_t) : 0u))

/**
 * What to add for images. A constant expression.
 * @p image, @p warp, @p velocity_on as in the settings; @p vote and @p n_batch as there, too. With velocity_on EVS_VELOCITY_BYTES()
 * comes on top, and for the warps GLOBAL and TILED EVS_PIPELINE_WARP_BYTES().
 */
#define EVS_PIPELINE_IMAGE_BYTES(width_px, height_px, image, vote, warp, velocity_on, n_batch)                         \
    (EVS_PIPELINE_PART(sizeof(evs_pipeline_imaging_t)) +                                                               \
     EVS_PIPELINE_PART(((image) == EVS_PIPELINE_IMAGE_SURFACE) ? EVS_SURFACE_BYTES(width_px, height_px)                \
                                                               : EVS_IWE_BYTES(width_px, height_px, vote)) +           \
     EVS_PIPELINE_PART(                                                                                                \
         ((velocity_on) && ((image) != EVS_PIPELINE_IMAGE_SURFACE)) ? 0u : EVS_IMAGE_BYTES(width_px, height_px)) +     \
     EVS_PIPELINE_PART(((warp) == EVS_PIPELINE_WARP_PREDICTED) ? (n_batch) * sizeof(evs_point_t) : 0u))

/** What to add for the warps GLOBAL and TILED; the last three as in warp_search. A constant expression. */
#define EVS_PIPELINE_WARP_BYTES(width_px, height_px, n_warp_events, n_budget, max_px, shift)                           \
    (EVS_PIPELINE_PART((n_warp_events) * sizeof(evs_event_t)) +                                                        \
     EVS_PIPELINE_PART((n_warp_events) * sizeof(evs_point_t)) +                                                        \
     EVS_PIPELINE_PART(EVS_WARP_BYTES(width_px, height_px, n_budget, max_px, shift)))

/** What to add for evs_pipeline_config_velocity() as it is: images of warped events and the direction of flight. */
#define EVS_PIPELINE_VELOCITY_BYTES(width_px, height_px)                                                               \
    (EVS_PIPELINE_IMAGE_BYTES(width_px, height_px, EVS_PIPELINE_IMAGE_IWE, EVS_IWE_NEAREST, EVS_PIPELINE_WARP_NONE,    \
                              true, 0u) +                                                                              \
     EVS_PIPELINE_PART(EVS_VELOCITY_DEFAULT_BYTES(width_px, height_px)))

/** Defaults for a camera: no image, no velocity, the windows of the paper. */
evs_pipeline_config_t evs_pipeline_config_default(const evs_camera_config_t *camera);

/**
 * Defaults for measuring the direction of flight: images of warped events, no warp, windows by area that close with the
 * 12th event per pixel of a tile, after 5 to 50 ms, a residual rotation rate of 0.002 rad/s, and learn_bias.
 */
evs_pipeline_config_t evs_pipeline_config_velocity(const evs_camera_config_t *camera);

/** Bytes of memory that evs_pipeline_init() needs for these settings; 0 when they are out of range. */
size_t evs_pipeline_bytes(const evs_pipeline_config_t *cfg);

/**
 * Bind a context to caller memory, build the undistortion table unless one is given, and wait for samples.
 * @param[out] p        Untouched on error; the memory may have been written.
 * @param      memory   Aligned to 8 bytes, kept by reference; contents on entry do not matter.
 * @param      n_bytes  At least evs_pipeline_bytes(cfg).
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (a setting is out of range, in any module), EVS_ERR_SIZE, or
 *         EVS_ERR_NUMERIC (the lens model cannot be inverted).
 */
EVS_NODISCARD evs_status_t evs_pipeline_init(evs_pipeline_t *p, const evs_pipeline_config_t *cfg, void *memory,
                                             size_t n_bytes);

/** Source IMU: one sample each, in SI units as evs/attitude.h. A gyro sample is what makes an orientation known. */
void evs_pipeline_push_gyro(evs_pipeline_t *p, uint32_t t_us, evs_vec3_t rate_rad_s_q24);
void evs_pipeline_push_accel(evs_pipeline_t *p, uint32_t t_us, evs_vec3_t accel_m_s2_q20);
void evs_pipeline_push_mag(evs_pipeline_t *p, uint32_t t_us, evs_vec3_t field_ut_q16);

/** Source ORIENTATION: the camera's orientation and rate at a time. @return as evs_orientation_track_push(). */
evs_status_t evs_pipeline_push_orientation(evs_pipeline_t *p, const evs_orientation_t *sample);

/**
 * Take events into the FIFO.
 * @return how many, from the first on; fewer than @p n when the FIFO is full or the clock of the events restarts: pull
 *         until there is nothing left, then push the rest again. Events dropped for their time count as taken.
 */
size_t evs_pipeline_push_events(evs_pipeline_t *p, const evs_event_t *ev, size_t n);

/** The next chunk. @return false when nothing can be said yet (chunk untouched). */
bool evs_pipeline_pull(evs_pipeline_t *p, evs_pipeline_chunk_t *chunk);

/**
 * End of the stream: evs_pipeline_pull() no longer waits for orientations, and closes the last window
 * (EVS_WINDOW_BY_FLUSH). The next push begins a new stream with the same attitude and reference.
 */
void evs_pipeline_finish(evs_pipeline_t *p);

/**
 * Work on the newest image: one bounded piece, at most @p max_tracks (at least 1) tracks. Call it between pulls; a window
 * that closes while an image is being worked on gives none. The result does not depend on max_tracks, as long as no
 * image is left out.
 * @return true when a result is there; only then is it written. False with nothing to do, or without velocity_on.
 */
bool evs_pipeline_velocity(evs_pipeline_t *p, size_t max_tracks, evs_velocity_result_t *result);

/** Whether an image is being worked on: evs_pipeline_velocity() has something to do. */
bool evs_pipeline_velocity_busy(const evs_pipeline_t *p);

/** The part that measures the direction, for its tracks and counters; NULL without velocity_on. */
const evs_velocity_t *evs_pipeline_velocity_part(const evs_pipeline_t *p);

/** Newest orientation of the camera as the view uses it, in the time of its own clock. @return EVS_OK or EVS_ERR_STATE (none yet). */
EVS_NODISCARD evs_status_t evs_pipeline_newest_orientation(const evs_pipeline_t *p, evs_orientation_t *newest);

/** The attitude filter, for its flags, bias and counters (read) or to give it an initial orientation and bias. */
static inline evs_attitude_t *evs_pipeline_attitude(evs_pipeline_t *p) { return &p->attitude; }

/**
 * Source IMU: the gyro bias as far as it is known, in the IMU's frame, rad/s Q24: the filter's, and what the flow tells
 * beyond it (velocity.learn_bias). Save it for evs_attitude_set_bias() at the next start.
 */
evs_vec3_t evs_pipeline_gyro_bias(const evs_pipeline_t *p);

/** What happened to the input so far. */
evs_pipeline_counts_t evs_pipeline_counts(const evs_pipeline_t *p);

#ifdef __cplusplus
}
#endif
#endif
