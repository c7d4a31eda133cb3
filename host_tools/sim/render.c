/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "render.h"

#include <math.h>

#define INVERSE_DEPTH_MIN 1e-5f /* 100 km: keeps texture coordinates finite where a plane is seen edge-on. */

static float along(const float a[3], float x, float y) { return a[0] * x + a[1] * y + a[2]; }

static void to_float(float out[3], evsim_vec_t a)
{
    for (unsigned i = 0u; i < 3u; i++) { out[i] = (float)a.v[i]; }
}

/* Scale so that the value changes by 1 per unit of ray motion. */
static void set_edge(float out[3], evsim_vec_t edge)
{
    const double gradient = hypot(edge.v[0], edge.v[1]);
    to_float(out, evsim_scale(1.0 / (gradient + 1e-12), edge));
}

void evsim_view_init(evsim_view_t *view, const evsim_scene_t *scene, const evsim_state_t *state)
{
    view->n_surfaces = 0u;
    view->background = (float)scene->background;
    for (unsigned i = 0u; i < scene->n_surfaces; i++) {
        const evsim_surface_t *const s = &scene->surface[i];
        const evsim_vec_t n = evsim_cross(s->u, s->v);
        const evsim_vec_t from_centre = evsim_sub(state->p_w_m, s->centre_m);
        const double height = -evsim_dot(n, from_centre);
        evsim_view_surface_t *const w = &view->surface[view->n_surfaces];
        evsim_vec_t c;
        evsim_vec_t u;
        evsim_vec_t v;
        if (fabs(height) < 1e-6) { continue; } /* Seen exactly edge-on. */
        c = evsim_scale(1.0 / height, evsim_rotate_back(&state->r_wc, n));
        u = evsim_add(evsim_scale(evsim_dot(s->u, from_centre), c), evsim_rotate_back(&state->r_wc, s->u));
        v = evsim_add(evsim_scale(evsim_dot(s->v, from_centre), c), evsim_rotate_back(&state->r_wc, s->v));
        to_float(w->inverse_depth, c);
        to_float(w->u, evsim_scale(s->texels_per_m_u, u));
        to_float(w->v, evsim_scale(s->texels_per_m_v, v));
        w->bounded = s->bounded;
        if (s->bounded) {
            set_edge(w->edge[0], evsim_sub(evsim_scale(s->half_u_m, c), u));
            set_edge(w->edge[1], evsim_add(evsim_scale(s->half_u_m, c), u));
            set_edge(w->edge[2], evsim_sub(evsim_scale(s->half_v_m, c), v));
            set_edge(w->edge[3], evsim_add(evsim_scale(s->half_v_m, c), v));
        }
        w->offset_u = (float)s->offset_u;
        w->offset_v = (float)s->offset_v;
        w->gain = (float)s->gain;
        w->texture = &scene->texture[s->texture];
        view->n_surfaces++;
    }
}

/* How far the ray is inside a bounded surface, in ray units. */
static float inside(const evsim_view_surface_t *s, float x, float y)
{
    float least = along(s->edge[0], x, y);
    for (unsigned k = 1u; k < 4u; k++) {
        const float edge = along(s->edge[k], x, y);
        least = (edge < least) ? edge : least;
    }
    return least;
}

double evsim_view_inverse_depth(const evsim_view_t *view, double x, double y)
{
    float nearest = 0.0f;
    for (unsigned i = 0u; i < view->n_surfaces; i++) {
        const evsim_view_surface_t *const s = &view->surface[i];
        const float w = along(s->inverse_depth, (float)x, (float)y);
        if ((w > nearest) && (!s->bounded || (inside(s, (float)x, (float)y) >= 0.0f))) { nearest = w; }
    }
    return (double)nearest;
}

/* Surfaces that may show in a tile. */
typedef struct {
    const evsim_view_surface_t *surface[EVSIM_SURFACES_MAX];
    unsigned n;
    bool filled; /* There is one only, and it covers the tile. */
} candidates_t;

static void cull(const evsim_view_t *view, const evsim_tile_t *tile, candidates_t *found)
{
    float low_bound = 0.0f; /* All of the tile is covered at least this near. */
    float high[EVSIM_SURFACES_MAX];
    bool full[EVSIM_SURFACES_MAX];
    unsigned n = 0u;
    found->n = 0u;
    found->filled = false;
    for (unsigned i = 0u; i < view->n_surfaces; i++) {
        const evsim_view_surface_t *const s = &view->surface[i];
        const float middle = along(s->inverse_depth, tile->x_mid, tile->y_mid);
        const float half = fabsf(s->inverse_depth[0]) * tile->x_half + fabsf(s->inverse_depth[1]) * tile->y_half;
        bool hidden = middle + half <= 0.0f;
        bool covers = middle - half > 0.0f;
        for (unsigned k = 0u; s->bounded && !hidden && (k < 4u); k++) {
            const float edge = along(s->edge[k], tile->x_mid, tile->y_mid);
            const float edge_half = fabsf(s->edge[k][0]) * tile->x_half + fabsf(s->edge[k][1]) * tile->y_half;
            hidden = edge + edge_half < 0.0f;
            covers = covers && (edge - edge_half > 0.0f);
        }
        if (hidden) { continue; }
        if (covers && (middle - half > low_bound)) { low_bound = middle - half; }
        high[n] = middle + half;
        full[n] = covers;
        found->surface[n++] = s;
    }
    for (unsigned i = 0u; i < n; i++) {
        if (high[i] < low_bound) { continue; }
        found->filled = (found->n == 0u) && full[i];
        found->surface[found->n++] = found->surface[i];
    }
}

/* Where a pixel is in the texture of a surface, in texels, and the square of its size there. */
typedef struct {
    float u;
    float v;
    float footprint2;
} place_t;

static inline place_t place(const evsim_view_surface_t *s, float x, float y, float inverse_depth, float pitch)
{
    const float z = 1.0f / ((inverse_depth > INVERSE_DEPTH_MIN) ? inverse_depth : INVERSE_DEPTH_MIN);
    const float u = along(s->u, x, y) * z;
    const float v = along(s->v, x, y) * z;
    const float scale = z * pitch;
    const float ux = (s->u[0] - u * s->inverse_depth[0]) * scale;
    const float uy = (s->u[1] - u * s->inverse_depth[1]) * scale;
    const float vx = (s->v[0] - v * s->inverse_depth[0]) * scale;
    const float vy = (s->v[1] - v * s->inverse_depth[1]) * scale;
    const float along_x = ux * ux + vx * vx;
    const float along_y = uy * uy + vy * vy;
    return (place_t){u + s->offset_u, v + s->offset_v, (along_x > along_y) ? along_x : along_y};
}

static float shade(const evsim_view_surface_t *s, float x, float y, float inverse_depth, float pitch)
{
    const place_t p = place(s, x, y, inverse_depth, pitch);
    return s->gain * evsim_texture_sample(s->texture, p.u, p.v, p.footprint2);
}

/* A row of pixels that all show the same surface: the arithmetic first, in a loop that compilers vectorize. */
static void shade_row(const evsim_view_surface_t *s, const float *restrict ray_x, const float *restrict ray_y,
                      const float *restrict pitch, unsigned n, float *restrict out)
{
    float u[EVSIM_TILE_W];
    float v[EVSIM_TILE_W];
    float footprint2[EVSIM_TILE_W];
    for (unsigned i = 0u; i < n; i++) {
        const place_t p = place(s, ray_x[i], ray_y[i], along(s->inverse_depth, ray_x[i], ray_y[i]), pitch[i]);
        u[i] = p.u;
        v[i] = p.v;
        footprint2[i] = p.footprint2;
    }
    for (unsigned i = 0u; i < n; i++) {
        out[i] = s->gain * evsim_texture_sample(s->texture, u[i], v[i], footprint2[i]);
    }
}

/* The nearest surface and the one behind it, and how much of the pixel the nearest covers. */
static float pixel(const candidates_t *in, float x, float y, float pitch, float background)
{
    const evsim_view_surface_t *first = NULL;
    const evsim_view_surface_t *second = NULL;
    float w1 = 0.0f;
    float w2 = 0.0f;
    float cover = 1.0f;
    float front;
    for (unsigned i = 0u; i < in->n; i++) {
        const evsim_view_surface_t *const s = in->surface[i];
        const float w = along(s->inverse_depth, x, y);
        float c = 1.0f;
        if (w <= w2) { continue; }
        if (s->bounded) {
            c = 0.5f + inside(s, x, y) / pitch;
            if (c <= 0.0f) { continue; }
            c = (c < 1.0f) ? c : 1.0f;
        }
        if (w > w1) {
            second = first;
            w2 = w1;
            first = s;
            w1 = w;
            cover = c;
        } else {
            second = s;
            w2 = w;
        }
    }
    if (first == NULL) { return background; }
    front = shade(first, x, y, w1, pitch);
    if (second != NULL) { /* Where two surfaces meet, the border between them is smooth too. */
        const float gx = first->inverse_depth[0] - second->inverse_depth[0];
        const float gy = first->inverse_depth[1] - second->inverse_depth[1];
        const float width2 = pitch * pitch * (gx * gx + gy * gy);
        const float lead = w1 - w2;
        if (lead * lead < 0.25f * width2) { cover *= 0.5f + lead / sqrtf(width2); }
    }
    if (cover < 1.0f) {
        const float back = (second != NULL) ? shade(second, x, y, w2, pitch) : background;
        return back + cover * (front - back);
    }
    return front;
}

void evsim_render_band(const evsim_view_t *view, const evsim_camera_t *camera, unsigned band, float *intensity)
{
    const unsigned y0 = band * EVSIM_TILE_H;
    const unsigned rows = (camera->height_px - y0 < EVSIM_TILE_H) ? camera->height_px - y0 : EVSIM_TILE_H;
    for (unsigned t = 0u; t < camera->n_tiles_x; t++) {
        const unsigned x0 = t * EVSIM_TILE_W;
        const unsigned columns = (camera->width_px - x0 < EVSIM_TILE_W) ? camera->width_px - x0 : EVSIM_TILE_W;
        candidates_t found;
        cull(view, &camera->tile[band * camera->n_tiles_x + t], &found);
        for (unsigned r = 0u; r < rows; r++) {
            const size_t from = (size_t)(y0 + r) * camera->width_px + x0;
            float *const out = intensity + (size_t)r * camera->width_px + x0;
            if (found.filled) {
                shade_row(found.surface[0], camera->ray_x + from, camera->ray_y + from, camera->pitch + from, columns,
                          out);
                continue;
            }
            for (unsigned i = 0u; i < columns; i++) {
                out[i] = pixel(&found, camera->ray_x[from + i], camera->ray_y[from + i], camera->pitch[from + i],
                               view->background);
            }
        }
    }
}
