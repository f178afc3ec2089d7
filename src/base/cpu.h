/* Features of the processor, and the number of cores this process may use. */
#pragma once

#include "ctsplat/api.h"

CTS_C_BEGIN

/* SIMD paths, each with the processor features that it needs. */
#define CTS_CPU_PATHS(path)                                                                                            \
    path(AVX2, HAS("avx2") && HAS("fma")) path(AVX512, HAS("avx2") && HAS("fma") && HAS("avx512f") &&                  \
                                                           HAS("avx512bw") && HAS("avx512dq") && HAS("avx512vl"))

#define CTS_CPU_PLACE(name, needs) CTS_CPU_PLACE_##name,
enum CtsCpuPlace { CTS_CPU_PATHS(CTS_CPU_PLACE) };
#define CTS_CPU_FLAG(name, needs) CTS_CPU_##name = 1 << CTS_CPU_PLACE_##name,
enum CtsCpuFlag { CTS_CPU_PATHS(CTS_CPU_FLAG) };

/* In front of a function that plain C loops are compiled into a second time, for processors that have the flag. */
#if defined(__x86_64__) && defined(__clang__)
#define CTS_TARGET_AVX2 __attribute__((target("avx2")))
#define CTS_TARGET_AVX512 __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl")))
#elif defined(__x86_64__)
#define CTS_TARGET_AVX2 __attribute__((target("avx2")))
#define CTS_TARGET_AVX512 __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl,prefer-vector-width=512")))
#else
#define CTS_TARGET_AVX2
#define CTS_TARGET_AVX512
#endif
/* Defines name_plain, name_avx2 and name_avx512: the statement, which calls an inlined function, for each SIMD path. */
#define CTS_CPU_VARIANTS(type, name, parameters, statement)                                                            \
    static type name##_plain parameters                                                                                \
    {                                                                                                                  \
        statement;                                                                                                     \
    }                                                                                                                  \
    CTS_TARGET_AVX2 static type name##_avx2 parameters                                                                 \
    {                                                                                                                  \
        statement;                                                                                                     \
    }                                                                                                                  \
    CTS_TARGET_AVX512 static type name##_avx512 parameters                                                             \
    {                                                                                                                  \
        statement;                                                                                                     \
    }
/* Of these, the one for these flags. */
#define CTS_CPU_CHOICE(flags, name)                                                                                    \
    ((flags)&CTS_CPU_AVX512 ? name##_avx512 : (flags)&CTS_CPU_AVX2 ? name##_avx2 : name##_plain)

/* The same one's name in reports. */
static inline const char *cts_cpu_path_name(unsigned flags)
{
    return flags & CTS_CPU_AVX512 ? "AVX-512" : flags & CTS_CPU_AVX2 ? "AVX2" : "plain C";
}

/* The SIMD paths that this processor supports, this build contains (option simd) and the mask allows; code with several
 * SIMD paths selects by them. */
unsigned cts_cpu_flags(void);
/* For tests: flags outside the mask count as missing from now on, in the whole process. ~0u lets all through. */
void cts_cpu_set_mask(unsigned mask);
/* Cores in this process's affinity mask, at least 1. */
int cts_cpu_cores(void);
/* Processors' worth of time that control groups leave to this process, not always a whole number; INFINITY without a
 * quota. The paths are /proc/self/cgroup and the hierarchy, /sys/fs/cgroup. */
double cts_cpu_quota(const char *groups_path, const char *mount);
/* n when n > 0, else the number of cores this process may use: of its affinity mask, at most its quota rounded up and
 * at most OMP_NUM_THREADS; at most 1024. *why: a static text on the deciding limit. */
int cts_threads_why(int n, const char **why);
int cts_threads(int n);

CTS_C_END
