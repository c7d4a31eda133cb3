/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include "temp_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zlib.h>

static char path[] = "/tmp/evstab_test_XXXXXX";
static int exists;

static void fail(const char *what)
{
    perror(what);
    exit(1);
}

const char *temp_file(const void *bytes, size_t n)
{
    int fd;
    temp_file_remove();
    memcpy(path + sizeof path - 7, "XXXXXX", 6);
    fd = mkstemp(path);
    if (fd < 0) { fail("mkstemp"); }
    exists = 1;
    if ((n > 0) && (write(fd, bytes, n) != (ssize_t)n)) { fail("write"); }
    if (close(fd) != 0) { fail("close"); }
    return path;
}

const char *temp_text(const char *text) { return temp_file(text, strlen(text)); }

const char *temp_gz(const char *text, size_t cut)
{
    static unsigned char packed[1 << 16];
    static unsigned char plain[1 << 16];
    z_stream z;
    memset(&z, 0, sizeof z);
    if (deflateInit2(&z, 6, Z_DEFLATED, 31, 8, Z_DEFAULT_STRATEGY) != Z_OK) { fail("deflateInit2"); }
    if (strlen(text) > sizeof plain) { fail("temp_gz: text too long"); }
    memcpy(plain, text, strlen(text)); /* zlib's input is not const by default. */
    z.next_in = plain;
    z.avail_in = (uInt)strlen(text);
    z.next_out = packed;
    z.avail_out = sizeof packed;
    if (deflate(&z, Z_FINISH) != Z_STREAM_END) { fail("deflate"); }
    (void)deflateEnd(&z);
    return temp_file(packed, z.total_out - cut);
}

void temp_file_remove(void)
{
    if (exists) { (void)unlink(path); }
    exists = 0;
}
