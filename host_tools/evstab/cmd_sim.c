/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* evstab sim: a recording that never was, with the truth beside it. Words and numbers of the command line become
 * settings here; the simulator itself is in sim/. */
#define _POSIX_C_SOURCE 200809L
#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "command.h"
#include "options.h"
#include "pool.h"
#include "progress.h"
#include "sim.h"

#define DURATION_MAX_S 3600.0
#define DEG            (3.14159265358979323846 / 180.0)
#define G_M_S2         9.81
#define NUMBERS_MAX    3u

static struct {
    const char *output, *motion, *duration, *seed, *size, *calib;
    const char *fx, *fy, *cx, *cy, *k1, *k2, *p1, *p2, *k3;
    const char *fps, *exposure, *texture;
    const char *imu_rate, *gyro_bias, *gyro_noise, *gyro_walk, *accel_bias, *accel_noise, *accel_walk;
    const char *imu_range, *imu_offset;
    const char *contrast, *contrast_sigma, *refractory, *noise, *hot, *jobs;
    bool no_frames, gz, quiet;
} opt;

static const evt_option_t OPTIONS[] = {
    {"output", 'o', "DIR", "Folder to write; made if it is not there. Needed.", &opt.output, NULL},
    {"motion", '\0', "NAME",
     "handheld  moderate, all six degrees of freedom\n"
     "hover     drone: drift, sway, rotor vibration\n"
     "sweep     fast hand-held swings\n"
     "flap      flapping wings: 5 Hz pitch and heave, forward flight\n"
     "rotate    rotation only\n"
     "static    at rest",
     &opt.motion, NULL},
    {"duration", '\0', "S", "Seconds, up to 3600. Default 3.", &opt.duration, NULL},
    {"seed", '\0', "N", "Another seed, another recording. Default 1.", &opt.seed, NULL},
    {"size", '\0', "WxH", "Sensor in pixels, up to 2048x2048. Default 240x180.", &opt.size, NULL},
    {"calib", '\0', "FILE", "Lens: fx fy cx cy k1 k2 p1 p2 k3, as in ECD's calib.txt.\nDefault: 62 degrees wide.",
     &opt.calib, NULL},
    {"fx", '\0', "PX", "Focal length and centre one by one; they win over\n--calib.", &opt.fx, NULL},
    {"fy", '\0', "PX", "As --fx if only that is given.", &opt.fy, NULL},
    {"cx", '\0', "PX", "Default: the middle.", &opt.cx, NULL},
    {"cy", '\0', "PX", "Default: the middle.", &opt.cy, NULL},
    {"k1", '\0', "K", "Distortion one by one (Brown-Conrady). Default -0.36.", &opt.k1, NULL},
    {"k2", '\0', "K", "Default 0.15.", &opt.k2, NULL},
    {"p1", '\0', "P", "Default 0.", &opt.p1, NULL},
    {"p2", '\0', "P", "Default 0.", &opt.p2, NULL},
    {"k3", '\0', "K", "Default 0.", &opt.k3, NULL},
    {"texture", '\0', "FILE,...", "PNG or JPEG pictures for the surfaces, up to 32.\nDefault: procedural textures.",
     &opt.texture, NULL},
    {"fps", '\0', "HZ", "Frames per second. Default 24.", &opt.fps, NULL},
    {"exposure", '\0', "S", "Exposure time of a frame. Default 0.01.", &opt.exposure, NULL},
    {"no-frames", '\0', NULL, "Events and IMU only. The events stay the same.", NULL, &opt.no_frames},
    {"contrast", '\0', "C[,C]", "Threshold on log intensity, or ON,OFF. Default 0.35.", &opt.contrast, NULL},
    {"contrast-sigma", '\0', "C", "Its spread from pixel to pixel. Default 0.02.", &opt.contrast_sigma, NULL},
    {"refractory-us", '\0', "US", "Shortest time between events of a pixel. Default 100.", &opt.refractory, NULL},
    {"noise-hz", '\0', "HZ", "Background events per pixel. Default 0.1.", &opt.noise, NULL},
    {"hot", '\0', "N,HZ", "N hot pixels that fire at this rate. Default none.", &opt.hot, NULL},
    {"imu-rate", '\0', "HZ", "Samples per second. Default 1000.", &opt.imu_rate, NULL},
    {"gyro-bias", '\0', "B[,B,B]", "rad/s: x,y,z, or one length in a random direction.\nDefault 0.01.", &opt.gyro_bias,
     NULL},
    {"gyro-noise", '\0', "N", "White noise, rad/s/sqrt(Hz). Default 0.0001.", &opt.gyro_noise, NULL},
    {"gyro-walk", '\0', "N", "Walk of the bias, rad/s^2/sqrt(Hz). Default 0.0002.", &opt.gyro_walk, NULL},
    {"accel-bias", '\0', "B[,B,B]", "m/s^2, like --gyro-bias. Default 0.05.", &opt.accel_bias, NULL},
    {"accel-noise", '\0', "N", "m/s^2/sqrt(Hz). Default 0.004.", &opt.accel_noise, NULL},
    {"accel-walk", '\0', "N", "m/s^3/sqrt(Hz). Default 0.001.", &opt.accel_walk, NULL},
    {"imu-range", '\0', "DPS,G", "Ends of the range: deg/s and g. Default 2000,16.", &opt.imu_range, NULL},
    {"imu-offset-us", '\0', "US", "t_event = t_imu + offset. Default 0.", &opt.imu_offset, NULL},
    {"gz", '\0', NULL, "Write events.txt.gz instead of events.txt.", NULL, &opt.gz},
    {"jobs", 'j', "N", "Threads; the bytes do not depend on it.\nDefault: one per processor.", &opt.jobs, NULL},
    {"quiet", 'q', NULL, "No progress, no summary.", NULL, &opt.quiet},
};

static const evt_usage_t USAGE = {
    .command = "sim",
    .synopsis = "SCENE -o DIR [options]",
    .about = "Simulates an event camera, its frames and its IMU, and writes a recording in the folder form of the\n"
             "Event Camera Dataset with the exact truth: events.txt imu.txt groundtruth.txt velocity.txt calib.txt\n"
             "images.txt images/ meta.json. Method: ESIM (Rebecq et al., CoRL 2018). Same settings, same bytes.\n\n"
             "SCENE     room      box room with panels at several depths (motion: flap)\n"
             "          poster    one textured plane (handheld)\n"
             "          shapes    white room with a few dark shapes (handheld)\n"
             "          panorama  everything far away, pure rotation (rotate)",
    .examples = "  evstab sim room -o flight --duration 3\n"
                "  evstab sim poster -o poster --motion hover --size 640x480 --texture wall.jpg\n"
                "  evstab sim panorama -o turn --noise-hz 0 --k1 0 --k2 0 --imu-offset-us 2500",
    .options = OPTIONS,
    .n_options = sizeof OPTIONS / sizeof OPTIONS[0],
    .n_words_min = 1u,
    .n_words_max = 1u,
};

/* A plain decimal number, nothing before or after it. */
static bool parse_number(const char *text, size_t length, double *value)
{
    char copy[64];
    char *end = NULL;
    if ((length == 0u) || (length >= sizeof copy)) { return false; }
    for (size_t i = 0u; i < length; i++) { /* strtod would take "nan", "inf", " 1" and "0x1" too. */
        if ((strchr("+-.eE", text[i]) == NULL) && (isdigit((unsigned char)text[i]) == 0)) { return false; }
    }
    memcpy(copy, text, length);
    copy[length] = '\0';
    *value = strtod(copy, &end);
    return (*end == '\0') && isfinite(*value);
}

/* Up to @p cap numbers with commas between. @return how many, 0 if the text is anything else. */
static size_t parse_numbers(const char *text, double *value, size_t cap)
{
    for (size_t n = 0u; n < cap; n++) {
        const size_t length = strcspn(text, ",");
        if (!parse_number(text, length, &value[n])) { return 0u; }
        if (text[length] == '\0') { return n + 1u; }
        text += length + 1u;
    }
    return 0u;
}

/* The value of option NAME, if given, within [low, high]. */
static bool take(const char *name, const char *text, double low, double high, double *value)
{
    double number = 0.0;
    if (text == NULL) { return true; }
    if ((parse_numbers(text, &number, 1u) != 1u) || (number < low) || (number > high)) {
        (void)evt_usage_error(&USAGE, "--%s is '%s'; expected a number from %g to %g", name, text, low, high);
        return false;
    }
    *value = number;
    return true;
}

static bool take_int(const char *name, const char *text, int64_t low, int64_t high, int64_t *value)
{
    if ((text == NULL) || evt_parse_int(text, low, high, value)) { return true; }
    (void)evt_usage_error(&USAGE, "--%s is '%s'; expected a whole number from %" PRId64 " to %" PRId64, name, text, low,
                          high);
    return false;
}

static bool take_choice(const char *what, const char *text, const char *const *names, unsigned n, unsigned *choice)
{
    char list[128] = "";
    if (text == NULL) { return true; }
    for (*choice = 0u; *choice < n; (*choice)++) {
        if (strcmp(text, names[*choice]) == 0) { return true; }
        (void)snprintf(list + strlen(list), sizeof list - strlen(list), "%s%s", (*choice > 0u) ? ", " : "",
                       names[*choice]);
    }
    (void)evt_usage_error(&USAGE, "unknown %s '%s'; there are %s", what, text, list);
    return false;
}

/* x,y,z or one length, whose direction the seed gives. */
static bool take_bias(const char *name, const char *text, double limit, uint64_t seed, unsigned index, double bias[3])
{
    double number[NUMBERS_MAX];
    const size_t n = (text != NULL) ? parse_numbers(text, number, NUMBERS_MAX) : 0u;
    bool ok = (n == 1u) || (n == 3u);
    for (size_t i = 0u; i < n; i++) { ok = ok && (fabs(number[i]) <= limit); }
    if (text == NULL) { return true; }
    if (!ok) {
        (void)evt_usage_error(&USAGE, "--%s is '%s'; expected x,y,z or one length, up to %g", name, text, limit);
        return false;
    }
    if (n == 1u) {
        evsim_random_direction(number[0], seed, index, bias);
    } else {
        memcpy(bias, number, sizeof number);
    }
    return true;
}

static bool take_camera(evsim_settings_t *s, evh_error_t *err, int *status)
{
    evh_calib_t *const c = &s->calib;
    uint16_t width_px = s->calib.width_px;
    uint16_t height_px = s->calib.height_px;
    if ((opt.size != NULL) && !evt_parse_size(opt.size, &width_px, &height_px)) {
        (void)evt_usage_error(&USAGE, "--size is '%s'; expected WIDTHxHEIGHT, such as 240x180, up to 2048x2048",
                              opt.size);
        return false;
    }
    evsim_default_calib(c, width_px, height_px);
    if (opt.calib != NULL) {
        if (!evh_calib_text_read(c, opt.calib, err)) {
            *status = EVT_EXIT_FAILED;
            return false;
        }
        c->width_px = width_px;
        c->height_px = height_px;
    }
    if (!take("fx", opt.fx, 1.0, 16383.0, &c->fx_px)) { return false; }
    if (opt.fx != NULL) { c->fy_px = c->fx_px; }
    return take("fy", opt.fy, 1.0, 16383.0, &c->fy_px) && take("cx", opt.cx, -8191.0, 8191.0, &c->cx_px) &&
           take("cy", opt.cy, -8191.0, 8191.0, &c->cy_px) && take("k1", opt.k1, -100.0, 100.0, &c->dist[0]) &&
           take("k2", opt.k2, -100.0, 100.0, &c->dist[1]) && take("p1", opt.p1, -100.0, 100.0, &c->dist[2]) &&
           take("p2", opt.p2, -100.0, 100.0, &c->dist[3]) && take("k3", opt.k3, -100.0, 100.0, &c->dist[4]);
}

static bool take_frames(evsim_settings_t *s)
{
    double exposure_s = (double)s->exposure_us * 1e-6;
    if (!take("fps", opt.fps, 0.01, 10000.0, &s->fps_hz)) { return false; }
    if ((opt.exposure == NULL) && (exposure_s > 0.5 / s->fps_hz)) { exposure_s = 0.5 / s->fps_hz; }
    if (!take("exposure", opt.exposure, 1e-5, 100.0, &exposure_s)) { return false; }
    s->exposure_us = (int64_t)(exposure_s * 1e6 + 0.5);
    if ((double)s->exposure_us > 1e6 / s->fps_hz) {
        (void)evt_usage_error(&USAGE, "--exposure is '%s', longer than a frame's %g s; lower --fps or --exposure",
                              opt.exposure, 1.0 / s->fps_hz);
        return false;
    }
    s->frames = !opt.no_frames;
    return true;
}

static bool take_pixels(evsim_settings_t *s)
{
    const double n_pixels = (double)s->calib.width_px * (double)s->calib.height_px;
    double number[NUMBERS_MAX];
    size_t n;
    if (opt.contrast != NULL) {
        n = parse_numbers(opt.contrast, number, 2u);
        if ((n == 0u) || !(number[0] >= 0.01) || !(number[n - 1u] >= 0.01) || !(number[0] <= 5.0) ||
            !(number[n - 1u] <= 5.0)) {
            (void)evt_usage_error(&USAGE, "--contrast is '%s'; expected one number or ON,OFF, from 0.01 to 5",
                                  opt.contrast);
            return false;
        }
        s->contrast_on = number[0];
        s->contrast_off = number[n - 1u];
    }
    if (opt.hot != NULL) {
        n = parse_numbers(opt.hot, number, 2u);
        if ((n != 2u) || !(number[0] >= 0.0) || !(number[0] <= n_pixels) || (number[0] != floor(number[0])) ||
            !(number[1] >= 0.0) || !(number[1] <= 1e5)) {
            (void)evt_usage_error(&USAGE,
                                  "--hot is '%s'; expected how many (of %g pixels) and their rate in Hz, such as 5,200",
                                  opt.hot, n_pixels);
            return false;
        }
        s->n_hot = (uint32_t)number[0];
        s->hot_hz = number[1];
    }
    return take("contrast-sigma", opt.contrast_sigma, 0.0, 1.0, &s->contrast_sigma) &&
           take_int("refractory-us", opt.refractory, 0, 10000000, &s->refractory_us) &&
           take("noise-hz", opt.noise, 0.0, 10000.0, &s->noise_hz);
}

static bool take_imu(evsim_settings_t *s)
{
    evsim_imu_settings_t *const imu = &s->imu;
    evsim_random_direction(0.01, s->seed, 0u, imu->gyro_bias_rad_s);
    evsim_random_direction(0.05, s->seed, 1u, imu->accel_bias_m_s2);
    if (opt.imu_range != NULL) {
        double number[NUMBERS_MAX];
        if ((parse_numbers(opt.imu_range, number, 2u) != 2u) || !(number[0] > 0.0) || !(number[1] > 0.0) ||
            !(number[0] <= 1e5) || !(number[1] <= 1e4)) {
            (void)evt_usage_error(&USAGE, "--imu-range is '%s'; expected deg/s and g, such as 2000,16", opt.imu_range);
            return false;
        }
        imu->gyro_range_rad_s = number[0] * DEG;
        imu->accel_range_m_s2 = number[1] * G_M_S2;
    }
    return take("imu-rate", opt.imu_rate, 1.0, 100000.0, &imu->rate_hz) &&
           take_bias("gyro-bias", opt.gyro_bias, 10.0, s->seed, 0u, imu->gyro_bias_rad_s) &&
           take_bias("accel-bias", opt.accel_bias, 100.0, s->seed, 1u, imu->accel_bias_m_s2) &&
           take("gyro-noise", opt.gyro_noise, 0.0, 10.0, &imu->gyro_noise) &&
           take("accel-noise", opt.accel_noise, 0.0, 100.0, &imu->accel_noise) &&
           take("gyro-walk", opt.gyro_walk, 0.0, 10.0, &imu->gyro_walk) &&
           take("accel-walk", opt.accel_walk, 0.0, 100.0, &imu->accel_walk) &&
           take_int("imu-offset-us", opt.imu_offset, -10000000, 10000000, &imu->offset_us);
}

/* "a.png,b.jpg": cut in place, in a copy that lives as long as the program. */
static bool take_textures(evsim_settings_t *s, evh_error_t *err, int *status)
{
    char *names;
    if (opt.texture == NULL) { return true; }
    names = strdup(opt.texture);
    if (names == NULL) {
        *status = EVT_EXIT_FAILED;
        return evh_fail(err, "out of memory");
    }
    for (char *p = strtok(names, ","); p != NULL; p = strtok(NULL, ",")) {
        if (s->n_textures == EVSIM_TEXTURES_MAX) {
            (void)evt_usage_error(&USAGE, "--texture names more than %u files", EVSIM_TEXTURES_MAX);
            return false;
        }
        s->texture[s->n_textures++] = p;
    }
    if (s->n_textures == 0u) {
        (void)evt_usage_error(&USAGE, "--texture is '%s'; expected FILE or FILE,FILE,...", opt.texture);
        return false;
    }
    return true;
}

static bool take_all(evsim_settings_t *s, const char *scene_name, evh_error_t *err, int *status)
{
    const long processors = sysconf(_SC_NPROCESSORS_ONLN);
    unsigned scene = EVSIM_SCENE_ROOM;
    unsigned motion;
    double duration_s = 3.0;
    int64_t seed = 1;
    int64_t jobs = (processors > 0) ? processors : 1;
    if (jobs > EVSIM_THREADS_MAX) { jobs = EVSIM_THREADS_MAX; }
    if (!take_choice("scene", scene_name, evsim_scene_names, EVSIM_SCENES, &scene)) { return false; }
    evsim_settings_default(s, (evsim_scene_kind_t)scene);
    motion = s->motion;
    if (!take_choice("motion", opt.motion, evsim_motion_names, EVSIM_MOTIONS, &motion) ||
        !take("duration", opt.duration, 0.001, DURATION_MAX_S, &duration_s) ||
        !take_int("seed", opt.seed, 0, INT64_MAX, &seed) || !take_int("jobs", opt.jobs, 1, EVSIM_THREADS_MAX, &jobs)) {
        return false;
    }
    s->motion = (evsim_motion_kind_t)motion;
    s->duration_us = (int64_t)(duration_s * 1e6 + 0.5);
    s->seed = (uint64_t)seed;
    s->jobs = (unsigned)jobs;
    s->gz = opt.gz;
    if (opt.output == NULL) {
        (void)evt_usage_error(&USAGE, "-o DIR is missing: where to write");
        return false;
    }
    return take_camera(s, err, status) && take_frames(s) && take_pixels(s) && take_imu(s) &&
           take_textures(s, err, status);
}

static void show_progress(void *context, double fraction, uint64_t n_events)
{
    evt_progress_update(context, fraction, n_events, "events");
}

static void print_summary(const evsim_settings_t *s, const evsim_result_t *r, double wall_s)
{
    const double duration_s = (double)s->duration_us * 1e-6;
    (void)printf("%s: %s, %s, %g s at %ux%u, seed %" PRIu64 "\n", opt.output, evsim_scene_names[s->scene],
                 evsim_motion_names[s->motion], duration_s, (unsigned)s->calib.width_px, (unsigned)s->calib.height_px,
                 s->seed);
    (void)printf("  %" PRIu64 " events, %.2f M/s, %.0f %% brighter; %" PRIu64 " frames\n", r->n_events,
                 (double)r->n_events / duration_s * 1e-6,
                 (r->n_events > 0u) ? 100.0 * (double)r->n_on / (double)r->n_events : 0.0, r->n_frames);
    (void)printf("  speed %.2f m/s on average; rotation %.2f, at most %.2f rad/s; image motion up to %.0f px/s\n",
                 r->velocity_mean_m_s, r->rate_mean_rad_s, r->rate_max_rad_s, r->speed_max_px_s);
    (void)printf("  %" PRIu64 " renders; %.2f s on %u thread%s: real-time factor %.2f\n", r->n_renders, wall_s, r->jobs,
                 (r->jobs == 1u) ? "" : "s", duration_s / wall_s);
}

int evt_sim_main(int argc, char **argv)
{
    const char *words[1];
    evsim_settings_t settings;
    evsim_result_t result;
    evt_progress_t progress;
    evh_error_t err = {""};
    int status = EVT_EXIT_OK;
    int64_t start_ns;
    bool ok;

    if (!evt_options_parse(&USAGE, argc, argv, words, &status)) { return status; }
    evh_set_quiet(opt.quiet);
    status = EVT_EXIT_USAGE;
    if (!take_all(&settings, words[0], &err, &status)) {
        if (status == EVT_EXIT_FAILED) { (void)fprintf(stderr, "evstab sim: %s\n", err.text); }
        return status;
    }
    start_ns = evt_now_ns();
    evt_progress_start(&progress);
    ok = evsim_run(&settings, opt.output, show_progress, &progress, &result, &err);
    evt_progress_end(&progress);
    if (!ok) {
        (void)fprintf(stderr, "evstab sim: %s\n", err.text);
        return EVT_EXIT_FAILED;
    }
    if (!opt.quiet) { print_summary(&settings, &result, (double)(evt_now_ns() - start_ns) * 1e-9); }
    return EVT_EXIT_OK;
}
