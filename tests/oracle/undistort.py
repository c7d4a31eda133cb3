#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Compares the lens models and the undistortion tables with OpenCV at every pixel of the three cameras of the paper.

usage: undistort.py DUMP_CAMERA

DUMP_CAMERA is the program made from dump_camera.c. Prints the largest and the root mean square error of each table in px,
per axis; exits 1 if one exceeds its bound, 77 if OpenCV is missing.
"""
import subprocess
import sys

try:
    import cv2
    import numpy as np
except ImportError as error:
    print(f"SKIPPED: {error}; install tests/requirements.txt to compare with OpenCV")
    sys.exit(77)

# name, model, width, height, fx fy cx cy, distortion
CAMERAS = [
    ("ECD", "pinhole", 240, 180, (199.092366542, 198.82882047, 132.192071378, 110.712660011),
     (-0.368436311798, 0.150947243557, -0.000296130534385, -0.000759431726241, 0.0)),
    ("MVSEC", "fisheye", 346, 260, (226.38018519795807, 226.15002947047415, 173.6470807871759, 133.73271487507847),
     (-0.048031442223833355, 0.011330957517194437, -0.055378166304281135, 0.021500973881459395)),
    ("VECtor", "pinhole", 640, 480, (327.32749, 327.46184, 304.97749, 235.37621),
     (-0.031982, 0.041966, -0.000507, -0.001031, 0.0)),
]
STEPS = (1, 2, 4, 8, 16, 32)

MODEL_BOUND_PX = 1e-4  # evs_camera_distort() and evs_camera_undistort() at every pixel
TABLE_BOUND_PX = {1: 1 / 16, 8: 0.15}  # where the undistorted position lies inside the image
EVERYWHERE_BOUND_PX = {1: 1 / 16}
MISROUNDED_MAX = 1e-4  # share of coordinates whose 1/16 px differs: ties that the rounded calibration tips over

# OpenCV stops after 5 iterations unless told otherwise, up to 0.4 px short of its own answer.
UNTIL_CONVERGED = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 1000, 1e-15)


def dump(program, camera, what, fraction_bits):
    _, model, width, height, k, dist = camera
    dist = list(dist) + [0.0] * (5 - len(dist))
    arguments = [program, model, width, height, *k, *dist, what]
    text = subprocess.run([str(a) for a in arguments], check=True, capture_output=True, text=True).stdout
    rows = [(np.nan, np.nan) if line == "none" else tuple(map(int, line.split())) for line in text.splitlines()]
    assert len(rows) == width * height, f"{len(rows)} lines"
    return np.array(rows, dtype=float) / 2**fraction_bits


def pixels(camera):
    x, y = np.meshgrid(np.arange(camera[2], dtype=float), np.arange(camera[3], dtype=float))
    return np.column_stack([x.ravel(), y.ravel()])


def matrix(k):
    return np.array([[k[0], 0.0, k[2]], [0.0, k[1], k[3]], [0.0, 0.0, 1.0]])


def opencv_undistort(camera):
    _, model, _, _, k, dist = camera
    points = pixels(camera).reshape(-1, 1, 2)
    if model == "fisheye":
        out = cv2.fisheye.undistortPoints(points, matrix(k), np.array(dist), None, np.eye(3), matrix(k),
                                          UNTIL_CONVERGED)
    else:
        out = cv2.undistortPointsIter(points, matrix(k), np.array(dist), np.eye(3), matrix(k), UNTIL_CONVERGED)
    return out.reshape(-1, 2)


def opencv_distort(camera):
    _, model, _, _, k, dist = camera
    rays = (pixels(camera) - np.array(k[2:])) / np.array(k[:2])
    if model == "fisheye":
        return cv2.fisheye.distortPoints(rays.reshape(-1, 1, 2), matrix(k), np.array(dist)).reshape(-1, 2)
    rays = np.column_stack([rays, np.ones(len(rays))])
    return cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix(k), np.array(dist))[0].reshape(-1, 2)


def main(program):
    faults = []

    def require(ok, text):
        if not ok:
            faults.append(text)

    print(f"OpenCV {cv2.__version__}; errors in px per axis; inside: the undistorted position lies in the image")
    for camera in CAMERAS:
        name, _, width, height = camera[:4]
        truth = opencv_undistort(camera)
        inside = ((truth >= 0) & (truth <= (width - 1, height - 1))).all(axis=1)

        for what, want in (("distort", opencv_distort(camera)), ("undistort", truth)):
            error = np.abs(dump(program, camera, what, 16) - want)
            print(f"{name:7} {what:9} max {error.max():.1e}")
            require(error.max() <= MODEL_BOUND_PX, f"{name} {what}: {error.max()} px")

        for step in STEPS:
            got = dump(program, camera, step, 4)
            error = np.abs(got - truth)
            n_none = int(np.isnan(error).any(axis=1).sum())
            worst, worst_all = error[inside].max(), error.max()
            rms = np.sqrt(np.mean(error[inside] ** 2))
            print(f"{name:7} step {step:2}   inside max {worst:.4f} rms {rms:.4f}   all max {worst_all:.4f}"
                  f"   without position {n_none}")
            require(n_none == 0, f"{name} step {step}: {n_none} pixels without a position")
            require(worst <= TABLE_BOUND_PX.get(step, np.inf), f"{name} step {step}: {worst} px inside the image")
            require(worst_all <= EVERYWHERE_BOUND_PX.get(step, np.inf), f"{name} step {step}: {worst_all} px")
            if step == 1:
                share = np.mean(np.floor(truth * 16 + 0.5) != got * 16)
                print(f"{name:7} step  1   coordinates rounded to another 1/16 px than OpenCV's: {share:.1e}")
                require(share <= MISROUNDED_MAX, f"{name}: {share} of the coordinates round differently")

    for fault in faults:
        print("FAILED:", fault)
    return 1 if faults else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
