#define _GNU_SOURCE
#include "base/cpu.h"

#include <sched.h>
#include <stdatomic.h>
#include <stdbool.h>

static atomic_uint cpu_mask = ~0u;

void cts_cpu_set_mask(unsigned mask)
{
    atomic_store(&cpu_mask, mask);
}

unsigned cts_cpu_flags(void)
{
    unsigned flags = 0;
#if defined(__x86_64__)
    const bool fma = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    if (fma)
        flags |= CTS_CPU_AVX2;
    if (fma && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        flags |= CTS_CPU_AVX512;
#endif
    return flags & atomic_load(&cpu_mask);
}

int cts_cpu_cores(void)
{
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set) == 0 && CPU_COUNT(&set) > 0)
        return CPU_COUNT(&set);
    return 1;
}

int cts_threads(int n)
{
    if (n <= 0)
        n = cts_cpu_cores();
    return n > 1024 ? 1024 : n;
}
