/* Shared functions of the benchmarks: a series in memory, and medians. */
#ifndef BENCH_H
#define BENCH_H

#include "ctsplat/ctsplat.h"

enum { BENCH_MAX_ROUNDS = 99 };

/* Sorts values. */
double bench_median(double *values, int n);

/* The number of rounds in text, or by_default where that is NULL; 1 to BENCH_MAX_ROUNDS. */
int bench_rounds(const char *text, int by_default);

/* The CT series in a folder, macro-cells made. Free with cts_volume_free(). */
CtsStatus bench_load(const char *folder, CtsVolume **volume, CtsError *err);

#endif
