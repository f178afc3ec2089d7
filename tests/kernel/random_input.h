/* Random numbers for the input of kernels, from a seed in state. */
#pragma once

#include <stdint.h>

static uint64_t state;

static uint32_t random_u32(void)
{
    uint64_t z = state += 0x9e3779b97f4a7c15u; /* SplitMix64 (Steele, Lea, Flood 2014) */
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (uint32_t)(z >> 32);
}

static int below(int n)
{
    return (int)(random_u32() % (uint32_t)n);
}
