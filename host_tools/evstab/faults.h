/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  faults.h
 * @brief What the attitude filter found wrong with the samples, in words.
 */
#ifndef EVT_FAULTS_H
#define EVT_FAULTS_H

#include "evs/attitude.h"

/** A note to stderr, unless there is nothing to tell. */
void evt_note_attitude_faults(const evs_attitude_faults_t *faults);

#endif
