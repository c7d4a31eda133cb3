/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The search for the basin that holds the answer: no refinement finds it by itself when many vectors are outliers. */
#include "evs_egomotion_private.h"
#include "evs_simd.h"

#include <string.h>

#if EVS_SIMD_X86
#include <emmintrin.h>
#endif

/* z = 1 - (i + 1/2) / 64, turned by the golden angle from one to the next: equal areas, gaps of 6.9 degrees on average
 * and at most 13.6. Q14. */
enum { N_HYPOTHESES = 64 };
static const int16_t HEMISPHERE[N_HYPOTHESES][3] = {
    {2044, 0, 16256},       {-2600, 2382, 16000},  {396, -4517, 15744},   {3251, 4241, 15488},   {-5943, -1051, 15232},
    {5607, -3567, 14976},   {-1868, 6948, 14720},  {-3547, -6830, 14464}, {7664, 2799, 14208},   {-7940, 3277, 13952},
    {3811, -8144, 13696},   {2804, 8941, 13440},   {-8416, -4877, 13184}, {9830, -2161, 12928},  {-5973, 8496, 12672},
    {-1374, -10601, 12416}, {8396, 7076, 12160},   {-11248, 465, 11904},  {8167, -8127, 11648},  {-544, 11763, 11392},
    {-7700, -9227, 11136},  {12141, 1633, 10880},  {-10238, 7124, 10624}, {2784, -12377, 10368}, {6409, 11185, 10112},
    {-12469, -3978, 9856},  {12053, -5569, 9600},  {-5196, 12415, 9344},  {-4614, -12828, 9088}, {12215, 6420, 8832},
    {-13499, 3558, 8576},   {7634, -11872, 8320},  {2416, 14056, 8064},   {-11388, -8820, 7808}, {14490, -1200, 7552},
    {-9962, 10769, 7296},   {72, -14794, 7040},    {10020, 11046, 6784},  {-14963, -1387, 6528}, {12057, -9151, 6272},
    {-2728, 14993, 6016},   {-8169, -12982, 5760}, {14883, 4079, 5504},   {-13809, 7086, 5248},  {5425, -14632, 4992},
    {5914, 14527, 4736},    {-14241, -6749, 4480}, {15127, -4664, 4224},  {-8037, 13715, 3968},  {-3350, -15602, 3712},
    {13056, 9275, 3456},    {-15945, 1987, 3200},  {10447, -12273, 2944}, {589, 16151, 2688},    {-11373, -11540, 2432},
    {16218, 829, 2176},     {-12543, 10364, 1920}, {2252, -16143, 1664},  {9257, 13445, 1408},   {-15927, -3665, 1152},
    {14234, -8064, 896},    {-5052, 15573, 640},   {-6797, -14903, 384},  {15082, 6399, 128},
};

/* A vector fits within s = 0.35 of the median flow, the root of 1/8. */
enum { S = 362, S2 = S * S, K_MAX_Q12 = 16 << 12 };

static void put_normal(int32_t x, int32_t y, int32_t z, int16_t xy[2], int16_t *z_out)
{
    const unsigned n_lead = evs_clz32(evs_abs_u32(x) | evs_abs_u32(y) | evs_abs_u32(z));
    const unsigned down = (n_lead < 17u) ? 17u - n_lead : 0u;
    xy[0] = (int16_t)(x >> down);
    xy[1] = (int16_t)(y >> down);
    *z_out = (int16_t)(z >> down);
}

/* c and d are linear in V: c = n V, d = m V. As c^2 + d^2 = |u|^2 |a|^2, the residual is below s and the depth positive
 * where |c| <= k d, k = s / sqrt(|u|^2 - s^2): that is where the products of V with k m + n and with k m - n are both
 * positive. For -V both are negative. */
static void make_wedge(const evs_ego_set_t *set, const evs_ego_vector_t *p, uint32_t i)
{
    const int32_t u2 = p->u * p->u + p->v * p->v;
    const unsigned shift = set->one_bits + 1u;
    const int32_t mz = (p->u * p->x + p->v * p->y) >> shift;
    int32_t k_q12 = K_MAX_Q12;
    if (u2 > S2 + S2 / 256) { k_q12 = (int32_t)((uint32_t)(S << 12) / evs_sqrt_u64((uint64_t)(uint32_t)(u2 - S2))); }
    const int32_t m[3] = {(-p->u * k_q12) >> 12, (-p->v * k_q12) >> 12, (int32_t)(((int64_t)mz * k_q12) >> 12)};
    const int32_t n[3] = {p->v, -p->u, (p->u * p->y - p->v * p->x) >> shift};
    evs_ego_subset_t *const w = set->subset;
    put_normal(m[0] + n[0], m[1] + n[1], m[2] + n[2], w->a_xy[i], &w->a_z[i]);
    put_normal(m[0] - n[0], m[1] - n[1], m[2] - n[2], w->b_xy[i], &w->b_z[i]);
}

/* Every so many of the vectors, so that they come from all over the list. */
static uint32_t pick(const evs_ego_set_t *set)
{
    const uint32_t n = (set->n < EVS_EGO_SUBSET) ? set->n : EVS_EGO_SUBSET;
    const uint32_t stride_q16 = (set->n << 16) / n; /* n <= 65535 */
    uint32_t at_q16 = 0u;
    for (uint32_t i = 0u; i < n; i++, at_q16 += stride_q16) { make_wedge(set, &set->vec[at_q16 >> 16], i); }
    return n;
}

#if EVS_SIMD_DSP

typedef struct {
    int32_t xy; /* packed */
    int32_t z;
} plane_t;

static inline plane_t plane(const int16_t v[3])
{
    const plane_t p = {(int32_t)((uint32_t)(uint16_t)v[0] | ((uint32_t)(uint16_t)v[1] << 16)), v[2]};
    return p;
}

static inline int32_t product(const int16_t xy[2], int16_t z, plane_t v)
{
    int32_t both;
    int32_t sum;
    memcpy(&both, xy, sizeof both);
    __asm__("smlad %0, %1, %2, %3" : "=r"(sum) : "r"(both), "r"(v.xy), "r"(z * v.z));
    return sum;
}

#else

typedef struct {
    int32_t x;
    int32_t y;
    int32_t z;
} plane_t;

static inline plane_t plane(const int16_t v[3])
{
    const plane_t p = {v[0], v[1], v[2]};
    return p;
}

static inline int32_t product(const int16_t xy[2], int16_t z, plane_t v) { return xy[0] * v.x + xy[1] * v.y + z * v.z; }

#endif

/* Of vectors: how many do not fit a direction, and how many fit its opposite. */
typedef struct {
    uint32_t not_forward;
    uint32_t backward;
} tally_t;

#if EVS_SIMD_X86

/* The products of four pairs and their z with V, in 32 bits each. */
static inline __m128i products(const int16_t (*xy)[2], const int16_t *z, __m128i v_xy, __m128i v_z)
{
    const __m128i pairs = _mm_loadu_si128((const __m128i *)(const void *)xy);
    const __m128i four_z = _mm_unpacklo_epi16(_mm_loadl_epi64((const __m128i *)(const void *)z), _mm_setzero_si128());
    return _mm_add_epi32(_mm_madd_epi16(pairs, v_xy), _mm_madd_epi16(four_z, v_z));
}

static inline uint32_t sum_of_four(__m128i x)
{
    const __m128i two = _mm_add_epi32(x, _mm_shuffle_epi32(x, _MM_SHUFFLE(1, 0, 3, 2)));
    return (uint32_t)_mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32(two, _MM_SHUFFLE(2, 3, 0, 1))));
}

/* Vectors [from, to) by fours, as far as these go; returns where they end. */
static uint32_t tally_fours(const evs_ego_subset_t *w, uint32_t from, uint32_t to, const int16_t v[3], tally_t *tally)
{
    const __m128i v_xy = _mm_set1_epi32((int32_t)((uint32_t)(uint16_t)v[0] | ((uint32_t)(uint16_t)v[1] << 16)));
    const __m128i v_z = _mm_set1_epi32((uint16_t)v[2]);
    __m128i not_forward = _mm_setzero_si128();
    __m128i backward = _mm_setzero_si128();
    uint32_t i = from;
    for (; i + 4u <= to; i += 4u) {
        const __m128i a = products(&w->a_xy[i], &w->a_z[i], v_xy, v_z);
        const __m128i b = products(&w->b_xy[i], &w->b_z[i], v_xy, v_z);
        not_forward = _mm_add_epi32(not_forward, _mm_srli_epi32(_mm_or_si128(a, b), 31));
        backward = _mm_add_epi32(backward, _mm_srli_epi32(_mm_and_si128(a, b), 31));
    }
    tally->not_forward += sum_of_four(not_forward);
    tally->backward += sum_of_four(backward);
    return i;
}

#else

static inline uint32_t tally_fours(const evs_ego_subset_t *w, uint32_t from, uint32_t to, const int16_t v[3],
                                   tally_t *tally)
{
    (void)w;
    (void)to;
    (void)v;
    (void)tally;
    return from;
}

#endif

/* How many of the vectors [from, to) fit a direction and its opposite. A plain count spares a division per vector and
 * hypothesis. */
static void score(const evs_ego_subset_t *w, uint32_t from, uint32_t to, const int16_t v[3], uint8_t points[2])
{
    const plane_t p = plane(v);
    tally_t tally = {0u, 0u};
    for (uint32_t i = tally_fours(w, from, to, v, &tally); i < to; i++) {
        const int32_t a = product(w->a_xy[i], w->a_z[i], p);
        const int32_t b = product(w->b_xy[i], w->b_z[i], p);
        tally.not_forward += (uint32_t)(a | b) >> 31;
        tally.backward += (uint32_t)(a & b) >> 31;
    }
    points[0] = (uint8_t)(points[0] + (to - from - tally.not_forward));
    points[1] = (uint8_t)(points[1] + tally.backward);
}

enum { APART_Q28 = 243283000 }; /* the cosine of 25 degrees */

static int32_t dot_q28(const int16_t a[3], const int16_t b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

uint32_t evs_ego_search(const evs_ego_set_t *set, evs_vec3_t best[EVS_EGO_CANDIDATES])
{
    const uint32_t n = pick(set);
    uint8_t points[N_HYPOTHESES][2];
    const uint32_t half = (n + 1u) / 2u;
    uint32_t most = 0u;
    for (int h = 0; h < N_HYPOTHESES; h++) {
        points[h][0] = 0u;
        points[h][1] = 0u;
        score(set->subset, 0u, half, HEMISPHERE[h], points[h]);
        for (int i = 0; i < 2; i++) {
            if (points[h][i] > most) { most = points[h][i]; }
        }
    }
    for (int h = 0; h < N_HYPOTHESES; h++) { /* what is far behind half-way does not win */
        if ((points[h][0] * 8u >= most * 5u) || (points[h][1] * 8u >= most * 5u)) {
            score(set->subset, half, n, HEMISPHERE[h], points[h]);
        }
    }
    for (uint32_t k = 0u; k < EVS_EGO_CANDIDATES; k++) {
        int at = 0;
        int side = 0;
        for (int h = 0; h < N_HYPOTHESES; h++) {
            for (int i = 0; i < 2; i++) {
                if (points[h][i] <= points[at][side]) { continue; }
                at = h;
                side = i;
            }
        }
        if ((k > 0u) && (points[at][side] * 8u <= most * 5u)) { return k; }
        if (k == 0u) { most = points[at][side]; }
        const int32_t sign = (side == 0) ? 65536 : -65536;
        const evs_vec3_t v = {HEMISPHERE[at][0] * sign, HEMISPHERE[at][1] * sign, HEMISPHERE[at][2] * sign};
        if (evs_vec3_normalize(v, &best[k]) != EVS_OK) { best[k] = v; } /* the table is rounded to 14 bits */
        for (int h = 0; h < N_HYPOTHESES; h++) {
            const int32_t cosine_q28 = dot_q28(HEMISPHERE[h], HEMISPHERE[at]);
            if (cosine_q28 > APART_Q28) { points[h][side] = 0u; }
            if (cosine_q28 < -APART_Q28) { points[h][1 - side] = 0u; }
        }
    }
    return EVS_EGO_CANDIDATES;
}
