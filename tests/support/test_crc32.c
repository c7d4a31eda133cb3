/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "crc32.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

static void test_the_published_check_value(void)
{
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926u, crc32_bytes(0u, "123456789", 9u));
    TEST_ASSERT_EQUAL_HEX32(0u, crc32_bytes(0u, "", 0u));
}

static void test_it_goes_on_where_it_stopped(void)
{
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926u, crc32_bytes(crc32_bytes(0u, "1234", 4u), "56789", 5u));
}

static void test_numbers_count_low_byte_first(void)
{
    TEST_ASSERT_EQUAL_HEX32(crc32_bytes(0u, "1234", 4u), crc32_u32(0u, 0x34333231u));
    TEST_ASSERT_EQUAL_HEX32(crc32_bytes(0u, "12", 2u), crc32_u16(0u, 0x3231u));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_published_check_value);
    RUN_TEST(test_it_goes_on_where_it_stopped);
    RUN_TEST(test_numbers_count_low_byte_first);
    return UNITY_END();
}
