/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <math.h>
#include <stdlib.h>

#include "texture.h"
#include "unity.h"

static evsim_texture_t texture;

void setUp(void) {}
void tearDown(void) { evsim_texture_free(&texture); }

static double value_at(unsigned x, unsigned y) { return 0.5 + 0.01 * x - 0.02 * y + (((x ^ y) & 1u) ? 0.1 : 0.0); }

static void fill(unsigned log2_size)
{
    const unsigned side = 1u << log2_size;
    TEST_ASSERT_TRUE(evsim_texture_init(&texture, log2_size));
    for (unsigned y = 0u; y < side; y++) {
        for (unsigned x = 0u; x < side; x++) { texture.level[0][y * side + x] = (float)value_at(x, y); }
    }
    evsim_texture_finish(&texture);
}

static void test_texel_centres_read_their_own_value_and_repeat(void)
{
    fill(4u);
    for (unsigned y = 0u; y < 16u; y++) {
        for (unsigned x = 0u; x < 16u; x++) {
            const float u = (float)x + 0.5f;
            const float v = (float)y + 0.5f;
            TEST_ASSERT_FLOAT_WITHIN(1e-6f, (float)value_at(x, y), evsim_texture_sample(&texture, u, v, 0.0f));
            TEST_ASSERT_FLOAT_WITHIN(1e-5f, (float)value_at(x, y),
                                     evsim_texture_sample(&texture, u - 1600.0f, v + 480.0f, 0.5f));
        }
    }
}

static void test_a_large_footprint_reads_the_mean(void)
{
    double mean = 0.0;
    fill(4u);
    for (unsigned y = 0u; y < 16u; y++) {
        for (unsigned x = 0u; x < 16u; x++) { mean += value_at(x, y) / 256.0; }
    }
    TEST_ASSERT_FLOAT_WITHIN(1e-5f, (float)mean, evsim_texture_sample(&texture, 3.0f, 7.0f, 256.0f));
    TEST_ASSERT_FLOAT_WITHIN(1e-5f, (float)mean, evsim_texture_sample(&texture, 3.0f, 7.0f, 1e30f));
    TEST_ASSERT_FLOAT_WITHIN(1e-5f, (float)mean, evsim_texture_sample(&texture, 3.0f, 7.0f, INFINITY));
}

static void test_sampling_is_continuous_in_place_and_footprint(void)
{
    float last = 0.0f;
    fill(5u);
    for (int i = 0; i <= 200000; i++) {
        const float size = 0.5f + 40.0f * (float)i / 200000.0f;
        const float now = evsim_texture_sample(&texture, 40.0f * (float)i / 200000.0f, 11.3f, size * size);
        if (i > 0) { TEST_ASSERT_FLOAT_WITHIN(2e-4f, last, now); }
        last = now;
    }
}

static void test_images_are_resampled_by_area(void)
{
    static const unsigned SIZES[][2] = {{8, 8}, {100, 37}, {3, 5}, {1, 1}, {16, 8}};
    for (size_t k = 0; k < sizeof SIZES / sizeof SIZES[0]; k++) {
        const unsigned w = SIZES[k][0];
        const unsigned h = SIZES[k][1];
        uint8_t *const gray = malloc((size_t)w * h);
        double sum = 0.0;
        TEST_ASSERT_NOT_NULL(gray);
        for (unsigned i = 0u; i < w * h; i++) {
            gray[i] = (uint8_t)(i * 37u + 11u);
            sum += gray[i] / 255.0;
        }
        TEST_ASSERT_TRUE(evsim_texture_init(&texture, 3u));
        TEST_ASSERT_TRUE(evsim_texture_from_image(&texture, gray, w, h));
        evsim_texture_finish(&texture);
        if ((w >= 8u) && (h >= 8u)) { /* Made smaller: the mean stays. */
            TEST_ASSERT_FLOAT_WITHIN(1e-5f, (float)(sum / (w * h)), texture.level[3][0]);
        }
        TEST_ASSERT_TRUE((texture.level[3][0] >= 0.0f) && (texture.level[3][0] <= 1.0f));
        if (w == 8u) { TEST_ASSERT_FLOAT_WITHIN(1e-6f, (float)gray[13] / 255.0f, texture.level[0][13]); }
        evsim_texture_free(&texture);
        free(gray);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_texel_centres_read_their_own_value_and_repeat);
    RUN_TEST(test_a_large_footprint_reads_the_mean);
    RUN_TEST(test_sampling_is_continuous_in_place_and_footprint);
    RUN_TEST(test_images_are_resampled_by_area);
    return UNITY_END();
}
