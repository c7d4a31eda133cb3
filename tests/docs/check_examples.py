#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Compile the C examples of the documentation.

usage: check_examples.py --work DIR --include DIR PAGE... -- COMPILER [FLAG...]

An example is a fenced block that opens with ```c. It must compile by itself, as C99, without a warning: a reader pastes it.
Blocks that open with ```c fragment stay unread. A run that finds no example at all fails.
"""
import argparse
import os
import re
import subprocess
import sys

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Werror"]
EXAMPLE = re.compile(r"^```c\n(.*?)^```$", re.M | re.S)


def main():
    if "--" not in sys.argv:
        raise SystemExit(__doc__)
    split = sys.argv.index("--")
    parser = argparse.ArgumentParser(description="Compile the C examples of the documentation.")
    parser.add_argument("--work", required=True)
    parser.add_argument("--include", required=True)
    parser.add_argument("pages", nargs="+")
    args = parser.parse_args(sys.argv[1:split])
    compiler = sys.argv[split + 1:]

    os.makedirs(args.work, exist_ok=True)
    n_found, n_bad = 0, 0
    for page in args.pages:
        with open(page, encoding="utf-8") as f:
            text = f.read()
        for match in EXAMPLE.finditer(text):
            n_found += 1
            source = os.path.join(args.work, f"example_{n_found}.c")
            line = text.count("\n", 0, match.start(1)) + 1
            with open(source, "w", encoding="utf-8") as f:
                f.write(f'#line {line} "{page}"\n{match.group(1)}')
            command = compiler + STRICT + ["-I", args.include, "-c", source, "-o", source[:-2] + ".o"]
            if subprocess.run(command, check=False).returncode != 0:
                n_bad += 1
    print(f"{n_found} examples, {n_bad} do not compile")
    return 1 if n_bad or not n_found else 0


if __name__ == "__main__":
    sys.exit(main())
