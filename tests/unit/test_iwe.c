/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/iwe.h"
#include "model.h"
#include "unity.h"

#include <stdlib.h>
#include <string.h>

enum { W = 37, H = 23, N_POINTS = 1200, GUARD = 0xA5 };

static evs_iwe_t iwe;
static union {
    uint32_t aligned;
    uint8_t bytes[EVS_IWE_BYTES(W, H, EVS_IWE_GAUSSIAN) + 4u];
    uint16_t halves[W * H];
} memory;
static uint8_t image[W * H + 1];
static evs_point_t points[N_POINTS];
static double want[W * H];

void setUp(void) {}
void tearDown(void) {}

static evs_iwe_config_t config(uint16_t width_px, uint16_t height_px, evs_iwe_vote_t vote)
{
    evs_iwe_config_t cfg = evs_iwe_config_default(width_px, height_px);
    cfg.vote = vote;
    return cfg;
}

/* In exactly the memory that it asks for. */
static size_t init(const evs_iwe_config_t *cfg)
{
    const size_t n_bytes = EVS_IWE_BYTES(cfg->width_px, cfg->height_px, cfg->vote);
    memset(memory.bytes, GUARD, sizeof memory.bytes);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_iwe_init(&iwe, cfg, &memory, n_bytes));
    return n_bytes;
}

static evs_point_t point(int x_q4, int y_q4)
{
    const evs_point_t p = {(int16_t)x_q4, (int16_t)y_q4};
    return p;
}

/* Points in and around an image, some with no position, many in a few places. */
static void make_points(int width, int height)
{
    for (size_t i = 0; i < N_POINTS; i++) {
        const double x = model_uniform(-5.0, width + 5.0);
        const double y = model_uniform(-5.0, height + 5.0);
        points[i] = point((int)floor(16.0 * x), (int)floor(16.0 * y));
        if (i % 3u == 0u) { points[i] = point((int)floor(x / 3.0) * 16, 16); }
        if (i % 50u == 0u) { points[i] = evs_point_outside(); }
    }
    points[1] = point(-EVS_POINT_MAX_Q4, EVS_POINT_MAX_Q4);
    points[2] = point(EVS_POINT_MAX_Q4, -EVS_POINT_MAX_Q4);
}

static bool takes_part(evs_point_t p, int width, int height)
{
    const double x = floor(p.x_q4 / 16.0 + 0.5);
    const double y = floor(p.y_q4 / 16.0 + 0.5);
    return (x >= 0) && (y >= 0) && (x < width) && (y < height);
}

/* What an event at distance (dx, dy) px gives to a pixel. */
static double weight(evs_iwe_vote_t vote, double dx, double dy)
{
    switch (vote) {
    case EVS_IWE_NEAREST:
        return ((dx > -0.5) && (dx <= 0.5) && (dy > -0.5) && (dy <= 0.5)) ? 1.0 : 0.0;
    case EVS_IWE_BILINEAR:
        return fmax(0.0, 1.0 - fabs(dx)) * fmax(0.0, 1.0 - fabs(dy));
    default:
        return exp(-(dx * dx + dy * dy) / 2.0) / (2.0 * MODEL_PI);
    }
}

/* The equation, without a cut-off; returns how many events take part. */
static uint32_t model_votes(evs_iwe_vote_t vote, int width, int height, size_t n)
{
    uint32_t n_votes = 0u;
    memset(want, 0, sizeof want);
    for (size_t i = 0; i < n; i++) {
        if (!takes_part(points[i], width, height)) { continue; }
        n_votes++;
        for (int y = 0; y < height; y++) {
            for (int x = 0; x < width; x++) {
                want[y * width + x] += weight(vote, x - points[i].x_q4 / 16.0, y - points[i].y_q4 / 16.0);
            }
        }
    }
    return n_votes;
}

static void test_init_names_the_fault_and_leaves_the_context_alone(void)
{
    const evs_iwe_config_t good = config(W, H, EVS_IWE_BILINEAR);
    const size_t n = EVS_IWE_BYTES(W, H, EVS_IWE_BILINEAR);
    evs_iwe_config_t bad[12];
    for (size_t i = 0; i < 12u; i++) { bad[i] = good; }
    bad[0].width_px = 0u;
    bad[1].height_px = 0u;
    bad[2].width_px = EVS_SENSOR_MAX_PX + 1u;
    bad[3].height_px = EVS_SENSOR_MAX_PX + 1u;
    bad[4].vote = (evs_iwe_vote_t)3;
    bad[5].vote = (evs_iwe_vote_t)-1;
    bad[6].scale = (evs_iwe_scale_t)2;
    bad[7].n_sigma_q4 = EVS_IWE_N_SIGMA_MAX_Q4 + 1u;
    bad[8].scale = EVS_IWE_SCALE_FIXED;
    bad[8].full_q4 = 0u;
    evs_iwe_t before;
    memset(&iwe, 0x77, sizeof iwe);
    before = iwe;
    for (size_t i = 0; i < 9u; i++) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(EVS_ERR_ARG, evs_iwe_init(&iwe, &bad[i], &memory, n), "a bad setting");
    }
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_iwe_init(&iwe, &good, memory.bytes + 2, n));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_iwe_init(NULL, &good, &memory, n));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_iwe_init(&iwe, NULL, &memory, n));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_NULL, evs_iwe_init(&iwe, &good, NULL, n));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_SIZE, evs_iwe_init(&iwe, &good, &memory, n - 1u));
    TEST_ASSERT_EQUAL_MEMORY(&before, &iwe, sizeof iwe);
    /* A setting that is not in use may be anything. */
    bad[9].scale = EVS_IWE_SCALE_FIXED;
    bad[9].n_sigma_q4 = UINT16_MAX;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_iwe_init(&iwe, &bad[9], &memory, n));
    bad[10].full_q4 = 0u;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_iwe_init(&iwe, &bad[10], &memory, n));
}

static void test_votes_follow_the_equation(void)
{
    static const double ONE[] = {1.0, 256.0, 1024.0};
    /* Of every event: half a unit of rounding, and a table in Q16; or what lies beyond 3.5 px. */
    static const double TOLERANCE[] = {0.0, 0.0, 0.0005};
    for (int vote = EVS_IWE_NEAREST; vote <= EVS_IWE_GAUSSIAN; vote++) {
        const evs_iwe_config_t cfg = config(W, H, (evs_iwe_vote_t)vote);
        make_points(W, H);
        points[3] = point(16 * (W - 1) + 7, 16 * (H - 1) + 7); /* the last ones inside */
        points[4] = point(-8, -8);
        const uint32_t n_votes = model_votes((evs_iwe_vote_t)vote, W, H, N_POINTS);
        TEST_ASSERT_TRUE((n_votes > N_POINTS / 3) && (n_votes < N_POINTS));
        const size_t n_bytes = init(&cfg);
        evs_iwe_add(&iwe, points, 700u);
        evs_iwe_add(&iwe, points + 700, N_POINTS - 700u);
        TEST_ASSERT_EQUAL_UINT32(n_votes, evs_iwe_n_votes(&iwe));
        TEST_ASSERT_EQUAL_UINT32(N_POINTS - n_votes, evs_iwe_n_outside(&iwe));
        for (size_t i = 0; i < W * H; i++) {
            const double votes = (vote == EVS_IWE_NEAREST) ? memory.bytes[i] : memory.halves[i];
            TEST_ASSERT_TRUE(fabs(votes / ONE[vote] - want[i]) <= TOLERANCE[vote] * n_votes);
            TEST_ASSERT_TRUE(fabs(votes / ONE[vote] - want[i]) <= TOLERANCE[vote] * 40 + 0.02 * want[i]);
        }
        for (size_t i = EVS_IWE_VOTES_BYTES_(W, H, vote); i <= n_bytes; i++) {
            TEST_ASSERT_EQUAL_HEX8_MESSAGE(GUARD, memory.bytes[i], "voted past the votes");
        }
    }
}

/* One event at each sixteenth of a pixel, in the middle and at the corners. */
static void test_gaussian_of_one_event_is_exact_to_its_last_bit(void)
{
    const evs_iwe_config_t cfg = config(9, 8, EVS_IWE_GAUSSIAN);
    double worst = 0.0;
    double worst_mass = 0.0;
    for (int y = -8; y < 8 * 16 - 8; y++) {
        for (int x = -8; x < 9 * 16 - 8; x++) {
            (void)init(&cfg);
            points[0] = point(x, y);
            evs_iwe_add(&iwe, points, 1u);
            double mass = 0.0;
            double in_x[9]; /* factors of the equation, for boards that have no exp() in hardware */
            for (int u = 0; u < 9; u++) { in_x[u] = weight(EVS_IWE_GAUSSIAN, u - x / 16.0, 0.0); }
            for (int v = 0; v < 8; v++) {
                const double in_y = weight(EVS_IWE_GAUSSIAN, 0.0, v - y / 16.0);
                for (int u = 0; u < 9; u++) {
                    const double equation = in_x[u] * in_y * 2.0 * MODEL_PI;
                    const double got = memory.halves[v * 9 + u] / 1024.0;
                    mass += got;
                    if ((abs(u - ((x + 8) >> 4)) <= 3) && (abs(v - ((y + 8) >> 4)) <= 3)) {
                        worst = fmax(worst, fabs(got - equation));
                    } else {
                        TEST_ASSERT_TRUE((got == 0.0) && (equation < 0.0004));
                    }
                }
            }
            if ((x >= 3 * 16) && (x < 5 * 16) && (y >= 3 * 16) && (y < 4 * 16)) {
                worst_mass = fmax(worst_mass, fabs(mass - 1.0));
            }
        }
    }
    TEST_ASSERT_TRUE(worst <= 1.0 / 2048.0 + 1e-5);
    TEST_ASSERT_TRUE(worst_mass < 0.008);
}

static void test_bilinear_loses_nothing_within_the_image(void)
{
    const evs_iwe_config_t cfg = config(W, H, EVS_IWE_BILINEAR);
    (void)init(&cfg);
    for (size_t i = 0; i < N_POINTS; i++) {
        points[i] = point((int)model_uniform(0, 16 * (W - 1)), (int)model_uniform(0, 16 * (H - 1)));
    }
    evs_iwe_add(&iwe, points, N_POINTS);
    uint32_t sum = 0u;
    for (size_t i = 0; i < W * H; i++) { sum += memory.halves[i]; }
    TEST_ASSERT_EQUAL_UINT32(256u * N_POINTS, sum);
}

static void test_order_does_not_matter(void)
{
    static uint8_t first[W * H * 2];
    for (int vote = EVS_IWE_NEAREST; vote <= EVS_IWE_GAUSSIAN; vote++) {
        const evs_iwe_config_t cfg = config(W, H, (evs_iwe_vote_t)vote);
        const size_t n_bytes = (size_t)W * H * ((vote == EVS_IWE_NEAREST) ? 1u : 2u);
        make_points(W, H);
        for (size_t i = 0; i < N_POINTS / 2; i++) { points[i] = point(100, 101); } /* into saturation */
        (void)init(&cfg);
        evs_iwe_add(&iwe, points, N_POINTS);
        memcpy(first, memory.bytes, n_bytes);
        evs_iwe_clear(&iwe);
        for (size_t i = N_POINTS; i > 0u; i--) { evs_iwe_add(&iwe, &points[i - 1u], 1u); }
        TEST_ASSERT_EQUAL_MEMORY(first, memory.bytes, n_bytes);
    }
}

static void test_votes_saturate(void)
{
    static const uint32_t N_FULL[] = {255u, 256u, 403u};
    for (size_t i = 0; i < N_POINTS; i++) { points[i] = point(5 * 16, 4 * 16); }
    for (int vote = EVS_IWE_NEAREST; vote <= EVS_IWE_GAUSSIAN; vote++) {
        const evs_iwe_config_t cfg = config(11, 9, (evs_iwe_vote_t)vote);
        const size_t at = 4u * 11u + 5u;
        (void)init(&cfg);
        evs_iwe_add(&iwe, points, N_FULL[vote] - 1u);
        const uint32_t before = (vote == EVS_IWE_NEAREST) ? memory.bytes[at] : memory.halves[at];
        TEST_ASSERT_TRUE(before < ((vote == EVS_IWE_NEAREST) ? 255u : 65535u));
        for (uint32_t more = 0u; more < 3u; more++) {
            evs_iwe_add(&iwe, points, (more == 0u) ? 1u : 300u);
            const uint32_t full = (vote == EVS_IWE_NEAREST) ? memory.bytes[at] : memory.halves[at];
            TEST_ASSERT_EQUAL_UINT32((vote == EVS_IWE_NEAREST) ? 255u : 65535u, full);
        }
        TEST_ASSERT_EQUAL_UINT32(N_FULL[vote] + 600u, evs_iwe_n_votes(&iwe));
    }
}

static void test_clear_takes_the_votes_back_and_keeps_the_count_of_bad_points(void)
{
    const evs_iwe_config_t cfg = config(W, H, EVS_IWE_NEAREST);
    (void)init(&cfg);
    make_points(W, H);
    evs_iwe_add(&iwe, points, N_POINTS);
    const uint32_t n_outside = evs_iwe_n_outside(&iwe);
    TEST_ASSERT_TRUE(n_outside > 0u);
    evs_iwe_clear(&iwe);
    TEST_ASSERT_EQUAL_UINT32(0u, evs_iwe_n_votes(&iwe));
    TEST_ASSERT_EQUAL_UINT32(n_outside, evs_iwe_n_outside(&iwe));
    for (size_t i = 0; i < W * H; i++) { TEST_ASSERT_EQUAL_UINT8(0, memory.bytes[i]); }
}

/* The votes that lie in memory, smoothed, in votes per pixel. */
static double smoothed(const evs_iwe_config_t *cfg, int x, int y)
{
    static const double ONE[] = {1.0, 256.0, 1024.0};
    static const double TAP[] = {0.25, 0.5, 0.25};
    double sum = 0.0;
    for (int dy = -1; dy <= 1; dy++) {
        for (int dx = -1; dx <= 1; dx++) {
            const int u = (x + dx < 0) ? 0 : ((x + dx >= cfg->width_px) ? cfg->width_px - 1 : x + dx);
            const int v = (y + dy < 0) ? 0 : ((y + dy >= cfg->height_px) ? cfg->height_px - 1 : y + dy);
            const int at = v * cfg->width_px + u;
            const double tap = cfg->smooth ? TAP[dx + 1] * TAP[dy + 1] : ((dx == 0) && (dy == 0) ? 1.0 : 0.0);
            sum += tap * ((cfg->vote == EVS_IWE_NEAREST) ? memory.bytes[at] : memory.halves[at]);
        }
    }
    /* Wide votes are smoothed to a whole number of units: those that vanish then are not counted either. */
    if (cfg->vote != EVS_IWE_NEAREST) { sum = floor(sum + 0.5); }
    return sum / ONE[cfg->vote];
}

static void check_image(const evs_iwe_config_t *cfg)
{
    const int n_px = cfg->width_px * cfg->height_px;
    double sum = 0.0;
    double squares = 0.0;
    int n = 0;
    for (int i = 0; i < n_px; i++) {
        want[i] = smoothed(cfg, i % cfg->width_px, i / cfg->width_px);
        sum += want[i];
        squares += want[i] * want[i];
        if (want[i] > 0.0) { n++; }
    }
    double white = cfg->full_q4 / 16.0;
    if (cfg->scale == EVS_IWE_SCALE_SIGMA) {
        white =
            (n == 0) ? 1.0 : sum / n + cfg->n_sigma_q4 / 16.0 * sqrt(fmax(0.0, squares / n - (sum / n) * (sum / n)));
    }
    image[n_px] = GUARD;
    evs_iwe_render(&iwe, image);
    for (int i = 0; i < n_px; i++) {
        const double level = fmin(255.0, want[i] / white * 255.0);
        TEST_ASSERT_TRUE_MESSAGE(fabs(image[i] - level) <= 1.0, "a grey level");
    }
    TEST_ASSERT_EQUAL_HEX8_MESSAGE(GUARD, image[n_px], "wrote past the image");
}

static void test_image_is_smoothed_and_scaled_for_every_size(void)
{
    for (int vote = EVS_IWE_NEAREST; vote <= EVS_IWE_GAUSSIAN; vote++) {
        for (uint16_t h = 1u; h <= 6u; h++) {
            for (uint16_t w = 1u; w <= 14u; w++) {
                evs_iwe_config_t cfg = config(w, h, (evs_iwe_vote_t)vote);
                for (int i = 0; i < 8; i++) {
                    cfg.smooth = (i & 1) == 0;
                    cfg.scale = ((i & 2) == 0) ? EVS_IWE_SCALE_SIGMA : EVS_IWE_SCALE_FIXED;
                    cfg.n_sigma_q4 = ((i & 4) == 0) ? 48u : 0u;
                    cfg.full_q4 = ((i & 4) == 0) ? 100u : 5000u;
                    const size_t n_bytes = init(&cfg);
                    make_points(w, h);
                    evs_iwe_add(&iwe, points, ((size_t)w * h) % 40u + 3u);
                    check_image(&cfg);
                    TEST_ASSERT_EQUAL_HEX8_MESSAGE(GUARD, memory.bytes[n_bytes], "wrote past the memory");
                }
            }
        }
    }
}

static void test_image_of_many_events(void)
{
    for (int vote = EVS_IWE_NEAREST; vote <= EVS_IWE_GAUSSIAN; vote++) {
        const evs_iwe_config_t cfg = config(W, H, (evs_iwe_vote_t)vote);
        (void)init(&cfg);
        make_points(W, H);
        evs_iwe_add(&iwe, points, N_POINTS);
        check_image(&cfg);
    }
}

static void test_image_of_full_votes(void)
{
    for (int vote = EVS_IWE_NEAREST; vote <= EVS_IWE_GAUSSIAN; vote++) {
        evs_iwe_config_t cfg = config(W, H, (evs_iwe_vote_t)vote);
        for (int i = 0; i < 4; i++) {
            cfg.smooth = (i & 1) == 0;
            cfg.n_sigma_q4 = ((i & 2) == 0) ? EVS_IWE_N_SIGMA_MAX_Q4 : 0u;
            (void)init(&cfg);
            memset(memory.bytes, 0xFF, (size_t)W * H * ((vote == EVS_IWE_NEAREST) ? 1u : 2u));
            evs_iwe_render(&iwe, image);
            for (size_t k = 0; k < W * H; k++) { TEST_ASSERT_EQUAL_UINT8(255, image[k]); } /* sigma is 0 */
            memset(memory.bytes, 0, W * 4u);
            check_image(&cfg);
        }
    }
}

static void test_nothing_is_black_and_one_event_is_a_blob(void)
{
    for (int vote = EVS_IWE_NEAREST; vote <= EVS_IWE_GAUSSIAN; vote++) {
        const evs_iwe_config_t cfg = config(W, H, (evs_iwe_vote_t)vote);
        (void)init(&cfg);
        memset(image, 0x55, sizeof image);
        evs_iwe_render(&iwe, image);
        for (size_t i = 0; i < W * H; i++) { TEST_ASSERT_EQUAL_UINT8(0, image[i]); }
        points[0] = point(16 * 20, 16 * 10);
        evs_iwe_add(&iwe, points, 1u);
        evs_iwe_render(&iwe, image);
        const size_t at = 10u * W + 20u;
        TEST_ASSERT_TRUE(image[at] > 200u);
        TEST_ASSERT_TRUE((image[at - 1u] > 0u) && (image[at - 1u] < image[at]) && (image[at + 1u] == image[at - 1u]));
        TEST_ASSERT_TRUE((image[at - W] == image[at - 1u]) && (image[at + W] == image[at - 1u]));
        TEST_ASSERT_EQUAL_UINT8(0, image[0]);
        uint8_t again[W * H];
        memcpy(again, image, sizeof again);
        evs_iwe_render(&iwe, image);
        TEST_ASSERT_EQUAL_MEMORY_MESSAGE(again, image, sizeof again, "rendering changed the votes");
    }
}

static void test_counts_at_a_fixed_scale_are_the_counts(void)
{
    evs_iwe_config_t cfg = config(W, H, EVS_IWE_NEAREST);
    cfg.smooth = false;
    cfg.scale = EVS_IWE_SCALE_FIXED;
    cfg.full_q4 = 255u * 16u;
    (void)init(&cfg);
    make_points(W, H);
    evs_iwe_add(&iwe, points, N_POINTS);
    evs_iwe_render(&iwe, image);
    TEST_ASSERT_EQUAL_MEMORY(memory.bytes, image, W * H);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_names_the_fault_and_leaves_the_context_alone);
    RUN_TEST(test_votes_follow_the_equation);
    RUN_TEST(test_gaussian_of_one_event_is_exact_to_its_last_bit);
    RUN_TEST(test_bilinear_loses_nothing_within_the_image);
    RUN_TEST(test_order_does_not_matter);
    RUN_TEST(test_votes_saturate);
    RUN_TEST(test_clear_takes_the_votes_back_and_keeps_the_count_of_bad_points);
    RUN_TEST(test_image_is_smoothed_and_scaled_for_every_size);
    RUN_TEST(test_image_of_many_events);
    RUN_TEST(test_image_of_full_votes);
    RUN_TEST(test_nothing_is_black_and_one_event_is_a_blob);
    RUN_TEST(test_counts_at_a_fixed_scale_are_the_counts);
    return UNITY_END();
}
