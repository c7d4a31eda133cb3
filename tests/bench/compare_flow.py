#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Compare corners and optical flow with OpenCV's in one run, on one thread; write a section of docs/performance.md.

usage: compare_flow.py DUMP_FLOW [--data DIR] [--write]

DUMP_FLOW is the program made from tests/oracle/dump_flow.c. Needs numpy and OpenCV (tests/requirements.txt); the images are
those of EVS_DATA_DIR. Without --write it only prints. Times are medians, the programs take turns; run it on a quiet machine.
"""
import argparse
import os
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

ROOT = os.path.normpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "tests", "support"))
sys.path.insert(0, os.path.join(ROOT, "tests", "oracle"))
from cross_tree import replace_section  # noqa: E402
from flow import UNTIL_CONVERGED, Dump, frames  # noqa: E402

N_POINTS = 500
ROUNDS = 7
REPEAT = 21
IMAGES = [("240×180", "sim/sim1_21/images"), ("752×480", "euroc_v101/cam0/data")]
FLOWS = [  # title, window, stride, levels, iterations, backward Q8
    ("**evstab, default: 25 px, every 2nd, 2 levels, 5 steps, and the way back**", 25, 2, 2, 5, 128),
    ("evstab, 31 px, every 2nd, 2 levels, 3 steps, and the way back", 31, 2, 2, 3, 128),
    ("evstab, 21 px, 3 levels, as many steps as OpenCV", 21, 1, 3, 30, 0),
    ("evstab, 31 px, 2 levels, as many steps as OpenCV", 31, 1, 2, 30, 0),
]
OPENCV_FLOWS = [("OpenCV, 21 px, 3 levels", 21, 3), ("OpenCV, 31 px, 2 levels", 31, 2)]


def median_ms(call):
    times = []
    for _ in range(REPEAT):
        start = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - start))
    return float(np.median(times))


def measure(dump, first, second):
    """{row: ms}, the medians of all rounds."""
    corners = dump.corners(first, 8, 1)[0]
    start = corners[np.argsort(-corners[:, 2], kind="stable")[:N_POINTS], :2]
    assert len(start) == N_POINTS
    points = start.astype(np.float32).reshape(-1, 1, 2)
    rounds = []
    for _ in range(ROUNDS):
        ms = {title: dump.track(first, second, start, start, *settings, repeat=REPEAT)[3] / 1e6
              for title, *settings in FLOWS}
        for title, window, levels in OPENCV_FLOWS:
            ms[title] = median_ms(lambda w=window, n=levels: cv2.calcOpticalFlowPyrLK(
                first, second, points, None, winSize=(w, w), maxLevel=n - 1, criteria=UNTIL_CONVERGED))
        ms["**evstab, corners**"] = dump.corners(first, repeat=REPEAT)[1] / 1e6
        ms["OpenCV, cornerMinEigenVal()"] = median_ms(lambda: cv2.cornerMinEigenVal(first, 5, ksize=3))
        ms["OpenCV, goodFeaturesToTrack()"] = median_ms(lambda: cv2.goodFeaturesToTrack(first, 500, 0.01, 8, blockSize=5))
        rounds.append(ms)
    return {row: float(np.median([r[row] for r in rounds])) for row in rounds[0]}


def machine():
    with open("/proc/cpuinfo", encoding="utf-8") as f:
        return next((line.split(":", 1)[1].strip() for line in f if line.startswith("model name")), "unknown")


def main():
    parser = argparse.ArgumentParser(description="Compare corners and flow with OpenCV: speed.")
    parser.add_argument("program")
    parser.add_argument("--data", default=os.environ.get("EVS_DATA_DIR", ""))
    parser.add_argument("--write", action="store_true", help="write the section of docs/performance.md")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        dump = Dump(args.program, folder)
        columns = [measure(dump, *frames(os.path.join(args.data, path), 1, 3)[1]) for _, path in IMAGES]
    commit = subprocess.run(["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], capture_output=True, text=True,
                            check=False).stdout.strip()
    text = (f"Milliseconds on one thread of {machine()}, commit {commit}, OpenCV {cv2.__version__}. Flow: {N_POINTS} points, "
            f"both pyramids included; OpenCV's has no way back.\n\n")
    text += "| | " + " | ".join(size for size, _ in IMAGES) + " |\n|---|" + "--:|" * len(IMAGES) + "\n"
    for row in columns[0]:
        text += f"| {row} | " + " | ".join(f"{column[row]:.2f}" for column in columns) + " |\n"
    print(text)
    if args.write:
        path = os.path.join(ROOT, "docs", "performance.md")
        content = replace_section(path, "flow", text)
        with open(path, "w", encoding="utf-8") as f:
            f.write(content)
    return 0


if __name__ == "__main__":
    sys.exit(main())
