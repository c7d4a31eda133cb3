/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include "csv_writer.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "decimal.h"

#define BLOCK_BYTES   (1u << 18)
#define RESERVE_BYTES (1u << 16)

bool evh_csv_open_path(evh_csv_t *csv, const char *path, const char *header, evh_error_t *err)
{
    memset(csv, 0, sizeof *csv);
    csv->file = fopen(path, "wb");
    if (csv->file == NULL) { return evh_fail(err, "%s: cannot write: %s", path, strerror(errno)); }
    csv->path = strdup(path);
    csv->buffer = malloc(BLOCK_BYTES);
    if ((csv->path == NULL) || (csv->buffer == NULL)) {
        csv->failure = ENOMEM;
        return evh_csv_close(csv, err);
    }
    evh_csv_advance(csv, evh_put_text(evh_csv_reserve(csv, strlen(header) + 1u), header));
    evh_csv_advance(csv, evh_put_text(evh_csv_reserve(csv, 1u), "\n"));
    return true;
}

bool evh_csv_open(evh_csv_t *csv, const char *dir, const char *name, const char *header, evh_error_t *err)
{
    const size_t bytes = strlen(dir) + strlen(name) + 2u;
    char *const path = malloc(bytes);
    bool ok;
    memset(csv, 0, sizeof *csv);
    if (path == NULL) { return evh_fail(err, "%s: out of memory", dir); }
    (void)snprintf(path, bytes, "%s/%s", dir, name);
    ok = evh_csv_open_path(csv, path, header, err);
    free(path);
    return ok;
}

static void flush(evh_csv_t *csv)
{
    if ((csv->length > 0u) && (csv->failure == 0) && (fwrite(csv->buffer, 1u, csv->length, csv->file) != csv->length)) {
        csv->failure = (errno != 0) ? errno : EIO;
    }
    csv->length = 0u;
}

char *evh_csv_reserve(evh_csv_t *csv, size_t bytes)
{
    if (csv->length + ((bytes > RESERVE_BYTES) ? RESERVE_BYTES : bytes) > BLOCK_BYTES) { flush(csv); }
    return csv->buffer + csv->length;
}

void evh_csv_advance(evh_csv_t *csv, char *end) { csv->length = (size_t)(end - csv->buffer); }

char *evh_put_uint(char *out, uint64_t value)
{
    char reversed[20];
    int n = 0;
    do {
        reversed[n++] = (char)('0' + (char)(value % 10u));
        value /= 10u;
    } while (value != 0u);
    while (n > 0) { *out++ = reversed[--n]; }
    return out;
}

char *evh_put_int(char *out, int64_t value)
{
    if (value < 0) {
        *out++ = '-';
        return evh_put_uint(out, 0u - (uint64_t)value);
    }
    return evh_put_uint(out, (uint64_t)value);
}

/* Exactly six digits. */
static char *put_six(char *out, uint32_t value)
{
    for (int i = 5; i >= 0; i--) {
        out[i] = (char)('0' + (char)(value % 10u));
        value /= 10u;
    }
    return out + 6;
}

char *evh_put_time_us(char *out, int64_t t_us)
{
    const uint64_t magnitude = (t_us < 0) ? 0u - (uint64_t)t_us : (uint64_t)t_us;
    if (t_us < 0) { *out++ = '-'; }
    out = evh_put_uint(out, magnitude / 1000000u);
    *out++ = '.';
    return put_six(out, (uint32_t)(magnitude % 1000000u));
}

char *evh_put_q4(char *out, int16_t value_q4)
{
    static const char FRACTION[16][5] = {"0000", "0625", "1250", "1875", "2500", "3125", "3750", "4375",
                                         "5000", "5625", "6250", "6875", "7500", "8125", "8750", "9375"};
    const unsigned magnitude = (unsigned)((value_q4 < 0) ? -(int)value_q4 : (int)value_q4);
    if (value_q4 < 0) { *out++ = '-'; }
    out = evh_put_uint(out, magnitude >> 4);
    *out++ = '.';
    memcpy(out, FRACTION[magnitude & 15u], 4u);
    return out + 4;
}

char *evh_put_q(char *out, int32_t value, unsigned bits, unsigned decimals)
{
    /* |value| 10^9 < 2^61; rounded half away from zero. */
    int64_t scaled = value;
    int64_t half;
    for (unsigned i = 0u; i < decimals; i++) { scaled *= 10; }
    half = (bits > 0u) ? (INT64_C(1) << (bits - 1u)) : 0;
    scaled = (scaled < 0) ? -((-scaled + half) >> bits) : ((scaled + half) >> bits);
    return out + evh_decimal_format(out, scaled, decimals);
}

char *evh_put_text(char *out, const char *text)
{
    const size_t n = strlen(text);
    memcpy(out, text, n);
    return out + n;
}

bool evh_csv_close(evh_csv_t *csv, evh_error_t *err)
{
    bool ok = true;
    if (csv->file != NULL) {
        if (csv->buffer != NULL) { flush(csv); }
        errno = 0;
        if ((fclose(csv->file) != 0) && (csv->failure == 0)) { csv->failure = (errno != 0) ? errno : EIO; }
        if (csv->failure != 0) {
            ok = evh_fail(err, "%s: cannot write: %s", (csv->path != NULL) ? csv->path : "output",
                          strerror(csv->failure));
        }
    }
    free(csv->buffer);
    free(csv->path);
    memset(csv, 0, sizeof *csv);
    return ok;
}
