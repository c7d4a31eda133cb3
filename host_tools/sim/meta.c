/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "meta.h"

#include <cJSON.h>
#include <stdlib.h>

#include "csv_writer.h"
#include "evs/version.h"
#include "recording.h"
#include "text_out.h"

static void add_vector(cJSON *object, const char *name, const double *value, int n)
{
    (void)cJSON_AddItemToObject(object, name, cJSON_CreateDoubleArray(value, n));
}

static cJSON *make(const evsim_settings_t *s, const evsim_result_t *r)
{
    cJSON *const meta = cJSON_CreateObject();
    cJSON *part;
    char seed[24];
    (void)cJSON_AddStringToObject(meta, "generator", "evstab sim " EVS_VERSION_STRING);
    (void)cJSON_AddStringToObject(meta, "scene", evsim_scene_names[s->scene]);
    (void)cJSON_AddStringToObject(meta, "motion", evsim_motion_names[s->motion]);
    *evh_put_uint(seed, s->seed) = '\0';
    (void)cJSON_AddItemToObject(meta, "seed", cJSON_CreateRaw(seed)); /* A double would not hold all of them. */
    (void)cJSON_AddNumberToObject(meta, "duration_s", (double)s->duration_us * 1e-6);
    part = cJSON_AddArrayToObject(meta, "textures");
    for (size_t i = 0u; i < s->n_textures; i++) {
        (void)cJSON_AddItemToArray(part, cJSON_CreateString(evh_path_name(s->texture[i])));
    }

    part = cJSON_AddObjectToObject(meta, "camera");
    (void)cJSON_AddNumberToObject(part, "width_px", s->calib.width_px);
    (void)cJSON_AddNumberToObject(part, "height_px", s->calib.height_px);
    add_vector(part, "fx_fy_cx_cy_px",
               (const double[4]){s->calib.fx_px, s->calib.fy_px, s->calib.cx_px, s->calib.cy_px}, 4);
    add_vector(part, "k1_k2_p1_p2_k3", s->calib.dist, 5);
    (void)cJSON_AddBoolToObject(part, "frames", s->frames);
    (void)cJSON_AddNumberToObject(part, "fps_hz", s->fps_hz);
    (void)cJSON_AddNumberToObject(part, "exposure_s", (double)s->exposure_us * 1e-6);
    (void)cJSON_AddStringToObject(part, "frame_time", "middle of the exposure");

    part = cJSON_AddObjectToObject(meta, "events");
    (void)cJSON_AddNumberToObject(part, "contrast_on", s->contrast_on);
    (void)cJSON_AddNumberToObject(part, "contrast_off", s->contrast_off);
    (void)cJSON_AddNumberToObject(part, "contrast_sigma", s->contrast_sigma);
    (void)cJSON_AddNumberToObject(part, "refractory_us", (double)s->refractory_us);
    (void)cJSON_AddNumberToObject(part, "noise_hz", s->noise_hz);
    (void)cJSON_AddNumberToObject(part, "n_hot", s->n_hot);
    (void)cJSON_AddNumberToObject(part, "hot_hz", s->hot_hz);

    part = cJSON_AddObjectToObject(meta, "imu");
    (void)cJSON_AddNumberToObject(part, "rate_hz", s->imu.rate_hz);
    add_vector(part, "gyro_bias_rad_s", s->imu.gyro_bias_rad_s, 3);
    add_vector(part, "accel_bias_m_s2", s->imu.accel_bias_m_s2, 3);
    (void)cJSON_AddNumberToObject(part, "gyro_noise_rad_s_rthz", s->imu.gyro_noise);
    (void)cJSON_AddNumberToObject(part, "accel_noise_m_s2_rthz", s->imu.accel_noise);
    (void)cJSON_AddNumberToObject(part, "gyro_walk_rad_s2_rthz", s->imu.gyro_walk);
    (void)cJSON_AddNumberToObject(part, "accel_walk_m_s3_rthz", s->imu.accel_walk);
    (void)cJSON_AddNumberToObject(part, "gyro_range_rad_s", s->imu.gyro_range_rad_s);
    (void)cJSON_AddNumberToObject(part, "accel_range_m_s2", s->imu.accel_range_m_s2);
    (void)cJSON_AddNumberToObject(part, "offset_us", (double)s->imu.offset_us);

    part = cJSON_AddObjectToObject(meta, "result");
    (void)cJSON_AddNumberToObject(part, "n_events", (double)r->n_events);
    (void)cJSON_AddNumberToObject(part, "n_on", (double)r->n_on);
    (void)cJSON_AddNumberToObject(part, "n_frames", (double)r->n_frames);
    (void)cJSON_AddNumberToObject(part, "n_renders", (double)r->n_renders);
    (void)cJSON_AddNumberToObject(part, "speed_max_px_s", r->speed_max_px_s);
    (void)cJSON_AddNumberToObject(part, "rate_mean_rad_s", r->rate_mean_rad_s);
    (void)cJSON_AddNumberToObject(part, "rate_max_rad_s", r->rate_max_rad_s);
    (void)cJSON_AddNumberToObject(part, "velocity_mean_m_s", r->velocity_mean_m_s);
    return meta;
}

bool evsim_meta_write(const char *dir, const evsim_settings_t *settings, const evsim_result_t *result, evh_error_t *err)
{
    cJSON *const meta = make(settings, result);
    char *const json = cJSON_Print(meta);
    evsim_text_t text;
    cJSON_Delete(meta);
    if (json == NULL) { return evh_fail(err, "out of memory"); }
    if (!evsim_text_open(&text, dir, "meta.json", false, err)) {
        free(json);
        return false;
    }
    for (const char *p = json; *p != '\0'; p++) {
        char *const at = evsim_text_reserve(&text, 1u);
        *at = *p;
        evsim_text_advance(&text, at + 1);
    }
    *evsim_text_reserve(&text, 1u) = '\n';
    text.length++;
    free(json);
    return evsim_text_close(&text, err);
}
