#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""End-to-end error of the direction of flight, by what is switched on and off; write a section of docs/accuracy.md.

usage: compare_velocity.py EVSTAB [--data DIR] [--write]

Replays recordings of EVS_DATA_DIR and flights that it simulates, each as often as there are rows in the tables. Needs numpy.
Each replay begins at three different times, so that windows begin elsewhere. Without --write it only prints. What an error is,
tests/support/velocity_score.py says. Takes four minutes on one core.
"""
import argparse
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))
import cross_tree  # noqa: E402
import velocity_score as score  # noqa: E402

PAGE = ROOT / "docs" / "accuracy.md"
RECORDED = [("sim1_21", "sim/sim1_21"), ("sim3_23", "sim/sim3_23"), ("slider_depth", "ecd/slider_depth")]
SIMULATED = [("handheld", "room --motion handheld --seed 101"), ("sweep", "room --motion sweep --seed 107"),
             ("hover", "room --motion hover --seed 103"), ("flap", "room --motion flap --seed 104"),
             ("poster", "poster --motion handheld --seed 105"),
             ("346×260", "room --motion handheld --seed 106 --size 346x260")]
SIMULATE = "--duration 2.5 --no-frames"
FROM_S = (0.0, 0.015, 0.03)
BIAS = "X,Y,Z"  # the mean error of the rates of imu.txt

TRUTH = "--attitude truth"
ROWS = [
    ("**default**", TRUTH),
    ("warp by the flow of the pair before", f"{TRUTH} --warp predicted"),
    ("warp by one velocity, contrast maximized", f"{TRUTH} --warp global"),
    ("warp by tiles, contrast maximized", f"{TRUTH} --warp tiled"),
    ("time surface", f"{TRUTH} --image surface"),
    ("ERL-V as published", f"{TRUTH} --method erlv-paper"),
    ("full ERL on the same flow", f"{TRUTH} --method erl"),
    ("one rotation per window", f"{TRUTH} --rotation window"),
    ("one rotation per window, warp by tiles", f"{TRUTH} --rotation window --warp tiled"),
    ("one rotation per short window", f"{TRUTH} --rotation window --window area:34x26:200"),
    ("one rotation per short window, warp by tiles", f"{TRUTH} --rotation window --window area:34x26:200 --warp tiled"),
    ("the published settings", f"{TRUTH} --paper"),
    ("not stabilized", "--attitude none --velocity on"),
    ("not stabilized, full ERL", "--attitude none --velocity on --method erl"),
    ("attitude from the IMU", "--attitude imu"),
    ("attitude from the IMU, its bias told", f"--attitude imu --gyro-bias {BIAS}"),
]


class Flight:
    def __init__(self, name, folder):
        self.name, self.folder = name, pathlib.Path(folder)
        velocity = self.folder / "velocity.txt"
        self.truth = score.Truth(self.folder / "groundtruth.txt", velocity if velocity.exists() else None)
        self.has_imu = (self.folder / "imu.txt").exists()

    def replay(self, evstab, temp, options):
        """Errors and results of replays that begin at different times."""
        if BIAS in options:
            options = options.replace(BIAS, score.gyro_bias_word(score.gyro_bias(self.folder)))
        words = options.split()
        if "346" in self.name:
            words += ["--size", "346x260"]
        results = [score.replay(evstab, temp / "out", self.folder, *words, "--from", start)[0] for start in FROM_S]
        return Measured(results, [score.Errors(result, self.truth) for result in results])


class Measured:
    def __init__(self, results, errors):
        self.interval_deg, self.deg, self.sigma = (np.concatenate([getattr(e, name) for e in errors])
                                                   for name in ("interval_deg", "deg", "sigma"))
        self.means = [float(e.interval_deg.mean()) for e in errors if len(e.interval_deg)]
        self.coverage = float(np.mean([result.coverage() for result in results]))
        self.per_s = float(np.mean([len(result.t) / result.summary["duration_s"] for result in results]))


def simulate(evstab, temp):
    for name, scene in SIMULATED:
        folder = temp / name
        subprocess.run([evstab, "sim", *scene.split(), *SIMULATE.split(), "-q", "-o", str(folder)], check=True)
        yield Flight(name, folder)


def overview(flights, evstab, temp):
    out = ("| recording | estimates a second | at hand | over the interval: mean | of each start | median | 95 % | at its time: mean "
           "| median | within 1 σ | 2 σ |\n|---" + "|--:" * 10 + "|\n")
    for flight in flights:
        m = flight.replay(evstab, temp, TRUTH)
        e = m.interval_deg
        within = [100 * float((e <= k * m.sigma).mean()) for k in (1, 2)]
        out += (f"| {flight.name} | {m.per_s:.1f} | {100 * m.coverage:.0f} % | {e.mean():.2f} | "
                f"{', '.join(f'{mean:.2f}' for mean in m.means)} | {np.median(e):.2f} | {np.percentile(e, 95):.2f} | {m.deg.mean():.2f} | "
                f"{np.median(m.deg):.2f} | {within[0]:.0f} % | {within[1]:.0f} % |\n")
    return out


def cell(flight, evstab, temp, options):
    if "imu" in options and not flight.has_imu:
        return None, "–"
    m = flight.replay(evstab, temp, options)
    if len(m.interval_deg) == 0:
        return None, "none"
    mean = float(m.interval_deg.mean())
    return mean, f"{mean:.1f}" if m.coverage >= 0.8 else f"{mean:.1f} ({100 * m.coverage:.0f} %)"


def variants(flights, evstab, temp):
    out = "| | " + " | ".join(flight.name for flight in flights) + " | mean | options of `evstab replay` |\n"
    out += "|---" + "|--:" * (len(flights) + 1) + "|---|\n"
    for name, options in ROWS:
        cells = [cell(flight, evstab, temp, options) for flight in flights]
        values = [value for value, _ in cells if value is not None]
        mean = f"{np.mean(values):.1f}" if len(values) == len(flights) else "–"
        out += f"| {name} | " + " | ".join(text for _, text in cells) + f" | {mean} | `{options}` |\n"
        print(out.splitlines()[-1], file=sys.stderr, flush=True)
    return out


def main():
    parser = argparse.ArgumentParser(description="End-to-end error of the direction of flight.")
    parser.add_argument("program")
    parser.add_argument("--data", default=os.environ.get("EVS_DATA_DIR", ""))
    parser.add_argument("--write", action="store_true", help="write the section of docs/accuracy.md")
    args = parser.parse_args()
    evstab = str(pathlib.Path(args.program).resolve())
    data = pathlib.Path(args.data)
    missing = [str(data / path) for _, path in RECORDED if not (data / path / "groundtruth.txt").exists()]
    if missing:
        raise SystemExit(f"{', '.join(missing)}: not there; give --data or set EVS_DATA_DIR")

    with tempfile.TemporaryDirectory(prefix="evstab_velocity_") as name:
        temp = pathlib.Path(name)
        flights = [Flight(name, data / path) for name, path in RECORDED] + list(simulate(evstab, temp))
        first, second = overview(flights, evstab, temp), variants(flights, evstab, temp)
    commit = subprocess.run(["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True,
                            check=False).stdout.strip()
    scenes = "\n".join(f"    evstab sim {scene} {SIMULATE} -o FLIGHT   # {name}" for name, scene in SIMULATED)
    text = f"""Written by a command; everything in this section was measured in one run, at commit {commit}:

    cmake --preset release && cmake --build --preset release
    python3 tests/bench/compare_velocity.py build/release/host_tools/evstab --data $EVS_DATA_DIR --write

Degrees between the direction in `velocity.csv` and the truth, from events alone. The flow spans an interval between two images, and
tells the mean velocity over it: *over the interval* is the error against that, *at its time* the one against the velocity in the
middle. They differ where the camera swings faster: the flapping flight heaves at 5 Hz. *At hand* is the share of the time in which an
estimate is not older than 0.1 s; *within σ* is the share of the errors over the interval within `sigma_deg` (63 and 98 % if Gaussian).
`sim1_21`, `sim3_23` and `slider_depth` are the recordings of EVS_DATA_DIR, the last one real; the others were simulated:

{scenes}

The last one is replayed with `--size 346x260`. Each replay is made three times, `--from {", ".join(f"{s:g}" for s in FROM_S)}`: windows that begin elsewhere make other
images, and the mean of one flight differs by some tenths of a degree, in the table *of each start*; all else is of the three together.
`tests/support/velocity_score.py` has the definitions; `ctest -R golden.velocity` holds `evstab` to the goals.

{first}
### What each part is worth
Mean error over the interval; in parentheses the share of the time in which an estimate is at hand, where it is below 80 %. A row is
`evstab replay FLIGHT -o OUT` with its options. In the last row X,Y,Z is the mean error of the rates in `imu.txt`.

{second}
"""
    print(text)
    if args.write:
        content = cross_tree.replace_section(PAGE, "velocity", text)
        PAGE.write_text(content, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
