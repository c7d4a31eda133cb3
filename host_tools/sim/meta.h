/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  meta.h
 * @brief meta.json: every setting of a simulated recording, and what came of it.
 */
#ifndef EVSIM_META_H
#define EVSIM_META_H

#include "sim.h"

bool evsim_meta_write(const char *dir, const evsim_settings_t *settings, const evsim_result_t *result,
                      evh_error_t *err);

#endif
