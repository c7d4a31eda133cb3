/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Which vector instructions the kernels may use: each 0 or 1, all 0 with EVS_NO_SIMD. Private. */
#ifndef EVS_SIMD_H
#define EVS_SIMD_H

#include "evs/config.h"

#if !EVS_NO_SIMD && defined(__GNUC__) && defined(__x86_64__)
#define EVS_SIMD_X86 1
#else
#define EVS_SIMD_X86 0
#endif

/* The DSP extension of Arm's microcontrollers: Cortex-M4, M7, M33, M55, ... */
#if !EVS_NO_SIMD && defined(__GNUC__) && defined(__ARM_FEATURE_DSP) && defined(__ARM_ARCH_PROFILE) &&                  \
    !defined(__ARM_BIG_ENDIAN)
#define EVS_SIMD_DSP (__ARM_ARCH_PROFILE == 'M')
#else
#define EVS_SIMD_DSP 0
#endif

/* Helium, the vector extension: Cortex-M55, M85. They have the DSP extension, too. */
#if EVS_SIMD_DSP && defined(__ARM_FEATURE_MVE)
#define EVS_SIMD_MVE 1
#else
#define EVS_SIMD_MVE 0
#endif

#endif
