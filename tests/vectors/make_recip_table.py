#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""Make lib/src/evs_recip_table.h: 1 / w on [1/2, 3/2) as straight lines over 256 cells.

    make_recip_table.py           print the header
    make_recip_table.py --check F compare it with the file F; exit 1 if they differ

On a cell of width h = 1/256 around its middle m, with f = (w - m) / h in [-1/2, 1/2), the line is v + s f. The slope is
that of the chord, the offset halves the error between chord and curve. Worst relative error: 2^-17, at w = 1/2.
Everything is exact rational arithmetic but for one square root, which is rounded far below the table's last bit.
"""
import sys
from fractions import Fraction as F
from math import isqrt

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
    v = middle_of_chord - deepest / 2
    return round(v * 2**Q), round(s * 2**Q)


def header():
    lines = ["/* SPDX-License-Identifier: MIT",
             " * SPDX-FileCopyrightText: 2026 the evstab authors */",
             "/* Made by tests/vectors/make_recip_table.py, which says how; do not edit. */",
             "#ifndef EVS_RECIP_TABLE_H",
             "#define EVS_RECIP_TABLE_H",
             "",
             "#include <stdint.h>",
             "",
             "#define EVS_RECIP_CELLS 256",
             "",
             "/* clang-format off */",
             "/* Value in the middle of each cell and slope across it, Q29. */",
             "static const int32_t EVS_RECIP_Q29[EVS_RECIP_CELLS][2] = {"]
    cells = ["{%d, %d}" % cell(i) for i in range(CELLS)]
    for i in range(0, CELLS, 4):
        lines.append("    " + ", ".join(cells[i:i + 4]) + ",")
    lines += ["};", "", "#endif", ""]
    return "\n".join(lines)


def main():
    if len(sys.argv) == 1:
        sys.stdout.write(header())
    elif len(sys.argv) == 3 and sys.argv[1] == "--check":
        with open(sys.argv[2], encoding="utf-8") as f:
            if f.read() != header():
                sys.exit(sys.argv[2] + " is not what make_recip_table.py makes")
        print("same as generated")
    else:
        sys.exit(__doc__)


main()
