#include "lab/bench/bench.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/file.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void describe_scene(const CtsBenchSettings *settings, CtsBenchRows *rows)
{
    const CtsVolume *v = settings->model->volume;
    const CtsRenderSettings *s = &settings->render;
    snprintf(rows->scene, sizeof rows->scene,
             "Volume of %d x %d x %d voxels, %.3g x %.3g x %.3g mm each; preset %s, mode %s, lighting %s; view %g,%g",
             v->dims[0], v->dims[1], v->dims[2], cts_volume_spacing_mm(v, 0), cts_volume_spacing_mm(v, 1),
             cts_volume_spacing_mm(v, 2), settings->preset->name, cts_mode_names[settings->preset->mode],
             settings->preset->shade ? "on" : "off", s->azimuth_deg, s->elevation_deg);
    rows->width = s->width;
    rows->height = s->height;
    rows->n_threads = cts_threads(s->n_threads);
}

static void report_progress(const CtsBenchSettings *settings, int done, int all, const CtsBenchRow *row)
{
    char what[128], samples[24];
    if (!settings->progress)
        return;
    if (!row) {
        settings->progress(done, all, "reference");
        return;
    }
    cts_bench_samples_text(row, samples);
    snprintf(what, sizeof what, "%s %s samples %s%s%s", cts_engine_names[row->engine], cts_kernel_names[row->kernel],
             samples, row->tolerance_hu > 0 ? " tolerant" : "", row->void_key ? " key" : "");
    settings->progress(done, all, what);
}

/* The converged integral of a kernel, once: own[CTS_KERNEL_TENT] is the trilinear one. */
static CtsStatus make_reference(const CtsBenchSettings *settings, CtsKernelId kernel, CtsReference **own, CtsError *err)
{
    enum { PIXELS_TRILINEAR = 4000, PIXELS_KERNEL = 1500 }; /* some 5 % of the rmse on real heads */
    CtsRenderSettings s = settings->render;
    s.kernel = kernel;
    return own[kernel] ? CTS_OK
                       : cts_reference_new(&own[kernel], settings->model, settings->preset, &s,
                                           kernel == CTS_KERNEL_TENT ? PIXELS_TRILINEAR : PIXELS_KERNEL, err);
}

/* Later settings take as long as the first one on average, and each further kernel needs its integral. */
static void estimate_duration(const CtsBenchSettings *settings, const CtsBenchRow *rows, int n, double reference_ms,
                              double first_ms)
{
    bool used[CTS_N_KERNELS] = {[CTS_KERNEL_TENT] = true};
    int n_integrals = 0;
    for (int i = 0; i < n; i++) {
        n_integrals += !used[rows[i].kernel];
        used[rows[i].kernel] = true;
    }
    if (settings->duration)
        settings->duration(n, ((n - 1) * first_ms + n_integrals * reference_ms) / 1000);
}

CtsStatus cts_bench_run(const CtsBenchSettings *settings, CtsBenchRows *rows, CtsError *err)
{
    CtsStatus st;
    CtsReference *own[CTS_N_KERNELS] = {NULL};
    int n = 0;
    *rows = (CtsBenchRows){.n = 0};
    describe_scene(settings, rows);
    if ((st = cts_bench_plan(settings->full, &rows->rows, &n, err)))
        return st;
    report_progress(settings, 0, n + 1, NULL);
    const double begin_ms = cts_wall_ms();
    st = make_reference(settings, CTS_KERNEL_TENT, own, err);
    const double reference_ms = cts_wall_ms() - begin_ms;
    for (int i = 0; i < n && !st; i++) {
        CtsBenchRow *row = &rows->rows[i];
        report_progress(settings, i + 1, n + 1, row);
        if (!(st = make_reference(settings, row->kernel, own, err)) &&
            !(st = cts_bench_measure(settings, own, row, err)))
            rows->n = i + 1;
        if (i == 0 && !st)
            estimate_duration(settings, rows->rows, n, reference_ms, cts_wall_ms() - begin_ms - reference_ms);
    }
    rows->complete = !st;
    cts_bench_mark_pareto(rows);
    for (int kernel = 0; kernel < CTS_N_KERNELS; kernel++)
        cts_reference_free(&own[kernel]);
    return st;
}

void cts_bench_free(CtsBenchRows *rows)
{
    free(rows->rows);
    *rows = (CtsBenchRows){.n = 0};
}

static const char *const file_names[3] = {"bench.jsonl", "error-vs-time.svg", "report.html"};

static void file_path(char path[4096], const char *folder, int i)
{
    snprintf(path, 4096, "%s/%s", folder, file_names[i]);
}

CtsStatus cts_bench_check_writable(const char *folder, bool force, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (strlen(folder) > 4000)
        return cts_fail(err, CTS_ERR_OUTPUT, "the output folder's name is too long");
    for (int i = 0; i < 3 && !st; i++) {
        char path[4096];
        file_path(path, folder, i);
        st = cts_file_check_writable(path, force, err);
    }
    char *nothing = NULL;
    if (!st)
        st = cts_gnuplot("", &nothing, err);
    free(nothing);
    return st;
}

static CtsStatus write_bench_file(const char *folder, int i, const char *text, bool force, CtsError *err)
{
    CtsStatus st;
    CtsTempFile *temp = NULL;
    char path[4096];
    file_path(path, folder, i);
    if (!(st = cts_temp_open(&temp, path, err)) && !(st = cts_temp_write(temp, text, strlen(text), err)))
        st = cts_temp_commit(&temp, force, NULL, err);
    cts_temp_discard(&temp);
    return st;
}

CtsStatus cts_bench_write(const CtsBenchRows *rows, const char *folder, bool force, CtsError *err)
{
    CtsStatus st;
    char *lines = NULL, *script = NULL, *svg = NULL, *html = NULL;
    bool any = false;
    for (int i = 0; i < rows->n; i++)
        any = any || rows->rows[i].measured;
    if ((st = cts_bench_lines(rows, &lines, err)) || (st = write_bench_file(folder, 0, lines, force, err)))
        goto end;
    if (any && ((st = cts_bench_plot_script(rows, &script, err)) || (st = cts_gnuplot(script, &svg, err)) ||
                (st = write_bench_file(folder, 1, svg, force, err))))
        goto end;
    if (!(st = cts_bench_page(rows, svg, &html, err)))
        st = write_bench_file(folder, 2, html, force, err);
end:
    free(lines);
    free(script);
    free(svg);
    free(html);
    return st;
}
