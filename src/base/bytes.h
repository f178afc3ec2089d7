/* Numbers in the bytes of a file, and a hash of bytes. */
#pragma once

#include <stddef.h>
#include <stdint.h>

/* Of four bytes, the lowest first. */
static inline uint32_t cts_little32(const uint8_t *p)
{
    return p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

/* FNV-1a: the hash of no bytes, and that of those hashed before and these. */
#define CTS_FNV UINT64_C(14695981039346656037)
static inline uint64_t cts_fnv(uint64_t hash, const void *bytes, size_t n)
{
    for (size_t i = 0; i < n; i++)
        hash = (hash ^ ((const uint8_t *)bytes)[i]) * UINT64_C(1099511628211);
    return hash;
}
