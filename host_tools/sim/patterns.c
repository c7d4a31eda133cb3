/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "patterns.h"

#include <math.h>
#include <stdbool.h>

#include "linalg.h"
#include "rng.h"

static double chance(uint64_t seed, uint64_t index, uint64_t n)
{
    return evsim_uniform(seed, EVSIM_STREAM_PATTERN, index, n);
}

static double between(double low, double high, double part) { return low + (high - low) * part; }

static double clamp01(double x) { return fmin(fmax(x, 0.0), 1.0); }

static double smooth(double x) { return x * x * (3.0 - 2.0 * x); }

/* 0 below low, 1 above high. */
static double step_between(double low, double high, double x) { return smooth(clamp01((x - low) / (high - low))); }

static unsigned wrap(int i, int period)
{
    const int r = i % period;
    return (unsigned)((r < 0) ? r + period : r);
}

/* Smooth noise in 0..1 whose lattice repeats after (nu, nv) cells. */
static double noise(uint64_t seed, uint64_t layer, double u, double v, int nu, int nv)
{
    const double x = u * nu;
    const double y = v * nv;
    const int ix = (int)floor(x);
    const int iy = (int)floor(y);
    const double fx = smooth(x - ix);
    const double fy = smooth(y - iy);
    double corner[2][2];
    for (int j = 0; j < 2; j++) {
        for (int i = 0; i < 2; i++) {
            corner[j][i] = chance(seed, layer, ((uint64_t)wrap(iy + j, nv) << 32) | wrap(ix + i, nu));
        }
    }
    return between(between(corner[0][0], corner[0][1], fx), between(corner[1][0], corner[1][1], fx), fy);
}

static double noise_octaves(uint64_t seed, uint64_t layer, double u, double v, int n, int octaves)
{
    double sum = 0.0;
    double weight = 0.5;
    double total = 0.0;
    for (int k = 0; k < octaves; k++) {
        sum += weight * noise(seed, layer + (uint64_t)k, u, v, n << k, n << k);
        total += weight;
        weight *= 0.55;
    }
    return sum / total;
}

static double stones(uint64_t seed, double u, double v)
{
    enum { N = 7 };
    const double x = u * N;
    const double y = v * N;
    double near1 = 9.0;
    double near2 = 9.0;
    uint64_t id = 0u;
    for (int j = -1; j <= 1; j++) {
        for (int i = -1; i <= 1; i++) {
            const int cx = (int)floor(x) + i;
            const int cy = (int)floor(y) + j;
            const uint64_t cell = (uint64_t)wrap(cy, N) * N + wrap(cx, N);
            const double d = hypot(cx + chance(seed, 1u, cell) - x, cy + chance(seed, 2u, cell) - y);
            if (d < near1) {
                near2 = near1;
                near1 = d;
                id = cell;
            } else if (d < near2) {
                near2 = d;
            }
        }
    }
    {
        const double stone =
            between(0.2, 0.8, chance(seed, 3u, id)) * between(0.7, 1.15, noise_octaves(seed, 10u, u, v, 16, 3));
        return between(0.12, stone, step_between(0.02, 0.07, near2 - near1));
    }
}

static double bricks(uint64_t seed, double u, double v)
{
    enum { ROWS = 8, COLUMNS = 3 };
    const double y = v * ROWS;
    const int row = (int)floor(y);
    const double x = u * COLUMNS + ((row & 1) ? 0.5 : 0.0);
    const int column = (int)floor(x);
    const double dx = fmin(x - column, column + 1.0 - x) / COLUMNS;
    const double dy = fmin(y - row, row + 1.0 - y) / ROWS;
    const uint64_t id = (uint64_t)wrap(row, ROWS) * COLUMNS + wrap(column, COLUMNS);
    const double brick =
        between(0.24, 0.48, chance(seed, 1u, id)) * between(0.75, 1.2, noise_octaves(seed, 10u, u, v, 24, 3));
    return between(0.58, brick, step_between(0.004, 0.009, fmin(dx, dy)));
}

static double clouds(uint64_t seed, double u, double v)
{
    return between(0.15, 0.85, step_between(0.2, 0.8, noise_octaves(seed, 1u, u, v, 4, 4)));
}

static double tiles(uint64_t seed, double u, double v)
{
    enum { N = 8 };
    const int i = (int)floor(u * N);
    const int j = (int)floor(v * N);
    const double dx = fmin(u * N - i, i + 1.0 - u * N);
    const double dy = fmin(v * N - j, j + 1.0 - v * N);
    const uint64_t id = (uint64_t)wrap(j, N) * N + wrap(i, N);
    const double base =
        (((i + j) & 1) != 0) ? between(0.5, 0.8, chance(seed, 1u, id)) : between(0.15, 0.4, chance(seed, 1u, id));
    const double tile = base * between(0.85, 1.1, noise_octaves(seed, 10u, u, v, 20, 2));
    return between(0.3, tile, step_between(0.02, 0.06, fmin(dx, dy)));
}

/* Distance on the circle of length 1. */
static double around(double a, double b) { return (a - b) - floor(a - b + 0.5); }

/* Signed distance to a regular polygon of circumradius 1, or to a star where inner < 1. */
static double polygon(double x, double y, int corners, double inner)
{
    const double sector = EVSIM_PI / corners;
    double angle = fmod(fabs(atan2(y, x)), 2.0 * sector);
    const double radius = hypot(x, y);
    double px;
    double py;
    double nx;
    double ny;
    if (angle > sector) { angle = 2.0 * sector - angle; }
    px = radius * cos(angle) - 1.0; /* From the outer corner... */
    py = radius * sin(angle);
    nx = inner * cos(sector) - 1.0; /* ...along the edge to the inner one. */
    ny = inner * sin(sector);
    return (px * ny - py * nx) / hypot(nx, ny);
}

static double polygon_inner(int corners) { return cos(EVSIM_PI / corners); }

/* A shape of about unit size: negative inside. */
static double shape(uint64_t kind, double x, double y)
{
    switch (kind % 6u) {
    case 0u:
        return hypot(x, y) - 0.85;
    case 1u:
        return polygon(x, y, 3, polygon_inner(3));
    case 2u:
        return polygon(x, y, 4, polygon_inner(4));
    case 3u:
        return polygon(x, y, 5, 0.42);
    case 4u:
        return polygon(x, y, 6, polygon_inner(6));
    default:
        return fmax(fabs(x) - 1.0, fabs(y) - 0.4);
    }
}

static double collage(uint64_t seed, double u, double v)
{
    enum { N = 60 };
    double value = 0.5;
    for (uint64_t i = 0u; i < N; i++) {
        const double size = between(0.04, 0.2, chance(seed, i, 2u)) * ((i < 12u) ? 1.8 : 1.0);
        const double dx = around(u, chance(seed, i, 0u)) / size;
        const double dy = (fabs(dx) < 1.1) ? around(v, chance(seed, i, 1u)) / size : 2.0;
        double turn;
        if (fabs(dy) > 1.1) { continue; }
        turn = 2.0 * EVSIM_PI * chance(seed, i, 3u);
        if (shape(evsim_bits(seed, EVSIM_STREAM_PATTERN, i, 4u), dx * cos(turn) + dy * sin(turn),
                  dy * cos(turn) - dx * sin(turn)) < 0.0) {
            value = between(0.1, 0.9, chance(seed, i, 5u));
        }
    }
    return value * between(0.8, 1.05, noise_octaves(seed, 100u, u, v, 24, 3));
}

static double planks(uint64_t seed, double u, double v)
{
    enum { N = 7 };
    const double x = u * N;
    const int i = (int)floor(x);
    const uint64_t id = wrap(i, N);
    const double end = around(v, chance(seed, 2u, id)); /* Where one plank ends and the next begins. */
    const double edge = fmin(fmin(x - i, i + 1.0 - x) / N, fabs(end));
    const double grain = 0.6 * noise(seed, 20u + id, u, v, 90, 5) + 0.4 * noise(seed, 40u + id, u, v, 180, 12);
    const double wood = between(0.25, 0.7, chance(seed, (end < 0.0) ? 1u : 3u, id)) * between(0.7, 1.15, grain);
    return between(0.1, wood, step_between(0.002, 0.006, edge));
}

/* Lines of glyph-like 5x7 blocks, some lines larger, some left out. */
static double print(uint64_t seed, double u, double v)
{
    enum { LINES = 10 };
    const double y = v * LINES;
    const uint64_t line = wrap((int)floor(y), LINES);
    const bool large = (line % 5u) == 0u;
    const double in_line = (y - floor(y)) / (large ? 0.9 : 0.65);
    const int glyphs = large ? 12 : 20;
    const double x = u * glyphs;
    const uint64_t glyph = wrap((int)floor(x), glyphs);
    const double in_glyph = (x - floor(x)) / 0.8;
    const double paper = between(0.82, 0.93, noise(seed, 9u, u, v, 6, 6));
    if ((in_line > 1.0) || (in_glyph > 1.0) || (chance(seed, 100u + line, 1000u + glyph) < 0.18)) { return paper; }
    return (chance(seed, 200u + line * 64u + glyph, (uint64_t)(in_line * 7.0) * 5u + (uint64_t)(in_glyph * 5.0)) < 0.5)
               ? 0.12
               : paper;
}

static double spots(uint64_t seed, double u, double v)
{
    const double coarse = noise_octaves(seed, 1u, u, v, 6, 2);
    const double fine = noise_octaves(seed, 10u, u, v, 11, 2);
    const double base = between(0.2, 0.6, step_between(0.48, 0.5, coarse));
    return between(base, (coarse > 0.55) ? 0.1 : 0.85, step_between(0.64, 0.66, fine)) *
           between(0.9, 1.05, noise(seed, 20u, u, v, 60, 60));
}

static double shapes(uint64_t seed, double u, double v)
{
    enum { N = 3 };
    const int i = (int)floor(u * N);
    const int j = (int)floor(v * N);
    const uint64_t id = (uint64_t)wrap(j, N) * N + wrap(i, N);
    const double size = between(0.2, 0.34, chance(seed, 1u, id));
    const double room = 0.5 - size;
    const double x = u * N - i - 0.5 - between(-room, room, chance(seed, 2u, id));
    const double y = v * N - j - 0.5 - between(-room, room, chance(seed, 3u, id));
    const double turn = 2.0 * EVSIM_PI * chance(seed, 4u, id);
    const double d = size * shape(id + evsim_bits(seed, EVSIM_STREAM_PATTERN, 5u, 0u) % 6u,
                                  (x * cos(turn) + y * sin(turn)) / size, (y * cos(turn) - x * sin(turn)) / size);
    return between(between(0.04, 0.2, chance(seed, 6u, id)), 0.9, step_between(-0.003, 0.003, d));
}

float evsim_pattern_at(evsim_pattern_t pattern, uint64_t seed, double u, double v)
{
    double value = 0.9;
    switch (pattern) {
    case EVSIM_PATTERN_STONES:
        value = stones(seed, u, v);
        break;
    case EVSIM_PATTERN_BRICKS:
        value = bricks(seed, u, v);
        break;
    case EVSIM_PATTERN_CLOUDS:
        value = clouds(seed, u, v);
        break;
    case EVSIM_PATTERN_TILES:
        value = tiles(seed, u, v);
        break;
    case EVSIM_PATTERN_COLLAGE:
        value = collage(seed, u, v);
        break;
    case EVSIM_PATTERN_PLANKS:
        value = planks(seed, u, v);
        break;
    case EVSIM_PATTERN_PRINT:
        value = print(seed, u, v);
        break;
    case EVSIM_PATTERN_SPOTS:
        value = spots(seed, u, v);
        break;
    case EVSIM_PATTERN_SHAPES:
        value = shapes(seed, u, v);
        break;
    case EVSIM_PATTERN_WHITE:
    default:
        break;
    }
    return (float)clamp01(value);
}

/* Cells of a jittered lattice in space, cut by the sphere: patches with straight borders, as fields seen from above. */
static double sky_cells(uint64_t seed, const double d[3], double density, double *border)
{
    /* The own cell first, then those at a face, an edge, a corner: most of the later ones are too far to matter. */
    static const signed char ORDER[27][3] = {
        {0, 0, 0},   {-1, 0, 0},  {1, 0, 0},   {0, -1, 0}, {0, 1, 0},   {0, 0, -1},   {0, 0, 1},
        {-1, -1, 0}, {-1, 1, 0},  {1, -1, 0},  {1, 1, 0},  {-1, 0, -1}, {-1, 0, 1},   {1, 0, -1},
        {1, 0, 1},   {0, -1, -1}, {0, -1, 1},  {0, 1, -1}, {0, 1, 1},   {-1, -1, -1}, {-1, -1, 1},
        {-1, 1, -1}, {-1, 1, 1},  {1, -1, -1}, {1, -1, 1}, {1, 1, -1},  {1, 1, 1}};
    double near1 = 99.0; /* Squares. */
    double near2 = 99.0;
    double value = 0.0;
    int base[3];
    double part[3];
    for (int i = 0; i < 3; i++) {
        base[i] = (int)floor(d[i] * density);
        part[i] = d[i] * density - base[i];
    }
    for (int k = 0; k < 27; k++) {
        double at_least = 0.0;
        double distance = 0.0;
        uint64_t id = 0u;
        uint64_t bits;
        for (int i = 0; i < 3; i++) {
            const double gap = (ORDER[k][i] < 0) ? part[i] : ((ORDER[k][i] > 0) ? 1.0 - part[i] : 0.0);
            at_least += gap * gap;
            id = (id << 20) | (unsigned)(base[i] + ORDER[k][i] + 512);
        }
        if (at_least >= near2) { continue; }
        bits = evsim_bits(seed, EVSIM_STREAM_PATTERN, id, 0u); /* 16 for each of x, y, z and the value. */
        for (int i = 0; i < 3; i++) {
            const double delta = ORDER[k][i] + (double)((bits >> (16 * i)) & 0xFFFFu) / 65536.0 - part[i];
            distance += delta * delta;
        }
        if (distance < near1) {
            near2 = near1;
            near1 = distance;
            value = (double)(bits >> 48) / 65536.0;
        } else if (distance < near2) {
            near2 = distance;
        }
    }
    *border = sqrt(near2) - sqrt(near1);
    return value;
}

float evsim_pattern_sky_at(uint64_t seed, const double direction[3])
{
    double border;
    double fine_border;
    const double patch = sky_cells(seed, direction, 4.0, &border);
    const double fine = sky_cells(seed + 1u, direction, 14.0, &fine_border);
    double value = between(0.15, 0.8, patch) * between(0.7, 1.15, fine);
    value *= between(0.4, 1.0, step_between(0.01, 0.05, border));
    if (fine > 0.93) { value = between(value, 0.95, step_between(0.05, 0.1, fine_border)); }
    return (float)clamp01(value);
}
