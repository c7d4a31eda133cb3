/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  evs/config.h
 * @brief What a build of the library may change, and the compiler dialect that it needs.
 *
 * To change a switch, define EVS_CONFIG_HEADER to the name of your own header, for example
 * -DEVS_CONFIG_HEADER=\"my_evs_config.h\", and define the switches below in it:
 *
 *   EVS_ASSERT(c)     contract checks on hot paths. Default: assert() of <assert.h>; off with NDEBUG.
 *   EVS_NO_SIMD       1 keeps to the plain C kernels. Default 0. The output bits are the same either way.
 *   EVS_NO_IMAGES     1 takes images and the direction of flight out of the pipeline, which refuses settings that ask for
 *                     them. Default 0. It saves the flash of what would be linked without being used.
 *   EVS_NO_PAPER      1 takes the published estimators PAPER and ERL out of egomotion.h, which refuses settings that ask
 *                     for them. Default 0. It saves some 5 KB of flash.
 */
#ifndef EVS_CONFIG_H
#define EVS_CONFIG_H

#ifdef EVS_CONFIG_HEADER
#include EVS_CONFIG_HEADER
#endif

#ifndef EVS_ASSERT
#include <assert.h>
#define EVS_ASSERT(c) assert(c)
#endif

#ifndef EVS_NO_SIMD
#define EVS_NO_SIMD 0
#endif

#ifndef EVS_NO_IMAGES
#define EVS_NO_IMAGES 0
#endif

#ifndef EVS_NO_PAPER
#define EVS_NO_PAPER 0
#endif

#if defined(__GNUC__)
#define EVS_NODISCARD __attribute__((warn_unused_result))
#else
#define EVS_NODISCARD
#endif

#if defined(__cplusplus)
#define EVS_STATIC_ASSERT(c, m) static_assert(c, m)
#elif defined(__STDC_VERSION__) && (__STDC_VERSION__ >= 201112L)
#define EVS_STATIC_ASSERT(c, m) _Static_assert(c, m)
#else
#define EVS_STATIC_ASSERT_NAME_(line) evs_static_assert_##line
#define EVS_STATIC_ASSERT_NAME(line)  EVS_STATIC_ASSERT_NAME_(line)
#define EVS_STATIC_ASSERT(c, m)       typedef char EVS_STATIC_ASSERT_NAME(__LINE__)[(c) ? 1 : -1]
#endif

#endif
