/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "text.h"

#include <math.h>
#include <string.h>

#include "png_bytes.h"
#include "unity.h"

#include <stdlib.h>

static evr_text_t t;

void setUp(void) { memset(&t, 0, sizeof t); }
void tearDown(void) { evr_text_free(&t); }

static void test_base64_is_that_of_rfc_4648(void)
{
    static const char *const CASES[][2] = {{"", ""},
                                           {"f", "Zg=="},
                                           {"fo", "Zm8="},
                                           {"foo", "Zm9v"},
                                           {"foob", "Zm9vYg=="},
                                           {"fooba", "Zm9vYmE="},
                                           {"foobar", "Zm9vYmFy"},
                                           {"\xff\xfe\xfd", "//79"}};
    for (size_t i = 0u; i < sizeof CASES / sizeof CASES[0]; i++) {
        uint8_t bytes[8];
        const size_t n = strlen(CASES[i][0]);
        memcpy(bytes, CASES[i][0], n);
        evr_text_free(&t);
        evr_put(&t, "=");
        evr_put_base64(&t, bytes, n);
        TEST_ASSERT_EQUAL_STRING(CASES[i][1], t.bytes + 1);
        TEST_ASSERT_EQUAL_size_t(strlen(t.bytes), t.n);
    }
}

static void test_markup_in_a_name_becomes_text(void)
{
    evr_put_html(&t, "<script>\"a\" & 'b'</script>.txt");
    TEST_ASSERT_EQUAL_STRING("&lt;script&gt;&quot;a&quot; &amp; &#39;b&#39;&lt;/script&gt;.txt", t.bytes);
}

static void test_a_json_string_holds_any_bytes(void)
{
    evr_put_json_string(&t, "</script><!--\"\\\n\x01\xc3\xa9&");
    TEST_ASSERT_EQUAL_STRING("\"\\u003c/script\\u003e\\u003c!--\\u0022\\u005c\\u000a\\u0001\xc3\xa9\\u0026\"", t.bytes);
}

static void test_json_in_a_page_cannot_end_its_element(void)
{
    evr_put_json_in_html(&t, "{\"a\": \"</script>&\\\"\", \"b\": [1, 2]}");
    TEST_ASSERT_EQUAL_STRING("{\"a\": \"\\u003c/script\\u003e\\u0026\\\"\", \"b\": [1, 2]}", t.bytes);
}

static void test_numbers_that_json_lacks_become_null(void)
{
    evr_put_number(&t, 1.0 / 3.0, 4);
    evr_put(&t, " ");
    evr_put_number(&t, (double)NAN, 4);
    evr_put(&t, " ");
    evr_put_number(&t, -(double)INFINITY, 4);
    TEST_ASSERT_EQUAL_STRING("0.3333 null null", t.bytes);
}

static void test_a_long_text_grows(void)
{
    for (int i = 0; i < 10000; i++) { evr_printf(&t, "%04d", i); }
    TEST_ASSERT_EQUAL_size_t(40000u, t.n);
    TEST_ASSERT_EQUAL_STRING("9999", t.bytes + 39996);
    TEST_ASSERT_FALSE(t.failed);
}

static void test_a_picture_becomes_a_png(void)
{
    static const uint8_t SIGNATURE[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    const uint8_t grey[6] = {0u, 1u, 2u, 253u, 254u, 255u};
    evr_png_t png;
    TEST_ASSERT_TRUE(evr_png_encode(&png, grey, 3, 2, 8));
    TEST_ASSERT_EQUAL_UINT8_ARRAY(SIGNATURE, png.bytes, 8);
    TEST_ASSERT_EQUAL_UINT8(3u, png.bytes[19]); /* IHDR: width */
    TEST_ASSERT_EQUAL_UINT8(2u, png.bytes[23]); /* height */
    TEST_ASSERT_EQUAL_UINT8(8u, png.bytes[24]); /* bits */
    TEST_ASSERT_EQUAL_UINT8(0u, png.bytes[25]); /* grey */
    free(png.bytes);
    TEST_ASSERT_TRUE(evr_png_encode(&png, grey, 3, 1, 4));
    TEST_ASSERT_EQUAL_UINT8(4u, png.bytes[24]);
    free(png.bytes);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_base64_is_that_of_rfc_4648);
    RUN_TEST(test_markup_in_a_name_becomes_text);
    RUN_TEST(test_a_json_string_holds_any_bytes);
    RUN_TEST(test_json_in_a_page_cannot_end_its_element);
    RUN_TEST(test_numbers_that_json_lacks_become_null);
    RUN_TEST(test_a_long_text_grows);
    RUN_TEST(test_a_picture_becomes_a_png);
    return UNITY_END();
}
