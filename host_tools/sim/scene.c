/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "scene.h"

#include <stdlib.h>

#include "image_file.h"
#include "patterns.h"
#include "rng.h"

#define ROOM_HALF_M     3.0
#define ROOM_HEIGHT_M   3.0
#define ROOM_PANELS     16u
#define POSTER_FAR_M    1.8
#define SKY_FAR_M       1000.0
#define SKY_OVERLAP     1.1 /* The texture of a face reaches beyond it: no seam where it would repeat. */
#define EYE_HEIGHT_M    1.4
#define FACES           6u
#define LOG2_TEXELS_MIN 6u

/* A texture to compute, row by row. */
typedef struct {
    evsim_texture_t *texture;
    uint64_t seed;
    evsim_pattern_t pattern;
    const evsim_surface_t *face; /* Of the panorama; NULL: a plane pattern. */
} fill_t;

static void fill_row(void *context, unsigned row, unsigned thread)
{
    const fill_t *const f = context;
    const unsigned side = 1u << f->texture->log2_size;
    float *const out = f->texture->level[0] + (size_t)row * side;
    const double v = ((double)row + 0.5) / side;
    (void)thread;
    for (unsigned i = 0u; i < side; i++) {
        const double u = ((double)i + 0.5) / side;
        if (f->face == NULL) {
            out[i] = evsim_pattern_at(f->pattern, f->seed, u, v);
        } else {
            const evsim_vec_t p = evsim_add(
                f->face->centre_m, evsim_add(evsim_scale((2.0 * u - 1.0) * SKY_OVERLAP * SKY_FAR_M, f->face->u),
                                             evsim_scale((2.0 * v - 1.0) * SKY_OVERLAP * SKY_FAR_M, f->face->v)));
            const evsim_vec_t direction = evsim_unit(evsim_sub(p, evsim_vec(0.0, 0.0, EYE_HEIGHT_M)));
            out[i] = evsim_pattern_sky_at(f->seed, direction.v);
        }
    }
}

/* The smallest power of two that is no less, within what textures may have. */
static unsigned log2_texels(double wanted)
{
    unsigned k = LOG2_TEXELS_MIN;
    while ((k < EVSIM_TEXTURE_LOG2_MAX) && ((double)(1u << k) < wanted)) { k++; }
    return k;
}

static bool out_of_memory(evh_error_t *err) { return evh_fail(err, "out of memory for the textures of the scene"); }

static bool add_pattern(evsim_scene_t *scene, evsim_pool_t *pool, evsim_pattern_t pattern, uint64_t seed,
                        const evsim_surface_t *face, unsigned log2_size, evh_error_t *err)
{
    evsim_texture_t *const texture = &scene->texture[scene->n_textures];
    fill_t fill = {texture, seed, pattern, face};
    if (!evsim_texture_init(texture, log2_size)) { return out_of_memory(err); }
    evsim_pool_run(pool, fill_row, &fill, 1u << log2_size);
    evsim_texture_finish(texture);
    scene->aspect[scene->n_textures++] = 1.0;
    return true;
}

static bool add_files(evsim_scene_t *scene, const evsim_settings_t *s, unsigned log2_size, evh_error_t *err)
{
    for (size_t i = 0u; i < s->n_textures; i++) {
        evsim_texture_t *const texture = &scene->texture[scene->n_textures];
        evsim_image_t image;
        bool ok;
        if (!evsim_image_read(&image, s->texture[i], err)) { return false; }
        ok = evsim_texture_init(texture, log2_size) &&
             evsim_texture_from_image(texture, image.gray, image.width_px, image.height_px);
        free(image.gray);
        scene->aspect[scene->n_textures] = (double)image.width_px / image.height_px;
        if (texture->storage != NULL) { scene->n_textures++; }
        if (!ok) { return out_of_memory(err); }
        evsim_texture_finish(texture);
    }
    return true;
}

static bool add_textures(evsim_scene_t *scene, const evsim_settings_t *s, evsim_pool_t *pool, evh_error_t *err)
{
    const double focal_px = s->calib.fx_px;
    if (s->n_textures > 0u) { return add_files(scene, s, log2_texels(2.0 * focal_px), err); }
    switch (s->scene) {
    case EVSIM_SCENE_POSTER:
        return add_pattern(scene, pool, EVSIM_PATTERN_COLLAGE, s->seed, NULL, log2_texels(2.6 * focal_px), err);
    case EVSIM_SCENE_SHAPES:
        for (unsigned i = 0u; i < 4u; i++) {
            if (!add_pattern(scene, pool, EVSIM_PATTERN_SHAPES, s->seed + i, NULL, log2_texels(2.0 * focal_px), err)) {
                return false;
            }
        }
        return add_pattern(scene, pool, EVSIM_PATTERN_WHITE, s->seed, NULL, LOG2_TEXELS_MIN, err);
    case EVSIM_SCENE_PANORAMA:
        for (unsigned i = 0u; i < FACES; i++) {
            if (!add_pattern(scene, pool, EVSIM_PATTERN_WHITE, s->seed, &scene->surface[i], log2_texels(2.2 * focal_px),
                             err)) {
                return false;
            }
        }
        return true;
    case EVSIM_SCENE_ROOM:
    case EVSIM_SCENES:
    default:
        for (unsigned i = 0u; i < (unsigned)EVSIM_PATTERNS_ROOM; i++) {
            if (!add_pattern(scene, pool, (evsim_pattern_t)i, s->seed, NULL, log2_texels(1.2 * focal_px), err)) {
                return false;
            }
        }
        return true;
    }
}

/* The six sides of a box, the camera's height above its floor given: front, left, back, right, floor, ceiling. */
static void add_box(evsim_scene_t *scene, double half_m, double below_m, double above_m)
{
    static const double GAIN[FACES] = {1.0, 0.9, 0.8, 0.9, 0.7, 1.0};
    const double middle = 0.5 * (above_m - below_m) + EYE_HEIGHT_M;
    for (unsigned i = 0u; i < FACES; i++) {
        evsim_surface_t *const s = &scene->surface[scene->n_surfaces++];
        const double angle = 0.5 * EVSIM_PI * i;
        const double c = round(cos(angle));
        const double d = round(sin(angle));
        if (i < 4u) {
            s->centre_m = evsim_vec(half_m * c, half_m * d, middle);
            s->u = evsim_vec(d, -c, 0.0);
            s->v = evsim_vec(0.0, 0.0, -1.0);
        } else {
            s->centre_m = evsim_vec(0.0, 0.0, EYE_HEIGHT_M + ((i == 4u) ? -below_m : above_m));
            s->u = evsim_vec(1.0, 0.0, 0.0);
            s->v = evsim_vec(0.0, (i == 4u) ? -1.0 : 1.0, 0.0);
        }
        s->bounded = false;
        s->gain = GAIN[i];
    }
}

static void set_texture(const evsim_scene_t *scene, evsim_surface_t *s, unsigned texture, double tile_m)
{
    const double side = (double)(1u << scene->texture[texture].log2_size);
    s->texture = texture;
    s->texels_per_m_u = side / tile_m;
    s->texels_per_m_v = side / tile_m * scene->aspect[texture];
    s->offset_u = 0.5 * side;
    s->offset_v = 0.5 * side;
}

/* Textures in random order, each once before one comes again. */
typedef struct {
    unsigned order[EVSIM_TEXTURES_MAX];
    unsigned n;
    unsigned next;
} deck_t;

static unsigned deal(deck_t *deck, evsim_draw_t *draw, unsigned n)
{
    if (deck->next == deck->n) {
        for (unsigned i = 0u; i < n; i++) { deck->order[i] = i; }
        for (unsigned i = n; i > 1u; i--) {
            const unsigned j = evsim_draw_below(draw, i);
            const unsigned swap = deck->order[i - 1u];
            deck->order[i - 1u] = deck->order[j];
            deck->order[j] = swap;
        }
        deck->n = n;
        deck->next = 0u;
    }
    return deck->order[deck->next++];
}

/* Panels stand around the middle, where the flights are, and face it more or less. */
static void add_panel(evsim_scene_t *scene, const evsim_settings_t *settings, evsim_draw_t *draw, unsigned texture,
                      unsigned i)
{
    evsim_surface_t *const s = &scene->surface[scene->n_surfaces++];
    const double azimuth = 2.0 * EVSIM_PI * ((double)i + evsim_draw(draw, 0.0, 0.8)) / ROOM_PANELS;
    const double radius_m = evsim_draw(draw, 1.85, 2.6);
    const double yaw = azimuth + evsim_draw(draw, -25.0, 25.0) * EVSIM_PI / 180.0;
    const double tilt = evsim_draw(draw, -15.0, 15.0) * EVSIM_PI / 180.0;
    const double roll = evsim_draw(draw, -20.0, 20.0) * EVSIM_PI / 180.0;
    const evsim_vec_t outward = evsim_vec(cos(yaw) * cos(tilt), sin(yaw) * cos(tilt), sin(tilt));
    const evsim_vec_t right = evsim_unit(evsim_cross(outward, evsim_vec(0.0, 0.0, 1.0)));
    const evsim_vec_t down = evsim_cross(outward, right);
    s->centre_m = evsim_vec(radius_m * cos(azimuth), radius_m * sin(azimuth), evsim_draw(draw, 0.7, 2.2));
    s->u = evsim_add(evsim_scale(cos(roll), right), evsim_scale(sin(roll), down));
    s->v = evsim_sub(evsim_scale(cos(roll), down), evsim_scale(sin(roll), right));
    s->bounded = true;
    s->half_u_m = evsim_draw(draw, 0.25, 0.5);
    s->half_v_m = evsim_draw(draw, 0.25, 0.5);
    s->gain = evsim_draw(draw, 0.75, 1.0);
    set_texture(scene, s, texture, 1.0);
    if (settings->n_textures > 0u) { /* The whole picture, not cut. */
        s->half_v_m = s->half_u_m / scene->aspect[texture];
        set_texture(scene, s, texture, 2.0 * s->half_u_m);
    } else {
        s->offset_u = evsim_draw(draw, 0.0, 1000.0);
        s->offset_v = evsim_draw(draw, 0.0, 1000.0);
    }
}

static void build_room(evsim_scene_t *scene, const evsim_settings_t *settings)
{
    evsim_draw_t draw = {settings->seed, EVSIM_STREAM_SCENE, 0u};
    deck_t deck = {{0u}, 0u, 0u};
    add_box(scene, ROOM_HALF_M, EYE_HEIGHT_M, ROOM_HEIGHT_M - EYE_HEIGHT_M);
    for (unsigned i = 0u; i < FACES; i++) {
        set_texture(scene, &scene->surface[i], deal(&deck, &draw, scene->n_textures), 1.6);
    }
    for (unsigned i = 0u; i < ROOM_PANELS; i++) {
        add_panel(scene, settings, &draw, deal(&deck, &draw, scene->n_textures), i);
    }
}

static void build_shapes(evsim_scene_t *scene, const evsim_settings_t *settings)
{
    add_box(scene, 2.2, EYE_HEIGHT_M, ROOM_HEIGHT_M - EYE_HEIGHT_M);
    for (unsigned i = 0u; i < FACES; i++) {
        const unsigned n = scene->n_textures;
        /* With pictures by the user: on the four walls, all that there are. */
        set_texture(scene, &scene->surface[i], (settings->n_textures > 0u) ? i % n : ((i < 4u) ? i : n - 1u), 2.6);
    }
}

static void build_poster(evsim_scene_t *scene)
{
    evsim_surface_t *const s = &scene->surface[scene->n_surfaces++];
    s->centre_m = evsim_vec(POSTER_FAR_M, 0.0, EYE_HEIGHT_M);
    s->u = evsim_vec(0.0, -1.0, 0.0);
    s->v = evsim_vec(0.0, 0.0, -1.0);
    s->bounded = false;
    s->gain = 1.0;
    set_texture(scene, s, 0u, 2.6);
}

static void build_panorama(evsim_scene_t *scene, const evsim_settings_t *settings)
{
    for (unsigned i = 0u; i < FACES; i++) {
        const double tile_m = 2.0 * SKY_FAR_M * ((settings->n_textures > 0u) ? 1.0 : SKY_OVERLAP);
        set_texture(scene, &scene->surface[i], i % scene->n_textures, tile_m);
        scene->surface[i].gain = 1.0;
        scene->surface[i].texels_per_m_v = scene->surface[i].texels_per_m_u;
    }
}

bool evsim_scene_init(evsim_scene_t *scene, const evsim_settings_t *settings, evsim_pool_t *pool, evh_error_t *err)
{
    memset(scene, 0, sizeof *scene);
    scene->background = 0.5;
    /* The faces of the panorama come before their textures, which are made for them. */
    if (settings->scene == EVSIM_SCENE_PANORAMA) { add_box(scene, SKY_FAR_M, SKY_FAR_M, SKY_FAR_M); }
    if (!add_textures(scene, settings, pool, err)) { return false; }
    switch (settings->scene) {
    case EVSIM_SCENE_POSTER:
        build_poster(scene);
        break;
    case EVSIM_SCENE_SHAPES:
        build_shapes(scene, settings);
        break;
    case EVSIM_SCENE_PANORAMA:
        build_panorama(scene, settings);
        break;
    case EVSIM_SCENE_ROOM:
    case EVSIM_SCENES:
    default:
        build_room(scene, settings);
        break;
    }
    return true;
}

void evsim_scene_free(evsim_scene_t *scene)
{
    for (unsigned i = 0u; i < EVSIM_TEXTURES_MAX; i++) { evsim_texture_free(&scene->texture[i]); }
    memset(scene, 0, sizeof *scene);
}
