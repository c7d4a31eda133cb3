/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* A stranger's program: prints the version and calls into the archive, so that it must have been linked. */
#include <stdio.h>

#include "evs/types.h"
#include "evs/version.h"

int main(void)
{
    puts(EVS_VERSION_STRING);
    puts(evs_status_name(EVS_OK));
    return 0;
}
