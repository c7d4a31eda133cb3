/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include <string.h>

#include "replay.h"

const char *evt_window_reason_name(evs_window_reason_t reason)
{
    static const char *const NAMES[] = {[EVS_WINDOW_OPEN] = "open",
                                        [EVS_WINDOW_BY_AREA] = "area",
                                        [EVS_WINDOW_BY_COUNT] = "count",
                                        [EVS_WINDOW_BY_DURATION] = "time",
                                        [EVS_WINDOW_BY_MAX_DURATION] = "max_duration",
                                        [EVS_WINDOW_BY_FLUSH] = "end",
                                        [EVS_WINDOW_BY_RESTART] = "restart"};
    return NAMES[reason];
}

bool evt_replay_output_open(evt_replay_output_t *out, const evt_replay_t *r, const char *dir, evh_error_t *err)
{
    memset(out, 0, sizeof *out);
    out->has_attitude =
        evh_csv_open(&out->attitude, dir, "attitude.csv", "#t_s,qw,qx,qy,qz,wx_rad_s,wy_rad_s,wz_rad_s,flags", err);
    if (!out->has_attitude) { return false; }
    out->has_windows = evh_csv_open(&out->windows, dir, "windows.csv",
                                    "#index,first_event,n_events,t_first_s,t_last_s,reason,saccade,qw,qx,qy,qz", err);
    if (!out->has_windows) { return false; }
    if (r->write_events) {
        out->has_events = evh_csv_open(&out->events, dir, "events.csv",
                                       "#t_s,x_px,y_px,p,x_undist_px,y_undist_px,x_stab_px,y_stab_px,window", err);
        return out->has_events;
    }
    return true;
}

static char *put_quat(char *p, evs_quat_t q)
{
    const int32_t part[4] = {q.w, q.x, q.y, q.z};
    for (int i = 0; i < 4; i++) {
        *p++ = ',';
        p = evh_put_q(p, part[i], 30u, 9u);
    }
    return p;
}

void evt_replay_put_orientation(evt_replay_output_t *out, int64_t t_us, const evs_orientation_t *o, uint32_t flags)
{
    const int32_t rate[3] = {o->rate_rad_s_q24.x, o->rate_rad_s_q24.y, o->rate_rad_s_q24.z};
    char *p = evh_csv_reserve(&out->attitude, 256u);
    p = put_quat(evh_put_time_us(p, t_us), o->q_wc);
    for (int i = 0; i < 3; i++) {
        *p++ = ',';
        p = evh_put_q(p, rate[i], 24u, 7u);
    }
    *p++ = ',';
    p = evh_put_uint(p, flags);
    *p++ = '\n';
    evh_csv_advance(&out->attitude, p);
}

static char *put_point(char *p, evs_point_t point)
{
    *p++ = ',';
    if (evs_point_is_outside(point)) { return evh_put_text(p, "nan,nan"); }
    p = evh_put_q4(p, point.x_q4);
    *p++ = ',';
    return evh_put_q4(p, point.y_q4);
}

static void put_events(evt_replay_output_t *out, const evs_pipeline_chunk_t *c, const int64_t *t_us)
{
    for (size_t i = 0u; i < c->n; i++) {
        const evs_event_t ev = c->events[i];
        char *p = evh_csv_reserve(&out->events, 160u);
        p = evh_put_time_us(p, t_us[i]);
        *p++ = ',';
        p = evh_put_uint(p, evs_event_x_px(ev));
        *p++ = ',';
        p = evh_put_uint(p, evs_event_y_px(ev));
        *p++ = ',';
        *p++ = evs_event_brighter(ev) ? '1' : '0';
        p = put_point(p, c->undistorted[i]);
        p = put_point(p, c->stabilized[i]);
        *p++ = ',';
        p = evh_put_uint(p, c->window);
        *p++ = '\n';
        evh_csv_advance(&out->events, p);
    }
}

void evt_replay_put_chunk(evt_replay_output_t *out, const evs_pipeline_chunk_t *chunk, const int64_t *t_us,
                          int64_t t_first_us, int64_t t_last_us)
{
    char *p;
    if (out->has_events) { put_events(out, chunk, t_us); }
    out->n_events += chunk->n;
    if (chunk->end.reason == EVS_WINDOW_OPEN) { return; }
    p = evh_csv_reserve(&out->windows, 256u);
    p = evh_put_uint(p, chunk->end.index);
    *p++ = ',';
    p = evh_put_uint(p, out->window_first_event);
    *p++ = ',';
    p = evh_put_uint(p, chunk->end.n_events);
    *p++ = ',';
    p = evh_put_time_us(p, t_first_us);
    *p++ = ',';
    p = evh_put_time_us(p, t_last_us);
    *p++ = ',';
    p = evh_put_text(p, evt_window_reason_name(chunk->end.reason));
    *p++ = ',';
    *p++ = chunk->saccade ? '1' : '0';
    p = put_quat(p, chunk->q_rc);
    *p++ = '\n';
    evh_csv_advance(&out->windows, p);
    out->window_first_event = out->n_events;
}

bool evt_replay_output_close(evt_replay_output_t *out, evh_error_t *err)
{
    bool ok = true;
    if (out->has_attitude) { ok = evh_csv_close(&out->attitude, err) && ok; }
    if (out->has_windows) { ok = evh_csv_close(&out->windows, err) && ok; }
    if (out->has_events) { ok = evh_csv_close(&out->events, err) && ok; }
    return ok;
}
