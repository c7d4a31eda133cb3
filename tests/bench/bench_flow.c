/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * Instructions for a pair of images, 240 x 180, step by step: the corners of one image, its half, and the tracks of 128
 * corners with the default settings. The images show a soft texture that has moved by a fraction of a pixel, with noise;
 * the start is off by 1.5 px, as a prediction may be.
 */
#include "bench_markers.h"
#include "bench_regions.h"
#include "bench_texture.h"

#include "board.h"
#include "evs/corners.h"
#include "evs/flow.h"

enum { W = 240, H = 180, CELL = 16, LEVELS = 2 };

static uint8_t px[2][W * H];
static uint8_t levels[2][EVS_PYRAMID_BYTES(W, H, LEVELS)];
static uint32_t corners_memory[(EVS_CORNERS_BYTES(W, H, CELL) + 3u) / 4u];
static uint32_t flow_memory[(EVS_FLOW_BYTES(25, 2) + 3u) / 4u];
static evs_corner_t found[BENCH_TRACKS];
static evs_flow_track_t tracks[BENCH_TRACKS];

static void render(uint8_t *out, uint32_t x_q8, uint32_t y_q8, uint32_t noise)
{
    for (uint32_t y = 0u; y < H; y++) {
        for (uint32_t x = 0u; x < W; x++) {
            const uint32_t grey =
                texture_at(256u * x + x_q8, 256u * y + y_q8) + (texture_hash(x + noise, y) >> 16) % 8u;
            out[y * W + x] = (uint8_t)((grey > 255u) ? 255u : grey);
        }
    }
}

int main(void)
{
    const evs_image_t images[2] = {{px[0], W, H}, {px[1], W, H}};
    const evs_corners_config_t corners_cfg = evs_corners_config_default(W, H);
    const evs_flow_config_t flow_cfg = evs_flow_config_default();
    evs_corners_t corners;
    evs_flow_t flow;
    evs_pyramid_t pyramid[2];
    render(px[0], 2560u, 2560u, 0u);
    render(px[1], 2560u - 351u, 2560u + 159u, 1000u);
    if ((evs_corners_init(&corners, &corners_cfg, corners_memory, sizeof corners_memory) != EVS_OK) ||
        (evs_flow_init(&flow, &flow_cfg, flow_memory, sizeof flow_memory) != EVS_OK) ||
        (evs_pyramid_build(&pyramid[0], &images[0], LEVELS, levels[0], sizeof levels[0]) != EVS_OK)) {
        board_puts("bench_flow: set-up refused\n");
        return 1;
    }

    BENCH_START(BENCH_IMAGE_PAIR);
    BENCH_START(BENCH_CORNERS);
    const size_t n = evs_corners_find(&corners, &images[0], found, BENCH_TRACKS);
    BENCH_STOP(BENCH_CORNERS);
    const evs_status_t built = evs_pyramid_build(&pyramid[1], &images[1], LEVELS, levels[1], sizeof levels[1]);
    for (size_t i = 0u; i < n; i++) {
        tracks[i].from = (evs_position_t){256 * found[i].x_px, 256 * found[i].y_px};
        tracks[i].to = tracks[i].from;
    }
    BENCH_START(BENCH_TRACK_ALL);
    evs_flow_track(&flow, &pyramid[0], &pyramid[1], tracks, n);
    BENCH_STOP(BENCH_TRACK_ALL);
    BENCH_STOP(BENCH_IMAGE_PAIR);

    size_t n_right = 0u;
    for (size_t i = 0u; i < n; i++) {
        const int32_t dx = tracks[i].to.x_q8 - tracks[i].from.x_q8 - 351;
        const int32_t dy = tracks[i].to.y_q8 - tracks[i].from.y_q8 + 159;
        n_right += ((tracks[i].status == EVS_FLOW_OK) && (dx * dx + dy * dy < 64 * 64)) ? 1u : 0u;
    }
    if ((built != EVS_OK) || (n != BENCH_TRACKS) || (n_right < BENCH_TRACKS * 9u / 10u)) {
        board_puts("bench_flow: too few corners, or tracks that went wrong\n");
        return 1;
    }
    return 0;
}
