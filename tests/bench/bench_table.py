#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Instructions per event on the emulated targets, for docs/performance.md.

usage: bench_table.py TREES PLUGIN [--write docs/performance.md | --check docs/performance.md]

TREES holds the cross builds m4f m7 m55 rv32, PLUGIN is the built evcount.c;
`cmake --build build/release --target evs_update_docs` makes both and calls this script. Without an option the table is
printed. --check fails when a count has moved by more than 2 % or 1; it is skipped (status 77) if the compiler is
another one than that of the document.
"""
import argparse
import os
import re
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "support"))
from count_insns import count  # noqa: E402
from cross_tree import SKIP, Tree, compare_tables, read_section, replace_section  # noqa: E402

TARGETS = {  # Tree: (column head, machine)
    "m4f": ("Cortex-M4F", "mps2-an386"),
    "m7": ("Cortex-M7", "mps2-an500"),
    "m55": ("Cortex-M55", "mps3-an547"),
    "rv32": ("RV32IMAC", "riscv32-virt"),
}
RUN_QEMU = os.path.join(HERE, "..", "target", "run_qemu.sh")
PER_EVENT = [  # (row, regions that it adds up)
    ("undistort, full table", ["LOOKUP_FULL"]),
    ("undistort, full table, tile from table", ["LOOKUP_FULL_TILES"]),
    ("undistort, grid of 8 px", ["LOOKUP_GRID"]),
    ("undistort, grid of 8 px, tile computed", ["LOOKUP_GRID_TILES"]),
    ("window, area count", ["WINDOW"]),
    ("rotation", ["ROTATE"]),
    ("**all: full table + window + rotation**", ["LOOKUP_FULL_TILES", "WINDOW", "ROTATE"]),
    ("**all: grid + window + rotation**", ["LOOKUP_GRID_TILES", "WINDOW", "ROTATE"]),
    ("pipeline with a full table: all of that, FIFO, chunks, and a slice and an IMU sample (6D) a ms", ["PIPELINE"]),
]
PER_EVENT_OF_IMAGES = [
    ("image of warped events, nearest vote", "IWE_NEAREST"),
    ("image of warped events, bilinear votes", "IWE_BILINEAR"),
    ("image of warped events, Gaussian of 7 x 7 px", "IWE_GAUSSIAN"),
    ("time surface", "SURFACE"),
]
PER_PIXEL = [
    ("image of nearest votes, smoothed and scaled", "RENDER_NEAREST"),
    ("image of bilinear votes, smoothed and scaled", "RENDER_BILINEAR"),
    ("image of Gaussian votes, scaled", "RENDER_GAUSSIAN"),
    ("image of a time surface", "RENDER_SURFACE"),
    ("half an image, per pixel of the whole", "HALVE"),
]
PER_ESTIMATE = [
    ("warp: one velocity from 6000 events, mean square", "WARP_GLOBAL"),
    ("warp: one velocity from 6000 events, gradient", "WARP_GLOBAL_GRADIENT"),
    ("warp: 8 x 6 tiles from 16000 events, mean square", "WARP_TILED"),
    ("warp: 8 x 6 tiles from 16000 events, gradient", "WARP_TILED_GRADIENT"),
]
PER_CALL = [("new orientation, once per slice of at most 1 ms", "SLICE")]
PER_UPDATE = [
    ("attitude: gyro sample", "GYRO"),
    ("attitude: accelerometer sample", "ACCEL"),
    ("attitude: magnetometer sample", "MAG"),
    ("**attitude: update without magnetometer (6D)**", "UPDATE_6D"),
    ("**attitude: update with magnetometer (9D)**", "UPDATE_9D"),
    ("attitude: 6D, at rest, bias being learnt", "REST_6D"),
    ("attitude: 9D, at rest, bias being learnt", "REST_9D"),
]
PER_IMAGE = [  # (row, region, how many there are in it)
    ("corners of an image of 240×180", "CORNERS", "ONE"),
    ("flow: a corner tracked, default settings, 2 levels", "TRACK_ALL", "TRACKS"),
    ("**image pair: corners, half, 128 tracks**", "IMAGE_PAIR", "ONE"),
]
PER_DIRECTION = [
    ("**direction of flight from an image and a keyframe: corners, pyramids, 180 tracks, solution**", "DIRECTION"),
    ("a keyframe turned after a saccade", "TURN"),
]
PER_SOLVE = [
    ("**direction of velocity from 500 vectors**", "SOLVE_500"),
    ("the same from 100", "SOLVE_100"),
    ("from 500, on a plane, so that a rotation has to be ruled out", "SOLVE_500_PLANE"),
    ("from 500, with a prior on the residual rotation", "SOLVE_500_ROTATION"),
    ("gyro bias: what a pair with 100 vectors tells of it", "BIAS_100"),
]


def constants():
    with open(os.path.join(HERE, "bench_regions.h"), encoding="utf-8") as f:
        return {name: int(value) for name, value in re.findall(r"BENCH_(\w+) = (\d+)", f.read())}


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|---" + "|--:" * (len(head) - 1) + "|"]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def generate(trees, plugin):
    number = constants()
    counts, attitude, images, flow, solve, warp, velocity = {}, {}, {}, {}, {}, {}, {}
    for tree in trees:
        image = os.path.join(tree.path, "tests", "bench", "bench_events")
        counts[tree.name], _ = count(plugin, RUN_QEMU, TARGETS[tree.name][1], image)
        image = os.path.join(tree.path, "tests", "bench", "bench_attitude")
        attitude[tree.name], _ = count(plugin, RUN_QEMU, TARGETS[tree.name][1], image)
        image = os.path.join(tree.path, "tests", "bench", "bench_images")
        images[tree.name], _ = count(plugin, RUN_QEMU, TARGETS[tree.name][1], image)
        image = os.path.join(tree.path, "tests", "bench", "bench_flow")
        flow[tree.name], _ = count(plugin, RUN_QEMU, TARGETS[tree.name][1], image)
        image = os.path.join(tree.path, "tests", "bench", "bench_egomotion")
        solve[tree.name], _ = count(plugin, RUN_QEMU, TARGETS[tree.name][1], image)
        image = os.path.join(tree.path, "tests", "bench", "bench_warp")
        warp[tree.name], _ = count(plugin, RUN_QEMU, TARGETS[tree.name][1], image)
        image = os.path.join(tree.path, "tests", "bench", "bench_velocity")
        velocity[tree.name], _ = count(plugin, RUN_QEMU, TARGETS[tree.name][1], image)

    def per_call(name, tree, counts=counts, expected=number["BATCHES"]):
        calls, insns = counts[tree.name][number[name]]
        if calls != expected:
            raise SystemExit(f"{tree.name}: {name} ran {calls} times, not {expected}")
        return insns / calls

    names = [TARGETS[tree.name][0] for tree in trees]
    rows = [[row] + [f"{sum(per_call(r, t) for r in regions) / number['EVENTS']:.1f}" for t in trees]
            for row, regions in PER_EVENT]
    n_batches = number["IMAGES"] * number["IMAGE_BATCHES"]
    rows += [[row] + [f"{per_call(region, t, images, n_batches) / number['EVENTS']:.1f}" for t in trees]
             for row, region in PER_EVENT_OF_IMAGES]
    rows += [["warp: moving events by a flow grid"] +
             [f"{per_call('WARP_MAP', t, warp, 1) / number['WARP_EVENTS']:.1f}" for t in trees]]
    out = "Instructions per event:\n\n" + table(["step"] + names, rows)
    n_px = number["IMAGE_WIDTH"] * number["IMAGE_HEIGHT"]
    rows = [[row] + [f"{per_call(region, t, images, number['IMAGES']) / n_px:.1f}" for t in trees]
            for row, region in PER_PIXEL]
    out += "\nInstructions per pixel of an image of 12288 events at 240 x 180:\n\n" + table(["step"] + names, rows)
    rows = [[row] + [f"{per_call(region, t, warp, 1) / 1e6:.1f}" for t in trees] for row, region in PER_ESTIMATE]
    out += "\nMillions of instructions per window of 16000 events at 240 x 180:\n\n" + table(["step"] + names, rows)
    rows = [[row] + [f"{per_call(region, t):.0f}" for t in trees] for row, region in PER_CALL]
    rows += [[row] + [f"{per_call(region, t, attitude, number['UPDATES']):.0f}" for t in trees]
             for row, region in PER_UPDATE]
    number["ONE"] = 1
    rows += [[row] + [f"{per_call(region, t, flow, 1) / number[n]:.0f}" for t in trees] for row, region, n in PER_IMAGE]
    rows += [[row] + [f"{per_call(region, t, solve, number['SOLVES']):.0f}" for t in trees] for row, region in PER_SOLVE]
    rows += [[row] + [f"{per_call(region, t, velocity, 1):.0f}" for t in trees] for row, region in PER_DIRECTION]
    return out + "\nInstructions per call:\n\n" + table(["step"] + names, rows)


def main():
    parser = argparse.ArgumentParser(description="Instructions per event on the emulated targets.")
    parser.add_argument("trees")
    parser.add_argument("plugin")
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--write", metavar="FILE")
    group.add_argument("--check", metavar="FILE")
    args = parser.parse_args()

    trees = [Tree(args.trees, name) for name in TARGETS]
    versions = ", ".join(f"{os.path.basename(t.compiler())} {t.compiler_version()}" for t in (trees[0], trees[-1]))
    stamp = f"Compilers: {versions}; `-O2`.\n\n"
    if args.check and not read_section(args.check, "performance").startswith(stamp):
        print(f"skipped: {args.check} was made with other compilers than {versions}")
        return SKIP
    section = stamp + generate(trees, args.plugin)
    if args.write:
        content = replace_section(args.write, "performance", section)
        with open(args.write, "w", encoding="utf-8") as f:
            f.write(content)
    elif args.check:
        documented = read_section(args.check, "performance")
        complaints = compare_tables(documented, section, lambda a, b: abs(a - b) <= max(1, 0.02 * a))
        if complaints:
            print(f"{args.check} is not what is counted:", *complaints, sep="\n  ")
            print("If the change is meant: cmake --build build/release --target evs_update_docs")
            return 1
    else:
        print(section, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
