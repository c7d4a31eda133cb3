/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs_undistort_kernel.h"

#include <string.h>

EVS_STATIC_ASSERT(EVS_POINT_MAX_Q4 *EVS_UNDISTORT_STEP_MAX_PX <= (uint32_t)INT32_MAX / EVS_UNDISTORT_STEP_MAX_PX / 2u,
                  "bilinear interpolation overflows 32 bits");

/* ---- Binding ---- */

/* Whether a grid has nodes without a position. The hot path looks out for them only then. */
static bool has_gaps(const evs_point_t *points, size_t n_points, uint8_t step_log2)
{
    if (step_log2 == 0u) { return false; }
    for (size_t i = 0u; i < n_points; i++) {
        if (evs_point_is_outside(points[i])) { return true; }
    }
    return false;
}

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

static evs_status_t set_table(evs_undistort_t *u, uint16_t width_px, uint16_t height_px, uint16_t step_px,
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

evs_status_t evs_undistort_bind(evs_undistort_t *u, uint16_t width_px, uint16_t height_px, uint16_t step_px,
                                const evs_point_t *points, size_t n_points)
{
    const evs_status_t status = set_table(u, width_px, height_px, step_px, points, n_points);
    if (status != EVS_OK) { return status; }
    u->has_gaps = has_gaps(points, EVS_UNDISTORT_POINTS(width_px, height_px, step_px), u->step_log2);
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
    const evs_status_t status = set_table(u, cam->cfg.width_px, cam->cfg.height_px, step_px, points, n_points);
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
    u->has_gaps = has_gaps(points, i, u->step_log2);
    return EVS_OK;
}

/* ---- The hot path ---- */

#if defined(__GNUC__)
#define LIKELY(c)     __builtin_expect((c), 1) /* keeps the common path of a loop in one piece */
#define ALWAYS_INLINE inline __attribute__((always_inline))
#else
#define LIKELY(c)     (c)
#define ALWAYS_INLINE inline
#endif

/* Interpolation works with 32 parts of a cell whatever its step: a constant number costs no register. */
#define PARTS_LOG2 5u
#define PARTS      (1u << PARTS_LOG2)

EVS_STATIC_ASSERT(PARTS == EVS_UNDISTORT_STEP_MAX_PX, "a cell of the largest step has one part per pixel");
EVS_STATIC_ASSERT((EVS_SENSOR_MAX_PX - 1u) * PARTS <= UINT16_MAX, "a coordinate in parts must fit half a word");

typedef struct { /* Where a pixel lies on a grid: the upper left node of its cell, and the parts from there. */
    uint32_t column;
    uint32_t row;
    uint32_t right;
    uint32_t bottom;
} cell_t;

/* By value: in a loop it stays in registers, whatever the outputs might alias. */
typedef struct {
    const evs_point_t *points;
    uint32_t n_nodes_x;
    uint32_t to_parts_log2; /* pixel << this = position in parts */
    bool has_gaps;
} lattice_t;

static inline lattice_t lattice_of(const evs_undistort_t *u)
{
    const lattice_t g = {u->points, u->n_nodes_x, PARTS_LOG2 - u->step_log2, u->has_gaps};
    return g;
}

#if EVS_SIMD_DSP
/* Cores with the DSP extension work on both halves of a word at once. The plain C below is what this computes. */

typedef uint32_t pixel_t; /* x in the low half, y in the high half */

typedef struct {
    pixel_t last;
    uint32_t pitch; /* 1 and the width */
} sensor_t;

static inline pixel_t pixel_at(uint32_t x_px, uint32_t y_px) { return x_px | (y_px << 16); }

static inline pixel_t pixel_of(const evs_event_t *ev)
{
    uint32_t word;
    memcpy(&word, &ev->x_px, sizeof word); /* one aligned load: x_px and y_px are neighbours */
    return word & ~((uint32_t)EVS_EVENT_POLARITY_BIT << 16);
}

static inline sensor_t sensor_of(const evs_undistort_t *u)
{
    const sensor_t s = {pixel_at(u->width_px - 1u, u->height_px - 1u), pixel_at(1u, u->width_px)};
    return s;
}

/* By how much each half exceeds the last pixel's; 0 on the sensor. */
static inline uint32_t excess(sensor_t s, pixel_t p)
{
    uint32_t beyond;
    __asm__("uqsub16 %0, %1, %2" : "=r"(beyond) : "r"(p), "r"(s.last));
    return beyond;
}

static inline uint32_t dual_mul(uint32_t a, uint32_t b) /* low * low + high * high, signed */
{
    uint32_t sum;
    __asm__("smuad %0, %1, %2" : "=r"(sum) : "r"(a), "r"(b));
    return sum;
}

static inline uint32_t index_of(sensor_t s, pixel_t p) { return dual_mul(p, s.pitch); }

static inline cell_t cell_of(pixel_t p, uint32_t to_parts_log2)
{
    const uint32_t parts = p << to_parts_log2; /* on the sensor neither half can spill into the other */
    const cell_t c = {(parts & 0xFFFFu) >> PARTS_LOG2, parts >> (16u + PARTS_LOG2), parts & (PARTS - 1u),
                      (parts >> 16) & (PARTS - 1u)};
    return c;
}

static inline uint32_t word_of(const evs_point_t *p)
{
    uint32_t word;
    memcpy(&word, p, sizeof word);
    return word;
}

static inline uint32_t low_halves(uint32_t low, uint32_t high)
{
    uint32_t word;
    __asm__("pkhbt %0, %1, %2, lsl #16" : "=r"(word) : "r"(low), "r"(high));
    return word;
}

static inline uint32_t high_halves(uint32_t low, uint32_t high)
{
    uint32_t word;
    __asm__("pkhtb %0, %2, %1, asr #16" : "=r"(word) : "r"(low), "r"(high));
    return word;
}

/* Both coordinates between two neighbours in a row, times PARTS. */
static inline void blend(const evs_point_t *pair, uint32_t left, uint32_t right, int32_t *x, int32_t *y)
{
    const uint32_t a = word_of(&pair[0]);
    const uint32_t b = word_of(&pair[1]);
    const uint32_t weights = low_halves(left, right);
    *x = (int32_t)dual_mul(low_halves(a, b), weights);
    *y = (int32_t)dual_mul(high_halves(a, b), weights);
}
#else
typedef struct {
    uint32_t x_px;
    uint32_t y_px;
} pixel_t;

typedef struct {
    uint32_t width_px;
    uint32_t height_px;
} sensor_t;

static inline pixel_t pixel_at(uint32_t x_px, uint32_t y_px)
{
    const pixel_t p = {x_px, y_px};
    return p;
}

static inline pixel_t pixel_of(const evs_event_t *ev) { return pixel_at(evs_event_x_px(*ev), evs_event_y_px(*ev)); }

static inline sensor_t sensor_of(const evs_undistort_t *u)
{
    const sensor_t s = {u->width_px, u->height_px};
    return s;
}

static inline uint32_t excess(sensor_t s, pixel_t p)
{
    return ((p.x_px < s.width_px) && (p.y_px < s.height_px)) ? 0u : 1u;
}

static inline uint32_t index_of(sensor_t s, pixel_t p) { return p.y_px * s.width_px + p.x_px; }

static inline cell_t cell_of(pixel_t p, uint32_t to_parts_log2)
{
    const uint32_t x = p.x_px << to_parts_log2;
    const uint32_t y = p.y_px << to_parts_log2;
    const cell_t c = {x >> PARTS_LOG2, y >> PARTS_LOG2, x & (PARTS - 1u), y & (PARTS - 1u)};
    return c;
}

static inline void blend(const evs_point_t *pair, uint32_t left, uint32_t right, int32_t *x, int32_t *y)
{
    *x = pair[0].x_q4 * (int32_t)left + pair[1].x_q4 * (int32_t)right;
    *y = pair[0].y_q4 * (int32_t)left + pair[1].y_q4 * (int32_t)right;
}
#endif

static inline bool is_on(sensor_t s, pixel_t p) { return excess(s, p) == 0u; }

static inline bool has_gap(const evs_point_t *upper, const evs_point_t *lower)
{
    return evs_point_is_outside(upper[0]) || evs_point_is_outside(upper[1]) || evs_point_is_outside(lower[0]) ||
           evs_point_is_outside(lower[1]);
}

/* Bilinear interpolation, rounded half up; OUTSIDE if a corner of the cell is. */
static inline evs_point_t interpolate(lattice_t g, pixel_t pixel)
{
    const cell_t cell = cell_of(pixel, g.to_parts_log2);
    const evs_point_t *const upper = g.points + (cell.row * g.n_nodes_x + cell.column);
    const evs_point_t *const lower = upper + g.n_nodes_x;
    if (g.has_gaps && has_gap(upper, lower)) { return evs_point_outside(); }

    int32_t upper_x;
    int32_t upper_y;
    int32_t lower_x;
    int32_t lower_y;
    blend(upper, PARTS - cell.right, cell.right, &upper_x, &upper_y);
    blend(lower, PARTS - cell.right, cell.right, &lower_x, &lower_y);
    const int32_t half = (int32_t)(PARTS * PARTS / 2u);
    const int32_t down = (int32_t)cell.bottom;
    const int32_t up = (int32_t)(PARTS - cell.bottom);
    const evs_point_t p = {(int16_t)((upper_x * up + lower_x * down + half) >> (2u * PARTS_LOG2)),
                           (int16_t)((upper_y * up + lower_y * down + half) >> (2u * PARTS_LOG2))};
    return p;
}

evs_point_t evs_undistort_pixel(const evs_undistort_t *u, uint16_t x_px, uint16_t y_px)
{
    EVS_ASSERT(u != NULL);
    if ((x_px >= u->width_px) || (y_px >= u->height_px)) { return evs_point_outside(); }
    return (u->step_log2 == 0u) ? u->points[(size_t)y_px * u->width_px + x_px]
                                : interpolate(lattice_of(u), pixel_at(x_px, y_px));
}

static void count_rejected(evs_undistort_t *u, size_t n)
{
    const uint32_t room = UINT32_MAX - u->n_rejected;
    u->n_rejected = (n < room) ? u->n_rejected + (uint32_t)n : UINT32_MAX;
}

/* A full table, and a full table of tiles or NULL. By value: registers, whatever the outputs might alias. */
typedef struct {
    const evs_point_t *points;
    const uint16_t *tiles;
    sensor_t sensor;
} tables_t;

static inline tables_t tables_of(const evs_undistort_t *u)
{
    const tables_t t = {u->points, u->tiles, sensor_of(u)};
    return t;
}

/* One event; false when it lies off the sensor. `tile` may be NULL. */
static ALWAYS_INLINE bool look_up(tables_t t, const evs_event_t *ev, evs_point_t *point, uint16_t *tile)
{
    const pixel_t pixel = pixel_of(ev);
    if (!LIKELY(is_on(t.sensor, pixel))) {
        *point = evs_point_outside();
        if (tile != NULL) { *tile = EVS_TILE_NONE; }
        return false;
    }
    const uint32_t at = index_of(t.sensor, pixel);
    *point = t.points[at];
    if (tile != NULL) { *tile = t.tiles[at]; }
    return true;
}

void evs_undistort_map_plain(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points, uint16_t *tiles)
{
    const tables_t t = tables_of(u);
    size_t n_off = 0u;
    if (tiles == NULL) {
        for (size_t i = 0u; i < n; i++) { n_off += look_up(t, &ev[i], &points[i], NULL) ? 0u : 1u; }
    } else {
        for (size_t i = 0u; i < n; i++) { n_off += look_up(t, &ev[i], &points[i], &tiles[i]) ? 0u : 1u; }
    }
    count_rejected(u, n_off);
}

#if EVS_SIMD_DSP && !EVS_SIMD_MVE
/* Four events with one branch: false, and nothing written, when some lie off the sensor. */
static ALWAYS_INLINE bool look_up_four(tables_t t, const evs_event_t *ev, evs_point_t *points, uint16_t *tiles)
{
    const pixel_t p0 = pixel_of(&ev[0]), p1 = pixel_of(&ev[1]), p2 = pixel_of(&ev[2]), p3 = pixel_of(&ev[3]);
    const uint32_t beyond = excess(t.sensor, p0) | excess(t.sensor, p1) | excess(t.sensor, p2) | excess(t.sensor, p3);
    if (!LIKELY(beyond == 0u)) { return false; }
    const uint32_t at0 = index_of(t.sensor, p0), at1 = index_of(t.sensor, p1);
    const uint32_t at2 = index_of(t.sensor, p2), at3 = index_of(t.sensor, p3);
    points[0] = t.points[at0];
    points[1] = t.points[at1];
    points[2] = t.points[at2];
    points[3] = t.points[at3];
    if (tiles != NULL) {
        tiles[0] = t.tiles[at0];
        tiles[1] = t.tiles[at1];
        tiles[2] = t.tiles[at2];
        tiles[3] = t.tiles[at3];
    }
    return true;
}

/* Eight events per turn of the loop; returns how many it mapped. */
static size_t map_by_eight(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points, uint16_t *tiles)
{
    const tables_t t = tables_of(u);
    const evs_event_t *const end = ev + (n & ~(size_t)7u);
    if (tiles == NULL) {
        for (; ev != end; ev += 8, points += 8) {
            if (!LIKELY(look_up_four(t, ev, points, NULL) && look_up_four(t, ev + 4, points + 4, NULL))) {
                evs_undistort_map_plain(u, ev, 8u, points, NULL);
            }
        }
    } else {
        for (; ev != end; ev += 8, points += 8, tiles += 8) {
            if (!LIKELY(look_up_four(t, ev, points, tiles) && look_up_four(t, ev + 4, points + 4, tiles + 4))) {
                evs_undistort_map_plain(u, ev, 8u, points, tiles);
            }
        }
    }
    return n & ~(size_t)7u;
}
#endif

/* A table of step 1 and, unless `tiles` is NULL, a tile table. */
static void map_exact(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points, uint16_t *tiles)
{
    size_t done = 0u;
#if EVS_SIMD_X86
    done = evs_undistort_map_sse2(u, ev, n, points, tiles);
#elif EVS_SIMD_MVE
    done = evs_undistort_map_mve(u, ev, n, points, tiles);
#elif EVS_SIMD_DSP
    done = map_by_eight(u, ev, n, points, tiles);
#endif
    if (done == n) { return; }
    evs_undistort_map_plain(u, ev + done, n - done, points + done, (tiles != NULL) ? tiles + done : NULL);
}

static void map_grid(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points)
{
    const lattice_t grid = lattice_of(u);
    const sensor_t sensor = sensor_of(u);
    size_t n_off = 0u;
    for (size_t i = 0u; i < n; i++) {
        const pixel_t pixel = pixel_of(&ev[i]);
        if (LIKELY(is_on(sensor, pixel))) {
            points[i] = interpolate(grid, pixel);
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
        map_exact(u, ev, n, points, NULL);
    } else {
        map_grid(u, ev, n, points);
    }
}

void evs_undistort_map_tiles(evs_undistort_t *u, const evs_event_t *ev, size_t n, evs_point_t *points, uint16_t *tiles)
{
    EVS_ASSERT((u != NULL) && u->has_tiles && ((n == 0u) || (tiles != NULL)));
    if ((u->step_log2 == 0u) && (u->tiles != NULL)) {
        map_exact(u, ev, n, points, tiles);
        return;
    }
    evs_undistort_map(u, ev, n, points);
    if (u->tiles == NULL) {
        const evs_tile_grid_t grid = u->grid;
        for (size_t i = 0u; i < n; i++) { tiles[i] = evs_tile_of_point(&grid, points[i]); }
        return;
    }
    const uint16_t *const table = u->tiles;
    const sensor_t sensor = sensor_of(u);
    for (size_t i = 0u; i < n; i++) {
        const pixel_t pixel = pixel_of(&ev[i]);
        tiles[i] = is_on(sensor, pixel) ? table[index_of(sensor, pixel)] : EVS_TILE_NONE;
    }
}

uint32_t evs_undistort_n_rejected(const evs_undistort_t *u)
{
    EVS_ASSERT(u != NULL);
    return u->n_rejected;
}
