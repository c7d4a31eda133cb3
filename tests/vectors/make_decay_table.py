#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Make lib/src/evs_decay_table.c: 2^-x over one octave in 256 steps, each at its middle.

    make_decay_table.py           print the file
    make_decay_table.py --check F compare it with the file F; exit 1 if they differ

Decimal arithmetic, so that no platform's exp() decides a rounding.
"""
from decimal import Decimal as D, getcontext

from generated import main

getcontext().prec = 40


def source():
    values = [int((D(65536) * D(2) ** (-(D(i) + D("0.5")) / 256)).to_integral_value()) for i in range(256)]
    lines = ["/* SPDX-License-Identifier: MIT",
             " * SPDX-FileCopyrightText: 2026 the evstab authors */",
             "/* Made by tests/vectors/make_decay_table.py, which says how; do not edit. */",
             '#include "evs_tables.h"',
             "",
             "/* clang-format off */",
             "const uint16_t evs_decay_q16[256] = {"]
    lines += ["    " + ", ".join(str(v) for v in values[i:i + 16]) + "," for i in range(0, 256, 16)]
    lines += ["};", ""]
    return "\n".join(lines)


main(source, __doc__)
