#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Runs the program evstab as a user would, above all wrongly: each case names the exit status and the words that must be
told. Errors are one line on stderr; nothing may crash, and nothing may pass silently.

usage: test_cli.py EVSTAB CC LIB_INCLUDE_DIR
"""
import csv
import gzip
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

EVSTAB, CC, INCLUDE = sys.argv[1:4]
ROOT = pathlib.Path(tempfile.mkdtemp(prefix="evstab_cli_"))
FAULTS = 0
N_CHECKS = 0


def check(case, ok, detail=""):
    global FAULTS, N_CHECKS
    N_CHECKS += 1
    if not ok:
        FAULTS += 1
        print(f"FAIL {case}: {detail}")


def run(*arguments, **options):
    done = subprocess.run([EVSTAB, *map(str, arguments)], capture_output=True, cwd=ROOT, timeout=60, **options)
    done.stdout = done.stdout.decode(errors="replace")
    done.stderr = done.stderr.decode(errors="replace")
    return done


def expect(case, arguments, status, *patterns, n_lines=None, **options):
    """Exit status, and every pattern on stderr (or on stdout when it begins with '>'). @return the process."""
    done = run(*arguments, **options)
    check(case, done.returncode == status, f"exit {done.returncode}, expected {status}; stderr: {done.stderr}")
    for pattern in patterns:
        stream, text = (done.stdout, pattern[1:]) if pattern.startswith(">") else (done.stderr, pattern)
        check(case, re.search(text, stream) is not None, f"'{text}' not in: {stream}")
    check(case, "Sanitizer" not in done.stderr and "runtime error" not in done.stderr, done.stderr)
    errors = [line for line in done.stderr.splitlines() if not line.startswith("evstab: note:")]
    if status != 0:
        check(case, len(errors) >= 1, "failed silently")
    if n_lines is not None:
        check(case, len(errors) == n_lines, f"{len(errors)} lines on stderr, expected {n_lines}: {done.stderr}")
    return done


def write(name, content):
    path = ROOT / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def summary(folder):
    return json.loads((ROOT / folder / "summary.json").read_text())


CALIB = "200 200 120 90 -0.3 0.1 0 0 0\n"


def events(n=2000, t0=1.0, step=0.0001):
    return "".join(f"{t0 + i * step:.9f} {i * 7 % 240} {i * 5 % 180} {i & 1}\n" for i in range(n))


def imu(n=400, t0=0.9, order="accel"):
    rows = []
    for i in range(n):
        gyro, accel = f"0.1 {0.5 * math.sin(i * 0.02):.6f} -0.2", "0.3 -9.7 0.2"
        rows.append(f"{t0 + i * 0.001:.6f} " + (f"{accel} {gyro}" if order == "accel" else f"{gyro} {accel}"))
    return "\n".join(rows) + "\n"


def poses(n=100, t0=0.9):
    return "".join(f"{t0 + i * 0.005:.6f} 0 0 0 0 {math.sin(i * 0.002):.9f} 0 {math.cos(i * 0.002):.9f}\n" for i in range(n))


def recording(name, **files):
    parts = {"events.txt": events(), "imu.txt": imu(), "groundtruth.txt": poses(), "calib.txt": CALIB}
    parts.update({key.replace("_txt", ".txt"): value for key, value in files.items()})
    for file, content in parts.items():
        if content is not None:
            write(f"{name}/{file}", content)
    return ROOT / name


def test_usage():
    expect("no command", [], 2, "Usage: evstab")
    expect("help", ["--help"], 0, ">replay", ">attitude", ">egomotion", ">lut", ">info", ">sim", n_lines=0)
    expect("version", ["--version"], 0, r">^evstab \d+\.\d+\.\d+$", n_lines=0)
    expect("unknown command", ["frobnicate"], 2, "unknown command 'frobnicate'", n_lines=1)
    for later in ("convert", "view", "live"):
        expect("a command that is not there yet", [later], 2, f"unknown command '{later}'", n_lines=1)
        check("help lists only what exists", f"  {later} " not in run("--help").stdout, later)
    for command in ("replay", "attitude", "egomotion", "lut", "info", "sim"):
        expect(f"{command} --help", [command, "--help"], 0, f">Usage: evstab {command}", ">Exit status", n_lines=0)
        expect(f"{command} without input", [command], 2, f"evstab {command}: ", f"evstab {command} --help", n_lines=1)
        expect(f"{command} --what", [command, "x", "--what"], 2, "unknown option '--what'", n_lines=1)
        if command != "replay":  # which takes several: tests/golden/batch.py
            expect(f"{command} a b", [command, "a", "b", "-o", "x"] if command != "info" else [command, "a", "b"], 2,
                   "one word too many: 'b'", n_lines=1)
    for unknown in ("--writ=events", "--i"):
        expect("an unknown option", ["replay", "x", "-o", "y", unknown], 2, "unknown option", n_lines=1)
    for option, value in (("--window", "area:34x26"), ("--window", "count:0"), ("--window", "time:1.5"), ("--window", "roi:1"),
                          ("--window", "area:0x26:200"), ("--window", "area:34x26:99999"), ("--window", "area:34x26:500:50-5"), ("--window", "area:34x26:500:5"),
                          ("--window", "count:100:5-"), ("--window", "count:100:5-9x"), ("--window", "time:100:5-9"), ("--rotation", "both"),
                          ("--saccade", "1"), ("--attitude", "magic"), ("--imu-offset-us", "1ms"), ("--imu-offset-us", "99999999"),
                          ("--gyro-bias", "0.01"), ("--gyro-bias", "0.01,0.02"), ("--gyro-bias", "0,0,0.6"), ("--gyro-bias", "0,0,0,0"), ("--gyro-bias", "0,x,0"),
                          ("--from", "now"), ("--to", ""), ("--size", "240"), ("--size", "240x0"), ("--size", "4096x4096"),
                          ("--write", "pictures"), ("--write", "events,"), ("--write", "events;frames"), ("--image", "none"), ("--image", "iw"),
                          ("--warp", "off"), ("--velocity", "yes"), ("--method", "erl-v"), ("--baseline-ms", "30"),
                          ("--baseline-ms", "30:20"), ("--baseline-ms", "0.5:20"), ("--baseline-ms", "30:9999"), ("--video", "a.avi"), ("--imu-order", "gyro")):
        folder = recording("usage")
        expect(f"{option} {value}", ["replay", folder, "-o", "out_usage", option, value], 2, option, n_lines=1)
    expect("demo --help", ["demo", "--help"], 0, ">Usage: evstab demo", ">Exit status", n_lines=0)
    for words in (["room"], ["--duration", "0"], ["--duration", "61"], ["--duration", "x"], ["--seed", "-1"], ["--what"]):
        expect(f"demo {words}", ["demo", "-o", "out_usage", *words], 2, "evstab demo --help", n_lines=1)
    expect("value missing", ["replay", "x", "-o"], 2, "--output needs a value", n_lines=1)
    expect("given twice", ["replay", "x", "-o", "a", "-o", "b"], 2, "given twice", n_lines=1)
    expect("a flag with a value", ["replay", "x", "-o", "a", "--paper=yes"], 2, "--paper takes no value", n_lines=1)
    expect("from after to", ["replay", "x", "-o", "a", "--from", "2", "--to", "1"], 2, "--from", n_lines=1)
    check("nothing written by wrong usage", not (ROOT / "out_usage").exists())


def test_replay():
    folder = recording("good")
    done = expect("all defaults", ["replay", folder, "-o", "out/a/b", "--write", "events"], 0, "attitude: imu", "240x180 is taken",
                  ">2000 events", n_lines=0)
    check("no progress when piped", "\r" not in done.stderr)
    s = summary("out/a/b")
    check("counts", s["events"]["in"] == s["events"]["replayed"] == s["events"]["kept"] == 2000, s["events"])
    check("settings", s["settings"]["attitude"] == "imu" and s["settings"]["rotation"] == "slice", s["settings"])
    headers = {"attitude.csv": "#t_s,qw,qx,qy,qz,wx_rad_s,wy_rad_s,wz_rad_s,flags",
               "windows.csv": "#index,first_event,n_events,t_first_s,t_last_s,reason,saccade,qw,qx,qy,qz",
               "events.csv": "#t_s,x_px,y_px,p,x_undist_px,y_undist_px,x_stab_px,y_stab_px,window"}
    for name, header in headers.items():
        rows = (ROOT / "out/a/b" / name).read_text().splitlines()
        check(f"header of {name}", rows[0] == header, rows[0])
        check(f"columns of {name}", {row.count(",") for row in rows} == {header.count(",")})
    rows = (ROOT / "out/a/b/events.csv").read_text().splitlines()
    check("a row per event", len(rows) == 2001, len(rows))
    check("exact times", rows[1].startswith("1.000000,0,0,0,") and rows[1236].startswith("1.123500,"), rows[1])
    check("no events.csv unless asked", expect("quiet", ["replay", folder, "-o", "out/q", "-q"], 0, n_lines=0).stderr == "" and
          not (ROOT / "out/q/events.csv").exists())
    check("quiet prints nothing", run("replay", folder, "-o", "out/q", "-q").stdout == "")

    again = run("replay", folder, "-o", "out/again", "--write", "events", "-q")
    check("same input, same bytes", again.returncode == 0 and
          (ROOT / "out/again/events.csv").read_bytes() == (ROOT / "out/a/b/events.csv").read_bytes())

    for attitude in ("gyro", "truth", "none"):
        expect(attitude, ["replay", folder, "-o", f"out/{attitude}", "--attitude", attitude], 0, n_lines=0)
        check(attitude, summary(f"out/{attitude}")["settings"]["attitude"] == attitude)
    check("without orientations there are none in the file", len((ROOT / "out/none/attitude.csv").read_text().splitlines()) == 1)
    expect("truth without IMU", ["replay", recording("no_imu", imu_txt=None), "-o", "out/t"], 0, "attitude: truth")
    expect("neither", ["replay", recording("bare", imu_txt=None, groundtruth_txt=None), "-o", "out/n"], 0, "attitude: none")
    expect("gyro-first IMU is noticed", ["replay", recording("gyro_first", imu_txt=imu(order="gyro")), "-o", "out/gf"], 0, "look like gravity")
    a = (ROOT / "out/gf/attitude.csv").read_bytes()
    check("and read rightly", a == (ROOT / "out/q/attitude.csv").read_bytes())
    expect("units of g are noticed", ["replay", recording("in_g", imu_txt=imu().replace("-9.7", "-0.99")), "-o", "out/g"], 0, "not about 9.8")

    # What the gyro reads too much: the same as an IMU without it, by option and by parameter file, also in a batch.
    biased = imu().splitlines()
    biased = "\n".join(" ".join(row[:4] + [f"{float(w) + b:.6f}" for w, b in zip(row[4:], (0.05, -0.25, 0.01))])
                       for row in (line.split() for line in biased)) + "\n"
    recording("biased", imu_txt=biased)
    told = ["--gyro-bias", "0.05,-0.25,0.01"]
    expect("gyro bias not told", ["replay", "biased", "-o", "out/b0", "-q"], 0)
    expect("gyro bias told", ["replay", "biased", "-o", "out/b1", "-q", *told], 0)
    expect("gyro bias in YAML", ["replay", "biased", "-o", "out/b2", "-q", "--config", write("bias.yaml", "gyro_bias: [0.05, -0.25, 0.01]\n")], 0)
    expect("the option counts more", ["replay", "biased", "-o", "out/b3", "-q", "--config", write("zero.yaml", "gyro_bias: [0, 0, 0]\n"), *told], 0)
    expect("gyro bias in a batch", ["replay", "biased", folder, "-o", "out/b4", "-q", *told], 0)
    expect("gyro bias, integration alone", ["replay", "biased", "-o", "out/b5", "-q", "--attitude", "gyro", *told], 0)

    def turned(name):  # First to last orientation.
        rows = [list(map(float, row.split(",")[1:5])) for row in (ROOT / name / "attitude.csv").read_text().splitlines()[1:]]
        return [rows[0], rows[-1]]
    for name in ("b1", "b2", "b3", "b4/biased"):
        s = summary(f"out/{name}")
        check(f"{name}: told", s["settings"]["gyro_bias_rad_s"] == [0.05, -0.25, 0.01] and s["attitude"]["gyro_bias_known"], s)
        check(f"{name}: kept", s["attitude"]["gyro_bias_rad_s"] == [0.05, -0.25, 0.01], s["attitude"])
    check("b5: kept", summary("out/b5")["attitude"]["gyro_bias_rad_s"] == [0.05, -0.25, 0.01])
    s = summary("out/b0")
    check("not told", "gyro_bias_rad_s" not in s["settings"] and not s["attitude"]["gyro_bias_known"], s)
    plain, bias = turned("out/q"), turned("out/b1")
    # (The plain one learns a little bias from its settling; a bias that is given stands.)
    apart = max(abs(a - b) for p, q in zip(plain, bias) for a, b in zip(p, q))
    check("subtracted: the same turn as without bias", apart < 2e-3, apart)
    check("added it would not be", max(abs(a - b) for p, q in zip(plain, turned("out/b0")) for a, b in zip(p, q)) > 1e-2)
    check("by whatever way it is told", all((ROOT / f"out/{n}/attitude.csv").read_bytes() == (ROOT / "out/b1/attitude.csv").read_bytes()
                                            for n in ("b2", "b3", "b4/biased")))
    expect("a bias of nothing", ["replay", folder, "-o", "out/b6", "--attitude", "truth", *told], 0, "the gyro bias is not used", n_lines=0)
    check("is not told either", "gyro_bias_rad_s" not in summary("out/b6")["settings"])
    for text in ("[0, 0]", "[0, 0, 0, 0]", "[0, 0, 0.6]", "[0, 0, nan]", "[a, b, c]"):
        expect(f"gyro_bias: {text}", ["replay", folder, "-o", "out/b7", "--config", write("bad.yaml", f"K: [200, 0, 120, 0, 200, 90, 0, 0, 1]\ngyro_bias: {text}\n")], 1,
               "bad.yaml: line 2: gyro_bias", n_lines=1)
    expect("count windows", ["replay", folder, "-o", "out/c", "--window", "count:100"], 0, ">20 windows")
    expect("count windows within limits", ["replay", folder, "-o", "out/c", "--window", "count:100:0-5.5"], 0, ">37 windows")
    c = summary("out/c")["settings"]
    check("limits are told", (c["window"], c["window_min_us"], c["window_max_us"]) == ("count:100", 0, 5500), c)
    expect("time windows", ["replay", folder, "-o", "out/tw", "--window", "time:50000"], 0, ">4 windows")
    expect("part of it", ["replay", folder, "-o", "out/part", "--from", "1.05", "--to", "1.1"], 0, ">500 events")
    check("what was left out is counted", summary("out/part")["events"]["before_from"] == 500, summary("out/part")["events"])
    expect("none of it", ["replay", folder, "-o", "out/none_of_it", "--from", "5"], 1, "no event between", n_lines=1)
    check("no litter", not (ROOT / "out/none_of_it").exists())
    expect("paper", ["replay", folder, "-o", "out/p", "--paper"], 0)
    s = summary("out/a/b")["settings"]
    threshold = int(s["window"].rsplit(":", 1)[1])
    check("default window", s["window"].startswith("area:34x26:") and threshold % 42 == 0 and
          (s["window_min_us"], s["window_max_us"]) == (5000, 50000), s)
    write("tiles.yaml", "number_of_columns: 17\nnumber_of_rows: 13\n")
    expect("larger tiles", ["replay", folder, "-o", "out/tiles", "--config", "tiles.yaml"], 0)
    check("hold more events", summary("out/tiles")["settings"]["window"] == f"area:17x13:{4 * threshold}", summary("out/tiles")["settings"])
    p = summary("out/p")["settings"]
    check("paper", (p["rotation"], p["window"], p["saccade_px"]) == ("window", "area:34x26:200", 40), p)
    expect("paper on another sensor", ["replay", folder, "-o", "out/p", "--paper", "--size", "346x260"], 0)
    check("threshold by sensor", summary("out/p")["settings"]["window"] == "area:34x26:50")
    write("good.yaml", "K: [210, 0, 121, 0, 211, 91, 0, 0, 1]\nD: [0, 0, 0, 0, 0]\nimage_width: 240\nimage_height: 180\n"
                       "q_external: [0, 0, 1, 0]\naccumulation_type: number_of_events\nnumber_of_accumulated_events: 250\n"
                       "enable_saccades: False\nfrobnicate: 1\n")
    expect("parameters of the paper's code", ["replay", folder, "-o", "out/y", "--config", "good.yaml"], 0, "keys not used: frobnicate",
           ">8 windows")
    y = summary("out/y")["settings"]
    check("are used", y["camera"]["fx_px"] == 210 and y["saccade_px"] == 0 and y["q_camera_from_imu_wxyz"] == [0, 0, 0, 1], y)

    shutil.rmtree(ROOT / "gz", ignore_errors=True)
    for name, content in (("events.txt", events()), ("imu.txt", imu()), ("calib.txt", CALIB), ("groundtruth.txt", poses())):
        write(f"gz/{name}.gz", gzip.compress(content.encode()))
    expect("gzip", ["replay", "gz", "-o", "out/gz", "--write", "events", "-q"], 0)
    check("reads the same", (ROOT / "out/gz/events.csv").read_bytes() == (ROOT / "out/a/b/events.csv").read_bytes())

    # The device's clock wraps after 2^32 us; a recording across the wrap gives the same but for the times.
    recording("wrap", events_txt=events(t0=4294.9), imu_txt=imu(t0=4294.8), groundtruth_txt=poses(t0=4294.8))
    for attitude in ("imu", "truth"):
        expect("across the wrap of the clock", ["replay", "wrap", "-o", "out/wrap", "--attitude", attitude, "--write", "events", "-q"], 0)
        expect("without it", ["replay", "good", "-o", "out/nowrap", "--attitude", attitude, "--write", "events", "-q"], 0)
        rows = [[row.split(",", 1)[1] for row in (ROOT / out / "events.csv").read_text().splitlines()] for out in ("out/wrap", "out/nowrap")]
        check(f"the same across the wrap: {attitude}", rows[0] == rows[1])
    check("and its times go on", (ROOT / "out/wrap/events.csv").read_text().splitlines()[-1].startswith("4295.099900,"))

    recording("late", imu_txt=imu(t0=0.905))
    expect("IMU clock 5 ms late", ["replay", "late", "-o", "out/late", "--imu-offset-us", "-5000", "--write", "events", "-q"], 0)
    for name in ("events.csv", "windows.csv", "attitude.csv"):
        check(f"offset undoes it: {name}", (ROOT / "out/late" / name).read_bytes() == (ROOT / "out/a/b" / name).read_bytes())
    expect("filter faults are told", ["replay", recording("hard", imu_txt=imu().replace("-9.7", "-777", 1)), "-o", "out/hard"], 0,
           "the attitude filter counts 1 accelerations left out")

    if os.path.exists("/bin/bash"):
        done = subprocess.run(["/bin/bash", "-c", f"{EVSTAB} replay <(cat good/events.txt) --calib good/calib.txt --imu <(cat good/imu.txt) "
                               "-o out/pipe --write events -q"], cwd=ROOT, capture_output=True, text=True)
        check("pipes", done.returncode == 0 and (ROOT / "out/pipe/events.csv").read_bytes() == (ROOT / "out/a/b/events.csv").read_bytes(),
              done.stderr)

    epoch = 1403715273
    recording("epoch", events_txt=events(t0=epoch), imu_txt=imu(t0=epoch - 0.1), groundtruth_txt=None)
    expect("times since 1970", ["replay", "epoch", "-o", "out/epoch", "--write", "events", "-q"], 0)
    row = (ROOT / "out/epoch/events.csv").read_text().splitlines()[1000]
    check("keep their microseconds", re.match(rf"{epoch}\.0999\d\d,", row) is not None, row)
    expect("clocks that do not meet", ["replay", recording("apart", imu_txt=imu(t0=500)), "-o", "out/apart"], 0, "have no orientation", n_lines=1)


def flight_events(n=60000, seconds=0.6, speed=0.5, slow_from=9.0):
    """Points on a wall that comes nearer: the flow spreads from the middle. Deterministic, and nothing turns. From a time
    on it comes ten times slower."""
    state = 1
    points = []
    for _ in range(120):
        state = state * 1103515245 + 12345 & 0x7fffffff
        x = (state >> 8) % 1000 / 1000 * 1.4 - 0.7
        state = state * 1103515245 + 12345 & 0x7fffffff
        points.append((x, (state >> 8) % 1000 / 1000 * 1.1 - 0.55))
    rows = []
    for i in range(n):
        state = state * 1103515245 + 12345 & 0x7fffffff
        x, y = points[(state >> 8) % len(points)]
        t = i / n * seconds
        scale = 200 / (1 - speed * (min(t, slow_from) + 0.1 * max(0.0, t - slow_from)))
        u, v = round(x * scale + 120 + (state >> 20 & 1)), round(y * scale + 90 + (state >> 21 & 1))
        if 0 <= u < 240 and 0 <= v < 180:
            rows.append(f"{1 + t:.6f} {u} {v} {i & 1}\n")
    return "".join(rows)


def test_velocity():
    straight = "200 200 120 90 0 0 0 0 0\n"
    still = "".join(f"{0.9 + i * 0.005:.6f} 0 0 {0.5 * max(0.0, i * 0.005 - 0.1):.6f} 0 0 0 1\n" for i in range(200))
    recording("flight", events_txt=flight_events(), imu_txt=None, groundtruth_txt=still, calib_txt=straight)
    expect("direction of flight", ["replay", "flight", "-o", "out/v"], 0, ">direction of flight from", ">median angle to the truth",
           ">velocity.csv pairs.csv", n_lines=0)
    s = summary("out/v")
    settings = s["settings"]
    check("defaults", (settings["velocity"], settings["image"], settings["warp"], settings["method"]) == ("on", "iwe", "none", "erlv"), settings)
    rows = (ROOT / "out/v/velocity.csv").read_text().splitlines()
    check("header of velocity.csv", rows[0] == "#t_s,vx,vy,vz,sigma_deg,n_flow,n_inliers", rows[0])
    table = [[float(v) for v in row.split(",")] for row in rows[1:]]
    check("some directions", len(table) == s["velocity"]["valid"] >= 5, s["velocity"])
    check("unit vectors, ahead", all(abs(sum(v * v for v in row[1:4]) - 1) < 1e-6 and row[3] > 0.98 for row in table), table)
    check("in order", all(a[0] < b[0] for a, b in zip(table, table[1:])))
    check("an uncertainty in degrees", all(0 < row[4] < 30 for row in table), table)
    check("inliers of the flow", all(8 <= row[6] <= row[5] for row in table), table)
    pairs = (ROOT / "out/v/pairs.csv").read_text().splitlines()
    check("header of pairs.csv", pairs[0] == "#t_s,interval_s,result,flow_px,n_corners,n_flow,n_inliers,saccade", pairs[0])
    results = [row.split(",")[2] for row in pairs[1:]]
    v = s["velocity"]
    check("every pair is there", len(results) == v["pairs"] and results.count("valid") == v["valid"] and
          results.count("few") == v["invalid"]["few_features"] and results.count("still") == v["invalid"]["too_little_motion"] and
          sum(map(results.count, ("chance", "rotation", "sign_unsure", "degenerate", "unsolved"))) == v["invalid"]["no_direction_fits"], (v, results))
    valid = [row.split(",")[0] for row in pairs[1:] if row.split(",")[2] == "valid"]
    check("at the same times", valid == [row.split(",")[0] for row in rows[1:]])
    check("images and pairs add up", s["images"]["made"] == v["pairs"] + v["images_without_an_older_one"] > 5, s)
    check("intervals within the limits", all(0.005 <= float(row.split(",")[1]) <= 0.4 for row in pairs[1:]), pairs)
    check("memory is told", 200_000 < s["library_memory_bytes"] < 4_000_000, s["library_memory_bytes"])

    again = run("replay", "flight", "-o", "out/v2", "-q", "--no-report")
    check("same input, same bytes", again.returncode == 0 and
          (ROOT / "out/v2/velocity.csv").read_bytes() == (ROOT / "out/v/velocity.csv").read_bytes())
    expect("off", ["replay", "flight", "-o", "out/v2", "-q", "--velocity", "off"], 0, n_lines=0)
    check("off leaves no file, not that of an earlier run either", not (ROOT / "out/v2/velocity.csv").exists() and
          not (ROOT / "out/v2/pairs.csv").exists() and "velocity" not in summary("out/v2") and "images" not in summary("out/v2"))
    windows = [(ROOT / out / "windows.csv").read_bytes() for out in ("out/v", "out/v2")]
    check("and the same windows", windows[0] == windows[1])

    # Across the wrap of the device's clock, and with times since 1970.
    for name, t0 in (("flight_wrap", 4294.5), ("flight_epoch", 1403715273)):
        shifted = "".join(f"{float(row.split(' ', 1)[0]) - 1 + t0:.6f} {row.split(' ', 1)[1]}\n" for row in flight_events().splitlines())
        moved = "".join(f"{float(row.split(' ', 1)[0]) - 1 + t0:.6f} {row.split(' ', 1)[1]}\n" for row in still.splitlines())
        recording(name, events_txt=shifted, imu_txt=None, groundtruth_txt=moved, calib_txt=straight)
        expect(name, ["replay", name, "-o", f"out/{name}", "-q", "--no-report"], 0)
        other = [row.split(",") for row in (ROOT / f"out/{name}/velocity.csv").read_text().splitlines()]
        check(f"{name}: the same directions", [row[1:] for row in other[1:]] == [row.split(",")[1:] for row in rows[1:]])
        check(f"{name}: at their own times", abs(float(other[1][0]) - t0 - (table[0][0] - 1)) < 2e-6, (other[1][0], table[0][0]))

    expect("windows too long", ["replay", "flight", "-o", "out/long_w", "--window", "time:150000"], 0, "windows last up to 150 ms")
    check("are no matter otherwise", "last up to" not in expect("no velocity", ["replay", "flight", "-o", "out/long_w", "--window", "time:150000",
                                                                              "--velocity", "off"], 0).stderr)
    # Slower flow needs longer intervals, whose middles run back: the rows are in order all the same.
    recording("slower", events_txt=flight_events(120000, 0.8, 1.2, 0.2), imu_txt=None, groundtruth_txt=still, calib_txt=straight)
    expect("slower", ["replay", "slower", "-o", "out/slower", "-q", "--no-report", "--window", "time:12000"], 0)
    slower = [[float(row.split(",")[k]) for k in (0, 1)] for row in (ROOT / "out/slower/pairs.csv").read_text().splitlines()[1:]]
    newest = [t + span / 2 for t, span in slower]
    check("a newer pair can belong to an earlier time", any(a > b + 1e-4 for a, b in zip(newest, newest[1:])), slower)
    check("and stands before the other", all(a[0] < b[0] for a, b in zip(slower, slower[1:])), slower)

    # The report's truth is by the same clock as the attitude.
    recording("late_poses", events_txt=flight_events(), imu_txt=None, calib_txt=straight,
              groundtruth_txt="".join(f"{float(row.split(' ', 1)[0]) - 5:.6f} {row.split(' ', 1)[1]}\n" for row in still.splitlines()))
    expect("poses 5 s late", ["replay", "late_poses", "-o", "out/late_poses", "--imu-offset-us", "5000000"], 0, ">median angle to the truth")

    kinds = {}
    for words in (["--image", "surface"], ["--image", "count"], ["--warp", "predicted"], ["--warp", "global"], ["--warp", "tiled"],
                  ["--method", "erlv-paper"], ["--method", "erl"], ["--baseline-ms", "20:40"], ["--rotation", "window"]):
        key = " ".join(words)
        expect(key, ["replay", "flight", "-o", "out/k", "-q", "--no-report", *words], 0)
        option = words[0][2:]
        k = summary("out/k")
        check(f"{key}: is told", k["settings"].get(option, words[1]) == words[1], k["settings"])
        kinds[key] = (ROOT / "out/k/velocity.csv").read_bytes()
        check(f"{key}: gives directions", k["velocity"]["valid"] > 0, k["velocity"])
    base = (ROOT / "out/v/velocity.csv").read_bytes()
    same = ["--rotation window", "--warp global"]  # Nothing turns, and the flow of a wall that comes nearer has no mean.
    check("each makes a difference", base not in [kinds[k] for k in kinds if k not in same] and
          len({kinds[k] for k in kinds if k not in same}) == len(kinds) - len(same), [k for k in kinds if kinds[k] == base])
    check("but for those that cannot", all(kinds[k] == base for k in same), same)
    expect("paper", ["replay", "flight", "-o", "out/paper", "-q", "--no-report", "--paper"], 0)
    p = summary("out/paper")["settings"]
    check("paper", (p["warp"], p["method"], p["image"], p["window_min_us"], p["window_max_us"]) == ("tiled", "erlv-paper", "iwe", 0, None), p)
    expect("paper, but", ["replay", "flight", "-o", "out/paper", "-q", "--no-report", "--paper", "--warp", "none", "--image", "surface"], 0)
    p = summary("out/paper")["settings"]
    check("options count more", (p["warp"], p["method"], p["image"]) == ("none", "erlv-paper", "surface"), p)
    write("images.yaml", "image: surface\nvelocity: True\nmethod: erlv-paper\n")
    expect("parameter file", ["replay", "flight", "-o", "out/y2", "-q", "--no-report", "--config", "images.yaml", "--method", "erl"], 0)
    p = summary("out/y2")["settings"]
    check("parameter file, and an option over it", (p["image"], p["method"], p["velocity"]) == ("surface", "erl", "on"), p)

    folder = ["replay", "flight", "-o", "out/refused"]
    expect("a warp of a surface", [*folder, "--image", "surface", "--warp", "tiled"], 2, "--warp is 'tiled'", "--image surface", n_lines=1)
    expect("a warp by no flow", [*folder, "--velocity", "off", "--warp", "predicted", "--image", "iwe"], 2, "--velocity on", n_lines=1)
    bare = ["replay", "flight/events.txt", "-o", "out/refused"]
    expect("no lens, no direction", [*bare, "--velocity", "on", "--attitude", "none"], 1, "--velocity on needs the lens", "--calib", n_lines=1)
    check("no litter", not (ROOT / "out/refused").exists())
    expect("unless nobody asks", [*bare, "--attitude", "none"], 0)
    check("then it is off", summary("out/refused")["settings"]["velocity"] == "off")
    expect("without attitude only when asked", ["replay", "flight", "-o", "out/na", "--attitude", "none", "--velocity", "on"], 0,
           "does not turn")
    check("which is the same where nothing turns", abs(len((ROOT / "out/na/velocity.csv").read_text().splitlines()) - len(rows)) <= 2)
    for size in ("34x26", "346x260"):
        expect(f"a sensor of {size}", ["replay", "flight", "-o", "out/small", "-q", "--no-report", "--size", size, "--window", "count:60"], 0)
        check(f"and a sensor of {size}", summary("out/small")["velocity"]["pairs"] > 0, summary("out/small"))
    recording("no_texture", events_txt="".join(f"{1 + i * 1e-5:.6f} 120 90 1\n" for i in range(30000)), imu_txt=None, groundtruth_txt=still,
              calib_txt=straight)
    expect("nothing to see", ["replay", "no_texture", "-o", "out/nt", "--velocity", "on"], 0, "no direction of flight: ")
    check("gives no direction", len((ROOT / "out/nt/velocity.csv").read_text().splitlines()) == 1 and
          summary("out/nt")["velocity"]["valid"] == 0, summary("out/nt"))

    expect("frames", ["replay", "flight", "-o", "out/f", "-q", "--no-report", "--write", "events,frames"], 0, n_lines=0)
    listed = [row.split(",") for row in (ROOT / "out/f/frames/frames.csv").read_text().splitlines()]
    files = sorted(path.name for path in (ROOT / "out/f/frames").glob("*.png"))
    check("an image per window", listed[0] == ["#window", "t_s", "file"] and [row[2] for row in listed[1:]] == files and
          len(files) == summary("out/f")["images"]["made"], (len(listed), len(files)))
    check("PNG files", all((ROOT / "out/f/frames" / name).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" for name in files))
    check("events.csv too", (ROOT / "out/f/events.csv").exists())
    expect("fewer frames", ["replay", "flight", "-o", "out/f", "-q", "--no-report", "--write", "frames", "--to", "1.2", "--velocity", "off"], 0)
    left = sorted(path.name for path in (ROOT / "out/f/frames").glob("*.png"))
    check("leave none of those before", 0 < len(left) == summary("out/f")["images"]["made"] < len(files), (len(left), len(files)))
    (ROOT / "out/blocked").mkdir(parents=True)
    (ROOT / "out/blocked/frames").write_text("in the way")
    expect("frames cannot be written", ["replay", "flight", "-o", "out/blocked", "--write", "frames"], 1, "frames", n_lines=1)


def test_terminal():
    """Progress shows on a terminal, and cleans up behind itself."""
    try:
        import pty
    except ImportError:
        return
    write("long/events.txt", events(400000, step=0.000001))
    write("long/calib.txt", CALIB)
    try:
        master, slave = pty.openpty()
    except OSError as error:  # A container without /dev/pts.
        print(f"not tried: progress on a terminal ({error})")
        return
    done = subprocess.Popen([EVSTAB, "replay", "long", "-o", "out/long", "--write", "events"], cwd=ROOT, stdout=subprocess.DEVNULL, stderr=slave)
    os.close(slave)
    text = b""
    while True:
        try:
            block = os.read(master, 4096)
        except OSError:
            break
        if not block:
            break
        text += block
    os.close(master)
    check("replay on a terminal", done.wait() == 0)
    shown = text.count(b"events/s")
    check("progress", shown == 0 or text.endswith(b"\r\x1b[K"), text[-100:])
    print(f"progress was shown {shown} times")


def test_bad_input():
    good = events()
    calib = write("calib.txt", CALIB)

    def replay(case, content, status, *patterns, n_lines=1, extra=()):
        name = re.sub(r"\W+", "_", case)
        path = write(f"bad/{name}.txt", content)
        return expect(case, ["replay", path, "--calib", calib, "-o", f"out/bad/{name}", "--attitude", "none", *extra], status, *patterns,
                      n_lines=n_lines), f"out/bad/{name}"

    expect("missing file", ["replay", "nowhere.txt", "-o", "o"], 1, "nowhere.txt: No such file", n_lines=1)
    expect("events alone", ["replay", write("bad/alone.txt", good), "-o", "o"], 0, "neither undistorted nor rotated", n_lines=0)
    expect("missing calibration", ["replay", "bad/alone.txt", "--poses", write("bad/one_pose.txt", "0 0 0 0 0 0 0 1\n"), "-o", "o"], 1,
           "no calibration; give --calib", n_lines=1)
    (ROOT / "empty_folder").mkdir()
    expect("empty folder", ["replay", "empty_folder", "-o", "o"], 1, "no events in this folder", n_lines=1)
    expect("folder for a file", ["replay", "bad/alone.txt", "--calib", "empty_folder", "-o", "o"], 1, "is a folder", n_lines=1)
    expect("missing IMU", ["replay", "bad/alone.txt", "--calib", calib, "--attitude", "imu", "-o", "o"], 1, "give --imu FILE", n_lines=1)
    expect("missing poses", ["replay", "bad/alone.txt", "--calib", calib, "--attitude", "truth", "-o", "o"], 1, "give --poses FILE", n_lines=1)
    expect("IMU file that is not there", ["replay", "bad/alone.txt", "--calib", calib, "--imu", "no.txt", "-o", "o"], 1, "no.txt: no such file")

    replay("empty file", "", 1, "holds no event")
    replay("only blank lines", "\n\n\n", 1, "holds no event")
    replay("binary garbage", bytes(i * 7919 % 256 for i in range(200000)), 1, "is this the right file|no usable event")
    replay("zeros", bytes(100000), 1, "no usable event")
    replay("another kind of file", imu(5000), 1, "looks like IMU samples")
    replay("another kind of text", "lorem ipsum dolor\n" * 5000, 1, "is this the right file")
    replay("png", b"\x89PNG\r\n\x1a\n" + bytes(500), 1, "no usable event")

    def skipped(case, line, cause, key):
        rows = good.splitlines()
        content = "\n".join(rows[:5] + [line] + rows[5:]) + "\n"
        _, out = replay(case, content, 0, rf"skipped 1 line of .*: 1 {cause}.* \(first: line 6\)")
        counted = summary(out)["events"]
        check(case, counted["bad"][key] == 1 and counted["replayed"] == 2000 and counted["in"] == 2001, counted)

    skipped("three columns", "1.00005 12 13", "malformed", "malformed")
    skipped("five columns", "1.00005 12 13 1 9", "malformed", "malformed")
    skipped("words", "hello world", "malformed", "malformed")
    skipped("NaN", "nan 12 13 1", "with NaN or infinity", "not_finite")
    skipped("x off the sensor", "1.00005 240 13 1", "off the sensor", "off_sensor")
    skipped("negative y", "1.00005 2 -13 1", "off the sensor", "off_sensor")
    skipped("1e9 in x", "1.00005 1000000000 13 1", "off the sensor", "off_sensor")
    skipped("1e9 in time", "1000000000 12 13 1", "where time jumps", "time_jump")
    skipped("1e30 in time", "1e30 12 13 1", "malformed", "malformed")
    skipped("time runs back", "0.5 12 13 1", "where time runs back", "time_back")
    skipped("control characters", "1.00005\x00 12 13 1", "malformed", "malformed")
    replay("truncated last line", good[:-8], 0, "1 malformed \\(first: line 2000\\)")
    replay("missing last line end", good[:-1], 0, ">2000 events", n_lines=0)
    replay("CR LF", good.replace("\n", "\r\n"), 0, ">2000 events", n_lines=0)
    replay("exponents", "".join(f"{1 + i * 1e-4:.18e} {i % 240:.6e} {i % 180:.6e} 1.0e+00\n" for i in range(100)), 0, ">100 events", n_lines=0)
    replay("one event", "1.0 1 1 1\n", 0, ">1 event", n_lines=0)
    replay("many faults", good + "x\n1.3 999 1 1\n1.3 1 1\n0.1 1 1 1\n", 0,
           r"skipped 4 lines of many_faults\.txt: 2 malformed \(first: line 2001\), 1 off the sensor \(first: line 2002\), "
           r"1 where time runs back \(first: line 2004\)")
    packed = gzip.compress(os.urandom(3000).hex().encode() + b"\n" + good.encode())
    replay("truncated gzip", packed[: len(packed) * 3 // 4], 1, "truncated", n_lines=2)
    damaged = bytearray(gzip.compress(good.encode()))
    for i in range(len(damaged) // 2, len(damaged) // 2 + 40):
        damaged[i] ^= 0x55
    replay("damaged gzip", bytes(damaged), 1, "damaged gzip|truncated|no usable event", n_lines=None)

    expect("output is a file", ["replay", "good", "-o", "calib.txt"], 1, "calib.txt: cannot create the output folder: a file of that name exists", n_lines=1)
    if os.geteuid() != 0:
        (ROOT / "locked").mkdir()
        (ROOT / "locked").chmod(0o500)
        expect("unwritable output", ["replay", "good", "-o", "locked/x"], 1, "cannot create the output folder: Permission denied", n_lines=1)
    expect("output below /proc", ["replay", "good", "-o", "/proc/evstab_cannot_be"], 1, "cannot create the output folder", n_lines=1)
    (ROOT / "blocked" / "events.csv").mkdir(parents=True)
    expect("output file blocked", ["replay", "good", "-o", "blocked", "--write", "events"], 1, "blocked/events.csv: cannot write", n_lines=1)

    for case, text, pattern in (("zero focal length", "0 200 120 90 0 0 0 0 0\n", "focal length fx 0"),
                                ("empty calibration", "", "holds 0 numbers"),
                                ("NaN in calibration", "nan 200 120 90\n", "focal length"),
                                ("1e9 in calibration", "200 200 1000000000 90\n", "principal point"),
                                ("words in calibration", "fx fy cx cy\n", "line 1"),
                                ("lens that folds over", "200 200 120 90 -8000 0 0 0 0\n", "check the distortion coefficients")):
        path = write("bad/calib.txt", text)
        expect(case, ["replay", "bad/alone.txt", "--calib", path, "-o", "out/bad/c", "--attitude", "none"], 1, pattern, n_lines=1)
    write("bad/broken.yaml", "K: [1, 2\n")
    expect("broken YAML", ["replay", "good", "--config", "bad/broken.yaml", "-o", "o"], 1, "bad/broken.yaml: line 2: not YAML", n_lines=1)
    expect("missing YAML", ["replay", "good", "--config", "no.yaml", "-o", "o"], 1, "no.yaml: No such file", n_lines=1)
    expect("too many tiles", ["replay", "good", "-o", "o", "--window", "area:300x26:200"], 1, "300x26 tiles do not fit", n_lines=1)

    lines = imu().splitlines()
    lines[100] = lines[100].replace("-9.7", "nan")
    lines[110] = "1e9 " + lines[110].split(" ", 1)[1]
    lines[120] = lines[119]
    lines[130] = "x"
    lines[140] = lines[140].replace("0.1 ", "1000000000 ")
    recording("bad_imu", imu_txt="\n".join(lines))
    expect("bad IMU lines", ["replay", "bad_imu", "-o", "out/bad_imu"], 0,
           r"skipped 5 lines of imu\.txt: 1 malformed \(first: line 131\), 1 with NaN or infinity \(first: line 101\), 1 with a value out of "
           r"range \(first: line 141\), 1 where time runs back \(first: line 121\), 1 where time jumps .* \(first: line 111\)", n_lines=1)
    expect("empty IMU", ["replay", recording("empty_imu", imu_txt=""), "-o", "o"], 1, "imu.txt: holds no usable sample", n_lines=1)
    expect("IMU of another kind", ["replay", recording("odd_imu", imu_txt=events()), "-o", "o"], 1, "imu.txt: ", n_lines=1)
    recording("bad_poses", imu_txt=None, groundtruth_txt=poses() + "1.5 0 0 0 0 0 0 0\n1.6 0 0 0 nan 0 0 1\n")
    expect("bad poses", ["replay", "bad_poses", "-o", "out/bad_poses"], 0, r"skipped 2 lines of groundtruth\.txt", n_lines=1)


def test_attitude():
    header = "t_s,gx_rad_s,gy_rad_s,gz_rad_s,ax_m_s2,ay_m_s2,az_m_s2\n"
    rows = [f"{i * 0.01:.6f},0,0,0.5,0,0,9.81" for i in range(500)]
    write("imu.csv", header + "\n".join(rows) + "\n")
    expect("attitude", ["attitude", "imu.csv", "-o", "q.csv"], 0, ">500 rows, 0 of them", n_lines=0)
    with open(ROOT / "q.csv", newline="") as file:
        table = list(csv.reader(file))
    check("header", table[0] == ["t_s", "qw", "qx", "qy", "qz"], table[0])
    check("one row per row", len(table) == 501, len(table))
    check("times", table[2][0] == "0.010000" and table[500][0] == "4.990000", table[2])
    q = list(map(float, table[500][1:]))
    check("unit", abs(sum(v * v for v in q) - 1) < 1e-8, q)
    yaw = 2 * math.atan2(q[3], q[0])
    check("a turn of 0.5 rad/s about the vertical", abs(yaw - 0.5 * 4.99) < 0.01, yaw)
    expect("gzip", ["attitude", write("imu.csv.gz", gzip.compress((header + "\n".join(rows)).encode())), "-o", "q2.csv"], 0)
    check("reads the same", (ROOT / "q.csv").read_bytes() == (ROOT / "q2.csv").read_bytes())
    check("quiet", run("attitude", "imu.csv", "-o", "q2.csv", "-q").stdout == "")
    for mode in ("gyro", "valenti"):
        expect(mode, ["attitude", "imu.csv", "-o", "q3.csv", "--mode", mode], 0, n_lines=0)
    for mode in ("filter", "gyro"):  # Subtracted, and kept: what is left turns by 0.1 rad/s. (Valenti's rule takes any slow turn for bias.)
        expect(f"bias, {mode}", ["attitude", "imu.csv", "-o", "q3.csv", "--mode", mode, "--gyro-bias", "0,-0,0.4"], 0, n_lines=0)
        q = list(map(float, (ROOT / "q3.csv").read_text().splitlines()[-1].split(",")[1:]))
        check(f"a bias of 0.4 rad/s is subtracted, {mode}", abs(2 * math.atan2(q[3], q[0]) - 0.1 * 4.99) < 0.01, q)
    for text in ("0.01,0.02", "1,0,0", "0,0,x", "0,0,0,", "0;0;0"):
        expect(f"--gyro-bias {text}", ["attitude", "imu.csv", "-o", "q4.csv", "--gyro-bias", text], 2, "--gyro-bias is '", "rad/s", n_lines=1)
    check("nothing written by a wrong bias", not (ROOT / "q4.csv").exists())
    expect("wrong mode", ["attitude", "imu.csv", "-o", "q3.csv", "--mode", "kalman"], 2, "expected filter, gyro or valenti", n_lines=1)

    bad = list(rows)
    bad[0] = "x" + bad[0]
    bad[7] = "0.07,nan,0,0.5,0,0,9.81"
    bad[8] = "0.08,0,0"
    bad[9] = "1000000000,0,0,0.5,0,0,9.81"
    bad[10] = "0.05,0,0,0.5,0,0,9.81"
    bad[11] = ",,,,,,"
    write("imu_bad.csv", header + "\n".join(bad))
    expect("bad rows", ["attitude", "imu_bad.csv", "-o", "q.csv"], 0, r"skipped 6 lines of imu_bad\.csv: 3 malformed", ">500 rows, 6 of them", n_lines=1)
    table = (ROOT / "q.csv").read_text().splitlines()
    check("still one row per row", len(table) == 501, len(table))
    check("which repeat the last orientation", len({row.split(",", 1)[1] for row in table[7:13]}) == 1, table[7:13])
    check("a bad row keeps its time", table[8].startswith("0.070000,"), table[8])

    expect("no header", ["attitude", write("nohead.csv", "0,0,0,0,0,0,9.8\n"), "-o", "q.csv"], 1, "line 1: no header names the columns", n_lines=1)
    expect("missing column", ["attitude", write("short.csv", "t_s,gx_rad_s,gy_rad_s\n0,0,0\n"), "-o", "q.csv"], 1,
           "gz_rad_s, ax_m_s2, ay_m_s2, az_m_s2", n_lines=1)
    expect("empty", ["attitude", write("empty.csv", ""), "-o", "q.csv"], 1, "holds no sample", n_lines=1)
    expect("header alone", ["attitude", write("head.csv", header), "-o", "q.csv"], 1, "holds no sample", n_lines=1)
    expect("missing", ["attitude", "no.csv", "-o", "q.csv"], 1, "no.csv: No such file", n_lines=1)
    expect("output is the input", ["attitude", "imu.csv", "-o", "./imu.csv"], 1, "would overwrite the input", n_lines=1)
    expect("no output", ["attitude", "imu.csv"], 2, "-o Q.csv is missing", n_lines=1)
    expect("unwritable", ["attitude", "imu.csv", "-o", "/nowhere/q.csv"], 1, "/nowhere/q.csv: cannot write", n_lines=1)
    if os.path.exists("/dev/full"):
        expect("disk full", ["attitude", "imu.csv", "-o", "/dev/full"], 1, "No space left", n_lines=1)


def flow_of(v, seed, n=120, frame=None):
    """Exact flow of random points under a motion along v, with the numbers of a simple generator."""
    state, rows = seed, []
    def uniform():
        nonlocal state
        state = (state * 1103515245 + 12345) % 2**31
        return state / 2**31
    for _ in range(n):
        x, y, rho = uniform() - 0.5, 0.8 * uniform() - 0.4, 0.01 + 0.04 * uniform()
        uv = rho * (x * v[2] - v[0]), rho * (y * v[2] - v[1])
        rows.append(("" if frame is None else f"{frame},") + f"{x:.7f},{y:.7f},{uv[0]:.9f},{uv[1]:.9f}")
    return rows


def angle_deg(a, b):
    return math.degrees(math.acos(max(-1.0, min(1.0, sum(p * q for p, q in zip(a, b))))))


def directions(text):
    table = list(csv.reader(text.splitlines()))
    check("header of directions", table[0] == ["frame", "vx", "vy", "vz", "sigma_deg", "n_inliers"], table[0])
    return {int(row[0]): ([float(c) for c in row[1:4]], float(row[4]), int(row[5])) for row in table[1:]}


def test_egomotion():
    truth = {3: (0.6, 0.0, 0.8), 4: (-1.0, 0.0, 0.0), 9: (0.0, 0.6, -0.8), -2: (0.48, -0.6, 0.64)}
    lines = ["frame,x,y,u,v"] + [row for frame, v in truth.items() for row in flow_of(v, 7 + frame, frame=frame)]
    write("flow.csv", "\n".join(lines) + "\n")
    done = expect("four frames", ["egomotion", "flow.csv"], 0, n_lines=0)
    found = directions(done.stdout)
    check("one line per frame, in their order", list(found) == list(truth), list(found))
    for frame, v in truth.items():
        got, sigma, n = found[frame]
        check("direction and sign", angle_deg(got, v) < 0.1, (frame, got, v))
        check("unit", abs(sum(c * c for c in got) - 1) < 1e-8, got)
        check("sigma", sigma < 0.1, sigma)
        check("inliers", n == 120, n)
    for method, limit in (("erlv", 0.1), ("erlv-paper", 0.5), ("erl", 1.0)):
        other = directions(expect(method, ["egomotion", "flow.csv", "--method", method], 0, n_lines=0).stdout)
        check(f"{method} finds them", all(angle_deg(other[f][0], v) < limit for f, v in truth.items()), other)
    expect("wrong method", ["egomotion", "flow.csv", "--method", "ransac"], 2, "expected erlv, erlv-paper or erl", n_lines=1)
    for value in ("-1", "51", "x"):
        expect("wrong sigma", ["egomotion", "flow.csv", "--rotation-sigma-deg", value], 2, "expected degrees from 0 to 50", n_lines=1)
    expect("a prior is not theirs", ["egomotion", "flow.csv", "--method", "erl", "--rotation-sigma-deg", "1"], 2, "is for --method erlv", n_lines=1)

    def same(case, name, content, *arguments):
        again = expect(case, ["egomotion", write(name, content), *arguments], 0, n_lines=0)
        check(case, again.stdout == done.stdout, again.stdout)
    same("gzip", "flow.csv.gz", gzip.compress("\n".join(lines).encode()))
    same("CR LF, no last line end", "flow_crlf.csv", "\r\n".join(lines))
    same("blanks, comments, a commented header, capitals", "flow_blank.csv",
         "# made by hand\n\n#Frame X Y U V\n# and\n" + "\n".join(line.replace(",", " ") for line in lines[1:]))
    shuffled = ["q;v;frame;x;u;y;z"] + ["a;{4};{0};{1};{3};{2};0".format(*line.split(",")) for line in lines[1:]]
    same("columns in another order, others beside them", "flow_order.csv", "\n".join(shuffled))
    expect("to a file", ["egomotion", "flow.csv", "-o", "v.csv"], 0, ">v.csv: 4 frames, 0 of them", n_lines=0)
    check("the same there", (ROOT / "v.csv").read_text() == done.stdout)
    check("quiet", run("egomotion", "flow.csv", "-o", "v.csv", "-q").stdout == "")
    expect("onto itself", ["egomotion", "flow.csv", "-o", "flow.csv"], 1, "would overwrite the input", n_lines=1)
    expect("unwritable", ["egomotion", "flow.csv", "-o", "/nowhere/v.csv"], 1, "/nowhere/v.csv", n_lines=1)

    tiny = ["x,y,u,v"] + [",".join(row.split(",")[:2] + [f"{float(c) * 1e-5:.12e}" for c in row.split(",")[2:]])
                          for row in flow_of((0.6, 0.0, 0.8), 1)]
    got = directions(expect("no frame column, tiny flow", ["egomotion", write("flow_tiny.csv", "\n".join(tiny))], 0, n_lines=0).stdout)
    check("frame 0", list(got) == [0] and angle_deg(got[0][0], (0.6, 0.0, 0.8)) < 0.1 and got[0][1] < 1, got)

    nothing = ["frame,x,y,u,v", "1,0.1,0.2,0,0", "1,0.2,0.3,0,0"] + flow_of((0.6, 0.0, 0.8), 1, frame=2) + flow_of((0.6, 0.0, 0.8), 1, 4, 5)
    nothing += ["6,nan,0,0,0", "6,0,0,inf,0"]
    bad = expect("frames that tell nothing", ["egomotion", write("flow_none.csv", "\n".join(nothing))], 0,
                 "note: 3 of 4 frames tell no direction", r"skipped 2 lines of flow_none.csv: 2 .*\(first: line 128\)", n_lines=1)
    got = directions(bad.stdout)
    check("still a line each, sigma 180, a unit vector", list(got) == [1, 2, 5, 6] and all(got[f][1] == 180 for f in (1, 5, 6)) and
          all(abs(sum(c * c for c in got[f][0]) - 1) < 1e-8 for f in got), got)
    check("the good one is good", got[2][1] < 1 and angle_deg(got[2][0], (0.6, 0.0, 0.8)) < 0.1, got[2])

    spoilt = list(lines)
    spoilt[5] = "3,0.1,0.2,0.3"
    spoilt[9] = "3,0.1,0.2,x,0.3"
    spoilt[10] = "3.5,0.1,0.2,0.1,0.3"
    spoilt[11] = ",0.1,0.2,0.1,0.3"
    spoilt[20] = "3,8.0,0.2,0.1,0.3"
    spoilt[21] = "3,0.1,0.2,1e9,0.3"
    spoilt.insert(30, "3,0.1," + "9" * 70000)
    expect("bad lines", ["egomotion", write("flow_bad.csv", "\n".join(spoilt))], 0, r"skipped 7 lines of flow_bad.csv: 5 malformed \(first: line 6\), 2 .*\(first: line 21\)",
           n_lines=1)
    again = lines + flow_of((0.6, 0.0, 0.8), 5, 1, 4)
    expect("a frame that comes again", ["egomotion", write("flow_again.csv", "\n".join(again))], 1, r"line 482: frame 4 was there before", n_lines=1)
    many = ["x,y,u,v"] + ["0.1,0.1,0.01,0.01"] * 65536
    expect("too many", ["egomotion", write("flow_many.csv", "\n".join(many))], 1, "line 65537: more than 65535 vectors in frame 0", n_lines=1)
    expect("no such file", ["egomotion", "nowhere.csv"], 1, "nowhere.csv", "No such file", n_lines=1)
    expect("empty", ["egomotion", write("flow_empty.csv", "")], 1, "the file is empty", n_lines=1)
    expect("no header", ["egomotion", write("flow_nohead.csv", "\n".join(lines[1:]))], 1, "line 1: no header with the columns x, y, u, v", n_lines=1)
    expect("a column is missing", ["egomotion", write("flow_xyu.csv", "frame,x,y,u\n0,0,0,0\n")], 1, "line 1: no header", n_lines=1)
    expect("header only", ["egomotion", write("flow_head.csv", lines[0])], 1, "holds no flow vector", n_lines=1)
    expect("garbage", ["egomotion", write("flow_png.csv", bytes(range(256)) * 300)], 1, "no header", n_lines=1)
    cut = gzip.compress("\n".join(lines).encode())[:-300]
    done = expect("truncated gzip", ["egomotion", write("flow_cut.csv.gz", cut)], 1, "flow_cut.csv.gz", n_lines=1)
    check("what could be read is there", len(done.stdout.splitlines()) >= 2, done.stdout)
    if os.path.exists("/dev/full"):
        expect("full disk", ["egomotion", "flow.csv", "-o", "/dev/full"], 1, "/dev/full", n_lines=1)


def test_lut():
    for arguments in (["calib.txt", "--size", "240x180"], ["calib.txt", "--step", "8", "--name", "lens"], ["good.yaml", "--step", "32"]):
        expect("lut", ["lut", *arguments, "-o", "camera-lut.h"], 0, ">camera-lut.h: ", n_lines=0)
        name = "lens" if "--name" in arguments else "camera_lut"
        text = (ROOT / "camera-lut.h").read_text()
        check("tells its inputs", "fx 2" in text and "distortion" in text and arguments[0] in text)
        write("use.c", f'#include "camera-lut.h"\n#include "evs/undistort.h"\nint main(void)\n{{\n    evs_undistort_t u;\n'
                       f"    return (int)evs_undistort_bind(&u, {name.upper()}_WIDTH_PX, {name.upper()}_HEIGHT_PX, {name.upper()}_STEP_PX, {name},\n"
                       f"                                   sizeof {name} / sizeof {name}[0]);\n}}\n")
        done = subprocess.run([CC, "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wconversion", "-fsyntax-only", f"-I{INCLUDE}", "use.c"],
                              cwd=ROOT, capture_output=True, text=True)
        check("the header compiles", done.returncode == 0, done.stderr)
    expect("odd step", ["lut", "calib.txt", "-o", "x.h", "--step", "3"], 2, "expected 1, 2, 4", n_lines=1)
    expect("odd name", ["lut", "calib.txt", "-o", "x.h", "--name", "a b"], 2, "expected a short C name", n_lines=1)
    expect("output is the input", ["lut", "calib.txt", "-o", "calib.txt"], 1, "would overwrite the input", n_lines=1)
    if os.path.exists("/dev/full"):
        with open("/dev/full", "wb") as full:
            done = subprocess.run([EVSTAB, "--help"], stdout=full, stderr=subprocess.PIPE)
        check("standard output full", done.returncode == 1 and b"standard output" in done.stderr, done)
    expect("no camera", ["lut", write("none.yaml", "a: 1\n"), "-o", "x.h"], 1, "no camera in it", n_lines=1)
    expect("folds over", ["lut", write("fold.txt", "200 200 120 90 -8000 0 0 0 0\n"), "-o", "x.h"], 1, "check the distortion coefficients", n_lines=1)
    expect("unwritable", ["lut", "calib.txt", "-o", "/nowhere/x.h"], 1, "cannot write", n_lines=1)
    check("no litter", not (ROOT / "x.h").exists())


def test_info():
    expect("folder", ["info", "good"], 0, ">2000 events", ">imu.txt: 400 samples", ">100 poses", ">fx 200", ">not there images", n_lines=0)
    expect("events", ["info", "good/events.txt"], 0, ">0.199900 s", ">10005 events/s", n_lines=0)
    expect("imu", ["info", "good/imu.txt"], 0, ">1000.0 Hz", n_lines=0)
    expect("poses", ["info", "good/groundtruth.txt"], 0, ">200.0 Hz", n_lines=0)
    expect("calib", ["info", "calib.txt"], 0, ">pinhole", n_lines=0)
    expect("yaml", ["info", "good.yaml"], 0, ">fx 210", n_lines=0)
    expect("bad lines", ["info", "bad/many_faults.txt", "--size", "240x180"], 0, ">skipped 4 lines", n_lines=0)
    expect("missing", ["info", "nowhere"], 1, "No such file", n_lines=1)
    expect("empty", ["info", "empty.csv"], 1, "the file is empty", n_lines=1)
    expect("garbage", ["info", "bad/png.txt"], 1, "unknown format", n_lines=1)
    expect("empty folder", ["info", "empty_folder"], 1, "no recording in this folder", n_lines=1)
    expect("two windows", ["info", write("two/events_1.txt", events()).parent], 0, ">2000 events")
    write("two/events_2.txt", events())
    expect("two windows", ["info", "two"], 1, "holds several event files", n_lines=1)
    expect("one damaged part does not hide the others", ["info", recording("part", calib_txt="0 0 0 0\n")], 1, "focal length", ">2000 events",
           ">400 samples", n_lines=1)


def main():
    try:
        for test in (test_usage, test_replay, test_velocity, test_terminal, test_bad_input, test_attitude, test_egomotion, test_lut, test_info):
            test()
    finally:
        shutil.rmtree(ROOT, ignore_errors=True)
    print(f"{N_CHECKS} checks, {FAULTS} failed")
    sys.exit(1 if FAULTS else 0)


main()
