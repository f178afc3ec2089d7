/* Pseudo-random numbers that repeat: by a counter, or one after the other. */
#pragma once

#include <stdint.h>

/* 64 bits, the upper ones even and unlike those of the next number (the finaliser of MurmurHash3). */
static inline uint64_t cts_random_bits(uint64_t number)
{
    number = (number ^ number >> 33) * 0xff51afd7ed558ccdu;
    return (number ^ number >> 33) * 0xc4ceb9fe1a85ec53u;
}

/* 64 bits (SplitMix64: Steele, Lea, Flood 2014). Pictures' bytes depend on both functions. */
static inline uint64_t cts_random_next(uint64_t *state)
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}
