/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/version.h
 * @brief The version; the only place it is written. CMake reads it from here.
 */
#ifndef EVS_VERSION_H
#define EVS_VERSION_H

#define EVS_VERSION_MAJOR 0
#define EVS_VERSION_MINOR 1
#define EVS_VERSION_PATCH 0

#define EVS_VERSION_TEXT_(a, b, c) #a "." #b "." #c
#define EVS_VERSION_TEXT(a, b, c)  EVS_VERSION_TEXT_(a, b, c)
#define EVS_VERSION_STRING         EVS_VERSION_TEXT(EVS_VERSION_MAJOR, EVS_VERSION_MINOR, EVS_VERSION_PATCH)

#endif
