# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# RV32IMAC: no floating point at all, which is how small RISC-V parts come.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR riscv32)
set(CMAKE_C_COMPILER riscv64-unknown-elf-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY) # No start-up code yet when CMake tries the compiler.
set(evs_cpu_flags "-march=rv32imac -mabi=ilp32 -mcmodel=medany")
set(EVS_BOARD riscv32-virt)
include(${CMAKE_CURRENT_LIST_DIR}/bare_metal.cmake)
