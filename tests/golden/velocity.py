#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""How well evstab replay tells the direction of flight, on simulated flights with exact truth and on real recordings. Errors
are computed here, from velocity.csv and the truth alone.

usage: velocity.py EVSTAB truth|order|imu|slider|windows

truth    two simulated flights, default settings, true attitude: the error, its own idea of it, and how often there is one
order    the paper's claims: stabilized beats full ERL on the same flow, IWE beats time surface, slices beat windows, and
         a rotation per window needs a warp
imu      the attitude from the IMU, its gyro bias known: little worse than true attitude; unknown: learnt from the flow
slider   a complete real recording that moves along +x
windows  short real recordings of a camera that is moved by hand

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

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
import velocity_score as score
from velocity_score import Errors, Truth, angle

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
    run, _ = score.replay(evstab, out, *arguments)
    check("rows in order, unit vectors", bool((np.diff(run.t) > 0).all()) and
          bool(np.allclose(np.linalg.norm(run.v, axis=1), 1, atol=1e-6)), f"{len(run.t)} rows")
    check("as many as the summary says", len(run.t) == run.summary["velocity"]["valid"], run.summary["velocity"])
    return run


def flight(name):
    folder = DATA / "sim" / name
    need(folder / "events.txt", folder / "velocity.txt", folder / "groundtruth.txt", folder / "imu.txt")
    return folder, Truth(folder / "groundtruth.txt", folder / "velocity.txt")


FLIGHTS = [("sim1_21", 2.5), ("sim3_23", 4.5)]


def test_truth(evstab, temp):
    for name, bound in FLIGHTS:
        folder, truth = flight(name)
        run = replay(evstab, temp / name, folder, "--attitude", "truth")
        errors = Errors(run, truth)
        check(f"{name}: mean error", errors.mean <= bound, f"{errors.text()}; at most {bound}")
        v = run.summary["velocity"]
        print(f"     {v['pairs']} pairs: {v['invalid']}; {v['mean']}; {v['library_ns_per_image'] * 1e-6:.2f} ms per image, "
              f"{run.summary['library_memory_bytes']} bytes")
        check(f"{name}: no direction is turned about", float(errors.deg.max()) < 90, f"{errors.deg.max():.1f} deg at most")
        duration = run.summary["duration_s"]
        covered = run.coverage()
        check(f"{name}: an estimate of the last 0.1 s is at hand", covered > 0.8, f"{100 * covered:.1f} % of {duration:.2f} s, "
              f"{len(run.t) / duration:.1f} per s")
        within = [float((errors.deg <= k * errors.sigma).mean()) for k in (1, 2)]
        check(f"{name}: within 2 sigma", within[1] >= 0.75, f"{100 * within[0]:.0f} % within 1, {100 * within[1]:.0f} % within 2; "
              f"median sigma {np.median(errors.sigma):.2f} deg")

        # evstab eval tells the same.
        done = subprocess.run([evstab, "eval", str(temp / name), "--truth", str(folder / "groundtruth.txt"), "--velocity-truth",
                               str(folder / "velocity.txt"), "-q"], text=True, capture_output=True)
        told = json.loads((temp / name / "eval.json").read_text())["velocity"] if done.returncode == 0 else {}
        direction = told.get("direction", {})
        check(f"{name}: evstab eval", direction.get("n") == len(errors.deg) and
              abs(direction["mean_deg"] - errors.mean) < 1e-3 and abs(direction["median_deg"] - errors.median) < 1e-3 and
              abs(told["within_2_sigma_share"] - within[1]) < 0.1 and abs(told["covered_share"] - covered) < 1e-3,
              done.stderr or f"{direction}, over the interval {told.get('direction_over_interval', {}).get('mean_deg')}")


def test_order(evstab, temp):
    sums = {}
    for name, _ in FLIGHTS:
        folder, truth = flight(name)
        variants = {"stabilized": (), "full ERL": ("--method", "erl"), "surface": ("--image", "surface"),
                    "window": ("--rotation", "window"), "window, tiled": ("--rotation", "window", "--warp", "tiled"),
                    "as published": ("--method", "erlv-paper")}
        runs = {key: replay(evstab, temp / f"{name} {key}", folder, "--attitude", "truth", *words)
                for key, words in variants.items()}
        for key, run in runs.items():
            only = None
            if key == "full ERL":  # The same flow: pairs that both solvers have an answer for.
                only = runs["stabilized"].t[np.isin(np.round(runs["stabilized"].t * 1e6), np.round(run.t * 1e6))]
                same = Errors(runs["stabilized"], truth, only)
                sums.setdefault("stabilized, same pairs", []).append(same.mean)
            errors = Errors(run, truth, only)
            sums.setdefault(key, []).append(errors.mean)
            print(f"     {name}, {key}: {errors.text()}")
    mean = {key: sum(values) / len(values) for key, values in sums.items()}
    print("     means: " + ", ".join(f"{key} {value:.2f}" for key, value in mean.items()))
    for i, (name, _) in enumerate(FLIGHTS):
        check(f"{name}: stabilized ERL-V < 1/3 of full ERL on the same flow",
              sums["stabilized, same pairs"][i] < sums["full ERL"][i] / 3,
              f"{sums['stabilized, same pairs'][i]:.2f} and {sums['full ERL'][i]:.2f} deg")
        check(f"{name}: IWE < time surface", sums["stabilized"][i] < sums["surface"][i],
              f"{sums['stabilized'][i]:.2f} and {sums['surface'][i]:.2f} deg")
        check(f"{name}: rotation per slice < per window without warp", sums["stabilized"][i] < sums["window"][i],
              f"{sums['stabilized'][i]:.2f} and {sums['window'][i]:.2f} deg")
    check("a warp helps rotation per window", mean["window, tiled"] < mean["window"],
          f"{mean['window, tiled']:.2f} and {mean['window']:.2f} deg")


def test_imu(evstab, temp):
    for name, _ in FLIGHTS:
        folder, truth = flight(name)
        bias = score.gyro_bias(folder)
        told = ("--gyro-bias", score.gyro_bias_word(bias))
        by_truth = Errors(replay(evstab, temp / f"{name} truth", folder, "--attitude", "truth"), truth)
        by_imu = Errors(replay(evstab, temp / f"{name} imu", folder, "--attitude", "imu", *told), truth)
        raw = Errors(replay(evstab, temp / f"{name} raw", folder, "--attitude", "imu"), truth)
        print(f"     {name}: true attitude: {by_truth.text()}")
        print(f"     {name}: bias {np.round(bias, 4)} rad/s; not told: {raw.text()}")
        known = json.loads((temp / f"{name} raw" / "summary.json").read_text())["attitude"]["gyro_bias_rad_s"]
        check(f"{name}: bias learnt from the flow", raw.mean <= 1.5 * by_truth.mean,
              f"{raw.mean / by_truth.mean:.2f} times the error of true attitude")
        check(f"{name}: nearer to the bias than zero", np.linalg.norm(known - bias) < np.linalg.norm(bias), known)
        check(f"{name}: attitude from the IMU", by_imu.mean <= 1.3 * by_truth.mean,
              f"{by_imu.text()}; {by_imu.mean / by_truth.mean:.2f} times that of true attitude")


def test_slider(evstab, temp):
    folder = DATA / "ecd" / "slider_depth"
    need(folder / "events.txt", folder / "calib.txt")
    run = replay(evstab, temp / "out", folder)
    errors = angle(run.v, np.array([[1.0, 0.0, 0.0]]))
    check("slider_depth: median angle to +x", float(np.median(errors)) <= 6.0,
          f"median {np.median(errors):.2f}, mean {errors.mean():.2f}, 95 % {np.percentile(errors, 95):.2f}, max {errors.max():.2f} "
          f"deg of {len(errors)}")
    check("slider_depth: sign", bool((run.v[:, 0] > 0).all()), "always to the right")
    print(f"     {run.summary['velocity']}")


class Poses:
    """Recorded poses, whose clock may run ahead of the events' by a few ms."""

    def __init__(self, path):
        table = model.read_table(path)
        self.t, self.p, self.q = table[:, 0], table[:, 1:4], table[:, [7, 4, 5, 6]]

    def velocity(self, t):
        """In the camera's frame: the slope of a parabola over 50 ms of positions."""
        near = np.abs(self.t - t) < 0.025
        fit = np.polyfit(self.t[near] - t, self.p[near], 2)
        now = self.q[np.argmin(np.abs(self.t - t))]
        return model.matrix(model.conjugate(now)) @ fit[1]

    def rate(self, t):
        near = np.flatnonzero(np.abs(self.t - t) < 0.02)
        turned = model.multiply(model.conjugate(self.q[near[0]]), self.q[near[-1]])
        return model.logarithm(turned) / (self.t[near[-1]] - self.t[near[0]])


# Recording, events, settings, and by how much the clock of its truth may be off (ms). So short a recording needs short
# windows and intervals.
WINDOWS = [("poster_translation", "events_39.127-39.200.txt", (), 30),
           ("boxes_translation", "events_18.580-18.591.txt", ("--window", "area:34x26:60", "--baseline-ms", "6:100"), 30),
           ("poster_6dof", "events_36.567-36.571.txt", ("--window", "area:34x26:60", "--baseline-ms", "1:100"), 0)]


def test_windows(evstab, temp):
    calib = DATA / "ecd" / "calib.txt"
    need(calib, *(DATA / "ecd" / name / events for name, events, _, _ in WINDOWS))
    focal = model.read_table(calib)[0][0]
    for name, events, words, clock_ms in WINDOWS:
        poses = DATA / "ecd" / name / "groundtruth.txt"
        truth = Poses(poses)
        found = {}
        for offset_ms in range(-clock_ms, clock_ms + 1, 5):
            run = replay(evstab, temp / f"{name} {offset_ms}", DATA / "ecd" / name / events, "--calib", calib, "--poses", poses,
                      "--attitude", "truth", "--imu-offset-us", offset_ms * 1000, *words)
            pairs = [row.split(",") for row in (temp / f"{name} {offset_ms}" / "pairs.csv").read_text().splitlines()[1:]]
            if len(run.t) == 0:
                continue
            at = run.t - offset_ms * 1e-3
            error = angle(run.v, np.array([truth.velocity(t) for t in at]))
            speed = np.median([float(p[3]) / float(p[1]) for p in pairs if p[2] == "valid"]) / focal  # rad/s of image motion
            # What the truth itself leaves open: a clock that is off turns the flow by the change of the rate, and the
            # direction with it.
            shifts = [k * 5e-3 for k in range(-clock_ms // 5, clock_ms // 5 + 1)]
            t = float(np.median(at))
            change = max(float(np.linalg.norm(truth.rate(t + s) - truth.rate(t))) for s in shifts)
            drift = max(float(angle(truth.velocity(t + s)[None], truth.velocity(t)[None])[0]) for s in shifts)
            known = np.degrees(np.arctan(change / speed)) + drift
            found[offset_ms] = (float(np.median(error)), float(np.median(run.sigma)), known, len(run.t))
        print(f"     {name}: " + ", ".join(f"{k:+d} ms: {v[0]:.1f} deg of {v[3]}, sigma {v[1]:.1f}, truth known to {v[2]:.1f}"
                                           for k, v in found.items()))
        if name == "poster_translation":  # The only one that is long enough for the default settings.
            check(f"{name}: there is a direction at the nominal time", 0 in found, sorted(found))
        if not found:  # Honest, but then there must be pairs that say so.
            check(f"{name}: what is too short to tell is flagged", len(pairs) > 0, [p[2] for p in pairs])
            continue
        for offset_ms, (error, sigma, known, _) in found.items():
            if offset_ms == 0:
                check(f"{name}: within the error of the truth and twice its own", error <= known + 2 * sigma,
                      f"{error:.1f}, truth {known:.1f}, sigma {sigma:.1f} deg")
        best = min(found, key=lambda k: found[k][0])
        bound = 15.0 if clock_ms > 0 else 20.0
        check(f"{name}: right for some clock within {clock_ms} ms", found[best][0] <= max(bound, found[best][1]),
              f"{found[best][0]:.1f} deg at {best:+d} ms, at most {bound:.0f}")


TESTS = {"truth": test_truth, "order": test_order, "imu": test_imu, "slider": test_slider, "windows": test_windows}


def main():
    if len(sys.argv) != 3 or sys.argv[2] not in TESTS:
        print(__doc__)
        sys.exit(2)
    with tempfile.TemporaryDirectory(prefix="evstab_velocity_") as temp:
        TESTS[sys.argv[2]](str(pathlib.Path(sys.argv[1]).resolve()), pathlib.Path(temp))
    sys.exit(1 if FAULTS else 0)


main()
