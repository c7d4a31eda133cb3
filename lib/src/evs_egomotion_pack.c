/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Flow vectors to 16 bits, and order statistics. */
#include "evs_egomotion_private.h"

#include <string.h>

#define POSITION_LIMIT (INT32_C(8) << 24)

/* --- order ------------------------------------------------------------------------------------------------------ */

/* 6 bits of exponent, 10 of mantissa. */
uint16_t evs_ego_key(uint64_t x)
{
    if (x < 1024u) { return (uint16_t)x; }
    const unsigned shift = 53u - evs_clz64(x);                 /* leaves 11 bits, the first of them 1 */
    return (uint16_t)((shift << 10) + (uint32_t)(x >> shift)); /* the leading 1 adds one to the exponent */
}

uint64_t evs_ego_key_value(uint16_t key)
{
    if (key < 2048u) { return key; }
    const unsigned shift = ((unsigned)key >> 10) - 1u;
    return (((uint64_t)(key & 1023u) + 1024u) << shift) + (UINT64_C(1) << (shift - 1u));
}

/* Of the keys whose bits above shift + n_bits are those of prefix: the group of the next n_bits that holds the k-th. */
static uint32_t narrow(const uint16_t *key, uint32_t n, uint32_t prefix, unsigned shift, unsigned n_bits, uint32_t *k)
{
    uint16_t count[64];
    memset(count, 0, sizeof count);
    const uint32_t mask = (UINT32_C(1) << n_bits) - 1u;
    for (uint32_t i = 0u; i < n; i++) {
        const uint32_t head = (uint32_t)key[i] >> shift;
        if ((head >> n_bits) == prefix) { count[head & mask]++; }
    }
    uint32_t group = 0u;
    while ((group < mask) && (*k >= count[group])) {
        *k -= count[group];
        group++;
    }
    return (prefix << n_bits) | group;
}

uint16_t evs_ego_select(const uint16_t *key, uint32_t n, uint32_t k)
{
    uint32_t prefix = narrow(key, n, 0u, 10u, 6u, &k);
    prefix = narrow(key, n, prefix, 5u, 5u, &k);
    return (uint16_t)narrow(key, n, prefix, 0u, 5u, &k);
}

/* --- packing ---------------------------------------------------------------------------------------------------- */

static bool position_ok(const evs_egomotion_flow_t *f)
{
    return (f->x_q24 >= -POSITION_LIMIT) && (f->x_q24 < POSITION_LIMIT) && (f->y_q24 >= -POSITION_LIMIT) &&
           (f->y_q24 < POSITION_LIMIT);
}

static bool is_still(const evs_egomotion_flow_t *f) { return (f->u_q24 == 0) && (f->v_q24 == 0); }

static uint64_t length_sq(const evs_egomotion_flow_t *f)
{
    return (uint64_t)((int64_t)f->u_q24 * f->u_q24) + (uint64_t)((int64_t)f->v_q24 * f->v_q24);
}

static int64_t to_steps(const evs_egomotion_result_t *scale, int32_t q24)
{
    return evs_shr_r64((int64_t)q24 * (int64_t)scale->scale_, scale->scale_shift_);
}

static uint64_t magnitude(int64_t x) { return (uint64_t)((x < 0) ? -x : x); }

static int32_t without(int32_t flow_q24, int64_t by_q52)
{
    return evs_sat32((int64_t)flow_q24 - evs_shr_r64(by_q52, 28u));
}

static void derotate(const evs_vec3_t w, const evs_egomotion_flow_t *f, int32_t uv_q24[2])
{
    const int64_t xy = ((int64_t)f->x_q24 * f->y_q24) >> 24; /* < 2^31 */
    const int64_t xx = (INT64_C(1) << 24) + (((int64_t)f->x_q24 * f->x_q24) >> 24);
    const int64_t yy = (INT64_C(1) << 24) + (((int64_t)f->y_q24 * f->y_q24) >> 24);
    uv_q24[0] = without(f->u_q24, xy * w.x - xx * w.y + (int64_t)f->y_q24 * w.z);
    uv_q24[1] = without(f->v_q24, yy * w.x - xy * w.y - (int64_t)f->x_q24 * w.z);
}

/* To at most EVS_EGO_CLIP, keeping the direction. */
static void shorten(uint64_t longer, int64_t *u, int64_t *v)
{
    if (longer >= (UINT64_C(1) << 30)) { /* keep the squares in range */
        const unsigned down = 34u - evs_clz64(longer);
        *u >>= down;
        *v >>= down;
    }
    const uint64_t sq = (uint64_t)(*u * *u) + (uint64_t)(*v * *v);
    if (sq <= (uint64_t)EVS_EGO_CLIP * EVS_EGO_CLIP) { return; }
    unsigned shift;
    const uint32_t r = evs_rsqrt_u64(sq, &shift);                         /* 1 / length = r 2^-shift, shift >= 44 */
    const int64_t factor = (int64_t)(((uint64_t)r * EVS_EGO_CLIP) >> 15); /* < 2^30, and so are u and v */
    *u = evs_shr_r64(*u * factor, shift - 15u);
    *v = evs_shr_r64(*v * factor, shift - 15u);
}

bool evs_ego_pack_one(const evs_egomotion_result_t *scale, const evs_egomotion_flow_t *flow, evs_ego_vector_t *packed)
{
    if (!position_ok(flow) || is_still(flow)) { return false; }
    /* Q24 with 1 = 2^24 to 1 = 2^(14 - position_shift_); the last value of the range must not round out of 16 bits */
    const unsigned shift = 10u + scale->position_shift_;
    packed->x = evs_sat16(evs_shr_r(flow->x_q24, shift));
    packed->y = evs_sat16(evs_shr_r(flow->y_q24, shift));
    int32_t uv_q24[2] = {flow->u_q24, flow->v_q24};
    const evs_vec3_t w = scale->rotation_rad_q28;
    if ((w.x != 0) || (w.y != 0) || (w.z != 0)) { derotate(w, flow, uv_q24); }
    int64_t u = to_steps(scale, uv_q24[0]);
    int64_t v = to_steps(scale, uv_q24[1]);
    const uint64_t longer = (magnitude(u) > magnitude(v)) ? magnitude(u) : magnitude(v);
    if (longer > (uint64_t)EVS_EGO_CLIP * 181u / 256u) {
        shorten(longer, &u, &v);
    } /* else below EVS_EGO_CLIP / sqrt(2) */
    packed->u = (int16_t)u;
    packed->v = (int16_t)v;
    return true;
}

uint32_t evs_ego_steps_to_q24(const evs_egomotion_result_t *scale, uint32_t steps)
{
    const uint64_t x = ((uint64_t)steps * scale->median_flow_q24) >> EVS_EGO_MEDIAN_BITS;
    return (x < UINT32_MAX) ? (uint32_t)x : UINT32_MAX;
}

static void lay_grid(evs_ego_set_t *set)
{
    int32_t right = INT16_MIN;
    int32_t bottom = INT16_MIN;
    set->left = INT16_MAX;
    set->top = INT16_MAX;
    for (uint32_t i = 0u; i < set->n; i++) {
        const evs_ego_vector_t *const p = &set->vec[i];
        if (p->x < set->left) { set->left = p->x; }
        if (p->x > right) { right = p->x; }
        if (p->y < set->top) { set->top = p->y; }
        if (p->y > bottom) { bottom = p->y; }
    }
    set->per_column_q16 = (EVS_EGO_COLUMNS << 16) / (uint32_t)(right - set->left + 1);
    set->per_row_q16 = (EVS_EGO_ROWS << 16) / (uint32_t)(bottom - set->top + 1);
}

void evs_ego_pack(evs_ego_set_t *set, const evs_egomotion_flow_t *flow, size_t n, evs_egomotion_result_t *result)
{
    uint32_t reach = 0u; /* bits of the largest coordinate */
    set->n = 0u;
    for (size_t i = 0u; i < n; i++) {
        if (!position_ok(&flow[i])) {
            result->n_rejected++;
        } else if (!is_still(&flow[i])) {
            reach |= evs_abs_u32(flow[i].x_q24) | evs_abs_u32(flow[i].y_q24);
            set->key[set->n++] = evs_ego_key(length_sq(&flow[i]));
        }
    }
    result->n_flow = set->n;
    if (set->n == 0u) { return; }

    const uint32_t median = evs_sqrt_u64(
        evs_ego_key_value(evs_ego_select(set->key, set->n, set->n / 2u))); /* at least 1: nothing here is still */
    unsigned recip_shift;
    const uint32_t recip = evs_recip_u32(median, &recip_shift); /* 1 / median = recip / 2^recip_shift */
    result->median_flow_q24 = median;
    result->scale_ = recip >> 1; /* 31 bits: times any int32_t it leaves room for rounding */
    result->scale_shift_ = (uint8_t)(recip_shift - 1u - (unsigned)EVS_EGO_MEDIAN_BITS);
    result->position_shift_ =
        (uint8_t)((reach >= (UINT32_C(4) << 24)) ? 2u : ((reach >= (UINT32_C(2) << 24)) ? 1u : 0u));
    set->one_bits = 13u - result->position_shift_;

    evs_ego_repack(set, flow, n, result);
    lay_grid(set);
}

void evs_ego_repack(const evs_ego_set_t *set, const evs_egomotion_flow_t *flow, size_t n,
                    const evs_egomotion_result_t *scale)
{
    evs_ego_vector_t *out = set->vec;
    for (size_t i = 0u; i < n; i++) {
        if (evs_ego_pack_one(scale, &flow[i], out)) { out++; }
    }
}
