#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Replays recordings with evstab and compares what it writes with a double-precision model and with known figures.

usage: replay.py EVSTAB sharpness|slider|rotation

sharpness  two windows of real events with the full IMU: the picture gets as sharp as it should, and blurs when the
           rotation is inverted
slider     a complete real recording: counts, window boundaries and every position
rotation   a simulated flight with exact orientations: rotation per window and per slice, saccades

Exits 77 when numpy or the recordings (EVS_DATA_DIR) are not there.
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile

try:
    import numpy as np
except ImportError as error:
    print(f"SKIPPED: {error}; install tests/requirements.txt")
    sys.exit(77)

import replay_model as model

DATA = pathlib.Path(os.environ.get("EVS_DATA_DIR", "."))
FAULTS = []


def check(what, ok, detail):
    print(f"{'ok  ' if ok else 'FAIL'} {what}: {detail}")
    if not ok:
        FAULTS.append(what)


def need(*paths):
    for path in paths:
        if not path.exists() and not path.with_name(path.name + ".gz").exists():
            print(f"SKIPPED: {path} is not there; EVS_DATA_DIR names the folder of recordings")
            sys.exit(77)


def replay(evstab, out, *arguments):
    done = subprocess.run([evstab, "replay", "-o", str(out), *map(str, arguments)], text=True, capture_output=True)
    print(done.stderr, end="")
    if done.returncode != 0:
        print(f"FAIL evstab replay exits {done.returncode}")
        sys.exit(1)
    return json.loads((out / "summary.json").read_text())


def read_events(out):
    """time, pixel, undistorted, stabilized, window"""
    table = model.read_csv(out / "events.csv", range(9))
    return table[:, 0], table[:, 1:3].astype(int), table[:, 4:6], table[:, 6:8], table[:, 8].astype(int)


def read_windows(out):
    return model.read_csv(out / "windows.csv", (0, 1, 2, 3, 4, 6, 7, 8, 9, 10))


def check_close(what, ours, theirs, bound):
    error = np.abs(ours - theirs)
    worst = float(np.nanmax(error)) if error.size else float("nan")
    check(what, error.size > 0 and worst <= bound and bool(np.isfinite(error).all()),
          f"largest difference {worst:.6f}, bound {bound:.6f}, rms {float(np.sqrt((error ** 2).mean())):.6f}")


def check_undistortion(camera, pixel, undistorted):
    truth = camera.undistorted_pixels()
    check_close("undistorted positions (px)", undistorted, truth[pixel[:, 1], pixel[:, 0]], 0.5 / 16 + 1e-4)


# The reference figures of the issue: unstabilized, and at least this when stabilized.
WINDOWS = [("events_02.097-02.196.txt", 20000, 1.25, 2.6), ("events_43.499-43.605.txt", 30000, 1.65, 4.2)]


def test_sharpness(evstab, temp):
    folder = DATA / "ecd" / "shapes_rotation"
    calib = DATA / "ecd" / "calib.txt"
    need(folder / "imu.txt", calib, *(folder / name for name, _, _, _ in WINDOWS))
    camera = model.Camera(model.read_table(calib)[0])
    for name, n_events, before, after in WINDOWS:
        out = temp / name
        summary = replay(evstab, out, folder / name, "--calib", calib, "--imu", folder / "imu.txt", "--attitude", "imu",
                         "--rotation", "slice", "--saccade", "off", "--write", "events")
        t, pixel, undistorted, stabilized, _ = read_events(out)
        check(f"{name}: every event comes out", len(t) == n_events == summary["events"]["in"], len(t))
        check_undistortion(camera, pixel, undistorted)
        flat = model.sharpness(undistorted)
        check(f"{name}: sharpness unstabilized", abs(flat - before) < 0.01, f"{flat:.3f}, expected {before}")
        sharp = model.sharpness(stabilized)
        check(f"{name}: sharpness stabilized", sharp >= after, f"{sharp:.3f}, at least {after}")

        # The same rotation by the model, forwards and backwards, at each event's own time.
        attitude = model.read_csv(out / "attitude.csv", range(8))
        attitude = attitude[(attitude[:, 0] > t[0] - 0.1) & (attitude[:, 0] < t[-1] + 0.1)]
        q = model.orientation_at(t, attitude[:, 0], attitude[:, 1:5], attitude[:, 5:8])
        relative = model.matrix(model.multiply(model.conjugate(q[0]), q))
        forward = camera.rotate(undistorted, relative)
        check_close(f"{name}: stabilized against the model at each event's time (px)", stabilized, forward, 0.25 + 0.1)
        backward = model.sharpness(camera.rotate(undistorted, np.swapaxes(relative, -1, -2)))
        check(f"{name}: sharpness with the rotation inverted", backward < flat, f"{backward:.3f}, below {flat:.3f}")


def test_slider(evstab, temp):
    folder = DATA / "ecd" / "slider_depth"
    need(folder / "events.txt", folder / "calib.txt")
    out = temp / "out"
    summary = replay(evstab, out, folder, "--window", "area:34x26:200", "--write", "events")
    camera = model.Camera(model.read_table(folder / "calib.txt")[0])
    truth = model.read_table(folder / "events.txt")
    t, pixel, undistorted, stabilized, window = read_events(out)

    check("events in", summary["events"]["in"] == len(truth) == len(t), len(t))
    check("times", np.array_equal(np.round(t * 1e6), np.round(truth[:, 0] * 1e6)), "exact in microseconds")
    check("pixels", np.array_equal(pixel, truth[:, 1:3].astype(int)), "equal")
    check_undistortion(camera, pixel, undistorted)

    # Windows by area count, from positions of the model rounded to the library's 1/16 px.
    rounded = np.floor(camera.undistorted_pixels() * model.Q4 + 0.5) / model.Q4
    tiles = model.tiles_of(rounded[pixel[:, 1], pixel[:, 0]], 240, 180, 34, 26)
    first = model.area_windows(tiles, 200)
    table = read_windows(out)
    check("window boundaries", np.array_equal(table[:, 1], first[:-1]) and np.array_equal(table[:, 2], np.diff(first)),
          f"{len(table)} windows, {len(first) - 1} in the model")
    check("window of each event", np.array_equal(window, np.searchsorted(first, np.arange(len(t)), side="right") - 1),
          "equal")
    check("times of windows", np.array_equal(table[:, 3], t[first[:-1]]) and
          np.array_equal(table[:, 4], t[first[1:] - 1]), "equal")

    # The slider does not turn: where there is an orientation, stabilizing must change nothing.
    known = np.isfinite(stabilized).all(axis=1)
    poses = model.read_table(folder / "groundtruth.txt")
    covered = (t >= poses[0, 0] + 0.001) & (t <= poses[-1, 0])  # a slice of 1 ms is oriented as a whole or not at all
    check("events with an orientation", bool(known[covered].all()) and
          int((~known).sum()) == summary["events"]["outside"]["no_orientation"],
          f"{int((~known).sum())} without, around the first pose and before")
    check_close("stabilized positions (px)", stabilized[known], undistorted[known], 1 / 16)


def test_rotation(evstab, temp):
    folder = DATA / "sim" / "sim1_21"
    need(folder / "events.txt", folder / "groundtruth.txt", folder / "calib.txt")
    camera = model.Camera(model.read_table(folder / "calib.txt")[0])
    poses = model.read_table(folder / "groundtruth.txt")
    pose_t, pose_q = poses[:, 0], poses[:, [7, 4, 5, 6]]
    pose_q = pose_q / np.linalg.norm(pose_q, axis=1, keepdims=True)
    rate = model.central_rates(pose_t, pose_q)

    def run(name, *arguments):
        out = temp / name
        replay(evstab, out, folder, "--attitude", "truth", "--to", "1.0", "--write", "events", *arguments)
        t, _, undistorted, stabilized, window = read_events(out)
        return t, undistorted, stabilized, window, read_windows(out)

    t, undistorted, stabilized, window, table = run("window", "--rotation", "window", "--window", "time:10000")
    # One rotation per window, that of its first event; a saccade when the image centre is further than W / 6 away.
    start = np.searchsorted(window, np.arange(window[-1] + 1))
    q = model.orientation_at(t[start], pose_t, pose_q, rate)
    centre = np.array([[(240 - 1) / 2, (180 - 1) / 2]])
    reference, relative, saccades = q[0], [], []
    for i in range(len(q)):
        r = model.multiply(model.conjugate(reference), q[i])
        moved = np.linalg.norm(camera.rotate(centre, model.matrix(r)) - centre)
        saccades.append(i > 0 and moved > 240 / 6)
        if saccades[-1]:
            reference = q[i]
            r = np.array([1.0, 0.0, 0.0, 0.0])
        relative.append(r)
    relative = np.array(relative)
    check("windows of 10 ms", np.array_equal(np.floor((t - t[0]) * 100 + 1e-9).astype(int), window), f"{len(table)}")
    check("saccades", sum(saccades) > 0 and np.array_equal(table[:, 5].astype(bool), saccades),
          f"{sum(saccades)} in the model, {int(table[:, 5].sum())} found")
    flip = np.sign((table[:, 6:10] * relative).sum(axis=1, keepdims=True))
    check_close("rotation of each window (quaternion)", table[:, 6:10] * flip, relative, 1e-5)
    check_close("rotation per window: positions (px)", stabilized,
                camera.rotate(undistorted, model.matrix(relative)[window]), 3 / 64 + 0.02)

    t, undistorted, stabilized, window, table = run("slice", "--rotation", "slice", "--saccade", "off")
    q = model.orientation_at(t, pose_t, pose_q, rate)
    relative = model.matrix(model.multiply(model.conjugate(q[0]), q))
    model_points = camera.rotate(undistorted, relative)
    near = np.abs(model_points - centre).max(axis=1) < 200  # further out, perspective magnifies the smear of a slice
    check_close("rotation per slice: positions (px)", stabilized[near], model_points[near], 0.25 * 2.5)


TESTS = {"sharpness": test_sharpness, "slider": test_slider, "rotation": test_rotation}


def main():
    if len(sys.argv) != 3 or sys.argv[2] not in TESTS:
        print(__doc__)
        sys.exit(2)
    with tempfile.TemporaryDirectory(prefix="evstab_golden_") as temp:
        TESTS[sys.argv[2]](sys.argv[1], pathlib.Path(temp))
    sys.exit(1 if FAULTS else 0)


main()
