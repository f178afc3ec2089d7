/* The bench and its parts. */
#ifndef CTS_BENCH_BENCH_H
#define CTS_BENCH_BENCH_H

#include "ctsplat/preset.h"
#include "ctsplat/reference.h"
#include "ctsplat/render.h"
#include "ctsplat/volume.h"
#include "output/report/bench_rows.h"

/* `ctsplat bench`: error against run time, for each engine and setting on one volume. */

typedef struct CtsBenchSettings {
    const CtsVolume *volume;
    const CtsPreset *preset;
    CtsRenderSettings render; /* size, view, threads, stop; engine, kernel and what is varied are set here */
    /* Before each setting, done of all; NULL: silent. */
    void (*progress)(double done, int all, const char *what);
} CtsBenchSettings;

/* Every setting is measured in a process of its own: at least 3 renders, more while they are quick. rows is filled
 * as far as things went also when the call fails; after CTS_ERR_INTERRUPTED that is what was measured so far. Free with
 * cts_bench_free(). */
CtsStatus cts_bench_run(const CtsBenchSettings *settings, CtsBenchRows *rows, CtsError *err);
void cts_bench_free(CtsBenchRows *rows);

/* bench.jsonl, error-vs-time.svg and report.html into an existing folder. */
CtsStatus cts_bench_write(const CtsBenchRows *rows, const char *folder, bool force, CtsError *err);
/* Before any work: the folder's three files could be written, and gnuplot is there. */
CtsStatus cts_bench_check_writable(const char *folder, bool force, CtsError *err);

/* Parts of the bench. */

/* The settings to measure; *rows is malloc'd. */
CtsStatus cts_bench_plan(CtsBenchRow **rows, int *n, CtsError *err);

/* Measures row in a child process, against the integral of its kernel and the trilinear one. A setting that cannot be
 * rendered is left out with its reason, which is no failure. */
CtsStatus cts_bench_measure(const CtsBenchSettings *settings, CtsReference *const own[CTS_N_KERNELS], CtsBenchRow *row,
                            CtsError *err);

#endif
