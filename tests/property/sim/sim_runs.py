#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Whole runs of `evstab sim`, judged by the files they write. Standard library only; small sensors, short flights.

    sim_runs.py EVSTAB
"""
import filecmp
import gzip
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

EVSTAB = ""
SMALL = ["--size", "64x48", "--duration", "0.2"]
PERFECT_IMU = ["--gyro-bias", "0", "--gyro-noise", "0", "--gyro-walk", "0",
               "--accel-bias", "0", "--accel-noise", "0", "--accel-walk", "0"]  # fmt: skip


def rows(path):
    with open(path, encoding="ascii") as file:
        return [[float(word) for word in line.split()] for line in file]


def rotate(q, v):
    """R(q) v with q = w x y z."""
    w, x, y, z = q
    a = [v[i] * (w * w - x * x - y * y - z * z) for i in range(3)]
    dot = x * v[0] + y * v[1] + z * v[2]
    cross = (y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0])
    return [a[i] + 2 * dot * (x, y, z)[i] + 2 * w * cross[i] for i in range(3)]


def multiply(p, q):
    return (p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
            p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
            p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
            p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0])  # fmt: skip


def conjugate(q):
    return (q[0], -q[1], -q[2], -q[3])


def wxyz(pose):
    return (pose[7], pose[4], pose[5], pose[6])


class Runs(unittest.TestCase):
    def setUp(self):
        self.temp = tempfile.TemporaryDirectory()
        self.addCleanup(self.temp.cleanup)
        self.n = 0

    def run_sim(self, *args, status=0):
        """The folder of a run that must end with this exit status; stderr if that is not 0."""
        self.n += 1
        out = pathlib.Path(self.temp.name) / f"run{self.n}"
        done = subprocess.run([EVSTAB, "sim", *args, *([] if "-o" in args else ["-o", str(out)])],
                              capture_output=True, text=True, check=False)  # fmt: skip
        self.assertEqual(status, done.returncode, (args, done.stderr))
        if status == 0:
            self.assertEqual("", done.stderr)
            return out
        self.assertEqual(1, done.stderr.count("\n"), done.stderr)
        self.assertEqual("", done.stdout)
        return done.stderr

    def events(self, folder):
        with open(folder / "events.txt", encoding="ascii") as file:
            found = []
            for line in file:
                t, x, y, p = line.split()
                self.assertRegex(t, r"^\d+\.\d{6}000$")
                found.append((int(t[:-10]) * 1000000 + int(t[-9:-3]), int(x), int(y), int(p)))
            return found

    def assert_same(self, a, b, leave_out=()):
        names = sorted(p.relative_to(a) for p in a.rglob("*") if p.is_file() and p.name not in leave_out)
        others = sorted(p.relative_to(b) for p in b.rglob("*") if p.is_file() and p.name not in leave_out)
        self.assertEqual(names, others)
        for name in names:
            self.assertTrue(filecmp.cmp(a / name, b / name, shallow=False), name)

    # What a run writes.

    def test_a_run_writes_the_folder_that_the_format_asks_for(self):
        out = self.run_sim("room", *SMALL, "--hot", "2,300")
        events = self.events(out)
        self.assertGreater(len(events), 1000)
        self.assertEqual(events, sorted(events, key=lambda e: e[0]))
        self.assertTrue(all(0 <= t <= 200000 and x < 64 and y < 48 and p < 2 for t, x, y, p in events))
        self.assertEqual({0, 1}, {p for _, _, _, p in events})
        self.assertEqual(201, len(rows(out / "imu.txt")))
        self.assertEqual(41, len(rows(out / "groundtruth.txt")))
        self.assertEqual([9], [len(row) for row in rows(out / "calib.txt")])
        images = (out / "images.txt").read_text().split()
        self.assertEqual(5, len(images) // 2)
        self.assertAlmostEqual(0.005, float(images[0]))  # The middle of the first exposure.
        self.assertAlmostEqual(1 / 24, float(images[2]) - float(images[0]), places=8)
        for name in images[1::2]:
            self.assertEqual(b"\x89PNG", (out / name).read_bytes()[:4])
        meta = json.loads((out / "meta.json").read_text())
        self.assertEqual(len(events), meta["result"]["n_events"])
        self.assertEqual(sum(e[3] for e in events), meta["result"]["n_on"])
        done = subprocess.run([EVSTAB, "info", str(out)], capture_output=True, text=True, check=False)
        self.assertEqual((0, ""), (done.returncode, done.stderr))
        self.assertNotIn("not there", done.stdout)
        self.assertIn(f"{len(events)} events", done.stdout)

    def test_events_gz_holds_the_same_and_replaces_an_older_one(self):
        plain = self.run_sim("poster", *SMALL)
        before = (plain / "events.txt").read_bytes()
        self.run_sim("poster", *SMALL, "--gz", "-o", str(plain))
        self.assertEqual(before, gzip.decompress((plain / "events.txt.gz").read_bytes()))
        self.assertFalse((plain / "events.txt").exists())

    def test_a_shorter_flight_leaves_no_frame_of_a_longer_one(self):
        out = self.run_sim("shapes", *SMALL)
        longer = len(list((out / "images").iterdir()))
        self.run_sim("shapes", "--size", "64x48", "--duration", "0.1", "-o", str(out))
        self.assertLess(len(list((out / "images").iterdir())), longer)
        self.assertEqual(len((out / "images.txt").read_text().splitlines()), len(list((out / "images").iterdir())))

    # Determinism.

    def test_same_settings_same_bytes_with_any_number_of_threads(self):
        args = ["room", *SMALL, "--motion", "sweep", "--noise-hz", "5", "--hot", "3,100"]
        one = self.run_sim(*args, "--jobs", "1")
        self.assert_same(one, self.run_sim(*args, "--jobs", "2"))
        self.assert_same(one, self.run_sim(*args, "--jobs", "7"))

    def test_another_seed_gives_another_recording(self):
        one = self.run_sim("room", *SMALL, "--seed", "1")
        two = self.run_sim("room", *SMALL, "--seed", "2")
        for name in ("events.txt", "imu.txt", "groundtruth.txt", "images/frame_00000000.png"):
            self.assertFalse(filecmp.cmp(one / name, two / name, shallow=False), name)

    def test_leaving_out_frames_changes_no_event(self):
        with_frames = self.run_sim("shapes", *SMALL)
        without = self.run_sim("shapes", *SMALL, "--no-frames")
        self.assertFalse((without / "images.txt").exists())
        self.assertTrue(filecmp.cmp(with_frames / "events.txt", without / "events.txt", shallow=False))

    # Events.

    def test_a_static_camera_makes_noise_events_only(self):
        out = self.run_sim("room", *SMALL, "--motion", "static", "--noise-hz", "0")
        self.assertEqual([], self.events(out))
        out = self.run_sim("room", *SMALL, "--motion", "static", "--noise-hz", "10", "--refractory-us", "0")
        expected = 10 * 64 * 48 * 0.2
        self.assertLess(abs(len(self.events(out)) - expected), 5 * math.sqrt(expected))

    def test_hot_pixels_fire_alone(self):
        out = self.run_sim("room", *SMALL, "--motion", "static", "--noise-hz", "0", "--hot", "4,500")
        events = self.events(out)
        self.assertEqual(4, len({e[1:3] for e in events}))
        self.assertLess(abs(len(events) - 400), 100)

    def test_more_events_at_lower_contrast(self):
        counts = []
        for contrast in ("0.8", "0.5", "0.35", "0.2", "0.1"):
            out = self.run_sim("room", *SMALL, "--noise-hz", "0", "--contrast", contrast, "--no-frames")
            counts.append(len(self.events(out)))
        self.assertEqual(counts, sorted(set(counts)))

    def test_the_refractory_period_is_kept(self):
        out = self.run_sim("room", *SMALL, "--motion", "sweep", "--refractory-us", "3000", "--hot", "50,1000")
        last = {}
        for t, x, y, _ in self.events(out):
            self.assertGreaterEqual(t - last.get((x, y), -3000), 3000)
            last[x, y] = t

    def test_turning_events_back_by_the_true_attitude_sharpens_them(self):
        """Pure rotation, no distortion: where a wrong sign anywhere would show."""
        out = self.run_sim("panorama", "--size", "96x72", "--duration", "0.4", "--fx", "80", "--k1", "0", "--k2", "0",
                           "--noise-hz", "0", "--seed", "3", "--no-frames", "--contrast-sigma", "0")  # fmt: skip
        poses = rows(out / "groundtruth.txt")
        calib = rows(out / "calib.txt")[0]
        events = [e for e in self.events(out) if 200000 <= e[0] < 280000]
        self.assertGreater(len(events), 3000)

        def sharpness(sign):
            image = {}
            for t, x, y, p in events:
                k = min(int(t / 5000), len(poses) - 2)
                part = t / 5000 - k
                q = [(1 - part) * a + part * b for a, b in zip(wxyz(poses[k]), wxyz(poses[k + 1]))]
                n = math.sqrt(sum(a * a for a in q))
                turn = multiply(conjugate(wxyz(poses[40])), tuple(a / n for a in q))
                ray = ((x - calib[2]) / calib[0], (y - calib[3]) / calib[1], 1.0)
                if sign < 0:
                    turn = conjugate(turn)
                r = rotate(turn if sign != 0 else (1, 0, 0, 0), ray)
                at = (round(calib[0] * r[0] / r[2]), round(calib[1] * r[1] / r[2]))
                image[at] = image.get(at, 0) + 2 * p - 1
            return sum(value * value for value in image.values()) / len(events)

        still = sharpness(0)
        self.assertGreater(sharpness(1), 1.5 * still)
        self.assertLess(sharpness(-1), 1.1 * still)

    # Truth and IMU.

    def test_poses_differentiate_to_velocity(self):
        out = self.run_sim("poster", "--size", "16x12", "--duration", "3", "--no-frames")
        poses = rows(out / "groundtruth.txt")
        velocity = rows(out / "velocity.txt")
        fastest = max(math.hypot(*row[1:4]) for row in velocity)
        for k in range(2, len(poses) - 2):
            slope = [(8 * (poses[k + 1][i] - poses[k - 1][i]) - (poses[k + 2][i] - poses[k - 2][i])) / 0.06
                     for i in (1, 2, 3)]  # fmt: skip
            camera = rotate(conjugate(wxyz(poses[k])), slope)
            for i in range(3):
                self.assertLess(abs(camera[i] - velocity[k][1 + i]), 1e-6 * fastest + 3e-7)  # 9 decimals are written.

    def test_gyro_integrates_to_attitude(self):
        out = self.run_sim("room", "--size", "16x12", "--duration", "2", "--no-frames", *PERFECT_IMU)
        poses = rows(out / "groundtruth.txt")
        imu = rows(out / "imu.txt")
        q = wxyz(poses[0])
        for a, b in zip(imu, imu[1:]):
            half = [0.5 * (b[0] - a[0]) * 0.5 * (a[i] + b[i]) for i in (4, 5, 6)]
            angle = math.sqrt(sum(h * h for h in half)) + 1e-300
            q = multiply(q, (math.cos(angle), *[math.sin(angle) * h / angle for h in half]))
        off = multiply(conjugate(q), wxyz(poses[-1]))
        self.assertLess(2 * math.sqrt(sum(v * v for v in off[1:])), 2e-4)

    def test_a_resting_accelerometer_reads_one_g_upwards(self):
        out = self.run_sim("room", *SMALL, "--motion", "static", *PERFECT_IMU)
        for row in rows(out / "imu.txt"):
            self.assertEqual([0.0, -9.81, 0.0, 0.0, 0.0, 0.0], row[1:])

    def test_imu_range_bias_and_offset(self):
        base = self.run_sim("room", *SMALL, "--motion", "sweep", "--no-frames", *PERFECT_IMU)
        args = ["room", *SMALL, "--motion", "sweep", "--no-frames", *PERFECT_IMU]
        truth = rows(base / "imu.txt")
        clipped = rows(self.run_sim(*args, "--imu-range", "60,0.9") / "imu.txt")
        limit = math.radians(60)
        self.assertTrue(any(abs(row[i]) > limit for row in truth for i in (4, 5, 6)))
        for a, b in zip(truth, clipped):
            for i in range(1, 7):
                end = limit if i > 3 else 0.9 * 9.81
                self.assertAlmostEqual(max(-end, min(end, a[i])), b[i], places=8)
        late = rows(self.run_sim(*args, "--imu-offset-us", "10000") / "imu.txt")
        for a, b in zip(truth[10:], late):  # t_event = t_imu + 10 ms
            for i in range(1, 7):
                self.assertAlmostEqual(a[i], b[i], places=7)
        args[args.index("--gyro-bias") + 1] = "0.1,-0.2,0.3"
        for a, b in zip(truth, rows(self.run_sim(*args) / "imu.txt")):
            for i, bias in zip((4, 5, 6), (0.1, -0.2, 0.3)):
                self.assertAlmostEqual(a[i] + bias, b[i], places=8)

    # Input.

    def test_calibration_comes_from_a_file_or_one_by_one(self):
        calib = pathlib.Path(self.temp.name) / "calib.txt"
        calib.write_text("60 61 30 25 -0.3 0.1 0.001 -0.002 0\n")
        out = self.run_sim("poster", *SMALL, "--calib", str(calib), "--k1", "-0.25", "--cx", "31.5")
        self.assertEqual([60, 61, 31.5, 25, -0.25, 0.1, 0.001, -0.002, 0], rows(out / "calib.txt")[0])

    def test_pictures_become_textures(self):
        folder = pathlib.Path(os.environ.get("EVS_DATA_DIR", "")) / "textures"
        files = [str(folder / name) for name in ("camera.png", "brick3.jpg", "shapes_poster.png", "astronaut.png")]
        if not all(os.path.exists(name) for name in files):
            self.skipTest("no textures in EVS_DATA_DIR")
        for scene in ("room", "poster", "shapes", "panorama"):
            out = self.run_sim(scene, *SMALL, "--texture", ",".join(files))
            self.assertGreater(len(self.events(out)), 100)
            self.assertEqual(4, len(json.loads((out / "meta.json").read_text())["textures"]))

    def test_every_scene_and_motion_flies(self):
        for scene in ("room", "poster", "shapes", "panorama"):
            for motion in ("handheld", "hover", "sweep", "flap", "rotate"):
                out = self.run_sim(scene, "--motion", motion, "--size", "32x24", "--duration", "0.1", "--noise-hz", "0")
                self.assertGreater(len(self.events(out)), 10, (scene, motion))

    def test_bad_usage_ends_with_2_and_one_line(self):
        for args in (["cave"], ["room", "--motion", "crawl"], ["room", "--duration", "0"], ["room", "--duration", "x"],
                     ["room", "--duration", "nan"], ["room", "--size", "5000x10"], ["room", "--contrast", "0"],
                     ["room", "--contrast", "0.1,0.2,0.3"], ["room", "--hot", "3"], ["room", "--hot", "1.5,3"],
                     ["room", "--size", "4x4", "--hot", "17,3"],
                     ["room", "--imu-range", "1"], ["room", "--gyro-bias", "1,2"], ["room", "--gyro-bias", "1e9"],
                     ["room", "--fps", "200"] + ["--exposure", "0.01"], ["room", "--jobs", "0"], ["room", "--fx", "0"],
                     ["room", "--noise-hz", "-1"], ["room", "--seed", "-1"], ["room", "--nonsense"], ["room", "poster"],
                     []):  # fmt: skip
            with self.subTest(args=args):
                self.run_sim(*args, status=2)
        done = subprocess.run([EVSTAB, "sim", "room"], capture_output=True, text=True, check=False)
        self.assertEqual(2, done.returncode)
        self.assertIn("-o", done.stderr)

    def test_what_cannot_be_read_or_written_ends_with_1_and_names_the_file(self):
        temp = pathlib.Path(self.temp.name)
        (temp / "file").write_text("x")
        (temp / "cut.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"\0" * 20)
        (temp / "cut.jpg").write_bytes(b"\xff\xd8\xff\xe0" + b"\0" * 20)
        self.assertIn("file", self.run_sim("room", *SMALL, "-o", str(temp / "file" / "out"), status=1))
        self.assertIn("file", self.run_sim("room", *SMALL, "-o", str(temp / "file"), status=1))
        for name in ("missing.png", "cut.png", "cut.jpg", "file"):
            self.assertIn(name, self.run_sim("room", *SMALL, "--texture", str(temp / name), status=1))
        self.assertIn("missing.txt", self.run_sim("room", *SMALL, "--calib", str(temp / "missing.txt"), status=1))
        self.assertIn("no inverse", self.run_sim("room", *SMALL, "--k1", "-2", status=1))
        if os.path.exists("/dev/full"):
            for name in ("events.txt", "imu.txt", "groundtruth.txt", "velocity.txt", "calib.txt", "meta.json"):
                (temp / "full").mkdir(exist_ok=True)
                for old in (temp / "full").glob("*.*"):
                    old.unlink()
                (temp / "full" / name).symlink_to("/dev/full")
                self.assertIn(name, self.run_sim("room", *SMALL, "--no-frames", "-o", str(temp / "full"), status=1))

    def test_quiet_says_nothing_and_help_names_every_scene(self):
        out = pathlib.Path(self.temp.name) / "quiet"
        args = [EVSTAB, "sim", "room", *SMALL, "-o", str(out)]
        self.assertEqual("", subprocess.run([*args, "--quiet"], capture_output=True, text=True, check=True).stdout)
        self.assertIn("real-time factor", subprocess.run(args, capture_output=True, text=True, check=True).stdout)
        text = subprocess.run([EVSTAB, "sim", "--help"], capture_output=True, text=True, check=True).stdout
        for word in ("room", "poster", "shapes", "panorama", "hover", "sweep", "flap"):
            self.assertIn(word, text)


if __name__ == "__main__":
    EVSTAB = sys.argv.pop(1)
    unittest.main()
