/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs_egomotion_private.h
 * @brief Private: what the parts of the ego-motion solver share.
 *
 * Formats. Positions (x, y, 1) are int16 with 1 = 2^(one_bits + 1); products with a unit vector in Q15, divided by
 * 2^16, have one_bits fractional bits. With one_bits = 13, 12, 11 positions reach 2, 4, 8, and each such product fits
 * an int16. Flow is int16 in steps of which the median length has 2^10; longer than 8 medians is shortened to that, so
 * that an outlier does not eat the bits of the others.
 *
 * Names, for a direction V: a = (x Vz - Vx, y Vz - Vy), the direction of the flow; c = u ay - v ax and d = u ax + v ay,
 * its components across and along, times |a|; r = c / |a| is the residual, d / |a|^2 the inverse depth rho.
 */
#ifndef EVS_EGOMOTION_PRIVATE_H
#define EVS_EGOMOTION_PRIVATE_H

#include "evs/egomotion.h"
#include "evs_scaled.h"

/* Short loops over the unknowns: unrolled, their sums stay out of arrays. */
#if defined(__GNUC__) && !defined(__clang__)
#define EVS_EGO_UNROLL _Pragma("GCC unroll 5")
#else
#define EVS_EGO_UNROLL
#endif

enum {
    EVS_EGO_MEDIAN_BITS = 10, /* median flow length: 2^10 steps */
    EVS_EGO_CLIP = 8 << EVS_EGO_MEDIAN_BITS,
    EVS_EGO_SUBSET = 128, /* vectors that the search looks at */
    EVS_EGO_INV_BITS = 14 /* of 1 / |a|^2 */
};

#define EVS_EGO_ROTATION_MAX (INT32_C(1) << 29) /* 2 rad */

typedef struct {
    int16_t x;
    int16_t y;
    int16_t u;
    int16_t v;
} evs_ego_vector_t;

/* For which V a vector fits, as the search asks it: its products with a and b are both positive. The pairs are read as
 * words: the scratch is aligned to 4. */
typedef struct {
    int16_t a_xy[EVS_EGO_SUBSET][2];
    int16_t b_xy[EVS_EGO_SUBSET][2];
    int16_t a_z[EVS_EGO_SUBSET];
    int16_t b_z[EVS_EGO_SUBSET];
} evs_ego_subset_t;

EVS_STATIC_ASSERT(sizeof(evs_ego_subset_t) + sizeof(evs_ego_vector_t) + sizeof(uint16_t) <= EVS_EGOMOTION_BYTES(1),
                  "the macro tells what is used");

/* The vectors of one call, packed, and what is told of all of them. */
typedef struct {
    evs_ego_subset_t *subset;
    evs_ego_vector_t *vec;
    uint16_t *key; /* one per vector: room for what is to be ordered */
    uint32_t n;
    unsigned one_bits;
    int32_t left; /* a grid of cells over the positions: see evs_ego_cell() */
    int32_t top;
    uint32_t per_column_q16;
    uint32_t per_row_q16;
} evs_ego_set_t;

/* Vectors of one cell err together, it is supposed: a moving object, or windows of the tracker that overlap. */
enum { EVS_EGO_COLUMNS = 4, EVS_EGO_ROWS = 4, EVS_EGO_CELLS = EVS_EGO_COLUMNS * EVS_EGO_ROWS };

static inline uint32_t evs_ego_cell(const evs_ego_set_t *set, const evs_ego_vector_t *p)
{
    const uint32_t column = ((uint32_t)(p->x - set->left) * set->per_column_q16) >> 16;
    const uint32_t row = ((uint32_t)(p->y - set->top) * set->per_row_q16) >> 16;
    return row * EVS_EGO_COLUMNS + column;
}

/* A unit vector and two that complete it to a right-handed frame: b0 x b1 = v. Q30. */
typedef struct {
    evs_vec3_t v;
    evs_vec3_t b0;
    evs_vec3_t b1;
} evs_ego_frame_t;

/* A direction ready for the inner loops: x and y are multiplied by "one". */
typedef struct {
    int32_t x;
    int32_t y;
    int32_t z;
} evs_ego_dir_t;

/* What a vector shows under a direction. */
typedef struct {
    int32_t ax;
    int32_t ay;
    int32_t c;
    int32_t d;
    uint32_t a2;
} evs_ego_view_t;

/* A component of a unit vector to Q15, 1.0 to the largest number below. */
static inline int32_t evs_ego_q15(int32_t q30)
{
    const int32_t q15 = evs_shr_r(evs_clamp(q30, -EVS_ONE_Q30, EVS_ONE_Q30), 15u);
    return (q15 > INT16_MAX) ? INT16_MAX : q15;
}

static inline evs_ego_dir_t evs_ego_dir(const evs_ego_set_t *set, evs_vec3_t v_q30)
{
    const int32_t one = INT32_C(2) << set->one_bits;
    const evs_ego_dir_t dir = {evs_ego_q15(v_q30.x) * one, evs_ego_q15(v_q30.y) * one, evs_ego_q15(v_q30.z)};
    return dir;
}

/* |a| < 2^14.6 and the flow is not longer than EVS_EGO_CLIP: |c|, |d| < 2^27.6; a2 < 2^29.2. */
static inline evs_ego_view_t evs_ego_view(const evs_ego_vector_t *p, evs_ego_dir_t dir)
{
    evs_ego_view_t w;
    w.ax = (p->x * dir.z - dir.x) >> 16;
    w.ay = (p->y * dir.z - dir.y) >> 16;
    w.c = p->u * w.ay - p->v * w.ax;
    w.d = p->u * w.ax + p->v * w.ay;
    w.a2 = (uint32_t)(w.ax * w.ax + w.ay * w.ay);
    return w;
}

/* Closer to the focus of expansion than 1/32 a vector says too little and would overflow what follows. */
static inline bool evs_ego_near_focus(const evs_ego_set_t *set, const evs_ego_view_t *w)
{
    return w->a2 < (UINT32_C(1) << (2u * set->one_bits - 10u));
}

/* 1 / |a|^2 with EVS_EGO_INV_BITS; below 2^24 unless near the focus. */
static inline uint32_t evs_ego_inv_a2(const evs_ego_set_t *set, uint32_t a2)
{
    const uint32_t inv = UINT32_MAX / (a2 >> (2u * set->one_bits - 18u));
    return (inv < (UINT32_C(1) << 24)) ? inv : (UINT32_C(1) << 24) - 1u;
}

/* c / |a|^2 in 1/4 steps: the residual over |a|, below 2^27.6. */
static inline int32_t evs_ego_over_a2_q2(const evs_ego_set_t *set, int32_t c, uint32_t inv)
{
    return evs_mul_hi(c * 8, (int32_t)(inv << (17u - set->one_bits)));
}

/* A squared scale, for weights: s2 = (s / 2^e)^2 in Q28 with s in [2^e, 2^(e+1)), and the shift that makes c alike. */
typedef struct {
    uint32_t s2_q28;
    unsigned shift;
} evs_ego_scale_t;

evs_ego_scale_t evs_ego_scale(uint32_t s); /* s in steps, [16, 2^13] */

/* s^2 / (s^2 + r^2) in Q15, from c = r |a|. The weight of Geman and McClure is its square. */
static inline uint32_t evs_ego_share_q15(evs_ego_scale_t scale, const evs_ego_view_t *w)
{
    const uint32_t c = evs_abs_u32(w->c) >> scale.shift;
    const uint32_t c_sat = (c < 60000u) ? c : 60000u;
    const uint32_t k = evs_mul_hi_u(w->a2, scale.s2_q28);
    const uint32_t sum = k + c_sat * c_sat + 1u;
    const unsigned up = evs_clz32(sum);
    return (k << up) / ((sum << up) >> 15);
}

static inline int32_t evs_ego_clip16(int32_t x) { return evs_clamp(x, INT16_MIN, INT16_MAX); }

/* How a vector's residual r depends on a step (d0, d1): |a| dr = j0 d0 + j1 d1, in steps. */
typedef struct {
    int32_t j0; /* |j| < 2^18, since |rho| < 2^14 and |p| < 2^(one_bits + 3.5) */
    int32_t j1;
} evs_ego_slope_t;

static inline evs_ego_slope_t evs_ego_slope(const evs_ego_set_t *set, const evs_ego_vector_t *p, int32_t d,
                                            uint32_t inv, evs_ego_dir_t b0, evs_ego_dir_t b1)
{
    const int32_t rho = evs_clamp(evs_ego_over_a2_q2(set, d, inv) >> 2, -16384, 16383);
    const int32_t p0 = (p->x * b0.x + p->y * b0.y + b0.z) >> 16;
    const int32_t p1 = (p->x * b1.x + p->y * b1.y + b1.z) >> 16;
    const evs_ego_slope_t s = {(rho * p1) >> set->one_bits, -((rho * p0) >> set->one_bits)};
    return s;
}

/* w J / |a|: twice 15 bits of share make the weight, in Q30; |.| < 2^28. */
static inline int32_t evs_ego_weigh(uint32_t weight_q30, uint32_t inv, int32_t j)
{
    return evs_mul_hi((int32_t)evs_mul_hi_u(weight_q30, inv << 8), j * 4096);
}

/* A direction whose product with (x, y, 1) is wanted: here z, not x and y, is multiplied by "one". */
static inline evs_ego_dir_t evs_ego_plane_dir(const evs_ego_set_t *set, evs_vec3_t b_q30)
{
    const evs_ego_dir_t dir = {evs_ego_q15(b_q30.x), evs_ego_q15(b_q30.y),
                               evs_ego_q15(b_q30.z) * (INT32_C(2) << set->one_bits)};
    return dir;
}

/* A direction with its tangent plane, and a kernel, ready for the inner loops. */
typedef struct {
    evs_ego_dir_t v;
    evs_ego_dir_t b0;
    evs_ego_dir_t b1;
    evs_ego_scale_t scale;
} evs_ego_loop_t;

static inline evs_ego_loop_t evs_ego_loop(const evs_ego_set_t *set, const evs_ego_frame_t *f, uint32_t s)
{
    const evs_ego_loop_t loop = {evs_ego_dir(set, f->v), evs_ego_plane_dir(set, f->b0), evs_ego_plane_dir(set, f->b1),
                                 evs_ego_scale(s)};
    return loop;
}

/* What one vector adds to the normal equations. */
typedef struct {
    evs_ego_slope_t j; /* |a| J */
    int32_t k0;        /* w J / |a| */
    int32_t k1;
    int32_t wr_q2;    /* w r / |a| */
    int32_t bend_q15; /* psi' / w = 4 q - 3, q being the share whose square is w */
} evs_ego_pull_t;

/* And what the part of a rotation is made from. */
typedef struct {
    evs_ego_view_t view;
    uint32_t weight_q30;
    uint32_t inv;
} evs_ego_pull_more_t;

/* psi' / w of a part of the Hessian. */
static inline int32_t evs_ego_bend(const evs_ego_pull_t *a, int32_t k)
{
    return evs_mul_hi(k * 8, a->bend_q15 * 16384);
}

/* False: the vector points the wrong way or is too close to the focus. `more` may be NULL. */
static inline bool evs_ego_pull(const evs_ego_set_t *set, const evs_ego_vector_t *p, const evs_ego_loop_t *loop,
                                evs_ego_pull_t *out, evs_ego_pull_more_t *more)
{
    const evs_ego_view_t w = evs_ego_view(p, loop->v);
    if ((w.d <= 0) || evs_ego_near_focus(set, &w)) { return false; }
    const uint32_t share = evs_ego_share_q15(loop->scale, &w);
    const uint32_t weight_q30 = share * share;
    const uint32_t inv = evs_ego_inv_a2(set, w.a2);
    out->j = evs_ego_slope(set, p, w.d, inv, loop->b0, loop->b1);
    out->k0 = evs_ego_weigh(weight_q30, inv, out->j.j0);
    out->k1 = evs_ego_weigh(weight_q30, inv, out->j.j1);
    out->wr_q2 = evs_mul_hi((int32_t)weight_q30, evs_ego_over_a2_q2(set, w.c, inv) * 4);
    out->bend_q15 = 4 * (int32_t)share - 3 * 32768;
    if (more != NULL) { *more = (evs_ego_pull_more_t){w, weight_q30, inv}; }
    return true;
}

/* The gradient that a vector adds, wr_q2 * j / 16: in 4 steps^2, limited to 2^23. */
static inline int32_t evs_ego_gradient(int32_t wr_q2, int32_t j)
{
    const int32_t wr = evs_clamp(wr_q2, -65536, 65535);
    return evs_clamp(evs_mul_hi(wr * 32768, j * 8192), -(INT32_C(1) << 23), (INT32_C(1) << 23) - 1);
}

/* Flow of a unit rotation about each axis, at 1 = 2^(one_bits + 1): u = bu w, v = bv w. */
typedef struct {
    int32_t bu[3];
    int32_t bv[3];
} evs_ego_rows_t;

static inline evs_ego_rows_t evs_ego_rows(const evs_ego_set_t *set, const evs_ego_vector_t *p)
{
    const unsigned shift = set->one_bits + 1u;
    const int32_t one = INT32_C(1) << shift;
    const int32_t xy = (p->x * p->y) >> shift;
    const evs_ego_rows_t r = {{xy, -one - ((p->x * p->x) >> shift), p->y},
                              {one + ((p->y * p->y) >> shift), -xy, -p->x}};
    return r;
}

/* Rotation in 1/256 steps. */
typedef struct {
    int32_t w_q8[3];
} evs_ego_turn_t;

enum { EVS_EGO_TURN_MAX = 1 << 22 };

/* What is left of the flow without the turn. */
static inline void evs_ego_left_over(const evs_ego_set_t *set, const evs_ego_vector_t *p, const evs_ego_rows_t *r,
                                     const evs_ego_turn_t *t, int32_t left[2])
{
    const unsigned shift = set->one_bits + 9u;
    int64_t u = 0;
    int64_t v = 0;
    EVS_EGO_UNROLL
    for (unsigned k = 0u; k < 3u; k++) {
        u += (int64_t)r->bu[k] * t->w_q8[k];
        v += (int64_t)r->bv[k] * t->w_q8[k];
    }
    left[0] = evs_ego_clip16(p->u - evs_sat32(u >> shift));
    left[1] = evs_ego_clip16(p->v - evs_sat32(v >> shift));
}

/* --- evs_egomotion_pack.c --- */

/* Count, scale and pack the vectors; fills the counts, the median and the private members of the result. */
void evs_ego_pack(evs_ego_set_t *set, const evs_egomotion_flow_t *flow, size_t n, evs_egomotion_result_t *result);
/* Pack them again, with the rotation of the result taken out. */
void evs_ego_repack(const evs_ego_set_t *set, const evs_egomotion_flow_t *flow, size_t n,
                    const evs_egomotion_result_t *scale);
/* Pack one vector as evs_ego_pack() did; false where it was left out. */
bool evs_ego_pack_one(const evs_egomotion_result_t *scale, const evs_egomotion_flow_t *flow, evs_ego_vector_t *packed);
/* Steps to K^-1 px, Q24. */
uint32_t evs_ego_steps_to_q24(const evs_egomotion_result_t *scale, uint32_t steps);
/* evs_ego_key() of a small number. */
static inline uint16_t evs_ego_key32(uint32_t x)
{
    if (x < 1024u) { return (uint16_t)x; }
    const unsigned shift = 21u - evs_clz32(x);
    return (uint16_t)((shift << 10) + (x >> shift));
}
/* A 16-bit key in the order of x; relative resolution 2^-10. And the middle of the values with that key. */
uint16_t evs_ego_key(uint64_t x);
uint64_t evs_ego_key_value(uint16_t key);
/* The k-th smallest of n keys, k from 0. */
uint16_t evs_ego_select(const uint16_t *key, uint32_t n, uint32_t k);

/* --- evs_egomotion_search.c --- */

enum { EVS_EGO_CANDIDATES = 3 };
/* The best of the signed hypotheses, and the next best that are 25 degrees from the better ones; returns how many. */
uint32_t evs_ego_search(const evs_ego_set_t *set, evs_vec3_t best[EVS_EGO_CANDIDATES]);

/* --- evs_egomotion_refine.c --- */

evs_ego_frame_t evs_ego_frame(evs_vec3_t v_q30);
/* The same frame at a v near by. */
evs_ego_frame_t evs_ego_carry(const evs_ego_frame_t *f, evs_vec3_t v_q30);
/* Move along the tangent plane by (d0, d1), at most half a radian, and normalize. */
evs_vec3_t evs_ego_move(const evs_ego_frame_t *f, evs_scaled_t d0, evs_scaled_t d1);
/* A Gauss-Newton step, made longer by eighths / 8, with Geman-McClure weights of scale s on every stride-th vector.
 * False: no step was possible. */
bool evs_ego_step(const evs_ego_set_t *set, uint32_t s, uint32_t stride, int32_t eighths, evs_vec3_t *v_q30);
/* Robust 1 sigma of the residuals in steps, from at most n_max vectors. */
uint32_t evs_ego_noise(const evs_ego_set_t *set, evs_vec3_t v_q30, uint32_t n_max);
/* How well v explains at most n_max of the vectors: the sum of their weights, Q15. */
uint32_t evs_ego_explained(const evs_ego_set_t *set, evs_vec3_t v_q30, uint32_t s, uint32_t n_max);
/* Sandwich covariance of v under the kernel of scale s in the tangent plane: 00, 01, 11, rad^2; then what
 * evs_ego_halves_apart() says; and the step that these sums tell to take. False: not positive definite. */
bool evs_ego_covariance(const evs_ego_set_t *set, const evs_ego_frame_t *f, uint32_t s, evs_scaled_t cov[4],
                        evs_scaled_t step[2]);
/* The first two rows and columns of H^-1 M H^-1, as above; lower triangles by rows. False: H is singular. */
bool evs_ego_sandwich(const evs_scaled_t *h, const evs_scaled_t *m, unsigned dim, evs_scaled_t cov[3]);

/* What one cell adds to the Hessian of v, and to the gradient in 4 steps^2. */
typedef struct {
    int64_t h[3];
    int64_t z[EVS_SCALED_DIM_MAX];
} evs_ego_cell_sum_t;

/* Room for the sums of all cells, cleared. It takes the place of the subset, which nobody needs after the search. */
evs_ego_cell_sum_t *evs_ego_cells(const evs_ego_set_t *set);
/* Variance of the gradient, from these sums. */
void evs_ego_spread(const evs_ego_cell_sum_t *cells, unsigned dim, evs_scaled_t *m);
/* How far a step from the vectors in one half of the image leads at most: the four halves' largest, squared. */
evs_scaled_t evs_ego_halves_apart(const evs_ego_cell_sum_t *cells, evs_scaled_t kappa);

/* --- evs_egomotion_rotation.c --- */

/* A rotation that is estimated together with v. */
typedef struct {
    evs_vec3_t rad_q28;
    evs_scaled_t prior; /* (noise / prior's sigma)^2, in the unit of the Hessian */
} evs_ego_rotation_t;

/* (noise / sigma)^2 in that unit. */
evs_scaled_t evs_ego_rotation_prior(const evs_ego_set_t *set, const evs_egomotion_result_t *scale, uint32_t noise,
                                    int32_t sigma_rad_q28);
/* As evs_ego_step(), for both. The set must be packed with rot->rad_q28 taken out. */
bool evs_ego_step_rotation(const evs_ego_set_t *set, const evs_egomotion_result_t *scale, uint32_t s, uint32_t stride,
                           evs_vec3_t *v_q30, evs_ego_rotation_t *rot);
/* As evs_ego_covariance(), with the rotation's share. */
bool evs_ego_covariance_rotation(const evs_ego_set_t *set, const evs_ego_frame_t *f, uint32_t s, uint32_t noise,
                                 evs_scaled_t prior, evs_scaled_t cov[4]);
/* What one unit of the rotation's slopes is in rad. */
evs_scaled_t evs_ego_rotation_unit(const evs_ego_set_t *set, const evs_egomotion_result_t *scale);
/* Whether a rotation alone explains the vectors as well as v does, under a kernel of scale s. */
bool evs_ego_is_rotation(const evs_ego_set_t *set, evs_vec3_t v_q30, uint32_t s);

/* --- evs_egomotion_paper.c --- */

/* The published estimators: v, and with `joint` the rotation, into the result; cov as of evs_ego_covariance(). The set
 * is packed without rotation. `likelihood` has room for set->n. False: no minimum with a covariance. */
bool evs_ego_paper(const evs_ego_set_t *set, bool joint, uint32_t *likelihood, evs_egomotion_result_t *result,
                   evs_scaled_t cov[4]);

#endif
