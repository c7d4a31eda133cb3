# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""What the documentation scripts need to know of a cross-built tree: its compiler and how it compiles the library."""
import json
import os
import shlex
import subprocess

SKIP = 77  # Exit status that ctest shows as "skipped".


class Tree:
    def __init__(self, root, name):
        self.name = name
        self.path = os.path.join(root, name)
        with open(os.path.join(self.path, "compile_commands.json"), encoding="utf-8") as f:
            entries = json.load(f)
        self.library = [e for e in entries if "/lib/src/evs_" in e["file"].replace(os.sep, "/")]
        if not self.library:
            raise SystemExit(f"{self.path}: compile_commands.json names no file of the library")

    def compiler(self):
        return shlex.split(self.library[0]["command"])[0]

    def tool(self, name):
        """nm or size of the same toolchain."""
        head, _, _ = self.compiler().rpartition("gcc")
        return head + name

    def compiler_version(self):
        out = subprocess.run([self.compiler(), "-dumpfullversion"], check=True, capture_output=True, text=True)
        return out.stdout.strip()

    def modules(self):
        """Yields (module name, object file) in the order of lib/sources.cmake."""
        for entry in self.library:
            words = shlex.split(entry["command"])
            name = os.path.basename(entry["file"])[len("evs_"):-len(".c")]
            yield name, os.path.join(entry["directory"], words[words.index("-o") + 1])

    def compile(self, source, output):
        """Compile another file the way the library is compiled."""
        words = shlex.split(self.library[0]["command"])
        words[words.index("-o") + 1] = output
        words[words.index("-c") + 1] = source
        for flag in ("-MF", "-MT"):
            if flag in words:
                del words[words.index(flag):words.index(flag) + 2]
        words = [w for w in words if w not in ("-MD", "-Werror", "-fstack-usage", "-fcallgraph-info=su")]
        subprocess.run(words, check=True, cwd=self.library[0]["directory"])


def replace_section(path, name, text):
    """Put text between <!-- name:begin --> and <!-- name:end --> of a file; returns the file's new content."""
    begin, end = f"<!-- {name}:begin -->", f"<!-- {name}:end -->"
    with open(path, encoding="utf-8") as f:
        content = f.read()
    if content.count(begin) != 1 or content.count(end) != 1:
        raise SystemExit(f"{path}: needs one {begin} and one {end}")
    head, rest = content.split(begin)
    _, tail = rest.split(end)
    return f"{head}{begin}\n{text}{end}{tail}"


def read_section(path, name):
    begin, end = f"<!-- {name}:begin -->", f"<!-- {name}:end -->"
    with open(path, encoding="utf-8") as f:
        content = f.read()
    if begin not in content or end not in content:
        raise SystemExit(f"{path}: needs {begin} and {end}")
    return content.split(begin)[1].split(end)[0].lstrip("\n")


def compare_tables(documented, measured, tolerance):
    """Compare two generated sections. tolerance(documented, measured) says whether two numbers agree.

    Returns a list of complaints; the words around the numbers must be equal.
    """
    import re

    complaints = []
    old_lines, new_lines = documented.splitlines(), measured.splitlines()
    if len(old_lines) != len(new_lines):
        complaints.append(f"{len(old_lines)} lines documented, {len(new_lines)} measured")
    number = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.])")
    for old, new in zip(old_lines, new_lines):
        same_words = number.sub("#", old).split() == number.sub("#", new).split()
        pairs = list(zip(number.findall(old), number.findall(new)))
        if not same_words or any(not tolerance(float(a), float(b)) for a, b in pairs):
            complaints.append(f"documented: {old}\n  measured:   {new}")
    return complaints
