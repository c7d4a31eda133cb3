/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* What the fuzz targets share. A target defines LLVMFuzzerTestOneInput(); libFuzzer calls it (option EVS_FUZZ, clang),
 * or fuzz_main.c, which replays the corpus and a fixed number of mutations of it under any compiler, as a ctest. */
#ifndef FUZZ_H
#define FUZZ_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* The readers read files: write the input to one. The path stays the same for the whole process. */
const char *fuzz_file(const uint8_t *data, size_t size);

#define FUZZ_CHECK(condition)                                                                                          \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            (void)fprintf(stderr, "%s:%d: %s is not so\n", __FILE__, __LINE__, #condition);                            \
            abort();                                                                                                   \
        }                                                                                                              \
    } while (0)

#endif
