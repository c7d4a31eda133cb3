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

/* How well the vectors fit a direction and its opposite: each gives 3, 2, 1 or 0 points for a residual below 1/4, 1/2 or 1
 * of the median flow, to the sign for which its inverse depth is positive. Stairs in place of a smooth kernel spare a
 * division per vector and hypothesis, and cost no accuracy. */
static void score(const ego_set_t *set, uint32_t stride_q16, uint32_t n, ego_dir_t dir, uint32_t points[2])
{
    uint32_t all = 0u;
    uint32_t forward = 0u;
    uint32_t at_q16 = 0u;
    for (uint32_t i = 0u; i < n; i++, at_q16 += stride_q16) {
        const ego_view_t w = ego_view(&set->vec[at_q16 >> 16], dir);
        const uint32_t c = evs_abs_u32(w.c) >> 13;
        const uint32_t c2 = c * c;
        const uint32_t k = w.a2 >> 6; /* (median |a|)^2 in the unit of c2 */
        const uint32_t got = (uint32_t)(c2 < k) + (uint32_t)(c2 < (k >> 2)) + (uint32_t)(c2 < (k >> 4));
        all += got;
        if (w.d > 0) { forward += got; }
    }
    points[0] = forward;
    points[1] = all - forward;
}

evs_vec3_t ego_search(const ego_set_t *set)
{
    const uint32_t n = (set->n < EGO_SUBSET) ? set->n : EGO_SUBSET;
    const uint32_t stride_q16 = (set->n << 16) / n; /* n <= 65535 */
    uint32_t most = 0u;
    evs_vec3_t best = {0, 0, EVS_ONE_Q30};
    for (int h = 0; h < N_HYPOTHESES; h++) {
        const evs_vec3_t v = {HEMISPHERE[h][0] * 65536, HEMISPHERE[h][1] * 65536, HEMISPHERE[h][2] * 65536};
        uint32_t points[2];
        score(set, stride_q16, n, ego_dir(set, v), points);
        if (points[0] > most) {
            most = points[0];
            best = v;
        }
        if (points[1] > most) {
            most = points[1];
            best = (evs_vec3_t){-v.x, -v.y, -v.z};
        }
    }
    return best;
}
