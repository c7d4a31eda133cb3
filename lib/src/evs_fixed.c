/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/fixed.h"

/*
 * The polynomials below are minimax fits (relative error for the starting values, absolute for the rest), made once in
 * double precision; each function refines its start by Newton steps, so only the fit's order matters for the result.
 */

/* 1 / sqrt(v) for v = top / 2^32 in [1/4, 1), as UQ1.31 in (1, 2]; 2.0 itself is UINT32_MAX. */
static uint32_t rsqrt_mantissa(uint32_t top)
{
    /* 2.6708 - 3.2853 v + 1.6385 v^2: within 2.5 % everywhere; three steps of e' = 1.5 e^2 leave 1e-9. */
    uint32_t y_q29 = UINT32_C(1433880272) - evs_mul_hi_u(top, UINT32_C(1763760244) - evs_mul_hi_u(top, 879658061u));
    for (int step = 0; step < 2; step++) {
        const uint32_t vy_q29 = evs_mul_hi_u(top, y_q29);
        const uint32_t vyy_q26 = evs_mul_hi_u(vy_q29, y_q29);                          /* about 1.0 = 2^26 */
        y_q29 = (uint32_t)(((uint64_t)y_q29 * ((UINT32_C(3) << 26) - vyy_q26)) >> 27); /* y (3 - v y^2) / 2 */
    }
    const uint64_t vy_q30 = ((uint64_t)top * y_q29) >> 31;
    const uint64_t vyy_q29 = (vy_q30 * y_q29) >> 30;
    const uint64_t y_q31 = ((uint64_t)y_q29 * ((UINT64_C(3) << 29) - vyy_q29) + (UINT64_C(1) << 27)) >> 28;
    return (y_q31 > UINT32_MAX) ? UINT32_MAX : (uint32_t)y_q31;
}

uint32_t evs_rsqrt_u64(uint64_t x, unsigned *shift)
{
    EVS_ASSERT(x != 0u);
    const unsigned even = evs_clz64(x) & ~1u;
    *shift = 63u - even / 2u;
    return rsqrt_mantissa((uint32_t)((x << even) >> 32));
}

uint32_t evs_sqrt_u64(uint64_t x)
{
    if (x == 0u) { return 0u; }
    const unsigned even = evs_clz64(x) & ~1u;
    const uint64_t m = x << even; /* in [2^62, 2^64): its root has 32 bits */
    const uint32_t r_q31 = rsqrt_mantissa((uint32_t)(m >> 32));
    const uint64_t guess = ((m >> 32) * r_q31) >> 31;
    uint32_t root = (guess > UINT32_MAX) ? UINT32_MAX : (uint32_t)guess;

    /* One Heron step brings the residual m - root^2 below a few roots; what is left is settled exactly. */
    const int64_t residual = (int64_t)(m - (uint64_t)root * root);
    const int64_t refined = (int64_t)root + (((residual >> 6) * (int64_t)r_q31) >> 58);
    root = (refined > (int64_t)UINT32_MAX) ? UINT32_MAX : (uint32_t)refined;
    while ((uint64_t)root * root > m) { root--; }
    while ((root < UINT32_MAX) && ((uint64_t)(root + 1u) * (root + 1u) <= m)) { root++; }
    return root >> (even / 2u);
}

uint32_t evs_recip_u32(uint32_t x, unsigned *shift)
{
    EVS_ASSERT(x != 0u);
    const unsigned zeros = evs_clz32(x);
    const uint32_t v = x << zeros; /* v / 2^32 in [1/2, 1) */
    *shift = 63u - zeros;

    /* 2.8235 - 1.8823 v: within 5.9 %; three steps of e' = e^2 leave 1.4e-10. */
    uint32_t y_q30 = UINT32_C(3031714739) - evs_mul_hi_u(v, UINT32_C(2021127161));
    for (int step = 0; step < 2; step++) {
        const uint32_t vy_q30 = evs_mul_hi_u(v, y_q30);
        y_q30 = (uint32_t)(((uint64_t)y_q30 * ((UINT32_C(2) << 30) - vy_q30)) >> 30);
    }
    const uint64_t vy_q31 = ((uint64_t)v * y_q30) >> 31;
    const uint64_t y_q31 = ((uint64_t)y_q30 * ((UINT64_C(2) << 31) - vy_q31)) >> 30;
    return (y_q31 > UINT32_MAX) ? UINT32_MAX : (uint32_t)y_q31;
}

/* atan(t) / (2 pi) * 2^32 for t in Q32, t in [0, tan(pi / 8)]. */
static int32_t atan_eighth(uint32_t t_q32)
{
    static const int32_t C[] = {683565275, -227855070, 136711617, -97611178, 75345082, -57227958, 31148326};
    const uint32_t tt_q32 = evs_mul_hi_u(t_q32, t_q32);
    int32_t sum = C[6];
    for (int k = 5; k >= 0; k--) { sum = C[k] + (int32_t)evs_shr_r64((int64_t)sum * tt_q32, 32); }
    return (int32_t)evs_shr_r64((int64_t)sum * t_q32, 32);
}

int32_t evs_atan2(int32_t y, int32_t x)
{
    const uint32_t ax = evs_abs_u32(x);
    const uint32_t ay = evs_abs_u32(y);
    const bool steep = ay > ax;
    uint32_t big = steep ? ay : ax;
    uint32_t small = steep ? ax : ay;
    if (big == 0u) { return 0; }

    /* Scale so that the larger one has 31 bits, then t = small / big. */
    const unsigned zeros = evs_clz32(big);
    if (zeros > 0u) {
        big <<= zeros - 1u;
        small <<= zeros - 1u;
    } else {
        big >>= 1;
        small >>= 1;
    }

    /* Above tan(pi / 8) = 0.41421: atan(t) = pi / 4 - atan((1 - t) / (1 + t)). */
    const bool fold = evs_mul_hi_u(big, UINT32_C(1779033704)) < small;
    const uint32_t num = fold ? big - small : small;
    const uint32_t den = fold ? big + small : big;
    unsigned shift;
    const uint32_t r = evs_recip_u32(den, &shift); /* den >= 2^30, so shift >= 62 */
    const uint32_t t_q32 = (uint32_t)(((uint64_t)num * r) >> (shift - 32u));

    int32_t angle = atan_eighth(t_q32); /* in [0, 1/8 turn] */
    if (fold) { angle = EVS_ANGLE_QUARTER_TURN / 2 - angle; }
    if (steep) { angle = EVS_ANGLE_QUARTER_TURN - angle; }
    uint32_t turn = (uint32_t)angle;
    if (x < 0) { turn = UINT32_C(0x80000000) - turn; }
    return (int32_t)((y < 0) ? 0u - turn : turn);
}

void evs_sincos(int32_t angle, int32_t *sin_q30, int32_t *cos_q30)
{
    static const int32_t S[] = {1686629713, -693598665, 85569234, -5026337, 169635};
    static const int32_t C[] = {1073741824, -1324675879, 272375559, -22401978, 986942, -26684};

    /* u = distance to the nearest quarter turn, in quarter turns: Q31 in [-1/2, 1/2]. */
    const uint32_t quadrant = ((uint32_t)angle + (UINT32_C(1) << 29)) >> 30;
    const int32_t u_q31 = (int32_t)(((uint32_t)angle - (quadrant << 30)) << 1);
    const int32_t uu_q31 = evs_q_mul(u_q31, u_q31, 31);

    int32_t s = S[4];
    for (int k = 3; k >= 0; k--) { s = S[k] + evs_q_mul(s, uu_q31, 31); }
    s = evs_q_mul(s, u_q31, 31);
    int32_t c = C[5];
    for (int k = 4; k >= 0; k--) { c = C[k] + evs_q_mul(c, uu_q31, 31); }

    const bool swap = (quadrant & 1u) != 0u;
    const int32_t sin_abs = swap ? c : s;
    const int32_t cos_abs = swap ? -s : c;
    const bool negate = (quadrant & 2u) != 0u;
    *sin_q30 = negate ? -sin_abs : sin_abs;
    *cos_q30 = negate ? -cos_abs : cos_abs;
}

/* 2^x in UQ16.16 for x in Q32: the fraction by a polynomial, the integer part by a shift. */
static uint32_t exp2_of_q32(int64_t x_q32)
{
    static const uint32_t C[] = {2147483648u, 1488522248u, 515882233u, 119196352u,
                                 20645944u,   2882489u,    308214u,    46168u};
    const int64_t whole = x_q32 >> 32;
    const uint32_t fraction_q32 = (uint32_t)x_q32;
    if (whole >= 16) { return UINT32_MAX; }
    if (whole < -17) { return 0u; } /* below half an LSB */

    uint32_t sum_q31 = C[7];
    for (int k = 6; k >= 0; k--) { sum_q31 = C[k] + evs_mul_hi_u(sum_q31, fraction_q32); } /* in [1, 2) */
    const unsigned down = (unsigned)(15 - whole); /* from Q31 to Q16, times 2^whole */
    if (down == 0u) { return sum_q31; }
    return (uint32_t)(((uint64_t)sum_q31 + (UINT64_C(1) << (down - 1u))) >> down);
}

uint32_t evs_exp2_q16(int32_t x_q16) { return exp2_of_q32(evs_shl64(x_q16, 16)); }

uint32_t evs_exp_q16(int32_t x_q16)
{
    /* x log2(e) with log2(e) = 94548.46219970 / 2^16, its fraction as a Q32 number. */
    return exp2_of_q32((int64_t)x_q16 * 94548 + evs_shr_r64((int64_t)x_q16 * INT64_C(1985132591), 32));
}
