/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "poses_text.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NORM_SLACK       0.05
#define POSITION_LIMIT_M 1e6

#define REQUIRED (EVH_BIT(EVH_Q_T) | EVH_BIT(EVH_Q_QW) | EVH_BIT(EVH_Q_QX) | EVH_BIT(EVH_Q_QY) | EVH_BIT(EVH_Q_QZ))

static const evh_layout_t TUM_LAYOUT = {
    .column = {EVH_Q_T, EVH_Q_PX, EVH_Q_PY, EVH_Q_PZ, EVH_Q_QX, EVH_Q_QY, EVH_Q_QZ, EVH_Q_QW}, .n_columns = 8u};

static bool grow(evh_poses_t *poses, size_t *cap)
{
    const size_t larger = (*cap == 0u) ? 1024u : *cap * 2u;
    evh_pose_t *const pose = realloc(poses->pose, larger * sizeof *pose);
    if (pose == NULL) { return false; }
    poses->pose = pose;
    *cap = larger;
    return true;
}

/* @return false when the quaternion is none. */
static bool to_pose(const evh_row_t *row, evh_pose_t *pose)
{
    const double *const q = &row->value[EVH_Q_QW];
    const double norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(fabs(norm - 1.0) <= NORM_SLACK)) { return false; }
    pose->t_us = row->t_us;
    memcpy(pose->p_m, &row->value[EVH_Q_PX], sizeof pose->p_m);
    for (int i = 0; i < 4; i++) { pose->q_wxyz[i] = q[i] / norm; }
    return true;
}

bool evh_poses_read(evh_poses_t *poses, const char *path, evh_error_t *err)
{
    evh_rows_t rows;
    evh_row_t row;
    size_t cap = 0u;
    bool ok = true;

    memset(poses, 0, sizeof *poses);
    if (!evh_rows_open(&rows, path, &TUM_LAYOUT, REQUIRED, err)) { return false; }
    for (int q = EVH_Q_PX; q <= EVH_Q_PZ; q++) { rows.limit[q] = POSITION_LIMIT_M; }
    while (ok && evh_rows_next(&rows, &row, err)) {
        if ((poses->n == cap) && !grow(poses, &cap)) {
            ok = evh_fail(err, "%s: out of memory after %zu poses", path, poses->n);
        } else if (to_pose(&row, &poses->pose[poses->n])) {
            poses->n++;
        } else {
            rows.tally.n_good--;
            evh_tally_fault(&rows.tally, EVH_FAULT_RANGE, row.line);
        }
    }
    poses->tally = rows.tally;
    evh_rows_close(&rows);
    if (err->text[0] != '\0') {
        evh_poses_free(poses);
        return false;
    }
    return true;
}

void evh_poses_free(evh_poses_t *poses)
{
    free(poses->pose);
    memset(poses, 0, sizeof *poses);
}
