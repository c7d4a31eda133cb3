/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* IMU samples and poses: what comes out is finite, in range and in order. */
#include <math.h>

#include "detect.h"
#include "fuzz.h"
#include "imu_text.h"
#include "poses_text.h"

static void read_imu(const char *path, bool named)
{
    evh_error_t err = {""};
    evh_imu_t imu;
    evh_imu_sample_t s;
    int64_t last_us = INT64_MIN;
    if (!(named ? evh_imu_open_named(&imu, path, &err) : evh_imu_open(&imu, path, NULL, &err))) {
        FUZZ_CHECK(err.text[0] != '\0');
        return;
    }
    while (named ? evh_imu_next_any(&imu, &s, &err) : evh_imu_next(&imu, &s, &err)) {
        if (s.fault != EVH_FAULT_NONE) { continue; }
        for (int i = 0; i < 3; i++) {
            FUZZ_CHECK(isfinite(s.gyro_rad_s[i]) && (fabs(s.gyro_rad_s[i]) <= 100.0));
            FUZZ_CHECK(isfinite(s.accel_m_s2[i]) && (fabs(s.accel_m_s2[i]) <= 2000.0));
            FUZZ_CHECK(isfinite(s.mag_ut[i]));
        }
        FUZZ_CHECK(s.t_us > last_us);
        last_us = s.t_us;
    }
    evh_imu_close(&imu);
}

static void read_poses(const char *path)
{
    evh_error_t err = {""};
    evh_poses_t poses;
    if (!evh_poses_read(&poses, path, &err)) {
        FUZZ_CHECK(err.text[0] != '\0');
        return;
    }
    for (size_t i = 0; i < poses.n; i++) {
        const double *const q = poses.pose[i].q_wxyz;
        FUZZ_CHECK(fabs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) < 1e-9);
        FUZZ_CHECK((i == 0) || (poses.pose[i].t_us > poses.pose[i - 1].t_us));
    }
    evh_poses_free(&poses);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const char *const path = fuzz_file(data, size);
    evh_error_t err = {""};
    evh_kind_t kind;
    evh_set_quiet(true);
    (void)evh_detect(path, &kind, &err);
    read_imu(path, false);
    read_imu(path, true);
    read_poses(path);
    return 0;
}
