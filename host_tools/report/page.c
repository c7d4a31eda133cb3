/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The page: a template, a style, a script, and the data as JSON for the script. */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "assets.h"
#include "collect.h"
#include "csv_writer.h"
#include "evs/version.h"
#include "png_bytes.h"
#include "text.h"

/* base64 of pictures; what does not fit is left out, from the end. Keeps the page within about 3 MB. */
#define CLIP_BYTES_MAX 2400000u

#define RATE_STEPS 300

#define STILL_RAD_S 0.01 /* Below this "fastest" says nothing. */

static void put_seconds(evr_text_t *t, int64_t t_us) { evr_printf(t, "%.6f", (double)t_us * 1e-6); }

static void put_points(evr_text_t *t, const evr_series_t *s, int64_t last_us)
{
    const char *comma = "";
    evr_put(t, "[");
    for (size_t i = 0u; i < EVR_SERIES_BINS; i++) {
        evr_sample_t sample[2];
        const size_t n = evr_series_samples(&s->bin[i], sample);
        for (size_t k = 0u; k < n; k++) {
            if (sample[k].t_us > last_us) { continue; } /* Orientations run ahead of the last event. */
            evr_printf(t, "%s%.6g,", comma, (double)sample[k].t_us * 1e-6);
            evr_put_number(t, sample[k].value, 5);
            comma = ",";
        }
    }
    evr_put(t, "]");
}

/* Events per second, at the middle of each step. Few steps: with few events in each, the curve would be noise. The last
 * step ends where the recording does. */
static void put_rates(evr_text_t *t, const evr_counts_t *c, int64_t last_us)
{
    const int64_t n_bins = last_us / c->width_us + 1;
    const int64_t group = (n_bins + RATE_STEPS - 1) / RATE_STEPS;
    const char *comma = "";
    evr_put(t, "[");
    for (int64_t i = 0; i < n_bins; i += group) {
        const int64_t from_us = i * c->width_us;
        const int64_t end_us = from_us + group * c->width_us;
        const int64_t to_us = (end_us <= last_us + 1) ? end_us : last_us + 1;
        uint64_t n = 0u;
        if ((i > 0) && (to_us - from_us < (end_us - from_us) / 2)) { break; }
        for (int64_t k = i; (k < i + group) && (k < n_bins); k++) { n += c->n[k]; }
        evr_printf(t, "%s%.6g,", comma, (double)(from_us + to_us) * 0.5e-6);
        evr_put_number(t, (double)n * 1e6 / (double)(to_us - from_us), 5);
        comma = ",";
    }
    evr_put(t, "]");
}

/* Half the widths of the band around the same points, in the same order. */
static void put_spreads(evr_text_t *t, const evr_series_t *s, int64_t last_us)
{
    const char *comma = "";
    evr_put(t, "[");
    for (size_t i = 0u; i < EVR_SERIES_BINS; i++) {
        evr_sample_t sample[2];
        const size_t n = evr_series_samples(&s->bin[i], sample);
        for (size_t k = 0u; k < n; k++) {
            if (sample[k].t_us > last_us) { continue; }
            evr_put(t, comma);
            evr_put_number(t, sample[k].spread, 3);
            comma = ",";
        }
    }
    evr_put(t, "]");
}

static bool has_samples(const evr_series_t *s)
{
    for (size_t i = 0u; i < EVR_SERIES_BINS; i++) {
        if (s->bin[i].n > 0u) { return true; }
    }
    return false;
}

static void begin_plot(evr_text_t *t, const char *comma, const char *id, const char *title, const char *unit)
{
    evr_printf(t, "%s\n{\"id\":\"%s\",\"title\":\"%s\",\"unit\":\"%s\",\"curves\":[", comma, id, title, unit);
}

static void put_axes(evr_text_t *t, const evr_series_t s[3], int64_t last_us, const char *const name[3])
{
    for (int i = 0; i < 3; i++) {
        evr_printf(t, "%s{\"name\":\"%s\",\"points\":", (i > 0) ? "," : "", name[i]);
        put_points(t, &s[i], last_us);
        evr_put(t, "}");
    }
    evr_put(t, "]}");
}

/* Unit vectors with the band of their uncertainty, and the truth where it is known. */
static void put_direction(evr_text_t *t, const evr_flight_t *f, int64_t last_us)
{
    static const char *const NAME[3] = {"x (right)", "y (down)", "z (ahead)"};
    begin_plot(t, ",", "direction", "Direction of flight in the camera's frame", "unit vector");
    for (int i = 0; i < 3; i++) {
        evr_printf(t, "%s{\"name\":\"%s\",\"points\":", (i > 0) ? "," : "", NAME[i]);
        put_points(t, &f->component[i], last_us);
        evr_put(t, ",\"spread\":");
        put_spreads(t, &f->component[i], last_us);
        if (has_samples(&f->truth[i])) {
            evr_put(t, ",\"truth\":");
            put_points(t, &f->truth[i], last_us);
        }
        evr_put(t, "}");
    }
    evr_put(t, "],\"base\":0}");
}

/* A plot that has nothing to show is not there. */
static void put_plots(evr_text_t *t, const evr_report_t *r)
{
    static const char *const TURN[3] = {"x (pitch)", "y (yaw)", "z (roll)"};
    const int64_t last_us = r->last_us - r->first_us;
    const char *comma = "";
    evr_put(t, "[");
    if (has_samples(&r->attitude_deg[0])) {
        begin_plot(t, comma, "attitude", "Attitude relative to the start (rotation vector)", "\\u00b0");
        put_axes(t, r->attitude_deg, last_us, TURN);
        begin_plot(t, ",", "rate", "Angular rate of the camera", "\\u00b0/s");
        put_axes(t, r->rate_deg_s, last_us, TURN);
        comma = ",";
    }
    begin_plot(t, comma, "events", "Event rate", "events/s");
    evr_put(t, "{\"name\":\"events\",\"fill\":true,\"points\":");
    put_rates(t, &r->events, last_us);
    evr_put(t, "}]}");
    if (has_samples(&r->flight.component[0])) { put_direction(t, &r->flight, last_us); }
    if (has_samples(&r->window_ms)) {
        begin_plot(t, ",", "window", "Duration of the windows", "ms");
        evr_put(t, "{\"name\":\"window\",\"points\":");
        put_points(t, &r->window_ms, last_us);
        evr_put(t, "}]}");
    }
    if (has_samples(&r->window_gain)) {
        begin_plot(t, ",", "gain", "Sharpness gain per window", "after / before");
        evr_put(t, "{\"name\":\"gain\",\"points\":");
        put_points(t, &r->window_gain, last_us);
        evr_put(t, "}],\"base\":1}");
    }
    evr_put(t, "]");
}

static void put_saccades(evr_text_t *t, const evr_report_t *r)
{
    const uint64_t kept = (r->n_saccades < EVR_SACCADES_MAX) ? r->n_saccades : EVR_SACCADES_MAX;
    evr_printf(t, "{\"n\":%" PRIu64 ",\"t\":[", r->n_saccades);
    for (uint64_t i = 0u; i < kept; i++) {
        evr_printf(t, "%s%.6g", (i > 0u) ? "," : "", (double)r->saccade_us[i] * 1e-6);
    }
    evr_put(t, "]}");
}

static void put_png(evr_text_t *t, const uint8_t *grey, int width, int height, int bits)
{
    evr_png_t png;
    if (!evr_png_encode(&png, grey, width, height, bits)) {
        t->failed = true;
        return;
    }
    evr_put(t, "\"");
    evr_put_base64(t, png.bytes, png.n);
    evr_put(t, "\"");
    free(png.bytes);
}

static void put_span(evr_text_t *t, const evr_report_t *r)
{
    const evr_span_facts_t *const f = &r->spans.best;
    evr_printf(t, "{\"width\":%u,\"height\":%u,\"n_events\":%" PRIu64, (unsigned)r->width_px, (unsigned)r->height_px,
               f->n_events);
    evr_put(t, ",\"from_s\":");
    put_seconds(t, f->first_us - r->first_us);
    evr_put(t, ",\"to_s\":");
    put_seconds(t, f->last_us - r->first_us);
    evr_printf(t, ",\"shaken\":%s", (r->spans.best_good && (f->shake.rate_rad_s > STILL_RAD_S)) ? "true" : "false");
    evr_printf(t, ",\"rate_deg_s\":%.5g,\"motion_px_s\":%.5g", f->shake.rate_rad_s * 57.29577951308232,
               f->shake.motion_px_s);
    evr_printf(t, ",\"sharpness\":[%.6g,%.6g],\n\"before\":", f->before, f->after);
    put_png(t, r->spans.best_before, r->width_px, r->height_px, 8);
    evr_put(t, ",\n\"after\":");
    put_png(t, r->spans.best_after, r->width_px, r->height_px, 8);
    evr_put(t, "}");
}

/* Counts as they are shown, 2 bits each: none, one, two, more. */
static uint8_t shown(uint8_t cell)
{
    const unsigned brighter = cell & 15u;
    const unsigned darker = cell >> 4;
    return (uint8_t)(((brighter < 3u) ? brighter : 3u) | (((darker < 3u) ? darker : 3u) << 2));
}

/* One picture as one PNG: the pane at the left, the canvas at the right of it. */
static void lay_out(const evr_panes_t *p, const uint8_t *picture, uint8_t *sheet)
{
    const size_t w = (size_t)p->width;
    const size_t h = (size_t)p->height;
    const uint8_t *const canvas = picture + evr_panes_canvas_at(p);
    for (size_t y = 0u; y < 2u * h; y++) {
        uint8_t *const row = sheet + y * 3u * w;
        for (size_t x = 0u; (y < h) && (x < w); x++) { row[x] = shown(picture[y * w + x]); }
        for (size_t x = 0u; x < 2u * w; x++) { row[w + x] = shown(canvas[y * 2u * w + x]); }
    }
}

static void put_clip(evr_text_t *t, const evr_report_t *r)
{
    const evr_panes_t *const p = &r->clip.panes;
    const size_t limit = t->n + CLIP_BYTES_MAX;
    uint8_t *const sheet = calloc(6u, evr_panes_canvas_at(p));
    if (sheet == NULL) {
        t->failed = true;
        return;
    }
    evr_printf(t, "{\"width\":%d,\"height\":%d,\"bin\":%d,\"rate_deg_s\":%.5g,\"picture_s\":%.6f,\"from_s\":", p->width,
               p->height, p->bin, r->take->rate_rad_s * 57.29577951308232, (double)r->take->picture_us * 1e-6);
    put_seconds(t, r->take->start_us - r->first_us);
    evr_put(t, ",\"pictures\":[");
    for (int i = 0; (i < r->take->n) && (t->n < limit); i++) {
        lay_out(p, r->take->pictures + (size_t)i * p->n_cells, sheet);
        evr_put(t, (i > 0) ? ",\n" : "\n");
        put_png(t, sheet, 3 * p->width, 2 * p->height, 4);
    }
    evr_put(t, "]}");
    free(sheet);
}

static void put_flow(evr_text_t *t, const evr_report_t *r)
{
    const evr_flow_t *const f = &r->flight.best;
    evr_printf(t, "{\"width\":%u,\"height\":%u,\"at_s\":", (unsigned)r->width_px, (unsigned)r->height_px);
    put_seconds(t, f->t_us - r->first_us);
    evr_put(t, ",\"interval_s\":");
    put_seconds(t, f->interval_us);
    evr_printf(t, ",\"k\":[%.6g,%.6g,%.6g,%.6g],\"v\":[%.5f,%.5f,%.5f],\"sigma_deg\":%.4g", f->fx_px, f->fy_px,
               f->cx_px, f->cy_px, f->v[0], f->v[1], f->v[2], f->sigma_rad * 57.29577951308232);
    evr_put(t, ",\"arrows\":[");
    for (size_t i = 0u; i < f->n; i++) {
        const evr_arrow_t *const a = &f->arrows[i];
        evr_printf(t, "%s%.2f,%.2f,%.2f,%.2f,%d", (i > 0u) ? "," : "", a->x, a->y, a->dx, a->dy, a->inlier ? 1 : 0);
    }
    evr_put(t, "],\n\"image\":");
    put_png(t, f->px, r->width_px, r->height_px, 8);
    evr_put(t, "}");
}

static void put_numbers(evr_text_t *t, const evr_report_t *r)
{
    const evr_spans_t *const s = &r->spans;
    const double n = (s->n_spans > 0u) ? (double)s->n_spans : 1.0;
    const double m = (r->n_measured > 0u) ? (double)r->n_measured : 1.0;
    evr_printf(t, "{\"spans\":%" PRIu64 ",\"spans_sharpness\":[%.6g,%.6g]", s->n_spans, s->before_sum / n,
               s->after_sum / n);
    evr_printf(t, ",\"windows\":%" PRIu64 ",\"windows_measured\":%" PRIu64 ",\"windows_sharpness\":[%.6g,%.6g]",
               r->n_windows, r->n_measured, r->window_before_sum / m, r->window_after_sum / m);
    if (s->all.n > 0u) {
        evr_printf(t, ",\"rate_deg_s\":[%.5g,%.5g],\"motion_px_s\":[%.5g,%.5g]", s->all.rate_rad_s * 57.29577951308232,
                   s->all.rate_max_rad_s * 57.29577951308232, s->all.motion_px_s, s->all.motion_max_px_s);
    }
    evr_printf(t, ",\"directions\":%" PRIu64 ",\"directions_true\":%" PRIu64, r->flight.sigma_deg.total,
               r->flight.error_deg.total);
    if (r->flight.sigma_deg.total > 0u) {
        evr_printf(t, ",\"direction_sigma_deg\":%.4g", evr_angles_median(&r->flight.sigma_deg));
    }
    if (r->flight.error_deg.total > 0u) {
        evr_printf(t, ",\"direction_error_deg\":%.4g", evr_angles_median(&r->flight.error_deg));
    }
    evr_put(t, "}");
}

static void put_data(evr_text_t *t, const evr_report_t *r, const char *name, const char *summary)
{
    evr_put(t, "{\"name\":");
    evr_put_json_string(t, name);
    evr_put(t, ",\"version\":\"" EVS_VERSION_STRING "\",\"duration_s\":");
    put_seconds(t, r->last_us - r->first_us);
    evr_put(t, ",\n\"numbers\":");
    put_numbers(t, r);
    evr_put(t, ",\n\"saccades\":");
    put_saccades(t, r);
    evr_put(t, ",\n\"plots\":");
    put_plots(t, r);
    if (r->spans.n_spans > 0u) {
        evr_put(t, ",\n\"span\":");
        put_span(t, r);
    }
    if (r->take != NULL) {
        evr_put(t, ",\n\"clip\":");
        put_clip(t, r);
    }
    if (r->flight.has_best) {
        evr_put(t, ",\n\"flow\":");
        put_flow(t, r);
    }
    evr_put(t, ",\n\"summary\":");
    evr_put_json_in_html(t, summary);
    evr_put(t, "}");
}

static void put_script(evr_text_t *t)
{
    const char *const parts[] = {evr_asset_page_js,       evr_asset_before_after_js, evr_asset_animation_js,
                                 evr_asset_flight_js,     evr_asset_plots_js,        evr_asset_tables_js,
                                 evr_asset_evaluation_js, evr_asset_main_js};
    for (size_t i = 0u; i < sizeof parts / sizeof parts[0]; i++) { evr_put(t, parts[i]); }
}

/* The template with its @WORDS@ replaced. */
static void put_page(evr_text_t *t, const evr_report_t *r, const char *name, const char *summary)
{
    const char *html = evr_asset_report_html;
    const char *at;
    while ((at = strchr(html, '@')) != NULL) {
        const size_t length = strcspn(at + 1, "@");
        evr_put_n(t, html, (size_t)(at - html));
        if (strncmp(at + 1, "TITLE", length) == 0) { evr_put_html(t, name); }
        if (strncmp(at + 1, "STYLE", length) == 0) { evr_put(t, evr_asset_report_css); }
        if (strncmp(at + 1, "DATA", length) == 0) { put_data(t, r, name, summary); }
        if (strncmp(at + 1, "SCRIPT", length) == 0) { put_script(t); }
        html = at + length + 2u;
    }
    evr_put(t, html);
}

bool evr_report_write(const evr_report_t *r, const char *dir, const char *name, const char *summary, evh_error_t *err)
{
    evr_text_t page = {NULL, 0u, 0u, false};
    evh_csv_t out;
    bool ok;
    put_page(&page, r, name, summary);
    if (page.failed) {
        evr_text_free(&page);
        return evh_fail(err, "%s/report.html: out of memory", dir);
    }
    ok = evh_csv_open(&out, dir, "report.html", "<!DOCTYPE html>", err);
    if (ok) {
        for (size_t at = 0u; at < page.n;) {
            const size_t n = (page.n - at < 32768u) ? page.n - at : 32768u;
            char *const to = evh_csv_reserve(&out, n);
            memcpy(to, page.bytes + at, n);
            evh_csv_advance(&out, to + n);
            at += n;
        }
        ok = evh_csv_close(&out, err);
    }
    evr_text_free(&page);
    return ok;
}
