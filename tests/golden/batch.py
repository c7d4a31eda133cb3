#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Replays several recordings at once: on the command line, and by the Snakemake workflow.

usage: batch.py EVSTAB BATCH_DIR processes|snakemake

The recordings are made here: small, two good ones and two that cannot be replayed. Exits 77 when snakemake is not
installed beside this Python (tests/requirements-batch.txt).
"""
import csv
import importlib.util
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

EVSTAB, BATCH = (os.path.abspath(a) for a in sys.argv[1:3])
ROOT = pathlib.Path(tempfile.mkdtemp(prefix="evstab_batch_"))
HEADER = "#recording,input,status,events,windows,saccades,kept,ns_per_event,message"
FAULTS = []


def check(what, ok, detail=""):
    print(f"{'ok  ' if ok else 'FAIL'} {what}: {detail}")
    if not ok:
        FAULTS.append(what)


def recording(name, n, calib="200 200 120 90 -0.3 0.1 0 0 0\n"):
    folder = ROOT / name
    folder.mkdir(parents=True)
    (folder / "events.txt").write_text("".join(f"{1 + i * 1e-4:.6f} {i * 7 % 240} {i * 5 % 180} {i & 1}\n" for i in range(n)))
    (folder / "imu.txt").write_text("".join(f"{0.9 + i * 1e-3:.6f} 0.3 -9.7 0.2 0.1 {0.5 * math.sin(i * 0.02):.6f} -0.2\n"
                                            for i in range(100 + n // 10 + 50)))
    if calib:
        (folder / "calib.txt").write_text(calib)


def evstab(*arguments):
    return subprocess.run([EVSTAB, *map(str, arguments)], capture_output=True, text=True, cwd=ROOT, timeout=100)


def table(path):
    lines = (ROOT / path).read_text().splitlines()
    check("header of the table", lines[0] == HEADER, lines[0])
    return [dict(zip(HEADER.lstrip("#").split(","), row)) for row in csv.reader(lines[1:])]


def without_time(rows):
    return [{key: value for key, value in row.items() if key != "ns_per_event"} for row in rows]


def make_recordings():
    recording("set/a", 3000)
    recording("set/b", 2000)
    recording("other/a", 1000)
    recording("bad/broken", 10, calib=None)
    (ROOT / "bad/broken/calib.txt").write_text("what?\n")


def test_processes():
    make_recordings()
    done = evstab("replay", "set/a", "set/b", "other/a/", "-o", "out", "-j", "2")
    check("all good", done.returncode == 0 and done.stderr == "", done.stderr)
    lines = done.stdout.splitlines()
    check("told in order", [line.split(":")[0] for line in lines[:3]] == ["[1/3] a", "[2/3] b", "[3/3] a_2"] and len(lines) == 4, lines)
    rows = table("out/summary.csv")
    check("rows", [(r["recording"], r["status"], r["events"], r["kept"], r["message"]) for r in rows] ==
          [("a", "ok", "3000", "3000", ""), ("b", "ok", "2000", "2000", ""), ("a_2", "ok", "1000", "1000", "")], rows)
    check("time", all(float(r["ns_per_event"]) > 0 for r in rows))
    for name in ("a", "b", "a_2"):
        files = sorted(p.name for p in (ROOT / "out" / name).iterdir())
        check(f"files of {name}", files == ["attitude.csv", "log.txt", "pairs.csv", "report.html", "summary.json", "velocity.csv",
                                            "windows.csv"], files)
    log = (ROOT / "out/a_2/log.txt").read_text()
    check("the log tells all", log.startswith("input: other/a/\n") and "note: attitude: imu" in log and "1000 events" in log, log)

    one = evstab("replay", "set/a", "-o", "one", "-j", "3", "-q")
    check("one recording goes straight into the folder", one.returncode == 0 and (ROOT / "one/summary.json").exists() and
          not (ROOT / "one/summary.csv").exists(), one.stderr)
    for name in ("attitude.csv", "windows.csv"):
        check(f"the same results alone and in a batch: {name}",
              (ROOT / "one" / name).read_bytes() == (ROOT / "out/a" / name).read_bytes())

    done = evstab("replay", "set/a", "bad/broken", "nosuch", "set/b", "-o", "out", "-j", "4", "--window", "count:500")
    check("a failure is told and ends no other", done.returncode == 1 and len(done.stderr.splitlines()) == 1 and
          "2 of 4 recordings failed" in done.stderr, done.stderr)
    rows = table("out/summary.csv")
    check("rows with failures", [r["status"] for r in rows] == ["ok", "failed", "failed", "ok"], rows)
    check("options reach every recording", [r["windows"] for r in rows] == ["6", "", "", "4"], rows)
    check("causes", "calib.txt" in rows[1]["message"] and "nosuch: No such file" in rows[2]["message"], rows)
    check("causes on the terminal", "[3/4] nosuch: FAILED: nosuch" in done.stdout, done.stdout)
    done = evstab("replay", "set/a", "bad/broken", "-o", "out2", "-q")
    check("--quiet", done.returncode == 1 and done.stdout == "" and len(done.stderr.splitlines()) == 1, done.stderr)
    check("--quiet does not silence logs", "input: set/a" in (ROOT / "out2/a/log.txt").read_text())

    # An earlier result must not stand for a run that failed.
    shutil.move(ROOT / "set/b", ROOT / "elsewhere")
    (ROOT / "set/b").mkdir()
    evstab("replay", "set/a", "set/b", "-o", "out", "-q")
    check("nothing stale", table("out/summary.csv")[1]["status"] == "failed" and not (ROOT / "out/b/summary.json").exists())

    for case, arguments, status, words in (
            ("--jobs 0", ["set/a", "-o", "x", "-j", "0"], 2, "--jobs"),
            ("--jobs many", ["set/a", "other/a", "-o", "x", "--jobs", "many"], 2, "--jobs"),
            ("no -o", ["set/a", "other/a"], 2, "-o DIR is missing"),
            ("a wrong word", ["set/a", "other/a", "-o", "x", "--rotation", "both"], 2, "--rotation"),
            ("a wrong word after a bad recording", ["nosuch", "other/a", "-o", "x", "--rotation", "both"], 2, "--rotation"),
            ("into itself", ["set/a", "other/a", "-o", "set"], 1, "into itself"),
            ("a file in the way", ["set/a", "other/a", "-o", "set/a/calib.txt"], 1, "calib.txt")):
        done = evstab("replay", *arguments)
        check(case, done.returncode == status and len(done.stderr.splitlines()) == 1 and words in done.stderr, done.stderr)
        check(f"{case}: nothing started", not (ROOT / "x").exists())


def snakemake(config):
    (ROOT / "config.yaml").write_text(config)
    return subprocess.run([sys.executable, "-m", "snakemake", "-s", f"{BATCH}/Snakefile", "--configfile", "config.yaml", "--cores",
                           "2", "--keep-going"], capture_output=True, text=True, cwd=ROOT, timeout=250,
                          env={**os.environ, "XDG_CACHE_HOME": str(ROOT / "cache"), "PYTHONDONTWRITEBYTECODE": "1"})


def test_snakemake():
    if importlib.util.find_spec("snakemake") is None:
        print("SKIPPED: snakemake is not installed; pip install -r tests/requirements-batch.txt")
        sys.exit(77)
    make_recordings()
    config = f"recordings: [set/*, other/a]\noutput: runs\nevstab: {EVSTAB}\noptions: --window count:500\n"
    done = snakemake(config)
    check("two folders and one more", done.returncode == 0, done.stdout[-600:] + done.stderr[-600:])
    rows = table("runs/summary.csv")
    evstab("replay", "set/a", "set/b", "other/a", "-o", "out", "--window", "count:500", "-q")
    check("the table of evstab replay", without_time(rows) == without_time(table("out/summary.csv")), rows)
    for name in ("attitude.csv", "windows.csv"):
        check(f"the results of evstab replay: {name}", (ROOT / "runs/a" / name).read_bytes() == (ROOT / "out/a" / name).read_bytes())

    before = (ROOT / "runs/a/summary.json").stat().st_mtime_ns
    done = snakemake(config.replace("set/*", "set/*, bad/broken"))
    check("one that fails", done.returncode != 0, done.returncode)
    rows = table("runs/summary.csv")
    check("the table tells which", [(r["recording"], r["status"]) for r in rows] ==
          [("a", "ok"), ("b", "ok"), ("broken", "failed"), ("a_2", "ok")], rows)
    check("and why", "calib.txt" in rows[2]["message"], rows[2])
    check("what is there is not replayed again", (ROOT / "runs/a/summary.json").stat().st_mtime_ns == before)
    done = snakemake(config.replace("set/*", "nosuch/*"))
    check("a pattern that matches nothing", done.returncode != 0 and "nothing matches" in done.stdout + done.stderr,
          (done.stdout + done.stderr)[-300:])


TESTS = {"processes": test_processes, "snakemake": test_snakemake}


def main():
    if len(sys.argv) != 4 or sys.argv[3] not in TESTS:
        print(__doc__)
        sys.exit(2)
    try:
        TESTS[sys.argv[3]]()
    finally:
        shutil.rmtree(ROOT, ignore_errors=True)
    print(f"{len(FAULTS)} faults")
    sys.exit(1 if FAULTS else 0)


main()
