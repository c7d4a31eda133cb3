# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# Included by the toolchain files. Tests link picolibc: it needs no board support of its own, and its soft double gives
# the models in the tests their precision. The library itself needs neither.
set(CMAKE_C_FLAGS_INIT "${evs_cpu_flags} --specs=picolibc.specs -ffunction-sections -fdata-sections")
# -O2 and not CMake's -O3: the tables in docs/ are made from these builds, and nobody ships -O3 on a microcontroller.
set(CMAKE_C_FLAGS_RELEASE "-O2 -DNDEBUG" CACHE STRING "Flags of a release build")
if(EVS_BOARD)
  cmake_path(SET evs_run_qemu NORMALIZE ${CMAKE_CURRENT_LIST_DIR}/../../tests/target/run_qemu.sh)
  set(CMAKE_CROSSCOMPILING_EMULATOR "sh;${evs_run_qemu};${EVS_BOARD}")
endif()
