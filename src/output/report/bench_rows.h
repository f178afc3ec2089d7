/* Results of `ctsplat bench`, and their output formats. */
#pragma once

#include "ctsplat/render.h"
#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include "output/report/text_table.h"
#include <stdbool.h>
#include <stdint.h>

/* One setting of one engine. */
typedef struct CtsBenchRow {
    CtsEngineId engine;
    CtsKernelId kernel;
    int samples;      /* 0: chosen by the engine */
    double max_error; /* requested, in 1/255 rms; 0: none */
    double tolerance_hu;
    bool void_key;
    bool measured; /* false: why has the reason, and the other fields are not valid */
    char why[1024];
    int runs;
    double wall_ms, wall_ms_spread; /* median; largest less smallest */
    double serial_ms;               /* of it, median: when one thread at most could work */
    uint64_t peak_rss_bytes;        /* of a process of its own, the volume included */
    CtsVerified own, trilinear;     /* against the converged integral of the same kernel, and of the trilinear field */
    CtsErrorBound bound;            /* the reported limit of the picture's error against the trilinear integral */
    CtsVoxelCounts voxels;
    bool pareto; /* no other row is both faster and nearer to the trilinear integral */
} CtsBenchRow;

typedef struct CtsBenchRows {
    CtsBenchRow *rows;
    int n;
    bool complete;   /* false: interrupted */
    char scene[256]; /* description of the volume and view, for the page; no patient data */
    int width, height, n_threads;
} CtsBenchRows;

/* Marks the rows that no other row beats in both time and rmse_trilinear. */
void cts_bench_mark_pareto(CtsBenchRows *rows);

/* "4", "auto", or "to 0.25/255" where an error was requested. */
void cts_bench_samples_text(const CtsBenchRow *row, char text[24]);

/* The results, one row each, to be freed with cts_table_free(), and an explanation of the columns in a few lines; ""
 * without results. */
CtsTable *cts_bench_table(const CtsBenchRows *rows);
void cts_bench_legend(const CtsBenchRows *rows, char text[2048]);
/* One object a line, to be freed with free(). */
CtsStatus cts_bench_lines(const CtsBenchRows *rows, char **text, CtsError *err);
/* gnuplot script: log-log, one line per engine except the reference, the Pareto front marked. */
CtsStatus cts_bench_plot_script(const CtsBenchRows *rows, char **script, CtsError *err);
/* HTML that needs no network: the plot (SVG text) and the table. */
CtsStatus cts_bench_page(const CtsBenchRows *rows, const char *svg, char **html, CtsError *err);

/* Runs gnuplot on a script that sets an SVG terminal and no output; *svg is its output, to be freed with free().
 * CTS_ERR_OUTPUT when gnuplot is missing or fails, with the beginning of its message. */
CtsStatus cts_gnuplot(const char *script, char **svg, CtsError *err);
