# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Trials of BROAD, ways to spoil them, and the errors of an orientation against their optical truth.

Definitions as in the data set's paper (Laidig et al., Data 6(7), 2021): e = q_est conj(q_ref) in the earth frame; total
error 2 acos |e_w|, heading 2 atan |e_z / e_w|, inclination 2 acos sqrt(e_w^2 + e_z^2); RMSE over the samples in motion
with a valid reference, then the mean over the trials. Without a magnetometer one constant heading per trial, from the
last second before motion, is taken out. `rel T` is the RMSE of the rotation accumulated over T seconds.
"""
import glob
import gzip
import os
import subprocess

import numpy as np

GYRO, ACCEL, MAG = slice(1, 4), slice(4, 7), slice(7, 10)
REL_S = (0.1, 1.0)


def conj(q):
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def mul(a, b):
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack([aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
                     aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw], -1)


class Trial:
    def __init__(self, path):
        self.name = os.path.basename(path).removesuffix(".csv.gz")
        with gzip.open(path, "rt") as f:
            f.readline()
            text = f.read().replace(",,", ",nan,").replace(",,", ",nan,")
        table = np.array([line.split(",") for line in text.split()], dtype=float)
        self.imu, self.truth, self.moving = table[:, :10].copy(), table[:, 10:14], table[:, 14] > 0
        self.first = int(np.argmax(self.moving))  # sample with which the motion starts
        self.dt = float(np.median(np.diff(self.imu[:, 0])))


def load_broad(data_dir):
    return [Trial(path) for path in sorted(glob.glob(os.path.join(data_dir, "broad", "*.csv.gz")))]


def score(trial, q, with_mag):
    """(total, inclination, heading, rel 0.1 s, rel 1 s) in degrees. Rows of q that are NaN are left out."""
    ok = np.isfinite(trial.truth[:, 0]) & np.isfinite(q[:, 0])
    e = mul(q, conj(trial.truth))
    if not with_mag:
        before = np.arange(max(0, trial.first - round(1.0 / trial.dt)), trial.first)
        before = before[ok[before]]
        heading = 2.0 * np.arctan2(e[before, 3], e[before, 0])
        mean = np.arctan2(np.sin(heading).mean(), np.cos(heading).mean())
        e = mul(np.array([np.cos(mean / 2), 0.0, 0.0, -np.sin(mean / 2)]), e)
    scored = ok & trial.moving
    w, z = e[scored, 0], e[scored, 3]
    rms = lambda angle: float(np.degrees(np.sqrt(np.mean(angle**2))))
    result = [rms(2 * np.arccos(np.minimum(1, np.abs(w)))), rms(2 * np.arccos(np.minimum(1, np.hypot(w, z)))),
              rms(2 * np.arctan2(np.abs(z), np.abs(w)))]
    for span in REL_S:
        n = round(span / trial.dt)
        both = scored[:-n] & scored[n:]
        moved = mul(mul(conj(q[:-n]), q[n:]), conj(mul(conj(trial.truth[:-n]), trial.truth[n:])))[both]
        result.append(rms(2 * np.arcsin(np.minimum(1, np.linalg.norm(moved[:, 1:], axis=1)))) if both.any() else np.nan)
    return result


def run(program, rows, *options):
    """attitude_run over rows: (orientations, {counter: value})."""
    done = subprocess.run([program, *options], input=np.ascontiguousarray(rows, dtype=float).tobytes(),
                          capture_output=True, check=True)
    counters = dict(line.split() for line in done.stderr.decode().splitlines())
    return np.frombuffer(done.stdout).reshape(-1, 4), {k: float(v) for k, v in counters.items()}


def as_is(trial):
    return trial.imu, np.arange(len(trial.imu))


def clipped(columns, limit):
    def spoil(trial):
        rows = trial.imu.copy()
        rows[:, columns] = rows[:, columns].clip(-limit, limit)
        return rows, np.arange(len(rows))
    return spoil


def from_motion(trial):
    """Switched on 5 s after the motion began."""
    kept = np.arange(trial.first + round(5.0 / trial.dt), len(trial.imu))
    return trial.imu[kept], kept


def every(n):
    return lambda trial: (trial.imu[::n], np.arange(0, len(trial.imu), n))


def with_losses(trial, share=0.2):
    """Bursts of 1 to 9 samples lost, this share of all; fixed seed."""
    random = np.random.default_rng(1)
    keep = np.ones(len(trial.imu), bool)
    for start in np.flatnonzero(random.random(len(keep)) < share / 5 / (1 - share)):
        keep[start:start + random.integers(1, 10)] = False
    kept = np.flatnonzero(keep)
    return trial.imu[kept], kept


def with_glitch(columns, change):
    """One bad sample in a thousand."""
    def spoil(trial):
        rows = trial.imu.copy()
        bad = np.arange(500, len(rows), 1000)
        rows[bad, columns] = change(rows[bad, columns])
        return rows, np.setdiff1d(np.arange(len(rows)), bad), bad
    return spoil


def evaluate(trials, filter_rows, spoil=as_is, with_mag=True):
    """Mean over the trials of score(); filter_rows(trial, rows) -> orientations."""
    results = []
    for trial in trials:
        rows, kept, *bad = spoil(trial)
        q = np.full((len(trial.imu), 4), np.nan)
        q[np.union1d(kept, bad[0]) if bad else kept] = filter_rows(trial, rows)
        if bad:
            q[bad[0]] = np.nan  # the bad sample itself is not scored; what it leaves behind is
        results.append(score(trial, q, with_mag))
    return np.mean(results, axis=0)
