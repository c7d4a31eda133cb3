# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""What the Snakefile needs beside its rules: names of recordings, and the table over all of them.

The names and the columns are those of `evstab replay A B C -o OUT` (names.c, replay_batch.c), so that a table from a
cluster and one from a desktop can be read by the same script.
"""
import csv
import glob
import json
import pathlib

COLUMNS = ["#recording", "input", "status", "events", "windows", "saccades", "kept", "ns_per_event", "message"]
PREFIX = "evstab replay: "


def recordings(patterns):
    """Name -> path of each folder or event file that the patterns match; the second of a name gets "_2", and so on."""
    runs = {}
    for pattern in patterns:
        paths = sorted(glob.glob(str(pattern)))
        if not paths:
            raise ValueError(f"recordings: nothing matches '{pattern}'")
        for path in paths:
            name = pathlib.Path(path).name
            for end in (".gz", ".txt", ".csv"):
                name = name[: -len(end)] if name.endswith(end) and name != end else name
            unique, k = name, 2
            while unique in runs:
                unique, k = f"{name}_{k}", k + 1
            runs[unique] = path
    return runs


def last_error(log):
    errors = [line[len(PREFIX):] for line in log.read_text(errors="replace").splitlines() if line.startswith(PREFIX)]
    return errors[-1] if errors else "failed; see its log.txt"


def row(folder, name, path):
    log, summary = folder / "log.txt", folder / "summary.json"
    if not summary.exists():
        ran = log.exists()
        return [name, path, "failed" if ran else "not run", "", "", "", "", "", last_error(log) if ran else ""]
    s = json.loads(summary.read_text())
    events = s["events"]
    return [name, path, "ok", events["replayed"], s["windows"], s["saccades"], events["kept"],
            f"{s['ns_per_event']:.4g}", ""]


def write(out, runs):
    """OUT/summary.csv, a row per recording. @return how many did not succeed."""
    out = pathlib.Path(out)
    out.mkdir(parents=True, exist_ok=True)
    rows = [row(out / name, name, path) for name, path in runs.items()]
    with open(out / "summary.csv", "w", newline="") as file:
        file.write(",".join(COLUMNS) + "\n")
        csv.writer(file, lineterminator="\n").writerows(rows)
    return sum(r[2] != "ok" for r in rows)
