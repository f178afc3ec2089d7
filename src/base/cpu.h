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

/* The flags that this processor has and the mask lets through: whoever has more than one SIMD path chooses by them. */
unsigned cts_cpu_flags(void);
/* For tests: flags outside the mask count as missing from now on, in the whole process. ~0u lets all through. */
void cts_cpu_set_mask(unsigned mask);
/* Cores in this process's affinity mask, at least 1. */
int cts_cpu_cores(void);
/* n when n > 0, else the cores this process may use; at most 1024. */
int cts_threads(int n);

#ifdef __cplusplus
}
#endif
#endif
