/* Counter-based pseudo-random numbers (MurmurHash3 finaliser). */
#pragma once

#include <stdint.h>

/* 64 bits, the upper ones even and unlike those of the next number (the finaliser of MurmurHash3). */
static inline uint64_t cts_random_bits(uint64_t number)
{
    number = (number ^ number >> 33) * 0xff51afd7ed558ccdu;
    return (number ^ number >> 33) * 0xc4ceb9fe1a85ec53u;
}
