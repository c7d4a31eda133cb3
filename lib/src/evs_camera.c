/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "evs/camera.h"

#include "evs/fixed.h"
#include "evs_wide.h"

#define ONE          EVS_WIDE_ONE_Q32
#define PX_MAX_Q32   (INT64_C(2047) << 32)  /* range of evs_point_t */
#define PX_MAX_Q16   (INT64_C(32767) << 16) /* range of evs_camera_px_t, less one */
#define RADIUS_MAX   (INT64_C(64) << 32)    /* of a pinhole ray: 89.1 degrees */
#define RADIUS_D_MAX (INT64_C(512) << 32)   /* of a distorted ray: keeps every intermediate in range */

/* The domain ends where the image of a small step shrinks to this: closer to the fold the inverse amplifies the last
 * bit of the calibration without limit. It costs a ring of the distorted image of about 1e-6 of the focal length. */
#define SLOPE_MIN  (ONE >> 10)
#define DOMAIN_MIN (ONE >> 10) /* A model that folds over within 0.06 degrees of the axis is a mistake. */
#define N_SCAN     1024        /* Steps in which the fold is looked for before it is bracketed. */
#define N_BISECT   40
#define N_RADIAL   128 /* Newton needs about 5; every second step at least halves bracket or step: 2 * 38 bits. */
#define N_NEWTON   20  /* Needs about 3. */
/* In LSB. */
#define SETTLED        (1 << 8)  /* a Newton step of 2^-24 leaves about its square: it is taken, and is the last */
#define SETTLED_RADIAL (1 << 18) /* the same, where another iteration follows */
#define ACCEPTED       256       /* residual, 6e-8, of an answer next to the fold, where rounding keeps steps longer */
#define STUCK          16        /* movement along the edge of the domain */

typedef struct {
    int64_t x; /* Normalised image coordinates, 32 fractional bits. */
    int64_t y;
} vec2_t;

typedef struct { /* Symmetric: the model is the gradient of a potential. */
    int64_t xx;
    int64_t xy;
    int64_t yy;
} jacobian_t;

static int64_t mul(int64_t a, int64_t b) { return evs_wide_mul(a, b, 32u); }

static int64_t abs64(int64_t x) { return (x < 0) ? -x : x; }

static bool within(int64_t x, int64_t limit) { return (x >= -limit) && (x <= limit); }

/* ---- The radial polynomial, shared by both models: g(t) = t (1 + c0 t^2 + c1 t^4 + c2 t^6 + c3 t^8) ---- */

static int64_t gain_of(const int64_t c[4], int64_t t2) /* g(t) / t */
{
    return ONE + mul(t2, c[0] + mul(t2, c[1] + mul(t2, c[2] + mul(t2, c[3]))));
}

static int64_t slope_of(const int64_t c[4], int64_t t2) /* g'(t) */
{
    return ONE + mul(t2, 3 * c[0] + mul(t2, 5 * c[1] + mul(t2, 7 * c[2] + mul(t2, 9 * c[3]))));
}

/* t in [0, domain] with g(t) = d, or the end of the domain when d lies beyond it. Newton inside a shrinking bracket: a
 * step that leaves it, or is not half as long as the one before, gives way to bisection, so that nothing can cycle. The
 * last step is at most `settled`; when it is Newton's, what it leaves is of the order of its square. */
static int64_t radial_inverse(const evs_camera_t *cam, int64_t d, int64_t settled)
{
    int64_t lo = 0;
    int64_t hi = cam->domain_q32;
    if (d >= cam->domain_d_q32) { return hi; }
    int64_t t = (d < hi) ? d : hi;
    int64_t last = hi;
    for (int i = 0; i < N_RADIAL; i++) {
        const int64_t t2 = mul(t, t);
        const int64_t excess = mul(t, gain_of(cam->poly_q32, t2)) - d;
        if (excess > 0) {
            hi = t;
        } else {
            lo = t;
        }
        int64_t next = t - evs_wide_div_q32(excess, slope_of(cam->poly_q32, t2));
        const bool bisect = (next < lo) || (next > hi) || (abs64(next - t) > last / 2);
        if (bisect) { next = lo + (hi - lo) / 2; }
        last = abs64(next - t);
        t = next;
        if ((last <= 1) || (!bisect && (last <= settled))) { break; }
    }
    return t;
}

/* ---- Set-up ---- */

static bool config_is_valid(const evs_camera_config_t *cfg)
{
    if ((cfg->model != EVS_CAMERA_PINHOLE) && (cfg->model != EVS_CAMERA_FISHEYE)) { return false; }
    if ((cfg->width_px < 1u) || (cfg->width_px > EVS_SENSOR_MAX_PX)) { return false; }
    if ((cfg->height_px < 1u) || (cfg->height_px > EVS_SENSOR_MAX_PX)) { return false; }
    if ((cfg->fx_q16 < EVS_CAMERA_FOCAL_MIN_Q16) || (cfg->fx_q16 > EVS_CAMERA_FOCAL_MAX_Q16)) { return false; }
    if ((cfg->fy_q16 < EVS_CAMERA_FOCAL_MIN_Q16) || (cfg->fy_q16 > EVS_CAMERA_FOCAL_MAX_Q16)) { return false; }
    if (!within(cfg->cx_q16, EVS_CAMERA_CENTRE_MAX_Q16)) { return false; }
    if (!within(cfg->cy_q16, EVS_CAMERA_CENTRE_MAX_Q16)) { return false; }
    for (unsigned i = 0u; i < EVS_CAMERA_N_DIST; i++) {
        if (!within(cfg->dist_q32[i], EVS_CAMERA_DIST_MAX_Q32)) { return false; }
    }
    return (cfg->model == EVS_CAMERA_PINHOLE) || (cfg->dist_q32[4] == 0);
}

/* The model is invertible inside radius t when its Jacobian is positive definite there: a gradient with that property
 * is one to one on a disc. The eigenvalues are g(t)/t and g'(t), moved by the tangential terms by at most 6 |p| t. */
static bool is_invertible_at(const evs_camera_t *cam, int64_t t)
{
    const int64_t t2 = mul(t, t);
    const int64_t gain = gain_of(cam->poly_q32, t2);
    const int64_t slope = slope_of(cam->poly_q32, t2);
    const int64_t least = ((gain < slope) ? gain : slope) - 6 * mul(cam->tangential_q32, t);
    return (least >= SLOPE_MIN) && (mul(t, gain) <= RADIUS_D_MAX);
}

static int64_t find_domain(const evs_camera_t *cam, int64_t limit)
{
    int64_t lo = 0;
    int64_t hi = 0;
    for (int i = 1; i <= N_SCAN; i++) {
        hi = limit / N_SCAN * i;
        if (!is_invertible_at(cam, hi)) { break; }
        lo = hi;
    }
    for (int i = 0; (i < N_BISECT) && (hi - lo > 1); i++) {
        const int64_t middle = lo + (hi - lo) / 2;
        if (is_invertible_at(cam, middle)) {
            lo = middle;
        } else {
            hi = middle;
        }
    }
    return lo;
}

/* Radius of the farthest ideal pixel that can be asked for. */
static int64_t pinhole_limit(const evs_camera_config_t *cfg)
{
    const int64_t x = evs_shl64((INT64_C(2048) << 16) + abs64(cfg->cx_q16), 16u);
    const int64_t y = evs_shl64((INT64_C(2048) << 16) + abs64(cfg->cy_q16), 16u);
    const int64_t limit = evs_wide_hypot(evs_wide_div_q32(x, evs_shl64(cfg->fx_q16, 16u)),
                                         evs_wide_div_q32(y, evs_shl64(cfg->fy_q16, 16u)));
    return (limit < RADIUS_MAX) ? limit : RADIUS_MAX;
}

evs_status_t evs_camera_init(evs_camera_t *cam, const evs_camera_config_t *cfg)
{
    if ((cam == NULL) || (cfg == NULL)) { return EVS_ERR_NULL; }
    if (!config_is_valid(cfg)) { return EVS_ERR_ARG; }

    const bool pinhole = (cfg->model == EVS_CAMERA_PINHOLE);
    const int64_t *const d = cfg->dist_q32;
    evs_camera_t fresh = {
        .cfg = *cfg,
        .poly_q32 = {d[0], d[1], pinhole ? d[4] : d[2], pinhole ? 0 : d[3]},
        .tangential_q32 = pinhole ? evs_wide_hypot(d[2], d[3]) : 0,
    };
    fresh.domain_q32 = find_domain(&fresh, pinhole ? pinhole_limit(cfg) : EVS_WIDE_PI_Q32 - 1);
    if (fresh.domain_q32 < DOMAIN_MIN) { return EVS_ERR_NUMERIC; }

    const int64_t t2 = mul(fresh.domain_q32, fresh.domain_q32);
    fresh.domain_d_q32 = mul(fresh.domain_q32, gain_of(fresh.poly_q32, t2));
    fresh.reach_q32 = fresh.domain_d_q32 + 3 * mul(fresh.tangential_q32, t2);
    *cam = fresh;
    return EVS_OK;
}

evs_camera_config_t evs_camera_config_ideal(uint16_t width_px, uint16_t height_px, int32_t focal_q16)
{
    const evs_camera_config_t cfg = {
        .model = EVS_CAMERA_PINHOLE,
        .width_px = width_px,
        .height_px = height_px,
        .fx_q16 = focal_q16,
        .fy_q16 = focal_q16,
        .cx_q16 = ((int32_t)width_px - 1) * 0x8000, /* half a pixel */
        .cy_q16 = ((int32_t)height_px - 1) * 0x8000,
    };
    return cfg;
}

int64_t evs_camera_domain_q32(const evs_camera_t *cam) { return cam->domain_q32; }

/* ---- Between pixels and normalised coordinates ---- */

/* (px - c) / f. Exact to the last bit: a lens without distortion must give each pixel back. */
static int64_t normalise_axis(int32_t px_q16, int32_t c_q16, int32_t f_q16)
{
    const int64_t from_c = (int64_t)px_q16 - c_q16;
    const int64_t whole = from_c / f_q16;
    const int64_t rest = from_c % f_q16;
    return whole * ONE + (rest * ONE) / f_q16;
}

static vec2_t normalise(const evs_camera_t *cam, evs_camera_px_t px)
{
    const vec2_t v = {normalise_axis(px.x_q16, cam->cfg.cx_q16, cam->cfg.fx_q16),
                      normalise_axis(px.y_q16, cam->cfg.cy_q16, cam->cfg.fy_q16)};
    return v;
}

static evs_status_t to_pixel(const evs_camera_t *cam, vec2_t v, evs_camera_px_t *out)
{
    const int64_t x_q16 = mul(v.x, cam->cfg.fx_q16) + cam->cfg.cx_q16;
    const int64_t y_q16 = mul(v.y, cam->cfg.fy_q16) + cam->cfg.cy_q16;
    if (!within(x_q16, PX_MAX_Q16) || !within(y_q16, PX_MAX_Q16)) { return EVS_ERR_NUMERIC; }
    out->x_q16 = (int32_t)x_q16;
    out->y_q16 = (int32_t)y_q16;
    return EVS_OK;
}

/* ---- Pinhole: Brown-Conrady ---- */

static int64_t norm2(vec2_t v) { return mul(v.x, v.x) + mul(v.y, v.y); }

/* The distorted position and, unless j is NULL, its derivative. */
static vec2_t brown(const evs_camera_t *cam, vec2_t v, jacobian_t *j)
{
    const int64_t *const c = cam->poly_q32;
    const int64_t p1 = cam->cfg.dist_q32[2];
    const int64_t p2 = cam->cfg.dist_q32[3];
    const int64_t r2 = norm2(v);
    const int64_t p2x = mul(p2, v.x);
    const int64_t p1y = mul(p1, v.y);
    const int64_t gain = gain_of(c, r2) + 2 * (p2x + p1y);
    const vec2_t d = {mul(v.x, gain) + mul(p2, r2), mul(v.y, gain) + mul(p1, r2)};
    if (j != NULL) {
        const int64_t bend = 2 * (c[0] + mul(r2, 2 * c[1] + mul(r2, 3 * c[2]))); /* twice d gain / d r2 */
        const int64_t bend_x = mul(v.x, bend);
        j->xx = gain + mul(v.x, bend_x) + 4 * p2x;
        j->xy = mul(v.y, bend_x) + 2 * (mul(p1, v.x) + mul(p2, v.y));
        j->yy = gain + mul(v.y, mul(v.y, bend)) + 4 * p1y;
    }
    return d;
}

static vec2_t newton_step(jacobian_t j, vec2_t error)
{
    const int64_t det = mul(j.xx, j.yy) - mul(j.xy, j.xy);
    if (det <= 0) { return (vec2_t){ONE, ONE}; } /* by rounding, at the very edge of the domain: any large step */
    const vec2_t step = {evs_wide_div_q32(mul(j.yy, error.x) - mul(j.xy, error.y), det),
                         evs_wide_div_q32(mul(j.xx, error.y) - mul(j.xy, error.x), det)};
    return step;
}

static evs_status_t brown_inverse(const evs_camera_t *cam, vec2_t d, vec2_t *out)
{
    const int64_t rd = evs_wide_hypot(d.x, d.y);
    if (rd > cam->reach_q32) { return EVS_ERR_NUMERIC; }

    /* Start from the radial part alone; what is left is the tangential part, a few thousandths. */
    vec2_t v = d;
    if (rd > 0) {
        const int64_t shrink = evs_wide_div_q32(radial_inverse(cam, rd, SETTLED_RADIAL), rd);
        v = (vec2_t){mul(d.x, shrink), mul(d.y, shrink)};
    }
    const int64_t domain2 = mul(cam->domain_q32, cam->domain_q32);
    int64_t residual = 0;
    for (int i = 0; i < N_NEWTON; i++) {
        jacobian_t j;
        const vec2_t there = brown(cam, v, &j);
        const vec2_t error = {d.x - there.x, d.y - there.y};
        const vec2_t step = newton_step(j, error);
        vec2_t next = {v.x + step.x, v.y + step.y};
        residual = abs64(error.x) + abs64(error.y);
        if (norm2(next) <= domain2) {
            v = next;
            if (abs64(step.x) + abs64(step.y) <= SETTLED) {
                *out = v;
                return EVS_OK;
            }
        } else { /* stay where the model can be trusted */
            const int64_t back = evs_wide_div_q32(cam->domain_q32, evs_wide_hypot(next.x, next.y));
            next = (vec2_t){mul(next.x, back), mul(next.y, back)};
            const bool stuck = (abs64(next.x - v.x) + abs64(next.y - v.y) <= STUCK);
            v = next;
            if (stuck) { break; } /* pressed against the edge: no preimage, or one on the edge itself */
        }
    }
    if (residual > ACCEPTED) { return EVS_ERR_NUMERIC; }
    *out = v;
    return EVS_OK;
}

/* ---- Fisheye: equidistant ---- */

/* Distorted coordinates of the direction at `angle` from the axis whose image lies along (x, y), r = |(x, y)|. */
static vec2_t fisheye(const evs_camera_t *cam, vec2_t v, int64_t r, int64_t angle)
{
    if (r == 0) { return v; }
    const int64_t ad = mul(angle, gain_of(cam->poly_q32, mul(angle, angle)));
    const vec2_t d = {mul(evs_wide_div_q32(v.x, r), ad), mul(evs_wide_div_q32(v.y, r), ad)};
    return d;
}

/* The angle to the axis of what is shown at distorted radius rd. */
static evs_status_t fisheye_inverse(const evs_camera_t *cam, int64_t rd, int64_t *angle)
{
    if (rd > cam->domain_d_q32) { return EVS_ERR_NUMERIC; }
    *angle = radial_inverse(cam, rd, 1);
    return EVS_OK;
}

/* ---- Public mappings ---- */

static evs_status_t distort(const evs_camera_t *cam, vec2_t v, evs_camera_px_t *out)
{
    const int64_t r = evs_wide_hypot(v.x, v.y);
    if (cam->cfg.model == EVS_CAMERA_PINHOLE) {
        return (r <= cam->domain_q32) ? to_pixel(cam, brown(cam, v, NULL), out) : EVS_ERR_NUMERIC;
    }
    const int64_t angle = evs_wide_angle_q32(r, ONE);
    return (angle <= cam->domain_q32) ? to_pixel(cam, fisheye(cam, v, r, angle), out) : EVS_ERR_NUMERIC;
}

evs_status_t evs_camera_distort(const evs_camera_t *cam, evs_camera_px_t ideal, evs_camera_px_t *out)
{
    if ((cam == NULL) || (out == NULL)) { return EVS_ERR_NULL; }
    return distort(cam, normalise(cam, ideal), out);
}

/* Normalised undistorted coordinates. */
static evs_status_t undistort(const evs_camera_t *cam, vec2_t d, vec2_t *out)
{
    if (cam->cfg.model == EVS_CAMERA_PINHOLE) { return brown_inverse(cam, d, out); }

    const int64_t rd = evs_wide_hypot(d.x, d.y);
    int64_t angle;
    if (fisheye_inverse(cam, rd, &angle) != EVS_OK) { return EVS_ERR_NUMERIC; }
    if (rd == 0) {
        *out = d;
        return EVS_OK;
    }
    int64_t s;
    int64_t c;
    evs_wide_sincos(angle, &s, &c);
    if (c <= 0) { return EVS_ERR_NUMERIC; } /* at 90 degrees and beyond there is no ideal pixel */
    /* tan(angle) / rd. rd <= 512, so the denominator fits with 50 fractional bits; the quotient then has 38. */
    const int64_t den_q50 = evs_wide_mul(c, rd, 38u);
    if (den_q50 == 0) { return EVS_ERR_NUMERIC; }
    const int64_t grow_q38 = evs_wide_div_q32(s, den_q50);
    *out = (vec2_t){evs_wide_mul(d.x, grow_q38, 38u), evs_wide_mul(d.y, grow_q38, 38u)};
    return EVS_OK;
}

/* The undistorted pixel with 32 fractional bits, so that each caller rounds once. */
static evs_status_t undistort_px_q32(const evs_camera_t *cam, evs_camera_px_t px, vec2_t *out)
{
    vec2_t v;
    if (undistort(cam, normalise(cam, px), &v) != EVS_OK) { return EVS_ERR_NUMERIC; }
    const vec2_t u = {evs_wide_mul(v.x, cam->cfg.fx_q16, 16u) + evs_shl64(cam->cfg.cx_q16, 16u),
                      evs_wide_mul(v.y, cam->cfg.fy_q16, 16u) + evs_shl64(cam->cfg.cy_q16, 16u)};
    if (!within(u.x, PX_MAX_Q32) || !within(u.y, PX_MAX_Q32)) { return EVS_ERR_NUMERIC; }
    *out = u;
    return EVS_OK;
}

evs_status_t evs_camera_undistort(const evs_camera_t *cam, evs_camera_px_t px, evs_camera_px_t *out)
{
    if ((cam == NULL) || (out == NULL)) { return EVS_ERR_NULL; }
    vec2_t u;
    if (undistort_px_q32(cam, px, &u) != EVS_OK) { return EVS_ERR_NUMERIC; }
    out->x_q16 = (int32_t)evs_shr_r64(u.x, 16u);
    out->y_q16 = (int32_t)evs_shr_r64(u.y, 16u);
    return EVS_OK;
}

evs_point_t evs_camera_undistort_point(const evs_camera_t *cam, evs_camera_px_t px)
{
    EVS_ASSERT(cam != NULL);
    vec2_t u;
    if (undistort_px_q32(cam, px, &u) != EVS_OK) { return evs_point_outside(); }
    const evs_point_t p = {(int16_t)evs_shr_r64(u.x, 28u), (int16_t)evs_shr_r64(u.y, 28u)};
    return p;
}

evs_status_t evs_camera_ray(const evs_camera_t *cam, evs_camera_px_t px, int32_t ray_q30[3])
{
    if ((cam == NULL) || (ray_q30 == NULL)) { return EVS_ERR_NULL; }
    const vec2_t d = normalise(cam, px);
    if (cam->cfg.model == EVS_CAMERA_PINHOLE) {
        vec2_t v;
        if (brown_inverse(cam, d, &v) != EVS_OK) { return EVS_ERR_NUMERIC; }
        const int64_t length = evs_wide_hypot(evs_wide_hypot(v.x, v.y), ONE);
        ray_q30[0] = (int32_t)evs_shr_r64(evs_wide_div_q32(v.x, length), 2u);
        ray_q30[1] = (int32_t)evs_shr_r64(evs_wide_div_q32(v.y, length), 2u);
        ray_q30[2] = (int32_t)evs_shr_r64(evs_wide_div_q32(ONE, length), 2u);
        return EVS_OK;
    }
    const int64_t rd = evs_wide_hypot(d.x, d.y);
    int64_t angle;
    if (fisheye_inverse(cam, rd, &angle) != EVS_OK) { return EVS_ERR_NUMERIC; }
    int64_t s;
    int64_t c;
    evs_wide_sincos(angle, &s, &c);
    /* sin(angle) / rd. rd <= 512, so it fits with 52 fractional bits; the quotient then has 36. */
    const int64_t shrink_q36 = (rd == 0) ? 0 : evs_wide_div_q32(s, evs_shl64(rd, 20u));
    ray_q30[0] = (int32_t)evs_wide_mul(d.x, shrink_q36, 38u);
    ray_q30[1] = (int32_t)evs_wide_mul(d.y, shrink_q36, 38u);
    ray_q30[2] = (int32_t)evs_shr_r64(c, 26u);
    return EVS_OK;
}

evs_status_t evs_camera_project(const evs_camera_t *cam, const int32_t ray[3], evs_camera_px_t *out)
{
    if ((cam == NULL) || (ray == NULL) || (out == NULL)) { return EVS_ERR_NULL; }
    /* 24 more digits, for the length of a short vector. */
    const vec2_t across = {evs_shl64(ray[0], 24u), evs_shl64(ray[1], 24u)};
    const int64_t along = evs_shl64(ray[2], 24u);
    if (cam->cfg.model == EVS_CAMERA_PINHOLE) {
        if (along <= 0) { return EVS_ERR_NUMERIC; }
        return distort(cam, (vec2_t){evs_wide_div_q32(across.x, along), evs_wide_div_q32(across.y, along)}, out);
    }
    const int64_t r = evs_wide_hypot(across.x, across.y);
    if ((r == 0) && (along <= 0)) { return EVS_ERR_NUMERIC; } /* no direction, or straight back: any image point */
    const int64_t angle = evs_wide_angle_q32(r, along);
    return (angle <= cam->domain_q32) ? to_pixel(cam, fisheye(cam, across, r, angle), out) : EVS_ERR_NUMERIC;
}
