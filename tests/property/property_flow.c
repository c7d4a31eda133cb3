/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The kernels of optical flow, those that this build uses and others that it has, give the bits of the plain ones for any
 * content, window and fraction, and read no pixel beyond those that the header of the kernels allows. */
#include "../../lib/src/evs_flow_kernel.h"
#include "unity.h"

#include <string.h>

enum { SIDE = 75, N_BYTES = EVS_FLOW_BYTES(31, 1) };

static uint32_t state = 0x2545F491u;
static uint8_t image[SIDE * SIDE], exact[SIDE * SIDE];
static uint32_t memory[2][N_BYTES / 4u + 1u];
static evs_flow_t used, plain;

typedef struct {
    void (*make_template)(evs_flow_t *flow, evs_flow_place_t at, evs_flow_texture_t *texture);
    void (*make_pull)(const evs_flow_t *flow, evs_flow_place_t at, evs_flow_pull_t *pull);
    uint32_t (*difference)(const evs_flow_t *flow, evs_flow_place_t at);
    uint16_t first_stride_px;
} kernels_t;

static const kernels_t KERNELS[] = {{evs_flow_template, evs_flow_pull, evs_flow_difference, 1u},
                                    {evs_flow_template_pairs, evs_flow_pull_pairs, evs_flow_difference_pairs, 2u}};

void setUp(void) {}
void tearDown(void) {}

static uint32_t below(uint32_t limit)
{
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return (uint32_t)(((uint64_t)state * limit) >> 32);
}

static void fill(uint32_t kind)
{
    for (uint32_t i = 0u; i < SIDE * SIDE; i++) {
        const uint32_t x = i % SIDE, y = i / SIDE;
        const uint32_t grey[] = {below(256u),
                                 below(2u) * 255u,
                                 (x & 2u) ? 255u : 0u, /* The steepest gradients along x, y, and both. */
                                 (y & 2u) ? 255u : 0u,
                                 ((x ^ y) & 2u) ? 255u : 0u,
                                 (3u * x + 2u * y) % 256u};
        image[i] = (uint8_t)grey[kind];
    }
}

/*
 * A random place, the pixels that a kernel may read there copied to the very end of `exact`, so that a sanitizer sees a
 * read beyond the last one. `flipped` inverts them: the largest differences.
 */
static evs_flow_place_t random_place(bool flipped)
{
    const size_t columns = (size_t)used.patch_columns - 2u * EVS_FLOW_SPARE_PX;
    const size_t rows = (size_t)used.patch_rows - 2u * EVS_FLOW_SPARE_PX;
    const size_t x = below((uint32_t)(SIDE - columns + 1u)), y = below((uint32_t)(SIDE - rows + 1u));
    uint8_t *const part = exact + sizeof exact - rows * columns;
    for (size_t r = 0u; r < rows; r++) {
        for (size_t c = 0u; c < columns; c++) {
            const uint8_t grey = image[(y + r) * SIDE + x + c];
            part[r * columns + c] = flipped ? (uint8_t)(255u - grey) : grey;
        }
    }
    evs_flow_place_t at = {.px = part + columns + 1u, .pitch = columns};
    const bool whole = below(4u) == 0u;
    evs_flow_set_weights(&at, whole ? 0u : below(128u), whole ? 0u : below(128u));
    return at;
}

static void assert_same_template(void)
{
    for (size_t i = 0u; i < used.n_side; i++) {
        for (size_t c = 0u; c < used.n_pitch; c++) {
            const int16_t *const got = evs_flow_sample(&used, i, c), *const want = evs_flow_sample(&plain, i, c);
            TEST_ASSERT_EQUAL_INT16(want[EVS_FLOW_DX], got[EVS_FLOW_DX]); /* 0 past the samples, in both */
            TEST_ASSERT_EQUAL_INT16(want[EVS_FLOW_DY], got[EVS_FLOW_DY]);
            if (c < used.n_side) { TEST_ASSERT_EQUAL_INT16(want[0], got[0]); }
        }
    }
}

static void check_window(const kernels_t *kernels, uint16_t window_px, uint16_t stride_px)
{
    evs_flow_config_t cfg = evs_flow_config_default();
    cfg.window_px = window_px;
    cfg.stride_px = stride_px;
    memset(memory, 0xA5, sizeof memory);
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_flow_init(&used, &cfg, memory[0], N_BYTES));
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_flow_init(&plain, &cfg, memory[1], N_BYTES));

    evs_flow_texture_t texture, want_texture;
    evs_flow_place_t at = random_place(false);
    kernels->make_template(&used, at, &texture);
    evs_flow_template_plain(&plain, at, &want_texture);
    assert_same_template();
    TEST_ASSERT_EQUAL_INT32(want_texture.xx, texture.xx);
    TEST_ASSERT_EQUAL_INT32(want_texture.xy, texture.xy);
    TEST_ASSERT_EQUAL_INT32(want_texture.yy, texture.yy);

    for (uint32_t k = 0u; k < 2u; k++) {
        evs_flow_pull_t pull, want_pull;
        at = random_place(k == 1u);
        kernels->make_pull(&used, at, &pull);
        evs_flow_pull_plain(&plain, at, &want_pull);
        TEST_ASSERT_EQUAL_INT64(want_pull.x, pull.x);
        TEST_ASSERT_EQUAL_INT64(want_pull.y, pull.y);
        TEST_ASSERT_EQUAL_UINT32(evs_flow_difference_plain(&plain, at), kernels->difference(&used, at));
    }
}

static void test_every_kernel_gives_the_bits_of_the_plain_one(void)
{
    for (uint32_t kind = 0u; kind < 6u; kind++) {
        fill(kind);
        for (uint16_t window_px = EVS_FLOW_WINDOW_MIN_PX; window_px <= EVS_FLOW_WINDOW_MAX_PX; window_px += 2u) {
            for (size_t k = 0u; k < sizeof KERNELS / sizeof KERNELS[0]; k++) {
                for (uint16_t stride_px = KERNELS[k].first_stride_px; stride_px <= 2u; stride_px++) {
                    check_window(&KERNELS[k], window_px, stride_px);
                }
            }
        }
    }
}

static void test_weights_add_up_and_none_is_negative(void)
{
    for (uint32_t fy = 0u; fy < 128u; fy++) {
        for (uint32_t fx = 0u; fx < 128u; fx++) {
            evs_flow_place_t at;
            evs_flow_set_weights(&at, fx, fy);
            TEST_ASSERT_TRUE((at.w00 <= 128u) && (at.w01 <= 128u) && (at.w10 <= 128u) && (at.w11 <= 128u));
            TEST_ASSERT_EQUAL_UINT32(128u, at.w00 + at.w01 + at.w10 + at.w11);
            TEST_ASSERT_EQUAL_UINT32(fx, at.w01 + at.w11);
            TEST_ASSERT_EQUAL_UINT32(fy, at.w10 + at.w11);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_every_kernel_gives_the_bits_of_the_plain_one);
    RUN_TEST(test_weights_add_up_and_none_is_negative);
    return UNITY_END();
}
