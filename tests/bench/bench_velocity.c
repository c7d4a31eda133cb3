/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * Instructions from a stabilized image of 240 x 180 to the direction of flight, with the default settings: the second of two
 * images that a camera took while it flew to the right along a slanting wall, and once more after a saccade, when the
 * keyframe has to be turned.
 */
#include "bench_markers.h"
#include "bench_regions.h"
#include "bench_texture.h"

#include "board.h"
#include "evs/velocity.h"

enum { W = 240, H = 180, INTERVAL_US = 70000, TRACKS_PER_STEP = 16 };

static evs_velocity_t velocity;
static uint64_t memory[EVS_VELOCITY_DEFAULT_BYTES(W, H) / 8u];
static uint8_t scratch[W * H];

/* The wall after n images: its rows move to the left by 3 to 7 px each time. */
static void render(uint8_t *out, uint32_t n)
{
    for (uint32_t y = 0u; y < H; y++) {
        const uint32_t moved_q8 = n * (3u * 256u + 4u * 256u * y / H);
        for (uint32_t x = 0u; x < W; x++) {
            const uint32_t grey =
                texture_at(256u * x + 2560u + moved_q8, 256u * y + 2560u) + (texture_hash(x + 1000u * n, y) >> 16) % 8u;
            out[y * W + x] = (uint8_t)((grey > 255u) ? 255u : grey);
        }
    }
}

static bool begin(uint32_t n, evs_quat_t q_wr)
{
    const evs_velocity_image_t image = {
        .px = evs_velocity_plane(&velocity), .t_us = n * (uint32_t)INTERVAL_US, .q_wr = q_wr};
    return evs_velocity_begin(&velocity, &image, scratch) == EVS_OK;
}

int main(void)
{
    const evs_pinhole_t pinhole = {.width_px = W,
                                   .height_px = H,
                                   .fx_q16 = INT32_C(200) << 16,
                                   .fy_q16 = INT32_C(200) << 16,
                                   .cx_q16 = INT32_C(0x778000),
                                   .cy_q16 = INT32_C(0x598000)};
    const evs_velocity_config_t cfg = evs_velocity_config_default(&pinhole);
    evs_velocity_result_t result = {.flags = 0u};
    if (evs_velocity_init(&velocity, &cfg, memory, sizeof memory) != EVS_OK) {
        board_puts("bench_velocity: set-up refused\n");
        return 1;
    }
    render(evs_velocity_plane(&velocity), 0u);
    bool ok = begin(0u, evs_quat_identity());
    render(evs_velocity_plane(&velocity), 1u);

    BENCH_START(BENCH_DIRECTION);
    ok = begin(1u, evs_quat_identity()) && ok;
    while (!evs_velocity_step(&velocity, TRACKS_PER_STEP, &result)) {}
    BENCH_STOP(BENCH_DIRECTION);

    ok = ok && ((result.flags & EVS_VELOCITY_VALID) != 0u) && (result.v_r_q30.x > INT32_C(0x3F000000));
    if (!ok || (result.n_corners != BENCH_DIRECTION_TRACKS)) {
        board_puts("bench_velocity: a wrong direction, or not as many corners\n");
        return 1;
    }

    const evs_quat_t turned = evs_quat_from_rotvec((evs_vec3_t){0, INT32_C(1) << 25, 0}); /* 7 degrees */
    render(evs_velocity_plane(&velocity), 2u);
    BENCH_START(BENCH_TURN);
    ok = begin(2u, turned);
    BENCH_STOP(BENCH_TURN);
    return (ok && (evs_velocity_counts(&velocity).n_turned == 1u)) ? 0 : 1;
}
