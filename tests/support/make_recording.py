#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Make a recording in the compact form that tests/target/replay.c reads (tests/target/recording.h), in time order.

usage: make_recording.py OUT --events FILE --calib FILE [--imu FILE | --rocking] [--size WxH] [--lead-in SECONDS]
       make_recording.py OUT --synthetic

--events, --imu and --calib are in the text form of the Event-Camera Dataset; .gz is accepted. IMU samples are taken from
LEAD-IN seconds before the first event (default 1) to the end of the events. --rocking stands in for a missing IMU: a camera
that rocks by up to 22 degrees at 5 to 9 Hz. --synthetic needs no data: that IMU and random events, the same in every run.
"""
import argparse
import gzip
import math
import struct
import sys
from decimal import Decimal

GYRO_Q, ACCEL_Q = 24, 20  # Fractional bits of rad/s and m/s^2, as evs/attitude.h takes them.
EVENTS, IMU = 1, 2        # Kinds of chunks.
EVENTS_MAX = 1024         # Events in a chunk: what the reader's buffer holds.
CALIB_SYNTHETIC = "199.0 198.5 132.2 110.7 -0.368 0.151 -0.0003 -0.00076 0.0"


def lines(path):
    opener = gzip.open if path.endswith(".gz") else open
    with opener(path, "rt", encoding="ascii") as f:
        for line in f:
            if line.strip() and not line.startswith("#"):
                yield line.split()


def microseconds(text):
    """Seconds as written to whole microseconds, rounded half up, without a detour through floating point."""
    whole, _, fraction = text.partition(".")
    return int(whole) * 1000000 + (int(fraction.ljust(9, "0")[:9]) + 500) // 1000


def fixed(text, bits):
    return round(Decimal(text) * 2**bits)


def read_events(path):
    for t, x, y, p in lines(path):
        yield microseconds(t), int(x), int(y), int(p)


def read_imu(path):
    for t, *values in lines(path):
        accel, gyro = values[:3], values[3:]
        yield microseconds(t), [fixed(v, GYRO_Q) for v in gyro], [fixed(v, ACCEL_Q) for v in accel]


def rocking_imu(t_first, t_last):
    for t in range(t_first, t_last + 1000, 1000):
        swings = ((12.0, 5), (9.0, 7), (3.0, 9))  # rad/s, Hz
        gyro = [round(2**GYRO_Q * rate * math.cos(2e-6 * math.pi * hz * (t - t_first))) for rate, hz in swings]
        yield t, gyro, (0, round(-9.81 * 2**ACCEL_Q), 0)


def synthetic(seconds=0.4):
    """Noise in front of a rocking camera."""
    state = 0x2545F4914F6CDD1D
    events = []
    t = 100000  # After the first IMU samples.
    while t < (100 + seconds * 1000) * 1000:
        state ^= (state << 13) & (2**64 - 1)
        state ^= state >> 7
        state ^= (state << 17) & (2**64 - 1)
        t += state % 40
        # A few events off the sensor: they must be counted in the same way everywhere.
        events.append((t, (state >> 8) % 243, (state >> 20) % 181, (state >> 40) & 1))
    return events, rocking_imu(0, events[-1][0] + 20000)


def chunks(events, imu):
    """Interleave in time: an IMU sample goes before the events that are not older than it."""
    pending = []
    events = iter(events)
    event = next(events, None)
    for t, gyro, accel in imu:
        while event is not None and event[0] < t:
            pending.append(event)
            event = next(events, None)
        yield from event_chunks(pending)
        pending = []
        yield struct.pack("<IIiiiiii", IMU << 24 | 1, t & 0xFFFFFFFF, *gyro, *accel)
    while event is not None:
        pending.append(event)
        event = next(events, None)
    yield from event_chunks(pending)


def event_chunks(pending):
    for i in range(0, len(pending), EVENTS_MAX):
        part = pending[i:i + EVENTS_MAX]
        body = [struct.pack("<IHH", t & 0xFFFFFFFF, x, y | p << 15) for t, x, y, p in part]
        yield struct.pack("<I", EVENTS << 24 | len(part)) + b"".join(body)


def main():
    parser = argparse.ArgumentParser(description="Make a recording for tests/target/replay.c.")
    parser.add_argument("out")
    parser.add_argument("--events")
    parser.add_argument("--calib")
    parser.add_argument("--imu")
    parser.add_argument("--rocking", action="store_true")
    parser.add_argument("--synthetic", action="store_true")
    parser.add_argument("--size", default="240x180")
    parser.add_argument("--lead-in", type=float, default=1.0)
    args = parser.parse_args()

    if args.synthetic:
        events, imu = synthetic()
        calib = CALIB_SYNTHETIC.split()
    elif args.events and args.calib and (args.imu or args.rocking):
        events = list(read_events(args.events))
        first = events[0][0] - round(args.lead_in * 1e6)
        last = events[-1][0] + 20000  # So that the last event's orientation gets known.
        imu = rocking_imu(max(first, 0), last) if args.rocking else (s for s in read_imu(args.imu) if first <= s[0] <= last)
        calib = next(lines(args.calib))
    else:
        parser.error("either --synthetic, or --events and --calib with --imu or --rocking")

    width, height = (int(n) for n in args.size.split("x"))
    pinhole = [fixed(c, 16) for c in calib[:4]]
    distortion = [fixed(c, 32) for c in calib[4:9]]
    with open(args.out, "wb") as f:
        f.write(struct.pack("<4sHH4i5q", b"EVR1", width, height, *pinhole, *distortion))
        for chunk in chunks(events, imu):
            f.write(chunk)
    return 0


if __name__ == "__main__":
    sys.exit(main())
