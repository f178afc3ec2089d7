/* ctsplat bench: error against run time, for each engine and setting on one series. */
#include "app/options/options.h"
#include "base/cpu.h"
#include "cli/commands.h"
#include "cli/terminal.h"
#include "lab/bench/bench.h"
#include "output/report/text_table.h"
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

static CtsStatus make_folder(const CtsOptions *options, CtsError *err)
{
    if (!options->output_dir)
        return cts_fail(err, CTS_ERR_USAGE, "bench: -O DIR is needed, for bench.jsonl and report.html");
    if (mkdir(options->output_dir, 0777) && errno != EEXIST)
        return cts_fail(err, CTS_ERR_OUTPUT, "%s: %s", options->output_dir, strerror(errno));
    return cts_bench_check_writable(options->output_dir, options->export.force, err);
}

static void print_table(const CtsBenchRows *rows)
{
    char legend[2048];
    CtsTable *table = cts_bench_table(rows);
    cts_bench_legend(rows, legend);
    if (legend[0])
        cts_table_print(table, stdout);
    printf("\n%s", legend);
    cts_table_free(&table);
    for (int i = 0; i < rows->n; i++)
        if (!rows->rows[i].measured)
            cli_note("left out: %s %s: %s", cts_engine_names[rows->rows[i].engine],
                     cts_kernel_names[rows->rows[i].kernel], rows->rows[i].why);
}

/* The paper's tables instead of the bench's. */
static CtsStatus run_paper(const CtsBenchSettings *bench, CtsError *err)
{
    CtsTable *table = NULL;
    const CtsVolume *const v = bench->model->volume;
    const CtsStatus st = cts_paper_table(bench, &table, err);
    cli_progress_clear();
    if (st)
        return st;
    cts_table_print(table, stdout);
    cts_table_free(&table);
    printf("\nVolume of %d x %d x %d voxels, %d grey bits, kernel cone-paper, unlit; medians of %d rounds, %s.\n"
           "The first four rows work as the paper has it (--occlusion-culling off --reuse always), the others by "
           "default.\n",
           v->dims[0], v->dims[1], v->dims[2], CTS_PAPER_BITS, CTS_PAPER_ROUNDS,
           cts_threads(bench->render.n_threads) == 1 ? "CPU time of one thread" : "wall time");
    return CTS_OK;
}

static void print_duration(int n, double seconds_left)
{
    cli_note("bench: %d settings%s", n, cli_time_left(seconds_left).text);
}

CtsStatus cli_bench(const CtsOptions *options, int *exit_code, CtsError *err)
{
    (void)exit_code;
    CtsStatus st;
    CtsLoaded loaded = {.list = NULL};
    CtsReport report = {0};
    CtsBenchRows rows = {.n = 0};
    CtsPreset preset;
    CtsJob job;
    if ((st = cts_options_one_job(options, &preset, &job, &report, err)) ||
        (!options->paper && (st = make_folder(options, err))))
        goto end;
    CliWatch cli = {0};
    const CtsWatch watch = cli_watch(&cli);
    st = cts_source_find(&job.source, &watch, 2, &loaded, &report, err);
    if (!st && loaded.series->renderable)
        st = cts_options_settle(options, loaded.series->modality_id, loaded.series->quantity, &preset, &job, &report,
                                err);
    job.source.crops_air = false;
    job.source.interpolation = CTS_INTERPOLATION_LINEAR; /* engines are measured on the slices without interpolation */
    if (!st && !(st = cts_source_scan(&job.source, &watch, 2, &loaded, &report, err)) &&
        !(st = cts_source_view(&job.source, true, &loaded, &report, err)))
        st = cts_preset_resolve(&preset, loaded.model.volume, err);
    cli_interrupt_sets_stop();
    if (st)
        goto end;
    CtsBenchSettings settings = {.model = &loaded.model,
                                 .preset = &preset,
                                 .render = options->render,
                                 .full = options->full,
                                 .progress = cli_progress,
                                 .duration = print_duration};
    settings.render.stop = &cli_stop;
    if (options->paper) {
        st = run_paper(&settings, err);
        goto end;
    }
    st = cts_bench_run(&settings, &rows, err);
    cli_progress_clear();
    /* Results measured so far are written also after an interruption. */
    if (!st || st == CTS_ERR_INTERRUPTED) {
        CtsError why;
        const CtsStatus written = cts_bench_write(&rows, options->output_dir, options->export.force, &why);
        print_table(&rows);
        if (written && !st) {
            *err = why;
            st = written;
        }
    }
end:
    cli_progress_clear();
    cts_bench_free(&rows);
    cts_loaded_free(&loaded);
    cts_report_free(&report);
    return st;
}
