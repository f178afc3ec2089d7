#include "output/report/bench_rows.h"

#include "base/text.h"
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* One colour per engine id, in all plots; the last three are spares. */
static const char *const colours[] = {"#7a3db8", "#1a8f6c", "#2f7fc1", "#c25a00", "#d98c00",
                                      "#b3123f", "#333333", "#8a7a00", "#008c95", "#c2418d"};
_Static_assert(sizeof colours / sizeof *colours >= CTS_N_ENGINES, "an engine has no colour");

void cts_bench_mark_pareto(CtsBenchRows *rows)
{
    for (int i = 0; i < rows->n; i++) {
        CtsBenchRow *r = &rows->rows[i];
        r->pareto = r->measured;
        for (int k = 0; k < rows->n && r->pareto; k++) {
            const CtsBenchRow *o = &rows->rows[k];
            const bool no_worse = o->wall_ms <= r->wall_ms && o->trilinear.rmse <= r->trilinear.rmse;
            const bool better = o->wall_ms < r->wall_ms || o->trilinear.rmse < r->trilinear.rmse;
            r->pareto = !(o->measured && no_worse && better);
        }
    }
}

void cts_bench_samples_text(const CtsBenchRow *row, char text[24])
{
    if (row->max_error > 0)
        snprintf(text, 24, "to %g/255", row->max_error);
    else if (row->samples > 0)
        snprintf(text, 24, "%d", row->samples);
    else
        strcpy(text, "auto");
}

/* good: the stream was written completely. */
static CtsStatus end_text(FILE *f, bool good, char **text, CtsError *err)
{
    if (cts_text_end(f, text) && good)
        return CTS_OK;
    free(*text);
    *text = NULL;
    return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

CtsStatus cts_bench_lines(const CtsBenchRows *rows, char **text, CtsError *err)
{
    size_t size;
    FILE *f = open_memstream(text, &size);
    bool good = f != NULL;
    for (int i = 0; i < rows->n && good; i++) {
        const CtsBenchRow *r = &rows->rows[i];
        if (!r->measured)
            continue;
        json_t *object = json_pack(
            "{s:s, s:s, s:i, s:f, s:f, s:s, s:f, s:f, s:f, s:I, s:f, s:[f,f], s:f, s:[f,f], s:o, s:o}", "engine",
            cts_engine_names[r->engine], "kernel", cts_kernel_names[r->kernel], "samples", r->samples, "max_error",
            r->max_error, "tolerance", r->tolerance_hu, "void", r->void_key ? "key" : "strict", "wall_ms", r->wall_ms,
            "wall_ms_spread", r->wall_ms_spread, "serial_ms", r->serial_ms, "peak_rss_bytes",
            (json_int_t)r->peak_rss_bytes, "rmse", r->own.rmse, "rmse_interval", r->own.rmse_low, r->own.rmse_high,
            "rmse_trilinear", r->trilinear.rmse, "rmse_trilinear_interval", r->trilinear.rmse_low,
            r->trilinear.rmse_high, "psnr_db", r->own.rmse > 0 ? json_real(-20 * log10(r->own.rmse)) : json_null(),
            "bound", r->bound.known ? json_real(r->bound.rmse) : json_null());
        good = object && !json_dumpf(object, f, JSON_COMPACT | JSON_REAL_PRECISION(9)) && fputc('\n', f) == '\n';
        json_decref(object);
    }
    return end_text(f, good, text, err);
}

static void add_bench_row(CtsTable *table, const CtsBenchRow *r)
{
    char samples[24], bound[16] = "-", splatted[16] = "-";
    cts_bench_samples_text(r, samples);
    if (r->bound.known)
        snprintf(bound, sizeof bound, "%.3g", r->bound.rmse);
    if (r->voxels.known)
        snprintf(splatted, sizeof splatted, "%.1f %%", 100 * (double)r->voxels.splatted / (double)r->voxels.total);
    cts_table_row(table, "%s\t%s\t%s\t%g\t%s\t%.1f\t%.1f\t%.1f %%\t%.0f\t%.3g\t%.3g\t%s\t%.1f\t%s\t%s",
                  cts_engine_names[r->engine], cts_kernel_names[r->kernel], samples, r->tolerance_hu,
                  r->void_key ? "key" : "strict", r->wall_ms, r->wall_ms_spread, 100 * r->serial_ms / r->wall_ms,
                  (double)r->peak_rss_bytes / 1048576, r->own.rmse, r->trilinear.rmse, bound,
                  r->own.rmse > 0 ? -20 * log10(r->own.rmse) : INFINITY, splatted, r->pareto ? "front" : "");
}

CtsTable *cts_bench_table(const CtsBenchRows *rows)
{
    CtsTable *table = cts_table_new("engine\tkernel\t>samples\t>tolerance\tvoid\t>ms\t>spread\t>serial\t>MiB\t>rmse\t"
                                    ">trilinear\t>reported\t>psnr dB\t>splatted\t");
    for (int i = 0; i < rows->n; i++)
        if (rows->rows[i].measured)
            add_bench_row(table, &rows->rows[i]);
    return table;
}

static const CtsBenchRow *first_measured(const CtsBenchRows *rows)
{
    for (int i = 0; i < rows->n; i++)
        if (rows->rows[i].measured)
            return &rows->rows[i];
    return NULL;
}

void cts_bench_legend(const CtsBenchRows *rows, char text[2048])
{
    const CtsBenchRow *some = first_measured(rows);
    text[0] = 0;
    if (some)
        snprintf(
            text, 2048,
            "%s.\nPictures of %d x %d pixels, %d threads. Times are medians of several renders in a process of "
            "their own, the spread\nis the largest less the smallest, serial the share in which one thread at most "
            "could work, MiB the process's peak.\nErrors are over display values 0..1 at %llu random pixels "
            "(trilinear: %llu), against float64 integrals converged to\n1e-7: rmse against the same kernel's, reported "
            "the estimate that a render gives for the trilinear one; bench.jsonl has\n95 %% intervals. No other row "
            "beats those of the front in both time and trilinear error.%s\n",
            rows->scene, rows->width, rows->height, rows->n_threads, (unsigned long long)some->own.pixels,
            (unsigned long long)some->trilinear.pixels,
            rows->complete ? "" : " Interrupted: not all settings were measured.");
}

static int by_time(const void *a, const void *b)
{
    const CtsBenchRow *x = *(const CtsBenchRow *const *)a, *y = *(const CtsBenchRow *const *)b;
    return (x->wall_ms > y->wall_ms) - (x->wall_ms < y->wall_ms);
}

/* Measured rows by time, without the reference's own, whose error is 0; free with free(). */
static const CtsBenchRow **sorted(const CtsBenchRows *rows, int *n)
{
    const CtsBenchRow **list = malloc((size_t)(rows->n + 1) * sizeof *list);
    *n = 0;
    for (int i = 0; list && i < rows->n; i++)
        if (rows->rows[i].measured && rows->rows[i].engine != CTS_ENGINE_RAYCAST)
            list[(*n)++] = &rows->rows[i];
    if (list)
        qsort(list, (size_t)*n, sizeof *list, by_time);
    return list;
}

/* An engine's Pareto-optimal rows, all its rows, and the reported errors. List is in order of time. */
static void plot_engine(FILE *f, const CtsBenchRow *const *list, int n, int engine)
{
    double best = INFINITY;
    fprintf(f, "$all%d << END\n", engine);
    for (int i = 0; i < n; i++)
        if ((int)list[i]->engine == engine)
            fprintf(f, "%.6g %.6g %.6g\n", list[i]->wall_ms, list[i]->trilinear.rmse,
                    list[i]->bound.known ? list[i]->bound.rmse : NAN);
    fprintf(f, "END\n$best%d << END\n", engine);
    for (int i = 0; i < n; i++)
        if ((int)list[i]->engine == engine && list[i]->trilinear.rmse < best) {
            best = list[i]->trilinear.rmse;
            fprintf(f, "%.6g %.6g\n", list[i]->wall_ms, best);
        }
    fputs("END\n", f);
}

/* The Pareto front with labels alternately above and below it, on white, so that no line crosses them. */
static void plot_front(FILE *f, const CtsBenchRow *const *list, int n)
{
    bool above = true;
    fputs("$front << END\n", f);
    for (int i = 0; i < n; i++)
        if (list[i]->pareto)
            fprintf(f, "%.6g %.6g\n", list[i]->wall_ms, list[i]->trilinear.rmse);
    fputs("END\nset style textbox opaque noborder margins 0.3,0.3\n", f);
    for (int i = 0; i < n; i++) {
        if (!list[i]->pareto)
            continue;
        char samples[24];
        cts_bench_samples_text(list[i], samples);
        fprintf(f, "set label '%s %s %s%s%s' at %.6g,%.6g %s front boxed font ',9' textcolor rgb '#222222'\n",
                cts_engine_names[list[i]->engine], cts_kernel_names[list[i]->kernel], samples,
                list[i]->tolerance_hu > 0 ? ", tolerant" : "", list[i]->void_key ? ", key" : "", list[i]->wall_ms,
                list[i]->trilinear.rmse, above ? "left offset 1.3,0.9" : "right offset -1.3,-0.9");
        above = !above;
    }
}

static void write_script(FILE *f, const CtsBenchRow *const *list, int n)
{
    fprintf(f,
            "set terminal svg noenhanced size 1000,640 font 'sans,12' background 'white'\n"
            "set logscale xy\nset format x '%%g'\nset format y '%%.0e'\nset grid\n"
            "set xlabel 'median wall time (ms)'\n"
            "set ylabel 'rmse against the converged trilinear integral (display values 0..1)'\n"
            "set key outside right top\n"
            "set arrow from graph 0,first %g to graph 1,first %g nohead dt 3 lc rgb '#999999'\n"
            "set label '1/255' at graph 0.005,first %g offset 0,0.5 font ',9' textcolor rgb '#777777'\n",
            1 / 255.0, 1 / 255.0, 1 / 255.0);
    for (int e = 0; e < CTS_N_ENGINES; e++)
        plot_engine(f, list, n, e);
    plot_front(f, list, n);
    fputs("plot $front using 1:2 with linespoints pt 6 ps 1.7 lw 2.5 dt 2 lc rgb '#000000' title 'Pareto front',"
          " NaN with points pt 6 ps 0.6 lc rgb '#777777' title 'its engine does better'",
          f);
    for (int e = 0; e < CTS_N_ENGINES; e++) {
        bool any = false, any_bound = false;
        for (int i = 0; i < n; i++) {
            const bool its = (int)list[i]->engine == e;
            any = any || its;
            any_bound = any_bound || (its && list[i]->bound.known);
        }
        if (any)
            fprintf(f,
                    ", $all%d using 1:2 with points pt 6 ps 0.6 lc rgb '%s' notitle,"
                    " $best%d using 1:2 with linespoints pt 7 ps 0.6 lw 1.5 lc rgb '%s' title '%s'",
                    e, colours[e], e, colours[e], cts_engine_names[e]);
        if (any_bound)
            fprintf(f, ", $all%d using 1:3 with points pt 2 ps 0.7 lc rgb '%s' title 'reported error'", e, colours[e]);
    }
    fputc('\n', f);
}

CtsStatus cts_bench_plot_script(const CtsBenchRows *rows, char **script, CtsError *err)
{
    size_t size;
    int n;
    const CtsBenchRow **list = sorted(rows, &n);
    FILE *f = open_memstream(script, &size);
    const bool good = list && f;
    if (good)
        write_script(f, list, n);
    free(list);
    return end_text(f, good, script, err);
}

CtsStatus cts_bench_page(const CtsBenchRows *rows, const char *svg, char **html, CtsError *err)
{
    size_t size;
    char legend[2048];
    FILE *f = open_memstream(html, &size);
    CtsTable *table = cts_bench_table(rows);
    const bool good = f && table;
    if (!good)
        goto end;
    fputs("<!DOCTYPE html>\n<html lang=en><head><meta charset=utf-8><meta name=viewport content='width=device-width'>"
          "<title>ctsplat bench</title>\n<style>body{font:14px sans-serif;margin:2em;color:#222}"
          "svg{max-width:100%;height:auto}</style></head><body>\n<h1>Error against run time</h1>\n",
          f);
    if (svg) {
        /* The XML declaration has no place inside a page. */
        const char *start = strstr(svg, "<svg");
        fputs(start ? start : svg, f);
    }
    cts_bench_legend(rows, legend);
    fputs("<p>", f);
    cts_html_text(f, legend);
    fputs("</p>\n<pre>", f);
    cts_table_print(table, f);
    fputs("</pre>\n", f);
    for (int i = 0; i < rows->n; i++)
        if (!rows->rows[i].measured) {
            fprintf(f, "<p>Left out: %s %s: ", cts_engine_names[rows->rows[i].engine],
                    cts_kernel_names[rows->rows[i].kernel]);
            cts_html_text(f, rows->rows[i].why);
            fputs("</p>\n", f);
        }
    fputs("</body></html>\n", f);
end:
    cts_table_free(&table);
    return end_text(f, good, html, err);
}

/* The contents of a file, 0-terminated. */
static char *read_whole(FILE *file)
{
    char *text = NULL;
    size_t room = 0;
    rewind(file);
    if (getdelim(&text, &room, 0, file) >= 0)
        return text;
    free(text);
    return ferror(file) ? NULL : strdup("");
}

CtsStatus cts_gnuplot(const char *script, char **svg, CtsError *err)
{
    FILE *const in = tmpfile(), *const out = tmpfile(), *const complaints = tmpfile();
    CtsStatus st = CTS_OK;
    char command[80];
    *svg = NULL;
    if (!in || !out || !complaints || fputs(script, in) < 0 || fflush(in))
        st = cts_fail(err, CTS_ERR_OUTPUT, "no temporary file for gnuplot: %s", strerror(errno));
    else {
        snprintf(command, sizeof command, "gnuplot /proc/self/fd/%d >&%d 2>&%d", fileno(in), fileno(out),
                 fileno(complaints));
        const int status = system(command);
        char *const text = read_whole(status ? complaints : out);
        if (status)
            st = cts_fail(err, CTS_ERR_OUTPUT,
                          "gnuplot cannot be run, or fails (it is in the package gnuplot-nox): %.300s",
                          text ? text : "");
        else if (!(*svg = text))
            st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        if (status)
            free(text);
    }
    FILE *const files[] = {in, out, complaints};
    for (int i = 0; i < 3; i++)
        if (files[i])
            fclose(files[i]);
    return st;
}
