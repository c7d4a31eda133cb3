/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Tables that the scripts of tests/vectors make. Private. */
#ifndef EVS_TABLES_H
#define EVS_TABLES_H

#include <stdint.h>

/* exp(-d^2 / 2) / sqrt(2 pi) in Q15 for d = (k - 3) - (i - 8) / 16; [i][7] = 0. */
extern const uint16_t evs_gauss_q15[16][8];

/* 2^-((i + 1/2) / 256) in Q16. */
extern const uint16_t evs_decay_q16[256];

#endif
