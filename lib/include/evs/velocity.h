/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/velocity.h
 * @brief From stabilized images to the direction in which the camera flies.
 *
 *          newest image --> corners --> predicted start --> flow to a keyframe --> egomotion --> direction
 *                                            ^                     |
 *                                            +--- flow grid <------+---> baseline of the keyframes
 *
 * Model    In stabilized images, be they made of events or frames, only translation moves anything. The best corners
 *          of the newest image are tracked back to an older one (evs/keyframes.h) by pyramidal Lucas-Kanade, which
 *          starts where the flow of the previous pair predicts. A tracker finds something in any two images, near where
 *          it was told to look; so patches that are said to match must be more alike than patches that are not. The
 *          displacements give the direction by evs/egomotion.h: that of the mean velocity over the interval between the two images. It is given in the
 *          reference frame of the newest image and, where the orientation in the middle of the interval is known, in the
 *          camera frame of that time.
 * Memory   one evs_velocity_t and one block of caller memory: evs_velocity_bytes(), or for a static array
 *          EVS_VELOCITY_BYTES(). It holds the newest image, the keyframes, pyramids, tracks and recent orientations.
 * Cost     an image pair takes millions of instructions (docs/performance.md counts them), most of them for tracking.
 *          So the work is cut into steps: begin, then step after step, each of at most max_tracks tracks, while the
 *          firmware's loop moves its events on between them.
 * Numeric  integers only, bit-exact on every target. The result does not depend on how the work is cut.
 * Time     wraps; images in order of time. An image that is older than the keyframes makes them be forgotten.
 * Threads  no shared state; one context must not be entered from two threads or ISRs at once.
 */
#ifndef EVS_VELOCITY_H
#define EVS_VELOCITY_H

#include "evs/corners.h"
#include "evs/egomotion.h"
#include "evs/flow.h"
#include "evs/flow_grid.h"
#include "evs/gyro_bias.h"
#include "evs/keyframes.h"
#include "evs/orientation_track.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What a result is worth; bits of evs_velocity_result_t.flags. */
#define EVS_VELOCITY_VALID          0x01u /**< The direction may be used: not FEW, STILL, UNSOLVED or UNLIKE. */
#define EVS_VELOCITY_FEW            0x02u /**< Fewer than min_features displacements: too little texture. */
#define EVS_VELOCITY_STILL          0x04u /**< They are too short: no motion, or rotation only. */
#define EVS_VELOCITY_UNSOLVED       0x08u /**< They fit no direction, or one too unsure: see solution. */
#define EVS_VELOCITY_NO_ORIENTATION 0x10u /**< v_c_q30 is unknown (zero); v_r_q30 stands. */
#define EVS_VELOCITY_UNLIKE         0x40u /**< The images do not show the same: noise, or too long a time apart. */
#define EVS_VELOCITY_TURNED         0x20u /**< The keyframe was turned: a saccade lies between the two images. */

#define EVS_VELOCITY_TRACKS_MIN 8u
#define EVS_VELOCITY_TRACKS_MAX 4096u

typedef struct {                      /** Settings; copied by evs_velocity_init(). */
    evs_keyframes_config_t keyframes; /**< Also holds the camera of the images. */
    evs_corners_config_t corners;     /**< Its size is set from the camera. */
    evs_flow_config_t flow;           /**< Default: windows of 25 px, 5 iterations. */
    evs_egomotion_config_t egomotion; /**< The method, and what may remain of the rotation. */
    int32_t residual_rate_rad_s_q24;  /**< 1 sigma per axis of the rotation that stabilization may have left, as a rate:
                                           egomotion.rotation_sigma_rad_q28 is this times the interval, if that is more.
                                           [0, 2^24], default 0. */
    bool learn_bias; /**< Learn the gyro's bias from the rotation that it leaves, see evs/gyro_bias.h. Only where images
                          are stabilized by a gyro whose bias is not known. Default false. */
    uint16_t n_levels;  /**< Of the pyramids. [1, EVS_FLOW_LEVELS_MAX], default 2. */
    uint16_t n_tracks;  /**< Most corners tracked, [8, 4096]; 0, the default: one per cell of the corners. */
    uint16_t grid_cols; /**< Tiles of the predicted flow. Default 8 x 6. */
    uint16_t grid_rows;
    uint16_t min_features;                /**< Fewest displacements of a valid result. At least 1, default 20. */
    uint16_t min_flow_px_q8;              /**< Shortest median displacement of a valid result. Default 256 (1 px). */
    int32_t max_sigma_rad_q28;            /**< Largest sigma of a valid direction. [1, 2^30], default pi / 8. */
    uint16_t max_mismatch_q8;             /**< Largest mismatch of a valid result, see there. Default 218 (0.85). */
    uint16_t n_orientations;              /**< Orientations kept. At least 4, default 64. */
    uint32_t orientation_spacing_us;      /**< Those that follow closer are left out. [0, 100000], default 5000. */
    evs_orientation_track_config_t track; /**< Of those orientations: the time offset against the images' clock. */
} evs_velocity_config_t;

typedef struct {       /** A stabilized image. */
    const uint8_t *px; /**< width_px * height_px of the camera: evs_velocity_plane(), or yours, which is copied. */
    uint32_t t_us;     /**< The middle of its events, or of its exposure. */
    evs_quat_t q_wr;   /**< World from the reference that the image is stabilized to. Identity when there is none. */
} evs_velocity_image_t;

/** What a pair of images told. */
typedef struct {
    uint32_t t_us;        /**< The middle of the interval that the flow spans. */
    uint32_t interval_us; /**< Its length. */
    uint32_t baseline_us; /**< The length that was aimed at, see evs/keyframes.h. */
    uint32_t flags;
    evs_vec3_t v_r_q30;  /**< Unit vector of the camera's own velocity, in the reference frame of the newest image. */
    evs_vec3_t v_c_q30;  /**< The same in the camera frame at t_us. */
    evs_quat_t q_wr;     /**< World from that reference frame: q_wr rotates v_r into the world. */
    uint16_t n_corners;  /**< Corners found in the newest image. */
    uint16_t n_flow;     /**< Corners whose displacement was found. */
    uint32_t flow_px_q8; /**< Median length of the displacements, Q8 px. */
    uint16_t
        mismatch_q8; /**< Mean difference between windows that the tracks say are the same, over that between windows of
                               different tracks. 256: they are no more alike, and the tracks are chance. */
    evs_egomotion_result_t solution; /**< In the reference frame: uncertainty, inliers, flags, residual rotation. */
} evs_velocity_result_t;

/** What happened to the images so far; each counter saturates. */
typedef struct {
    uint32_t n_images;   /**< Begun. */
    uint32_t n_unpaired; /**< Without a keyframe to compare with. */
    uint32_t n_results;
    uint32_t n_valid;
    uint32_t n_turned; /**< Keyframes turned to another reference. */
} evs_velocity_counts_t;

typedef struct { /** Context. A complete type only so that you can place it: every member is private. */
    evs_velocity_config_t cfg;
    evs_keyframes_t keyframes;
    evs_corners_t corners;
    evs_flow_t flow;
    evs_flow_grid_t grid; /* image velocities of the pair before, in the reference grid_q_wr */
    evs_quat_t grid_q_wr;
    evs_orientation_track_t orientations;
    uint32_t orientation_t_us; /* of the newest that was kept */
    bool orientation_known;
    uint32_t per_fx_q32; /* 1 / focal length */
    uint32_t per_fy_q32;

    uint8_t *work; /* what the stages need by turns */
    evs_flow_track_t *tracks;
    size_t n_tracks_max;
    size_t n_tracks;
    size_t n_tracked;
    evs_pyramid_t newest;
    evs_pyramid_t older;
    evs_velocity_result_t pair; /* what is known of the result already */
    evs_gyro_bias_t bias;
    evs_vec3_t left_rad_q28; /* rotation that the bias has left in the flow of this pair */
    evs_quat_t middle_q_cr;  /* camera in the middle of the interval from reference */
    uint32_t t_us;           /* of the newest image */
    const uint8_t *older_px;
    uint32_t stage;
    evs_velocity_counts_t counts;
} evs_velocity_t;

/* Sizes of the parts of the memory; each begins at a multiple of 8 bytes. */
#define EVS_VELOCITY_PART(bytes)  (((size_t)(bytes) + 7u) / 8u * 8u)
#define EVS_VELOCITY_LARGER(a, b) (((a) > (b)) ? (a) : (b))
#define EVS_VELOCITY_TRACKS(width_px, height_px, cell_px, n_tracks)                                                    \
    (((n_tracks) == 0u) ? EVS_CORNERS_CELLS(width_px, height_px, cell_px) : (size_t)(n_tracks))
/* Shared by the stages: finding corners; the two pyramids; flow vectors, samples, lengths and scratch of the solution. */
#define EVS_VELOCITY_FIND_BYTES(width_px, height_px, cell_px, n)                                                       \
    (EVS_VELOCITY_PART((n) * sizeof(evs_corner_t)) + EVS_CORNERS_BYTES(width_px, height_px, cell_px))
#define EVS_VELOCITY_SOLVE_BYTES(n)                                                                                    \
    ((n) * (sizeof(evs_egomotion_flow_t) + sizeof(evs_flow_sample_t) + sizeof(uint32_t)) + EVS_EGOMOTION_PAPER_BYTES(n))
#define EVS_VELOCITY_WORK_BYTES(width_px, height_px, cell_px, n, n_levels)                                             \
    EVS_VELOCITY_LARGER(EVS_VELOCITY_SOLVE_BYTES(n),                                                                   \
                        EVS_VELOCITY_LARGER(EVS_VELOCITY_FIND_BYTES(width_px, height_px, cell_px, n),                  \
                                            2u * EVS_VELOCITY_PART(EVS_PYRAMID_BYTES(width_px, height_px, n_levels))))

/**
 * Bytes of memory for a size of image and settings: n_stored of the keyframes, cell_px of the corners, window_px and
 * stride_px of the flow, the others of evs_velocity_config_t. A constant expression.
 */
#define EVS_VELOCITY_BYTES(width_px, height_px, n_stored, cell_px, n_tracks, n_levels, window_px, stride_px,           \
                           n_orientations)                                                                             \
    (EVS_VELOCITY_PART(EVS_KEYFRAMES_BYTES(width_px, height_px, n_stored)) +                                           \
     EVS_VELOCITY_PART(EVS_VELOCITY_WORK_BYTES(                                                                        \
         width_px, height_px, cell_px, EVS_VELOCITY_TRACKS(width_px, height_px, cell_px, n_tracks), n_levels)) +       \
     EVS_VELOCITY_PART(EVS_VELOCITY_TRACKS(width_px, height_px, cell_px, n_tracks) * sizeof(evs_flow_track_t)) +       \
     EVS_VELOCITY_PART(EVS_FLOW_BYTES(window_px, stride_px)) +                                                         \
     EVS_VELOCITY_PART((n_orientations) * sizeof(evs_orientation_t)))

/** The same for the default settings. */
#define EVS_VELOCITY_DEFAULT_BYTES(width_px, height_px)                                                                \
    EVS_VELOCITY_BYTES(width_px, height_px, 3u, 16u, 0u, 2u, 25u, 2u, 64u)

/** Defaults for a camera after undistortion. */
evs_velocity_config_t evs_velocity_config_default(const evs_pinhole_t *pinhole);

/** Bytes of memory that evs_velocity_init() needs for these settings; 0 when they are out of range. */
size_t evs_velocity_bytes(const evs_velocity_config_t *cfg);

/**
 * Bind a context to caller memory.
 * @param[out] v        Untouched on error; the memory may have been written.
 * @param      memory   Aligned to 8 bytes, kept by reference; contents on entry do not matter.
 * @return EVS_OK, EVS_ERR_NULL, EVS_ERR_ARG (a setting is out of range, in any module) or EVS_ERR_SIZE.
 */
EVS_NODISCARD evs_status_t evs_velocity_init(evs_velocity_t *v, const evs_velocity_config_t *cfg, void *memory,
                                             size_t n_bytes);

/** Forget images, flow and orientations, as after a restart of the clock. Work under way is given up. */
void evs_velocity_reset(evs_velocity_t *v);

/** The camera's orientation, as often as it is known: what is closer than the spacing is left out. */
void evs_velocity_push_orientation(evs_velocity_t *v, const evs_orientation_t *sample);

/** The plane into which the next image can be written without a copy; NULL while an image is being worked on. */
static inline uint8_t *evs_velocity_plane(const evs_velocity_t *v)
{
    return (v->stage == 0u) ? evs_keyframes_plane(&v->keyframes) : NULL;
}

/**
 * Begin with an image.
 * @param scratch  A plane of the same size for turning a keyframe after a saccade; its contents are lost. NULL: after a
 *                 saccade keyframes are forgotten instead.
 * @return EVS_OK, EVS_ERR_NULL, or EVS_ERR_STATE: the image before is still being worked on.
 */
EVS_NODISCARD evs_status_t evs_velocity_begin(evs_velocity_t *v, const evs_velocity_image_t *image, uint8_t *scratch);

/** Whether an image is being worked on. */
static inline bool evs_velocity_busy(const evs_velocity_t *v) { return v->stage != 0u; }

/**
 * One bounded piece of the work: at most @p max_tracks (at least 1) tracks, or as much of the search for corners as takes
 * that long; or the pyramids; or the solution.
 * @return true when the result is there; only then is it written. False with nothing to do.
 */
bool evs_velocity_step(evs_velocity_t *v, size_t max_tracks, evs_velocity_result_t *result);

/**
 * The tracks of the newest result, from the newest image (from) to the keyframe (to), with their status.
 * @return how many. Valid until the next evs_velocity_begin().
 */
static inline size_t evs_velocity_tracks(const evs_velocity_t *v, const evs_flow_track_t **tracks)
{
    *tracks = v->tracks;
    return v->n_tracks;
}

/** A track as the solution saw it. */
evs_egomotion_flow_t evs_velocity_flow_of(const evs_velocity_t *v, const evs_flow_track_t *track);

/** Whether a track of the newest result agrees with its direction. */
static inline bool evs_velocity_track_is_inlier(const evs_velocity_t *v, const evs_velocity_result_t *result,
                                                const evs_flow_track_t *track)
{
    const evs_egomotion_flow_t flow = evs_velocity_flow_of(v, track);
    return (track->status == EVS_FLOW_OK) && evs_egomotion_is_inlier(&result->solution, &flow);
}

/** The gyro bias that was learnt, in the camera's frame, rad/s Q24. */
static inline evs_vec3_t evs_velocity_bias(const evs_velocity_t *v) { return v->bias.bias_q24; }

/** Begin or go on learning it; or forget it, as when the gyro's bias has been learnt elsewhere and is subtracted now. */
void evs_velocity_learn_bias(evs_velocity_t *v, bool on);

/** What happened to the images so far. */
static inline evs_velocity_counts_t evs_velocity_counts(const evs_velocity_t *v) { return v->counts; }

#ifdef __cplusplus
}
#endif
#endif
