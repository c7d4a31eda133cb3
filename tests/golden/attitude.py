#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""The attitude filter on real recordings: its accuracy, with the defaults, must not get worse.

usage: attitude.py ATTITUDE_RUN   (data: $EVS_DATA_DIR; exit status 77 where they or numpy are missing)

The bounds of the undisturbed cases are what the project promises (docs/accuracy.md has what it measures); those of the
spoilt ones lie a little above what was measured when they were written.
"""
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
try:
    import numpy as np
    import attitude_score as at
except ImportError as missing:
    print(f"SKIPPED: {missing}")
    sys.exit(77)

G = 9.80665
ANY = np.inf
CASES = [  # name, how the data are spoilt, magnetometer, upper bounds: total, inclination, heading, rel 0.1 s, rel 1 s
    ("as recorded", at.as_is, True, (2.25, 0.76, ANY, 0.466, 1.001)),
    ("as recorded, no magnetometer", at.as_is, False, (5.06, 0.76, ANY, 0.4505, 0.800)),
    ("gyro clipped at 500 deg/s", at.clipped(at.GYRO, np.radians(500)), True, (8.0, 3.6, ANY, ANY, ANY)),
    ("accelerometer clipped at 4 g", at.clipped(at.ACCEL, 4 * G), True, (3.2, 1.25, ANY, ANY, ANY)),
    ("switched on in motion", at.from_motion, True, (7.5, 2.1, ANY, ANY, ANY)),
    ("95 Hz", at.every(3), True, (2.25, 0.8, ANY, ANY, ANY)),
    ("a fifth of the samples lost", at.with_losses, True, (4.4, 2.2, ANY, ANY, ANY)),
]
GLITCHES = [  # one sample in a thousand; on every third trial, against the same trials as recorded
    ("gyro 35 rad/s", at.with_glitch(at.GYRO, lambda x: 0 * x + 35.0)),
    ("accelerometer -160 m/s^2", at.with_glitch(at.ACCEL, lambda x: 0 * x - 160.0)),
    ("gravity upside down", at.with_glitch(at.ACCEL, lambda x: -x)),
    ("zeros", at.with_glitch(slice(4, 10), lambda x: 0 * x)),
    ("field reversed", at.with_glitch(at.MAG, lambda x: -x)),
    ("field thirtyfold", at.with_glitch(at.MAG, lambda x: 30 * x)),
]
GLITCH_MAY_ADD = (0.05, 0.03, ANY, ANY, ANY)


def main():
    program, data = sys.argv[1], os.environ.get("EVS_DATA_DIR", "")
    trials = at.load_broad(data)
    if not trials:
        print(f"SKIPPED: no recordings in {data}/broad (set EVS_DATA_DIR)")
        return 77
    def judge(name, trials, spoil, with_mag, bounds):
        options = [] if with_mag else ["--no-mag"]
        got = at.evaluate(trials, lambda _, rows: at.run(program, rows, *options)[0], spoil, with_mag)
        bad = any(g > b for g, b in zip(got, bounds) if np.isfinite(b))
        numbers = " ".join(f"{g:6.3f}" for g in got)
        limits = " ".join(f"{b:6.3f}" if np.isfinite(b) else "     -" for b in bounds)
        print(f"{'WORSE' if bad else 'ok   '} {name:32} {numbers}   at most {limits}")
        return got, bad

    failed = [judge(name, trials, spoil, with_mag, bounds)[1] for name, spoil, with_mag, bounds in CASES]
    some = trials[::3]
    unspoilt, _ = judge("every third trial, as recorded", some, at.as_is, True, (ANY,) * 5)
    failed += [judge(name, some, spoil, True, unspoilt + np.array(GLITCH_MAY_ADD))[1] for name, spoil in GLITCHES]
    print(f"{len(trials)} trials; degrees: total, inclination, heading, rel 0.1 s, rel 1 s")
    return 1 if any(failed) else 0


if __name__ == "__main__":
    sys.exit(main())
