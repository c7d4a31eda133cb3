/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/orientation_track.h"

#define OFFSET_MAX_US  INT32_C(10000000)
#define GAP_MAX_US     UINT32_C(1000000)
#define PREDICT_MAX_US UINT32_C(50000)

evs_orientation_track_config_t evs_orientation_track_config_default(void)
{
    const evs_orientation_track_config_t cfg = {.offset_us = 0, .max_gap_us = 100000u, .max_predict_us = 5000u};
    return cfg;
}

evs_status_t evs_orientation_track_init(evs_orientation_track_t *track, const evs_orientation_track_config_t *cfg,
                                        evs_orientation_t *ring, size_t n_ring)
{
    if ((track == NULL) || (cfg == NULL) || (ring == NULL)) { return EVS_ERR_NULL; }
    if ((cfg->offset_us < -OFFSET_MAX_US) || (cfg->offset_us > OFFSET_MAX_US) || (cfg->max_gap_us < 1u) ||
        (cfg->max_gap_us > GAP_MAX_US) || (cfg->max_predict_us > PREDICT_MAX_US)) {
        return EVS_ERR_ARG;
    }
    if (n_ring < EVS_ORIENTATION_TRACK_MIN) { return EVS_ERR_SIZE; }
    *track = (evs_orientation_track_t){.cfg = *cfg, .ring = ring, .n_ring = n_ring};
    return EVS_OK;
}

evs_status_t evs_orientation_track_push(evs_orientation_track_t *track, const evs_orientation_t *sample)
{
    EVS_ASSERT((track != NULL) && (sample != NULL));
    const evs_clock_verdict_t verdict = evs_clock_step(&track->clock, sample->t_us, false);
    if (verdict == EVS_CLOCK_BACK) { return EVS_ERR_TIME; }
    if (verdict == EVS_CLOCK_RESTART) { track->n_used = 0u; }

    track->newest = (track->n_used == 0u) ? 0u : (track->newest + 1u) % track->n_ring;
    track->ring[track->newest] = *sample;
    if (track->n_used < track->n_ring) { track->n_used++; }
    return EVS_OK;
}

/* The sample `age` places before the newest. */
static const evs_orientation_t *sample_back(const evs_orientation_track_t *track, size_t age)
{
    const size_t i = (track->newest >= age) ? track->newest - age : track->newest + track->n_ring - age;
    return &track->ring[i];
}

/* a + (b - a) s, s in Q30. */
static evs_vec3_t mix(evs_vec3_t a, evs_vec3_t b, int32_t s_q30)
{
    return evs_vec3_add(a, evs_vec3_scale(evs_vec3_sub(b, a), s_q30, 30));
}

/* part / whole in Q30, for 0 <= part <= whole <= 10^6. */
static int32_t fraction_q30(int32_t part, int32_t whole)
{
    unsigned shift;
    const uint32_t r = evs_recip_u32((uint32_t)whole, &shift);
    return (int32_t)evs_shr_r64((int64_t)part * (int64_t)(r >> 1), shift - 31u);
}

static void interpolate(const evs_orientation_t *a, const evs_orientation_t *b, int32_t from_a_us, int32_t span_us,
                        evs_orientation_t *at)
{
    /*
     * r(t) = log(q_a^-1 q(t)) runs from 0 to phi. Its slope at a is the rate; at b it is the rate carried back into
     * the tangent space at a by the inverse right Jacobian, w + phi x w / 2 + phi x (phi x w) / 12 (rest O(phi^4)).
     */
    const int32_t s = fraction_q30(from_a_us, span_us);
    const evs_vec3_t phi = evs_quat_to_rotvec(evs_quat_mul(evs_quat_conj(a->q_wc), b->q_wc));
    const evs_vec3_t start = evs_rotvec_of_rate(a->rate_rad_s_q24, span_us);
    const evs_vec3_t end_b = evs_rotvec_of_rate(b->rate_rad_s_q24, span_us);
    const evs_vec3_t bend = evs_vec3_cross(phi, end_b, 28);
    const evs_vec3_t bend2 = evs_vec3_cross(phi, bend, 28);
    const evs_vec3_t end = evs_vec3_add(evs_vec3_add(end_b, evs_vec3_scale(bend, 1, 1)),
                                        evs_vec3_scale(bend2, INT32_C(89478485), 30)); /* 1 / 12 */

    const int32_t ss = evs_q_mul(s, s, 30);
    const int32_t sss = evs_q_mul(ss, s, 30);
    const int32_t h_start = sss - 2 * ss + s; /* s (1 - s)^2 */
    const int32_t h_end = sss - ss;           /* s^2 (s - 1) */
    const int32_t h_phi = ss - 2 * h_end;     /* 3 s^2 - 2 s^3 */
    const evs_vec3_t r = evs_vec3_add(evs_vec3_scale(phi, h_phi, 30),
                                      evs_vec3_add(evs_vec3_scale(start, h_start, 30), evs_vec3_scale(end, h_end, 30)));
    at->q_wc = evs_quat_mul(a->q_wc, evs_quat_from_rotvec(r));
    at->rate_rad_s_q24 = mix(a->rate_rad_s_q24, b->rate_rad_s_q24, s);
}

/* Past the newest sample b: its rate and the angular acceleration since the sample a before it (may be NULL) are held.
 */
static void predict(const evs_orientation_t *a, const evs_orientation_t *b, int32_t ahead_us, evs_orientation_t *at)
{
    evs_vec3_t mean_rate = b->rate_rad_s_q24;
    evs_vec3_t end_rate = b->rate_rad_s_q24;
    if (a != NULL) {
        const int32_t span_us = evs_time_diff_us(b->t_us, a->t_us);
        const int64_t change_q16 = evs_shl64(ahead_us, 16) / span_us;
        const evs_vec3_t step = evs_vec3_sub(b->rate_rad_s_q24, a->rate_rad_s_q24);
        mean_rate = evs_vec3_add(mean_rate, evs_vec3_scale(step, (int32_t)change_q16, 17));
        end_rate = evs_vec3_add(end_rate, evs_vec3_scale(step, (int32_t)change_q16, 16));
    }
    at->q_wc = evs_quat_mul(b->q_wc, evs_quat_from_rotvec(evs_rotvec_of_rate(mean_rate, ahead_us)));
    at->rate_rad_s_q24 = end_rate;
}

evs_status_t evs_orientation_track_at(const evs_orientation_track_t *track, uint32_t t_us, evs_orientation_t *at)
{
    EVS_ASSERT((track != NULL) && (at != NULL));
    if (track->n_used == 0u) { return EVS_ERR_STATE; }

    const uint32_t t_sample_us = t_us - (uint32_t)track->cfg.offset_us;
    const evs_orientation_t *newer = sample_back(track, 0u);
    const int32_t ahead_us = evs_time_diff_us(t_sample_us, newer->t_us);
    evs_orientation_t answer = {.t_us = t_us, .q_wc = newer->q_wc, .rate_rad_s_q24 = newer->rate_rad_s_q24};
    if (ahead_us > 0) {
        if ((uint32_t)ahead_us > track->cfg.max_predict_us) { return EVS_ERR_TOO_NEW; }
        const evs_orientation_t *before = (track->n_used > 1u) ? sample_back(track, 1u) : NULL;
        /* An acceleration is told by samples about as close as the prediction is long, or not at all. */
        const int32_t span_us = (before != NULL) ? evs_time_diff_us(newer->t_us, before->t_us) : 0;
        const bool close = ((uint32_t)span_us <= track->cfg.max_gap_us) && (ahead_us <= 8 * span_us);
        predict(close ? before : NULL, newer, ahead_us, &answer);
        *at = answer;
        return EVS_OK;
    }
    if (ahead_us == 0) {
        *at = answer;
        return EVS_OK;
    }

    for (size_t age = 1u; age < track->n_used; age++) {
        const evs_orientation_t *older = sample_back(track, age);
        const int32_t from_older_us = evs_time_diff_us(t_sample_us, older->t_us);
        if (from_older_us == 0) {
            *at = *older;
            at->t_us = t_us;
            return EVS_OK;
        }
        if (from_older_us > 0) {
            const int32_t span_us = evs_time_diff_us(newer->t_us, older->t_us);
            if ((uint32_t)span_us > track->cfg.max_gap_us) { return EVS_ERR_GAP; }
            interpolate(older, newer, from_older_us, span_us, &answer);
            *at = answer;
            return EVS_OK;
        }
        newer = older;
    }
    return EVS_ERR_TOO_OLD;
}

evs_status_t evs_orientation_track_newest(const evs_orientation_track_t *track, uint32_t *t_us)
{
    if ((track == NULL) || (t_us == NULL)) { return EVS_ERR_NULL; }
    if (track->n_used == 0u) { return EVS_ERR_STATE; }
    *t_us = sample_back(track, 0u)->t_us + (uint32_t)track->cfg.offset_us;
    return EVS_OK;
}

uint32_t evs_orientation_track_n_dropped(const evs_orientation_track_t *track) { return track->clock.n_back; }
