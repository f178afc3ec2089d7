/* Numbers in the bytes of a file. */
#pragma once

#include <stdint.h>

/* Of four bytes, the lowest first. */
static inline uint32_t cts_little32(const uint8_t *p)
{
    return p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}
