#!/bin/sh
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# run_qemu.sh BOARD IMAGE [ARG...]: run a bare-metal image in QEMU; its output and exit status become ours.
# CTest calls it as CMAKE_CROSSCOMPILING_EMULATOR. QEMU_EXTRA: further options for QEMU, split at blanks.
# EVS_QEMU_TIMEOUT: seconds after which an image that hangs is stopped with status 124 (default 300).
set -eu
if [ $# -lt 2 ]; then
    echo "usage: run_qemu.sh BOARD IMAGE [ARG...]" >&2
    exit 2
fi
board=$1
image=$2
shift 2

case $board in
riscv32-virt) qemu=qemu-system-riscv32 machine="virt -bios none -m 64M" ;;
*) qemu=qemu-system-arm machine=$board ;;
esac

# The image reads its command line by semihosting. QEMU splits this option at commas: a comma is written twice.
config=enable=on,target=native
for arg in "$image" "$@"; do
    config=$config,arg=$(printf '%s' "$arg" | sed 's/,/,,/g')
done

# No -icount: nothing here reads a clock, so every run is the same run anyway, and it costs a fifth of the speed.
# shellcheck disable=SC2086 # machine and QEMU_EXTRA are lists of words
exec timeout "${EVS_QEMU_TIMEOUT:-300}" "$qemu" -M $machine -display none -serial null -parallel none -monitor none \
    -semihosting-config "$config" ${QEMU_EXTRA:-} -kernel "$image" </dev/null
