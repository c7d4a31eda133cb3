#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Runs `evstab bench` briefly: what it prints and writes makes sense, whatever the speed of this computer.

usage: bench.py EVSTAB SOURCE_DIR
"""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

EVSTAB, SOURCE = os.path.abspath(sys.argv[1]), sys.argv[2]
FAULTS = []


def check(what, ok, detail=""):
    print(f"{'ok  ' if ok else 'FAIL'} {what}: {detail}")
    if not ok:
        FAULTS.append(what)


def run(*arguments):
    return subprocess.run([EVSTAB, "bench", *arguments], capture_output=True, text=True, timeout=100)


def git(*arguments):
    try:
        done = subprocess.run(["git", "-C", SOURCE, *arguments], capture_output=True, text=True, timeout=60)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def test_usage():
    done = run("--help")
    check("--help", done.returncode == 0 and "Usage: evstab bench" in done.stdout and "memcpy" in done.stdout)
    for option, value in (("--size", "240"), ("--size", "9000x9000"), ("--events", "many"), ("--events", "10"), ("--rounds", "0")):
        done = run(option, value)
        check(f"{option} {value}", done.returncode == 2 and option in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr)
    done = run("recording")
    check("a word", done.returncode == 2 and "one word too many" in done.stderr, done.stderr)
    done = run("--events", "1000", "--rounds", "1", "--json", "/nosuch/x.json", "-q")
    check("nowhere to write", done.returncode == 1 and "/nosuch/x.json" in done.stderr, done.stderr)


def test_figures(folder):
    for size, n in (("240x180", 100000), ("64x48", 5001)):
        path = folder / f"{size}.json"
        done = run("--size", size, "--events", str(n), "--rounds", "2", "--json", str(path))
        check(f"{size}: runs", done.returncode == 0 and "ns per event" in done.stdout, done.stderr)
        x = json.loads(path.read_text())
        check(f"{size}: all events kept", x["kept"] == x["events"] == n, x["kept"])
        # 34 x 26 tiles, 200 events each: the reference opens one window per some ten thousand clustered events.
        if size == "240x180":
            check(f"{size}: windows", n / 40000 < x["windows"] < n / 4000, x["windows"])
        steps = x["steps"]
        check(f"{size}: steps", list(steps) == ["memcpy", "undistort", "window", "rotate", "pipeline"], list(steps))
        for name, step in steps.items():
            check(f"{size}: {name}", 0 < step["least_ns_per_event"] <= step["ns_per_event"] < 1e5 and
                  abs(step["events_per_s"] * step["ns_per_event"] / 1e9 - 1) < 1e-6 and
                  abs(step["ratio_to_memcpy"] - step["ns_per_event"] / steps["memcpy"]["ns_per_event"]) < 1e-4 * step["ratio_to_memcpy"],
                  step["ns_per_event"])
        parts = sum(steps[name]["least_ns_per_event"] for name in ("undistort", "window"))
        check(f"{size}: the whole costs more than two of its parts", steps["pipeline"]["least_ns_per_event"] > 0.5 * parts, parts)
        check(f"{size}: processor", x["cpu"] != "" and x["cpu"] in done.stdout, x["cpu"])
        commit = git("describe", "--tags", "--always", "--dirty") if git("rev-parse", "--show-toplevel") == os.path.realpath(SOURCE) else ""
        # Built before the last commit or edit, perhaps: the form is what can be told.
        form = re.fullmatch(r"[A-Za-z0-9._+/-]+", x["commit"]) is not None
        check(f"{size}: commit", form and (x["commit"] != "unknown" or commit == ""), f"{x['commit']}; now {commit or 'no git'}")
    quiet = run("--events", "1000", "--rounds", "1", "-q")
    check("--quiet", quiet.returncode == 0 and quiet.stdout == "" and quiet.stderr == "", quiet.stderr)


def main():
    test_usage()
    with tempfile.TemporaryDirectory(prefix="evstab_bench_") as folder:
        test_figures(pathlib.Path(folder))
    print(f"{len(FAULTS)} faults")
    sys.exit(1 if FAULTS else 0)


main()
