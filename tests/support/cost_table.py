#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""The short table of costs in README.md, drawn from docs/memory.md and docs/performance.md.

usage: cost_table.py [--write | --check]

Measures nothing: it repeats what those pages say, and --check tells when README.md says something else.
"""
import argparse
import os
import sys

from cross_tree import read_section, replace_section

ROOT = os.path.normpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
README = os.path.join(ROOT, "README.md")
CORES = ["Cortex-M0+", "Cortex-M4F", "Cortex-M7", "Cortex-M55", "RV32IMAC"]


def tables(page, name):
    """Yields each table of a page's generated part as {row: {column: text}}."""
    rows = None
    for line in read_section(os.path.join(ROOT, "docs", page), name).splitlines() + [""]:
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if not line.startswith("|"):
            if rows:
                yield rows
            rows = None
        elif rows is None:
            head, rows = cells, {}
        elif not line.startswith("|---"):
            rows[cells[0]] = dict(zip(head[1:], cells[1:]))


def row(name, cells):
    return "| " + " | ".join([name] + [cells.get(core, "–") for core in CORES]) + " |\n"


def generate():
    flash, ram, stack, *_, pipelines = tables("memory.md", "memory")
    events, *_, calls = tables("performance.md", "performance")
    deepest = {core: str(max(int(cells[core]) for cells in stack.values())) for core in CORES}
    out = "| | " + " | ".join(CORES) + " |\n|---" + "|--:" * len(CORES) + "|\n"
    out += row("flash, all modules, bytes", flash["all modules"])
    out += row("RAM of its own, bytes", ram["all modules"])
    out += row("stack of the deepest call, bytes", deepest)
    for name in ("stabilized events, 240 × 180", "… and the direction of flight, 240 × 180"):
        out += row(f"memory of the caller, bytes: {name}", pipelines[name])
    out += row("instructions per event, exact table", events["**all: full table + window + rotation**"])
    out += row("instructions per event, grid of 3 KB", events["**all: grid + window + rotation**"])
    direction = next(cells for name, cells in calls.items() if name.startswith("**direction of flight"))
    out += row("million instructions per direction of flight, 180 features",
               {core: f"{int(count) / 1e6:.1f}" for core, count in direction.items()})
    return out


def main():
    parser = argparse.ArgumentParser(description="The short table of costs in README.md.")
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--write", action="store_true")
    group.add_argument("--check", action="store_true")
    args = parser.parse_args()
    table = generate()
    if args.write:
        content = replace_section(README, "cost", table)
        with open(README, "w", encoding="utf-8") as f:
            f.write(content)
    elif args.check:
        if read_section(README, "cost") != table:
            print(f"README.md says:\n{read_section(README, 'cost')}docs/ says:\n{table}")
            print("To repeat it: python3 tests/support/cost_table.py --write")
            return 1
    else:
        print(table, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
