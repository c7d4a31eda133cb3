/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * The attitude filter as a whole: simulated flights with exact truth, an independent model in double precision, random
 * abuse, and a long time. The flights are sampled without an anti-alias filter, which is the harder case.
 */
#include "evs/attitude.h"
#include "evs/float.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>

#define PI  3.14159265358979323846
#define DEG (PI / 180.0)
#define G   9.80665

static evs_attitude_t att;

void setUp(void)
{
    const evs_attitude_config_t cfg = evs_attitude_config_default();
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_init(&att, &cfg));
}
void tearDown(void) {}

/* --- double precision ------------------------------------------------------------------------------------------ */

typedef struct {
    double w, x, y, z;
} quat_d;
typedef struct {
    double x, y, z;
} vec_d;

static quat_d mul_d(quat_d a, quat_d b)
{
    const quat_d r = {a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                      a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
    return r;
}
static quat_d conj_d(quat_d q)
{
    const quat_d r = {q.w, -q.x, -q.y, -q.z};
    return r;
}
static quat_d turn_d(double x, double y, double z)
{
    const double angle = sqrt(x * x + y * y + z * z);
    const double s = (angle > 0.0) ? sin(angle / 2.0) / angle : 0.5;
    const quat_d r = {cos(angle / 2.0), s * x, s * y, s * z};
    return r;
}
static vec_d rotate_d(quat_d q, vec_d v)
{
    const quat_d p = {0.0, v.x, v.y, v.z};
    const quat_d r = mul_d(mul_d(q, p), conj_d(q));
    const vec_d out = {r.x, r.y, r.z};
    return out;
}
static quat_d orientation(void)
{
    const evs_quat_t q = evs_attitude_orientation(&att);
    const quat_d r = {evs_q_to_double(q.w, 30), evs_q_to_double(q.x, 30), evs_q_to_double(q.y, 30),
                      evs_q_to_double(q.z, 30)};
    return r;
}
static double norm_error(void)
{
    const quat_d q = orientation();
    return fabs(sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z) - 1.0);
}
static double angle_between(quat_d a, quat_d b)
{
    const quat_d e = mul_d(a, conj_d(b));
    return 2.0 * asin(fmin(1.0, sqrt(e.x * e.x + e.y * e.y + e.z * e.z))) / DEG;
}
static double tilt_between(quat_d a, quat_d b)
{
    const quat_d e = mul_d(a, conj_d(b));
    return 2.0 * asin(fmin(1.0, sqrt(e.x * e.x + e.y * e.y))) / DEG;
}
static evs_vec3_t fixed(vec_d v, unsigned n) { return evs_vec3_from_double(v.x, v.y, v.z, n); }

static uint32_t random_state = 1u;
static uint32_t next_random(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return random_state;
}
static double uniform(void) { return next_random() / 4294967296.0; }
static double gaussian(void) { return sqrt(-2.0 * log(uniform() + 1e-12)) * cos(2.0 * PI * uniform()); }

/* --- flights --------------------------------------------------------------------------------------------------- */

typedef struct {
    const char *name;
    double rate_hz;
    double tilt_max_deg, drift_max_deg; /* bounds of the RMS tilt error and of the heading at the end */
    double wander_deg, wander_hz;       /* slow roll and pitch */
    double flap_hz, heave_g, surge_g, flap_pitch_deg;
    double prop_hz, prop_g, prop_rate_deg_s;
    double turn_deg_s, speed_m_s; /* level turn with its centripetal acceleration */
    double clip_g;                /* 0: none */
} flight_t;

typedef struct {
    quat_d q; /* world from body */
    vec_d w;  /* body rate */
    vec_d f;  /* specific force, body */
} state_t;

static state_t fly(const flight_t *p, double t)
{
    const double wr = 2.0 * PI * p->wander_hz, wp = 2.0 * PI * p->wander_hz * 0.73, wf = 2.0 * PI * p->flap_hz;
    const double a = p->wander_deg * DEG, b = p->flap_pitch_deg * DEG, c = p->turn_deg_s * DEG;
    const double roll = a * sin(wr * t), roll_d = a * wr * cos(wr * t);
    const double pitch = a * sin(wp * t) + b * sin(wf * t), pitch_d = a * wp * cos(wp * t) + b * wf * cos(wf * t);
    state_t s;
    s.q = mul_d(mul_d(turn_d(0.0, 0.0, c * t), turn_d(0.0, pitch, 0.0)), turn_d(roll, 0.0, 0.0));
    s.w.x = roll_d - c * sin(pitch);
    s.w.y = pitch_d * cos(roll) + c * sin(roll) * cos(pitch);
    s.w.z = -pitch_d * sin(roll) + c * cos(roll) * cos(pitch);
    const vec_d world = {p->surge_g * G * sin(wf * t + 1.0) - p->speed_m_s * c * sin(c * t),
                         p->speed_m_s * c * cos(c * t), G + p->heave_g * G * sin(wf * t)};
    s.f = rotate_d(conj_d(s.q), world);
    const double v = 2.0 * PI * p->prop_hz * t;
    s.f.x += p->prop_g * G * sin(v);
    s.f.z += p->prop_g * G * sin(v + 2.0);
    s.w.x += p->prop_rate_deg_s * DEG * sin(v + 1.0);
    s.w.y += p->prop_rate_deg_s * DEG * cos(v + 1.0);
    return s;
}

static double clip(double x, double limit) { return (limit > 0.0) ? fmin(fmax(x, -limit), limit) : x; }

/* 12 s of rest, then 60 s of flight, without a magnetometer. Bias 0.3 deg/s, noise of a common MEMS part. */
static void run_flight(const flight_t *p, double *tilt_rms, double *drift)
{
    setUp();
    random_state = 12345u;
    const double dt = 1.0 / p->rate_hz;
    const vec_d bias = {0.3 * DEG, -0.3 * DEG, 0.2 * DEG};
    double sum = 0.0, angle = 0.0;
    uint32_t n = 0u;
    for (uint32_t i = 0u; i * dt < 72.0; i++) {
        const double t = i * dt - 12.0;
        static const flight_t REST = {.name = "rest"};
        const state_t s = fly((t < 0.0) ? &REST : p, (t < 0.0) ? 0.0 : t);
        const vec_d w = {s.w.x + bias.x + 0.002 * gaussian(), s.w.y + bias.y + 0.002 * gaussian(),
                         s.w.z + bias.z + 0.002 * gaussian()};
        const vec_d f = {clip(s.f.x + 0.03 * gaussian(), p->clip_g * G), clip(s.f.y + 0.03 * gaussian(), p->clip_g * G),
                         clip(s.f.z + 0.03 * gaussian(), p->clip_g * G)};
        const uint32_t t_us = (uint32_t)(i * (dt * 1e6) + 0.5);
        evs_attitude_push_gyro(&att, t_us, fixed(w, 24));
        evs_attitude_push_accel(&att, t_us, fixed(f, 20));
        if (t > 0.0) {
            const double tilt = tilt_between(orientation(), s.q);
            sum += tilt * tilt;
            n++;
            const quat_d e = mul_d(orientation(), conj_d(s.q));
            angle = fabs(2.0 * atan2(e.z, e.w)) / DEG;
            angle = fmin(angle, 360.0 - angle);
        }
    }
    *tilt_rms = sqrt(sum / n);
    *drift = angle;
}

static void test_flights_with_exact_truth(void)
{
    static const flight_t FLIGHTS[] = {
        {.name = "hover", .rate_hz = 200, .tilt_max_deg = 0.1, .drift_max_deg = 0.5, .wander_deg = 3, .wander_hz = 0.1},
        {.name = "flap 5 Hz, 200 Hz",
         .rate_hz = 200,
         .tilt_max_deg = 0.9,
         .drift_max_deg = 2.0,
         .wander_deg = 5,
         .wander_hz = 0.2,
         .flap_hz = 5,
         .heave_g = 1.2,
         .surge_g = 0.4,
         .flap_pitch_deg = 8},
        {.name = "flap 5 Hz, 1 kHz",
         .rate_hz = 1000,
         .tilt_max_deg = 0.3,
         .drift_max_deg = 1.0,
         .wander_deg = 5,
         .wander_hz = 0.2,
         .flap_hz = 5,
         .heave_g = 1.2,
         .surge_g = 0.4,
         .flap_pitch_deg = 8},
        {.name = "flap, clipped at 2 g",
         .rate_hz = 1000,
         .tilt_max_deg = 0.7,
         .drift_max_deg = 1.0,
         .wander_deg = 5,
         .wander_hz = 0.2,
         .flap_hz = 5,
         .heave_g = 1.2,
         .surge_g = 0.4,
         .flap_pitch_deg = 8,
         .clip_g = 2},
        {.name = "propeller 183 Hz, 1 kHz",
         .rate_hz = 1000,
         .tilt_max_deg = 0.1,
         .drift_max_deg = 0.5,
         .wander_deg = 3,
         .wander_hz = 0.1,
         .prop_hz = 183,
         .prop_g = 1,
         .prop_rate_deg_s = 20},
        {.name = "propeller, 200 Hz",
         .rate_hz = 200,
         .tilt_max_deg = 0.6,
         .drift_max_deg = 3.0,
         .wander_deg = 3,
         .wander_hz = 0.1,
         .prop_hz = 183,
         .prop_g = 1,
         .prop_rate_deg_s = 20},
        /* sustained acceleration is what no accelerometer reference survives: atan(v w / g) = 10 deg is the limit */
        {.name = "level turns",
         .rate_hz = 200,
         .tilt_max_deg = 8.5,
         .drift_max_deg = 15.0,
         .turn_deg_s = 25,
         .speed_m_s = 4},
    };
    for (size_t i = 0; i < sizeof FLIGHTS / sizeof FLIGHTS[0]; i++) {
        double tilt, drift;
        run_flight(&FLIGHTS[i], &tilt, &drift);
        (void)printf("%-26s tilt %.3f deg rms, heading %.3f deg after 60 s\n", FLIGHTS[i].name, tilt, drift);
        TEST_ASSERT_TRUE_MESSAGE(tilt < FLIGHTS[i].tilt_max_deg, FLIGHTS[i].name);
        TEST_ASSERT_TRUE_MESSAGE(drift < FLIGHTS[i].drift_max_deg, FLIGHTS[i].name);
        TEST_ASSERT_DOUBLE_WITHIN(4e-9, 0.0, norm_error());
        const evs_attitude_faults_t f = evs_attitude_faults(&att);
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(0u, f.n_gyro_spikes + f.n_accel_bad + f.n_time_bad, FLIGHTS[i].name);
    }
}

/* --- the model, in double precision ---------------------------------------------------------------------------- */

/* What docs/modules/attitude.md says, written from there: no rest, no rejection, an orientation that was given. */
typedef struct {
    quat_d q;
    vec_d slope, field;
    double gravity, cx, cy, cz;
    bool has_field;
} model_t;

static void model_gyro(model_t *m, vec_d w, double dt)
{
    m->q = mul_d(mul_d(turn_d(m->cx * dt, m->cy * dt, m->cz * dt), m->q), turn_d(w.x * dt, w.y * dt, w.z * dt));
}
static void model_accel(model_t *m, vec_d f, double dt, double tau)
{
    const vec_d a = rotate_d(m->q, f);
    m->slope.x += 2.0 * dt / tau * (a.x - m->slope.x);
    m->slope.y += 2.0 * dt / tau * (a.y - m->slope.y);
    m->slope.z += 2.0 * dt / tau * (a.z - m->gravity - m->slope.z);
    m->gravity += dt / tau * m->slope.z;
    m->cx = m->slope.y / (tau * m->gravity);
    m->cy = -m->slope.x / (tau * m->gravity);
}
static void model_mag(model_t *m, vec_d b, double dt, double tau)
{
    const vec_d w = rotate_d(m->q, b);
    if (!m->has_field) {
        m->field = w;
        m->has_field = true;
        return;
    }
    m->field.x += dt / 0.2 * (w.x - m->field.x);
    m->field.y += dt / 0.2 * (w.y - m->field.y);
    m->field.z += dt / 0.2 * (w.z - m->field.z);
    m->cz = atan2(m->field.x, m->field.y) / tau;
}

static void test_fixed_point_follows_the_model_in_double_precision(void)
{
    /* The product of the rotation and the correction of one step is left out: it matters at long steps only. */
    static const double RATES_HZ[] = {50.0, 285.714, 1000.0, 8000.0};
    static const double BOUNDS_DEG[] = {0.08, 0.015, 0.005, 0.005};
    evs_attitude_config_t cfg = evs_attitude_config_default();
    cfg.learn_bias = false;
    cfg.reject_mag = false;
    for (size_t k = 0; k < sizeof RATES_HZ / sizeof RATES_HZ[0]; k++) {
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_init(&att, &cfg));
        model_t m = {.q = turn_d(0.2, -0.1, 0.4), .gravity = G};
        TEST_ASSERT_EQUAL_INT(EVS_OK,
                              evs_attitude_set_orientation(&att, evs_quat_from_double(m.q.w, m.q.x, m.q.y, m.q.z)));
        double worst = 0.0;
        uint32_t t_us = 0u;
        for (uint32_t i = 0u; i < (uint32_t)(30.0 * RATES_HZ[k]); i++) {
            const uint32_t next_us = (uint32_t)(i * (1e6 / RATES_HZ[k]) + 0.5);
            const double t = next_us * 1e-6, dt = (next_us - t_us) * 1e-6;
            t_us = next_us;
            static const flight_t FLIGHT = {.wander_deg = 30,
                                            .wander_hz = 0.4,
                                            .flap_hz = 3,
                                            .heave_g = 0.5,
                                            .surge_g = 0.3,
                                            .flap_pitch_deg = 10,
                                            .turn_deg_s = 20};
            const state_t s = fly(&FLIGHT, t);
            const vec_d w = s.w, f = s.f, field = {3.0, 20.0, -40.0};
            const vec_d b = rotate_d(conj_d(s.q), field);
            evs_attitude_push_gyro(&att, t_us, fixed(w, 24));
            evs_attitude_push_accel(&att, t_us, fixed(f, 20));
            evs_attitude_push_mag(&att, t_us, fixed(b, 16));
            if (dt > 0.0) {
                model_gyro(&m, w, dt);
                model_accel(&m, f, dt, 3.0);
            }
            model_mag(&m, b, dt, 15.0);
            worst = fmax(worst, angle_between(orientation(), m.q));
        }
        (void)printf("%.0f Hz: at most %.2g deg from the model in 30 s\n", RATES_HZ[k], worst);
        TEST_ASSERT_TRUE(worst < BOUNDS_DEG[k]);
    }
}

/* --- abuse and time -------------------------------------------------------------------------------------------- */

static int32_t any_int32(void)
{
    switch (next_random() % 8u) {
    case 0:
        return INT32_MAX;
    case 1:
        return INT32_MIN;
    case 2:
        return 0;
    case 3:
        return 1;
    default:
        return (int32_t)next_random() >> (next_random() % 32u);
    }
}
static evs_vec3_t any_vec(void)
{
    const evs_vec3_t v = {any_int32(), any_int32(), any_int32()};
    return v;
}

static void test_no_input_breaks_the_norm(void)
{
    uint32_t t_us = 0u;
    for (int run = 0; run < 300; run++) {
        evs_attitude_config_t cfg = evs_attitude_config_default();
        cfg.mode = (evs_attitude_mode_t)(next_random() % 3u);
        cfg.tau_accel_ms = (uint16_t)(100u + next_random() % 59901u);
        cfg.tau_mag_ms = (uint16_t)(100u + next_random() % 59901u);
        cfg.tau_recover_ms = (uint16_t)(50u + next_random() % 9951u);
        cfg.gap_max_ms = (uint16_t)(20u + next_random() % 981u);
        cfg.accel_max_m_s2 = (uint16_t)(20u + next_random() % 1981u);
        cfg.rest_time_ms = 200u;
        cfg.rest_gyro_mrad_s = (uint16_t)(1u + next_random() % 1000u);
        cfg.rest_accel_mm_s2 = (uint16_t)(10u + next_random() % 9991u);
        cfg.bias_max_mrad_s = (uint16_t)(1u + next_random() % 500u);
        cfg.mag_tolerance_permille = (uint16_t)(10u + next_random() % 991u);
        cfg.declination = any_int32();
        cfg.valenti_adaptive = (next_random() & 1u) != 0u;
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_attitude_init(&att, &cfg));
        for (int i = 0; i < 3000; i++) {
            switch (next_random() % 16u) {
            case 0:
                t_us = next_random();
                break;
            case 1:
                t_us -= next_random() % 5000u;
                break;
            case 2:
                t_us += next_random() % 3000000u;
                break;
            default:
                t_us += next_random() % 8000u;
                break;
            }
            evs_vec3_t v = any_vec();
            switch (next_random() % 8u) {
            case 0:
                evs_attitude_push_mag(&att, t_us, v);
                break;
            case 1:
                evs_attitude_push_delta_angle(&att, t_us, v, next_random() % 25000u);
                break;
            case 2:
                v.x >>= 24; /* now and then something quiet, so that rest is reached too */
                v.y >>= 24;
                v.z >>= 24;
                evs_attitude_push_gyro(&att, t_us, v);
                break;
            case 3:
            case 4:
                evs_attitude_push_accel(&att, t_us, v);
                break;
            default:
                evs_attitude_push_gyro(&att, t_us, v);
                break;
            }
            if (next_random() % 1000u == 0u) {
                const evs_quat_t q = {any_int32(), any_int32(), any_int32(), any_int32()};
                (void)!evs_attitude_set_orientation(&att, q);
                (void)!evs_attitude_set_bias(&att, any_vec());
            }
            TEST_ASSERT_DOUBLE_WITHIN(1e-8, 0.0, norm_error());
        }
    }
}

static void test_after_any_abuse_a_minute_of_good_data_puts_it_right(void)
{
    for (int run = 0; run < 20; run++) {
        setUp();
        uint32_t t_us = 0u;
        for (int i = 0; i < 2000; i++) {
            t_us += next_random() % 8000u;
            evs_attitude_push_gyro(&att, t_us, any_vec());
            evs_attitude_push_accel(&att, t_us, any_vec());
        }
        const vec_d up = {0.0, 0.0, G}, still = {0.0, 0.0, 0.0};
        const quat_d truth = turn_d(uniform(), uniform(), 0.0);
        const evs_vec3_t f = fixed(rotate_d(conj_d(truth), up), 20);
        for (int i = 0; i < 60 * 200; i++) {
            t_us += 5000u;
            evs_attitude_push_gyro(&att, t_us, fixed(still, 24));
            evs_attitude_push_accel(&att, t_us, f);
        }
        const quat_d q = orientation();
        const vec_d seen = rotate_d(q, rotate_d(conj_d(truth), up));
        TEST_ASSERT_DOUBLE_WITHIN(0.1, 0.0, acos(fmin(1.0, seen.z / G)) / DEG);
    }
}

static void test_an_hour_of_flight_keeps_the_norm_and_the_horizon(void)
{
    /* 72 min, so that the clock wraps; 100 Hz */
    static const flight_t HOUR = {.name = "hour", .rate_hz = 100, .wander_deg = 20, .wander_hz = 0.3, .turn_deg_s = 7};
    double worst_norm = 0.0, worst_tilt = 0.0;
    for (uint32_t i = 0u; i < 72u * 60u * 100u; i++) {
        const state_t s = fly(&HOUR, i * 0.01);
        const state_t middle = fly(&HOUR, i * 0.01 - 0.005);
        const uint32_t t_us = i * 10000u; /* wraps */
        evs_attitude_push_gyro(&att, t_us, fixed(middle.w, 24));
        evs_attitude_push_accel(&att, t_us, fixed(s.f, 20));
        worst_norm = fmax(worst_norm, norm_error());
        if (i > 2000u) { worst_tilt = fmax(worst_tilt, tilt_between(orientation(), s.q)); }
    }
    TEST_ASSERT_TRUE(worst_norm < 4e-9);
    TEST_ASSERT_TRUE(worst_tilt < 0.1);
    TEST_ASSERT_EQUAL_UINT32(0u, evs_attitude_faults(&att).n_time_bad);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_flights_with_exact_truth);
    RUN_TEST(test_fixed_point_follows_the_model_in_double_precision);
    RUN_TEST(test_no_input_breaks_the_norm);
    RUN_TEST(test_after_any_abuse_a_minute_of_good_data_puts_it_right);
    RUN_TEST(test_an_hour_of_flight_keeps_the_norm_and_the_horizon);
    return UNITY_END();
}
