/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "gyro_bias.h"

#include <math.h>
#include <string.h>

#include "decimal.h"
#include "to_device.h"

#define BIAS_MAX_NRAD_S 500000000 /* What the filter can be set to. */

bool evt_gyro_bias_parse(const char *text, evt_gyro_bias_t *bias)
{
    const char *const end = text + strlen(text);
    evt_gyro_bias_t parsed = {.given = true};
    for (int i = 0; i < 3; i++) {
        int64_t nrad_s = 0;
        if (!evh_decimal_parse(&text, end, 9, &nrad_s, NULL) || (nrad_s < -BIAS_MAX_NRAD_S) ||
            (nrad_s > BIAS_MAX_NRAD_S)) {
            return false;
        }
        parsed.rad_s[i] = 1e-9 * (double)nrad_s;
        if ((i < 2) && ((text == end) || (*text++ != ','))) { return false; }
    }
    if (text != end) { return false; }
    *bias = parsed;
    return true;
}

void evt_gyro_bias_admit(const evt_gyro_bias_t *bias, evs_attitude_config_t *cfg)
{
    for (int i = 0; (i < 3) && bias->given; i++) {
        const uint16_t mrad_s = (uint16_t)ceil(1e3 * fabs(bias->rad_s[i]));
        if (mrad_s > cfg->bias_max_mrad_s) { cfg->bias_max_mrad_s = mrad_s; }
    }
}

void evt_gyro_bias_give(const evt_gyro_bias_t *bias, evs_attitude_t *att)
{
    if (!bias->given) { return; }
    const evs_status_t status = evs_attitude_set_bias(att, evt_rate_q24(bias->rad_s));
    EVS_ASSERT(status == EVS_OK);
    (void)status;
}
