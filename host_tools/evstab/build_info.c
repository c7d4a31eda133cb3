/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* What the program and the computer know about themselves: a timing without it is worth nothing a month later. */
#include <stdio.h>
#include <string.h>
#if defined(__APPLE__)
#include <sys/sysctl.h>
#include <sys/types.h>
#endif

#include "bench.h"
#include "commit.h" /* Written by the build, see commit.cmake. */

const char *evt_build_commit(void) { return EVT_COMMIT; }

const char *evt_build_compiler(void)
{
#if defined(__clang__)
    return "clang " __clang_version__;
#elif defined(__GNUC__)
    return "gcc " __VERSION__;
#else
    return "unknown";
#endif
}

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define HAS_SANITIZER 1
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define HAS_SANITIZER 1
#endif

const char *evt_build_flaw(void)
{
#if defined(HAS_SANITIZER)
    return "it was built with sanitizers";
#elif defined(__GNUC__) && !defined(__OPTIMIZE__)
    return "it was built without optimization";
#else
    return NULL;
#endif
}

#if !defined(__APPLE__)
/* "key : value" lines; the first that names the processor. On Arm only the board may have a name. */
static bool from_cpuinfo(const char *key, char *name, size_t bytes)
{
    char line[512];
    bool found = false;
    FILE *const file = fopen("/proc/cpuinfo", "r");
    if (file == NULL) { return false; }
    while (!found && (fgets(line, sizeof line, file) != NULL)) {
        const size_t n = strlen(key);
        const char *value = strchr(line, ':');
        if ((strncmp(line, key, n) != 0) || (value == NULL) ||
            ((line[n] != '\t') && (line[n] != ' ') && (line[n] != ':'))) {
            continue;
        }
        value++;
        while (*value == ' ') { value++; }
        (void)snprintf(name, bytes, "%.*s", (int)strcspn(value, "\r\n"), value);
        found = (name[0] != '\0');
    }
    (void)fclose(file);
    return found;
}
#endif

void evt_cpu_name(char *name, size_t bytes)
{
#if defined(__APPLE__)
    size_t length = bytes;
    if (sysctlbyname("machdep.cpu.brand_string", name, &length, NULL, 0) == 0) { return; }
#else
    static const char *const KEYS[] = {"model name", "Model", "Hardware", "uarch", "Processor"};
    for (size_t i = 0u; i < sizeof KEYS / sizeof KEYS[0]; i++) {
        if (from_cpuinfo(KEYS[i], name, bytes)) { return; }
    }
#endif
    (void)snprintf(name, bytes, "unknown");
}
