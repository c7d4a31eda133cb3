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

static bool from_poses(const evl_velocity_truth_t *truth, int64_t t_us, evl_vec3_t *v)
{
    const int64_t half_us = truth->baseline_us / 2;
    const double seconds = 2e-6 * (double)half_us;
    evl_vec3_t before;
    evl_vec3_t after;
    evl_quat_t q_wb;
    if (!evl_track_position(truth->poses, t_us - half_us, &before) ||
        !evl_track_position(truth->poses, t_us + half_us, &after) ||
        !evl_track_orientation(truth->poses, t_us, &q_wb)) {
        return false;
    }
    v->x = (after.x - before.x) / seconds;
    v->y = (after.y - before.y) / seconds;
    v->z = (after.z - before.z) / seconds;
    *v = evl_quat_rotate(evl_quat_conj(evl_quat_mul(q_wb, truth->q_bc)), *v);
    return true;
}

bool evl_velocity_at(const evl_velocity_truth_t *truth, int64_t t_us, evl_vec3_t *v)
{
    return (truth->table != NULL) ? table_at(truth->table, t_us, v) : from_poses(truth, t_us, v);
}

bool evl_velocity_compare(const evl_velocities_t *est, const evl_velocity_truth_t *truth, int64_t from_us,
                          int64_t to_us, evl_velocity_result_t *result)
{
    evl_list_t errors;
    evl_list_t speeds;
    bool ok = true;
    double sum = 0.0;
    memset(result, 0, sizeof *result);
    memset(&errors, 0, sizeof errors);
    memset(&speeds, 0, sizeof speeds);
    /* First all errors with their speeds, in two lists of equal length: the mean speed is known only afterwards. */
    for (size_t i = 0u; ok && (i < est->n); i++) {
        evl_vec3_t v;
        if ((est->at[i].t_us < from_us) || (est->at[i].t_us >= to_us)) { continue; }
        if (!(evl_norm(est->at[i].v) > 0.0)) {
            result->n_zero++;
            continue;
        }
        result->n_estimates++;
        if (!evl_velocity_at(truth, est->at[i].t_us, &v)) {
            result->n_no_truth++;
            continue;
        }
        ok = evl_list_add(&errors, EVL_DEG_PER_RAD * evl_angle_between(est->at[i].v, v)) &&
             evl_list_add(&speeds, evl_norm(v));
        sum += ok ? evl_norm(v) : 0.0;
    }
    if (errors.n > 0u) {
        const size_t n = errors.n;
        size_t n_kept = 0u;
        result->mean_speed_m_s = sum / (double)n;
        for (size_t i = 0u; i < n; i++) {
            /* Not "speed < limit": with a mean of zero nothing moves, and everything is slow. */
            if ((speeds.value[i] >= EVL_SLOW_SHARE * result->mean_speed_m_s) && (speeds.value[i] > 0.0)) {
                errors.value[n_kept++] = errors.value[i];
            }
        }
        errors.n = n_kept;
        result->n_slow = n - n_kept;
    }
    result->error_deg = evl_list_stats(&errors);
    evl_list_free(&errors);
    evl_list_free(&speeds);
    return ok;
}
