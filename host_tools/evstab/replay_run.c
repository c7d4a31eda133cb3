/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The loop of evstab replay. Orientations go into the library ahead of the events that need them, so that none has to
 * be predicted and the output depends on nothing but the recording and the settings. */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "events_text.h"
#include "orientation_feed.h"
#include "progress.h"
#include "replay.h"
#include "replay_velocity.h"
#include "to_device.h"

#define BLOCK_EVENTS 8192u

/* How far orientations run ahead: longer than the longest slice and a few samples of the slowest source (poses at
 * 100 Hz), and few enough samples for the ring even at 8 kHz. */
#define AHEAD_US 40000

typedef struct {
    const evt_replay_t *r;
    evt_replay_watch_t watch;
    evt_replay_result_t *result;
    evs_pipeline_t pipeline;
    void *memory;
    evh_event_source_t *source;
    evt_orientation_feed_t feed;
    int64_t newest_us; /* Of the newest orientation pushed, by the events' clock. */
    evt_replay_output_t out;
    bool out_open;
    evt_velocity_log_t velocity;
    evh_error_t *err; /* Of what fails inside a pull. */
    bool failed;
    evt_progress_t progress;
    evs_event_t ev[BLOCK_EVENTS];
    int64_t t_us[BLOCK_EVENTS];
    /* Host times of the events inside the library, which come out again in the same order. */
    int64_t *inside_us;
    size_t inside_first, inside_used, inside_cap;
    int64_t window_first_us;
    int64_t window_last_us;
    bool window_empty;
} run_t;

static bool open_pipeline(run_t *run, evh_error_t *err)
{
    const evs_pipeline_config_t *const cfg = &run->r->pipeline;
    const size_t bytes = evs_pipeline_bytes(cfg);
    evs_status_t status;
    if (bytes == 0u) { return evh_fail(err, "the library refuses these settings; check sensor size and tiles"); }
    run->result->library_bytes = sizeof run->pipeline + bytes;
    run->memory = malloc(bytes);
    run->inside_cap = cfg->n_fifo + 1u;
    run->inside_us = malloc(run->inside_cap * sizeof *run->inside_us);
    if ((run->memory == NULL) || (run->inside_us == NULL)) { return evh_fail(err, "out of memory for the pipeline"); }
    status = evs_pipeline_init(&run->pipeline, cfg, run->memory, bytes);
    if (status == EVS_ERR_NUMERIC) {
        return evh_fail(
            err,
            "the lens model of this calibration cannot be inverted near the axis; check the distortion coefficients");
    }
    if (status != EVS_OK) {
        return evh_fail(err, "the library refuses these settings (%s); check calibration, sensor size and window",
                        evs_status_name(status));
    }
    evt_gyro_bias_give(&run->r->gyro_bias, evs_pipeline_attitude(&run->pipeline));
    return true;
}

/* The next block of events in [from, to). @return their count, 0 at the end, -1 on a read error. */
static ssize_t next_block(run_t *run, evh_error_t *err)
{
    ssize_t got;
    while ((got = run->source->read(run->source, run->ev, run->t_us, BLOCK_EVENTS, err)) > 0) {
        size_t first = 0u;
        size_t last = (size_t)got;
        while ((first < last) && (run->t_us[first] < run->r->from_us)) { first++; }
        while ((last > first) && (run->t_us[last - 1u] >= run->r->to_us)) { last--; }
        run->result->n_before_from += first;
        run->result->n_after_to += (size_t)got - last;
        if (last > first) {
            memmove(run->ev, run->ev + first, (last - first) * sizeof run->ev[0]);
            memmove(run->t_us, run->t_us + first, (last - first) * sizeof run->t_us[0]);
            return (ssize_t)(last - first);
        }
        if ((size_t)got > first) { return 0; } /* Beyond --to: the rest of the file is not needed. */
        evt_progress_update(&run->progress, run->source->fraction(run->source), run->source->tally.n_good, "events");
    }
    return got;
}

static bool push_orientations(run_t *run, int64_t until_us, evh_error_t *err)
{
    evt_replay_result_t *const result = run->result;
    while (run->feed.has_next && (run->newest_us < until_us)) {
        evs_orientation_t newest;
        uint32_t flags = 0u;
        bool known = false;
        const int64_t t_us = run->feed.next_us;
        const int64_t start_ns = evt_now_ns();
        evt_orientation_feed_push(&run->feed, &newest, &flags, &known);
        result->attitude_ns += evt_now_ns() - start_ns;
        run->newest_us = t_us;
        if (result->n_orientations++ == 0u) { result->orientation_first_us = t_us; }
        result->orientation_last_us = t_us;
        if (known) {
            evt_replay_put_orientation(&run->out, t_us, &newest, flags);
            if (run->watch.report != NULL) { evr_report_orientation(run->watch.report, t_us, &newest); }
        }
        if (!evt_orientation_feed_fetch(&run->feed, err)) { return false; }
    }
    return true;
}

/* Move the host times of n events out of the queue, to the front of `t_us`. The library drops an event whose time runs
 * back, by its own clock; the queue skips those too. */
static void pop_times(run_t *run, const evs_event_t *ev, size_t n, int64_t *t_us)
{
    for (size_t i = 0u; i < n; i++) {
        int64_t t = 0;
        do {
            t = run->inside_us[run->inside_first];
            run->inside_first = (run->inside_first + 1u < run->inside_cap) ? run->inside_first + 1u : 0u;
            run->inside_used--;
        } while ((evt_time_us(t) != ev[i].t_us) && (run->inside_used > 0u));
        t_us[i] = t;
    }
}

static void count_points(evt_replay_result_t *result, const evs_pipeline_chunk_t *c)
{
    for (size_t i = 0u; i < c->n; i++) {
        if (!evs_point_is_outside(c->stabilized[i])) {
            result->n_kept++;
        } else if (evs_point_is_outside(c->undistorted[i])) {
            result->n_no_undistorted++;
        } else if (!c->oriented) {
            result->n_unoriented++;
        } else {
            result->n_out_of_range++;
        }
    }
    result->n_out += c->n;
}

static void take_chunk(run_t *run, const evs_pipeline_chunk_t *chunk)
{
    static int64_t t_us[BLOCK_EVENTS];
    pop_times(run, chunk->events, chunk->n, t_us);
    if (chunk->n > 0u) {
        if (run->window_empty) { run->window_first_us = t_us[0]; }
        run->window_empty = false;
        run->window_last_us = t_us[chunk->n - 1u];
    }
    count_points(run->result, chunk);
    evt_replay_put_chunk(&run->out, chunk, t_us, run->window_first_us, run->window_last_us);
    if (run->watch.report != NULL) {
        evr_report_chunk(run->watch.report, chunk, t_us, run->window_first_us, run->window_last_us);
    }
    if (run->watch.video != NULL) {
        evr_video_add(run->watch.video, t_us, chunk->events, chunk->undistorted, chunk->stabilized, chunk->n);
    }
    if (chunk->end.reason != EVS_WINDOW_OPEN) {
        run->window_empty = true;
        const int64_t length_us = run->window_last_us - run->window_first_us;
        if (length_us > run->result->window_longest_us) { run->result->window_longest_us = length_us; }
        run->result->n_windows++;
        run->result->n_saccades += chunk->saccade ? 1u : 0u;
        if (!evt_velocity_log_window(&run->velocity, chunk, run->window_last_us, run->err)) { run->failed = true; }
    }
}

/* All of the work on an image at once, so that none is left out. */
static void work_on_image(run_t *run)
{
    while (evs_pipeline_velocity_busy(&run->pipeline)) {
        evs_velocity_result_t pair;
        const int64_t start_ns = evt_now_ns();
        const bool got = evs_pipeline_velocity(&run->pipeline, SIZE_MAX, &pair);
        run->result->velocity_ns += evt_now_ns() - start_ns;
        if (got && !evt_velocity_log_pair(&run->velocity, &run->pipeline, &pair, run->err)) { run->failed = true; }
    }
}

static void pull_all(run_t *run)
{
    evs_pipeline_chunk_t chunk;
    for (;;) {
        const int64_t start_ns = evt_now_ns();
        const bool got = evs_pipeline_pull(&run->pipeline, &chunk);
        run->result->library_ns += evt_now_ns() - start_ns;
        if (!got) { return; }
        take_chunk(run, &chunk);
        work_on_image(run);
    }
}

static void push_events(run_t *run, const evs_event_t *ev, const int64_t *t_us, size_t n)
{
    while (n > 0u) {
        const int64_t start_ns = evt_now_ns();
        const size_t taken = evs_pipeline_push_events(&run->pipeline, ev, n);
        run->result->library_ns += evt_now_ns() - start_ns;
        for (size_t i = 0u; i < taken; i++) {
            size_t at = run->inside_first + run->inside_used;
            if (run->inside_used == run->inside_cap) { break; } /* Only when the library dropped that many. */
            at = (at < run->inside_cap) ? at : at - run->inside_cap;
            run->inside_us[at] = t_us[i];
            run->inside_used++;
        }
        pull_all(run);
        ev += taken;
        t_us += taken;
        n -= taken;
    }
}

static bool run_block(run_t *run, size_t n, evh_error_t *err)
{
    size_t i = 0u;
    while (i < n) {
        size_t end = n;
        if (!push_orientations(run, run->t_us[i] + AHEAD_US, err)) { return false; }
        if (run->feed.has_next) {
            end = i;
            while ((end < n) && (run->t_us[end] <= run->newest_us - AHEAD_US)) { end++; }
        }
        push_events(run, run->ev + i, run->t_us + i, end - i);
        i = end;
    }
    return !run->failed;
}

static bool run_all(run_t *run, size_t n_first, evh_error_t *err)
{
    evt_replay_result_t *const result = run->result;
    ssize_t n = (ssize_t)n_first;
    bool ok = true;
    result->t_first_us = run->t_us[0];
    if (run->watch.report != NULL) { evr_report_start(run->watch.report, result->t_first_us); }
    while (ok && (n > 0)) {
        result->n_events += (uint64_t)n;
        result->t_last_us = run->t_us[n - 1];
        ok = run_block(run, (size_t)n, err);
        evt_progress_update(&run->progress, run->source->fraction(run->source), run->source->tally.n_good, "events");
        if (ok) { n = next_block(run, err); }
    }
    evs_pipeline_finish(&run->pipeline);
    pull_all(run);
    if (ok && (n == 0) && (result->n_no_undistorted == result->n_out)) {
        return evh_fail(
            err, "no event has an undistorted position under this lens model; check the distortion coefficients");
    }
    return ok && !run->failed && (n == 0);
}

static bool no_event(const run_t *run, evh_error_t *err)
{
    const evt_replay_result_t *const result = run->result;
    if (result->n_before_from + result->n_after_to > 0u) {
        return evh_fail(err, "%s: no event between --from and --to; 'evstab info' tells its times", run->r->rec.events);
    }
    if (evh_tally_skipped(&run->source->tally) > 0u) {
        char text[800];
        evh_tally_text(&run->source->tally, "it", text, sizeof text);
        return evh_fail(err, "%s: no usable event (%s)", run->r->rec.events, text);
    }
    return evh_fail(err, "%s: holds no event", run->r->rec.events);
}

static bool start_and_run(run_t *run, const char *dir, evh_error_t *err)
{
    const evt_replay_t *const r = run->r;
    ssize_t n;
    if (!open_pipeline(run, err)) { return false; }
    run->source = evh_events_text_open(r->rec.events, r->calib.width_px, r->calib.height_px, err);
    if (run->source == NULL) { return false; }
    if (!evt_orientation_feed_open(&run->feed, r, &run->pipeline, err)) { return false; }
    /* The first events before the first output file: an input that is none leaves no litter behind. */
    n = next_block(run, err);
    if (n <= 0) { return (n < 0) ? false : no_event(run, err); }
    if (!evh_make_folder(dir, err)) { return false; }
    run->out_open = true;
    if (!evt_replay_output_open(&run->out, r, dir, err) ||
        !evt_velocity_log_open(&run->velocity, r, dir, run->watch.report, &run->result->velocity, err)) {
        return false;
    }
    return run_all(run, (size_t)n, err);
}

bool evt_replay_run(const evt_replay_t *r, const char *dir, const evt_replay_watch_t *watch,
                    evt_replay_result_t *result, evh_error_t *err)
{
    run_t *const run = calloc(1u, sizeof *run);
    const int64_t start_ns = evt_now_ns();
    bool ok;
    memset(result, 0, sizeof *result);
    if (run == NULL) { return evh_fail(err, "out of memory"); }
    run->r = r;
    run->watch = *watch;
    run->result = result;
    run->newest_us = INT64_MIN;
    run->err = err;
    run->window_empty = true;
    evt_progress_start(&run->progress);
    ok = start_and_run(run, dir, err);
    evt_progress_end(&run->progress);
    if (run->out_open) {
        ok = evt_replay_output_close(&run->out, err) && ok;
        ok = evt_velocity_log_close(&run->velocity, err) && ok;
    }
    evt_orientation_feed_close(&run->feed, result);
    if (run->source != NULL) {
        result->events_tally = run->source->tally;
        run->source->close(run->source);
    }
    if (result->n_events > 0u) {
        const evs_velocity_t *const part = evs_pipeline_velocity_part(&run->pipeline);
        result->counts = evs_pipeline_counts(&run->pipeline);
        if (part != NULL) { result->velocity.library = evs_velocity_counts(part); }
        result->attitude_faults = evs_attitude_faults(evs_pipeline_attitude(&run->pipeline));
        result->gyro_bias_q24 = evs_pipeline_gyro_bias(&run->pipeline);
        result->gyro_bias_known =
            (evs_attitude_flags(evs_pipeline_attitude(&run->pipeline)) & EVS_ATTITUDE_BIAS_KNOWN) != 0u;
    }
    free(run->inside_us);
    free(run->memory);
    free(run);
    result->wall_ns = evt_now_ns() - start_ns;
    return ok;
}
