#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Play a recording through the library and compare the CRC of every stage with tests/golden/bits.txt.

usage: bits.py RECORDING --cache DIR [--data DIR] -- COMMAND...
       bits.py --update --cache DIR --data DIR -- COMMAND...

COMMAND is tests/target/replay as built for the host, or an emulator and the image; the recording and the setting are added
to it. Every compiler, optimization level, kernel and processor is held against the same file, so all agree. Recordings
are made once and kept in the cache. Exit status 77: the recording's data are not here.

A change of the output bits must be meant: it takes --update, which `cmake --build build/release --target
evs_update_golden` runs, and a line under "Numerics" in the changelog.
"""
import argparse
import os
import re
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
GOLDEN = os.path.join(HERE, "bits.txt")
MAKER = os.path.join(HERE, "..", "support", "make_recording.py")
SETTINGS = ("full", "grid", "duration", "velocity")
ONLY = {"sim1": ("velocity",)}  # Not every setting for a recording that is there for one of them
SHAPES = "ecd/shapes_rotation"
RECORDINGS = {  # Name: options of make_recording.py with paths in the data folder
    "synthetic": {},
    "shapes_02": {"--events": f"{SHAPES}/events_02.097-02.196.txt", "--imu": f"{SHAPES}/imu.txt",
                  "--calib": "ecd/calib.txt"},
    "shapes_43": {"--events": f"{SHAPES}/events_43.499-43.605.txt", "--imu": f"{SHAPES}/imu.txt",
                  "--calib": "ecd/calib.txt"},
    "sim1": {"--events": "sim/sim1_21/events.txt.gz", "--imu": "sim/sim1_21/imu.txt",
             "--calib": "sim/sim1_21/calib.txt"},
    "slider": {"--events": "ecd/slider_depth/events.txt.gz", "--calib": "ecd/slider_depth/calib.txt"},
}
SKIP = 77


def recording(name, cache, data):
    """The path of a recording, made if it is not there yet; None if its data are missing."""
    options = {option: os.path.join(data or "", path) for option, path in RECORDINGS[name].items()}
    missing = [path for path in options.values() if not os.path.exists(path)]
    if missing:
        print(f"skipped: no {missing[0]} (set EVS_DATA_DIR to the folder of the recordings)")
        return None
    path = os.path.join(cache, f"{name}.evr")
    if not os.path.exists(path) or os.path.getmtime(path) < os.path.getmtime(MAKER):
        os.makedirs(cache, exist_ok=True)
        part = f"{path}.{os.getpid()}"  # Two tests may make it at once; each moves a complete file into place.
        words = [word for pair in options.items() for word in pair]
        if not words:
            words = ["--synthetic"]
        elif "--imu" not in options:
            words.append("--rocking")
        subprocess.run([sys.executable, MAKER, part, *words], check=True)
        os.replace(part, path)
    return path


def play(name, path, command):
    out = ""
    for setting in ONLY.get(name, SETTINGS):
        done = subprocess.run(command + [path, setting], stdout=subprocess.PIPE, text=True, check=False)
        if done.returncode != 0:
            raise SystemExit(f"{' '.join(command)} {path} {setting}: exit status {done.returncode}\n{done.stdout}")
        out += f"[{name} {setting}]\n{done.stdout}\n"
    return out


def golden(name):
    with open(GOLDEN, encoding="ascii") as f:
        parts = re.findall(rf"^\[{name} \w+\]\n(?:[^\[\n].*\n)*\n", f.read(), re.M)
    return "".join(parts)


def main():
    if "--" not in sys.argv:
        raise SystemExit(__doc__)
    split = sys.argv.index("--")
    parser = argparse.ArgumentParser(description="Compare the CRC of every stage with the golden ones.")
    parser.add_argument("recording", nargs="?", choices=sorted(RECORDINGS))
    parser.add_argument("--cache", required=True)
    parser.add_argument("--data")
    parser.add_argument("--update", action="store_true")
    args = parser.parse_args(sys.argv[1:split])
    command = sys.argv[split + 1:]

    if args.update:
        out = "# CRC-32 of every stage, per recording and setting. Written by bits.py --update; never by hand.\n\n"
        for name in RECORDINGS:
            path = recording(name, args.cache, args.data)
            if path is None:
                return 1
            out += play(name, path, command)
        with open(GOLDEN, "w", encoding="ascii") as f:
            f.write(out)
        return 0

    path = recording(args.recording, args.cache, args.data)
    if path is None:
        return SKIP
    got, want = play(args.recording, path, command), golden(args.recording)
    if got != want:
        print(f"{GOLDEN} says:\n{want}this build says:\n{got}")
        print("If the change is meant: cmake --build build/release --target evs_update_golden, and the changelog")
        return 1
    print(got, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
