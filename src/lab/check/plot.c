#include "lab/check/plot.h"

#include "output/report/gnuplot.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LEAST 1e-6 /* smaller ratios stand at the left edge */

/* The share of the bound that is used, within the plot. A bound of 0 is met or not. */
static double ratio(const CtsCheckResult *r)
{
    const double x = r->bound > 0 ? r->error / r->bound : r->error > 0 ? 1e3 : LEAST;
    return isnan(x) ? 1e3 : fmin(fmax(x, LEAST), 1e3);
}

/* The row of each result: cases in order of their first appearance. */
static size_t find_rows(const CtsCheckResult *results, size_t n, size_t *row, size_t *first)
{
    size_t n_rows = 0;
    for (size_t i = 0; i < n; i++) {
        size_t at = 0;
        while (at < n_rows && strcmp(results[first[at]].name, results[i].name) != 0)
            at++;
        if (at == n_rows)
            first[n_rows++] = i;
        row[i] = at;
    }
    return n_rows;
}

static void write_head(FILE *f, const CtsCheckResult *results, const size_t *first, size_t n_rows)
{
    fprintf(f,
            "set terminal svg noenhanced size 1000,%zu font 'sans,11' background 'white'\n"
            "set logscale x\nset xrange [%g:1.5e3]\nset yrange [%zu:-1]\nset format x '%%g'\n"
            "set xlabel 'error / bound (a case fails right of 1)'\nset grid x\nset key outside top horizontal\n"
            "set lmargin 46\nset arrow from 1,graph 0 to 1,graph 1 nohead lc rgb '#b02020' lw 2\nset ytics (",
            120 + 15 * n_rows, LEAST * 0.7, n_rows);
    for (size_t r = 0; r < n_rows; r++) {
        fputs(r ? ", '" : "'", f);
        /* gnuplot takes a tic's name for a format. */
        for (const char *c = results[first[r]].name; *c; c++)
            fputs(*c == '%' ? "%%" : (const char[2]){*c, 0}, f);
        fprintf(f, "' %zu", r);
    }
    fputs(")\n", f);
}

static void write_data(FILE *f, const CtsCheckResult *results, size_t n, const size_t *row)
{
    for (int e = 0; e < CTS_N_ENGINES; e++)
        fprintf(f, "%s '-' using 1:2 with points pt %d ps 0.6 lc rgb '%s' title '%s'", e ? "," : "plot", 4 + e,
                cts_engine_colours[e], cts_engine_names[e]);
    fputc('\n', f);
    for (int e = 0; e < CTS_N_ENGINES; e++) {
        bool any = false;
        for (size_t i = 0; i < n; i++) {
            if (strcmp(results[i].engine, cts_engine_names[e]) != 0)
                continue;
            fprintf(f, "%.6g %g\n", ratio(&results[i]), (double)row[i] + 0.1 * (e - 2.5));
            any = true;
        }
        fputs(any ? "e\n" : "1e-99 0\ne\n", f);
    }
}

CtsStatus cts_check_plot(const CtsCheckResult *results, size_t n, const char *path, bool force, CtsError *err)
{
    CtsStatus st;
    char *script = NULL;
    size_t size = 0;
    size_t *row = malloc((n + 1) * sizeof *row), *first = malloc((n + 1) * sizeof *first);
    FILE *f = open_memstream(&script, &size);
    if (!row || !first || !f) {
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        if (f)
            fclose(f);
        goto end;
    }
    const size_t n_rows = find_rows(results, n, row, first);
    write_head(f, results, first, n_rows);
    write_data(f, results, n, row);
    fclose(f);
    st = script ? cts_gnuplot_file(script, path, force, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
end:
    free(script);
    free(row);
    free(first);
    return st;
}
