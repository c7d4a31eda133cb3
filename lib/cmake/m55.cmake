# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# Cortex-M55: DSP and vector (MVE, Helium) instructions.
set(evs_cpu_flags "-mcpu=cortex-m55 -mthumb -mfloat-abi=hard")
set(EVS_BOARD mps3-an547)
include(${CMAKE_CURRENT_LIST_DIR}/arm-none-eabi.cmake)
