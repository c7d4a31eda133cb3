/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/image.h"
#include "unity.h"

enum { SIDE = 21, GUARD = 0xA5 };

static uint8_t whole[SIDE * SIDE];
static uint8_t half[EVS_IMAGE_BYTES(EVS_IMAGE_HALF(SIDE), EVS_IMAGE_HALF(SIDE)) + 1u];

void setUp(void) {}
void tearDown(void) {}

static void fill(void)
{
    uint32_t seed = 5u;
    for (size_t i = 0u; i < sizeof whole; i++) {
        seed = seed * 1664525u + 1013904223u;
        whole[i] = (uint8_t)(seed >> 24);
    }
}

static unsigned pixel(unsigned width, unsigned height, unsigned x, unsigned y)
{
    return whole[((y < height) ? y : height - 1u) * width + ((x < width) ? x : width - 1u)];
}

static void test_half_is_the_rounded_mean_for_every_size(void)
{
    fill();
    for (unsigned h = 1u; h <= SIDE; h++) {
        for (unsigned w = 1u; w <= SIDE; w++) {
            const evs_image_t in = {whole, (uint16_t)w, (uint16_t)h};
            const unsigned half_w = EVS_IMAGE_HALF(w);
            const unsigned half_h = EVS_IMAGE_HALF(h);
            half[half_w * half_h] = GUARD;
            evs_image_halve(&in, half);
            for (unsigned y = 0u; y < half_h; y++) {
                for (unsigned x = 0u; x < half_w; x++) {
                    const unsigned sum = pixel(w, h, 2u * x, 2u * y) + pixel(w, h, 2u * x + 1u, 2u * y) +
                                         pixel(w, h, 2u * x, 2u * y + 1u) + pixel(w, h, 2u * x + 1u, 2u * y + 1u);
                    TEST_ASSERT_EQUAL_UINT8((sum + 2u) / 4u, half[y * half_w + x]);
                }
            }
            TEST_ASSERT_EQUAL_HEX8_MESSAGE(GUARD, half[half_w * half_h], "wrote past the half");
        }
    }
}

static void test_half_of_a_flat_image_is_as_bright(void)
{
    static const uint8_t LEVELS[] = {0u, 1u, 127u, 255u};
    const evs_image_t in = {whole, SIDE, SIDE};
    for (size_t i = 0u; i < sizeof LEVELS; i++) {
        for (size_t k = 0u; k < sizeof whole; k++) { whole[k] = LEVELS[i]; }
        evs_image_halve(&in, half);
        for (size_t k = 0u; k < sizeof half - 1u; k++) { TEST_ASSERT_EQUAL_UINT8(LEVELS[i], half[k]); }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_half_is_the_rounded_mean_for_every_size);
    RUN_TEST(test_half_of_a_flat_image_is_as_bright);
    return UNITY_END();
}
