#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Make lib/src/evs_gauss_table.c: a Gaussian of sigma 1 px at seven pixels, for each sixteenth of a pixel.

    make_gauss_table.py           print the file
    make_gauss_table.py --check F compare it with the file F; exit 1 if they differ

Row i is for a point (i - 8) / 16 px right of the pixel in the middle. Q15. An eighth column of zeros fills a vector.
Decimal arithmetic, so that no platform's exp() decides a rounding.
"""
from decimal import Decimal as D, getcontext

from generated import main

getcontext().prec = 40
PI = D("3.1415926535897932384626433832795028841972")


def weight(i, k):
    d = D(k - 3) - D(i - 8) / 16
    return int(((-d * d / 2).exp() / (2 * PI).sqrt() * 32768).to_integral_value())


def source():
    lines = ["/* SPDX-License-Identifier: MIT",
             " * SPDX-FileCopyrightText: 2026 the evstab authors */",
             "/* Made by tests/vectors/make_gauss_table.py, which says how; do not edit. */",
             '#include "evs_tables.h"',
             "",
             "/* clang-format off */",
             "const uint16_t evs_gauss_q15[16][8] = {"]
    lines += ["    {" + ", ".join([str(weight(i, k)) for k in range(7)] + ["0"]) + "}," for i in range(16)]
    lines += ["};", ""]
    return "\n".join(lines)


main(source, __doc__)
