/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * The direction of velocity over many random scenes: its error, whether its sigma is honest, the sign, and what happens
 * where no answer is to be had; against the goals of the project and against models in double precision.
 */
#include "egomotion_model.h"
#include "flow_scene.h"
#include "unity.h"

#include <stdio.h>

enum { N = 500, TRIALS = 200, MANY = 1500 };

static evs_egomotion_flow_t flow[N];
static model_flow_t flow_d[N];
static unsigned char bad[N];
static uint64_t scratch[EVS_EGOMOTION_PAPER_BYTES(N) / 8u + 1u];
static evs_egomotion_config_t cfg;
static evs_egomotion_result_t result;
static double errors[MANY];
static double honesty; /* RMS error over RMS sigma */

void setUp(void)
{
    cfg = evs_egomotion_config_default();
    scene_seed = 2026u;
}
void tearDown(void) {}

static scene_truth_t make(const scene_settings_t *s, double rotation_rad, size_t n)
{
    scene_truth_t truth = {{0, 0, 1}, {0, 0, 0}};
    scene_direction(truth.v);
    if (rotation_rad > 0.0) {
        scene_direction(truth.w);
        for (int k = 0; k < 3; k++) { truth.w[k] *= rotation_rad; }
    }
    scene_make_labelled(s, &truth, flow, n, bad);
    for (size_t i = 0; i < n; i++) {
        flow_d[i] = (model_flow_t){evs_q_to_double(flow[i].x_q24, 24), evs_q_to_double(flow[i].y_q24, 24),
                                   evs_q_to_double(flow[i].u_q24, 24), evs_q_to_double(flow[i].v_q24, 24)};
    }
    return truth;
}

static double solve(const scene_truth_t *truth, size_t n)
{
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_egomotion_solve(&cfg, flow, n, scratch, sizeof scratch, &result));
    return scene_error_deg(&result, truth->v);
}

static int by_size(const void *a, const void *b)
{
    const double p = *(const double *)a;
    const double q = *(const double *)b;
    return (p > q) - (p < q);
}

/* --- the goals: 500 vectors, median flow 3 px ----------------------------------------------------------------- */

static const double NOISE_PX[3] = {0.2, 0.5, 1.0};
static const double OUTLIERS[4] = {0.0, 0.1, 0.3, 0.5};
static const double GOAL_MEAN_DEG[3][4] = {{0.35, 0.4, 0.45, 0.55}, {0.85, 0.95, 1.1, 1.45}, {1.8, 2.0, 2.4, 3.1}};
static const double GOAL_P95_DEG[3][4] = {{0.75, 0.9, 1.0, 1.3}, {1.9, 2.1, 2.6, 3.6}, {4.2, 4.5, 5.4, 8.0}};

static void check_cell(int noise, int outliers)
{
    const scene_settings_t s = scene_settings(NOISE_PX[noise], OUTLIERS[outliers]);
    double sum = 0.0, sum_sq = 0.0, sigma_sq = 0.0, of_model = 0.0, of_oracle = 0.0, apart = 0.0;
    for (int t = 0; t < TRIALS; t++) {
        const scene_truth_t truth = make(&s, 0.0, N);
        double model[3] = {0, 0, 1}, oracle[3];
        errors[t] = solve(&truth, N);
        TEST_ASSERT_EQUAL_HEX32_MESSAGE(EVS_EGOMOTION_VALID, result.flags, "flagged");
        TEST_ASSERT_TRUE_MESSAGE(errors[t] < 90.0, "the wrong sign");
        sum += errors[t];
        sum_sq += errors[t] * errors[t];
        sigma_sq += scene_sigma_deg(&result) * scene_sigma_deg(&result);
        model_robust(flow_d, N, model);
        of_model += model_angle_between(model, truth.v) * 180.0 / MODEL_PI;
        apart += scene_error_deg(&result, model);
        model_oracle(flow_d, N, bad, truth.v, oracle);
        of_oracle += model_angle_between(oracle, truth.v) * 180.0 / MODEL_PI;
    }
    qsort(errors, TRIALS, sizeof errors[0], by_size);
    const double mean = sum / TRIALS;
    const double p95 = errors[TRIALS * 95 / 100];
    honesty = sqrt(sum_sq / sigma_sq);
    (void)printf("%.1f px, %2.0f %%: mean %.2f (model %.2f, apart %.3f; oracle %.2f), p95 %.2f, RMS/sigma %.2f\n",
                 s.noise_px, 100.0 * s.outliers, mean, of_model / TRIALS, apart / TRIALS, of_oracle / TRIALS, p95,
                 honesty);
    TEST_ASSERT_TRUE_MESSAGE(mean <= GOAL_MEAN_DEG[noise][outliers], "mean");
    TEST_ASSERT_TRUE_MESSAGE(p95 <= GOAL_P95_DEG[noise][outliers], "p95");
    TEST_ASSERT_TRUE_MESSAGE(mean <= ((OUTLIERS[outliers] < 0.4) ? 1.3 : 1.45) * of_oracle / TRIALS, "oracle");
    TEST_ASSERT_TRUE_MESSAGE(fabs(sum / of_model - 1.0) <= 0.03, "integers against doubles");
    TEST_ASSERT_TRUE_MESSAGE(apart / TRIALS <= 0.1 * mean, "integers far from doubles");
    TEST_ASSERT_TRUE_MESSAGE((honesty >= 0.7) && (honesty <= 1.5), "sigma");
}

static void test_goals_noise_02(void)
{
    for (int i = 0; i < 4; i++) { check_cell(0, i); }
}
static void test_goals_noise_05(void)
{
    for (int i = 0; i < 4; i++) { check_cell(1, i); }
}
static void test_goals_noise_10(void)
{
    for (int i = 0; i < 4; i++) { check_cell(2, i); }
}

static double mean_error(const scene_settings_t *s, double rotation_rad, size_t n, int *n_valid)
{
    double sum = 0.0, sum_sq = 0.0, sigma_sq = 0.0;
    *n_valid = 0;
    for (int t = 0; t < TRIALS; t++) {
        const scene_truth_t truth = make(s, rotation_rad, n);
        const double error = solve(&truth, n);
        if ((result.flags & (uint32_t)EVS_EGOMOTION_VALID) == 0u) { continue; }
        sum += error;
        sum_sq += error * error;
        sigma_sq += scene_sigma_deg(&result) * scene_sigma_deg(&result);
        *n_valid += 1;
    }
    honesty = sqrt(sum_sq / sigma_sq);
    (void)printf("%zu vectors, rotation %.4f rad: mean %.2f, RMS/sigma %.2f\n", n, rotation_rad, sum / *n_valid,
                 honesty);
    return sum / *n_valid;
}

static void test_few_vectors(void)
{
    const scene_settings_t s = scene_settings(0.5, 0.3);
    int n_valid;
    TEST_ASSERT_TRUE(mean_error(&s, 0.0, 100, &n_valid) <= 2.5);
    TEST_ASSERT_TRUE(n_valid >= TRIALS * 97 / 100);
}

/* The cell with the least margin, in as many scenes as it takes to tell. */
static void test_the_hardest_cell_in_many_scenes(void)
{
    const scene_settings_t s = scene_settings(1.0, 0.5);
    double sum = 0.0;
    for (int t = 0; t < MANY; t++) {
        const scene_truth_t truth = make(&s, 0.0, N);
        sum += solve(&truth, N);
    }
    (void)printf("1.0 px, 50 %%, %d scenes: mean %.3f\n", MANY, sum / MANY);
    TEST_ASSERT_TRUE(sum / MANY <= 2.85);
}

/* Errors over sigma of the valid results, sorted; returns how many. */
static int ratios(const scene_settings_t *s, bool object_varies, size_t n, int n_trials)
{
    scene_settings_t here = *s;
    int m = 0;
    for (int t = 0; t < n_trials; t++) {
        if (object_varies) { /* a third to three times the speed, 1 to 4 m off */
            here.object_way_m = 0.05 * pow(3.0, 2.0 * scene_uniform() - 1.0);
            here.object_depth_m = 1.0 + 3.0 * scene_uniform();
        }
        const scene_truth_t truth = make(&here, 0.0, n);
        const double error = solve(&truth, n);
        if ((result.flags & (uint32_t)EVS_EGOMOTION_VALID) != 0u) { errors[m++] = error / scene_sigma_deg(&result); }
    }
    qsort(errors, (size_t)m, sizeof errors[0], by_size);
    return m;
}

static int count_above(double limit, int m)
{
    int n = 0;
    for (int i = 0; i < m; i++) { n += (errors[i] > limit) ? 1 : 0; }
    return n;
}

static void test_an_object_of_any_speed_leaves_sigma_honest(void)
{
    enum { CASES = 1000, N_VECTORS = 300 };
    scene_settings_t s = scene_settings(0.4, 0.0);
    s.object_share = 0.3;
    const int m = ratios(&s, true, N_VECTORS, CASES);
    (void)printf("object over 30 %%: %d of %d valid, error over sigma: p68 %.2f, p95 %.2f, max %.1f, %d above 4\n", m,
                 (int)CASES, errors[m * 68 / 100], errors[m * 95 / 100], errors[m - 1], count_above(4.0, m));
    TEST_ASSERT_TRUE(m >= CASES * 97 / 100);
    TEST_ASSERT_TRUE(errors[m * 95 / 100] <= 2.5);
    TEST_ASSERT_TRUE(errors[m * 68 / 100] >= 0.4); /* not by a sigma that says nothing */
    TEST_ASSERT_TRUE(count_above(4.0, m) <= CASES / 200);
}

static void test_few_vectors_leave_sigma_honest(void)
{
    enum { CASES = 1000 };
    static const size_t N_VECTORS[] = {12, 20};
    const scene_settings_t s = scene_settings(0.5, 0.0);
    for (int k = 0; k < 2; k++) {
        const int m = ratios(&s, false, N_VECTORS[k], CASES);
        (void)printf("%2u vectors: %d of %d valid, error over sigma: p68 %.2f, p95 %.2f, %d above 4\n",
                     (unsigned)N_VECTORS[k], m, (int)CASES, errors[m * 68 / 100], errors[m * 95 / 100],
                     count_above(4.0, m));
        TEST_ASSERT_TRUE(m >= CASES * 6 / 10);
        TEST_ASSERT_TRUE(errors[m * 95 / 100] <= 2.5);
        TEST_ASSERT_TRUE(errors[m * 68 / 100] >= 0.5);
    }
}

static void test_residual_rotation(void)
{
    const scene_settings_t s = scene_settings(0.5, 0.1);
    const double rotation = 0.05 * MODEL_PI / 180.0; /* 1 deg/s over 50 ms */
    int n_valid;
    TEST_ASSERT_TRUE(mean_error(&s, rotation, N, &n_valid) <= 1.8);
    cfg.rotation_sigma_rad_q28 = evs_q_from_double(rotation, 28);
    TEST_ASSERT_TRUE(mean_error(&s, rotation, N, &n_valid) <= 1.35);
    TEST_ASSERT_TRUE((honesty >= 0.7) && (honesty <= 1.3));
    TEST_ASSERT_EQUAL_INT(TRIALS, n_valid);
    /* what the prior leaves open is most of the error here: sigma must know */
    const scene_settings_t noisy = scene_settings(0.3, 0.0);
    cfg.rotation_sigma_rad_q28 = evs_q_from_double(0.002, 28);
    (void)mean_error(&noisy, 0.002 * sqrt(3.0), 60, &n_valid);
    TEST_ASSERT_TRUE((honesty >= 0.7) && (honesty <= 1.05));
}

/* Bad data at any rate: flags, or an error that sigma accounts for. Returns how many were confident and wrong. */
static int count_wrong(const scene_settings_t *s, double rotation_rad, size_t n, int *n_valid)
{
    int n_wrong = 0;
    *n_valid = 0;
    for (int t = 0; t < TRIALS; t++) {
        const scene_truth_t truth = make(s, rotation_rad, n);
        const double error = solve(&truth, n);
        if ((result.flags & (uint32_t)EVS_EGOMOTION_VALID) == 0u) { continue; }
        *n_valid += 1;
        if ((error > 1.0) && (error > 4.0 * scene_sigma_deg(&result))) { n_wrong++; }
    }
    return n_wrong;
}

static void test_never_confident_and_wrong(void)
{
    static const double OBJECT[] = {0.1, 0.2, 0.3};
    int n_valid;
    for (int noise = 0; noise < 3; noise++) {
        scene_settings_t s = scene_settings(NOISE_PX[noise], 0.05);
        for (size_t k = 0; k < 3u; k++) {
            s.object_share = OBJECT[k];
            const int n_wrong = count_wrong(&s, 0.0, N, &n_valid);
            (void)printf("object over %.0f %%, %.1f px: %d valid, %d of them wrong\n", 100.0 * OBJECT[k], s.noise_px,
                         n_valid, n_wrong);
            TEST_ASSERT_TRUE(n_wrong <= TRIALS * 4 / 100); /* it may move much as the camera does */
            TEST_ASSERT_TRUE(n_valid >= TRIALS * 9 / 10);
        }
        s = scene_settings(NOISE_PX[noise], 0.1); /* a plane that faces the camera */
        s.depth_low_m = s.depth_high_m = 2.5;
        TEST_ASSERT_TRUE(count_wrong(&s, 0.0, N, &n_valid) <= TRIALS / 100);
        TEST_ASSERT_TRUE(n_valid >= ((noise < 2) ? TRIALS * 99 / 100 : TRIALS * 2 / 3));
        s = scene_settings(NOISE_PX[noise], 0.1); /* nothing but rotation: 1 degree, 3.5 px */
        s.way_m = 0.0;
        (void)count_wrong(&s, MODEL_PI / 180.0, N, &n_valid);
        TEST_ASSERT_TRUE(n_valid <= TRIALS / 50);
        (void)count_wrong(&s, 0.0, N, &n_valid); /* nothing but noise */
        TEST_ASSERT_EQUAL_INT(0, n_valid);
        s = scene_settings(NOISE_PX[noise], 0.9); /* hardly a good vector */
        (void)count_wrong(&s, 0.0, N, &n_valid);
        TEST_ASSERT_TRUE(n_valid <= TRIALS / 100);
        s = scene_settings(NOISE_PX[noise], 0.0);
        (void)count_wrong(&s, 0.0, 5, &n_valid);
        TEST_ASSERT_EQUAL_INT(0, n_valid);
        const int n_wrong = count_wrong(&s, 0.0, 12, &n_valid);
        (void)printf("12 vectors, %.1f px: %d valid, %d of them wrong\n", s.noise_px, n_valid, n_wrong);
        TEST_ASSERT_TRUE(n_wrong <= TRIALS * 3 / 100);
    }
}

/* A long lens, whose focus of expansion may be in view or far off: sigma must tell. */
static void test_long_lenses(void)
{
    static const double REACH[] = {0.17, 0.05};
    for (int k = 0; k < 2; k++) {
        double sum_sq = 0.0, sigma_sq = 0.0;
        int n_valid = 0;
        for (int t = 0; t < TRIALS; t++) {
            scene_truth_t truth = {{0, 0, 1}, {0, 0, 0}};
            scene_direction(truth.v);
            if (t % 2 == 0) { /* every other one flies forward or backward */
                truth.v[0] *= 0.05;
                truth.v[1] *= 0.05;
                model_unit(truth.v);
            }
            double mean = 0.0;
            for (size_t i = 0; i < N; i++) {
                const double x = REACH[k] * (2.0 * scene_uniform() - 1.0);
                const double y = REACH[k] * (2.0 * scene_uniform() - 1.0);
                double uv[2];
                scene_flow(x, y, 20.0 + 80.0 * scene_uniform(), truth.v, truth.w, uv);
                flow[i] = scene_vector(x, y, uv[0], uv[1]);
                mean += hypot(uv[0], uv[1]) / N;
            }
            for (size_t i = 0; i < N; i++) {
                flow[i].u_q24 += (int32_t)(scene_normal() * 0.1 * mean * 16777216.0);
                flow[i].v_q24 += (int32_t)(scene_normal() * 0.1 * mean * 16777216.0);
            }
            const double error = solve(&truth, N);
            if ((result.flags & (uint32_t)EVS_EGOMOTION_VALID) == 0u) { continue; }
            sum_sq += error * error;
            sigma_sq += scene_sigma_deg(&result) * scene_sigma_deg(&result);
            n_valid++;
        }
        (void)printf("reach %.2f: %d valid, RMS/sigma %.2f\n", REACH[k], n_valid, sqrt(sum_sq / sigma_sq));
        TEST_ASSERT_TRUE(n_valid >= TRIALS * 2 / 5);
        TEST_ASSERT_TRUE(sum_sq < 1.5 * 1.5 * sigma_sq);
    }
}

/* Against the published formulas in double precision, on the same flow. */
static void check_published(evs_egomotion_method_t method, double rotation_rad, double limit_deg)
{
    enum { M = 200, PROBLEMS = 12 };
    const scene_settings_t s = scene_settings(0.3, 0.2);
    cfg.method = method;
    for (int t = 0; t < PROBLEMS; t++) {
        const scene_truth_t truth = make(&s, rotation_rad, M);
        double v[3];
        (void)solve(&truth, M);
        model_published(flow_d, M, method == EVS_EGOMOTION_ERL, v);
        const double error = scene_error_deg(&result, v);
        errors[t] = fmin(error, 180.0 - error);
    }
    qsort(errors, PROBLEMS, sizeof errors[0], by_size);
    (void)printf("published: apart median %.3f, largest %.3f\n", errors[PROBLEMS / 2], errors[PROBLEMS - 1]);
    TEST_ASSERT_TRUE(errors[PROBLEMS / 2] < limit_deg);
    TEST_ASSERT_TRUE(errors[PROBLEMS - 1] < 4.0 * limit_deg);
}

static void test_published_erlv(void) { check_published(EVS_EGOMOTION_PAPER, 0.0, 0.1); }
static void test_published_erl(void) { check_published(EVS_EGOMOTION_ERL, 0.02, 0.3); }

static void test_any_numbers(void)
{
    for (int t = 0; t < 400; t++) {
        const size_t n = (size_t)(scene_uniform() * 40.0);
        const double size = pow(2.0, 31.0 * scene_uniform());
        for (size_t i = 0; i < n; i++) {
            const evs_egomotion_flow_t f = {
                (int32_t)(4294967295.0 * scene_uniform() - 2147483648.0) >> (int)(8.0 * scene_uniform()),
                (int32_t)(4294967295.0 * scene_uniform() - 2147483648.0) >> (int)(8.0 * scene_uniform()),
                (int32_t)(size * (2.0 * scene_uniform() - 1.0)), (int32_t)(size * (2.0 * scene_uniform() - 1.0))};
            flow[i] = f;
        }
        cfg.method = (evs_egomotion_method_t)(t % 16 == 0 ? 1 : (t % 16 == 1 ? 2 : 0));
        cfg.rotation_sigma_rad_q28 = (t % 3 == 0) ? (int32_t)(268435456.0 * scene_uniform()) : 0;
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_egomotion_solve(&cfg, flow, n, scratch, sizeof scratch, &result));
        const double length = sqrt((double)evs_vec3_norm_sq(result.v_q30)) / 1073741824.0;
        TEST_ASSERT_TRUE(fabs(length - 1.0) < 1e-6);
        TEST_ASSERT_TRUE((result.sigma_rad_q28 >= 0) && (result.sigma_rad_q28 <= 843314857));
        TEST_ASSERT_TRUE(result.n_inliers <= result.n_flow);
        TEST_ASSERT_TRUE(result.n_flow + result.n_rejected <= n);
    }
}

/* Not a test: the table of docs/modules/egomotion.md. `test_property_egomotion published 400` takes some minutes. */
static int print_published(int n_scenes)
{
    static const char *const NAMES[] = {"", "ERL-V", "ERL"};
    for (int method = 1; method <= 2; method++) {
        setUp();
        cfg.method = (evs_egomotion_method_t)method;
        for (int noise = 0; noise < 3; noise++) {
            (void)printf("%s, %.1f px, 0 / 10 / 30 / 50 %%:", NAMES[method], NOISE_PX[noise]);
            for (int outliers = 0; outliers < 4; outliers++) {
                const scene_settings_t s = scene_settings(NOISE_PX[noise], OUTLIERS[outliers]);
                double sum = 0.0;
                for (int t = 0; t < n_scenes; t++) {
                    const scene_truth_t truth = make(&s, 0.0, N);
                    sum += solve(&truth, N);
                }
                (void)printf(" %.2f", sum / n_scenes);
                (void)fflush(stdout);
            }
            (void)printf("\n");
        }
    }
    return 0;
}

int main(int argc, char **argv)
{
    if ((argc == 3) && (strcmp(argv[1], "published") == 0)) { return print_published(atoi(argv[2])); }
    UNITY_BEGIN();
    RUN_TEST(test_goals_noise_02);
    RUN_TEST(test_goals_noise_05);
    RUN_TEST(test_goals_noise_10);
    RUN_TEST(test_few_vectors);
    RUN_TEST(test_the_hardest_cell_in_many_scenes);
    RUN_TEST(test_an_object_of_any_speed_leaves_sigma_honest);
    RUN_TEST(test_few_vectors_leave_sigma_honest);
    RUN_TEST(test_residual_rotation);
    RUN_TEST(test_never_confident_and_wrong);
    RUN_TEST(test_long_lenses);
    RUN_TEST(test_published_erlv);
    RUN_TEST(test_published_erl);
    RUN_TEST(test_any_numbers);
    return UNITY_END();
}
