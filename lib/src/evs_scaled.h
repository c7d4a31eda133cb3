/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs_scaled.h
 * @brief Private: numbers m * 2^e, for the few sums per problem whose range nobody can know beforehand.
 *
 * Normal equations span many octaves; a mantissa with an exponent keeps 30 bits wherever they lie. About 40
 * instructions an operation: for solving small systems, not for loops over data.
 */
#ifndef EVS_SCALED_H
#define EVS_SCALED_H

#include "evs/fixed.h"

/* Value m * 2^e. |m| in [2^29, 2^30], or m = 0 and e = 0. */
typedef struct {
    int32_t m;
    int32_t e;
} evs_scaled_t;

/* x * 2^e rounded to 30 bits. |e| stays far from overflow in all that the library does. */
evs_scaled_t evs_scaled(int64_t x, int32_t e);

evs_scaled_t evs_scaled_add(evs_scaled_t a, evs_scaled_t b);
evs_scaled_t evs_scaled_sub(evs_scaled_t a, evs_scaled_t b);
evs_scaled_t evs_scaled_mul(evs_scaled_t a, evs_scaled_t b);
evs_scaled_t evs_scaled_div(evs_scaled_t a, evs_scaled_t b); /* b is not 0; relative error 2^-28 */
evs_scaled_t evs_scaled_sqrt(evs_scaled_t a);                /* 0 for a negative one */

/* The number with n fractional bits, rounded, saturated. */
int32_t evs_scaled_to_q(evs_scaled_t a, int32_t n);

static inline bool evs_scaled_less(evs_scaled_t a, evs_scaled_t b) { return evs_scaled_sub(a, b).m < 0; }

#define EVS_SCALED_DIM_MAX 5u

/*
 * Solve the symmetric positive definite system a x = b of dim unknowns by LDL^T. `a` holds the lower triangle by rows
 * (a[i (i + 1) / 2 + j], j <= i) and is replaced by its factors; b by x.
 * False when a pivot falls below 2^-20 of its diagonal entry: the data leave a direction open. b is spoilt then.
 */
bool evs_scaled_solve(evs_scaled_t *a, evs_scaled_t *b, unsigned dim);

#endif
