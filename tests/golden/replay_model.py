# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""A second implementation of what `evstab replay` does, in double precision and without a look at the library's code.

It shares the definitions (docs/modules, the headers) with the library and nothing else: numpy, no integers.
"""
import gzip
import pathlib

import numpy as np

Q4 = 16.0  # the library's positions come in sixteenths of a pixel


def read_table(path, columns=None):
    """Numbers of a text file, plain or .gz; '#' starts a comment."""
    path = pathlib.Path(path)
    if not path.exists() and path.with_name(path.name + ".gz").exists():
        path = path.with_name(path.name + ".gz")
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rt") as file:
        return np.loadtxt(file, usecols=columns, ndmin=2)


def read_csv(path, columns):
    return np.loadtxt(path, delimiter=",", usecols=columns, ndmin=2)


class Camera:
    """A pinhole camera with Brown-Conrady distortion."""

    def __init__(self, numbers, width=240, height=180):
        self.fx, self.fy, self.cx, self.cy = numbers[:4]
        self.k1, self.k2, self.p1, self.p2, self.k3 = (list(numbers[4:]) + [0.0] * 5)[:5]
        self.width, self.height = width, height

    def distort(self, x, y):
        r2 = x * x + y * y
        radial = 1 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        return (x * radial + 2 * self.p1 * x * y + self.p2 * (r2 + 2 * x * x),
                y * radial + self.p1 * (r2 + 2 * y * y) + 2 * self.p2 * x * y)

    def undistorted_pixels(self):
        """Undistorted position of every pixel, (height, width, 2), by Newton's method on numeric derivatives."""
        v, u = np.mgrid[0:self.height, 0:self.width].astype(float)
        xd, yd = (u - self.cx) / self.fx, (v - self.cy) / self.fy
        x, y = xd.copy(), yd.copy()
        h = 1e-6
        for _ in range(60):
            f, g = self.distort(x, y)
            fx, gx = [(a - b) / (2 * h) for a, b in zip(self.distort(x + h, y), self.distort(x - h, y))]
            fy, gy = [(a - b) / (2 * h) for a, b in zip(self.distort(x, y + h), self.distort(x, y - h))]
            f, g = f - xd, g - yd
            det = fx * gy - fy * gx
            x, y = x - (f * gy - g * fy) / det, y - (g * fx - f * gx) / det
        return np.dstack([x * self.fx + self.cx, y * self.fy + self.cy])

    def rotate(self, points, rotation):
        """K R K^-1 of points (n, 2); rotation is one matrix or one per point."""
        ray = np.column_stack([(points[:, 0] - self.cx) / self.fx, (points[:, 1] - self.cy) / self.fy,
                               np.ones(len(points))])
        ray = np.einsum("...ij,...j->...i", rotation, ray)
        return np.column_stack([ray[:, 0] / ray[:, 2] * self.fx + self.cx, ray[:, 1] / ray[:, 2] * self.fy + self.cy])


# --- rotations: quaternions (..., 4), w first ---------------------------------------------------------------------

def multiply(a, b):
    aw, ax, ay, az = np.moveaxis(np.asarray(a), -1, 0)
    bw, bx, by, bz = np.moveaxis(np.asarray(b), -1, 0)
    return np.stack([aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
                     aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw], axis=-1)


def conjugate(q):
    return np.asarray(q) * np.array([1.0, -1.0, -1.0, -1.0])


def exponential(r):
    angle = np.linalg.norm(r, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), r * (np.sinc(angle / (2 * np.pi)) / 2)], axis=-1)


def logarithm(q):
    q = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., :1])
    return q[..., 1:] * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)


def matrix(q):
    w, x, y, z = np.moveaxis(np.asarray(q), -1, 0)
    return np.stack([np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=-1),
                     np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=-1),
                     np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=-1)], axis=-2)


def central_rates(t, q):
    """Angular rate in the rotating frame at each sample, from its neighbours."""
    before = np.maximum(np.arange(len(t)) - 1, 0)
    after = np.minimum(np.arange(len(t)) + 1, len(t) - 1)
    return logarithm(multiply(conjugate(q[before]), q[after])) / (t[after] - t[before])[:, None]


def orientation_at(times, t, q, rate):
    """Cubic Hermite curve in the rotation vector between samples."""
    i = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    dt = (t[i + 1] - t[i])[:, None]
    s = ((times - t[i])[:, None]) / dt
    r1 = logarithm(multiply(conjugate(q[i]), q[i + 1]))
    # The rate of the rotation vector at its end differs from the body rate by the inverse right Jacobian.
    w0, w1 = rate[i] * dt, rate[i + 1] * dt
    d1 = w1 + np.cross(r1, w1) / 2 + np.cross(r1, np.cross(r1, w1)) / 12
    r = (s ** 3 - 2 * s ** 2 + s) * w0 + (3 * s ** 2 - 2 * s ** 3) * r1 + (s ** 3 - s ** 2) * d1
    return multiply(q[i], exponential(r))


# --- windows and images --------------------------------------------------------------------------------------------

def tiles_of(points, width, height, columns, rows):
    """Tile of each position, -1 off the sensor; the last column and row absorb the remainder."""
    pixel = np.floor(points + 0.5).astype(int)
    inside = (pixel >= 0).all(axis=1) & (pixel[:, 0] < width) & (pixel[:, 1] < height)
    column = np.minimum(pixel[:, 0] // (width // columns), columns - 1)
    row = np.minimum(pixel[:, 1] // (height // rows), rows - 1)
    return np.where(inside, row * columns + column, -1)


def area_windows(tiles, threshold):
    """First events of the windows, and the end: a window closes with the event that lifts a tile above the threshold."""
    first = [0]
    counts = {}
    for i, tile in enumerate(tiles.tolist()):
        if tile < 0:
            continue
        counts[tile] = counts.get(tile, 0) + 1
        if counts[tile] > threshold:
            first.append(i + 1)
            counts = {}
    if first[-1] != len(tiles):
        first.append(len(tiles))
    return np.array(first)


def sharpness(points, width=240, height=180):
    """Variance over the sensor of the image of events: nearest pixel, one count each, Gaussian of 1 px."""
    points = points[np.isfinite(points).all(axis=1)]
    pixel = np.floor(points + 0.5).astype(int)
    inside = (pixel >= 0).all(axis=1) & (pixel[:, 0] < width) & (pixel[:, 1] < height)
    image = np.zeros((height, width))
    np.add.at(image, (pixel[inside, 1], pixel[inside, 0]), 1.0)
    kernel = np.exp(-np.arange(-4, 5) ** 2 / 2.0)
    kernel /= kernel.sum()
    padded = np.pad(image, 4, mode="symmetric")
    for axis in (0, 1):
        padded = np.apply_along_axis(lambda line: np.convolve(line, kernel, "valid"), axis, padded)
    return padded.var()
