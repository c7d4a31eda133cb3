/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "decimal.h"
#include "eval.h"
#include "evs/version.h"
#include "json.h"
#include "recording.h"

static const char *const ALIGN_NAMES[] = {
    [EVL_ALIGN_NONE] = "none", [EVL_ALIGN_HEADING] = "heading", [EVL_ALIGN_WORLD] = "world", [EVL_ALIGN_FULL] = "full"};

const char *evt_align_name(evl_align_kind_t kind) { return ALIGN_NAMES[kind]; }

static const char *seconds(char text[32], int64_t t_us)
{
    text[evh_decimal_format(text, t_us, 6u)] = '\0';
    text[strlen(text) - 3u] = '\0'; /* Milliseconds do for reading. */
    return text;
}

/* --- the table ---------------------------------------------------------------------------------------------------- */

static void print_rotation(FILE *out, const char *what, evl_quat_t q)
{
    const evl_vec3_t r = evl_quat_log(q);
    (void)fprintf(out, "  %s: %.3f deg (rotation vector %.3f %.3f %.3f deg)\n", what,
                  EVL_DEG_PER_RAD * evl_quat_angle(q), EVL_DEG_PER_RAD * r.x, EVL_DEG_PER_RAD * r.y,
                  EVL_DEG_PER_RAD * r.z);
}

static void print_align(FILE *out, const evl_align_t *a)
{
    char from[32];
    char to[32];
    const char *const why = a->at_rest ? "the last second before the truth starts to turn" : "its first second";
    (void)seconds(from, a->from_us);
    (void)seconds(to, a->to_us);
    switch (a->kind) {
    case EVL_ALIGN_NONE:
        (void)fprintf(out, "aligned: nothing\n");
        break;
    case EVL_ALIGN_HEADING:
        (void)fprintf(out, "aligned: one heading, %.3f deg, the mean over %s .. %s s (%s)\n",
                      EVL_DEG_PER_RAD * evl_quat_log(a->left).z, from, to, why);
        break;
    case EVL_ALIGN_WORLD:
        (void)fprintf(out, "aligned: the worlds, by the mean over %s .. %s s (%s)\n", from, to, why);
        print_rotation(out, "estimate's world from truth's", a->left);
        break;
    case EVL_ALIGN_FULL:
        (void)fprintf(out, "aligned: worlds and mounting, least squares over all samples; slow drift hides in it\n");
        print_rotation(out, "estimate's world from truth's", a->left);
        print_rotation(out, "truth's body from camera", a->right);
        break;
    }
}

static void print_error(FILE *out, const char *name, const evl_stats_t *s)
{
    if (s->n == 0u) {
        (void)fprintf(out, "  %-14s %9s %9s %9s %9s\n", name, "-", "-", "-", "-");
    } else {
        (void)fprintf(out, "  %-14s %9.3f %9.3f %9.3f %9.3f\n", name, s->rmse, s->median, s->p95, s->max);
    }
}

static void print_attitude(FILE *out, const evt_eval_t *e, const evt_eval_result_t *x)
{
    const evl_attitude_result_t *const a = &x->attitude;
    char from[32];
    char to[32];
    (void)fprintf(out, "attitude (%s) against %s: %zu samples in %s .. %s s", x->attitude_source,
                  evh_path_name(e->truth), a->total_deg.n, seconds(from, a->t_first_us), seconds(to, a->t_last_us));
    if (a->n_no_truth > 0u) { (void)fprintf(out, "; %zu more have no truth", a->n_no_truth); }
    (void)fprintf(out, "\n");
    print_align(out, &a->align);
    (void)fprintf(out, "  %-14s %9s %9s %9s %9s\n", "error, deg", "RMSE", "median", "95 %", "max");
    print_error(out, "total", &a->total_deg);
    print_error(out, "inclination", &a->inclination_deg);
    print_error(out, "heading", &a->heading_deg);
    print_error(out, "over 0.1 s", &a->over_100ms_deg);
    print_error(out, "over 1 s", &a->over_1s_deg);
}

static double percent(size_t part, size_t whole) { return 100.0 * (double)part / (double)whole; }

static void print_angles(FILE *out, const char *name, const evl_stats_t *s)
{
    (void)fprintf(out, "  %-14s %9.3f %9.3f %9.3f %9.3f\n", name, s->mean, s->median, s->p95, s->max);
}

static void print_velocity(FILE *out, const evt_eval_t *e, const evt_eval_result_t *x)
{
    const evl_velocity_result_t *const v = &x->velocity;
    const bool table = (e->velocity_truth != NULL);
    (void)fprintf(out, "velocity direction against %s", evh_path_name(table ? e->velocity_truth : e->truth));
    if (!table) { (void)fprintf(out, ", fits over %.0f ms", 1e-3 * (double)e->baseline_us); }
    (void)fprintf(out,
                  ": %zu samples\n  left out: %zu slower than %.2f of the mean %.3f m/s, %zu without truth, %" PRIu64
                  " without an estimate\n",
                  v->error_deg.n, v->n_slow, EVL_SLOW_SHARE, v->mean_speed_m_s, v->n_no_truth,
                  x->n_no_estimate + v->n_zero);
    (void)fprintf(out, "  %-14s %9s %9s %9s %9s\n", "error, deg", "mean", "median", "95 %", "max");
    print_angles(out, "at its time", &v->error_deg);
    if (v->interval_error_deg.n > 0u) { print_angles(out, "over interval", &v->interval_error_deg); }
    if (isfinite(x->coverage)) {
        (void)fprintf(out, "  an estimate of the last %.1f s was at hand for %.1f %% of the time\n",
                      1e-6 * EVL_COVER_US, 100.0 * x->coverage);
    }
    if (v->n_sigma > 0u) {
        (void)fprintf(out, "  within 1 sigma of their own: %.1f %% (63 if Gaussian), within 2: %.1f %% (98)\n",
                      percent(v->n_within_sigma, v->n_sigma), percent(v->n_within_2_sigma, v->n_sigma));
    }
}

static void print_gain(FILE *out, const char *name, const evl_gain_t *g)
{
    if (g->n == 0u) { return; }
    (void)fprintf(out, "  %-14s %9zu %9.4g %9.4g %9.3f %9.3f\n", name, g->n, g->unstabilized, g->stabilized, g->gain,
                  g->gain_median);
}

static void print_sharpness(FILE *out, const evt_eval_result_t *x)
{
    (void)fprintf(out, "sharpness (variance of the picture of events) of %" PRIu64 " events, mean over the pictures\n",
                  x->sharpness.n_events);
    (void)fprintf(out, "  %-14s %9s %9s %9s %9s %9s\n", "one picture per", "pictures", "without", "with", "gain",
                  "median");
    print_gain(out, "window", &x->per_window);
    print_gain(out, "0.1 s", &x->per_100ms);
}

void evt_eval_print(const evt_eval_t *e, const evt_eval_result_t *x, FILE *out)
{
    if (x->has_attitude) { print_attitude(out, e, x); }
    if (x->has_velocity) { print_velocity(out, e, x); }
    if (x->has_sharpness) { print_sharpness(out, x); }
}

/* --- eval.json ------------------------------------------------------------------------------------------------------
 */

static void add_stats(cJSON *to, const char *key, const evl_stats_t *s)
{
    cJSON *const o = cJSON_AddObjectToObject(to, key);
    evt_json_count(o, "n", s->n);
    if (s->n == 0u) { return; }
    evt_json_number(o, "rmse_deg", s->rmse);
    evt_json_number(o, "mean_deg", s->mean);
    evt_json_number(o, "median_deg", s->median);
    evt_json_number(o, "p95_deg", s->p95);
    evt_json_number(o, "max_deg", s->max);
}

static void add_quat(cJSON *to, const char *key, evl_quat_t q)
{
    const double part[4] = {q.w, q.x, q.y, q.z};
    evt_json_numbers(to, key, part, 4);
}

static void add_attitude(cJSON *root, const evt_eval_result_t *x)
{
    const evl_attitude_result_t *const a = &x->attitude;
    cJSON *const o = cJSON_AddObjectToObject(root, "attitude");
    cJSON *align;
    evt_json_text(o, "source", x->attitude_source);
    evt_json_count(o, "n", a->total_deg.n);
    evt_json_count(o, "n_no_truth", a->n_no_truth);
    evt_json_seconds(o, "t_first_s", a->t_first_us);
    evt_json_seconds(o, "t_last_s", a->t_last_us);
    align = cJSON_AddObjectToObject(o, "aligned");
    evt_json_text(align, "kind", evt_align_name(a->align.kind));
    evt_json_seconds(align, "from_s", a->align.from_us);
    evt_json_seconds(align, "to_s", a->align.to_us);
    (void)cJSON_AddBoolToObject(align, "at_rest", a->align.at_rest);
    add_quat(align, "q_estimate_world_from_truth_world_wxyz", a->align.left);
    add_quat(align, "q_truth_body_from_camera_wxyz", a->align.right);
    if (a->align.kind == EVL_ALIGN_HEADING) {
        evt_json_number(align, "heading_deg", EVL_DEG_PER_RAD * evl_quat_log(a->align.left).z);
    }
    if (a->align.kind == EVL_ALIGN_FULL) {
        evt_json_number(align, "spread_deg", EVL_DEG_PER_RAD * a->align.spread_rad);
        (void)cJSON_AddBoolToObject(align, "mounting_told",
                                    evl_align_is_told(&a->align, a->total_deg.rmse / EVL_DEG_PER_RAD));
    }
    add_stats(o, "total", &a->total_deg);
    add_stats(o, "inclination", &a->inclination_deg);
    add_stats(o, "heading", &a->heading_deg);
    add_stats(o, "over_100ms", &a->over_100ms_deg);
    add_stats(o, "over_1s", &a->over_1s_deg);
}

static void add_velocity(cJSON *root, const evt_eval_t *e, const evt_eval_result_t *x)
{
    const evl_velocity_result_t *const v = &x->velocity;
    cJSON *const o = cJSON_AddObjectToObject(root, "velocity");
    evt_json_text(o, "truth", (e->velocity_truth != NULL) ? "velocities" : "poses");
    if (e->velocity_truth == NULL) { evt_json_seconds(o, "baseline_s", e->baseline_us); }
    evt_json_number(o, "slow_below_share_of_mean", EVL_SLOW_SHARE);
    evt_json_number(o, "mean_speed_m_s", v->mean_speed_m_s);
    evt_json_count(o, "n_slow", v->n_slow);
    evt_json_count(o, "n_no_truth", v->n_no_truth);
    evt_json_count(o, "n_no_estimate", x->n_no_estimate + v->n_zero);
    add_stats(o, "direction", &v->error_deg);
    if (v->interval_error_deg.n > 0u) { add_stats(o, "direction_over_interval", &v->interval_error_deg); }
    evt_json_number(o, "covered_share", x->coverage);
    evt_json_seconds(o, "covered_for_s", EVL_COVER_US);
    if (v->n_sigma > 0u) {
        evt_json_count(o, "n_sigma", v->n_sigma);
        evt_json_number(o, "within_sigma_share", (double)v->n_within_sigma / (double)v->n_sigma);
        evt_json_number(o, "within_2_sigma_share", (double)v->n_within_2_sigma / (double)v->n_sigma);
    }
}

static void add_pictures(cJSON *to, const char *key, const evl_pictures_t *pictures, const evl_gain_t *gain)
{
    cJSON *const o = cJSON_AddObjectToObject(to, key);
    cJSON *list;
    evt_json_count(o, "n", gain->n);
    evt_json_number(o, "unstabilized_mean", gain->unstabilized);
    evt_json_number(o, "stabilized_mean", gain->stabilized);
    evt_json_number(o, "gain", gain->gain);
    evt_json_number(o, "gain_median", gain->gain_median);
    evt_json_text(o, "columns", "window,t_first_s,n_events,unstabilized,stabilized");
    list = cJSON_AddArrayToObject(o, "pictures");
    for (size_t i = 0u; i < pictures->n; i++) {
        const evl_picture_t *const p = &pictures->at[i];
        char t[32];
        char row[128];
        t[evh_decimal_format(t, p->t_first_us, 6u)] = '\0';
        (void)snprintf(row, sizeof row, "[%" PRIu32 ", %s, %" PRIu64 ", %.7g, %.7g]", p->window, t, p->n_events,
                       p->unstabilized, p->stabilized);
        (void)cJSON_AddItemToArray(list, cJSON_CreateRaw(row));
    }
}

bool evt_eval_write_json(const evt_eval_t *e, const evt_eval_result_t *x, const char *path, evh_error_t *err)
{
    cJSON *const root = cJSON_CreateObject();
    evt_json_text(root, "program", "evstab eval");
    evt_json_text(root, "library_version", EVS_VERSION_STRING);
    evt_json_text(root, "run", e->run);
    evt_json_text(root, "truth", e->truth);
    evt_json_text(root, "velocity_truth", e->velocity_truth);
    evt_json_seconds(root, "poses_offset_s", e->poses_offset_us);
    if (x->has_attitude) { add_attitude(root, x); }
    if (x->has_velocity) { add_velocity(root, e, x); }
    if (x->has_sharpness) {
        cJSON *const o = cJSON_AddObjectToObject(root, "sharpness");
        evt_json_count(o, "n_events", x->sharpness.n_events);
        add_pictures(o, "per_window", &x->sharpness.per_window, &x->per_window);
        add_pictures(o, "per_100ms", &x->sharpness.per_100ms, &x->per_100ms);
    }
    return evt_json_write(root, path, err);
}
