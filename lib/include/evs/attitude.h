/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/attitude.h
 * @brief Orientation from gyroscope, accelerometer and, if there is one, magnetometer.
 *
 * Model    The gyro is integrated; everything else only trims it. The raw acceleration, turned into the world, passes
 *          a second-order low-pass there: in a frame that does not rotate, the carrier's own acceleration averages out,
 *          because its integral is a velocity and so is bounded [1]. What is left is gravity, and the low-pass's slope
 *          is the rate at which the estimate is tilted towards it. The heading is a scalar, corrected after the tilt,
 *          so that the magnetometer can never tilt the horizon; a field that changes strength or dip is not believed.
 *          Gyro bias is learnt while the carrier lies still. docs/modules/attitude.md derives it.
 *          Corrections act as a rate, spread over the gyro samples: the orientation never steps after the start.
 * Memory   caller-owned: one evs_attitude_t (at most 256 bytes). No heap, no globals.
 * Cost     docs/performance.md: instructions per push, counted. No division, no loop over more than a few samples.
 * Numeric  integers only, bit-exact on every target. Quaternions Q30, gyro Q24 rad/s (+-128), acceleration Q20 m/s^2
 *          (+-2048), field Q16 uT, delta angles Q30 rad (+-2). Sums saturate.
 * Threads  no shared state; one context must not be entered from two threads or ISRs at once.
 *
 * Frames   World: z up; with a magnetometer x east, y north (magnetic, or true with the declination set), else the
 *          heading starts at 0. q_wi turns IMU vectors into the world. An accelerometer at rest reads +g upwards.
 * Time     uint32_t us, wraps. Each sensor has a clock of its own here: rates may differ and change, and samples may
 *          come in any order between sensors. Within one sensor time must advance; a sample whose time does not is
 *          counted and left out (several in a row: the clock was restarted, and the new one is adopted).
 *          Samples of one sensor may lie up to 35 min apart without confusing it; see gap_max_ms.
 * Bad data A zero vector, a value off any sensor's scale, a spike of one gyro sample, a clipped sensor, a gap: each is
 *          counted or flagged, and never does lasting harm. Nothing here can produce a quaternion that is not of unit
 *          length.
 *
 * [1] D. Laidig, T. Seel, "VQF: Highly accurate IMU orientation estimation with bias estimation and magnetic
 *     disturbance rejection", Information Fusion 91, 2023. doi:10.1016/j.inffus.2022.10.014
 * [2] R. Valenti, I. Dryanovski, J. Xiao, "Keeping a Good Attitude: A Quaternion-Based Orientation Filter for IMUs and
 *     MARGs", Sensors 15(8), 2015. doi:10.3390/s150819302
 */
#ifndef EVS_ATTITUDE_H
#define EVS_ATTITUDE_H

#include "evs/types.h"
#include "evs/vec.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EVS_ATTITUDE_DELTA_MIN_US 50u    /**< Shortest and */
#define EVS_ATTITUDE_DELTA_MAX_US 20000u /**< longest increment of evs_attitude_push_delta_angle(). */

/** Which filter. */
typedef enum {
    EVS_ATTITUDE_FILTER = 0,    /**< The one described above. */
    EVS_ATTITUDE_GYRO_ONLY = 1, /**< Integration alone, from the orientation given or from identity. Accelerations only
                                     serve to tell rest, where the bias is learnt. */
    EVS_ATTITUDE_VALENTI = 2    /**< The complementary filter of [2], for comparison. Its gains per sample are turned
                                     into time constants: a gain of 0.01 at 286 Hz is a tau of 350 ms. */
} evs_attitude_mode_t;

/** Settings; copied by evs_attitude_init(). Start from evs_attitude_config_default(). */
typedef struct {
    evs_attitude_mode_t mode; /**< Default EVS_ATTITUDE_FILTER. */

    /** A rate of this size or more, on any axis, is taken as clipped. rad/s Q24; 0 (default): found from the data, as
        the largest value if it repeats unchanged. Else [1 rad/s, 128 rad/s). */
    int32_t gyro_limit_rad_s_q24;

    /** Added to the magnetic heading: positive where the needle points east of true north. Binary angle (2^32 = one
        turn); default 0. */
    int32_t declination;

    uint16_t tau_accel_ms;   /**< Tilt: time constant of the low-pass. Longer trusts the gyro more: sustained turns and
                                  climbs tilt less, bias tilts more. [100, 60000], default 3000. */
    uint16_t tau_mag_ms;     /**< Heading: time constant of its correction. [100, 60000], default 15000. */
    uint16_t tau_recover_ms; /**< What both shrink to while the gyro is clipped and after a gap; then they grow back
                                  by 1 s each second. [50, 10000], default 600. */
    uint16_t gap_max_ms;     /**< A longer pause between gyro samples is not bridged: the orientation stays, and
                                  recovers from the other sensors. [20, 1000], default 250. */
    uint16_t accel_max_m_s2; /**< A component above it is not a measurement: the sample is counted and left out. Set it
                                  well above full scale: clipped samples must come in, they balance.
                                  [20, 2000], default 400. */
    uint16_t rest_time_ms;   /**< Stillness before the carrier counts as at rest. [200, 30000], default 1500. */
    uint16_t rest_gyro_mrad_s; /**< Largest departure from the running mean at rest, per axis. [1, 1000], default 35. */
    uint16_t rest_accel_mm_s2; /**< The same for the acceleration. [10, 10000], default 500. */
    uint16_t bias_max_mrad_s;  /**< Largest bias per axis; a faster turn is never taken for one. [1, 500],
                                    default 100. */
    uint16_t mag_tolerance_permille; /**< Largest departure of the field from the undisturbed one, horizontal and
                                          vertical part together, relative to its strength. [10, 1000], default 120. */
    bool learn_bias;                 /**< Learn the gyro bias at rest. Default true. */
    bool reject_mag;                 /**< Disbelieve a disturbed field, for up to a minute. Default true. */
    bool valenti_adaptive; /**< EVS_ATTITUDE_VALENTI: less gain while the acceleration is not g. Default false. */
} evs_attitude_config_t;

/* What evs_attitude_flags() tells, or-ed together. */
#define EVS_ATTITUDE_TILT_KNOWN     UINT32_C(0x001) /**< The horizon was found, or the orientation was given. */
#define EVS_ATTITUDE_HEADING_KNOWN  UINT32_C(0x002) /**< North was found, or the orientation was given. */
#define EVS_ATTITUDE_SETTLING       UINT32_C(0x004) /**< Still averaging since the start (one tau_accel_ms). */
#define EVS_ATTITUDE_AT_REST        UINT32_C(0x008) /**< Has been still for rest_time_ms. */
#define EVS_ATTITUDE_BIAS_KNOWN     UINT32_C(0x010) /**< The bias was learnt, or given. */
#define EVS_ATTITUDE_GYRO_SATURATED UINT32_C(0x020) /**< The newest gyro sample was clipped. */
#define EVS_ATTITUDE_RECOVERING                                                                                        \
    UINT32_C(0x040)                                /**< Time constants are shortened: after the first field, clipping  \
                                                        or a gap. */
#define EVS_ATTITUDE_MAG_DISTURBED UINT32_C(0x080) /**< The newest field does not fit the undisturbed one. */
#define EVS_ATTITUDE_ACCEL_BAD     UINT32_C(0x100) /**< The newest acceleration was left out. */
#define EVS_ATTITUDE_MAG_BAD       UINT32_C(0x200) /**< The newest field was left out. */

/** Bad samples since evs_attitude_init() or evs_attitude_reset(); each counter stops at its largest value. */
typedef struct {
    uint32_t n_gyro_saturated; /**< Clipped: used, and followed by quicker correction. */
    uint32_t n_gyro_spikes;    /**< One sample far off both neighbours: taken back when the next one arrived. */
    uint32_t n_gyro_gaps;      /**< Pauses longer than gap_max_ms. */
    uint32_t n_accel_bad;      /**< Zero, above accel_max_m_s2, or one sample far off gravity between ones near it:
                                    left out, the latter taken back when the next one arrived. */
    uint32_t n_mag_bad;        /**< Zero, above 4096 uT, or four times the usual field: left out. */
    uint32_t n_time_bad;       /**< Time did not advance within its sensor: left out. */
} evs_attitude_faults_t;

/** Context. A complete type only so that you can place it: every member is private. */
typedef struct {
    evs_attitude_config_t cfg;
    evs_quat_t q;            /* world from IMU */
    evs_vec3_t bias_q30;     /* rad/s */
    evs_vec3_t rate_q24;     /* newest rate less bias, rad/s */
    evs_vec3_t correct_q24;  /* rate of correction, world frame, rad/s */
    evs_vec3_t slope_q24;    /* second state of the acceleration's low-pass: tau times the slope, world, m/s^2 */
    int32_t gravity_q24;     /* first state: its x and y are zero by construction, m/s^2 */
    int32_t w_accel_q24;     /* 1 / tau of the low-pass; while settling 1 / elapsed time; 1/s */
    int32_t w_mag_q24;       /* 1 / tau of the heading, 1/s */
    evs_vec3_t gyro_lp_q24;  /* running mean of the raw rate, rad/s */
    evs_vec3_t accel_lp_q20; /* running mean of the raw acceleration, IMU frame, m/s^2 */
    evs_vec3_t mag_lp_q16;   /* running mean of the field, world frame, uT; 0 0 0 = none yet */
    int32_t field_h_q16, field_v_q16; /* the undisturbed field: horizontal, vertical, uT; 0 0 = none yet */
    int32_t other_h_q16, other_v_q16; /* a candidate to replace it */
    uint32_t gyro_max_q24;            /* largest rate seen, rad/s */
    int32_t bias_step_q31;            /* how far the bias may have moved since it was learnt, rad/s */
    uint32_t t_gyro_us, t_accel_us, t_mag_us;
    uint32_t rest_us; /* stillness so far */
    uint32_t field_ok_us, field_bad_us, other_us;
    evs_attitude_faults_t faults;
    uint32_t flags;
    uint16_t dt_gyro_us;       /* usual interval */
    uint16_t dt_newest_us;     /* what the newest rate was applied for */
    int16_t accel_ref_q7[3];   /* where the mean acceleration was when stillness began, m/s^2 */
    int16_t rate_before_q8[3]; /* the rate before one that jumped, rad/s */
    int16_t shock_q4[3];       /* an acceleration on trial, less gravity, m/s^2; 0 0 0 = none */
    uint8_t n_repeats;
    uint8_t n_time_back[3]; /* in a row: gyro, accelerometer, magnetometer */
} evs_attitude_t;

EVS_STATIC_ASSERT(sizeof(evs_attitude_t) <= 256u, "the context has outgrown what its documentation promises");

/** The defaults, the same for every sensor and rate. */
evs_attitude_config_t evs_attitude_config_default(void);

/**
 * Start: orientation unknown, bias 0.
 * @param[out] att  Untouched on error.
 * @return EVS_OK, EVS_ERR_NULL or EVS_ERR_ARG (a field of @p cfg is out of its range).
 */
EVS_NODISCARD evs_status_t evs_attitude_init(evs_attitude_t *att, const evs_attitude_config_t *cfg);

/** Start over with the same settings; the bias is forgotten too (save it first with evs_attitude_bias()). */
void evs_attitude_reset(evs_attitude_t *att);

/**
 * One gyro sample: the orientation moves to @p t_us. The first one only sets the clock.
 * Cost: the largest part of the filter, no division; a gap is bridged in steps of 20 ms.
 * @param rate_rad_s_q24  The rate over the interval that ends at @p t_us. After lost samples the mean of this one and
 *                        the one before bridges the gap.
 */
void evs_attitude_push_gyro(evs_attitude_t *att, uint32_t t_us, evs_vec3_t rate_rad_s_q24);

/**
 * The same for IMUs that integrate themselves: the rotation from @p t_us - @p dt_us to @p t_us.
 * @param angle_rad_q30  Rotation vector. Integrals of each axis do as well while the axis moves little in between.
 * @param dt_us          [EVS_ATTITUDE_DELTA_MIN_US, EVS_ATTITUDE_DELTA_MAX_US]; else the sample is counted as one of
 * bad time.
 */
void evs_attitude_push_delta_angle(evs_attitude_t *att, uint32_t t_us, evs_vec3_t angle_rad_q30, uint32_t dt_us);

/**
 * One accelerometer sample (specific force: +g upwards at rest). The first one levels the estimate at once; later ones
 * set the rate at which coming gyro samples correct it.
 */
void evs_attitude_push_accel(evs_attitude_t *att, uint32_t t_us, evs_vec3_t accel_m_s2_q20);

/**
 * One magnetometer sample, calibrated. The first one after an accelerometer sample turns the estimate to north at
 * once; later ones as for the acceleration.
 */
void evs_attitude_push_mag(evs_attitude_t *att, uint32_t t_us, evs_vec3_t field_ut_q16);

/**
 * Give the orientation, at the start or later. It counts as true: no settling follows.
 * @param q_wi  Of any length but zero; normalized here.
 * @return EVS_OK or EVS_ERR_NUMERIC (all components zero; nothing changed).
 */
EVS_NODISCARD evs_status_t evs_attitude_set_orientation(evs_attitude_t *att, evs_quat_t q_wi);

/** World from IMU at the newest gyro sample. Unit length within 2^-28. Identity before anything is known. */
evs_quat_t evs_attitude_orientation(const evs_attitude_t *att);

/** Newest rate less bias, in the IMU's frame, rad/s Q24. */
evs_vec3_t evs_attitude_rate(const evs_attitude_t *att);

/** Gyro bias, rad/s Q24: save it at shut-down ... */
evs_vec3_t evs_attitude_bias(const evs_attitude_t *att);

/**
 * ... and give it back at the next start. Learning at rest goes on from there.
 * @return EVS_OK or EVS_ERR_ARG (a component beyond bias_max_mrad_s; nothing changed).
 */
EVS_NODISCARD evs_status_t evs_attitude_set_bias(evs_attitude_t *att, evs_vec3_t bias_rad_s_q24);

/** EVS_ATTITUDE_... flags. */
uint32_t evs_attitude_flags(const evs_attitude_t *att);

/** The rest detector: true while the carrier has been still for rest_time_ms. */
bool evs_attitude_at_rest(const evs_attitude_t *att);

/** Bad samples so far, by cause. */
evs_attitude_faults_t evs_attitude_faults(const evs_attitude_t *att);

#ifdef __cplusplus
}
#endif
#endif
