#!/bin/sh
# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# From a fresh clone on Debian 12 or Ubuntu 24.04 to a result, in one command:
#
#   sh host_tools/quickstart.sh test    install what is missing, build everything, run every test
#   sh host_tools/quickstart.sh demo    install what is missing, build evstab, simulate and stabilize a flight, write a report
#
# What is there already is left alone: a second run installs nothing. Everything built lies in build/.
set -eu
cd "$(dirname "$0")/.."
root=$PWD
venv=$root/build/venv
missing=

usage() {
    echo "usage: sh host_tools/quickstart.sh test|demo" >&2
    exit 2
}

say() { printf '\n== %s\n' "$*"; }

# need COMMAND PACKAGE: the package is wanted if there is no such command, wherever that may have come from.
need() { command -v "$1" >/dev/null 2>&1 || missing="$missing $2"; }

# need_package PACKAGE: for what is no command.
need_package() {
    if [ "$(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null)" != installed ]; then missing="$missing $1"; fi
}

# What building and running evstab needs.
need_for_evstab() {
    need gcc gcc
    need cmake cmake
    need ninja ninja-build
    need pkg-config pkg-config
    need_package libc6-dev
    need_package zlib1g-dev   # evstab reads .gz
    need_package libyaml-dev  # evstab reads the settings of the paper's code
    need_package libcjson-dev # and writes summary.json
    for p in libpng-dev libjpeg-dev; do need_package "$p"; done # evstab sim reads textures and writes frames; the report
}

# What the tests need beyond that.
need_for_tests() {
    need g++ g++ # The headers must compile as C++ too.
    need clang clang
    need python3 python3
    python3 -c 'import ensurepip, venv' 2>/dev/null || missing="$missing python3-venv"
    # A browser for the test of the report. Where it comes as a snap (Ubuntu) that test is skipped.
    if grep -q '^ID=debian' /etc/os-release 2>/dev/null; then need chromium chromium; fi
    # The emulated targets. picolibc is for the tests on them: the library needs no C library.
    need arm-none-eabi-gcc gcc-arm-none-eabi
    need riscv64-unknown-elf-gcc gcc-riscv64-unknown-elf
    need_package picolibc-arm-none-eabi
    need_package picolibc-riscv64-unknown-elf
    need qemu-system-arm qemu-system-arm
    need qemu-system-riscv32 qemu-system-misc
}

install_missing() {
    command -v apt-get >/dev/null 2>&1 || {
        echo "quickstart: needs apt (Debian 12, Ubuntu 24.04); elsewhere see docs/porting.md" >&2
        exit 1
    }
    if [ -z "$missing" ]; then return; fi
    say "installing:$missing"
    as_root=
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null 2>&1 || {
            echo "quickstart: not root and no sudo; install by hand:$missing" >&2
            exit 1
        }
        as_root=sudo
    fi
    # Another apt may be at work (unattended upgrades): wait for its lock.
    $as_root apt-get -q -o DPkg::Lock::Timeout=500 update
    # shellcheck disable=SC2086 # a list of words
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get -q -y -o DPkg::Lock::Timeout=500 -o Dpkg::Use-Pty=0 \
        install --no-install-recommends $missing
}

# The Python packages that tests compare against, in a place of their own.
make_venv() {
    wanted=$(cat tests/requirements.txt tests/requirements-batch.txt | cksum)
    if [ -x "$venv/bin/python" ] && [ "$(cat "$venv/installed" 2>/dev/null)" = "$wanted" ]; then return; fi
    say "Python packages into build/venv"
    rm -rf "$venv"
    python3 -m venv "$venv"
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check \
        -r tests/requirements.txt -r tests/requirements-batch.txt
    echo "$wanted" >"$venv/installed"
}

# build_and_test NAME SKIP CMAKE-ARGUMENT...: one build folder, all tests but those with a label that matches SKIP.
build_and_test() {
    name=$1
    skip=$2
    shift 2
    say "$name"
    cmake "$@" -DPython3_EXECUTABLE="$venv/bin/python" >"build/$name.log" 2>&1 || {
        cat "build/$name.log" >&2
        exit 1
    }
    cmake --build "build/$name" -- --quiet
    ctest --test-dir "build/$name" --output-on-failure --no-tests=error -LE "$skip" -j "$(nproc)"
}

run_demo() {
    need_for_evstab
    install_missing
    say "build"
    mkdir -p build
    cmake -S . -B build/demo -G Ninja -DCMAKE_BUILD_TYPE=Release -DEVS_BUILD_TESTS=OFF >build/demo.log 2>&1 || {
        cat build/demo.log >&2
        exit 1
    }
    cmake --build build/demo -- --quiet
    say "demo"
    build/demo/host_tools/evstab demo -o "$root/build/evstab_demo"
}

run_tests() {
    mkdir -p build
    need_for_evstab
    need_for_tests
    install_missing
    make_venv
    # What does not depend on how the library was compiled runs once, in the last build.
    build_and_test ci 'oracle|docs' --preset ci
    build_and_test clang 'oracle|docs' -S . -B build/clang -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_C_COMPILER=clang -DEVS_WERROR=ON
    build_and_test nosimd 'oracle|docs' -S . -B build/nosimd -G Ninja -DCMAKE_BUILD_TYPE=Release -DEVS_NO_SIMD=ON -DEVS_WERROR=ON
    # Last, because its closing line tells about most: the optimized build, all cross builds, the emulated targets.
    build_and_test release none --preset release -DEVS_WERROR=ON -DEVS_TARGET_TESTS=ON
}

[ $# -eq 1 ] || usage
case $1 in
test) run_tests ;;
demo) run_demo ;;
*) usage ;;
esac
