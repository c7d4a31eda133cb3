/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "crc32.h"

/* Remainders of the 16 values of half a byte, for the reflected polynomial 0xEDB88320. */
static const uint32_t NIBBLE[16] = {0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u,
                                    0x4DB26158u, 0x5005713Cu, 0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu,
                                    0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu};

uint32_t crc32_bytes(uint32_t crc, const void *bytes, size_t n_bytes)
{
    const unsigned char *const b = bytes;
    crc = ~crc;
    for (size_t i = 0; i < n_bytes; i++) {
        crc ^= b[i];
        crc = (crc >> 4) ^ NIBBLE[crc & 0xFu];
        crc = (crc >> 4) ^ NIBBLE[crc & 0xFu];
    }
    return ~crc;
}

uint32_t crc32_u16(uint32_t crc, uint16_t value)
{
    const unsigned char b[2] = {(unsigned char)(value & 0xFFu), (unsigned char)(value >> 8)};
    return crc32_bytes(crc, b, sizeof b);
}

uint32_t crc32_u32(uint32_t crc, uint32_t value)
{
    return crc32_u16(crc32_u16(crc, (uint16_t)(value & 0xFFFFu)), (uint16_t)(value >> 16));
}
