/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "series.h"

#include "shake.h"
#include "unity.h"

static evr_series_t s;
static evr_counts_t c;
static evr_shake_t shake;

void setUp(void)
{
    evr_series_clear(&s);
    evr_counts_clear(&c);
    evr_shake_clear(&shake);
}
void tearDown(void) {}

static size_t n_kept(void)
{
    size_t n = 0u;
    evr_sample_t out[2];
    for (size_t i = 0u; i < EVR_SERIES_BINS; i++) { n += evr_series_samples(&s.bin[i], out); }
    return n;
}

static void test_few_samples_are_all_kept(void)
{
    for (int i = 0; i < 80; i++) { evr_series_put(&s, i * 1000, i); }
    TEST_ASSERT_EQUAL_size_t(80u, n_kept());
}

static void test_a_sample_keeps_its_own_spread(void)
{
    evr_sample_t out[2];
    for (int i = 0; i < 10; i++) { evr_series_put_spread(&s, i, i, 0.1 * i); } /* One bin. */
    TEST_ASSERT_EQUAL_size_t(2u, evr_series_samples(&s.bin[0], out));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, out[0].spread);
    TEST_ASSERT_EQUAL_DOUBLE(0.9, out[1].spread);
    for (int i = 0; i < 5000; i++) { evr_series_put(&s, 1000 * i, 5.0); } /* Bins merge. */
    TEST_ASSERT_EQUAL_size_t(2u, evr_series_samples(&s.bin[0], out));
    TEST_ASSERT_EQUAL_DOUBLE(9.0, out[1].value);
    TEST_ASSERT_EQUAL_DOUBLE(0.9, out[1].spread);
}

static void test_a_peak_survives_any_length(void)
{
    double low = 1e9;
    double high = -1e9;
    uint64_t n = 0u;
    for (int64_t i = 0; i < 300000; i++) {
        const double v = (i == 123457) ? 100.0 : (i == 200001) ? -50.0 : (double)(i % 7);
        evr_series_put(&s, i * 1000, v);
    }
    for (size_t i = 0u; i < EVR_SERIES_BINS; i++) {
        if (s.bin[i].n == 0u) { continue; }
        n += s.bin[i].n;
        if (s.bin[i].low.value < low) { low = s.bin[i].low.value; }
        if (s.bin[i].high.value > high) { high = s.bin[i].high.value; }
        TEST_ASSERT_EQUAL_INT64((int64_t)i, s.bin[i].low.t_us / s.width_us);
        TEST_ASSERT_EQUAL_INT64((int64_t)i, s.bin[i].high.t_us / s.width_us);
    }
    TEST_ASSERT_EQUAL_DOUBLE(-50.0, low);
    TEST_ASSERT_EQUAL_DOUBLE(100.0, high);
    TEST_ASSERT_EQUAL_UINT64(300000u, n);
    TEST_ASSERT_TRUE(n_kept() <= 2000u);
    TEST_ASSERT_TRUE(n_kept() > 900u);
}

static void test_the_two_samples_of_a_bin_come_in_the_order_of_time(void)
{
    evr_sample_t out[2];
    evr_series_put(&s, 10, 5.0);
    evr_series_put(&s, 20, 9.0);
    evr_series_put(&s, 30, -1.0);
    TEST_ASSERT_EQUAL_size_t(2u, evr_series_samples(&s.bin[0], out));
    TEST_ASSERT_EQUAL_DOUBLE(9.0, out[0].value);
    TEST_ASSERT_EQUAL_DOUBLE(-1.0, out[1].value);
}

static void test_a_time_before_the_start_is_ignored(void)
{
    const int64_t early = -5;
    evr_series_put(&s, -1, 3.0);
    evr_counts_add(&c, 0, &early, 1u);
    TEST_ASSERT_EQUAL_size_t(0u, n_kept());
    for (size_t i = 0u; i < EVR_SERIES_BINS; i++) { TEST_ASSERT_EQUAL_UINT64(0u, c.n[i]); }
}

static void test_counts_add_up_when_bins_double(void)
{
    int64_t t_us[1000];
    uint64_t sum = 0u;
    for (int round = 0; round < 50; round++) {
        for (int i = 0; i < 1000; i++) { t_us[i] = 1000000 + (round * 1000 + i) * 37; }
        evr_counts_add(&c, 1000000, t_us, 1000u);
    }
    for (size_t i = 0u; i < EVR_SERIES_BINS; i++) { sum += c.n[i]; }
    TEST_ASSERT_EQUAL_UINT64(50000u, sum);
    TEST_ASSERT_EQUAL_INT64(3200, c.width_us); /* 1.85 s */
    TEST_ASSERT_UINT64_WITHIN(1u, 3200u / 37u, c.n[0]);
    TEST_ASSERT_UINT64_WITHIN(1u, 3200u / 37u, c.n[300]);
}

static void test_a_span_is_asked_for_its_own_rate(void)
{
    evr_shake_mean_t m;
    for (int64_t t = -20000; t < 100000; t += 500) { evr_shake_put(&shake, t, (t < 50000) ? 1.0 : 3.0, 10.0); }
    m = evr_shake_between(&shake, 0, 49999);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, m.rate_rad_s);
    TEST_ASSERT_EQUAL_UINT32(100u, m.n);
    m = evr_shake_between(&shake, 0, 99999);
    TEST_ASSERT_EQUAL_DOUBLE(2.0, m.rate_rad_s);
    TEST_ASSERT_EQUAL_DOUBLE(3.0, m.rate_max_rad_s);
    TEST_ASSERT_EQUAL_DOUBLE(10.0, m.motion_px_s);
    TEST_ASSERT_EQUAL_UINT32(0u, evr_shake_between(&shake, 200000, 300000).n);
    TEST_ASSERT_EQUAL_UINT32(40u, evr_shake_between(&shake, -20000, -1).n);
}

static void test_an_old_rate_is_forgotten_not_mistaken(void)
{
    evr_shake_put(&shake, 1000, 7.0, 1.0);
    evr_shake_put(&shake, 1000 + EVR_SHAKE_MS * 1000, 2.0, 1.0);
    TEST_ASSERT_EQUAL_UINT32(0u, evr_shake_between(&shake, 1000, 1999).n);
    TEST_ASSERT_EQUAL_DOUBLE(2.0, evr_shake_between(&shake, 0, INT64_C(1000) * (EVR_SHAKE_MS + 2)).rate_rad_s);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_few_samples_are_all_kept);
    RUN_TEST(test_a_sample_keeps_its_own_spread);
    RUN_TEST(test_a_peak_survives_any_length);
    RUN_TEST(test_the_two_samples_of_a_bin_come_in_the_order_of_time);
    RUN_TEST(test_a_time_before_the_start_is_ignored);
    RUN_TEST(test_counts_add_up_when_bins_double);
    RUN_TEST(test_a_span_is_asked_for_its_own_rate);
    RUN_TEST(test_an_old_rate_is_forgotten_not_mistaken);
    return UNITY_END();
}
