/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "json.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "decimal.h"

#define FILE_MAX_BYTES (1 << 24) /* Nothing that evstab reads back is nearly that large. */

void evt_json_text(cJSON *to, const char *key, const char *text)
{
    if (text != NULL) {
        (void)cJSON_AddStringToObject(to, key, text);
    } else {
        (void)cJSON_AddNullToObject(to, key);
    }
}

void evt_json_count(cJSON *to, const char *key, uint64_t value)
{
    char text[24];
    (void)snprintf(text, sizeof text, "%" PRIu64, value);
    (void)cJSON_AddRawToObject(to, key, text);
}

void evt_json_seconds(cJSON *to, const char *key, int64_t t_us)
{
    char text[32];
    text[evh_decimal_format(text, t_us, 6u)] = '\0';
    (void)cJSON_AddRawToObject(to, key, text);
}

static void number_text(char text[40], double value)
{
    (void)snprintf(text, 40u, "%.9g", value);
    if (!isfinite(value)) { (void)snprintf(text, 40u, "null"); }
}

void evt_json_number(cJSON *to, const char *key, double value)
{
    char text[40];
    number_text(text, value);
    (void)cJSON_AddRawToObject(to, key, text);
}

void evt_json_numbers(cJSON *to, const char *key, const double *value, int n)
{
    cJSON *const array = cJSON_AddArrayToObject(to, key);
    for (int i = 0; i < n; i++) {
        char text[40];
        number_text(text, value[i]);
        (void)cJSON_AddItemToArray(array, cJSON_CreateRaw(text));
    }
}

cJSON *evt_json_read(const char *path, evh_error_t *err)
{
    FILE *const file = fopen(path, "rb");
    char *const text = malloc(FILE_MAX_BYTES);
    cJSON *root = NULL;
    if (file == NULL) {
        (void)evh_fail(err, "%s: cannot read: %s", path, strerror(errno));
    } else if (text == NULL) {
        (void)evh_fail(err, "%s: out of memory", path);
    } else {
        const size_t n = fread(text, 1u, FILE_MAX_BYTES - 1u, file);
        text[n] = '\0';
        root = (ferror(file) == 0) ? cJSON_Parse(text) : NULL;
        if (root == NULL) { (void)evh_fail(err, "%s: cannot be read as JSON", path); }
    }
    free(text);
    if (file != NULL) { (void)fclose(file); }
    return root;
}

bool evt_json_write(cJSON *root, const char *path, evh_error_t *err)
{
    char *const text = (root != NULL) ? cJSON_Print(root) : NULL;
    bool ok = false;
    if (text == NULL) {
        (void)evh_fail(err, "%s: out of memory", path);
    } else {
        FILE *file;
        errno = 0;
        file = fopen(path, "wb");
        if (file != NULL) {
            ok = (fprintf(file, "%s\n", text) > 0);
            ok = (fclose(file) == 0) && ok;
        }
        if (!ok) { (void)evh_fail(err, "%s: cannot write: %s", path, strerror((errno != 0) ? errno : EIO)); }
    }
    cJSON_free(text);
    cJSON_Delete(root);
    return ok;
}

static const cJSON *find(const cJSON *root, const char *keys)
{
    char key[64];
    while ((root != NULL) && (*keys != '\0')) {
        const size_t n = strcspn(keys, ".");
        if (n >= sizeof key) { return NULL; }
        memcpy(key, keys, n);
        key[n] = '\0';
        root = cJSON_GetObjectItemCaseSensitive(root, key);
        keys += n + ((keys[n] == '.') ? 1u : 0u);
    }
    return root;
}

const char *evt_json_get_text(const cJSON *root, const char *keys, const char *otherwise)
{
    const cJSON *const item = find(root, keys);
    return cJSON_IsString(item) ? item->valuestring : otherwise;
}

double evt_json_get_number(const cJSON *root, const char *keys, double otherwise)
{
    const cJSON *const item = find(root, keys);
    return cJSON_IsNumber(item) ? item->valuedouble : otherwise;
}
