/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "to_device.h"

#include <math.h>

evs_camera_config_t evt_camera_config(const evh_calib_t *calib, uint16_t width_px, uint16_t height_px)
{
    evs_camera_config_t c = {0};
    c.model = calib->fisheye ? EVS_CAMERA_FISHEYE : EVS_CAMERA_PINHOLE;
    c.width_px = width_px;
    c.height_px = height_px;
    c.fx_q16 = evs_q_from_double(calib->fx_px, 16);
    c.fy_q16 = evs_q_from_double(calib->fy_px, 16);
    c.cx_q16 = evs_q_from_double(calib->cx_px, 16);
    c.cy_q16 = evs_q_from_double(calib->cy_px, 16);
    for (unsigned i = 0; i < EVS_CAMERA_N_DIST; i++) { c.dist_q32[i] = (int64_t)llround(ldexp(calib->dist[i], 32)); }
    return c;
}
