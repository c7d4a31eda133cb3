/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _XOPEN_SOURCE 700
#include "names.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void drop_end(char *text, const char *end)
{
    const size_t n = strlen(text);
    const size_t m = strlen(end);
    if ((n > m) && (strcmp(text + n - m, end) == 0)) { text[n - m] = '\0'; }
}

/* The part between the last slashes of `path`, which loses slashes at its end. */
static const char *last_part(char *path)
{
    char *slash;
    size_t n = strlen(path);
    while ((n > 1u) && (path[n - 1u] == '/')) { path[--n] = '\0'; }
    slash = strrchr(path, '/');
    return (slash != NULL) ? slash + 1 : path;
}

static bool is_name(const char *part)
{
    return (part[0] != '\0') && (strcmp(part, ".") != 0) && (strcmp(part, "..") != 0);
}

static char *stem(const char *path)
{
    char *copy = strdup(path);
    char *name = NULL;
    const char *part;
    if (copy == NULL) { return NULL; }
    part = last_part(copy);
    if (!is_name(part)) {
        char *const real = realpath(path, NULL);
        if (real != NULL) {
            free(copy);
            copy = real;
            part = last_part(copy);
        }
    }
    name = strdup(is_name(part) ? part : "recording");
    free(copy);
    if (name != NULL) {
        drop_end(name, ".gz");
        drop_end(name, ".txt");
        drop_end(name, ".csv");
    }
    return name;
}

static bool is_taken(char *const *name, size_t n, const char *candidate)
{
    for (size_t i = 0u; i < n; i++) {
        if (strcmp(name[i], candidate) == 0) { return true; }
    }
    return false;
}

/* "a", "a_2", "a_3": the first that none of the n before it has. */
static char *make_unique(char *wish, char *const *name, size_t n)
{
    const size_t bytes = strlen(wish) + 24u;
    char *const candidate = malloc(bytes);
    if (candidate != NULL) {
        (void)snprintf(candidate, bytes, "%s", wish);
        for (size_t k = 2u; is_taken(name, n, candidate); k++) { (void)snprintf(candidate, bytes, "%s_%zu", wish, k); }
    }
    free(wish);
    return candidate;
}

bool evb_names(const char *const *path, size_t n, char **name)
{
    for (size_t i = 0u; i < n; i++) { name[i] = NULL; }
    for (size_t i = 0u; i < n; i++) {
        char *const wish = stem(path[i]);
        name[i] = (wish != NULL) ? make_unique(wish, name, i) : NULL;
        if (name[i] == NULL) {
            for (size_t k = 0u; k < i; k++) {
                free(name[k]);
                name[k] = NULL;
            }
            return false;
        }
    }
    return true;
}
