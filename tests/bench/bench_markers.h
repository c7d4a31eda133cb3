/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  bench_markers.h
 * @brief Marks a region whose instructions evcount.c counts: instructions without effect, on silicon as well.
 *
 * The id is a constant in [0, 31]. Regions may nest if their ids differ. Both are barriers for the compiler.
 */
#ifndef EVS_BENCH_MARKERS_H
#define EVS_BENCH_MARKERS_H

#if defined(__arm__)
#define BENCH_START(id) __asm__ volatile(".inst.w 0xF3AF8040 + %c0" : : "i"(id) : "memory")
#define BENCH_STOP(id)  __asm__ volatile(".inst.w 0xF3AF8060 + %c0" : : "i"(id) : "memory")
#elif defined(__riscv)
#define BENCH_START(id) __asm__ volatile("addi x0, x0, 0x400 + %c0" : : "i"(id) : "memory")
#define BENCH_STOP(id)  __asm__ volatile("addi x0, x0, 0x420 + %c0" : : "i"(id) : "memory")
#else
#error "bench_markers.h knows Arm and RISC-V"
#endif

#endif
