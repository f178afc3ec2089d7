/* Parts of the bench. */
#ifndef CTS_BENCH_PARTS_H
#define CTS_BENCH_PARTS_H

#include "ctsplat/reference.h"
#include "lab/bench/bench.h"

/* The settings to measure; *rows is malloc'd. */
CtsStatus cts_bench_plan(CtsBenchRow **rows, int *n, CtsError *err);

/* Measures row in a child process, against the integral of its kernel and the trilinear one. A setting that cannot be
 * rendered is left out with its reason, which is no failure. */
CtsStatus cts_bench_measure(const CtsBenchSettings *settings, CtsReference *const own[CTS_N_KERNELS], CtsBenchRow *row,
                            CtsError *err);

#endif
