/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* A pipeline without its images: this file's own copy of that part takes the place of the library's. */
#define EVS_NO_IMAGES 1
#include "../../lib/src/evs_pipeline_imaging.c"
#include "unity.h"

enum { W = 32, H = 24, N_EVENTS = 100 };

#define BYTES (EVS_PIPELINE_BYTES(W, H, 1u, false, 12u, 64u, 8u, 16u) + EVS_PIPELINE_VELOCITY_BYTES(W, H))

static evs_pipeline_t p;
static uint64_t memory[BYTES / 8u];
static evs_camera_config_t camera;

void setUp(void) { camera = evs_camera_config_ideal(W, H, INT32_C(30) << 16); }
void tearDown(void) {}

static evs_pipeline_config_t config(evs_pipeline_config_t cfg)
{
    cfg.source = EVS_PIPELINE_ORIENTATION;
    cfg.n_cols = 4u;
    cfg.n_rows = 3u;
    cfg.n_fifo = 64u;
    cfg.n_ring = 8u;
    cfg.n_batch = 16u;
    return cfg;
}

static void test_settings_that_ask_for_images_are_refused(void)
{
    evs_pipeline_config_t cfg = config(evs_pipeline_config_velocity(&camera));
    TEST_ASSERT_EQUAL_UINT(0u, evs_pipeline_bytes(&cfg));
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_pipeline_init(&p, &cfg, memory, sizeof memory));
    cfg.velocity_on = false;
    TEST_ASSERT_EQUAL_INT(EVS_ERR_ARG, evs_pipeline_init(&p, &cfg, memory, sizeof memory));
}

static void test_events_are_stabilized_as_ever(void)
{
    evs_pipeline_config_t cfg = config(evs_pipeline_config_default(&camera));
    cfg.window.kind = EVS_WINDOW_COUNT;
    cfg.window.threshold = 50u;
    TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_init(&p, &cfg, memory, sizeof memory));
    size_t n_out = 0u, n_windows = 0u;
    for (uint32_t i = 0u; i < N_EVENTS; i++) {
        const evs_orientation_t s = {.t_us = i * 1000u, .q_wc = evs_quat_identity()};
        const evs_event_t ev = evs_event_make(i * 1000u, 10u, 10u, true);
        TEST_ASSERT_EQUAL_INT(EVS_OK, evs_pipeline_push_orientation(&p, &s));
        TEST_ASSERT_EQUAL_UINT(1u, evs_pipeline_push_events(&p, &ev, 1u));
        if (i == N_EVENTS - 1u) { evs_pipeline_finish(&p); }
        evs_pipeline_chunk_t chunk;
        while (evs_pipeline_pull(&p, &chunk)) {
            n_out += chunk.n;
            n_windows += (chunk.end.reason != EVS_WINDOW_OPEN) ? 1u : 0u;
            TEST_ASSERT_NULL(chunk.image.px);
        }
    }
    TEST_ASSERT_EQUAL_UINT(N_EVENTS, n_out);
    TEST_ASSERT_EQUAL_UINT(2u, n_windows);
    evs_velocity_result_t none;
    TEST_ASSERT_FALSE(evs_pipeline_velocity_busy(&p));
    TEST_ASSERT_FALSE(evs_pipeline_velocity(&p, 1u, &none));
    TEST_ASSERT_NULL(evs_pipeline_velocity_part(&p));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_settings_that_ask_for_images_are_refused);
    RUN_TEST(test_events_are_stabilized_as_ever);
    return UNITY_END();
}
