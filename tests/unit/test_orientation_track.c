/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/orientation_track.h"
#include "model.h"
#include "unity.h"

enum { N_RING = 16 };

static evs_orientation_track_t track;
static evs_orientation_t ring[N_RING + 1]; /* the last one is a canary */

static void init_with(int32_t offset_us, uint32_t max_gap_us, uint32_t max_predict_us)
{
    const evs_orientation_track_config_t cfg = {offset_us, max_gap_us, max_predict_us};
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_init(&track, &cfg, ring, N_RING));
}

void setUp(void)
{
    ring[N_RING].t_us = 0x5A5A5A5Au;
    init_with(0, 100000u, 5000u);
}
void tearDown(void) { TEST_ASSERT_EQUAL_HEX32_MESSAGE(0x5A5A5A5Au, ring[N_RING].t_us, "wrote past the ring"); }

/* A shaken flight: q(t) = exp(b(t)) exp(a(t)) with smooth a, b; its body rate by a small difference. */
static model_quat_t flight(double t_s)
{
    const model_quat_t slow = model_exp(0.5 * sin(1.1 * t_s), 0.8 * t_s, 0.3 * cos(0.7 * t_s));
    const model_quat_t flap = model_exp(0.14 * sin(31.4 * t_s), 0.02 * sin(62.8 * t_s + 1.0), 0.03 * cos(31.4 * t_s));
    return model_mul(slow, flap);
}

static evs_orientation_t flight_sample(double t_s, uint32_t t_us)
{
    const double h = 1e-5;
    const model_quat_t d = model_mul(model_conj(flight(t_s - h)), flight(t_s + h));
    const evs_orientation_t s = {.t_us = t_us,
                                 .q_wc = model_to_fixed(flight(t_s)),
                                 .rate_rad_s_q24 = evs_vec3_from_double(d.x / h, d.y / h, d.z / h, 24)};
    return s;
}

static void push_at(uint32_t t_us)
{
    const evs_orientation_t s = {.t_us = t_us, .q_wc = evs_quat_identity()};
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_push(&track, &s));
}

static void test_init_names_the_fault_and_leaves_the_context_alone(void)
{
    static const struct {
        evs_orientation_track_config_t cfg;
        size_t n_ring;
        evs_status_t want;
    } CASES[] = {
        {{-10000001, 1000, 0}, N_RING, EVS_ERR_ARG},
        {{10000001, 1000, 0}, N_RING, EVS_ERR_ARG},
        {{0, 0, 0}, N_RING, EVS_ERR_ARG},
        {{0, 1000001, 0}, N_RING, EVS_ERR_ARG},
        {{0, 1000, 50001}, N_RING, EVS_ERR_ARG},
        {{0, 1000, 0}, EVS_ORIENTATION_TRACK_MIN - 1u, EVS_ERR_SIZE},
        {{10000000, 1, 50000}, N_RING, EVS_OK},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        evs_orientation_track_t fresh = {.n_used = 7u};
        TEST_ASSERT_EQUAL_INT(CASES[i].want, evs_orientation_track_init(&fresh, &CASES[i].cfg, ring, CASES[i].n_ring));
        TEST_ASSERT_EQUAL_UINT(CASES[i].want == EVS_OK ? 0u : 7u, fresh.n_used);
    }
    const evs_orientation_track_config_t cfg = evs_orientation_track_config_default();
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_orientation_track_init(NULL, &cfg, ring, N_RING));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_orientation_track_init(&track, NULL, ring, N_RING));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_orientation_track_init(&track, &cfg, NULL, N_RING));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_init(&track, &cfg, ring, N_RING));
}

static void test_interpolation_follows_a_flapping_flight(void)
{
    static const struct {
        uint32_t period_us;
        double bound_rad;
    } CASES[] = {{1000, 1e-6}, {5000, 4e-6}, {10000, 5e-5}};
    for (size_t c = 0; c < sizeof CASES / sizeof CASES[0]; c++) {
        init_with(0, 100000u, 0u);
        uint32_t t_us = 4294000000u; /* runs across the wrap */
        double t_s = 0.0;
        evs_orientation_t s = flight_sample(t_s, t_us);
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_push(&track, &s));
        for (int i = 0; i < 200; i++) {
            const double next_s = t_s + CASES[c].period_us * 1e-6;
            s = flight_sample(next_s, t_us + CASES[c].period_us);
            TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_push(&track, &s));
            for (uint32_t part = 0; part <= CASES[c].period_us; part += CASES[c].period_us / 8u) {
                evs_orientation_t at;
                TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_at(&track, t_us + part, &at));
                TEST_ASSERT_EQUAL_UINT32(t_us + part, at.t_us);
                const double error = model_angle(flight(t_s + part * 1e-6), model_from_fixed(at.q_wc));
                TEST_ASSERT_DOUBLE_WITHIN(CASES[c].bound_rad, 0.0, error);
            }
            t_us += CASES[c].period_us;
            t_s = next_s;
        }
    }
}

/* The curve itself, in double precision. */
static model_quat_t hermite_model(const evs_orientation_t *a, const evs_orientation_t *b, double s)
{
    const model_quat_t qa = model_from_fixed(a->q_wc);
    const double span_s = evs_time_diff_us(b->t_us, a->t_us) * 1e-6;
    model_quat_t d = model_mul(model_conj(qa), model_from_fixed(b->q_wc));
    if (d.w < 0) { d = (model_quat_t){-d.w, -d.x, -d.y, -d.z}; }
    const double sine = sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
    const double k = (sine > 1e-12) ? 2.0 * atan2(sine, d.w) / sine : 2.0;
    const double phi[3] = {d.x * k, d.y * k, d.z * k};
    const double wa[3] = {evs_q_to_double(a->rate_rad_s_q24.x, 24) * span_s,
                          evs_q_to_double(a->rate_rad_s_q24.y, 24) * span_s,
                          evs_q_to_double(a->rate_rad_s_q24.z, 24) * span_s};
    const double wb[3] = {evs_q_to_double(b->rate_rad_s_q24.x, 24) * span_s,
                          evs_q_to_double(b->rate_rad_s_q24.y, 24) * span_s,
                          evs_q_to_double(b->rate_rad_s_q24.z, 24) * span_s};
    const double c1[3] = {phi[1] * wb[2] - phi[2] * wb[1], phi[2] * wb[0] - phi[0] * wb[2],
                          phi[0] * wb[1] - phi[1] * wb[0]};
    const double c2[3] = {phi[1] * c1[2] - phi[2] * c1[1], phi[2] * c1[0] - phi[0] * c1[2],
                          phi[0] * c1[1] - phi[1] * c1[0]};
    double r[3];
    for (int i = 0; i < 3; i++) {
        const double end = wb[i] + c1[i] / 2 + c2[i] / 12;
        r[i] = (s * (1 - s) * (1 - s)) * wa[i] + (s * s * (s - 1)) * end + (3 - 2 * s) * s * s * phi[i];
    }
    return model_mul(qa, model_exp(r[0], r[1], r[2]));
}

static void test_interpolation_is_within_1e_6_rad_of_the_curve_in_double(void)
{
    for (int i = 0; i < 3000; i++) {
        init_with(0, 1000000u, 0u);
        const uint32_t span_us = (uint32_t)model_uniform(1, 50000);
        const model_quat_t qa = model_random_rotation(6.0);
        const evs_vec3_t wa =
            evs_vec3_from_double(model_uniform(-20, 20), model_uniform(-20, 20), model_uniform(-20, 20), 24);
        const evs_vec3_t wb =
            evs_vec3_from_double(model_uniform(-20, 20), model_uniform(-20, 20), model_uniform(-20, 20), 24);
        const model_quat_t turn = model_random_rotation(1.0);
        const evs_orientation_t a = {100u, model_to_fixed(qa), wa};
        const evs_orientation_t b = {100u + span_us, model_to_fixed(model_mul(qa, turn)), wb};
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_push(&track, &a));
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_push(&track, &b));
        const uint32_t part = (uint32_t)model_uniform(0, span_us);
        evs_orientation_t at;
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_at(&track, 100u + part, &at));
        const model_quat_t want = hermite_model(&a, &b, (double)part / span_us);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.0, model_angle(want, model_from_fixed(at.q_wc)));
        TEST_ASSERT_DOUBLE_WITHIN(
            1e-5, evs_q_to_double(wa.x, 24) + (evs_q_to_double(wb.x, 24) - evs_q_to_double(wa.x, 24)) * part / span_us,
            evs_q_to_double(at.rate_rad_s_q24.x, 24));
    }
}

static void test_prediction_holds_rate_and_acceleration(void)
{
    for (int i = 0; i < 200; i++) {
        const double t_s = i * 0.013;
        init_with(0, 100000u, 5000u);
        const evs_orientation_t a = flight_sample(t_s - 0.001, 9000u);
        const evs_orientation_t b = flight_sample(t_s, 10000u);
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_push(&track, &a));
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_push(&track, &b));
        evs_orientation_t at;
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_at(&track, 12000u, &at));
        const double error = model_angle(flight(t_s + 0.002), model_from_fixed(at.q_wc));
        TEST_ASSERT_DOUBLE_WITHIN(2e-4, 0.0, error); /* holding the rate alone errs by up to 3e-4 */
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_at(&track, 15000u, &at));
        TEST_ASSERT_EQUAL_INT(EVS_ERR_TOO_NEW, evs_orientation_track_at(&track, 15001u, &at));
    }
}

static void test_prediction_from_a_single_sample_holds_its_rate(void)
{
    const evs_orientation_t only = {1000u, evs_quat_identity(), evs_vec3_from_double(2.0, 0.0, 0.0, 24)};
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_push(&track, &only));
    evs_orientation_t at;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_at(&track, 6000u, &at));
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0.0, model_angle(model_exp(0.01, 0, 0), model_from_fixed(at.q_wc)));
}

static void test_each_reason_for_no_answer_is_told_apart(void)
{
    evs_orientation_t at = {.t_us = 77u};
    TEST_ASSERT_EQUAL_INT(EVS_ERR_STATE, evs_orientation_track_at(&track, 0u, &at));
    push_at(1000u);
    push_at(2000u);
    push_at(102001u);
    TEST_ASSERT_EQUAL_INT(EVS_ERR_TOO_OLD, evs_orientation_track_at(&track, 999u, &at));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_GAP, evs_orientation_track_at(&track, 2001u, &at));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_TOO_NEW, evs_orientation_track_at(&track, 107002u, &at));
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(77u, at.t_us, "touched on error");
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_at(&track, 1000u, &at));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_at(&track, 2000u, &at));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_at(&track, 107001u, &at));
}

static void test_full_ring_forgets_the_oldest(void)
{
    for (uint32_t i = 0; i < 3u * N_RING; i++) { push_at(1000u * i); }
    evs_orientation_t at;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_at(&track, 1000u * (2u * N_RING), &at));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_TOO_OLD, evs_orientation_track_at(&track, 1000u * (2u * N_RING) - 1u, &at));
}

static void test_offset_moves_the_samples_in_event_time(void)
{
    init_with(-2000, 100000u, 0u);
    uint32_t newest_us = 1u;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_STATE, evs_orientation_track_newest(&track, &newest_us));
    push_at(10000u);
    push_at(11000u);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_newest(&track, &newest_us));
    TEST_ASSERT_EQUAL_UINT32(9000u, newest_us);
    evs_orientation_t at;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_at(&track, 8000u, &at));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_TOO_OLD, evs_orientation_track_at(&track, 7999u, &at));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_TOO_NEW, evs_orientation_track_at(&track, 9001u, &at));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_orientation_track_newest(&track, NULL));
}

static void test_time_running_back_is_dropped_until_the_clock_has_restarted(void)
{
    push_at(500000u);
    evs_orientation_t s = {.t_us = 1000u, .q_wc = evs_quat_identity()};
    for (uint32_t i = 0; i < EVS_CLOCK_RESTART_AFTER; i++) {
        TEST_ASSERT_EQUAL_INT(EVS_ERR_TIME, evs_orientation_track_push(&track, &s));
        s.t_us += 1000u;
    }
    TEST_ASSERT_EQUAL_UINT32(EVS_CLOCK_RESTART_AFTER, evs_orientation_track_n_dropped(&track));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_push(&track, &s));
    evs_orientation_t at;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_TOO_NEW, evs_orientation_track_at(&track, 500000u, &at));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_orientation_track_at(&track, s.t_us, &at));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_names_the_fault_and_leaves_the_context_alone);
    RUN_TEST(test_interpolation_follows_a_flapping_flight);
    RUN_TEST(test_interpolation_is_within_1e_6_rad_of_the_curve_in_double);
    RUN_TEST(test_prediction_holds_rate_and_acceleration);
    RUN_TEST(test_prediction_from_a_single_sample_holds_its_rate);
    RUN_TEST(test_each_reason_for_no_answer_is_told_apart);
    RUN_TEST(test_full_ring_forgets_the_oldest);
    RUN_TEST(test_offset_moves_the_samples_in_event_time);
    RUN_TEST(test_time_running_back_is_dropped_until_the_clock_has_restarted);
    return UNITY_END();
}
