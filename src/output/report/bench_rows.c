#include "output/report/bench_rows.h"

#include "output/report/gnuplot.h"
#include "output/report/page.h"
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

void cts_bench_bound_text(const CtsBenchRow *row, char text[24])
{
    if (row->bound.known)
        snprintf(text, 24, "%.3g", row->bound.rmse);
    else
        strcpy(text, "-");
}

static json_t *psnr(double rmse)
{
    return rmse > 0 ? json_real(-20 * log10(rmse)) : json_null();
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
            "{s:s, s:s, s:i, s:f, s:f, s:s, s:f, s:f, s:f, s:I, s:f, s:f, s:o, s:o}", "engine",
            cts_engine_names[r->engine], "kernel", cts_kernel_names[r->kernel], "samples", r->samples, "max_error",
            r->max_error, "tolerance", r->tolerance_hu, "void", r->void_key ? "key" : "strict", "wall_ms", r->wall_ms,
            "wall_ms_spread", r->wall_ms_spread, "serial_ms", r->serial_ms, "peak_rss_bytes",
            (json_int_t)r->peak_rss_bytes, "rmse", r->own.rmse, "rmse_trilinear", r->trilinear.rmse, "psnr_db",
            psnr(r->own.rmse), "bound", r->bound.known ? json_real(r->bound.rmse) : json_null());
        char *line = object ? json_dumps(object, JSON_COMPACT | JSON_REAL_PRECISION(9)) : NULL;
        good = line && fprintf(f, "%s\n", line) > 0;
        json_decref(object);
        free(line);
    }
    if (f && fclose(f))
        good = false;
    if (good)
        return CTS_OK;
    if (f)
        free(*text);
    *text = NULL;
    return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

static int by_time(const void *a, const void *b)
{
    const CtsBenchRow *x = *(const CtsBenchRow *const *)a, *y = *(const CtsBenchRow *const *)b;
    return (x->wall_ms > y->wall_ms) - (x->wall_ms < y->wall_ms);
}

/* Measured rows by time; free with free(). */
static const CtsBenchRow **sorted(const CtsBenchRows *rows, int *n)
{
    const CtsBenchRow **list = malloc((size_t)(rows->n + 1) * sizeof *list);
    *n = 0;
    for (int i = 0; list && i < rows->n; i++)
        if (rows->rows[i].measured)
            list[(*n)++] = &rows->rows[i];
    if (list)
        qsort(list, (size_t)*n, sizeof *list, by_time);
    return list;
}

/* Rows of one engine that no other of its rows beats, and all of them. List is in order of time. */
static void plot_engine(FILE *f, const CtsBenchRow *const *list, int n, int engine, double least)
{
    double best = INFINITY;
    fprintf(f, "$all%d << END\n", engine);
    for (int i = 0; i < n; i++)
        if ((int)list[i]->engine == engine)
            fprintf(f, "%.6g %.6g\n", list[i]->wall_ms, fmax(list[i]->trilinear.rmse, least));
    fprintf(f, "END\n$best%d << END\n", engine);
    for (int i = 0; i < n; i++)
        if ((int)list[i]->engine == engine && list[i]->trilinear.rmse < best) {
            best = list[i]->trilinear.rmse;
            fprintf(f, "%.6g %.6g\n", list[i]->wall_ms, fmax(best, least));
        }
    fputs("END\n", f);
}

/* What was told of errors; false when there is nothing. */
static bool plot_bounds(FILE *f, const CtsBenchRow *const *list, int n)
{
    bool any = false;
    fputs("$bounds << END\n", f);
    for (int i = 0; i < n; i++)
        if (list[i]->bound.known && list[i]->bound.rmse > 0) {
            fprintf(f, "%.6g %.6g\n", list[i]->wall_ms, list[i]->bound.rmse);
            any = true;
        }
    fputs("END\n", f);
    return any;
}

/* The front, and what its rows are: names in turn above and below it, on white, so that no line crosses them. A row
 * below the axis is an arrow at its foot. */
static void plot_front(FILE *f, const CtsBenchRow *const *list, int n, double least)
{
    int above = 1;
    fputs("$front << END\n", f);
    for (int i = 0; i < n; i++)
        if (list[i]->pareto)
            fprintf(f, "%.6g %.6g\n", list[i]->wall_ms, fmax(list[i]->trilinear.rmse, least));
    fputs("END\nset style textbox opaque noborder margins 0.3,0.3\n", f);
    for (int i = 0; i < n; i++) {
        if (!list[i]->pareto)
            continue;
        const bool is_below = list[i]->trilinear.rmse < least;
        char samples[24], tolerance[40] = "", off[40] = "";
        cts_bench_samples_text(list[i], samples);
        if (list[i]->tolerance_hu > 0)
            snprintf(tolerance, sizeof tolerance, ", %g HU", list[i]->tolerance_hu);
        if (list[i]->void_key)
            strcat(tolerance, ", key");
        if (is_below) {
            snprintf(off, sizeof off, ": %.1e, below the axis", list[i]->trilinear.rmse);
            fprintf(f, "set arrow from %.6g,%.6g rto graph 0,-0.035 front lw 2 lc rgb '#000000'\n", list[i]->wall_ms,
                    least);
        }
        fprintf(f, "set label '%s %s %s%s%s' at %.6g,%.6g %s front boxed font ',9' textcolor rgb '#222222'\n",
                cts_engine_names[list[i]->engine], cts_kernel_names[list[i]->kernel], samples, tolerance, off,
                list[i]->wall_ms, fmax(list[i]->trilinear.rmse, least),
                is_below ? "right offset -1.5,0"
                : above  ? "left offset 1.3,0.9"
                         : "right offset -1.3,-0.9");
        above = !above;
    }
}

/* The ends of the error axis. The foot is a third of the smallest error, the reference engine's own apart, which would
 * squeeze all others to the top. */
static void plot_range(const CtsBenchRow *const *list, int n, double *least, double *most)
{
    *least = INFINITY;
    *most = 1 / 255.0;
    for (int i = 0; i < n; i++) {
        if (list[i]->engine != CTS_ENGINE_RAYCAST && list[i]->trilinear.rmse > 0)
            *least = fmin(*least, list[i]->trilinear.rmse);
        *most = fmax(*most, list[i]->trilinear.rmse);
        if (list[i]->bound.known)
            *most = fmax(*most, fmin(list[i]->bound.rmse, 1));
    }
    *least = isinf(*least) ? 1e-9 : *least / 3;
}

/* The first of a peer's points stands for it in the key. */
static bool is_first(const CtsBenchPeers *peers, int i)
{
    for (int k = 0; k < i; k++)
        if (!strcmp(peers->peers[k].name, peers->peers[i].name))
            return false;
    return true;
}

/* The points of each peer, in shapes of their own. */
static void plot_peers(FILE *f, const CtsBenchPeers *peers)
{
    for (int i = 0; i < peers->n; i++) {
        if (!is_first(peers, i))
            continue;
        fprintf(f, "$peer%d << END\n", i);
        for (int k = i; k < peers->n; k++)
            if (!strcmp(peers->peers[k].name, peers->peers[i].name))
                fprintf(f, "%.6g %.6g \"%s\"\n", peers->peers[k].wall_ms, peers->peers[k].rmse,
                        peers->peers[k].setting);
        fputs("END\n", f);
    }
}

static void draw_peers(FILE *f, const CtsBenchPeers *peers)
{
    static const int shapes[] = {4, 8, 10, 12, 14, 1, 3};
    enum { N_SHAPES = sizeof shapes / sizeof *shapes };
    int n = 0;
    for (int i = 0; i < peers->n; i++)
        if (is_first(peers, i))
            fprintf(f,
                    ", $peer%d using 1:2 with points pt %d ps 1.1 lw 1.5 lc rgb '#8a6d00' title '%s',"
                    " $peer%d using 1:2:3 with labels left offset 0.8,-0.4 font ',8' textcolor rgb '#8a6d00' notitle",
                    i, shapes[n++ % N_SHAPES], peers->peers[i].name, i);
}

/* The axes hold the peers too. */
static void widen_for_peers(const CtsBenchPeers *peers, double *least, double *most, double *first, double *last)
{
    for (int i = 0; i < peers->n; i++) {
        *least = fmin(*least, peers->peers[i].rmse / 1.5);
        *most = fmax(*most, peers->peers[i].rmse);
        *first = fmin(*first, peers->peers[i].wall_ms / 2);
        *last = fmax(*last, peers->peers[i].wall_ms * 2);
    }
}

static void write_script(FILE *f, const CtsBenchRow *const *list, int n, const CtsBenchPeers *peers)
{
    double least, most, first = n ? list[0]->wall_ms / 2 : 1, last = n ? list[n - 1]->wall_ms * 2 : 10;
    const char *plot = "plot";
    plot_range(list, n, &least, &most);
    widen_for_peers(peers, &least, &most, &first, &last);
    fprintf(f,
            "set terminal svg noenhanced size 1000,640 font 'sans,12' background 'white'\n"
            "set logscale xy\nset format x '%%g'\nset format y '%%.0e'\nset grid\nset yrange [%g:%g]\n"
            "set xlabel 'median wall time (ms)'\n"
            "set ylabel 'rmse against the converged trilinear integral (display values 0..1)'\n"
            "set key outside right top\nset xrange [%g:%g]\n"
            "set arrow from graph 0,first %g to graph 1,first %g nohead dt 3 lc rgb '#999999'\n"
            "set label '1/255' at graph 0.005,first %g offset 0,0.5 font ',9' textcolor rgb '#777777'\n",
            least * 0.7, most * 1.5, first, last, 1 / 255.0, 1 / 255.0, 1 / 255.0);
    for (int e = 0; e < CTS_N_ENGINES; e++)
        plot_engine(f, list, n, e, least);
    plot_front(f, list, n, least);
    const bool told = plot_bounds(f, list, n);
    plot_peers(f, peers);
    for (int e = 0; e < CTS_N_ENGINES; e++) {
        bool any = false;
        for (int i = 0; i < n; i++)
            any = any || (int)list[i]->engine == e;
        if (!any)
            continue;
        fprintf(f,
                "%s $all%d using 1:2 with points pt 6 ps 0.6 lc rgb '%s' notitle,"
                " $best%d using 1:2 with linespoints pt 7 ps 0.6 lw 1.5 lc rgb '%s' title '%s'",
                plot, e, cts_engine_colours[e], e, cts_engine_colours[e], cts_engine_names[e]);
        plot = ",";
    }
    if (told)
        fputs(", $bounds using 1:2 with points pt 2 ps 0.7 lc rgb '#b3123f' title 'the error told, at most'", f);
    if (n)
        draw_peers(f, peers);
    if (n)
        fprintf(f,
                "%s $front using 1:2 with linespoints pt 6 ps 1.7 lw 2.5 dt 2 lc rgb '#000000' title 'Pareto front',"
                " NaN with points pt 6 ps 0.6 lc rgb '#777777' title 'its engine does better'\n",
                plot);
}

CtsStatus cts_bench_plot_script(const CtsBenchRows *rows, char **script, CtsError *err)
{
    size_t size;
    int n;
    const CtsBenchRow **list = sorted(rows, &n);
    FILE *f = open_memstream(script, &size);
    if (list && f)
        write_script(f, list, n, &rows->peers);
    const bool good = f && fclose(f) == 0 && list;
    free(list);
    if (good)
        return CTS_OK;
    if (f)
        free(*script);
    *script = NULL;
    return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

static void write_row(FILE *f, const CtsBenchRow *r, CtsStatus *st, CtsError *err)
{
    char samples[24], bound[24];
    cts_bench_samples_text(r, samples);
    cts_bench_bound_text(r, bound);
    fprintf(f,
            "<tr%s><td>%s</td><td>%s</td><td>%s</td><td>%g</td><td>%s</td><td>%.1f</td><td>%.1f</td><td>%.1f "
            "%%</td><td>%.0f</td>"
            "<td>%.3g<br><small>%.2g to %.2g</small></td><td>%.3g<br><small>%.2g to "
            "%.2g</small></td><td>%s</td><td>%.1f</td>",
            r->pareto ? " class=front" : "", cts_engine_names[r->engine], cts_kernel_names[r->kernel], samples,
            r->tolerance_hu, r->void_key ? "key" : "strict", r->wall_ms, r->wall_ms_spread,
            100 * r->serial_ms / r->wall_ms, (double)r->peak_rss_bytes / 1048576, r->own.rmse, r->own.rmse_low,
            r->own.rmse_high, r->trilinear.rmse, r->trilinear.rmse_low, r->trilinear.rmse_high, bound,
            r->own.rmse > 0 ? -20 * log10(r->own.rmse) : INFINITY);
    if (r->voxels.known)
        fprintf(f, "<td>%.1f %%</td>", 100 * (double)r->voxels.splatted / (double)r->voxels.total);
    else
        fputs("<td>-</td>", f);
    for (int i = 0; i < 2 && !*st; i++) {
        const CtsThumb *t = i ? &r->difference : &r->picture;
        fprintf(f, "<td><img width=%d height=%d alt=\"%s\" src=\"", t->width, t->height, i ? "difference" : "picture");
        *st = cts_page_image(f, t->rgb, t->width, t->height, err);
        fputs("\"></td>", f);
    }
    fputs("</tr>\n", f);
}

static void write_head(FILE *f, const CtsBenchRows *rows, const char *svg)
{
    const CtsBenchRow *some = NULL;
    for (int i = 0; i < rows->n && !some; i++)
        some = rows->rows[i].measured ? &rows->rows[i] : NULL;
    fputs("<!DOCTYPE html>\n<html lang=en><head><meta charset=utf-8><title>ctsplat bench</title>\n<style>"
          "body{font:14px sans-serif;margin:2em;color:#222}table{border-collapse:collapse}"
          "td,th{border:1px solid #ccc;padding:3px 7px;text-align:right;vertical-align:middle}"
          "td:nth-child(-n+2),th:nth-child(-n+2){text-align:left}small{color:#777}"
          "tr.front td:first-child{font-weight:bold}tr.front{background:#f3f7ee}img{display:block;background:#000}"
          "svg{max-width:100%;height:auto}</style></head><body>\n<h1>Error against run time</h1>\n<p>",
          f);
    cts_page_text(f, rows->scene);
    fprintf(f, ". Pictures of %d x %d pixels, %d thread%s.%s</p>\n", rows->width, rows->height, rows->n_threads,
            rows->n_threads == 1 ? "" : "s",
            rows->complete ? "" : " <b>Interrupted: not all settings were measured.</b>");
    if (svg) {
        /* The XML declaration has no place inside a page. */
        const char *start = strstr(svg, "<svg");
        fputs(start ? start : svg, f);
    }
    fprintf(f,
            "<p>Times are medians of several renders in a process of their own, the spread is the largest less the "
            "smallest; <i>serial</i> is the share of the time in which one thread at most could work; memory is that "
            "process's peak, the volume included. Errors are over red, green and blue as "
            "display values 0..1, at %llu random pixels (%llu for the trilinear integral), with 95 %% intervals: "
            "<i>own</i> against the converged float64 integral of the same kernel (PSNR goes with it), "
            "<i>trilinear</i> against that of the trilinear field; <i>told</i> is the bound of the latter that the "
            "render itself gives. Rows in green lie on the Pareto front. "
            "Difference pictures are against the trilinear integral, %g times too large.</p>\n",
            (unsigned long long)(some ? some->own.pixels : 0), (unsigned long long)(some ? some->trilinear.pixels : 0),
            rows->amplified);
}

static void write_peers(FILE *f, const CtsBenchPeers *peers)
{
    if (!peers->n)
        return;
    fputs("<h2>Other renderers</h2><p>Measured elsewhere, as they were given.</p>\n"
          "<table><tr><th>peer<th>setting<th>wall, ms<th>rmse, trilinear<th>PSNR, dB</tr>\n",
          f);
    for (int i = 0; i < peers->n; i++) {
        const CtsBenchPeer *p = &peers->peers[i];
        fputs("<tr class=peer><td>", f);
        cts_page_text(f, p->name);
        fputs("</td><td>", f);
        cts_page_text(f, p->setting);
        fprintf(f, "</td><td>%.1f</td><td>%.3g</td><td>%.1f</td></tr>\n", p->wall_ms, p->rmse, -20 * log10(p->rmse));
    }
    fputs("</table>\n", f);
}

CtsStatus cts_bench_page(const CtsBenchRows *rows, const char *svg, char **html, CtsError *err)
{
    CtsStatus st = CTS_OK;
    size_t size;
    int n;
    const CtsBenchRow **list = sorted(rows, &n);
    FILE *f = open_memstream(html, &size);
    if (!list || !f) {
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        goto end;
    }
    write_head(f, rows, svg);
    fputs("<table><tr><th>engine<th>kernel<th>samples<th>tolerance, HU<th>void<th>wall, ms<th>spread, "
          "ms<th>serial<th>peak, MiB"
          "<th>rmse, own<th>rmse, trilinear<th>told<th>PSNR, dB<th>voxels splatted<th>picture<th>difference</tr>\n",
          f);
    for (int i = 0; i < n && !st; i++)
        write_row(f, list[i], &st, err);
    fputs("</table>\n", f);
    write_peers(f, &rows->peers);
    bool titled = false;
    for (int i = 0; i < rows->n; i++) {
        const CtsBenchRow *r = &rows->rows[i];
        if (r->measured)
            continue;
        fprintf(f, "%s<li>%s %s: ", titled ? "" : "<h2>Left out</h2><ul>\n", cts_engine_names[r->engine],
                cts_kernel_names[r->kernel]);
        titled = true;
        cts_page_text(f, r->why);
        fputs("</li>\n", f);
    }
    fputs(titled ? "</ul></body></html>\n" : "</body></html>\n", f);
end:
    if (f)
        fclose(f);
    if (st && f) {
        free(*html);
        *html = NULL;
    }
    free(list);
    return st;
}
