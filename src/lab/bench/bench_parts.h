/* Parts of the bench. */
#ifndef CTS_BENCH_PARTS_H
#define CTS_BENCH_PARTS_H

#include "lab/bench/bench.h"
#include "ctsplat/reference.h"

/* The settings to measure; *rows is malloc'd. */
CtsStatus cts_bench_plan(CtsBenchRow **rows, int *n, CtsError *err);

/* What pictures are judged by. */
typedef struct CtsBenchTruth {
    CtsReference *own[CTS_N_KERNELS]; /* NULL until a setting needs it; own[CTS_KERNEL_TENT] is the trilinear one */
    int frame[4];                     /* what thumbnails show of a picture: from x, y on, so wide and high */
    int thumb_width, thumb_height;
    double (*thumb)[4]; /* the trilinear integral at the thumbnails' pixels, red, green, blue over the background */
} CtsBenchTruth;

CtsStatus cts_bench_truth_init(CtsBenchTruth *truth, const CtsBenchSettings *settings, CtsError *err);
CtsStatus cts_bench_truth_of(CtsBenchTruth *truth, const CtsBenchSettings *settings, CtsKernelId kernel, CtsError *err);
void cts_bench_truth_free(CtsBenchTruth *truth);

/* Thumbnails of a picture and of its difference from the truth. */
void cts_bench_thumbs(const CtsBenchTruth *truth, const CtsPreset *preset, const CtsPicture *picture, CtsBenchRow *row);

/* Measures row in a child process. A setting that cannot be rendered is left out with its reason, which is no
 * failure. */
CtsStatus cts_bench_measure(const CtsBenchSettings *settings, const CtsBenchTruth *truth, CtsBenchRow *row,
                            CtsError *err);

/* How many times too large differences are drawn. */
#define CTS_BENCH_AMPLIFIED 8

#endif
