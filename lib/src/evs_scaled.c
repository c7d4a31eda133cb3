/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_scaled.h"

enum { MANTISSA_BITS = 30 };

evs_scaled_t evs_scaled(int64_t x, int32_t e)
{
    evs_scaled_t s = {0, 0};
    if (x == 0) { return s; }
    const uint64_t magnitude = (x < 0) ? 0u - (uint64_t)x : (uint64_t)x;
    const int32_t shift = 64 - MANTISSA_BITS - (int32_t)evs_clz64(magnitude); /* > 0: bits too many */
    uint64_t m;
    if (shift > 0) {
        m = ((magnitude >> (shift - 1)) + 1u) >> 1;
    } else {
        m = magnitude << -shift;
    }
    s.m = (x < 0) ? -(int32_t)m : (int32_t)m;
    s.e = e + shift;
    return s;
}

evs_scaled_t evs_scaled_add(evs_scaled_t a, evs_scaled_t b)
{
    if (a.m == 0) { return b; }
    if (b.m == 0) { return a; }
    const evs_scaled_t big = (a.e >= b.e) ? a : b;
    const evs_scaled_t small = (a.e >= b.e) ? b : a;
    const int32_t gap = big.e - small.e;
    if (gap > MANTISSA_BITS + 1) { return big; }
    const int64_t sum = evs_shl64(big.m, 31u) + (evs_shl64(small.m, 31u) >> gap);
    return evs_scaled(sum, big.e - 31);
}

evs_scaled_t evs_scaled_sub(evs_scaled_t a, evs_scaled_t b)
{
    b.m = -b.m;
    return evs_scaled_add(a, b);
}

evs_scaled_t evs_scaled_mul(evs_scaled_t a, evs_scaled_t b) { return evs_scaled((int64_t)a.m * b.m, a.e + b.e); }

evs_scaled_t evs_scaled_div(evs_scaled_t a, evs_scaled_t b)
{
    unsigned shift;
    const uint32_t r = evs_recip_u32(evs_abs_u32(b.m), &shift); /* 1 / |b.m| = r 2^-shift */
    const int32_t half = (int32_t)(r >> 1);
    const int64_t product = (int64_t)a.m * ((b.m < 0) ? -half : half);
    return evs_scaled(product, a.e - b.e - (int32_t)shift + 1);
}

evs_scaled_t evs_scaled_sqrt(evs_scaled_t a)
{
    if (a.m <= 0) { return evs_scaled(0, 0); }
    const unsigned odd = (unsigned)a.e & 1u;
    const uint64_t x = (uint64_t)(uint32_t)a.m << (30u + odd); /* even exponent below */
    return evs_scaled((int64_t)evs_sqrt_u64(x), (a.e - 30 - (int32_t)odd) / 2);
}

int32_t evs_scaled_to_q(evs_scaled_t a, int32_t n)
{
    const int32_t shift = a.e + n; /* value = m * 2^shift */
    if ((a.m == 0) || (shift < -MANTISSA_BITS - 1)) { return 0; }
    if (shift > 2) { return (a.m < 0) ? INT32_MIN : INT32_MAX; }
    return (shift >= 0) ? evs_sat32(evs_shl64(a.m, (unsigned)shift)) : (int32_t)evs_shr_r64(a.m, (unsigned)-shift);
}

bool evs_scaled_solve(evs_scaled_t *a, evs_scaled_t *b, unsigned dim)
{
    for (unsigned i = 0u; i < dim; i++) {
        evs_scaled_t *const row_i = a + i * (i + 1u) / 2u;
        for (unsigned j = 0u; j < i; j++) { /* row_i[j] becomes L_ij D_j */
            const evs_scaled_t *const row_j = a + j * (j + 1u) / 2u;
            for (unsigned k = 0u; k < j; k++) {
                row_i[j] = evs_scaled_sub(row_i[j], evs_scaled_mul(row_i[k], row_j[k]));
            }
        }
        const evs_scaled_t diagonal = row_i[i];
        for (unsigned j = 0u; j < i; j++) {
            const evs_scaled_t l = evs_scaled_div(row_i[j], a[j * (j + 1u) / 2u + j]);
            row_i[i] = evs_scaled_sub(row_i[i], evs_scaled_mul(l, row_i[j]));
            row_i[j] = l;
        }
        const evs_scaled_t least = {diagonal.m, diagonal.e - 20};
        if ((diagonal.m <= 0) || evs_scaled_less(row_i[i], least)) { return false; }
    }
    for (unsigned i = 0u; i < dim; i++) {
        for (unsigned j = 0u; j < i; j++) {
            b[i] = evs_scaled_sub(b[i], evs_scaled_mul(a[i * (i + 1u) / 2u + j], b[j]));
        }
    }
    for (unsigned i = dim; i-- > 0u;) {
        b[i] = evs_scaled_div(b[i], a[i * (i + 1u) / 2u + i]);
        for (unsigned j = i + 1u; j < dim; j++) {
            b[i] = evs_scaled_sub(b[i], evs_scaled_mul(a[j * (j + 1u) / 2u + i], b[j]));
        }
    }
    return true;
}
