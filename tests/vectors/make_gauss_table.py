#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Make lib/src/evs_gauss_table.c: a Gaussian of sigma 1 px at seven pixels, for each sixteenth of a pixel.

    make_gauss_table.py           print the file
    make_gauss_table.py --check F compare it with the file F; exit 1 if they differ

Row i is for a point (i - 8) / 16 px right of the pixel in the middle. Q15. An eighth column of zeros fills a vector.
Decimal arithmetic, so that no platform's exp() decides a rounding.
"""
import sys
from decimal import Decimal as D, getcontext

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


def main():
    if len(sys.argv) == 1:
        sys.stdout.write(source())
    elif len(sys.argv) == 3 and sys.argv[1] == "--check":
        with open(sys.argv[2], encoding="utf-8") as f:
            if f.read() != source():
                sys.exit(sys.argv[2] + " is not what make_gauss_table.py makes")
        print("same as generated")
    else:
        sys.exit(__doc__)


main()
