/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "velocity_error.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define REQUIRED (EVH_BIT(EVH_Q_T) | EVH_BIT(EVH_Q_VX) | EVH_BIT(EVH_Q_VY) | EVH_BIT(EVH_Q_VZ))

static const evh_layout_t LAYOUT = {.column = {EVH_Q_T, EVH_Q_VX, EVH_Q_VY, EVH_Q_VZ}, .n_columns = 4u};

static bool add(evl_velocities_t *v, size_t *cap, const evh_row_t *row)
{
    if (v->n == *cap) {
        const size_t larger = (*cap == 0u) ? 1024u : 2u * *cap;
        evl_velocity_t *const grown = realloc(v->at, larger * sizeof *grown);
        if (grown == NULL) { return false; }
        v->at = grown;
        *cap = larger;
    }
    v->at[v->n].t_us = row->t_us;
    v->at[v->n].v.x = row->value[EVH_Q_VX];
    v->at[v->n].v.y = row->value[EVH_Q_VY];
    v->at[v->n].v.z = row->value[EVH_Q_VZ];
    v->at[v->n].sigma_deg = ((row->present & EVH_BIT(EVH_Q_SIGMA)) != 0u) ? row->value[EVH_Q_SIGMA] : (double)NAN;
    v->at[v->n].interval_us = 0;
    v->n++;
    return true;
}

bool evl_velocities_read(evl_velocities_t *v, const char *path, evh_error_t *err)
{
    evh_rows_t rows;
    evh_row_t row;
    size_t cap = 0u;
    bool ok = true;
    memset(v, 0, sizeof *v);
    if (!evh_rows_open(&rows, path, &LAYOUT, REQUIRED, err)) { return false; }
    /* Also past a long run of faulty rows: a start without motion has no estimate for as long as it lasts. */
    while (ok && evh_rows_next_any(&rows, &row, err)) {
        if ((row.fault == EVH_FAULT_NONE) && !add(v, &cap, &row)) {
            ok = evh_fail(err, "%s: out of memory after %zu rows", path, v->n);
        }
    }
    v->tally = rows.tally;
    evh_rows_close(&rows);
    if (err->text[0] != '\0') {
        evl_velocities_free(v);
        return false;
    }
    return true;
}

bool evl_velocities_read_intervals(evl_velocities_t *v, const char *path, evh_error_t *err)
{
    evh_rows_t rows;
    evh_row_t row;
    size_t i = 0u;
    if (!evh_rows_open(&rows, path, NULL, EVH_BIT(EVH_Q_T) | EVH_BIT(EVH_Q_SPAN), err)) { return false; }
    while ((i < v->n) && evh_rows_next_any(&rows, &row, err)) {
        while ((i < v->n) && (v->at[i].t_us < row.t_us)) { i++; }
        if ((i < v->n) && (row.fault == EVH_FAULT_NONE) && (v->at[i].t_us == row.t_us)) {
            v->at[i++].interval_us = llround(1e6 * row.value[EVH_Q_SPAN]);
        }
    }
    evh_rows_close(&rows);
    return err->text[0] == '\0';
}

void evl_velocities_free(evl_velocities_t *v)
{
    free(v->at);
    memset(v, 0, sizeof *v);
}

static bool table_at(const evl_velocities_t *table, int64_t t_us, evl_vec3_t *v)
{
    size_t low = 0u;
    size_t high = table->n;
    double s;
    if ((table->n == 0u) || (t_us < table->at[0].t_us) || (t_us > table->at[table->n - 1u].t_us)) { return false; }
    while (high - low > 1u) {
        const size_t middle = low + (high - low) / 2u;
        if (table->at[middle].t_us <= t_us) {
            low = middle;
        } else {
            high = middle;
        }
    }
    *v = table->at[low].v;
    if (table->at[low].t_us == t_us) { return true; }
    if (table->at[low + 1u].t_us - table->at[low].t_us > EVL_GAP_MAX_US) { return false; }
    s = (double)(t_us - table->at[low].t_us) / (double)(table->at[low + 1u].t_us - table->at[low].t_us);
    v->x += s * (table->at[low + 1u].v.x - v->x);
    v->y += s * (table->at[low + 1u].v.y - v->y);
    v->z += s * (table->at[low + 1u].v.z - v->z);
    return true;
}

/* Sums for the slope at s = 0 of the parabola that fits (s, p) best. */
typedef struct {
    double n, s1, s2, s3, s4;
    evl_vec3_t p0, p1, p2;
} fit_t;

static void fit_add(fit_t *f, double s, evl_vec3_t p)
{
    const double square = s * s;
    f->n += 1.0;
    f->s1 += s;
    f->s2 += square;
    f->s3 += square * s;
    f->s4 += square * square;
    f->p0.x += p.x;
    f->p0.y += p.y;
    f->p0.z += p.z;
    f->p1.x += s * p.x;
    f->p1.y += s * p.y;
    f->p1.z += s * p.z;
    f->p2.x += square * p.x;
    f->p2.y += square * p.y;
    f->p2.z += square * p.z;
}

/* The second unknown of the normal equations, by Cramer's rule. Two points only: the line through them. */
static evl_vec3_t fit_slope(const fit_t *f)
{
    const double a = f->s2 * f->s3 - f->s1 * f->s4;
    const double b = f->n * f->s4 - f->s2 * f->s2;
    const double c = f->s1 * f->s2 - f->n * f->s3;
    const double det = a * f->s1 + b * f->s2 + c * f->s3;
    const double line = f->n * f->s2 - f->s1 * f->s1;
    evl_vec3_t v;
    if (f->n < 2.5) {
        v.x = (f->n * f->p1.x - f->s1 * f->p0.x) / line;
        v.y = (f->n * f->p1.y - f->s1 * f->p0.y) / line;
        v.z = (f->n * f->p1.z - f->s1 * f->p0.z) / line;
    } else {
        v.x = (a * f->p0.x + b * f->p1.x + c * f->p2.x) / det;
        v.y = (a * f->p0.y + b * f->p1.y + c * f->p2.y) / det;
        v.z = (a * f->p0.z + b * f->p1.z + c * f->p2.z) / det;
    }
    return v;
}

bool evl_velocity_over(const evh_poses_t *poses, evl_quat_t q_bc, int64_t t_us, int64_t interval_us, evl_vec3_t *v)
{
    const double seconds = 1e-6 * (double)interval_us;
    const int64_t first_us = t_us - interval_us / 2;
    evl_vec3_t before;
    evl_vec3_t after;
    evl_quat_t q_wb;
    if ((interval_us <= 0) || !evl_track_position(poses, first_us, &before) ||
        !evl_track_position(poses, first_us + interval_us, &after) || !evl_track_orientation(poses, t_us, &q_wb)) {
        return false;
    }
    v->x = (after.x - before.x) / seconds;
    v->y = (after.y - before.y) / seconds;
    v->z = (after.z - before.z) / seconds;
    *v = evl_quat_rotate(evl_quat_conj(evl_quat_mul(q_wb, q_bc)), *v);
    return true;
}

static bool from_poses(const evl_velocity_truth_t *truth, int64_t t_us, evl_vec3_t *v)
{
    const int64_t half_us = truth->baseline_us / 2;
    const evh_poses_t *const track = truth->poses;
    fit_t fit = {0};
    evl_vec3_t before;
    evl_vec3_t after;
    evl_quat_t q_wb;
    if (!evl_track_position(track, t_us - half_us, &before) || !evl_track_position(track, t_us + half_us, &after) ||
        !evl_track_orientation(track, t_us, &q_wb)) {
        return false;
    }
    /* From the first position on, in units of half a baseline: the sums keep their digits. */
    for (size_t i = evl_track_after(track, t_us - half_us); (i < track->n) && (track->pose[i].t_us < t_us + half_us);
         i++) {
        const double *const m = track->pose[i].p_m;
        const evl_vec3_t p = {m[0] - before.x, m[1] - before.y, m[2] - before.z};
        fit_add(&fit, (double)(track->pose[i].t_us - t_us) / (double)half_us, p);
    }
    after.x -= before.x;
    after.y -= before.y;
    after.z -= before.z;
    memset(&before, 0, sizeof before);
    fit_add(&fit, -1.0, before);
    fit_add(&fit, 1.0, after);
    *v = fit_slope(&fit);
    v->x /= 1e-6 * (double)half_us;
    v->y /= 1e-6 * (double)half_us;
    v->z /= 1e-6 * (double)half_us;
    *v = evl_quat_rotate(evl_quat_conj(evl_quat_mul(q_wb, truth->q_bc)), *v);
    return true;
}

bool evl_velocity_at(const evl_velocity_truth_t *truth, int64_t t_us, evl_vec3_t *v)
{
    return (truth->table != NULL) ? table_at(truth->table, t_us, v) : from_poses(truth, t_us, v);
}

/* Errors with what decides about them: the mean speed is known only after the last. */
typedef struct {
    evl_list_t error_deg, speed_m_s, sigma_deg, interval_error_deg; /* the last NaN where it is not told */
} errors_t;

/* The error against the mean velocity over the interval of the estimate; NaN where that is not known. */
static double over_interval(const evl_velocity_t *at, const evl_velocity_truth_t *truth)
{
    evl_vec3_t v;
    if ((truth->poses == NULL) || !evl_velocity_over(truth->poses, truth->q_bc, at->t_us, at->interval_us, &v)) {
        return (double)NAN;
    }
    return EVL_DEG_PER_RAD * evl_angle_between(at->v, v);
}

static bool collect(const evl_velocities_t *est, const evl_velocity_truth_t *truth, int64_t from_us, int64_t to_us,
                    evl_velocity_result_t *result, errors_t *e)
{
    for (size_t i = 0u; i < est->n; i++) {
        const evl_velocity_t *const at = &est->at[i];
        evl_vec3_t v;
        if ((at->t_us < from_us) || (at->t_us >= to_us)) { continue; }
        if (!(evl_norm(at->v) > 0.0)) {
            result->n_zero++;
            continue;
        }
        result->n_estimates++;
        if (!evl_velocity_at(truth, at->t_us, &v)) {
            result->n_no_truth++;
        } else if (!evl_list_add(&e->error_deg, EVL_DEG_PER_RAD * evl_angle_between(at->v, v)) ||
                   !evl_list_add(&e->speed_m_s, evl_norm(v)) || !evl_list_add(&e->sigma_deg, at->sigma_deg) ||
                   !evl_list_add(&e->interval_error_deg, over_interval(at, truth))) {
            return false;
        }
    }
    return true;
}

/* Leave the slow ones out, and tell how many of the others are within what they say of themselves. */
static void judge(evl_velocity_result_t *result, errors_t *e)
{
    const size_t n = e->error_deg.n;
    double sum = 0.0;
    size_t n_kept = 0u;
    size_t n_interval = 0u;
    for (size_t i = 0u; i < n; i++) { sum += e->speed_m_s.value[i]; }
    result->mean_speed_m_s = sum / (double)n;
    for (size_t i = 0u; i < n; i++) {
        const double error_deg = e->error_deg.value[i];
        const double sigma_deg = e->sigma_deg.value[i];
        const double interval_deg = e->interval_error_deg.value[i];
        /* Not "speed < limit": with a mean of zero nothing moves, and everything is slow. */
        if (!(e->speed_m_s.value[i] >= EVL_SLOW_SHARE * result->mean_speed_m_s) || !(e->speed_m_s.value[i] > 0.0)) {
            continue;
        }
        e->error_deg.value[n_kept++] = error_deg;
        if (isfinite(interval_deg)) { e->interval_error_deg.value[n_interval++] = interval_deg; }
        if (isfinite(sigma_deg)) {
            const double told_deg = isfinite(interval_deg) ? interval_deg : error_deg; /* What it is an estimate of. */
            result->n_sigma++;
            result->n_within_sigma += (told_deg <= sigma_deg) ? 1u : 0u;
            result->n_within_2_sigma += (told_deg <= 2.0 * sigma_deg) ? 1u : 0u;
        }
    }
    e->error_deg.n = n_kept;
    e->interval_error_deg.n = n_interval;
    result->n_slow = n - n_kept;
}

bool evl_velocity_compare(const evl_velocities_t *est, const evl_velocity_truth_t *truth, int64_t from_us,
                          int64_t to_us, evl_velocity_result_t *result)
{
    errors_t e;
    bool ok;
    memset(result, 0, sizeof *result);
    memset(&e, 0, sizeof e);
    ok = collect(est, truth, from_us, to_us, result, &e);
    if (e.error_deg.n > 0u) { judge(result, &e); }
    result->error_deg = evl_list_stats(&e.error_deg);
    result->interval_error_deg = evl_list_stats(&e.interval_error_deg);
    evl_list_free(&e.error_deg);
    evl_list_free(&e.speed_m_s);
    evl_list_free(&e.sigma_deg);
    evl_list_free(&e.interval_error_deg);
    return ok;
}

double evl_velocity_coverage(const evl_velocities_t *est, int64_t from_us, int64_t to_us)
{
    int64_t covered_us = 0;
    int64_t until_us = from_us;
    if (to_us <= from_us) { return 0.0; }
    for (size_t i = 0u; i < est->n; i++) {
        const int64_t start_us = (est->at[i].t_us > until_us) ? est->at[i].t_us : until_us;
        int64_t end_us = est->at[i].t_us + EVL_COVER_US;
        if (!(evl_norm(est->at[i].v) > 0.0)) { continue; }
        end_us = (end_us < to_us) ? end_us : to_us;
        if (end_us <= start_us) { continue; }
        covered_us += end_us - start_us;
        until_us = end_us;
    }
    return (double)covered_us / (double)(to_us - from_us);
}
