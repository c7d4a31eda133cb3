/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Calibrations and parameter files: what is accepted lies in the ranges that the library takes. */
#include <math.h>
#include <string.h>

#include "config_yaml.h"
#include "fuzz.h"

static void check_calib(const evh_calib_t *c)
{
    FUZZ_CHECK((c->fx_px >= 8.0) && (c->fx_px <= 8192.0) && (c->fy_px >= 8.0) && (c->fy_px <= 8192.0));
    FUZZ_CHECK((fabs(c->cx_px) <= 4096.0) && (fabs(c->cy_px) <= 4096.0));
    for (int i = 0; i < 5; i++) { FUZZ_CHECK(fabs(c->dist[i]) < 16384.0); }
    FUZZ_CHECK((c->width_px <= 2048) && (c->height_px <= 2048));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    evh_error_t err = {""};
    evh_config_t config;
    evh_calib_t calib;
    evh_set_quiet(true);
    if (evh_config_parse(&config, (const char *)data, size, "fuzz", &err)) {
        if (config.has_calib) { check_calib(&config.calib); }
        if (config.has_q_ci) {
            const double *const q = config.q_ci_wxyz;
            FUZZ_CHECK(fabs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) < 1e-9);
        }
    } else {
        FUZZ_CHECK((err.text[0] != '\0') && (strchr(err.text, '\n') == NULL));
    }
    err.text[0] = '\0';
    if (evh_calib_text_read(&calib, fuzz_file(data, size), &err)) { check_calib(&calib); }
    return 0;
}
