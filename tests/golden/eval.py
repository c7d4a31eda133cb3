#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Compares the numbers of `evstab eval` with numbers worked out by hand and with a second, independent computation.

usage: eval.py EVSTAB usage|hand|numpy|sim

usage  wrong words and bad input: exit status, one line each
hand   a run of a few rows whose errors can be told without a computer
numpy  random motion with noise, drift and gaps, against numpy
sim    a simulated flight (EVS_DATA_DIR) replayed and compared: attitude, velocity by two kinds of truth, sharpness

Exits 77 when numpy or the recordings are not there.
"""
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

EVSTAB = os.path.abspath(sys.argv[1]) if len(sys.argv) == 3 else None
DATA = pathlib.Path(os.environ.get("EVS_DATA_DIR", "."))
ROOT = pathlib.Path(tempfile.mkdtemp(prefix="evstab_eval_"))
FAULTS = []


def check(what, ok, detail=""):
    print(f"{'ok  ' if ok else 'FAIL'} {what}: {detail}")
    if not ok:
        FAULTS.append(what)


def close(what, ours, theirs, bound=1e-6):
    check(what, ours is not None and abs(ours - theirs) <= bound, f"{ours}, expected {theirs:.9g}")


def skip(why):
    print(f"SKIPPED: {why}")
    sys.exit(77)


def run(*arguments):
    done = subprocess.run([EVSTAB, *map(str, arguments)], capture_output=True, text=True, cwd=ROOT, timeout=120)
    check("no sanitizer report", "Sanitizer" not in done.stderr and "runtime error" not in done.stderr, done.stderr[:300])
    return done


def evaluate(folder, *arguments):
    done = run("eval", folder, *arguments)
    check(f"eval {' '.join(map(str, arguments))}", done.returncode == 0, done.stderr.strip())
    return json.loads((ROOT / folder / "eval.json").read_text())


def write(name, text):
    path = ROOT / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def make_run(name, attitude, velocity=None, source="imu", span=None):
    """A folder as `evstab replay` leaves it; attitude: rows of t, qw, qx, qy, qz."""
    summary = {"settings": {"attitude": source, "camera": {"width_px": 240, "height_px": 180}}}
    if span is not None:
        summary.update(t_first_s=span[0], t_last_s=span[1])
    write(f"{name}/summary.json", json.dumps(summary))
    rows = "".join(f"{t:.6f},{w:.9f},{x:.9f},{y:.9f},{z:.9f},0,0,0,0\n" for t, w, x, y, z in attitude)
    write(f"{name}/attitude.csv", "#t_s,qw,qx,qy,qz,wx_rad_s,wy_rad_s,wz_rad_s,flags\n" + rows)
    if velocity is not None:
        write(f"{name}/velocity.csv", "#t_s,vx,vy,vz,sigma_deg,n_flow,n_inliers\n" + velocity)
    return name


def about(axis, deg):
    half = math.radians(deg) / 2
    return [math.cos(half)] + [math.sin(half) * (axis == a) for a in "xyz"]


# --- usage -------------------------------------------------------------------------------------------------------

def expect(case, arguments, status, words):
    done = run(*arguments)
    lines = [line for line in done.stderr.splitlines() if not line.startswith("evstab: note:")]
    check(case, done.returncode == status and len(lines) == 1 and words in lines[0],
          f"exit {done.returncode}, expected {status}; '{words}' in: {done.stderr.strip()}")


def test_usage():
    good = make_run("good", [(1 + 0.01 * i, 1, 0, 0, 0) for i in range(50)])
    truth = write("truth.txt", "".join(f"{1 + 0.01 * i:.6f} 0 0 0 0 0 0 1\n" for i in range(50)))
    help_text = run("eval", "--help")
    check("--help", help_text.returncode == 0 and "Usage: evstab eval" in help_text.stdout and "Exit status" in help_text.stdout)
    check("listed", "  eval " in run("--help").stdout)
    expect("no run", ["eval"], 2, "something is missing")
    expect("no truth", ["eval", good], 2, "--truth FILE is missing")
    expect("two runs", ["eval", good, good, "--truth", truth], 2, "one word too many")
    expect("unknown option", ["eval", good, "--truth", truth, "--what"], 2, "unknown option")
    for option, value in (("--align", "both"), ("--poses-offset-us", "1ms"), ("--from", "now"), ("--to", "x"), ("--baseline-ms", "0")):
        expect(f"{option} {value}", ["eval", good, "--truth", truth, option, value], 2, option)
    expect("from after to", ["eval", good, "--truth", truth, "--from", "2", "--to", "1"], 2, "--from")
    expect("six and nine", ["eval", good, "--truth", truth, "--sixdof", "--ninedof"], 2, "exclude")
    expect("six and align", ["eval", good, "--truth", truth, "--sixdof", "--align", "full"], 2, "exclude")
    check("wrong usage writes nothing", not (ROOT / good / "eval.json").exists())

    expect("no such run", ["eval", "nosuch", "--truth", truth], 1, "nosuch")
    (ROOT / "empty").mkdir()
    expect("not a run", ["eval", "empty", "--truth", truth], 1, "summary.json is missing")
    expect("a file for a run", ["eval", truth, "--truth", truth], 1, "no run in it")
    expect("no such truth", ["eval", good, "--truth", "nosuch.txt"], 1, "nosuch.txt")
    expect("empty truth", ["eval", good, "--truth", write("none.txt", "")], 1, "holds no pose")
    expect("truth at other times", ["eval", good, "--truth", truth, "--poses-offset-us", "60000000"], 1, "--poses-offset-us")
    expect("nothing in the span", ["eval", good, "--truth", truth, "--from", "7"], 1, "--from")
    expect("a velocity truth without velocities", ["eval", good, "--velocity-truth", truth], 1, "velocity.csv")
    write("broken/summary.json", "{")
    expect("a broken summary", ["eval", "broken", "--truth", truth], 1, "summary.json")
    write("other/summary.json", "{}")
    expect("another program's summary", ["eval", "other", "--truth", truth], 1, "no sensor size")
    expect("nowhere to write", ["eval", good, "--truth", truth, "--json", "nosuch/x.json"], 1, "nosuch/x.json")
    make_run("bad_events", [(1 + 0.01 * i, 1, 0, 0, 0) for i in range(50)])
    write("bad_events/events.csv", "#t_s\n1.0,2,3\n")
    write("bad_events/windows.csv", "#index\n0,0,1,1.0,1.0,end,0,1,0,0,0\n")
    expect("an events.csv that is none", ["eval", "bad_events", "--truth", truth], 1, "line 2")
    none = make_run("no_attitude", [], source="none")
    expect("a run without attitude", ["eval", none, "--truth", truth], 1, "nothing in it can be compared")
    done = run("eval", good, "--truth", truth, "--json", "other.json")
    check("a good run, told without events", done.returncode == 0 and "no sharpness" in done.stderr and "RMSE" in done.stdout)
    check("--json", (ROOT / "other.json").exists() and not (ROOT / good / "eval.json").exists())
    done = run("eval", good, "--truth", truth, "-q")
    check("--quiet", done.returncode == 0 and done.stdout == "" and done.stderr == "", done.stderr)


# --- by hand -----------------------------------------------------------------------------------------------------

def test_hand():
    # The truth looks straight; the estimate is off by 10 degrees of heading at first (taken out), then by 13, 6 and 10
    # with a tilt of 4. Left over: heading 0, 3, -4, 0; tilt 0, 0, 0, 4.
    truth = write("truth.txt", "".join(f"{0.05 * i:.6f} {0.05 * i:.6f} 0 0 0 0 0 1\n" for i in range(100)))
    tilted = [math.cos(math.radians(5)) * math.cos(math.radians(2)), math.cos(math.radians(5)) * math.sin(math.radians(2)),
              math.sin(math.radians(5)) * math.sin(math.radians(2)), math.sin(math.radians(5)) * math.cos(math.radians(2))]
    attitude = [(0.5, *about("z", 10)), (1.6, *about("z", 13)), (2.0, *about("z", 6)), (2.5, *tilted)]
    # The camera moves along x at 1 m/s. Estimates at 0, 90 and 60 degrees from it, one missing, one beyond the truth.
    half, root = 0.5, math.sqrt(0.75)
    velocity = (f"4.0,1,0,0,1,5,5\n4.1,0,1,0,1,5,5\n4.2,nan,nan,nan,nan,2,0\n4.3,{half},{root:.9f},0,1,5,5\n"
                "4.945,1,0,0,1,5,5\n")
    # The attitude in between is not there: 0.1 s and 1 s cannot be judged.
    e = evaluate(make_run("run", attitude, velocity), "--truth", truth)
    a = e["attitude"]
    close("heading that was removed", a["aligned"]["heading_deg"], 10)
    close("total RMSE", a["total"]["rmse_deg"], math.sqrt((0 + 9 + 16 + 16) / 4))
    close("total max", a["total"]["max_deg"], 4)
    close("heading RMSE", a["heading"]["rmse_deg"], math.sqrt((0 + 9 + 16 + 0) / 4))
    close("inclination RMSE", a["inclination"]["rmse_deg"], math.sqrt(16 / 4))
    check("nothing over 0.1 s", a["over_100ms"]["n"] == 0 and a["over_1s"]["n"] == 0)
    v = e["velocity"]
    check("coverage of a run that does not tell its span", v["covered_share"] is None, v)
    close("within sigma: one of three", v["within_sigma_share"], 1 / 3)
    check("velocity counts", (v["direction"]["n"], v["n_no_estimate"], v["n_no_truth"], v["n_slow"]) == (3, 1, 1, 0), v)
    close("velocity mean", v["direction"]["mean_deg"], 50)
    close("velocity median", v["direction"]["median_deg"], 60)
    close("velocity 95 %", v["direction"]["p95_deg"], 87)
    close("mean speed", v["mean_speed_m_s"], 1)
    a = evaluate("run", "--truth", truth, "--ninedof")["attitude"]
    close("nine degrees of freedom: nothing removed", a["heading"]["rmse_deg"], math.sqrt((100 + 169 + 36 + 100) / 4))
    euroc = write("euroc.csv", "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n" +
                  "".join(f"{50000000 * i},{0.05 * i:.6f},0,0,1,0,0,0\n" for i in range(100)))
    b = evaluate("run", "--truth", euroc, "--ninedof")["attitude"]
    check("the same truth in EuRoC's form", all(a[key] == b[key] for key in ("total", "inclination", "heading")), b["total"])
    a = evaluate("run", "--truth", truth, "--from", "1.6", "--to", "2.5")["attitude"]
    check("--from is in, --to is out", a["n"] == 2, a["n"])
    # Shifted by 2.5 s the truth ends at 2.45 s, before the last row at 2.5 s.
    a = evaluate(make_run("shifted", attitude), "--truth", truth, "--poses-offset-us", "-2500000")["attitude"]
    check("--poses-offset-us shifts the truth", (a["n"], a["n_no_truth"]) == (3, 1), (a["n"], a["n_no_truth"]))


# --- numpy -------------------------------------------------------------------------------------------------------

def numpy_and_model():
    try:
        import numpy
        import replay_model
    except ImportError as error:
        skip(f"{error}; install tests/requirements.txt")
    return numpy, replay_model


def slerp_at(np, m, times, t, q, gap=0.1):
    """Orientations at times; NaN outside and in gaps."""
    i = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    step = t[i + 1] - t[i]
    s = (times - t[i]) / step
    turned = m.logarithm(m.multiply(m.conjugate(q[i]), q[i + 1]))
    out = m.multiply(q[i], m.exponential(s[:, None] * turned))
    exact = (times == t[i]) | (times == t[i + 1])
    bad = (times < t[0]) | (times > t[-1]) | ((step > gap + 1e-9) & ~exact)
    out[bad] = np.nan
    return out


def angles(np, e):
    """The definitions as written: with acos and atan, in degrees."""
    e = e / np.linalg.norm(e, axis=-1, keepdims=True)
    w, z = np.abs(e[..., 0]), np.abs(e[..., 3])
    total = 2 * np.degrees(np.arccos(np.clip(w, 0, 1)))
    heading = 2 * np.degrees(np.arctan2(z, w))
    inclination = 2 * np.degrees(np.arccos(np.clip(np.sqrt(w * w + z * z), 0, 1)))
    return total, inclination, heading


def check_stats(np, what, ours, errors, bound=2e-5):
    check(f"{what}: count", ours["n"] == len(errors), f"{ours['n']}, expected {len(errors)}")
    for key, value in (("rmse_deg", np.sqrt((errors ** 2).mean())), ("max_deg", errors.max()), ("mean_deg", errors.mean()),
                       ("median_deg", np.median(errors)), ("p95_deg", np.percentile(errors, 95))):
        close(f"{what}: {key}", ours[key], float(value), bound)


def over(np, m, span, t, q, kept, ref_t, ref_q):
    """Error of the rotation over a span, from each kept estimate on."""
    first = t[kept]
    later = first + span
    inside = later <= first[-1] + 1e-9
    later = np.round(later, 6)
    est = slerp_at(np, m, later, t, q)
    ref = slerp_at(np, m, later, ref_t, ref_q)
    ref_now = slerp_at(np, m, first, ref_t, ref_q)
    turned_est = m.multiply(m.conjugate(q[kept]), est)
    turned_ref = m.multiply(m.conjugate(ref_now), ref)
    e = angles(np, m.multiply(m.conjugate(turned_ref), turned_est))[0]
    return e[inside & np.isfinite(e)]


def compare_with_numpy(np, m, attitude, t, q, ref_t, ref_q):
    """All figures of a six-degrees-of-freedom comparison."""
    ref = slerp_at(np, m, t, ref_t, ref_q)
    kept = np.isfinite(ref[:, 0])
    e = m.multiply(q[kept], m.conjugate(ref[kept]))
    time = t[kept]
    turned = angles(np, m.multiply(m.conjugate(ref[kept][:1]), ref[kept]))[0]
    moving = np.flatnonzero(turned > 1)
    start = time[0]
    if len(moving) and time[moving[0]] - 0.1 - time[0] >= 1:
        start = time[moving[0]] - 1.1
    first = (time >= start - 1e-9) & (time <= start + 1 + 1e-9)
    heading = 2 * np.arctan2(e[first, 3], e[first, 0])
    offset = np.arctan2(np.sin(heading).mean(), np.cos(heading).mean())
    close("removed heading", attitude["aligned"]["heading_deg"], math.degrees(offset), 1e-4)
    left = np.array([math.cos(offset / 2), 0, 0, math.sin(offset / 2)])
    e = m.multiply(q[kept], m.conjugate(m.multiply(left, ref[kept])))
    for key, errors in zip(("total", "inclination", "heading"), angles(np, e)):
        check_stats(np, key, attitude[key], errors)
    check_stats(np, "over 0.1 s", attitude["over_100ms"], over(np, m, 0.1, t, q, kept, ref_t, ref_q))
    check_stats(np, "over 1 s", attitude["over_1s"], over(np, m, 1.0, t, q, kept, ref_t, ref_q))


def pose_rows(np, t, p, q):
    return "".join(f"{a:.6f} {b[0]:.9f} {b[1]:.9f} {b[2]:.9f} {c[1]:.12f} {c[2]:.12f} {c[3]:.12f} {c[0]:.12f}\n"
                   for a, b, c in zip(t, p, q))


def test_numpy():
    np, m = numpy_and_model()
    rng = np.random.default_rng(20240901)
    ref_t = np.round(np.arange(0, 12, 0.008), 6)
    ref_t = ref_t[(ref_t < 5.0) | (ref_t > 5.3)]  # markers hidden
    rest = 3.0

    def motion(t):
        s = np.maximum(t - rest, 0)[:, None]
        return m.multiply(m.exponential(s * 0 + np.sin(s * [1.9, 2.3, 1.1]) * [0.7, 0.5, 1.2]),
                          m.exponential(np.sin(s * 5) * [0.1, 0.2, 0.0]))

    def position(t):
        return np.sin(1.3 * t)[:, None] * [1.0, 0.4, 0.3] + 0.02 * np.cos(7 * t)[:, None] * [0, 1, -1]

    t = np.round(np.arange(0.5, 12.4, 0.005), 6)
    drift = m.exponential(np.stack([0.002 * t, -0.003 * t, 0.01 * t + 2.0], axis=-1))
    q = m.multiply(m.multiply(drift, motion(t)), m.exponential(rng.normal(0, 0.004, (len(t), 3))))
    q = np.round(q, 9)
    ref_q = motion(ref_t)
    truth = write("truth.txt", pose_rows(np, ref_t, position(ref_t), ref_q))

    v_t = np.round(np.arange(0.9, 11.5, 0.031), 6)
    v = rng.normal(0, 1, (len(v_t), 3))
    velocity = "".join(f"{a:.6f},{b[0]:.9f},{b[1]:.9f},{b[2]:.9f},{(1, 60, 130)[i % 3]},9,9\n"
                       for i, (a, b) in enumerate(zip(v_t, v)))
    run_name = make_run("run", [(a, *b) for a, b in zip(t, q)], velocity, span=(0.8, 11.9))

    spans = np.round(rng.uniform(0.02, 0.5, len(v_t)), 6)
    write(f"{run_name}/pairs.csv", "#t_s,interval_s,result,flow_px,n_corners,n_flow,n_inliers,saccade\n" +
          "".join(f"{a:.6f},{b:.6f},valid,4.0,9,9,9,0\n" for i, (a, b) in enumerate(zip(v_t, spans)) if i % 3))

    e = evaluate(run_name, "--truth", truth, "--baseline-ms", "40")
    check("heading at rest", e["attitude"]["aligned"]["at_rest"] is True)
    compare_with_numpy(np, m, e["attitude"], t, q, ref_t, ref_q)

    def position_at(times):
        out = np.stack([np.interp(times, ref_t, position(ref_t)[:, k]) for k in range(3)], axis=-1)
        out[np.isnan(slerp_at(np, m, times, ref_t, ref_q)[:, 0])] = np.nan
        return out

    # By numpy's least squares: a parabola through the samples within the baseline and its two interpolated ends.
    ends = [np.round(v_t + sign * 0.02, 6) for sign in (-1, 1)]
    at_ends = [position_at(times) for times in ends]
    world = np.full((len(v_t), 3), np.nan)
    for i, time in enumerate(v_t):
        within = (ref_t > ends[0][i] + 1e-9) & (ref_t < ends[1][i] - 1e-9)
        times = np.concatenate([[ends[0][i]], ref_t[within], [ends[1][i]]]) - time
        points = np.vstack([at_ends[0][i], np.round(position(ref_t[within]), 9), at_ends[1][i]])
        if np.isfinite(points).all():
            world[i] = np.linalg.lstsq(np.vander(times, 3), points, rcond=None)[0][1]
    orientation = slerp_at(np, m, v_t, ref_t, ref_q)
    true = np.einsum("nji,nj->ni", m.matrix(orientation), world)
    known = np.isfinite(true[:, 0])
    speed = np.linalg.norm(true[known], axis=1)
    fast = speed >= 0.25 * speed.mean()
    unit = v[known] / np.linalg.norm(v[known], axis=1, keepdims=True)
    error = np.degrees(np.arccos(np.clip((unit * true[known] / speed[:, None]).sum(axis=1), -1, 1)))
    check("velocity: counts", (e["velocity"]["n_no_truth"], e["velocity"]["n_slow"]) == (int((~known).sum()), int((~fast).sum())),
          f"{int((~known).sum())} without truth, {int((~fast).sum())} slow")
    check("velocity: both happen", (~known).any() and (~fast).any())
    check_stats(np, "velocity", e["velocity"]["direction"], error[fast], 1e-4)

    # Against the mean over the interval of each estimate: from where it begins to where it ends.
    first = np.round(v_t - np.floor(spans * 1e6 / 2) * 1e-6, 6)
    chord = (position_at(np.round(first + spans, 6)) - position_at(first)) / spans[:, None]
    chord = np.einsum("nji,nj->ni", m.matrix(orientation), chord)
    told = known.copy()
    told[known] = fast
    told &= np.isfinite(chord[:, 0]) & (np.arange(len(v_t)) % 3 > 0)
    both = (v * chord).sum(axis=1) / (np.linalg.norm(v, axis=1) * np.linalg.norm(chord, axis=1))
    check_stats(np, "velocity over the interval", e["velocity"]["direction_over_interval"],
                np.degrees(np.arccos(np.clip(both[told], -1, 1))), 1e-4)

    # Uncertainty and coverage: the sigmas of the rows cycle through three values.
    # An estimate is held to what it is one of: the mean over its interval, where that is told.
    sigma = np.array([1.0, 60.0, 130.0])[np.arange(len(v_t)) % 3][known][fast]
    error = error.copy()
    error[fast] = np.where(told[known][fast], np.degrees(np.arccos(np.clip(both, -1, 1)))[known][fast], error[fast])
    close("within sigma", e["velocity"]["within_sigma_share"], float((error[fast] <= sigma).mean()), 1e-8)
    close("within 2 sigma", e["velocity"]["within_2_sigma_share"], float((error[fast] <= 2 * sigma).mean()), 1e-8)
    first, last = 0.8, 11.9
    grid = np.arange(first, last, 1e-5) + 5e-6
    age = grid - v_t[np.clip(np.searchsorted(v_t, grid, side="right") - 1, 0, None)]
    close("covered", e["velocity"]["covered_share"], float(((age >= 0) & (age < 0.1)).mean()), 1e-4)
    part = evaluate(run_name, "--truth", truth, "--from", "11.0")["velocity"]
    close("covered, of a part", part["covered_share"], float(((age >= 0) & (age < 0.1))[grid >= 11.0].mean()), 1e-4)

    # Full alignment: the noise must be all that is left of arbitrary worlds and an arbitrary mounting.
    left, right = m.exponential(np.array([0.4, -0.7, 2.2])), m.exponential(np.array([1.5, 0.3, -0.4]))
    q = m.multiply(m.multiply(left, motion(t)), right)
    noisy = np.round(m.multiply(q, m.exponential(rng.normal(0, 0.004, (len(t), 3)))), 9)
    make_run("full", [(a, *b) for a, b in zip(t, noisy)])
    a = evaluate("full", "--truth", truth, "--align", "full")["attitude"]
    for key, want in (("q_estimate_world_from_truth_world_wxyz", left), ("q_truth_body_from_camera_wxyz", right)):
        got = np.array(a["aligned"][key])
        off = angles(np, m.multiply(m.conjugate(got), want))[0]
        check(f"{key}", off < 0.1, f"{off:.4f} deg off")
    close("what is left is the noise", a["total"]["rmse_deg"], math.degrees(0.004) * math.sqrt(3), 0.01)
    # It is a minimum: moving either rotation makes it worse.
    ref = slerp_at(np, m, t, ref_t, ref_q)
    kept = np.isfinite(ref[:, 0])
    gl, gr = (np.array(a["aligned"][k]) for k in ("q_estimate_world_from_truth_world_wxyz", "q_truth_body_from_camera_wxyz"))

    def rmse(dl, dr):
        model = m.multiply(m.multiply(m.multiply(m.exponential(dl), gl), ref[kept]), m.multiply(gr, m.exponential(dr)))
        return float(np.sqrt((angles(np, m.multiply(noisy[kept], m.conjugate(model)))[0] ** 2).mean()))

    best = rmse(np.zeros(3), np.zeros(3))
    close("RMSE after full alignment", a["total"]["rmse_deg"], best, 1e-5)
    for axis in range(3):
        for sign in (-1, 1):
            step = np.zeros(3)
            step[axis] = sign * 0.001
            check("a minimum", rmse(step, np.zeros(3)) > best and rmse(np.zeros(3), step) > best, f"axis {axis}, {sign}")


# --- a simulated flight ------------------------------------------------------------------------------------------

def test_sim():
    np, m = numpy_and_model()
    folder = DATA / "sim" / "sim1_21"
    if not (folder / "groundtruth.txt").exists():
        skip(f"{folder} is not there; EVS_DATA_DIR names the folder of recordings")
    done = run("replay", folder, "-o", "out", "--attitude", "imu", "--to", "1.2", "--write", "events", "-q")
    check("replay", done.returncode == 0, done.stderr)
    # Directions that are off by exactly 7 degrees, about an axis that changes.
    velocity = m.read_table(folder / "velocity.txt")
    direction = velocity[:, 1:4] / np.linalg.norm(velocity[:, 1:4], axis=1, keepdims=True)
    axis = np.cross(direction, np.roll(direction, 1, axis=1))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turned = np.einsum("nij,nj->ni", m.matrix(m.exponential(axis * math.radians(7))), direction)
    kept = velocity[:, 0] < 1.2
    write("out/velocity.csv", "#t_s,vx,vy,vz,sigma_deg,n_flow,n_inliers\n" +
          "".join(f"{t:.6f},{v[0]:.9f},{v[1]:.9f},{v[2]:.9f},1,9,9\n" for t, v in zip(velocity[kept, 0], turned[kept])))

    e = evaluate("out", "--truth", folder / "groundtruth.txt", "--velocity-truth", folder / "velocity.txt")
    for key in ("mean_deg", "median_deg", "max_deg"):
        close(f"velocity by velocities: {key}", e["velocity"]["direction"][key], 7, 1e-5)
    poses = m.read_table(folder / "groundtruth.txt")
    pose_q = poses[:, [7, 4, 5, 6]] / np.linalg.norm(poses[:, 4:8], axis=1, keepdims=True)
    table = m.read_csv(ROOT / "out/attitude.csv", range(5))
    compare_with_numpy(np, m, e["attitude"], table[:, 0], table[:, 1:5], poses[:, 0], pose_q)

    # By poses the truth itself is off a little: the motion curves within the baseline.
    for baseline in (10, 20, 40):
        d = evaluate("out", "--truth", folder / "groundtruth.txt", "--baseline-ms", baseline)["velocity"]["direction"]
        check(f"velocity by poses over {baseline} ms", abs(d["median_deg"] - 7) < 0.1 and d["p95_deg"] < 7.5,
              f"median {d['median_deg']:.4f}, 95 % {d['p95_deg']:.4f}, max {d['max_deg']:.4f}")

    # Sharpness: the pictures of a second implementation.
    rows = m.read_csv(ROOT / "out/events.csv", range(9))
    rows = rows[np.isfinite(rows[:, 4:8]).all(axis=1)]
    pictures = e["sharpness"]["per_window"]["pictures"]
    check("a picture per window", len(pictures) == len(np.unique(rows[:, 8])), len(pictures))
    for picture in pictures[:: max(1, len(pictures) // 3)]:
        part = rows[rows[:, 8] == picture[0]]
        check(f"events of window {picture[0]}", picture[2] == len(part), picture[2])
        close(f"window {picture[0]} without", picture[3], m.sharpness(part[:, 4:6]), 1e-5)
        close(f"window {picture[0]} with", picture[4], m.sharpness(part[:, 6:8]), 1e-5)
    saccades = m.read_csv(ROOT / "out/windows.csv", (0, 6))
    starts = set(saccades[saccades[:, 1] == 1, 0])
    windows = rows[:, 8]
    new, t_first = [0], rows[0, 0]
    for i in range(1, len(rows)):
        if round(1e6 * (rows[i, 0] - t_first)) >= 100000 or (windows[i] != windows[i - 1] and windows[i] in starts):
            new.append(i)
            t_first = rows[i, 0]
    pictures = e["sharpness"]["per_100ms"]["pictures"]
    check("pictures of 0.1 s", [p[2] for p in pictures] == list(np.diff(new + [len(rows)])), f"{len(pictures)} of {len(new)}")
    close("0.1 s without", pictures[0][3], m.sharpness(rows[:new[1], 4:6]), 1e-5)
    close("0.1 s with", pictures[0][4], m.sharpness(rows[:new[1], 6:8]), 1e-5)
    mean = np.array(pictures)[:, 3:5].mean(axis=0)
    close("gain", e["sharpness"]["per_100ms"]["gain"], mean[1] / mean[0], 1e-5)


TESTS = {"usage": test_usage, "hand": test_hand, "numpy": test_numpy, "sim": test_sim}


def main():
    if len(sys.argv) != 3 or sys.argv[2] not in TESTS:
        print(__doc__)
        sys.exit(2)
    try:
        TESTS[sys.argv[2]]()
    finally:
        import shutil
        shutil.rmtree(ROOT, ignore_errors=True)
    print(f"{len(FAULTS)} faults")
    sys.exit(1 if FAULTS else 0)


main()
