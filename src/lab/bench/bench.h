/* The bench, and its internal functions. */
#pragma once

#include "ctsplat/model.h"
#include "ctsplat/preset.h"
#include "ctsplat/reference.h"
#include "ctsplat/render.h"
#include "output/report/bench_rows.h"

/* `ctsplat bench`: error against run time, for each engine and setting on one volume. */

typedef struct CtsBenchSettings {
    const CtsModel *model;
    const CtsPreset *preset;
    /* size, view, threads, stop; engine, kernel and the varied settings are set by the bench */
    CtsRenderSettings render;
    /* Every kernel, tuning parameter and requested error, and the ray caster; false: a choice that shows each engine.
     */
    bool full;
    /* Before each setting, done of all; NULL: silent. */
    void (*progress)(double done, int all, const char *what);
    /* Once, after the first of n settings: the estimated time left. NULL: none. */
    void (*duration)(int n, double seconds_left);
} CtsBenchSettings;

/* Measures every setting in a process of its own: at least 3 renders, more while they are quick. rows is filled as far
 * as measured also when the call fails; after CTS_ERR_INTERRUPTED with the results so far. Free with
 * cts_bench_free(). */
CtsStatus cts_bench_run(const CtsBenchSettings *settings, CtsBenchRows *rows, CtsError *err);
void cts_bench_free(CtsBenchRows *rows);

/* bench.jsonl, error-vs-time.svg and report.html into an existing folder. */
CtsStatus cts_bench_write(const CtsBenchRows *rows, const char *folder, bool force, CtsError *err);
/* Before any work: the folder's three files could be written, and gnuplot is there. */
CtsStatus cts_bench_check_writable(const char *folder, bool force, CtsError *err);

/* Internal functions of the bench. */

/* The settings to measure; *rows is malloc'd. */
CtsStatus cts_bench_plan(bool full, CtsBenchRow **rows, int *n, CtsError *err);

/* Measures row in a child process, against the integral of its kernel and the trilinear one. A setting that cannot be
 * rendered is recorded with the reason, which is no failure. */
CtsStatus cts_bench_measure(const CtsBenchSettings *settings, CtsReference *const own[CTS_N_KERNELS], CtsBenchRow *row,
                            CtsError *err);

/* `ctsplat bench --paper`: the paper's engines, configured as in the paper (cones from a table, 8 bits, unlit, one
 * picture of each in turn), and their times in per cent of plain splatting beside the published ones. Times are wall,
 * or with one thread CPU time, which others disturb less. Free with cts_table_free(). */
enum { CTS_PAPER_ROUNDS = 15, CTS_PAPER_BITS = 8 };
CtsStatus cts_paper_table(const CtsBenchSettings *settings, CtsTable **table, CtsError *err);
