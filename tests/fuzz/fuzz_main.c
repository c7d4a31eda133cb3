/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Replays a corpus and mutations of it through a fuzz target, the same on every machine.
 *
 * usage: fuzz_TARGET N_MUTATIONS FILE... */
#include <string.h>

#include "fuzz.h"

#define INPUT_MAX 65536u

static uint64_t rng_state = 88172645463325252u;

/* xorshift64: Marsaglia, "Xorshift RNGs", Journal of Statistical Software 8(14), 2003. */
static uint32_t rng(uint32_t n)
{
    rng_state ^= rng_state << 13;
    rng_state ^= rng_state >> 7;
    rng_state ^= rng_state << 17;
    return (uint32_t)((rng_state >> 32) % n);
}

/* What parsers of numbers stumble over. */
static const char *const TOKENS[] = {"nan",    "inf", "-",      "1e9", "1000000000", "99999999999999999999",
                                     "1e-400", "e",   ".",      "\n",  "\r\n",       " ",
                                     ",",      "#",   "0x10",   "\t",  ":",          "[",
                                     "]",      "{",   "-1",     "1.",  "1e5",        "\"",
                                     "*a",     "&a",  "%YAML:", "?",   "-0",         ";"};

static size_t insert(uint8_t *data, size_t size, const void *bytes, size_t n, size_t at)
{
    if (size + n > INPUT_MAX) { return size; }
    memmove(data + at + n, data + at, size - at);
    memcpy(data + at, bytes, n);
    return size + n;
}

static size_t mutate(uint8_t *data, size_t size)
{
    uint8_t copy[64];
    const size_t at = rng((uint32_t)size + 1u);
    size_t n = 1u + rng(64u);
    switch (rng(6u)) {
    case 0: /* another byte */
        if (at < size) { data[at] = (uint8_t)rng(256u); }
        return size;
    case 1: /* a token */
    {
        const char *const token = TOKENS[rng((uint32_t)(sizeof TOKENS / sizeof TOKENS[0]))];
        return insert(data, size, token, strlen(token), at);
    }
    case 2: /* a piece missing */
        n = (at + n > size) ? size - at : n;
        memmove(data + at, data + at + n, size - at - n);
        return size - n;
    case 3: /* a piece twice */
        n = (at + n > size) ? size - at : n;
        memcpy(copy, data + at, n);
        return insert(data, size, copy, n, at);
    case 4: /* cut short */
        return (rng(8u) == 0u) ? at : size;
    default: /* a digit changed */
        for (size_t i = at; i < size; i++) {
            if ((data[i] >= '0') && (data[i] <= '9')) {
                data[i] = (uint8_t)('0' + rng(10u));
                break;
            }
        }
        return size;
    }
}

static void run_file(const char *path, unsigned long n_mutations)
{
    static uint8_t seed[INPUT_MAX];
    static uint8_t data[INPUT_MAX];
    FILE *const file = fopen(path, "rb");
    size_t size;
    if (file == NULL) {
        perror(path);
        exit(1);
    }
    size = fread(seed, 1u, sizeof seed, file);
    (void)fclose(file);
    (void)LLVMFuzzerTestOneInput(seed, size);
    for (unsigned long i = 0; i < n_mutations; i++) {
        size_t n = size;
        memcpy(data, seed, size);
        for (uint32_t k = 1u + rng(6u); k > 0u; k--) { n = mutate(data, n); }
        (void)LLVMFuzzerTestOneInput(data, n);
    }
}

int main(int argc, char **argv)
{
    if (argc < 3) {
        (void)fprintf(stderr, "usage: %s N_MUTATIONS FILE...\n", argv[0]);
        return 2;
    }
    for (int i = 2; i < argc; i++) { run_file(argv[i], strtoul(argv[1], NULL, 10)); }
    (void)printf("%d files, each with %s mutations\n", argc - 2, argv[1]);
    return 0;
}
