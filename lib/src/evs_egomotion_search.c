/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The search for the basin that holds the answer: no refinement finds it by itself when many vectors are outliers. */
#include "evs_egomotion_private.h"

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

/* Every so many of the vectors, so that they come from all over the list. */
static uint32_t pick(const evs_ego_set_t *set)
{
    const uint32_t n = (set->n < EVS_EGO_SUBSET) ? set->n : EVS_EGO_SUBSET;
    const uint32_t stride_q16 = (set->n << 16) / n; /* n <= 65535 */
    evs_ego_subset_t *const s = set->subset;
    uint32_t at_q16 = 0u;
    for (uint32_t i = 0u; i < n; i++, at_q16 += stride_q16) {
        const evs_ego_vector_t p = set->vec[at_q16 >> 16];
        s->x[i] = p.x;
        s->y[i] = p.y;
        s->u[i] = p.u;
        s->v[i] = p.v;
    }
    return n;
}

/* How many vectors fit a direction and its opposite: the residual is below 0.35 of the median flow (the root of 1/8),
 * the inverse depth positive. A plain count spares a division per vector and hypothesis; the accuracy in the end is
 * that of a smooth kernel, and where an object moves by itself a narrow count is better. */
static void score(const evs_ego_subset_t *s, uint32_t n, evs_ego_dir_t dir, uint32_t points[2])
{
    uint32_t all = 0u;
    uint32_t forward = 0u;
    for (uint32_t i = 0u; i < n; i++) {
        const int32_t ax = (s->x[i] * dir.z - dir.x) >> 16;
        const int32_t ay = (s->y[i] * dir.z - dir.y) >> 16;
        const int32_t c = (s->u[i] * ay - s->v[i] * ax) >> 12;
        const int32_t d = s->u[i] * ax + s->v[i] * ay;
        const int32_t a2 = ax * ax + ay * ay;
        const uint32_t fits =
            ((uint32_t)c * (uint32_t)c <= (uint32_t)a2 >> 7) ? 1u : 0u; /* r^2 <= 2^20 / 8, over 2^24 */
        all += fits;
        forward += (d > 0) ? fits : 0u;
    }
    points[0] = forward;
    points[1] = all - forward;
}

evs_vec3_t evs_ego_search(const evs_ego_set_t *set)
{
    const uint32_t n = pick(set);
    uint32_t most = 0u;
    evs_vec3_t best = {0, 0, EVS_ONE_Q30};
    for (int h = 0; h < N_HYPOTHESES; h++) {
        const evs_vec3_t v = {HEMISPHERE[h][0] * 65536, HEMISPHERE[h][1] * 65536, HEMISPHERE[h][2] * 65536};
        uint32_t points[2];
        score(set->subset, n, evs_ego_dir(set, v), points);
        if (points[0] > most) {
            most = points[0];
            best = v;
        }
        if (points[1] > most) {
            most = points[1];
            best = (evs_vec3_t){-v.x, -v.y, -v.z};
        }
    }
    evs_vec3_t unit = best; /* the table is rounded to 14 bits */
    return (evs_vec3_normalize(best, &unit) == EVS_OK) ? unit : best;
}
