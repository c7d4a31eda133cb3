/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "config_yaml.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <yaml.h>

#include "decimal.h"

#define FILE_MAX_BYTES (1u << 20)
#define DEPTH_MAX      16
#define UNUSED_MAX     400u
#define VISITS_MAX     20000 /* Aliases let a short file describe an endless one. */

typedef struct {
    yaml_document_t *doc;
    const char *name;
    evh_config_t *config;
    evh_error_t *err;
    bool external_off; /* use_external_extrinsic_rotation: false */
    bool is_imu_file;  /* sensor_type: imu, whose T_BS is not the camera's. */
    double k[9];
    size_t n_k; /* 9: row-major K; 4: fx fy cx cy. */
    double dist[8];
    size_t n_dist;
    bool has_t_bs;
    double t_bs[16];
    int n_visits;
    char unused[UNUSED_MAX];
} parser_t;

static const char *scalar(const yaml_node_t *node)
{
    return (node->type == YAML_SCALAR_NODE) ? (const char *)node->data.scalar.value : NULL;
}

static bool is_too_much(parser_t *p)
{
    if (++p->n_visits <= VISITS_MAX) { return false; }
    (void)evh_fail(p->err, "%s: more than %d values; is this a parameter file?", p->name, VISITS_MAX);
    return true;
}

static unsigned long line_of(const yaml_node_t *node) { return (unsigned long)node->start_mark.line + 1uL; }

static bool bad(parser_t *p, const yaml_node_t *node, const char *key, const char *want)
{
    const char *const value = scalar(node);
    return evh_fail(p->err, "%s: line %lu: %s is '%s'; expected %s", p->name, line_of(node), key,
                    (value != NULL) ? value : "(a list)", want);
}

static bool take_bool(parser_t *p, const yaml_node_t *node, const char *key, bool *out)
{
    static const char *const YES[] = {"true", "True", "TRUE", "yes", "on", "1"};
    static const char *const NO[] = {"false", "False", "FALSE", "no", "off", "0"};
    const char *const text = scalar(node);
    for (size_t i = 0u; (text != NULL) && (i < sizeof YES / sizeof YES[0]); i++) {
        if ((strcmp(text, YES[i]) == 0) || (strcmp(text, NO[i]) == 0)) {
            *out = (strcmp(text, YES[i]) == 0);
            return true;
        }
    }
    return bad(p, node, key, "True or False");
}

static bool take_int(parser_t *p, const yaml_node_t *node, const char *key, int decimals, int64_t low, int64_t high,
                     int64_t *out)
{
    const char *text = scalar(node);
    char want[64];
    if (text != NULL) {
        const char *const end = text + strlen(text);
        if (evh_decimal_parse(&text, end, decimals, out, NULL) && (text == end) && (*out >= low) && (*out <= high)) {
            return true;
        }
    }
    (void)snprintf(want, sizeof want, "a number of %lld .. %lld%s", (long long)low, (long long)high,
                   (decimals == 6) ? " us, written in seconds" : "");
    return bad(p, node, key, want);
}

/* Numbers of a list, of a list of lists, or of an OpenCV matrix {rows, cols, data: [...]}. */
static bool take_numbers(parser_t *p, const yaml_node_t *node, const char *key, int depth, double *out, size_t cap,
                         size_t *n)
{
    if ((node == NULL) || (depth > DEPTH_MAX)) { return true; }
    if (is_too_much(p)) { return false; }
    if (node->type == YAML_SCALAR_NODE) {
        const char *const text = scalar(node);
        char *stop = NULL;
        double value;
        value = strtod(text, &stop);
        if ((stop == text) || (*stop != '\0') || !isfinite(value)) { return bad(p, node, key, "numbers"); }
        if (*n == cap) {
            return evh_fail(p->err, "%s: line %lu: %s has more than %zu numbers", p->name, line_of(node), key, cap);
        }
        out[(*n)++] = value;
        return true;
    }
    if (node->type == YAML_SEQUENCE_NODE) {
        for (const yaml_node_item_t *i = node->data.sequence.items.start; i < node->data.sequence.items.top; i++) {
            if (!take_numbers(p, yaml_document_get_node(p->doc, *i), key, depth + 1, out, cap, n)) { return false; }
        }
        return true;
    }
    for (const yaml_node_pair_t *i = node->data.mapping.pairs.start; i < node->data.mapping.pairs.top; i++) {
        const yaml_node_t *const name = yaml_document_get_node(p->doc, i->key);
        if ((name != NULL) && (scalar(name) != NULL) && (strcmp(scalar(name), "data") == 0)) {
            return take_numbers(p, yaml_document_get_node(p->doc, i->value), key, depth + 1, out, cap, n);
        }
    }
    return bad(p, node, key, "numbers");
}

/* A list of which one of the allowed lengths is expected. */
static bool take_list(parser_t *p, const yaml_node_t *node, const char *key, size_t least, double *out, size_t cap,
                      size_t *n)
{
    *n = 0u;
    if (!take_numbers(p, node, key, 0, out, cap, n)) { return false; }
    if (*n < least) {
        return evh_fail(p->err, "%s: line %lu: %s has %zu numbers; expected %zu or more", p->name, line_of(node), key,
                        *n, least);
    }
    return true;
}

static bool set_q_external(parser_t *p, const yaml_node_t *node)
{
    double q[4];
    double norm;
    size_t n = 0u;
    if (!take_list(p, node, "q_external", 4u, q, 4u, &n)) { return false; }
    norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(fabs(norm - 1.0) < 0.05)) {
        return evh_fail(p->err, "%s: line %lu: q_external has length %g; expected a unit quaternion [qx, qy, qz, qw]",
                        p->name, line_of(node), norm);
    }
    for (int i = 0; i < 4; i++) { p->config->q_ci_wxyz[i] = q[(i + 3) % 4] / norm; } /* xyzw to wxyz */
    p->config->has_q_ci = true;
    return true;
}

static bool set_gyro_bias(parser_t *p, const yaml_node_t *node)
{
    double *const bias = p->config->gyro_bias_rad_s;
    size_t n = 0u;
    if (!take_list(p, node, "gyro_bias", 3u, bias, 3u, &n)) { return false; }
    for (size_t i = 0u; i < n; i++) {
        if (!(fabs(bias[i]) <= EVH_GYRO_BIAS_MAX_RAD_S)) {
            return evh_fail(p->err, "%s: line %lu: gyro_bias has %g; expected rad/s within %g", p->name, line_of(node),
                            bias[i], EVH_GYRO_BIAS_MAX_RAD_S);
        }
    }
    p->config->has_gyro_bias = true;
    return true;
}

/* One of the words, which are listed as the message shall list them: "iwe, surface, count". */
static bool set_word(parser_t *p, const yaml_node_t *node, const char *key, const char *words,
                     char out[EVH_CONFIG_WORD_MAX])
{
    const char *const text = scalar(node);
    const size_t n = (text != NULL) ? strlen(text) : 0u;
    for (const char *word = words; n > 0u; word += 2) {
        const size_t length = strcspn(word, ",");
        if ((length == n) && (n < EVH_CONFIG_WORD_MAX) && (memcmp(word, text, n) == 0)) {
            memcpy(out, text, n + 1u);
            return true;
        }
        word += length;
        if (*word == '\0') { break; }
    }
    return bad(p, node, key, words);
}

static bool set_window_kind(parser_t *p, const yaml_node_t *node)
{
    const char *const text = scalar(node);
    if ((text != NULL) && (strcmp(text, "area") == 0)) {
        p->config->window_kind = EVH_WINDOW_AREA;
    } else if ((text != NULL) && (strcmp(text, "number_of_events") == 0)) {
        p->config->window_kind = EVH_WINDOW_COUNT;
    } else if ((text != NULL) && (strcmp(text, "time") == 0)) {
        p->config->window_kind = EVH_WINDOW_TIME;
    } else {
        return bad(p, node, "accumulation_type", "area, number_of_events or time");
    }
    return true;
}

static bool set_model(parser_t *p, const yaml_node_t *node, const char *key)
{
    static const char *const BROWN[] = {"radial-tangential", "radtan", "plumb_bob", "none"};
    static const char *const FISHEYE[] = {"equidistant", "fisheye"};
    const char *const text = scalar(node);
    for (size_t i = 0u; (text != NULL) && (i < sizeof BROWN / sizeof BROWN[0]); i++) {
        if (strcmp(text, BROWN[i]) == 0) { return true; }
    }
    for (size_t i = 0u; (text != NULL) && (i < sizeof FISHEYE / sizeof FISHEYE[0]); i++) {
        if (strcmp(text, FISHEYE[i]) == 0) {
            p->config->calib.fisheye = true;
            return true;
        }
    }
    return bad(p, node, key, "radtan, plumb_bob or equidistant");
}

static bool set_size(parser_t *p, const yaml_node_t *node, const char *key, uint16_t *out)
{
    int64_t value = 0;
    if (!take_int(p, node, key, 0, 1, 2048, &value)) { return false; }
    *out = (uint16_t)value;
    return true;
}

static bool set_resolution(parser_t *p, const yaml_node_t *node)
{
    double size[2];
    size_t n = 0u;
    if (!take_list(p, node, "resolution", 2u, size, 2u, &n)) { return false; }
    if (!(size[0] >= 1.0) || !(size[1] >= 1.0) || !(size[0] <= 2048.0) || !(size[1] <= 2048.0)) {
        return evh_fail(p->err, "%s: line %lu: resolution %g x %g; expected 1 .. 2048", p->name, line_of(node), size[0],
                        size[1]);
    }
    p->config->calib.width_px = (uint16_t)size[0];
    p->config->calib.height_px = (uint16_t)size[1];
    return true;
}

/* Keys that describe things this program has no use for, and whose absence from the result surprises nobody. */
static bool is_descriptive(const char *key)
{
    static const char *const KEYS[] = {"sensor_type",
                                       "comment",
                                       "rate_hz",
                                       "camera_model",
                                       "cols",
                                       "rows",
                                       "data",
                                       "dt",
                                       "camera_name",
                                       "header",
                                       "rectification_matrix",
                                       "projection_matrix"};
    for (size_t i = 0u; i < sizeof KEYS / sizeof KEYS[0]; i++) {
        if (strcmp(key, KEYS[i]) == 0) { return true; }
    }
    return false;
}

static void add_unused(parser_t *p, const char *key)
{
    const size_t at = strlen(p->unused);
    if (at + strlen(key) + 3u < UNUSED_MAX) {
        (void)snprintf(p->unused + at, UNUSED_MAX - at, "%s%s", (at > 0u) ? ", " : "", key);
    }
}

/* @return true with *known false for a key that is none of ours. */
static bool take_key(parser_t *p, const char *key, const yaml_node_t *value, bool *known)
{
    evh_config_t *const c = p->config;
    bool flag = false;
    *known = true;
    if ((strcmp(key, "K") == 0) || (strcmp(key, "camera_matrix") == 0)) {
        return take_list(p, value, key, 9u, p->k, 9u, &p->n_k);
    }
    if (strcmp(key, "intrinsics") == 0) { return take_list(p, value, key, 4u, p->k, 4u, &p->n_k); }
    if ((strcmp(key, "D") == 0) || (strcmp(key, "distortion_coefficients") == 0) ||
        (strcmp(key, "distortion_coeffs") == 0)) {
        return take_list(p, value, key, 0u, p->dist, 8u, &p->n_dist);
    }
    if (strcmp(key, "distortion_model") == 0) { return set_model(p, value, key); }
    if (strcmp(key, "fisheye_distortion") == 0) { return take_bool(p, value, key, &c->calib.fisheye); }
    if (strcmp(key, "image_width") == 0) { return set_size(p, value, key, &c->calib.width_px); }
    if (strcmp(key, "image_height") == 0) { return set_size(p, value, key, &c->calib.height_px); }
    if (strcmp(key, "resolution") == 0) { return set_resolution(p, value); }
    if (strcmp(key, "T_BS") == 0) {
        size_t n = 0u;
        p->has_t_bs = true;
        return take_list(p, value, key, 16u, p->t_bs, 16u, &n);
    }
    if (strcmp(key, "q_external") == 0) { return set_q_external(p, value); }
    if (strcmp(key, "gyro_bias") == 0) { return set_gyro_bias(p, value); }
    if (strcmp(key, "use_external_extrinsic_rotation") == 0) {
        if (!take_bool(p, value, key, &flag)) { return false; }
        p->external_off = !flag;
        return true;
    }
    if (strcmp(key, "get_orientation_from_imu") == 0) {
        c->has_from_imu = true;
        return take_bool(p, value, key, &c->from_imu);
    }
    if (strcmp(key, "enable_saccades") == 0) {
        c->has_saccades = true;
        return take_bool(p, value, key, &c->saccades);
    }
    if (strcmp(key, "image") == 0) { return set_word(p, value, key, "iwe, surface, count", c->image); }
    if (strcmp(key, "warp") == 0) { return set_word(p, value, key, "none, global, tiled, predicted", c->warp); }
    if (strcmp(key, "method") == 0) { return set_word(p, value, key, "erlv, erlv-paper, erl", c->method); }
    if (strcmp(key, "velocity") == 0) {
        c->has_velocity = true;
        return take_bool(p, value, key, &c->velocity);
    }
    if (strcmp(key, "accumulation_type") == 0) { return set_window_kind(p, value); }
    if (strcmp(key, "accumulation_time") == 0) {
        c->has_window_time = true;
        return take_int(p, value, key, 6, 1, 60000000, &c->window_time_us);
    }
    if (strcmp(key, "number_of_accumulated_events") == 0) {
        c->has_count = true;
        return take_int(p, value, key, 0, 1, 1000000000, &c->n_events);
    }
    if (strcmp(key, "roi_threshold") == 0) {
        c->has_roi_threshold = true;
        return take_int(p, value, key, 0, 1, 1000000, &c->roi_threshold);
    }
    if (strcmp(key, "number_of_columns") == 0) {
        c->has_columns = true;
        return take_int(p, value, key, 0, 1, 2048, &c->n_columns);
    }
    if (strcmp(key, "number_of_rows") == 0) {
        c->has_rows = true;
        return take_int(p, value, key, 0, 1, 2048, &c->n_rows);
    }
    if ((strcmp(key, "sensor_type") == 0) && (scalar(value) != NULL) && (strcmp(scalar(value), "imu") == 0)) {
        p->is_imu_file = true;
        return true;
    }
    *known = false;
    return true;
}

static bool walk(parser_t *p, const yaml_node_t *node, int depth)
{
    if ((node == NULL) || (depth > DEPTH_MAX)) { return true; }
    if (is_too_much(p)) { return false; }
    if (node->type == YAML_SEQUENCE_NODE) {
        for (const yaml_node_item_t *i = node->data.sequence.items.start; i < node->data.sequence.items.top; i++) {
            if (!walk(p, yaml_document_get_node(p->doc, *i), depth + 1)) { return false; }
        }
        return true;
    }
    if (node->type != YAML_MAPPING_NODE) { return true; }
    for (const yaml_node_pair_t *i = node->data.mapping.pairs.start; i < node->data.mapping.pairs.top; i++) {
        const yaml_node_t *const key = yaml_document_get_node(p->doc, i->key);
        const yaml_node_t *const value = yaml_document_get_node(p->doc, i->value);
        bool known = false;
        if ((key == NULL) || (value == NULL) || (scalar(key) == NULL)) { continue; }
        if (!take_key(p, scalar(key), value, &known)) { return false; }
        if (known) { continue; }
        if (value->type == YAML_MAPPING_NODE) {
            if (!walk(p, value, depth + 1)) { return false; }
        } else if (!is_descriptive(scalar(key))) {
            add_unused(p, scalar(key));
        }
    }
    return true;
}

static void set_intrinsics(parser_t *p)
{
    evh_calib_t *const c = &p->config->calib;
    if (p->n_k == 9u) { /* Row-major 3x3. */
        c->fx_px = p->k[0];
        c->cx_px = p->k[2];
        c->fy_px = p->k[4];
        c->cy_px = p->k[5];
    } else {
        c->fx_px = p->k[0];
        c->fy_px = p->k[1];
        c->cx_px = p->k[2];
        c->cy_px = p->k[3];
    }
    p->config->has_calib = true;
}

/* The rotation of a rigid transform as a quaternion wxyz. @return false when it is no rotation. */
static bool rotation_of(const double *t, double q[4])
{
    const double trace = t[0] + t[5] + t[10];
    double norm;
    int i;
    /* From the largest of the four components: no cancellation. */
    const double square[4] = {1.0 + trace, 1.0 + t[0] - t[5] - t[10], 1.0 - t[0] + t[5] - t[10],
                              1.0 - t[0] - t[5] + t[10]};
    const double off[3] = {t[9] - t[6], t[2] - t[8], t[4] - t[1]};
    const double sum[3] = {t[6] + t[9], t[2] + t[8], t[1] + t[4]}; /* yz, xz, xy */
    int largest = 0;
    for (i = 1; i < 4; i++) {
        if (square[i] > square[largest]) { largest = i; }
    }
    if (!(square[largest] > 0.1)) { return false; }
    switch (largest) {
    case 0:
        q[0] = square[0];
        q[1] = off[0];
        q[2] = off[1];
        q[3] = off[2];
        break;
    case 1:
        q[0] = off[0];
        q[1] = square[1];
        q[2] = sum[2];
        q[3] = sum[1];
        break;
    case 2:
        q[0] = off[1];
        q[1] = sum[2];
        q[2] = square[2];
        q[3] = sum[0];
        break;
    default:
        q[0] = off[2];
        q[1] = sum[1];
        q[2] = sum[0];
        q[3] = square[3];
        break;
    }
    norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (i = 0; i < 4; i++) { q[i] /= norm; }
    return isfinite(norm) && (fabs(norm * norm / (4.0 * square[largest]) - 1.0) < 0.05);
}

static bool set_from_t_bs(parser_t *p)
{
    double q[4]; /* Body (the IMU, in EuRoC files) from camera. */
    if (!rotation_of(p->t_bs, q)) { return evh_fail(p->err, "%s: T_BS holds no rotation", p->name); }
    p->config->q_ci_wxyz[0] = q[0];
    for (int i = 1; i < 4; i++) { p->config->q_ci_wxyz[i] = -q[i]; }
    p->config->has_q_ci = true;
    return true;
}

static bool finish(parser_t *p)
{
    evh_config_t *const c = p->config;
    if (p->external_off) { c->has_q_ci = false; }
    if (p->has_t_bs && !p->is_imu_file && !c->has_q_ci && !set_from_t_bs(p)) { return false; }
    for (size_t i = 0u; i < p->n_dist; i++) {
        const size_t cap = c->calib.fisheye ? 4u : 5u;
        if (i < cap) {
            c->calib.dist[i] = p->dist[i];
        } else if (fabs(p->dist[i]) > 0.0) {
            return evh_fail(p->err, "%s: distortion coefficient %zu is %g, but the model has %zu", p->name, i + 1u,
                            p->dist[i], cap);
        }
    }
    if (p->n_k > 0u) {
        set_intrinsics(p);
        if (!evh_calib_check(&c->calib, p->name, p->err)) { return false; }
    }
    if (p->unused[0] != '\0') { evh_note("%s: keys not used: %s", p->name, p->unused); }
    return true;
}

/* OpenCV and EuRoC files begin with "%YAML:1.0", which no YAML version allows: blank it out. */
static void drop_opencv_directive(const char **text, size_t *length)
{
    if ((*length > 6u) && (memcmp(*text, "%YAML:", 6u) == 0)) {
        const char *const stop = memchr(*text, '\n', *length);
        const size_t skip = (stop != NULL) ? (size_t)(stop - *text) : *length;
        *text += skip;
        *length -= skip;
    }
}

bool evh_config_parse(evh_config_t *config, const char *text, size_t length, const char *name, evh_error_t *err)
{
    yaml_parser_t yaml;
    yaml_document_t doc;
    parser_t p;
    bool ok;

    memset(config, 0, sizeof *config);
    memset(&p, 0, sizeof p);
    p.name = name;
    p.config = config;
    p.err = err;
    drop_opencv_directive(&text, &length);
    if (!yaml_parser_initialize(&yaml)) { return evh_fail(err, "%s: out of memory", name); }
    yaml_parser_set_input_string(&yaml, (const unsigned char *)text, length);
    if (!yaml_parser_load(&yaml, &doc)) {
        evh_fail(err, "%s: line %lu: not YAML (%s)", name, (unsigned long)yaml.problem_mark.line + 1uL,
                 (yaml.problem != NULL) ? yaml.problem : "out of memory");
        yaml_parser_delete(&yaml);
        return false;
    }
    p.doc = &doc;
    if (yaml_document_get_root_node(&doc) == NULL) {
        ok = evh_fail(err, "%s: the file is empty", name);
    } else if (yaml_document_get_root_node(&doc)->type != YAML_MAPPING_NODE) {
        ok = evh_fail(err, "%s: expected \"key: value\" lines", name);
    } else {
        ok = walk(&p, yaml_document_get_root_node(&doc), 0) && finish(&p);
    }
    yaml_document_delete(&doc);
    yaml_parser_delete(&yaml);
    return ok;
}

bool evh_config_read(evh_config_t *config, const char *path, evh_error_t *err)
{
    FILE *const file = fopen(path, "rb");
    char *text;
    size_t n;
    bool ok;
    if (file == NULL) { return evh_fail(err, "%s: %s; check the path", path, strerror(errno)); }
    text = malloc(FILE_MAX_BYTES + 1u);
    if (text == NULL) {
        (void)fclose(file);
        return evh_fail(err, "%s: out of memory", path);
    }
    errno = 0;
    n = fread(text, 1u, FILE_MAX_BYTES + 1u, file);
    if (ferror(file) != 0) {
        ok = evh_fail(err, "%s: %s", path,
                      (errno == EISDIR) ? "is a folder, but a file is needed here" : strerror(errno));
    } else if (n > FILE_MAX_BYTES) {
        ok = evh_fail(err, "%s: larger than %u bytes; is this a parameter file?", path, FILE_MAX_BYTES);
    } else {
        ok = evh_config_parse(config, text, n, path, err);
    }
    free(text);
    (void)fclose(file);
    return ok;
}
