/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Flow in text: what comes out is finite and in range; the solver has an answer to any of it. */
#include <math.h>

#include "evs/egomotion.h"
#include "evs/float.h"
#include "flow_text.h"
#include "fuzz.h"

enum { N_MAX = 256 };

static evs_egomotion_flow_t flow[N_MAX];
static uint32_t scratch[EVS_EGOMOTION_PAPER_BYTES(N_MAX) / 4u];

static void solve(size_t n)
{
    for (int method = 0; method < 3; method++) {
        evs_egomotion_config_t cfg = evs_egomotion_config_default();
        evs_egomotion_result_t result;
        cfg.method = (evs_egomotion_method_t)method;
        cfg.rotation_sigma_rad_q28 = (n % 2u == 0u) ? 0 : 1000000;
        FUZZ_CHECK(evs_egomotion_solve(&cfg, flow, n, scratch, sizeof scratch, &result) == EVS_OK);
        const double length = sqrt((double)evs_vec3_norm_sq(result.v_q30)) / 1073741824.0;
        FUZZ_CHECK(fabs(length - 1.0) < 1e-6);
        FUZZ_CHECK((result.sigma_rad_q28 >= 0) && (result.n_inliers <= result.n_flow));
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    evh_error_t err = {""};
    evh_flow_t reader;
    evh_flow_row_t row;
    size_t n = 0u;
    if (!evh_flow_open(&reader, fuzz_file(data, size), &err)) {
        FUZZ_CHECK(err.text[0] != '\0');
        return 0;
    }
    while (evh_flow_next(&reader, &row, &err)) {
        if (row.fault != EVH_FAULT_NONE) { continue; }
        FUZZ_CHECK(row.has_frame);
        FUZZ_CHECK((fabs(row.x) < EVH_FLOW_POSITION_LIMIT) && (fabs(row.y) < EVH_FLOW_POSITION_LIMIT));
        FUZZ_CHECK((fabs(row.u) < EVH_FLOW_LENGTH_LIMIT) && (fabs(row.v) < EVH_FLOW_LENGTH_LIMIT));
        if (n < N_MAX) {
            flow[n++] = (evs_egomotion_flow_t){evs_q_from_double(row.x, 24u), evs_q_from_double(row.y, 24u),
                                               evs_q_from_double(row.u, 24u), evs_q_from_double(row.v, 24u)};
        }
    }
    evh_flow_close(&reader);
    solve((n < 24u) ? n : 24u);
    return 0;
}
