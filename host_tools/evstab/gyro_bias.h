/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  gyro_bias.h
 * @brief A gyro bias that is known beforehand: what the gyro reads when nothing turns, in the IMU's own axes. The filter
 *        subtracts it.
 */
#ifndef EVT_GYRO_BIAS_H
#define EVT_GYRO_BIAS_H

#include "evs/attitude.h"

#define EVT_GYRO_BIAS_EXPECTED "rad/s about the IMU's x,y,z, each within 0.5, such as 0.012,-0.02,0.005"

typedef struct {
    bool given;
    double rad_s[3];
} evt_gyro_bias_t;

/** "X,Y,Z" in rad/s. @return false for a text that is not wholly that; the bias is untouched then. */
bool evt_gyro_bias_parse(const char *text, evt_gyro_bias_t *bias);

/** Let the filter take a bias as large as this one. */
void evt_gyro_bias_admit(const evt_gyro_bias_t *bias, evs_attitude_config_t *cfg);

/** Give it to a filter that has been initialized so. Without a bias nothing changes. */
void evt_gyro_bias_give(const evt_gyro_bias_t *bias, evs_attitude_t *att);

#endif
