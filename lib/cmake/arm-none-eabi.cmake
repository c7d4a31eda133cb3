# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# What all Arm toolchain files share. The including file sets evs_cpu_flags and, if QEMU has a machine for it, EVS_BOARD.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY) # No start-up code yet when CMake tries the compiler.
include(${CMAKE_CURRENT_LIST_DIR}/bare_metal.cmake)
