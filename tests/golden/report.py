#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Replays a small made-up recording and opens report.html in a browser: nothing may fail, nothing may be fetched, and
the page must have drawn what the recording holds, in the light and in the dark theme. Videos and the demo are tried too.

usage: report.py EVSTAB

Exits 77 when chromium is not there; what needs no browser is checked before.
"""
import html
import json
import math
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys
import tempfile

FAULTS = []
SECONDS, FOCAL, WIDTH, HEIGHT = 1.5, 200.0, 240, 180
NAME = """fl<i>ght & "co" 'x' <script>.d"""  # Markup that must stay text.


def check(what, ok, detail=""):
    print(f"{'ok  ' if ok else 'FAIL'} {what}: {detail}")
    if not ok:
        FAULTS.append(what)


def yaw(t):
    """The camera looks around while it is shaken: far enough for saccades."""
    return math.radians(60.0) * t + math.radians(6.0) * math.sin(2.0 * math.pi * 5.0 * t)


def yaw_rate(t):
    return math.radians(60.0) + math.radians(6.0) * 2.0 * math.pi * 5.0 * math.cos(2.0 * math.pi * 5.0 * t)


def make_recording(folder):
    """Points infinitely far away, seen by a camera that turns about its vertical axis."""
    draw = random.Random(1)
    points = [(draw.uniform(-0.7, 2.4), draw.uniform(-0.4, 0.4)) for _ in range(150)]
    folder.mkdir()
    (folder / "calib.txt").write_text(f"{FOCAL} {FOCAL} 119.5 89.5 0 0 0 0 0\n")
    with open(folder / "imu.txt", "w", encoding="ascii") as f:
        for i in range(-200, int(SECONDS * 1000) + 50):
            f.write(f"{1 + i / 1000:.6f} 0 -9.81 0 0 {yaw_rate(max(i, 0) / 1000) if i >= 0 else 0:.9f} 0\n")
    with open(folder / "events.txt", "w", encoding="ascii") as f:
        for i in range(90000):
            t = i / 90000 * SECONDS
            azimuth, height = draw.choice(points)
            angle = azimuth - yaw(t)
            x = round(FOCAL * math.tan(angle) + 119.5) if abs(angle) < 0.6 else -1
            y = round(FOCAL * height / math.cos(angle) + 89.5)
            if 0 <= x < WIDTH and 0 <= y < HEIGHT:
                f.write(f"{1 + t:.6f} {x} {y} {i & 1}\n")
            if i % 10000 == 5000:
                f.write("this is no event\n")


def evstab(program, *arguments, **options):
    return subprocess.run([program, *map(str, arguments)], text=True, capture_output=True, timeout=120, **options)


def browse(page, temp, *flags, until='"ready":true'):
    """@return what the page says about itself, and what the browser says about the page.

    The browser's virtual time does not wait for pictures that are being decoded elsewhere, so that now and then it is over
    before the page is done. Then look again: a page that never gets that far is told as it is.
    """
    for _ in range(4):
        seen = look_once(page, temp, *flags)
        if until in seen[3]:
            break
    return seen


def look_once(page, temp, *flags):
    profile = pathlib.Path(tempfile.mkdtemp(dir=temp))
    net_log = profile / "net.json"
    done = subprocess.run(
        ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--disable-extensions", "--disable-default-apps",
         "--disable-dev-shm-usage", f"--user-data-dir={profile}", f"--log-net-log={net_log}", "--enable-logging=stderr",
         "--host-resolver-rules=MAP * ~NOTFOUND", "--virtual-time-budget=20000", "--window-size=1000,900", *flags, "--dump-dom",
         page.as_uri()],
        text=True, capture_output=True, timeout=240)
    status = re.search(r'<p id="status" hidden="">(.*?)</p>', done.stdout, re.S)
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    # What a page asks for has an initiator; what the browser wants for itself (and does not get here) has none.
    log = net_log.read_text(errors="replace")
    requests = [line for line in log.splitlines()
                if re.search(r'"url":"(?!file:|data:|chrome|devtools:)', line) and '"initiator":"' in line and
                '"initiator":"not an origin"' not in line]
    return (json.loads(html.unescape(status[1])) if status and status[1] else None), console, requests, done.stdout


def check_page(page, temp, theme, flags, summary):
    status, console, requests, dom = browse(page, temp, *flags)
    check(f"{theme}: the script ran to its end", status is not None and status["ready"], status)
    if status is None:
        return
    check(f"{theme}: theme", status["theme"] == theme, status["theme"])
    check(f"{theme}: no errors", not status["errors"] and not console, (status["errors"], console))
    check(f"{theme}: nothing fetched", status["resources"] == 0 and not requests, (status["resources"], requests))
    for plot in ("attitude", "rate", "events", "window", "gain"):
        curves = 3 if plot in ("attitude", "rate") else 1
        n = status["plots"].get(plot, 0)
        check(f"{theme}: plot {plot}", 2 * curves < n <= 2000 * curves, f"{n} points")
    check(f"{theme}: evaluation", status["evaluation"] == 30, f"{status['evaluation']} cells")
    check(f"{theme}: animation", status["pictures"] >= 50, f"{status['pictures']} pictures")
    check(f"{theme}: before and after", status["span"]["before"] > 300 and 100 < status["span"]["after"],
          status["span"])
    check(f"{theme}: the name is text", f"<h1>{html.escape(NAME, quote=False)}</h1>" in dom and "<i>ght" not in dom,
          NAME)
    check(f"{theme}: counts", f"{summary['saccades']} saccades" in dom and "skipped:" in dom, "saccades, skipped lines")


# What a reader does, by script; what came of it is left in an element of its own.
HANDS = """<p id="hands" hidden></p><script>
const whenReady = (act) => { /* The page says so itself; how long its pictures take to decode, nobody knows. */
  const status = document.getElementById("status");
  const look = () => status.textContent.includes('"ready":true') && (watcher.disconnect(), act(), true);
  const watcher = new MutationObserver(look);
  watcher.observe(status, { childList: true, characterData: true, subtree: true });
  look();
};
whenReady(() => {
  const $ = (id) => document.getElementById(id);
  const out = {};
  const set = (id, value, event) => { $(id).value = value; $(id).dispatchEvent(new Event(event)); };
  set("split", "20", "input");
  out.split = $("compare").style.getPropertyValue("--split");
  out.spoken = $("split").getAttribute("aria-valuetext");
  out.moving = $("play").getAttribute("aria-label");
  const pixels = () => $("pane-canvas").toDataURL().length + $("pane-canvas").toDataURL().slice(200, 3000);
  set("seek", "3", "input");
  const one = pixels();
  set("exposure", $("exposure").options[0].value, "change");
  set("seek", $("seek").max, "input");
  out.moved = one !== pixels();
  out.clock = $("clock").textContent;
  const ground = () => getComputedStyle(document.body).backgroundColor;
  const before = ground();
  $("theme").click();
  out.themed = before !== ground() && $("theme").textContent;
  $("play").click();
  out.playing = $("play").getAttribute("aria-label");
  out.wide = document.documentElement.scrollWidth - window.innerWidth;
  out.plain = [...document.querySelectorAll("canvas, svg")].filter((e) => !e.getAttribute("aria-label")).length;
  $("hands").textContent = JSON.stringify(out);
});
</script></body>"""


def check_hands(page, temp):
    handled = temp / "hands.html"
    handled.write_text(page.read_text(encoding="utf-8").replace("</body>", HANDS), encoding="utf-8")
    _, console, _, dom = browse(handled, temp, "--force-prefers-reduced-motion", "--window-size=500,900",
                                until='<p id="hands" hidden="">{')
    found = re.search(r'<p id="hands" hidden="">(.+?)</p>', dom, re.S)
    hands = json.loads(html.unescape(found[1])) if found else {}
    check("controls: no errors", bool(hands) and not console, (hands, console))
    check("controls: slider", hands.get("split") == "20%" and "20 % raw" in hands.get("spoken", ""))
    check("controls: nothing moves by itself for who wants it calm", hands.get("moving") == "Play")
    check("controls: scrubber, exposure", hands.get("moved") is True and hands.get("clock") == f"{SECONDS:.2f} s")
    check("controls: theme, play", hands.get("themed") == "Light theme" and hands.get("playing") == "Pause")
    check("nothing is wider than a small window", hands.get("wide", 1) <= 0, hands.get("wide"))
    check("every picture has a text", hands.get("plain") == 0, hands.get("plain"))


def check_evaluation(program, out, temp):
    """evstab eval adds a section; a second run replaces it."""
    truth = temp / "truth.txt"
    with open(truth, "w", encoding="ascii") as f:
        for i in range(int(SECONDS * 200) + 1):
            half = yaw(i / 200) / 2
            f.write(f"{1 + i / 200:.6f} 0 0 0 0 {math.sin(half):.9f} 0 {math.cos(half):.9f}\n")
    page = out / "report.html"
    before = len(page.read_bytes())
    sizes = []
    for _ in range(2):
        done = evstab(program, "eval", out, "--truth", truth, "--align", "world")
        check("eval", done.returncode == 0 and "a section of report.html" in done.stdout, done.stdout + done.stderr)
        sizes.append(len(page.read_bytes()))
    check("the section replaces itself", sizes[0] == sizes[1] > before, sizes)
    text = page.read_text(encoding="utf-8")
    shown = json.loads(re.search(r'<script type="application/json" id="evaluation-data">(.*?)</script>', text, re.S)[1])
    found = json.loads((out / "eval.json").read_text())
    check("the section holds what eval.json holds", shown["attitude"] == found["attitude"], shown["attitude"])
    check("attitude against the truth", found["attitude"]["total"]["rmse_deg"] < 1.0, found["attitude"]["total"])
    page.write_text("<!DOCTYPE html><p>another page", encoding="utf-8")
    done = evstab(program, "eval", out, "--truth", truth)
    check("a page that is none of ours is left alone",
          done.returncode == 1 and "report.html" in done.stderr and "another" in page.read_text(), done.stderr)
    page.write_text(text, encoding="utf-8")


def check_direction(page, temp):
    """The demo flies somewhere, and knows the truth."""
    text = page.read_text(encoding="utf-8")
    data = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)[1])
    curves = next(plot["curves"] for plot in data["plots"] if plot["id"] == "direction")
    check("direction: a spread per point, and the truth", all(2 * len(c["spread"]) == len(c["points"]) > 0 and
                                                              len(c["truth"]) > 0 for c in curves), [len(c["points"]) for c in curves])
    at = [sum(c["points"][2 * i + 1] ** 2 for c in curves) for i in range(len(curves[0]["spread"]))]
    check("direction: unit vectors", all(abs(length - 1) < 1e-3 for length in at), at)
    flow = data["flow"]
    arrows = [flow["arrows"][i:i + 5] for i in range(0, len(flow["arrows"]), 5)]
    fits = [a for a in arrows if a[4] == 1]
    check("flow: arrows", len(fits) >= 20, f"{len(fits)} of {len(arrows)} fit")
    fx, fy, cx, cy = flow["k"]
    off = []
    for x, y, dx, dy, _ in fits:  # By the model: u = rho (x Vz - Vx), rho > 0.
        x0, y0, u, v = (x - dx - cx) / fx, (y - dy - cy) / fy, dx / fx, dy / fy
        a, b = x0 * flow["v"][2] - flow["v"][0], y0 * flow["v"][2] - flow["v"][1]
        off.append(math.degrees(abs(math.atan2(a * v - b * u, a * u + b * v))))
    check("flow: the arrows point from the focus", sorted(off)[len(off) // 2] < 15, f"median {sorted(off)[len(off) // 2]:.1f} deg off")
    status, console, _, dom = browse(page, temp)
    check("flow: drawn", status is not None and not status["errors"] and not console and
          status["flow"] == {"arrows": len(arrows), "inliers": len(fits)}, (status, console))
    check("flow: told in words", "The camera flies " in dom and "arrows" in dom)


def check_odd_recordings(program, folder, temp):
    """Little to show must not break the page."""
    single = temp / "single.txt"
    single.write_text("5.0 10 20 1\n")
    strong_lens = temp / "strong_lens.txt"  # The event's undistorted position is off the sensor.
    strong_lens.write_text("200 200 119.5 89.5 -0.4 0.1 0 0 0\n")
    cases = {"no orientation": [folder, "--attitude", "none"],
             "one event": [single, "--calib", folder / "calib.txt", "--attitude", "none"],
             "none on the sensor": [single, "--calib", strong_lens, "--attitude", "none"],
             "events before the IMU": [folder, "--imu-offset-us", "1000000"]}
    for case, words in cases.items():
        out = temp / case
        done = evstab(program, "replay", *words, "-o", out)
        check(f"{case}: replay", done.returncode == 0, done.stderr)
        status, console, _, dom = browse(out / "report.html", temp)
        check(f"{case}: page", status is not None and status["ready"] and not status["errors"] and not console,
              (status, console))
        check(f"{case}: no NaN, no undefined", not re.search(r">[^<]*(NaN|undefined|Infinity)[^<]*<",
                                                             dom[:dom.find('<script type="application/json"')]))


def check_video(program, folder, temp):
    empty = temp / "empty"
    empty.mkdir()
    out = temp / "no_ffmpeg"
    done = evstab(program, "replay", folder, "-o", out, "--video", temp / "v.mp4",
                  env={**os.environ, "PATH": str(empty)})
    check("without ffmpeg: exit status and one line", done.returncode == 1 and done.stderr.count("\n") == 1 and
          "ffmpeg" in done.stderr, done.stderr)
    check("without ffmpeg: told before any work", not out.exists())
    done = evstab(program, "replay", folder, "-o", out, "--video", temp / "v.avi")
    check("a video of another kind is refused", done.returncode == 2 and ".mp4" in done.stderr, done.stderr)
    if shutil.which("ffmpeg") is None:
        print("no ffmpeg here: no video made")
        return
    for name in ("-odd name;$(x).mp4", "small.gif"):
        done = evstab(program, "replay", folder, "-o", out, "--no-report", "--video", name, cwd=temp)
        check(f"video {name}", done.returncode == 0 and (temp / name).stat().st_size > 5000, done.stderr)
    done = evstab(program, "replay", folder, "-o", out, "--no-report", "--video", empty / "no" / "such.mp4")
    check("a video that cannot be written fails", done.returncode == 1 and "ffmpeg failed" in done.stderr, done.stderr)


def check_demo(program, temp):
    out = temp / "demo"
    done = evstab(program, "demo", "-o", out, "--duration", "0.3", "--quiet")
    check("demo", done.returncode == 0 and (out / "report.html").exists() and (out / "flight" / "events.txt").exists(),
          done.stderr)
    lines = done.stdout.splitlines()
    check("demo: four numbers and where to look", len(lines) == 6 and lines[5] == f"look at {out}/report.html" and
          [line.split()[0] for line in lines[1:5]] == ["sharpness", "rotation", "direction", "speed"], done.stdout)
    angle = re.search(r"within ([0-9.]+) deg of the truth", done.stdout)
    check("demo: the direction of flight is right", angle is not None and float(angle[1]) < 10, done.stdout)
    gain = re.search(r"x([0-9.]+):", done.stdout)
    check("demo: stabilization shows", gain is not None and float(gain[1]) > 1.3, done.stdout)


def main():
    if len(sys.argv) != 2:
        print(__doc__)
        sys.exit(2)
    program = str(pathlib.Path(sys.argv[1]).resolve())
    with tempfile.TemporaryDirectory(prefix="evstab_report_", ignore_cleanup_errors=True) as name:
        temp = pathlib.Path(name)
        folder, out = temp / NAME, temp / "out"
        make_recording(folder)
        done = evstab(program, "replay", folder, "-o", out, "--window", "time:20000")
        print(done.stderr, end="")
        if done.returncode != 0:
            print(f"FAIL evstab replay exits {done.returncode}")
            sys.exit(1)
        page = out / "report.html"
        text = page.read_text(encoding="utf-8")
        summary = json.loads((out / "summary.json").read_text())
        data = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)[1])
        check("size", 50_000 < len(text) < 3_000_000, f"{len(text)} bytes")
        addresses = set(re.findall(r"https?://[^\"' ]+", text))
        check("no address but that of SVG", addresses == {"http://www.w3.org/2000/svg"}, addresses)
        check("settings and counts are those of summary.json", data["summary"] == summary)
        check("saccades", data["saccades"]["n"] == summary["saccades"] > 0, data["saccades"])
        before, after = data["numbers"]["spans_sharpness"]
        check("sharpness gain", after > 1.5 * before, f"{before} -> {after}")
        mean = math.degrees(sum(abs(yaw_rate(i / 1000)) for i in range(int(SECONDS * 1000))) / (SECONDS * 1000))
        check("rotation removed", abs(data["numbers"]["rate_deg_s"][0] - mean) < 0.03 * mean,
              f"{data['numbers']['rate_deg_s'][0]} deg/s, made {mean:.1f}")
        check("a camera that only turns flies nowhere", summary["velocity"]["pairs"] > 5 and "flow" not in data and
              summary["velocity"]["valid"] == data["numbers"]["directions"] == 0, summary["velocity"])
        turn = data["plots"][0]["curves"][1]["points"][-1]
        check("attitude", abs(turn - math.degrees(yaw(SECONDS))) < 2.0, f"yaw {turn} deg at the end")
        done = evstab(program, "replay", folder, "-o", temp / "bare", "--no-report")
        check("--no-report", done.returncode == 0 and not (temp / "bare" / "report.html").exists())
        check_evaluation(program, out, temp)
        check_video(program, folder, temp)
        check_demo(program, temp)
        if shutil.which("chromium") is None:
            print("SKIPPED: chromium is not installed; the page was not opened")
            sys.exit(1 if FAULTS else 77)
        check_page(page, temp, "light", ["--blink-settings=preferredColorScheme=1"], summary)
        check_page(page, temp, "dark", ["--blink-settings=preferredColorScheme=0"], summary)
        check_hands(page, temp)
        check_odd_recordings(program, folder, temp)
        check_direction(temp / "demo" / "report.html", temp)
    print(f"{len(FAULTS)} faults")
    sys.exit(1 if FAULTS else 0)


if __name__ == "__main__":
    main()
