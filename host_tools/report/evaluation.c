/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evaluation.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lines.h"
#include "recording.h"
#include "text.h"

/* Where the template leaves room; the element's end follows the numbers. */
#define BEGIN "<script type=\"application/json\" id=\"evaluation-data\">"
#define END   "</script>"

static bool read_whole(evr_text_t *t, const char *path, evh_error_t *err)
{
    char block[65536];
    size_t n;
    FILE *const f = fopen(path, "rb");
    if (f == NULL) { return evh_fail(err, "%s: %s", path, strerror(errno)); }
    while ((n = fread(block, 1u, sizeof block, f)) > 0u) { evr_put_n(t, block, n); }
    const bool ok = ferror(f) == 0;
    (void)fclose(f);
    if (!ok) { return evh_fail(err, "%s: cannot be read", path); }
    return t->failed ? evh_fail(err, "%s: out of memory", path) : true;
}

static bool write_whole(const evr_text_t *t, const char *path, evh_error_t *err)
{
    FILE *const f = fopen(path, "wb");
    if (f == NULL) { return evh_fail(err, "%s: %s", path, strerror(errno)); }
    const bool written = fwrite(t->bytes, 1u, t->n, f) == t->n;
    const bool closed = fclose(f) == 0;
    return (written && closed) || evh_fail(err, "%s: cannot be written: %s", path, strerror(errno));
}

/* The page with the numbers between BEGIN and END. */
static bool replace(evr_text_t *out, const evr_text_t *page, const char *json, const char *path, evh_error_t *err)
{
    const char *const begin = (page->bytes != NULL) ? strstr(page->bytes, BEGIN) : NULL;
    const char *const end = (begin != NULL) ? strstr(begin, END) : NULL;
    if (end == NULL) {
        return evh_fail(err, "%s: no room for an evaluation in it; was it written by this version of evstab replay?",
                        path);
    }
    evr_put_n(out, page->bytes, (size_t)(begin - page->bytes) + strlen(BEGIN));
    evr_put(out, "\n");
    evr_put_json_in_html(out, json);
    evr_put(out, "\n");
    evr_put_n(out, end, page->n - (size_t)(end - page->bytes));
    return out->failed ? evh_fail(err, "%s: out of memory", path) : true;
}

bool evr_put_evaluation(const char *dir, const char *json, bool *found, evh_error_t *err)
{
    evr_text_t page = {NULL, 0u, 0u, false};
    evr_text_t out = {NULL, 0u, 0u, false};
    char *const path = evh_path_join(dir, "report.html");
    char *const part = evh_path_join(dir, "report.html.part");
    bool ok;
    if ((path == NULL) || (part == NULL)) {
        ok = evh_fail(err, "out of memory");
    } else if (!evh_file_exists(path)) {
        *found = false;
        ok = true;
    } else {
        *found = true;
        ok = read_whole(&page, path, err) && replace(&out, &page, json, path, err) && write_whole(&out, part, err);
        if (ok && (rename(part, path) != 0)) { ok = evh_fail(err, "%s: %s", path, strerror(errno)); }
        if (!ok) { (void)remove(part); }
    }
    evr_text_free(&page);
    evr_text_free(&out);
    free(path);
    free(part);
    return ok;
}
