/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  align.h
 * @brief Which constant rotations lie between an estimate and a truth that were made by two systems.
 *
 * Model    q_est(t) = left . q_ref(t) . right, up to the error that is to be measured. `left` turns the truth's world
 *          into the estimate's, `right` is the truth's body from the camera.
 *          NONE     both are identity: the truth is of the camera, in the same world.
 *          HEADING  left is a rotation about the vertical: what an estimate without a magnetometer cannot know.
 *          WORLD    left is any rotation: the truth's z is not up, or the estimate never learnt where up is.
 *          FULL     both are any rotation, by least squares over all samples.
 *          HEADING and WORLD take the mean over one second: the last one before the truth starts to turn where it rests
 *          that long, else the first. What happens later is error.
 */
#ifndef EVL_ALIGN_H
#define EVL_ALIGN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "rotation.h"

typedef enum { EVL_ALIGN_NONE = 0, EVL_ALIGN_HEADING, EVL_ALIGN_WORLD, EVL_ALIGN_FULL } evl_align_kind_t;

/** An estimate and the truth at its time. */
typedef struct {
    int64_t t_us;
    evl_quat_t est;
    evl_quat_t ref;
} evl_pair_t;

typedef struct {
    evl_align_kind_t kind;
    evl_quat_t left;
    evl_quat_t right;
    int64_t from_us, to_us; /**< The samples that decided. */
    bool at_rest;           /**< HEADING, WORLD: the truth rested then. */
    double spread_rad;      /**< FULL: how far the motion turns, rms about the axis that it turns about least. */
} evl_align_t;

/** FULL: the motion must turn at least this far about every axis, and further than the estimate errs by this factor;
 * otherwise the errors decide what is found, and `left` and `right` cannot be told apart. */
#define EVL_ALIGN_SPREAD_MIN_RAD  0.02
#define EVL_ALIGN_SPREAD_PER_RMSE 3.0

/** @param n  At least 1. */
evl_align_t evl_align(evl_align_kind_t kind, const evl_pair_t *pair, size_t n);

/** Whether the motion told what FULL was to find. @param rmse_rad  What is left after the alignment. */
bool evl_align_is_told(const evl_align_t *align, double rmse_rad);

/** The truth as the estimate would see it: left . ref . right. */
evl_quat_t evl_align_apply(const evl_align_t *align, evl_quat_t ref);

#endif
