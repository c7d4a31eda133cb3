#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""The scripts that check the documentation must be able to say no."""
import os
import tempfile
import unittest

from cross_tree import compare_tables, read_section, replace_section
from memory_table import CallGraph

TABLE = "| module | M4 |\n|---|--:|\n| fixed | 1000 |\n"


def within_2_percent(a, b):
    return abs(a - b) <= 0.02 * a


class Tables(unittest.TestCase):
    def test_small_changes_pass(self):
        self.assertEqual([], compare_tables(TABLE, TABLE.replace("1000", "1019"), within_2_percent))

    def test_a_large_change_is_named(self):
        complaints = compare_tables(TABLE, TABLE.replace("1000", "1021"), within_2_percent)
        self.assertEqual(1, len(complaints))
        self.assertIn("1021", complaints[0])

    def test_a_missing_module_is_named(self):
        self.assertTrue(compare_tables(TABLE, TABLE + "| vec | 10 |\n", within_2_percent))
        self.assertTrue(compare_tables(TABLE, TABLE.replace("fixed", "vec"), within_2_percent))

    def test_a_section_goes_in_and_comes_out(self):
        with tempfile.TemporaryDirectory() as work:
            path = os.path.join(work, "page.md")
            with open(path, "w", encoding="utf-8") as f:
                f.write("before\n<!-- t:begin -->\nold\n<!-- t:end -->\nafter\n")
            content = replace_section(path, "t", TABLE)
            with open(path, "w", encoding="utf-8") as f:
                f.write(content)
            self.assertEqual(TABLE, read_section(path, "t"))
            self.assertTrue(content.startswith("before\n") and content.endswith("\nafter\n"))


class Stack(unittest.TestCase):
    @staticmethod
    def graph(*lines):
        result = CallGraph()
        with tempfile.TemporaryDirectory() as work:
            path = os.path.join(work, "a.ci")
            with open(path, "w", encoding="utf-8") as f:
                f.write("\n".join(lines))
            result.add("a", path)
        return result

    @staticmethod
    def node(name, size, kind="static"):
        return f'node: {{ title: "{name}" label: "{name}\\n/a.c:1:1\\n{size} bytes ({kind})" }}'

    @staticmethod
    def edge(caller, callee):
        return f'edge: {{ sourcename: "{caller}" targetname: "{callee}" label: "/a.c:1:1" }}'

    def test_the_deepest_path_counts(self):
        graph = self.graph(self.node("f", 8), self.node("g", 16), self.node("h", 100), self.edge("f", "g"),
                           self.edge("f", "h"), self.edge("h", "g"))
        self.assertEqual(124, graph.deepest("a"))

    def test_what_has_no_depth_is_refused(self):
        with self.assertRaisesRegex(SystemExit, "recursion: f -> g -> f"):
            self.graph(self.node("f", 8), self.node("g", 8), self.edge("f", "g"), self.edge("g", "f")).deepest("a")
        with self.assertRaisesRegex(SystemExit, "unknown size"):
            self.graph(self.node("f", 8, "dynamic"))
        with self.assertRaisesRegex(SystemExit, "through a pointer"):
            self.graph(self.node("f", 8), self.edge("f", "__indirect_call"))


if __name__ == "__main__":
    unittest.main()
