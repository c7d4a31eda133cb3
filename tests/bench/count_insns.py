#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Run a bare-metal program in QEMU and count the instructions of its marked regions.

usage: count_insns.py PLUGIN RUN_QEMU BOARD IMAGE [--expect ID=CALLS:INSTRUCTIONS ...]

Runs twice and insists on the same counts. With --expect they must be exactly these.
"""
import argparse
import os
import re
import subprocess
import sys
import tempfile


def run_once(plugin, run_qemu, board, image):
    with tempfile.TemporaryDirectory() as work:
        out = os.path.join(work, "counts.txt")
        env = dict(os.environ, QEMU_EXTRA=f"-plugin {plugin},out={out}")
        done = subprocess.run(["sh", run_qemu, board, image], env=env, capture_output=True, text=True, check=False)
        if done.returncode != 0 or not os.path.exists(out):
            raise SystemExit(f"{image} on {board}: exit status {done.returncode}\n{done.stdout}{done.stderr}")
        with open(out, encoding="utf-8") as f:
            return f.read(), done.stdout


def count(plugin, run_qemu, board, image):
    """Returns ({region: (calls, instructions)}, what the program printed)."""
    (first, printed), (second, _) = (run_once(plugin, run_qemu, board, image) for _ in range(2))
    if first != second:
        raise SystemExit(f"{image} on {board}: two runs, two counts:\n{first}\n{second}")
    found = re.findall(r"^region (\d+) calls (\d+) instructions (\d+)$", first, re.M)
    return {int(region): (int(calls), int(insns)) for region, calls, insns in found}, printed


def main():
    parser = argparse.ArgumentParser(description="Count the instructions of marked regions in QEMU.")
    for name in ("plugin", "run_qemu", "board", "image"):
        parser.add_argument(name)
    parser.add_argument("--expect", nargs="+", default=[], metavar="ID=CALLS:INSTRUCTIONS")
    args = parser.parse_args()

    counts, printed = count(args.plugin, args.run_qemu, args.board, args.image)
    sys.stdout.write(printed)
    for region, (calls, insns) in sorted(counts.items()):
        print(f"region {region}: {calls} calls, {insns} instructions")
    expected = {int(r): (int(c), int(i)) for r, c, i in (re.split("[=:]", e) for e in args.expect)}
    if expected and counts != expected:
        print(f"expected {expected}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
