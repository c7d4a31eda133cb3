/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_homography_kernel.h"

/*
 * With dx = x - cx, dy = y - cy (px) and g = fx / fy, the rotated ray times fx is
 *     X = r00 dx + g r01 dy + fx r02,   Z = r20 dx + g r21 dy + fx r22,
 * and times fy
 *     Y = r10 dx / g + r11 dy + fy r12,
 * so that x' = cx + fx X / Z and y' = cy + fx Y / Z. The exact path computes these in 64 bits. The fast path has the
 * same three rows expanded in x and y, divided by the depth ratio Z / fx at the image centre, in 32 bits.
 */

#define COEF_MAX_Q28  INT64_C(0x40000000) /* 4.0: with coordinates below 2048 px a numerator stays below 2^15 px. */
#define SHIFT_MAX_Q16 INT64_C(0x38000000) /* 14336 px */
#define W_COEF_MAX    INT64_C(0x40000000) /* Q35: 64 in Q23 at 2048 px */
#define W0_MAX_Q23    INT64_C(0x20000000) /* 64 */

evs_status_t evs_pinhole_check(const evs_pinhole_t *k)
{
    if (k == NULL) { return EVS_ERR_NULL; }
    const bool ok = (k->width_px >= 1u) && (k->width_px <= EVS_SENSOR_MAX_PX) && (k->height_px >= 1u) &&
                    (k->height_px <= EVS_SENSOR_MAX_PX) &&
                    evs_in_range(k->fx_q16, EVS_PINHOLE_FOCAL_MIN_Q16, EVS_PINHOLE_FOCAL_MAX_Q16) &&
                    evs_in_range(k->fy_q16, EVS_PINHOLE_FOCAL_MIN_Q16, EVS_PINHOLE_FOCAL_MAX_Q16) &&
                    evs_in_range(k->cx_q16, -EVS_PINHOLE_CENTRE_MAX_Q16, EVS_PINHOLE_CENTRE_MAX_Q16) &&
                    evs_in_range(k->cy_q16, -EVS_PINHOLE_CENTRE_MAX_Q16, EVS_PINHOLE_CENTRE_MAX_Q16) &&
                    (k->fx_q16 / 2 < k->fy_q16) && (k->fy_q16 / 2 < k->fx_q16);
    return ok ? EVS_OK : EVS_ERR_ARG;
}

typedef struct { /* 1 / x = r 2^-shift */
    uint32_t r;
    unsigned shift;
} recip_t;

static recip_t recip_of(int32_t x)
{
    recip_t inverse;
    inverse.r = evs_recip_u32((uint32_t)x, &inverse.shift);
    return inverse;
}

/* num / den in Q30 for a quotient in (1/2, 2); both positive. */
static int32_t ratio_q30(int32_t num, recip_t den)
{
    const uint64_t q = ((uint64_t)(uint32_t)num * den.r) >> (den.shift - 30u);
    return (q > (uint64_t)INT32_MAX) ? INT32_MAX : (int32_t)q;
}

static bool below(int64_t x, int64_t limit) { return (x < limit) && (x > -limit); }

static int64_t mul_q30(int32_t a, int32_t b) { return evs_shr_r64((int64_t)a * b, 30); }

/* The constant of a row expanded in x and y: row . (third, -cx, -cy) / 2^28. */
static int64_t constant_of(int64_t third, int32_t row_x, int32_t row_y, const evs_homography_t *h)
{
    return evs_shr_r64(third - (int64_t)row_x * h->cx_q16 - (int64_t)row_y * h->cy_q16, 28);
}

static void set_fast(evs_homography_t *h, const evs_pinhole_t *k, recip_t fx_recip)
{
    /* Depth ratio at the image centre, Q28. Dividing by it puts the ratios of the image around 1. */
    const int32_t dx_q16 = ((int32_t)k->width_px - 1) * 32768 - k->cx_q16;
    const int32_t dy_q16 = ((int32_t)k->height_px - 1) * 32768 - k->cy_q16;
    const int64_t z_q46 =
        (int64_t)h->row_q30[2][0] * dx_q16 + (int64_t)h->row_q30[2][1] * dy_q16 + (int64_t)h->row_q30[2][2] * k->fx_q16;
    const int64_t w_q28 = evs_shr_r64((z_q46 >> 31) * (int64_t)fx_recip.r, fx_recip.shift - 29u); /* Q15 Q16 / Q16 */
    if ((w_q28 < (INT64_C(1) << 26)) || (w_q28 > INT32_MAX)) { return; } /* below 1/4, or absurd */
    const recip_t w_recip = recip_of((int32_t)w_q28);
    const int32_t inv_q28 = (int32_t)(w_recip.r >> (w_recip.shift - 56u)); /* at most 4 */

    const int64_t ax = mul_q30(h->row_q30[0][0], inv_q28);
    const int64_t ay = mul_q30(h->row_q30[0][1], inv_q28);
    const int64_t bx = mul_q30(h->row_q30[1][0], inv_q28);
    const int64_t by = mul_q30(h->row_q30[1][1], inv_q28);
    /* (r / w) / fx: Q28 times 2^16 / fx_q16, to Q35. */
    const int64_t wx = evs_shr_r64(mul_q30(h->row_q30[2][0], inv_q28) * (int64_t)fx_recip.r, fx_recip.shift - 23u);
    const int64_t wy = evs_shr_r64(mul_q30(h->row_q30[2][1], inv_q28) * (int64_t)fx_recip.r, fx_recip.shift - 23u);
    if (!below(ax, COEF_MAX_Q28) || !below(ay, COEF_MAX_Q28) || !below(bx, COEF_MAX_Q28) || !below(by, COEF_MAX_Q28) ||
        !below(wx, W_COEF_MAX) || !below(wy, W_COEF_MAX)) {
        return;
    }
    h->ax_q28 = (int32_t)ax;
    h->ay_q28 = (int32_t)ay;
    h->bx_q28 = (int32_t)bx;
    h->by_q28 = (int32_t)by;
    h->wx_q35 = (int32_t)wx;
    h->wy_q35 = (int32_t)wy;
    /* Entries of the third column are at most 1, and 4 after the division: 32 bits. */
    const int32_t az_q28 = (int32_t)mul_q30(h->row_q30[0][2], inv_q28);
    const int32_t bz_q28 = (int32_t)mul_q30(h->row_q30[1][2], inv_q28);
    const int32_t wz_q28 = (int32_t)mul_q30(h->row_q30[2][2], inv_q28);
    const int64_t a0 = constant_of((int64_t)az_q28 * k->fx_q16, h->ax_q28, h->ay_q28, h);
    const int64_t b0 = constant_of((int64_t)bz_q28 * k->fy_q16, h->bx_q28, h->by_q28, h);
    const int64_t w0 = constant_of((int64_t)wz_q28 * (INT32_C(1) << 23), h->wx_q35, h->wy_q35, h);
    if (!below(a0, SHIFT_MAX_Q16) || !below(b0, SHIFT_MAX_Q16) || !below(w0, W0_MAX_Q23)) { return; }

    /* Each row rounds down twice; +1 centres that. The kernel wants the depth ratio less 1/2. */
    h->a0_q16 = (int32_t)a0 + 1;
    h->b0_q16 = (int32_t)b0 + 1;
    h->w0_q23 = (int32_t)w0 + 1 - (INT32_C(1) << 22);
    /* Half an output LSB, for the rounding. */
    h->cx_q13 = evs_shr_r(k->cx_q16, 3) + (1 << 8);
    h->cy_q13 = evs_shr_r(k->cy_q16, 3) + (1 << 8);
    h->fast = true;
}

void evs_homography_set(evs_homography_t *h, const evs_pinhole_t *k, evs_quat_t q_ba)
{
    EVS_ASSERT((h != NULL) && (evs_pinhole_check(k) == EVS_OK));
    const evs_mat3_t r = evs_quat_to_mat3(q_ba);
    const recip_t fx_recip = recip_of(k->fx_q16);
    const recip_t fy_recip = (k->fy_q16 == k->fx_q16) ? fx_recip : recip_of(k->fy_q16);
    const int32_t g_q30 = ratio_q30(k->fx_q16, fy_recip);
    const int32_t g_inv_q30 = ratio_q30(k->fy_q16, fx_recip);
    h->row_q30[0][0] = r.m[0][0];
    h->row_q30[0][1] = evs_q_mul_sat(r.m[0][1], g_q30, 30);
    h->row_q30[0][2] = r.m[0][2];
    h->row_q30[1][0] = evs_q_mul_sat(r.m[1][0], g_inv_q30, 30);
    h->row_q30[1][1] = r.m[1][1];
    h->row_q30[1][2] = r.m[1][2];
    h->row_q30[2][0] = r.m[2][0];
    h->row_q30[2][1] = evs_q_mul_sat(r.m[2][1], g_q30, 30);
    h->row_q30[2][2] = r.m[2][2];
    h->fx_q16 = k->fx_q16;
    h->fy_q16 = k->fy_q16;
    h->cx_q16 = k->cx_q16;
    h->cy_q16 = k->cy_q16;
    h->fast = false;
    set_fast(h, k, fx_recip);
}

/* c + fx num / z in 1/16 px, rounded half up; false when beyond the range of a point. z in [2^30, 2^31). */
static bool quotient_q4(int64_t num, int64_t z, int32_t fx_q16, int32_t c_q16, int16_t *out_q4)
{
    /* |c + fx num / z| <= 2048 px means |num| <= (2048 px + |c|) z / fx, which keeps the product below within 2^60. */
    const int64_t reach_q16 = (INT64_C(2048) << 16) + (int64_t)evs_abs_u32(c_q16);
    const int64_t magnitude = (num < 0) ? -num : num;
    if (magnitude > (reach_q16 * z) / fx_q16) { return false; }
    const int64_t x_q16 = c_q16 + (num * fx_q16) / z;
    const int64_t x_q4 = evs_shr_r64(x_q16, 12);
    if (!below(x_q4, EVS_POINT_MAX_Q4 + 1)) { return false; }
    *out_q4 = (int16_t)x_q4;
    return true;
}

evs_point_t evs_homography_map_exact(const evs_homography_t *h, evs_point_t p)
{
    if (evs_point_is_outside(p)) { return p; }
    const int64_t dx_q16 = (int64_t)p.x_q4 * 4096 - h->cx_q16;
    const int64_t dy_q16 = (int64_t)p.y_q4 * 4096 - h->cy_q16;
    const int64_t x_q46 = h->row_q30[0][0] * dx_q16 + h->row_q30[0][1] * dy_q16 + (int64_t)h->row_q30[0][2] * h->fx_q16;
    const int64_t y_q46 = h->row_q30[1][0] * dx_q16 + h->row_q30[1][1] * dy_q16 + (int64_t)h->row_q30[1][2] * h->fy_q16;
    const int64_t z_q46 = h->row_q30[2][0] * dx_q16 + h->row_q30[2][1] * dy_q16 + (int64_t)h->row_q30[2][2] * h->fx_q16;
    if (z_q46 < (INT64_C(1) << 30)) { return evs_point_outside(); } /* behind the camera or at its plane */

    const unsigned down = 33u - evs_clz64((uint64_t)z_q46); /* z to 31 bits */
    evs_point_t mapped;
    const int64_t z = z_q46 >> down;
    if (!quotient_q4(x_q46 >> down, z, h->fx_q16, h->cx_q16, &mapped.x_q4) ||
        !quotient_q4(y_q46 >> down, z, h->fx_q16, h->cy_q16, &mapped.y_q4)) {
        return evs_point_outside();
    }
    return mapped;
}

void evs_homography_map_plain(const evs_homography_t *h, const evs_point_t *in, size_t n, evs_point_t *out)
{
    for (size_t i = 0u; i < n; i++) { out[i] = map_fast(h, in[i]); }
}

void evs_homography_map(const evs_homography_t *h, const evs_point_t *in, size_t n, evs_point_t *out)
{
    EVS_ASSERT((h != NULL) && (((in != NULL) && (out != NULL)) || (n == 0u)));
    if (!h->fast) {
        for (size_t i = 0u; i < n; i++) { out[i] = evs_homography_map_exact(h, in[i]); }
        return;
    }
#if EVS_SIMD_X86
    if (__builtin_cpu_supports("avx2")) {
        evs_homography_map_avx2(h, in, n, out);
        return;
    }
#endif
    size_t done = 0u;
#if EVS_SIMD_MVE
    done = evs_homography_map_mve(h, in, n, out);
#elif EVS_SIMD_DSP
    done = evs_homography_map_dsp(h, in, n, out);
#endif
    if (done < n) { evs_homography_map_plain(h, in + done, n - done, out + done); }
}
