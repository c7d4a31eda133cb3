# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
"""What the scripts that make a table of the library have in common: print it, or check the file that holds it."""
import os
import sys


def main(source, usage):
    """@p source makes the text of the C file; without arguments print it, with --check FILE compare."""
    if len(sys.argv) == 1:
        sys.stdout.write(source())
    elif len(sys.argv) == 3 and sys.argv[1] == "--check":
        with open(sys.argv[2], encoding="utf-8") as f:
            if f.read() != source():
                sys.exit("%s is not what %s makes" % (sys.argv[2], os.path.basename(sys.argv[0])))
        print("same as generated")
    else:
        sys.exit(usage)
