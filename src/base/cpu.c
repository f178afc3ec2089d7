#include "base/cpu.h"

#include <math.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>

enum { MAX_THREADS = 1024 };

static atomic_uint cpu_mask = ~0u;

void cts_cpu_set_mask(unsigned mask)
{
    atomic_store(&cpu_mask, mask);
}

unsigned cts_cpu_flags(void)
{
    unsigned flags = 0;
#if defined(__x86_64__)
#define HAS(feature) __builtin_cpu_supports(feature)
#define FIND(name, needs) flags |= needs ? CTS_CPU_##name : 0;
    CTS_CPU_PATHS(FIND)
#endif
    return flags & (CTS_BUILT_FOR)&atomic_load(&cpu_mask);
}

int cts_cpu_cores(void)
{
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set) == 0 && CPU_COUNT(&set) > 0)
        return CPU_COUNT(&set);
    return 1;
}

int cts_threads_why(int n, const char **why)
{
    *why = "as asked for";
    if (n <= 0) {
        *why = "cores this process may run on";
        n = cts_cpu_cores();
        const double quota = ceil(cts_cpu_quota("/proc/self/cgroup", "/sys/fs/cgroup"));
        if (quota < n) {
            *why = "processor quota of the control group";
            n = (int)quota;
        }
        /* As programs with OpenMP read it: the first number of a list. */
        const char *const text = getenv("OMP_NUM_THREADS");
        const long limit = text ? strtol(text, NULL, 10) : 0;
        if (limit > 0 && limit < n) {
            *why = "OMP_NUM_THREADS";
            n = (int)limit;
        }
    }
    return n > MAX_THREADS ? MAX_THREADS : n;
}

int cts_threads(int n)
{
    const char *why;
    return cts_threads_why(n, &why);
}
