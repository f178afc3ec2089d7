/* Shared functions of the benchmarks: a series in memory, and medians. */
#ifndef BENCH_H
#define BENCH_H

#include "ctsplat/ctsplat.h"

enum { BENCH_MAX_ROUNDS = 99 };

/* Sorts values. */
double bench_median(double *values, int n);

/* A benchmark's main(): NAME FOLDER [ROUNDS], 5 rounds by default. Loads the CT series in a folder, with its
 * macro-cells, and returns what measure() returns. */
int bench_main(int argc, char **argv, const char *name, int (*measure)(const CtsModel *model, int rounds));

#endif
