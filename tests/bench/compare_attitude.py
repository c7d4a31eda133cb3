#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Compare the attitude filter with others on the same recordings in one run; write a section of docs/accuracy.md.

usage: compare_attitude.py ATTITUDE_RUN [--data DIR] [--write]

Needs numpy and the PyPI packages vqf and imufusion; the recordings are those of EVS_DATA_DIR. Without --write it only
prints. Times are medians of whole runs over one recording, one filter after the other, on one core; run it on a quiet
machine.
"""
import argparse
import os
import platform
import subprocess
import sys
import time

import imufusion
import numpy as np
import vqf

ROOT = os.path.normpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "tests", "support"))
import attitude_score as at  # noqa: E402
import cross_tree  # noqa: E402

G = 9.80665
REPEAT = 11


def ours(program, *options):
    return lambda with_mag: lambda trial, rows: at.run(program, rows, *options, *([] if with_mag else ["--no-mag"]))[0]


def run_vqf(rows, dt, with_mag):
    columns = [np.ascontiguousarray(rows[:, c]) for c in (at.GYRO, at.ACCEL, at.MAG)]
    if with_mag:
        return vqf.VQF(dt).updateBatch(*columns)["quat9D"]
    return vqf.VQF(dt).updateBatch(*columns[:2])["quat6D"]


def interval(rows):
    return float(np.median(np.diff(rows[:, 0])))


def filter_vqf(with_mag):
    return lambda trial, rows: run_vqf(rows, interval(rows), with_mag)


def run_fusion(rows, dt, with_mag):
    ahrs = imufusion.Ahrs()
    settings = imufusion.AhrsSettings()
    settings.convention = imufusion.CONVENTION_ENU
    ahrs.set_settings(settings)
    ahrs.set_sample_period(dt)
    gyro, accel, mag = np.degrees(rows[:, at.GYRO]), rows[:, at.ACCEL] / G, rows[:, at.MAG]
    q = np.empty((len(rows), 4))
    for i in range(len(rows)):
        if with_mag:
            ahrs.update(gyro[i], accel[i], mag[i])
        else:
            ahrs.update_no_magnetometer(gyro[i], accel[i])
        q[i] = ahrs.get_quaternion()
    return q


def filter_fusion(with_mag):
    return lambda trial, rows: run_fusion(rows, interval(rows), with_mag)


def accuracy(trials, filters):
    out = "| filter | 9D total | incl. | head. | rel 0.1 s | rel 1 s | 6D total | incl. | drift | rel 0.1 s | rel 1 s |\n"
    out += "|---" + "|--:" * 10 + "|\n"
    for name, make in filters:
        cells = [f"{x:.3f}" for with_mag in (True, False)
                 for x in at.evaluate(trials, make(with_mag), at.as_is, with_mag)]
        out += f"| {name} | " + " | ".join(cells) + " |\n"
    return out


def robustness(trials, program):
    cases = [
        ("as recorded", at.as_is), ("switched on 5 s into the motion", at.from_motion),
        ("gyro clipped at 500 °/s", at.clipped(at.GYRO, np.radians(500))),
        ("accelerometer clipped at 4 g", at.clipped(at.ACCEL, 4 * G)), ("every third sample (95 Hz)", at.every(3)),
        ("a fifth of the samples lost in bursts of 1 to 9", at.with_losses),
        ("1 of 1000: gyro 35 rad/s on every axis", at.with_glitch(at.GYRO, lambda x: 0 * x + 35.0)),
        ("1 of 1000: accelerometer −160 m/s² on every axis", at.with_glitch(at.ACCEL, lambda x: 0 * x - 160.0)),
        ("1 of 1000: gravity upside down", at.with_glitch(at.ACCEL, lambda x: -x)),
        ("1 of 1000: accelerometer and magnetometer zero", at.with_glitch(slice(4, 10), lambda x: 0 * x)),
        ("1 of 1000: field reversed", at.with_glitch(at.MAG, lambda x: -x)),
        ("1 of 1000: field thirty times as strong", at.with_glitch(at.MAG, lambda x: 30 * x)),
    ]
    out = "| the recordings, spoilt | evstab total | incl. | VQF total | incl. |\n|---|--:|--:|--:|--:|\n"
    for name, spoil in cases:
        mine = at.evaluate(trials, ours(program)(True), spoil)
        theirs = at.evaluate(trials, filter_vqf(True), spoil)
        out += f"| {name} | {mine[0]:.2f} | {mine[1]:.2f} | {theirs[0]:.2f} | {theirs[1]:.2f} |\n"
    return out


def median_ns(call, n):
    times = []
    for _ in range(REPEAT):
        start = time.perf_counter()
        call()
        times.append((time.perf_counter() - start) / n * 1e9)
    return float(np.median(times))


def speed(trial, program):
    rows = np.ascontiguousarray(trial.imu)
    out = "| ns per update | 9D | 6D | how |\n|---|--:|--:|---|\n"
    cells = [at.run(program, rows, "--repeat", str(REPEAT), *o)[1]["ns_per_row"] for o in ([], ["--no-mag"])]
    out += f"| evstab | {cells[0]:.0f} | {cells[1]:.0f} | C, in a loop over memory |\n"
    cells = [median_ns(lambda m=m: run_vqf(rows, trial.dt, m), len(rows)) for m in (True, False)]
    out += f"| VQF {version('vqf')} | {cells[0]:.0f} | {cells[1]:.0f} | C++ in double, `updateBatch()`: its loop, allocations included |\n"
    short = rows[:5000]
    cells = [median_ns(lambda m=m: run_fusion(short, trial.dt, m), len(short)) for m in (True, False)]
    out += f"| imufusion {version('imufusion')} | {cells[0]:.0f} | {cells[1]:.0f} | C in float, but called sample by sample from Python: mostly the cost of that |\n"
    return out


def version(package):
    from importlib.metadata import version as installed
    return installed(package)


def machine():
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as f:
            return next(line.split(":", 1)[1].strip() for line in f if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.machine()


def main():
    parser = argparse.ArgumentParser(description="Compare attitude filters on the same recordings.")
    parser.add_argument("program")
    parser.add_argument("--data", default=os.environ.get("EVS_DATA_DIR", ""))
    parser.add_argument("--write", action="store_true", help="write the section of docs/accuracy.md")
    args = parser.parse_args()
    trials = at.load_broad(args.data)
    if not trials:
        raise SystemExit(f"no recordings in {args.data}/broad: give --data or set EVS_DATA_DIR")

    filters = [
        ("**evstab**, default", ours(args.program)),
        (f"VQF {version('vqf')}, default", filter_vqf),
        (f"imufusion {version('imufusion')}, default", filter_fusion),
        ("evstab, mode valenti, gain 0.01 a sample (the published default)",
         ours(args.program, "--mode", "valenti", "--tau-accel", "350", "--tau-mag", "350")),
        ("evstab, mode gyro, bias learnt at rest", ours(args.program, "--mode", "gyro")),
        ("evstab, mode gyro, no bias", ours(args.program, "--mode", "gyro", "--no-bias")),
    ]
    commit = subprocess.run(["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], capture_output=True, text=True,
                            check=False).stdout.strip()
    section = f"""Written by a command; everything in this section was measured in one run, at commit {commit} on {machine()}:

    cmake --preset release && cmake --build --preset release
    python3 tests/bench/compare_attitude.py build/release/tests/bench/attitude_run --data $EVS_DATA_DIR --write

Data: {len(trials)} trials of BROAD (Laidig et al. 2021, [10.3390/data6070072](https://doi.org/10.3390/data6070072)): a hand
moves an IMU and magnetometer, 286 Hz, up to 1450 °/s and 158 m/s², with optical truth; slow and fast, rotation and
translation, and magnets near by. All filters run with one set of parameters, their defaults. Degrees; RMSE over the samples in
motion, then the mean over the trials. 9D uses the magnetometer; 6D does not, there the heading is relative and its error is the
drift. `rel T` is the error of the rotation accumulated over T: what stabilization feels. `tests/support/attitude_score.py` has the
definitions. `ctest --preset release -R golden.attitude` holds the filter to these numbers.

{accuracy(trials, filters)}
A filter that normalizes each acceleration before it uses it (imufusion, Valenti) loses the mean of an oscillating one, and
with it the horizon; see [modules/attitude.md](modules/attitude.md).

### Robustness
9D. A spoilt sample itself is not scored, what it leaves behind is. VQF takes no time stamps, so lost samples cost it their motion.

{robustness(trials, args.program)}
### Speed on this machine
{speed(trials[0], args.program)}
On a Cortex-M4F the update takes the instructions that [performance.md](performance.md) lists.
"""
    print(section)
    if args.write:
        page = os.path.join(ROOT, "docs", "accuracy.md")
        content = cross_tree.replace_section(page, "attitude", section)
        with open(page, "w", encoding="utf-8") as f:
            f.write(content)
    return 0


if __name__ == "__main__":
    sys.exit(main())
