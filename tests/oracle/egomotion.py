#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Compares `evstab egomotion` with what others minimize and estimate, on made-up flow.

usage: egomotion.py EVSTAB

1. scipy.optimize.least_squares on the same robust cost, started at the truth: the directions must be close, by the
   solver's own sigma.
2. OpenCV's essential matrix, of which nobody here chose the signs: on flow without noise the directions must agree.
Exits 1 if they do not, 77 if scipy or OpenCV is missing.
"""
import subprocess
import sys
import tempfile

try:
    import cv2
    import numpy as np
    from scipy.optimize import least_squares
except ImportError as error:
    print(f"SKIPPED: {error}; install tests/requirements.txt to compare with scipy and OpenCV")
    sys.exit(77)

F, N, FRAMES = 199.0, 300, 40
RNG = np.random.default_rng(5)


def unit(v):
    return v / np.linalg.norm(v)


def scene(noise_px, outliers):
    """Positions, flow and own direction, by projecting points before and after the camera has moved."""
    v = unit(RNG.normal(size=3))
    xy = np.column_stack([RNG.uniform(-132, 108, N), RNG.uniform(-110, 70, N)]) / F
    p = np.column_stack([xy, np.ones(N)]) * RNG.uniform(1, 5, (N, 1))
    q = p - 0.02 * v  # small: the solver's model is that of velocities
    uv = q[:, :2] / q[:, 2:] - xy
    bad = RNG.random(N) < outliers
    angle, length = RNG.uniform(0, 2 * np.pi, N), RNG.permutation(np.linalg.norm(uv, axis=1))
    uv[bad] = (length[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))[bad]
    return xy, uv + RNG.normal(size=(N, 2)) * noise_px / F, v


def solve(evstab, scenes):
    with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
        file.write("frame,x,y,u,v\n")
        for i, (xy, uv, _) in enumerate(scenes):
            file.writelines(f"{i},{a:.9f},{b:.9f},{c:.9f},{d:.9f}\n" for (a, b), (c, d) in zip(xy, uv))
        file.flush()
        out = subprocess.run([evstab, "egomotion", file.name], check=True, capture_output=True, text=True).stdout
    table = np.array([[float(c) for c in line.split(",")] for line in out.splitlines()[1:]])
    return table[:, 1:4], table[:, 4]


def residuals(v, xy, uv):
    a = xy * v[2] - v[:2]
    return (uv[:, 0] * a[:, 1] - uv[:, 1] * a[:, 0]) / np.linalg.norm(a, axis=1), (uv * a).sum(axis=1)


def minimum(xy, uv, found, start):
    """Of the same cost (Geman-McClure; vectors that point back do not count), by scipy, in the tangent plane of start."""
    r, _ = residuals(found, xy, uv)
    median = np.median(np.linalg.norm(uv, axis=1))
    s = np.clip(2.25 * np.quantile(np.abs(r), 0.25) / 0.31864, 0.02 * median, median)
    t0 = unit(np.cross(start, np.eye(3)[np.argmin(np.abs(start))]))
    t1 = np.cross(start, t0)

    def direction(d):
        return unit(start + d[0] * t0 + d[1] * t1)

    def error(d):
        r, along = residuals(direction(d), xy, uv)
        return np.where(along > 0, r, 1e3 * s) / s

    def geman_mcclure(z):
        return np.array([z / (1 + z), 1 / (1 + z) ** 2, -2 / (1 + z) ** 3])

    return direction(least_squares(error, [0.0, 0.0], loss=geman_mcclure, xtol=1e-12).x)


def angle_deg(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def opencv(xy, uv):
    """The camera's own direction from OpenCV: it gives x2 = R x1 + t, hence V = -R' t."""
    a, b = xy, xy + uv
    essential, mask = cv2.findEssentialMat(a, b, np.eye(3), cv2.RANSAC, 0.999, 1e-6)
    # the sign comes from points in front, which by default OpenCV drops beyond 50 baselines
    _, rotation, t, *_ = cv2.recoverPose(essential[:3], a, b, np.eye(3), distanceThresh=1e4, mask=mask)
    return -(rotation.T @ t).ravel()


def main():
    evstab, failed = sys.argv[1], False
    for noise, outliers in ((0.1, 0.0), (0.2, 0.3), (0.05, 0.5)):
        scenes = [scene(noise, outliers) for _ in range(FRAMES)]
        found, sigma = solve(evstab, scenes)
        apart = np.array([angle_deg(f, minimum(xy, uv, f, v)) for f, (xy, uv, v) in zip(found, scenes)]) / sigma
        bad = np.median(apart) > 0.15 or np.quantile(apart, 0.9) > 0.6
        failed |= bool(bad)
        print(f"{'FAR  ' if bad else 'ok   '} scipy, {noise} px, {100 * outliers:.0f} %: apart {np.median(apart):.3f} sigma "
              f"(median), {np.quantile(apart, 0.9):.3f} (90 %), {apart.max():.2f} (largest); sigma {np.median(sigma):.2f} deg")
    scenes = [scene(0.0, 0.0) for _ in range(FRAMES)]
    found, _ = solve(evstab, scenes)
    apart = np.array([angle_deg(f, opencv(xy, uv)) for f, (xy, uv, _) in zip(found, scenes)])
    bad = np.median(apart) > 1.0 or np.mean(apart > 5.0) > 0.1
    failed |= bool(bad)
    print(f"{'FAR  ' if bad else 'ok   '} OpenCV, no noise: apart {np.median(apart):.3f} deg (median), {apart.max():.2f} (largest)")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
