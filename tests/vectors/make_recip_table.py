#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Make lib/src/evs_recip_table.c: 1 / w on [1/2, 3/2) as straight lines over 256 cells.

    make_recip_table.py           print the file
    make_recip_table.py --check F compare it with the file F; exit 1 if they differ

On a cell [lo, hi) the line is v + s f / 2^16, f the distance of w from an edge in units of half the width of a cell pair:
the kernel takes f as the low 16 bits of w (Q23), read as a signed number. Two cells share these 16 bits. In the even one
they count up from its left edge, in the odd one they are negative and count down from its right edge; each entry holds
the value at the edge that its f starts from. The slope is that of the chord, the offset halves the error between chord
and curve. Worst relative error: 2^-17, at w = 1/2. Exact rational arithmetic but for one square root, which is rounded
far below the table's last bit.
"""
from fractions import Fraction as F
from math import isqrt

from generated import main

CELLS, Q = 256, 29


def sqrt_fraction(x):
    scale = 1 << 200
    return F(isqrt(x.numerator * scale * scale // x.denominator), scale)


def cell(i):
    lo = F(1, 2) + F(i, CELLS)
    hi = lo + F(1, CELLS)
    s = 1 / hi - 1 / lo
    middle_of_chord = (1 / lo + 1 / hi) / 2
    # 1/w lies furthest below the chord where its slope equals the chord's: w^2 = lo hi.
    touch = sqrt_fraction(lo * hi)
    f = (touch - (lo + hi) / 2) * CELLS
    deepest = middle_of_chord + s * f - 1 / touch
    middle = middle_of_chord - deepest / 2
    edge = middle - s / 2 if i % 2 == 0 else middle + s / 2
    return round(edge * 2**Q), round(2 * s * 2**Q)


def source():
    lines = ["/* SPDX-License-Identifier: MIT",
             " * SPDX-FileCopyrightText: 2026 the evstab authors */",
             "/* Made by tests/vectors/make_recip_table.py, which says how; do not edit. */",
             '#include "evs_homography_kernel.h"',
             "",
             "/* clang-format off */",
             "/* Value at the edge that the fraction starts from, and slope across two cells, Q29. */",
             "const int32_t evs_recip_q29[EVS_RECIP_CELLS][2] = {"]
    cells = ["{%d, %d}" % cell(i) for i in range(CELLS)]
    for i in range(0, CELLS, 4):
        lines.append("    " + ", ".join(cells[i:i + 4]) + ",")
    lines += ["};", ""]
    return "\n".join(lines)


main(source, __doc__)
