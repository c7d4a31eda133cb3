#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Flash, RAM and stack of every module of the library on every target, for docs/memory.md.

usage: memory_table.py TREES [--write docs/memory.md | --check docs/memory.md]

TREES holds the cross builds m0plus m4f m7 m55 rv32; `cmake --build build/release --target evs_update_docs` makes them
and calls this script. Without an option the tables are printed.

Stack is the deepest path of calls that begins in the module, from GCC's -fstack-usage and -fcallgraph-info. Recursion,
calls through pointers and stack of unknown size have no such depth: they are errors. What the compiler's own helpers
(memcpy, 64-bit division) use comes on top.

--check fails when a number has moved by more than 2 % or 16 bytes; it is skipped (status 77) if the compiler is another
one than that of the document, because then every number moves.
"""
import argparse
import glob
import os
import re
import subprocess
import sys
import tempfile

from cross_tree import SKIP, Tree, compare_tables, read_section, replace_section

TARGETS = {"m0plus": "Cortex-M0+", "m4f": "Cortex-M4F", "m7": "Cortex-M7", "m55": "Cortex-M55", "rv32": "RV32IMAC"}
SOURCE = os.path.normpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))


def sections(tree, obj):
    """(text, data + bss) of an object file, in bytes; text includes constants."""
    out = subprocess.run([tree.tool("size"), obj], check=True, capture_output=True, text=True).stdout
    text, data, bss = (int(w) for w in out.splitlines()[1].split()[:3])
    return text, data + bss


class CallGraph:
    """Who calls whom, and the frame of each function, merged over all files of the library."""

    NODE = re.compile(r'^node: \{ title: "([^"]+)" label: "[^"]*\\n(\d+) bytes \(([^)]*)\)')
    EDGE = re.compile(r'^edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')

    def __init__(self):
        self.frame, self.calls, self.home = {}, {}, {}

    def add(self, module, path):
        with open(path, encoding="utf-8") as f:
            for line in f:
                if match := self.NODE.match(line):
                    name, size, kind = match.groups()
                    if kind != "static":
                        raise SystemExit(f"{name}: stack of unknown size ({kind})")
                    self.frame[name] = int(size)
                    self.home[name] = module
                elif match := self.EDGE.match(line):
                    caller, callee = match.groups()
                    if callee == "__indirect_call":
                        raise SystemExit(f"{caller}: calls through a pointer")
                    self.calls.setdefault(caller, set()).add(callee)

    def depth(self, name, path=()):
        if name in path:
            raise SystemExit(f"recursion: {' -> '.join(path + (name,))}")
        below = [self.depth(callee, path + (name,)) for callee in self.calls.get(name, ())]
        return self.frame.get(name, 0) + max(below, default=0)

    def deepest(self, module):
        return max((self.depth(f) for f, home in self.home.items() if home == module), default=0)


def contexts():
    """The types that a caller has to place: those that some evs_..._init() sets up."""
    found = {}
    for header in sorted(glob.glob(os.path.join(SOURCE, "lib", "include", "evs", "*.h"))):
        with open(header, encoding="utf-8") as f:
            for name in re.findall(r"\bevs_\w+_init\(\s*(evs_\w+_t)\s*\*", f.read()):
                found.setdefault(name, os.path.basename(header))
    return found


def sizes_of(tree, types):
    """sizeof of each type on the target: the sizes of arrays of that many bytes."""
    with tempfile.TemporaryDirectory() as work:
        source, obj = os.path.join(work, "sizes.c"), os.path.join(work, "sizes.o")
        with open(source, "w", encoding="utf-8") as f:
            for header in sorted(set(types.values())):
                f.write(f'#include "evs/{header}"\n')
            for name in types:
                f.write(f"extern char sizeof_{name}[]; char sizeof_{name}[sizeof({name})];\n")
        tree.compile(source, obj)
        out = subprocess.run([tree.tool("nm"), "-S", obj], check=True, capture_output=True, text=True).stdout
    return {name: int(size, 16) for size, name in re.findall(r"^\w+ (\w+) \w sizeof_(\w+)$", out, re.M)}


# Whole pipelines: context and memory block together, as a user of the default settings places them.
PIPELINE = "sizeof(evs_pipeline_t) + EVS_PIPELINE_BYTES({w}, {h}, 8u, false, 34u * 26u, 2048u, 32u, 128u)"
PIPELINES = {
    "stabilized events, 240 × 180": PIPELINE.format(w=240, h=180),
    "… and the direction of flight, 240 × 180":
        PIPELINE.format(w=240, h=180) + " + EVS_PIPELINE_VELOCITY_BYTES(240, 180)",
    "stabilized events, 346 × 260": PIPELINE.format(w=346, h=260),
    "… and the direction of flight, 346 × 260":
        PIPELINE.format(w=346, h=260) + " + EVS_PIPELINE_VELOCITY_BYTES(346, 260)",
}


def sizes_of_pipelines(tree):
    """What each whole pipeline occupies on the target: the macros of its header are constant expressions."""
    with tempfile.TemporaryDirectory() as work:
        source, obj = os.path.join(work, "pipelines.c"), os.path.join(work, "pipelines.o")
        with open(source, "w", encoding="utf-8") as f:
            f.write('#include "evs/pipeline.h"\n')
            for i, size in enumerate(PIPELINES.values()):
                f.write(f"extern char pipeline_{i}[]; char pipeline_{i}[{size}];\n")
        tree.compile(source, obj)
        out = subprocess.run([tree.tool("nm"), "-S", obj], check=True, capture_output=True, text=True).stdout
    sizes = {int(i): int(size, 16) for size, i in re.findall(r"^\w+ (\w+) \w pipeline_(\d+)$", out, re.M)}
    return {name: sizes[i] for i, name in enumerate(PIPELINES)}


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|---" + "|--:" * (len(head) - 1) + "|"]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def generate(trees):
    text, ram, stack, modules = {}, {}, {}, []
    for tree in trees:
        graph = CallGraph()
        for module, obj in tree.modules():
            if module not in modules:
                modules.append(module)
            text[module, tree.name], ram[module, tree.name] = sections(tree, obj)
            graph.add(module, obj[:-len(".obj")] + ".ci")
        for module in modules:
            stack[module, tree.name] = graph.deepest(module)
    names = [TARGETS[tree.name] for tree in trees]
    modules = [m for m in modules if any(text[m, tree.name] for tree in trees)]  # Kernels of host processors are empty.

    def cells(values, module):
        return [values[module, tree.name] for tree in trees]

    def totals(values):
        return [sum(values[module, tree.name] for module in modules) for tree in trees]

    out = "Flash (code and constants), bytes:\n\n"
    out += table(["module"] + names, [[m] + cells(text, m) for m in modules] + [["all modules"] + totals(text)])
    out += "\nRAM that the library keeps for itself (.data and .bss), bytes:\n\n"
    out += table(["module"] + names, [["all modules"] + totals(ram)])
    out += "\nStack of the deepest call, bytes:\n\n"
    out += table(["module"] + names, [[m] + cells(stack, m) for m in modules])
    if types := contexts():
        sizes = {tree.name: sizes_of(tree, types) for tree in trees}
        out += "\nContexts that the caller places (`sizeof`), bytes; buffers come on top, by the macros of each header:\n\n"
        out += table(["type"] + names, [[f"`{t}`"] + [sizes[tree.name][t] for tree in trees] for t in types])
    whole = {tree.name: sizes_of_pipelines(tree) for tree in trees}
    out += ("\nWhole pipelines, context and buffers, with a table of step 8, 34 x 26 tiles, 2048 events, 32 orientations, "
            "batches of 128, bytes:\n\n")
    out += table(["pipeline"] + names, [[name] + [whole[tree.name][name] for tree in trees] for name in PIPELINES])
    return out


def main():
    parser = argparse.ArgumentParser(description="Flash, RAM and stack per module and target.")
    parser.add_argument("trees")
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--write", metavar="FILE")
    group.add_argument("--check", metavar="FILE")
    args = parser.parse_args()

    trees = [Tree(args.trees, name) for name in TARGETS]
    versions = ", ".join(f"{os.path.basename(t.compiler())} {t.compiler_version()}" for t in (trees[0], trees[-1]))
    stamp = f"Compilers: {versions}; `-O2`, one section per function.\n\n"
    section = stamp + generate(trees)
    if args.write:
        content = replace_section(args.write, "memory", section)
        with open(args.write, "w", encoding="utf-8") as f:
            f.write(content)
    elif args.check:
        documented = read_section(args.check, "memory")
        if not documented.startswith(stamp):
            print(f"skipped: {args.check} was made with other compilers than {versions}")
            return SKIP
        complaints = compare_tables(documented, section, lambda a, b: abs(a - b) <= max(16, 0.02 * a))
        if complaints:
            print(f"{args.check} is not what is measured:", *complaints, sep="\n  ")
            print("If the change is meant: cmake --build build/release --target evs_update_docs")
            return 1
    else:
        print(section, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
