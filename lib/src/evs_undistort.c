/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/undistort.h"

EVS_STATIC_ASSERT(EVS_POINT_MAX_Q4 *EVS_UNDISTORT_STEP_MAX_PX <= (uint32_t)INT32_MAX / EVS_UNDISTORT_STEP_MAX_PX / 2u,
                  "bilinear interpolation overflows 32 bits");

/* ---- Binding ---- */

static bool step_to_log2(uint16_t step_px, uint8_t *step_log2)
{
    for (uint8_t k = 0u; (1u << k) <= EVS_UNDISTORT_STEP_MAX_PX; k++) {
        if (step_px == (1u << k)) {
            *step_log2 = k;
            return true;
        }
    }
    return false;
}

static bool is_sensor_length(uint16_t length_px) { return (length_px >= 1u) && (length_px <= EVS_SENSOR_MAX_PX); }

evs_status_t evs_undistort_bind(evs_undistort_t *u, uint16_t width_px, uint16_t height_px, uint16_t step_px,
                                const evs_point_t *points, size_t n_points)
{
    if ((u == NULL) || (points == NULL)) { return EVS_ERR_NULL; }
    uint8_t step_log2;
    if (!is_sensor_length(width_px) || !is_sensor_length(height_px) || !step_to_log2(step_px, &step_log2)) {
        return EVS_ERR_ARG;
    }
    if (n_points < EVS_UNDISTORT_POINTS(width_px, height_px, step_px)) { return EVS_ERR_SIZE; }

    *u = (evs_undistort_t){
        .points = points,
        .width_px = width_px,
        .height_px = height_px,
        .n_nodes_x = (uint16_t)EVS_UNDISTORT_NODES(width_px, step_px),
        .step_log2 = step_log2,
    };
    return EVS_OK;
}

static evs_status_t check_tiles(const evs_undistort_t *u, const evs_tile_grid_t *grid, size_t n_tiles)
{
    if ((grid->width_px != u->width_px) || (grid->height_px != u->height_px)) { return EVS_ERR_ARG; }
    return (n_tiles < EVS_UNDISTORT_TILES(u->width_px, u->height_px)) ? EVS_ERR_SIZE : EVS_OK;
}

static void set_tiles(evs_undistort_t *u, const evs_tile_grid_t *grid, const uint16_t *tiles)
{
    u->grid = *grid;
    u->tiles = tiles;
    u->has_tiles = true;
}

evs_status_t evs_undistort_bind_tiles(evs_undistort_t *u, const evs_tile_grid_t *grid, const uint16_t *tiles,
                                      size_t n_tiles)
{
    if ((u == NULL) || (grid == NULL) || ((tiles == NULL) && (n_tiles != 0u))) { return EVS_ERR_NULL; }
    const evs_status_t status = check_tiles(u, grid, n_tiles);
    if ((status != EVS_OK) && !((status == EVS_ERR_SIZE) && (tiles == NULL))) { return status; }
    set_tiles(u, grid, tiles);
    return EVS_OK;
}

evs_status_t evs_undistort_build_tiles(evs_undistort_t *u, const evs_tile_grid_t *grid, uint16_t *tiles, size_t n_tiles)
{
    if ((u == NULL) || (grid == NULL) || (tiles == NULL)) { return EVS_ERR_NULL; }
    const evs_status_t status = check_tiles(u, grid, n_tiles);
    if (status != EVS_OK) { return status; }

    size_t i = 0u;
    for (uint16_t y = 0u; y < u->height_px; y++) {
        for (uint16_t x = 0u; x < u->width_px; x++) {
            tiles[i++] = evs_tile_of_point(grid, evs_undistort_pixel(u, x, y));
        }
    }
    set_tiles(u, grid, tiles);
    return EVS_OK;
}

/* ---- Building ---- */

typedef struct { /* A position with 16 fractional bits, in 64 so that it can be extrapolated. */
    int64_t x_q16;
    int64_t y_q16;
    bool exists;
} position_t;

static position_t position_of(const evs_camera_t *cam, int32_t x_px, int32_t y_px)
{
    const evs_camera_px_t px = {x_px * 0x10000, y_px * 0x10000};
    evs_camera_px_t ideal = {0, 0};
    const bool exists = (evs_camera_undistort(cam, px, &ideal) == EVS_OK);
    const position_t p = {ideal.x_q16, ideal.y_q16, exists};
    return p;
}

/* a + (b - a) * num / den */
static position_t extrapolate(position_t a, position_t b, int32_t num, int32_t den)
{
    const position_t p = {a.x_q16 + (b.x_q16 - a.x_q16) * num / den, a.y_q16 + (b.y_q16 - a.y_q16) * num / den,
                          a.exists && b.exists};
    return p;
}

/* Move *p against the curvature of the lens across a cell, from its neighbours one step to either side.
 * Straight lines between points of a curve all err to one side, by up to h^2 f'' / 8. With every node moved by half of
 * that the error is halved, and it costs nothing per event. */
static void centre_error(position_t *p, position_t before, position_t after)
{
    if (!before.exists || !after.exists) { return; }
    p->x_q16 -= (before.x_q16 + after.x_q16 - 2 * p->x_q16) / 16;
    p->y_q16 -= (before.y_q16 + after.y_q16 - 2 * p->y_q16) / 16;
}

static position_t centred(const evs_camera_t *cam, int32_t x_px, int32_t y_px, int32_t step_px)
{
    const position_t exact = position_of(cam, x_px, y_px);
    position_t p = exact;
    if (!exact.exists) { return p; }
    position_t bend_x = exact;
    position_t bend_y = exact;
    centre_error(&bend_x, position_of(cam, x_px - step_px, y_px), position_of(cam, x_px + step_px, y_px));
    centre_error(&bend_y, position_of(cam, x_px, y_px - step_px), position_of(cam, x_px, y_px + step_px));
    p.x_q16 = bend_x.x_q16 + bend_y.x_q16 - exact.x_q16;
    p.y_q16 = bend_x.y_q16 + bend_y.y_q16 - exact.y_q16;
    return p;
}

/* A node along one axis. One that lies behind the last pixel is drawn through its predecessor and the last pixel: the
 * lens need not be invertible off the sensor, and the pixels in between are then as good as any. */
typedef struct {
    int32_t first_px;
    int32_t second_px;
    int32_t num; /* node = first + (second - first) * num / den; num = 0: the node is first */
    int32_t den;
} node_t;

static node_t node_at(size_t index, uint16_t step_px, uint16_t length_px)
{
    const int32_t at_px = (int32_t)(index * step_px);
    const int32_t last_px = (int32_t)length_px - 1;
    if (at_px <= last_px) { return (node_t){at_px, at_px, 0, 1}; }
    const int32_t before_px = at_px - step_px;
    if (before_px == last_px) { return (node_t){last_px, last_px, 0, 1}; } /* its weight is always 0 */
    return (node_t){before_px, last_px, step_px, last_px - before_px};
}

static position_t node_on_row(const evs_camera_t *cam, node_t nx, int32_t y_px, int32_t step_px)
{
    const position_t first = centred(cam, nx.first_px, y_px, step_px);
    return (nx.num == 0) ? first : extrapolate(first, centred(cam, nx.second_px, y_px, step_px), nx.num, nx.den);
}

static evs_point_t grid_point(const evs_camera_t *cam, node_t nx, node_t ny, int32_t step_px)
{
    position_t p = node_on_row(cam, nx, ny.first_px, step_px);
    if (ny.num != 0) { p = extrapolate(p, node_on_row(cam, nx, ny.second_px, step_px), ny.num, ny.den); }

    const int64_t x_q4 = (p.x_q16 + 0x800) >> 12;
    const int64_t y_q4 = (p.y_q16 + 0x800) >> 12;
    const bool fits = (x_q4 >= -EVS_POINT_MAX_Q4) && (x_q4 <= EVS_POINT_MAX_Q4) && (y_q4 >= -EVS_POINT_MAX_Q4) &&
                      (y_q4 <= EVS_POINT_MAX_Q4);
    if (!p.exists || !fits) { return evs_point_outside(); }
    return (evs_point_t){(int16_t)x_q4, (int16_t)y_q4};
}

evs_status_t evs_undistort_build(evs_undistort_t *u, const evs_camera_t *cam, uint16_t step_px, evs_point_t *points,
                                 size_t n_points)
{
    if (cam == NULL) { return EVS_ERR_NULL; }
    const evs_status_t status = evs_undistort_bind(u, cam->cfg.width_px, cam->cfg.height_px, step_px, points, n_points);
    if (status != EVS_OK) { return status; }

    const size_t n_rows = EVS_UNDISTORT_NODES(cam->cfg.height_px, step_px);
    size_t i = 0u;
    for (size_t row = 0u; row < n_rows; row++) {
        for (size_t col = 0u; col < u->n_nodes_x; col++) {
            if (step_px == 1u) {
                points[i] =
                    evs_camera_undistort_point(cam, (evs_camera_px_t){(int32_t)(col << 16), (int32_t)(row << 16)});
            } else {
                points[i] = grid_point(cam, node_at(col, step_px, cam->cfg.width_px),
                                       node_at(row, step_px, cam->cfg.height_px), step_px);
            }
            i++;
        }
    }
    return EVS_OK;
}

/* ---- The hot path ---- */

static bool is_on_sensor(const evs_undistort_t *u, uint32_t x_px, uint32_t y_px)
{
    return (x_px < u->width_px) && (y_px < u->height_px);
}

/* Bilinear interpolation, rounded half up; OUTSIDE if a corner of the cell is. */
static evs_point_t interpolate(const evs_undistort_t *u, uint32_t x_px, uint32_t y_px)
{
    const uint32_t k = u->step_log2;
    const int32_t step = (int32_t)(1u << k);
    const int32_t fx = (int32_t)(x_px & ((1u << k) - 1u));
    const int32_t fy = (int32_t)(y_px & ((1u << k) - 1u));
    const evs_point_t *const upper = u->points + (size_t)(y_px >> k) * u->n_nodes_x + (x_px >> k);
    const evs_point_t *const lower = upper + u->n_nodes_x;
    const evs_point_t a = upper[0];
    const evs_point_t b = upper[1];
    const evs_point_t c = lower[0];
    const evs_point_t d = lower[1];
    if (evs_point_is_outside(a) || evs_point_is_outside(b) || evs_point_is_outside(c) || evs_point_is_outside(d)) {
        return evs_point_outside();
    }
    const int32_t top_x = a.x_q4 * step + (b.x_q4 - a.x_q4) * fx;
    const int32_t top_y = a.y_q4 * step + (b.y_q4 - a.y_q4) * fx;
    const int32_t bottom_x = c.x_q4 * step + (d.x_q4 - c.x_q4) * fx;
    const int32_t bottom_y = c.y_q4 * step + (d.y_q4 - c.y_q4) * fx;
    const int32_t half = step * step / 2;
    const evs_point_t p = {(int16_t)((top_x * step + (bottom_x - top_x) * fy + half) >> (2u * k)),
                           (int16_t)((top_y * step + (bottom_y - top_y) * fy + half) >> (2u * k))};
    return p;
}

evs_point_t evs_undistort_pixel(const evs_undistort_t *u, uint16_t x_px, uint16_t y_px)
{
    EVS_ASSERT(u != NULL);
    if (!is_on_sensor(u, x_px, y_px)) { return evs_point_outside(); }
    return (u->step_log2 == 0u) ? u->points[(size_t)y_px * u->width_px + x_px] : interpolate(u, x_px, y_px);
}

static void count_rejected(evs_undistort_t *u, size_t n)
{
    const uint32_t room = UINT32_MAX - u->n_rejected;
    u->n_rejected = (n < room) ? u->n_rejected + (uint32_t)n : UINT32_MAX;
}

static void map_exact(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points)
{
    const evs_point_t *const table = u->points;
    const uint32_t width_px = u->width_px;
    const uint32_t height_px = u->height_px;
    size_t n_off = 0u;
    for (size_t i = 0u; i < n; i++) {
        const uint32_t x_px = evs_event_x_px(ev[i]);
        const uint32_t y_px = evs_event_y_px(ev[i]);
        if ((x_px < width_px) && (y_px < height_px)) {
            points[i] = table[y_px * width_px + x_px];
        } else {
            points[i] = evs_point_outside();
            n_off++;
        }
    }
    count_rejected(u, n_off);
}

static void map_exact_tiles(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points, uint16_t *tiles)
{
    const evs_point_t *const point_table = u->points;
    const uint16_t *const tile_table = u->tiles;
    const uint32_t width_px = u->width_px;
    const uint32_t height_px = u->height_px;
    size_t n_off = 0u;
    for (size_t i = 0u; i < n; i++) {
        const uint32_t x_px = evs_event_x_px(ev[i]);
        const uint32_t y_px = evs_event_y_px(ev[i]);
        if ((x_px < width_px) && (y_px < height_px)) {
            const uint32_t at = y_px * width_px + x_px;
            points[i] = point_table[at];
            tiles[i] = tile_table[at];
        } else {
            points[i] = evs_point_outside();
            tiles[i] = EVS_TILE_NONE;
            n_off++;
        }
    }
    count_rejected(u, n_off);
}

static void map_grid(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points)
{
    size_t n_off = 0u;
    for (size_t i = 0u; i < n; i++) {
        const uint32_t x_px = evs_event_x_px(ev[i]);
        const uint32_t y_px = evs_event_y_px(ev[i]);
        if (is_on_sensor(u, x_px, y_px)) {
            points[i] = interpolate(u, x_px, y_px);
        } else {
            points[i] = evs_point_outside();
            n_off++;
        }
    }
    count_rejected(u, n_off);
}

void evs_undistort_map(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points)
{
    EVS_ASSERT((u != NULL) && ((n == 0u) || ((ev != NULL) && (points != NULL))));
    if (u->step_log2 == 0u) {
        map_exact(u, ev, n, points);
    } else {
        map_grid(u, ev, n, points);
    }
}

void evs_undistort_map_tiles(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points, uint16_t *tiles)
{
    EVS_ASSERT((u != NULL) && u->has_tiles && ((n == 0u) || (tiles != NULL)));
    if ((u->step_log2 == 0u) && (u->tiles != NULL)) {
        map_exact_tiles(u, ev, n, points, tiles);
        return;
    }
    evs_undistort_map(u, ev, n, points);
    const evs_tile_grid_t grid = u->grid; /* a copy the compiler may keep in registers: `tiles` cannot alias it */
    for (size_t i = 0u; i < n; i++) {
        if (u->tiles == NULL) {
            tiles[i] = evs_tile_of_point(&grid, points[i]);
        } else {
            const uint32_t at = (uint32_t)evs_event_y_px(ev[i]) * u->width_px + evs_event_x_px(ev[i]);
            tiles[i] = is_on_sensor(u, evs_event_x_px(ev[i]), evs_event_y_px(ev[i])) ? u->tiles[at] : EVS_TILE_NONE;
        }
    }
}

uint32_t evs_undistort_n_rejected(const evs_undistort_t *u)
{
    EVS_ASSERT(u != NULL);
    return u->n_rejected;
}
