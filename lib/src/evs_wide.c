/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_wide.h"

#include "evs/fixed.h"

EVS_STATIC_ASSERT((INT64_C(-1) >> 1) == -1, "right shift of a negative number must keep the sign");
EVS_STATIC_ASSERT((int64_t)UINT64_MAX == -1, "conversion to a signed type must wrap");

#define LOW32(x)    ((x)&UINT32_MAX)
#define HALF_PI_Q56 (INT64_C(226375608064910089) / 2)

static uint64_t magnitude(int64_t x) { return (x < 0) ? 0u - (uint64_t)x : (uint64_t)x; }

int64_t evs_wide_mul(int64_t a, int64_t b, unsigned shift)
{
    const uint64_t ua = (uint64_t)a;
    const uint64_t ub = (uint64_t)b;
    const uint64_t p00 = LOW32(ua) * LOW32(ub);
    const uint64_t p01 = LOW32(ua) * (ub >> 32);
    const uint64_t p10 = (ua >> 32) * LOW32(ub);
    const uint64_t mid = (p00 >> 32) + LOW32(p01) + LOW32(p10);
    uint64_t hi = (ua >> 32) * (ub >> 32) + (p01 >> 32) + (p10 >> 32) + (mid >> 32);
    uint64_t lo = (mid << 32) | LOW32(p00);

    /* The product of the two's complements, made that of the signed numbers. */
    if (a < 0) { hi -= ub; }
    if (b < 0) { hi -= ua; }

    const uint64_t half = UINT64_C(1) << (shift - 1u);
    lo += half;
    if (lo < half) { hi++; }

    const int64_t limit = INT64_C(1) << (shift - 4u); /* of the high word where the result reaches EVS_WIDE_MAX */
    if ((int64_t)hi >= limit) { return EVS_WIDE_MAX; }
    if ((int64_t)hi < -limit) { return -EVS_WIDE_MAX; }
    return (int64_t)((hi << (64u - shift)) | (lo >> shift));
}

int64_t evs_wide_div_q32(int64_t num, int64_t den)
{
    if (num == 0) { return 0; }

    /* 64 significant bits over 32 leave a quotient of 32 or 33, whatever the operands; `up` puts the point back. */
    const unsigned num_up = evs_clz64(magnitude(num));
    const unsigned den_up = evs_clz64(magnitude(den));
    const uint64_t n = magnitude(num) << num_up;
    uint64_t d = magnitude(den) << den_up;
    d = (d >> 32) + ((d >> 31) & 1u);
    const uint64_t quotient = n / d;
    const int up = (int)den_up - (int)num_up; /* quotient * 2^up = num / den * 2^32 */

    uint64_t q;
    if (up > 27) {
        q = (uint64_t)EVS_WIDE_MAX;
    } else if (up >= 0) {
        q = quotient << up;
    } else if (up > -40) {
        q = ((quotient >> (-up - 1)) + 1u) >> 1;
    } else {
        q = 0u;
    }
    return ((num < 0) != (den < 0)) ? -(int64_t)q : (int64_t)q;
}

static uint64_t sqrt_nearest(uint64_t x)
{
    const uint64_t root = evs_sqrt_u64(x);
    return (x - root * root > root) ? root + 1u : root;
}

int64_t evs_wide_hypot(int64_t x, int64_t y)
{
    const uint64_t ux = magnitude(x);
    const uint64_t uy = magnitude(y);
    if ((ux | uy) == 0u) { return 0; }

    /* Scale to 31 bits: the squares then fill 63 bits. */
    const unsigned up = evs_clz64(ux | uy);
    if (up >= 33u) {
        const unsigned by = up - 33u;
        const uint64_t root = sqrt_nearest((ux << by) * (ux << by) + (uy << by) * (uy << by));
        return (int64_t)((by == 0u) ? root : ((root >> (by - 1u)) + 1u) >> 1);
    }
    const unsigned by = 33u - up;
    const uint64_t half = UINT64_C(1) << (by - 1u);
    const uint64_t sx = (ux + half) >> by; /* may round up to 2^31: two squares of that still fit */
    const uint64_t sy = (uy + half) >> by;
    return (int64_t)(sqrt_nearest(sx * sx + sy * sy) << by);
}

/* Taylor series on [0, pi/4]; the first terms left out are below 2^-45. */
static void sincos_octant(int64_t a_q56, int64_t *sin_q56, int64_t *cos_q56)
{
    static const int64_t SIN_Q56[] = {INT64_C(-12009599006321322), INT64_C(600479950316066), INT64_C(-14297141674192),
                                      INT64_C(198571412142),       INT64_C(-1805194656),     INT64_C(11571761)};
    static const int64_t COS_Q56[] = {INT64_C(-36028797018963968), INT64_C(3002399751580330), INT64_C(-100079991719344),
                                      INT64_C(1787142709274),      INT64_C(-19857141214),     INT64_C(150432888)};
    const int64_t one_q56 = INT64_C(1) << 56;
    const int64_t a2 = evs_wide_mul(a_q56, a_q56, 56u);
    int64_t s = 0;
    int64_t c = 0;
    for (int i = 5; i >= 0; i--) {
        s = evs_wide_mul(s + SIN_Q56[i], a2, 56u);
        c = evs_wide_mul(c + COS_Q56[i], a2, 56u);
    }
    *sin_q56 = evs_wide_mul(a_q56, one_q56 + s, 56u);
    *cos_q56 = one_q56 + c;
}

void evs_wide_sincos(int64_t angle_q32, int64_t *sin_q56, int64_t *cos_q56)
{
    int64_t a_q56 = evs_shl64(angle_q32, 24u);
    int64_t sign = 1;
    if (a_q56 > HALF_PI_Q56) {
        a_q56 = 2 * HALF_PI_Q56 - a_q56;
        sign = -1;
    }
    if (a_q56 <= HALF_PI_Q56 / 2) {
        sincos_octant(a_q56, sin_q56, cos_q56);
    } else {
        sincos_octant(HALF_PI_Q56 - a_q56, cos_q56, sin_q56);
    }
    *cos_q56 *= sign;
}

int64_t evs_wide_angle_q32(int64_t r, int64_t z)
{
    int64_t az = (z < 0) ? -z : z;
    const int64_t pi_4_q32 = EVS_WIDE_PI_Q32 / 4;

    /* A short vector gains digits for what follows, a long one loses some that do not matter. */
    const int up = (int)evs_clz64((uint64_t)(r | az)) - 5;
    r = (up >= 0) ? r << up : r >> -up;
    az = (up >= 0) ? az << up : az >> -up;

    /* Start within 0.004 rad: atan(t) = t (pi/4 + 0.273 (1 - t)) for t <= 1. */
    const int64_t t = (r < az) ? evs_wide_div_q32(r, az) : evs_wide_div_q32(az, r);
    const int64_t bend = evs_wide_mul(EVS_WIDE_ONE_Q32 - t, INT64_C(1172526072), 32u); /* 0.273 */
    int64_t a = evs_wide_mul(t, pi_4_q32 + bend, 32u);
    if (r >= az) { a = 2 * pi_4_q32 - a; }

    /* Turn the vector by -a: its remaining angle d has tan d = d + d^3 / 3, so each round cubes the error. */
    for (int i = 0; i < 2; i++) {
        int64_t s;
        int64_t c;
        evs_wide_sincos(a, &s, &c);
        const int64_t across = evs_wide_mul(r, c, 56u) - evs_wide_mul(az, s, 56u);
        const int64_t along = evs_wide_mul(r, s, 56u) + evs_wide_mul(az, c, 56u);
        a += evs_wide_div_q32(across, along);
        if (a < 0) { a = 0; }
    }
    return (z < 0) ? EVS_WIDE_PI_Q32 - a : a;
}
