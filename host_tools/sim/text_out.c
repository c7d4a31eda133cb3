/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "text_out.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "csv_writer.h"
#include "decimal.h"
#include "recording.h"

#define ROW_BYTES_MAX 4096u
#define GZ_FAST       "wb1" /* Level 6 takes four times as long for a quarter less. */
#define PLAIN         "wbT"

bool evsim_text_open(evsim_text_t *text, const char *dir, const char *name, bool gz, evh_error_t *err)
{
    memset(text, 0, sizeof *text);
    text->path = evh_path_join(dir, name);
    text->buffer = malloc(EVSIM_TEXT_BLOCK);
    if ((text->path == NULL) || (text->buffer == NULL)) {
        text->failure = ENOMEM;
        return evsim_text_close(text, err);
    }
    errno = 0;
    text->file = gzopen(text->path, gz ? GZ_FAST : PLAIN);
    if (text->file == NULL) {
        text->failure = (errno != 0) ? errno : ENOMEM;
        return evsim_text_close(text, err);
    }
    return true;
}

static void flush(evsim_text_t *text)
{
    if ((text->length > 0u) && (text->failure == 0)) {
        errno = 0;
        if (gzwrite(text->file, text->buffer, (unsigned)text->length) != (int)text->length) {
            text->failure = (errno != 0) ? errno : EIO;
        }
    }
    text->length = 0u;
}

char *evsim_text_reserve(evsim_text_t *text, size_t bytes)
{
    if (text->length + bytes > EVSIM_TEXT_BLOCK) { flush(text); }
    return text->buffer + text->length;
}

void evsim_text_advance(evsim_text_t *text, char *end) { text->length = (size_t)(end - text->buffer); }

void evsim_text_row(evsim_text_t *text, int64_t t_ns, const double *number, size_t n)
{
    char *p = evsim_text_reserve(text, ROW_BYTES_MAX);
    p += evh_decimal_format(p, t_ns, 9u);
    for (size_t i = 0u; i < n; i++) {
        *p++ = ' ';
        p += evh_decimal_format(p, (int64_t)llround(number[i] * 1e9), 9u);
    }
    *p++ = '\n';
    evsim_text_advance(text, p);
}

bool evsim_text_close(evsim_text_t *text, evh_error_t *err)
{
    bool ok = true;
    if (text->file != NULL) {
        flush(text);
        errno = 0;
        if ((gzclose(text->file) != Z_OK) && (text->failure == 0)) { text->failure = (errno != 0) ? errno : EIO; }
    }
    if (text->failure != 0) {
        ok = evh_fail(err, "%s: cannot write: %s", (text->path != NULL) ? text->path : "output",
                      strerror(text->failure));
    }
    free(text->buffer);
    free(text->path);
    memset(text, 0, sizeof *text);
    return ok;
}
