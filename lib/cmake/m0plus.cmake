# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# Cortex-M0+: no divider, no 32x32=64 multiplier.
set(evs_cpu_flags "-mcpu=cortex-m0plus -mthumb -mfloat-abi=soft")
include(${CMAKE_CURRENT_LIST_DIR}/arm-none-eabi.cmake)
