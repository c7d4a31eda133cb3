/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "decimal.h"

#define DIGITS_KEPT   19     /* The largest count of digits that always fits uint64_t. */
#define EXPONENT_STOP 100000 /* Further digits of an exponent cannot matter. */

static bool is_digit(char c) { return (c >= '0') && (c <= '9'); }

/* The digits of a number: mantissa * 10^exponent. */
typedef struct {
    uint64_t mantissa;
    int exponent;
    int n_kept;
    bool any_digit;
    bool lost_digit; /* A non-zero digit did not fit the mantissa. */
} digits_t;

static void take_digit(digits_t *d, char c, bool after_point)
{
    const unsigned digit = (unsigned)(c - '0');
    d->any_digit = true;
    if ((d->n_kept > 0) || (digit != 0u)) {
        if (d->n_kept < DIGITS_KEPT) {
            d->mantissa = d->mantissa * 10u + digit;
            d->n_kept++;
        } else {
            d->lost_digit = d->lost_digit || (digit != 0u);
            if (d->exponent < EXPONENT_STOP) { d->exponent++; }
        }
    }
    if (after_point && (d->exponent > -EXPONENT_STOP)) { d->exponent--; }
}

static const char *take_exponent(const char *p, const char *end, digits_t *d)
{
    const char *const start = p;
    bool negative = false;
    int value = 0;
    p++; /* The 'e'. */
    if ((p < end) && ((*p == '-') || (*p == '+'))) { negative = (*p++ == '-'); }
    if ((p == end) || !is_digit(*p)) { return start; }
    for (; (p < end) && is_digit(*p); p++) {
        if (value < EXPONENT_STOP) { value = value * 10 + (*p - '0'); }
    }
    d->exponent += negative ? -value : value;
    return p;
}

/* mantissa * 10^shift, rounded half up. */
static bool scale(const digits_t *d, int shift, uint64_t *magnitude, bool *exact)
{
    uint64_t m = d->mantissa;
    *exact = !d->lost_digit;
    if (m == 0u) {
        *magnitude = 0u;
        return true;
    }
    for (; shift > 0; shift--) {
        if (m > UINT64_MAX / 10u) { return false; }
        m *= 10u;
    }
    if (shift < -DIGITS_KEPT) {
        *exact = false;
        *magnitude = 0u;
        return true;
    }
    if (shift < 0) {
        uint64_t divisor = 1u;
        uint64_t rest;
        for (; shift < 0; shift++) { divisor *= 10u; }
        rest = m % divisor;
        m /= divisor;
        if (rest != 0u) { *exact = false; }
        if (rest >= divisor - divisor / 2u) { m++; }
    }
    *magnitude = m;
    return true;
}

bool evh_decimal_parse(const char **text, const char *end, int decimals, int64_t *value, bool *exact)
{
    const char *p = *text;
    digits_t d = {0u, 0, 0, false, false};
    bool negative = false;
    bool is_exact = true;
    uint64_t magnitude = 0u;

    if ((p < end) && ((*p == '-') || (*p == '+'))) { negative = (*p++ == '-'); }
    for (; (p < end) && is_digit(*p); p++) { take_digit(&d, *p, false); }
    if ((p < end) && (*p == '.')) {
        p++;
        for (; (p < end) && is_digit(*p); p++) { take_digit(&d, *p, true); }
    }
    if (!d.any_digit) { return false; }
    if ((p < end) && ((*p == 'e') || (*p == 'E'))) { p = take_exponent(p, end, &d); }
    if (!scale(&d, d.exponent + decimals, &magnitude, &is_exact) || (magnitude > (uint64_t)INT64_MAX)) { return false; }

    *text = p;
    *value = negative ? -(int64_t)magnitude : (int64_t)magnitude;
    if (exact != NULL) { *exact = is_exact; }
    return true;
}

size_t evh_decimal_format(char *out, int64_t value, unsigned decimals)
{
    char reversed[24];
    size_t n = 0u;
    size_t length = 0u;
    uint64_t magnitude = (value < 0) ? 0u - (uint64_t)value : (uint64_t)value;

    for (unsigned i = 0u; (magnitude != 0u) || (i <= decimals); i++) {
        if ((i == decimals) && (decimals > 0u)) { reversed[n++] = '.'; }
        reversed[n++] = (char)('0' + (char)(magnitude % 10u));
        magnitude /= 10u;
    }
    if (value < 0) { out[length++] = '-'; }
    while (n > 0u) { out[length++] = reversed[--n]; }
    return length;
}
