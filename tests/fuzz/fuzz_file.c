/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include <string.h>
#include <unistd.h>

#include "fuzz.h"

static char path[] = "/tmp/evstab_fuzz_XXXXXX";

static void remove_file(void) { (void)unlink(path); }

const char *fuzz_file(const uint8_t *data, size_t size)
{
    static FILE *file;
    if (file == NULL) {
        const int fd = mkstemp(path);
        FUZZ_CHECK(fd >= 0);
        (void)atexit(remove_file);
        file = fdopen(fd, "wb");
        FUZZ_CHECK(file != NULL);
    }
    FUZZ_CHECK(fseek(file, 0, SEEK_SET) == 0);
    FUZZ_CHECK(ftruncate(fileno(file), 0) == 0);
    FUZZ_CHECK(fwrite(data, 1, size, file) == size);
    FUZZ_CHECK(fflush(file) == 0);
    return path;
}
