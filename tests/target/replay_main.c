/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* replay RECORDING SETTING, for the host and, with files by semihosting, for the boards. */
#include "replay.h"

#include <stdio.h>

#if defined(EVS_BOARD)
#include "semihost.h"

static int32_t read_file(void *source, void *bytes, size_t n_bytes)
{
    return semihost_read(*(const int *)source, bytes, n_bytes);
}

static const char *run(const char *path, const char *setting, replay_result_t *result)
{
    int handle = semihost_open(path, SEMIHOST_READ_BINARY);
    if (handle < 0) { return "cannot open it"; }
    const char *const problem = replay_run(read_file, &handle, setting, result);
    semihost_close(handle);
    return problem;
}
#else
static int32_t read_file(void *source, void *bytes, size_t n_bytes)
{
    FILE *const file = source;
    const size_t n = fread(bytes, 1, n_bytes, file);
    return (ferror(file) != 0) ? -1 : (int32_t)n;
}

static const char *run(const char *path, const char *setting, replay_result_t *result)
{
    FILE *const file = fopen(path, "rb");
    if (file == NULL) { return "cannot open it"; }
    const char *const problem = replay_run(read_file, file, setting, result);
    fclose(file);
    return problem;
}
#endif

int main(int argc, char **argv)
{
    replay_result_t result;
    if (argc != 3) {
        printf("usage: replay RECORDING full|grid|duration\n");
        return 2;
    }
    const char *const problem = run(argv[1], argv[2], &result);
    if (problem != NULL) {
        printf("%s, setting %s: %s\n", argv[1], argv[2], problem);
        return 1;
    }
    replay_print(&result);
    return 0;
}
