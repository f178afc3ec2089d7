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
/* Processors' worth of time that control groups leave to this process, not always a whole number; INFINITY without a
 * quota. The paths are /proc/self/cgroup and /proc/self/mountinfo. */
double cts_cpu_quota(const char *groups_path, const char *mounts_path);
/* n when n > 0, else as many as this process may use: the cores of its affinity mask, no more than its quota rounded up
 * and no more than OMP_NUM_THREADS; at most 1024. *why is a static text on what decided. */
int cts_threads_why(int n, const char **why);
int cts_threads(int n);

#ifdef __cplusplus
}
#endif
#endif
