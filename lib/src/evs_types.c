/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/types.h"

const char *evs_status_name(evs_status_t status)
{
    /* A switch without default: the compiler then names the status that somebody adds and forgets here. */
    switch (status) {
    case EVS_OK:
        return "EVS_OK";
    case EVS_ERR_NULL:
        return "EVS_ERR_NULL";
    case EVS_ERR_ARG:
        return "EVS_ERR_ARG";
    case EVS_ERR_SIZE:
        return "EVS_ERR_SIZE";
    case EVS_ERR_TIME:
        return "EVS_ERR_TIME";
    case EVS_ERR_STATE:
        return "EVS_ERR_STATE";
    case EVS_ERR_NUMERIC:
        return "EVS_ERR_NUMERIC";
    case EVS_ERR_TOO_OLD:
        return "EVS_ERR_TOO_OLD";
    case EVS_ERR_TOO_NEW:
        return "EVS_ERR_TOO_NEW";
    case EVS_ERR_GAP:
        return "EVS_ERR_GAP";
    }
    return "EVS_ERR_?";
}
