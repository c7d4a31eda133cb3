#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Compares corners and optical flow with OpenCV's on frames of real and simulated recordings.

usage: flow.py DUMP_FLOW [--data DIR]

DUMP_FLOW is the program made from dump_flow.c; DIR, by default EVS_DATA_DIR, is where the recordings are. Prints a table;
exits 1 if a bound is exceeded, 77 if OpenCV or the recordings are missing.
"""
import argparse
import os
import subprocess
import sys
import tempfile

try:
    import cv2
    import numpy as np
except ImportError as error:
    print(f"SKIPPED: {error}; install tests/requirements.txt to compare with OpenCV")
    sys.exit(77)

# Frames between the two images of a pair: near and far.
RECORDINGS = [
    ("slider_depth", "ecd/slider_depth/images", (1, 3), 12),
    ("sim1_21", "sim/sim1_21/images", (1, 2), 12),
    ("sim3_23", "sim/sim3_23/images", (1, 2), 12),
    ("euroc_v101", "euroc_v101/cam0/data", (1, 2), 6),
]
CORNER_CELL = 16
UNTIL_CONVERGED = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.01)  # OpenCV's default

# window, stride, levels, iterations, backward Q8; OpenCV's window and levels; by how much the start misses OpenCV's
# result, None: start at the point itself, as OpenCV; bound of the median distance from OpenCV's result where both have one
# that comes back
FLOWS = [
    ("21, 3 levels", (21, 1, 3, 30, 128), (21, 3), None, 0.05),
    ("31, 2 levels", (31, 1, 2, 30, 128), (31, 2), None, 0.05),
    ("default, predicted", (25, 2, 2, 5, 128), (25, 2), (1.0, -0.8), 0.15),  # other samples: a quarter of OpenCV's
]
SAME_SHARE_MIN = 0.9  # of those, nearer than 0.5 px, in near images: in far ones many tracks of both are wrong
CELL_SHARE_MIN = 0.95  # cells with the same best corner


class Dump:
    """The library, through files."""

    def __init__(self, program, folder):
        self.program, self.folder = program, folder

    def _write(self, name, image):
        path = os.path.join(self.folder, name)
        image.tofile(path)
        return path

    def _run(self, command, images, numbers, text="", repeat=0):
        height, width = images[0].shape
        paths = [self._write(f"{i}.raw", image) for i, image in enumerate(images)]
        arguments = [self.program, command, width, height, *paths, *numbers, repeat]
        done = subprocess.run([str(a) for a in arguments], input=text, check=True, capture_output=True, text=True)
        rows = np.array([[int(v) for v in line.split()] for line in done.stdout.splitlines()], dtype=np.int64)
        return rows, float(done.stderr.split()[1]) if repeat else 0.0

    def corners(self, image, cell=CORNER_CELL, permille=10, repeat=0):
        return self._run("corners", [image], [cell, permille], repeat=repeat)

    def track(self, first, second, start, guess, window, stride, levels, iterations, backward, epsilon=3, repeat=0):
        q8 = np.round(np.column_stack([start, guess]) * 256).astype(int)
        text = "".join(" ".join(map(str, row)) + "\n" for row in q8)
        rows, ns = self._run("track", [first, second], [levels, window, stride, iterations, epsilon, backward], text,
                             repeat)
        return rows[:, :2] / 256, rows[:, 2] / 256, rows[:, 3], ns


def frames(folder, gap, n):
    names = sorted(name for name in os.listdir(folder) if name.endswith(".png"))
    at = np.linspace(0, len(names) - 1 - gap, n).astype(int)
    read = lambda i: cv2.imread(os.path.join(folder, names[i]), cv2.IMREAD_GRAYSCALE)
    return [(read(i), read(i + gap)) for i in at]


def best_per_cell(score, cell, margin):
    inside = np.full(score.shape, -np.inf)
    inside[margin:-margin, margin:-margin] = score[margin:-margin, margin:-margin]
    found = {}
    for y in range(0, score.shape[0], cell):
        for x in range(0, score.shape[1], cell):
            part = inside[y:y + cell, x:x + cell]
            dy, dx = np.unravel_index(np.argmax(part), part.shape)
            found[(x // cell, y // cell)] = (x + dx, y + dy, part[dy, dx])
    return found


def compare_corners(dump, image):
    """Cells that both have, those with the same pixel, largest relative difference of the score, and cells that only one has."""
    score = cv2.cornerMinEigenVal(image, 5, ksize=3).astype(float) * 5100.0**2
    want = {k: v for k, v in best_per_cell(score, CORNER_CELL, 3).items()}
    highest = max(v[2] for v in want.values())
    want = {k: v for k, v in want.items() if v[2] >= 0.01 * highest}
    rows, _ = dump.corners(image)
    got = {(x // CORNER_CELL, y // CORNER_CELL): (x, y, s) for x, y, s in rows}
    both = want.keys() & got.keys()
    same = sum(want[k][:2] == got[k][:2] for k in both)
    worst = max(abs(want[k][2] - got[k][2]) / highest for k in both)
    return len(both), same, worst, len(want.keys() ^ got.keys())


def opencv_track(first, second, start, window, levels):
    points = np.asarray(start, np.float32).reshape(-1, 1, 2)
    options = dict(winSize=(window, window), maxLevel=levels - 1, criteria=UNTIL_CONVERGED)
    there, ok, _ = cv2.calcOpticalFlowPyrLK(first, second, points, None, **options)
    back, ok_back, _ = cv2.calcOpticalFlowPyrLK(second, first, there, None, **options)
    returns = np.linalg.norm((back - points).reshape(-1, 2), axis=1) < 0.5
    return there.reshape(-1, 2), (ok.ravel() == 1) & (ok_back.ravel() == 1) & returns


def main():
    parser = argparse.ArgumentParser(description="Compare corners and flow with OpenCV.")
    parser.add_argument("program")
    parser.add_argument("--data", default=os.environ.get("EVS_DATA_DIR", ""))
    args = parser.parse_args()
    here = [r for r in RECORDINGS if os.path.isdir(os.path.join(args.data, r[1]))]
    if not here:
        print(f"SKIPPED: no recordings in {args.data or 'EVS_DATA_DIR'}")
        return 77
    for recording in RECORDINGS:
        if recording not in here:
            print(f"not there: {recording[1]}")
    faults = []

    def require(ok, text):
        if not ok:
            faults.append(text)

    print(f"OpenCV {cv2.__version__}; distances in px")
    with tempfile.TemporaryDirectory() as folder:
        dump = Dump(args.program, folder)
        for name, path, gaps, n in here:
            pairs = [(gap, pair) for gap in gaps for pair in frames(os.path.join(args.data, path), gap, n)]
            counts = np.array([compare_corners(dump, first) for _, (first, _) in pairs])
            share = counts[:, 1].sum() / counts[:, 0].sum()
            print(f"{name:13} corners: {counts[:, 0].sum():.0f} cells, the same pixel in {100 * share:.2f} %, "
                  f"scores within {counts[:, 2].max():.1e} of the highest, in one only {counts[:, 3].sum():.0f}")
            require(share >= CELL_SHARE_MIN, f"{name}: the same corner in {share} of the cells")
            require(counts[:, 2].max() < 1e-4, f"{name}: scores differ by {counts[:, 2].max()}")
            require(counts[:, 3].sum() <= 0.01 * counts[:, 0].sum(), f"{name}: {counts[:, 3].sum()} cells in one only")

            for title, settings, theirs, miss, bound in FLOWS:
                for gap in gaps:
                    apart, moved, n_ours, n_theirs, n_all = [], [], 0, 0, 0
                    for first, second in [pair for g, pair in pairs if g == gap]:
                        start = dump.corners(first)[0][:, :2]
                        want, want_ok = opencv_track(first, second, start, *theirs)
                        guess = start if miss is None else np.clip(want + miss, 0, np.array(first.shape[::-1]) - 1)
                        got, _, status, _ = dump.track(first, second, start, guess, *settings)
                        both = want_ok & (status == 0)
                        apart.append(np.linalg.norm(got - want, axis=1)[both])
                        moved.append(np.linalg.norm(want - start, axis=1)[both])
                        n_ours, n_theirs = n_ours + (status == 0).sum(), n_theirs + want_ok.sum()
                        n_all += len(start)
                    apart, moved = np.concatenate(apart), np.concatenate(moved)
                    median, high = np.quantile(apart, (0.5, 0.9))
                    same = np.mean(apart < 0.5)
                    print(f"{name:13} gap {gap} {title:18} moved {np.median(moved):5.2f}  apart: median {median:.4f} "
                          f"90 % {high:.3f}  within 0.5: {100 * same:.1f} %  tracked {n_ours} / {n_theirs} of {n_all}")
                    require(median <= bound, f"{name} gap {gap} {title}: median {median} px")
                    require(gap != gaps[0] or same >= SAME_SHARE_MIN, f"{name} gap {gap} {title}: {same} within 0.5 px")

    for fault in faults:
        print("FAILED:", fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
