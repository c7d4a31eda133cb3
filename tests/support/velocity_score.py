# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""What a replay says of the direction of flight, and how far it is from the truth. Nothing here is evstab's own code.

Two errors, both the angle between the direction in velocity.csv and a true velocity in the camera's frame at that time:
at its time, against the true velocity then; over the interval, against the mean true velocity over the interval of the flow
(interval_s in pairs.csv), which is what two images can tell. They differ where the camera swings faster than that.
Where the camera is slower than a quarter of its mean speed, a direction means little: left out.
"""
import csv
import json
import pathlib
import subprocess

import numpy as np

SLOW = 0.25  # of the mean speed


def read_table(path):
    """Numbers of a text file whose comments begin with #."""
    return np.loadtxt(path, ndmin=2)


def read_rows(path, n_columns):
    """The first columns of one of evstab's CSV files."""
    lines = [line for line in pathlib.Path(path).read_text().splitlines() if line and line[0] != "#"]
    return np.array([[float(field) for field in line.split(",")[:n_columns]] for line in lines]).reshape(-1, n_columns)


def angle(a, b):
    """Degrees between the rows of a and those of b."""
    cosine = (a * b).sum(axis=1) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


class Result:
    """The folder that a replay wrote."""

    def __init__(self, out):
        out = pathlib.Path(out)
        self.summary = json.loads((out / "summary.json").read_text())
        table = read_rows(out / "velocity.csv", 7)
        self.t, self.v, self.sigma, self.n_flow, self.inliers = (table[:, 0], table[:, 1:4], table[:, 4], table[:, 5],
                                                                 table[:, 6])
        with open(out / "pairs.csv", encoding="utf-8") as f:
            interval = {row["#t_s"]: float(row["interval_s"]) for row in csv.DictReader(f) if row["result"] == "valid"}
        self.interval = np.array([interval[f"{t:.6f}"] for t in self.t])

    def coverage(self):
        """Share of the time in which an estimate not older than 0.1 s is at hand."""
        duration = self.summary["duration_s"]
        ages = np.diff(np.append(self.t, self.summary["t_last_s"]))
        return float(np.minimum(ages, 0.1).sum()) / duration if len(self.t) else 0.0


class Truth:
    """Poses of the camera, `t px py pz qx qy qz qw`, and, if there are any, true velocities in its own frame, `t vx vy vz`."""

    def __init__(self, poses, velocity=None):
        table = read_table(poses)
        self.t, self.p, self.q = table[:, 0], table[:, 1:4], table[:, 4:8].copy()
        flips = (self.q[1:] * self.q[:-1]).sum(axis=1) < 0
        self.q[1:] *= np.where(np.cumsum(flips) % 2 == 1, -1.0, 1.0)[:, None]
        self.v = read_table(velocity)[:, :4] if velocity else None

    def _between(self, t, columns):
        return np.stack([np.interp(t, self.t, column) for column in columns.T], axis=1)

    def _to_camera(self, t, v):
        """Turn world vectors into the camera's frame at t."""
        q = self._between(t, self.q)
        q /= np.linalg.norm(q, axis=1)[:, None]
        u, w = -q[:, :3], q[:, 3:]
        twice = 2 * np.cross(u, v)
        return v + w * twice + np.cross(u, twice)

    def over_interval(self, t, interval):
        half = np.broadcast_to(interval, np.shape(t)) / 2
        moved = self._between(t + half, self.p) - self._between(t - half, self.p)
        return self._to_camera(t, moved / (2 * half)[:, None])

    def at(self, t):
        if self.v is None:
            return self.over_interval(t, 0.02)
        return np.stack([np.interp(t, self.v[:, 0], self.v[:, k]) for k in (1, 2, 3)], axis=1)


class Errors:
    """Of a result: `deg` at its time, `interval_deg` over the interval, of those samples that `kept` marks."""

    def __init__(self, result, truth, only=None):
        true = truth.at(result.t)
        speed = np.linalg.norm(true, axis=1)
        inside = (result.t - result.interval / 2 >= truth.t[0]) & (result.t + result.interval / 2 <= truth.t[-1])
        self.kept = (speed >= SLOW * np.linalg.norm(truth.at(truth.t[1:-1]), axis=1).mean()) & inside
        if only is not None:
            self.kept &= np.isin(np.round(result.t * 1e6), np.round(only * 1e6))
        self.all = angle(result.v, true)
        self.deg = self.all[self.kept]
        self.interval_deg = angle(result.v, truth.over_interval(result.t, result.interval))[self.kept]
        self.sigma = result.sigma[self.kept]
        self.mean = float(self.deg.mean()) if len(self.deg) else float("nan")
        self.median = float(np.median(self.deg)) if len(self.deg) else float("nan")

    def text(self):
        return (f"mean {self.mean:.2f}, median {self.median:.2f}, 95 % {np.percentile(self.deg, 95):.2f}, "
                f"max {self.deg.max():.2f} deg of {len(self.deg)}")


def replay(evstab, out, *arguments):
    """Run a replay; returns (its result, what it had to say)."""
    done = subprocess.run([str(evstab), "replay", "--no-report", "-o", str(out), *map(str, arguments)], text=True,
                          capture_output=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{done.stderr}evstab replay exits {done.returncode}")
    return Result(out), done.stderr


def gyro_bias(folder):
    """The mean error of the rates in a simulated flight's imu.txt."""
    imu, true = read_table(folder / "imu.txt"), read_table(folder / "velocity.txt")
    rate = np.stack([np.interp(imu[:, 0], true[:, 0], true[:, k]) for k in (4, 5, 6)], axis=1)
    inside = (imu[:, 0] >= true[0, 0]) & (imu[:, 0] <= true[-1, 0])
    return (imu[inside, 4:7] - rate[inside]).mean(axis=0)


def gyro_bias_word(bias):
    """For evstab replay --gyro-bias."""
    return ",".join(f"{b:.6f}" for b in bias)
