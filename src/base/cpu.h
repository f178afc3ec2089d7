/* What the processor can do, and how many of it this process may use. */
#ifndef CTS_BASE_CPU_H
#define CTS_BASE_CPU_H

#ifdef __cplusplus
extern "C" {
#endif

enum {
    CTS_CPU_AVX2 = 1,
    CTS_CPU_AVX512 = 2 /* F, BW, DQ and VL */
};

/* In front of a function of plain integer loops: compiled twice, the version that the processor can run is taken when
 * the program starts. Integers alone, so that both give the same bytes. */
#if defined(__x86_64__)
#define CTS_VECTOR_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define CTS_VECTOR_CLONES
#endif

/* Flags found at run time; kernels take `cts_cpu_flags() & settings->cpu_mask`. */
unsigned cts_cpu_flags(void);
/* Cores in this process's affinity mask, at least 1. */
int cts_cpu_cores(void);
/* n when n > 0, else the cores this process may use; at most 1024. */
int cts_threads(int n);

#ifdef __cplusplus
}
#endif
#endif
