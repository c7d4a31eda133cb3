/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  crc32.h
 * @brief CRC-32 (IEEE 802.3, as zlib has it) over numbers, the same on every host: low byte first whatever the machine.
 */
#ifndef EVS_TESTS_CRC32_H
#define EVS_TESTS_CRC32_H

#include <stddef.h>
#include <stdint.h>

/** Start with @p crc 0; go on with the last answer. */
uint32_t crc32_bytes(uint32_t crc, const void *bytes, size_t n_bytes);
uint32_t crc32_u16(uint32_t crc, uint16_t value);
uint32_t crc32_u32(uint32_t crc, uint32_t value);

#endif
