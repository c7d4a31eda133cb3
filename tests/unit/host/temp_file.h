/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* A file with given contents for the tests of readers; removed by temp_file_remove(). */
#ifndef TEMP_FILE_H
#define TEMP_FILE_H

#include <stddef.h>

/** Path of a new file with these bytes; valid until the next call. */
const char *temp_file(const void *bytes, size_t n);

/** The same for a text. */
const char *temp_text(const char *text);

/** The same, gzip-compressed, the last @p cut bytes missing. */
const char *temp_gz(const char *text, size_t cut);

void temp_file_remove(void);

#endif
