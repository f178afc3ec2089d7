/* ctsplat render: the command line as a job, its progress, its log and its output. */
#include "app/options/options.h"
#include "base/clock.h"
#include "base/exit_code.h"
#include "base/stage_timer.h"
#include "cli/commands.h"
#include "cli/terminal.h"
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static void print_plan_lines(const char *plan)
{
    char line[700];
    while (plan && *plan) {
        char text[512];
        const size_t n = strcspn(plan, "\n");
        snprintf(text, sizeof text, "%.*s", (int)n, plan);
        printf("%s\n", cli_with_options(text, line, sizeof line));
        plan += n + (plan[n] != 0);
    }
}

/* Output of --explain: the task, the engine's plan, and omitted steps with reasons. */
static void print_plan(const CtsJob *job, const CtsReport *report)
{
    char line[sizeof report->diagnostics.items->text + 64];
    const CtsRenderSettings *s = &job->render;
    printf("preset %s, mode %s, engine %s, kernel %s\n", job->preset->name, cts_mode_names[job->preset->mode],
           cts_engine_names[s->engine], cts_kernel_names[s->kernel]);
    printf("%d x %d pixels, azimuth %g, elevation %g degrees", s->width, s->height, s->azimuth_deg, s->elevation_deg);
    if (job->outputs.rotation > 1)
        printf(", and %d more views of a rotation", job->outputs.rotation - 1);
    putchar('\n');
    print_plan_lines(report->plan);
    for (size_t i = 0; i < report->diagnostics.n; i++)
        if (report->diagnostics.items[i].severity == CTS_NOTE)
            printf("note: %s\n", cli_with_options(report->diagnostics.items[i].text, line, sizeof line));
    for (size_t i = 0; i < report->n_skips; i++)
        printf("left out: %s: %s\n", report->skips[i].what, report->skips[i].why);
}

static void print_verified(const CtsReport *report)
{
    const CtsVerified *v = &report->verified;
    const double picture_cpu_ms = cts_report_picture_cpu_ms(report);
    if (!v->pixels)
        return;
    char psnr[32] = "";
    if (v->rmse > 0)
        snprintf(psnr, sizeof psnr, " (%.1f dB)", -20 * log10(v->rmse));
    cli_note("verified %llu pixels, in 1/255: rmse %.3g%s, 95 %% interval %.3g to %.3g if no pixel is off by more than "
             "the largest; 99.9 %% of them within %.3g; "
             "%.3g %% of the picture off by more than 1 (upper 97.5 %% limit: %.3g %%); largest %.3g at pixel %d,%d",
             (unsigned long long)v->pixels, 255 * v->rmse, psnr, 255 * v->rmse_low, 255 * v->rmse_high, 255 * v->p999,
             100 * v->share_above, 100 * v->share_high, 255 * v->max, v->worst_x, v->worst_y);
    if (v->cpu_ms >= picture_cpu_ms)
        cli_note("verification took %.2f s of processor time, more than the picture's %.2f s", v->cpu_ms / 1000,
                 picture_cpu_ms / 1000);
}

/* Preparation before the job; from here on the log records failures. */
static CtsStatus begin_render(const CtsOptions *options, CtsLog *log, CtsPreset *preset, CtsJob *job,
                              CliStandardOutput *standard_output, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    int fd;
    const char *last_words;
    size_t n;
    char command[512] = "render", lists[CTS_VALUE_LISTS_MAX];
    cts_options_command(options, command + strlen(command), sizeof command - strlen(command));
    cts_log_run(log, command, NULL);
    if (cts_log_last_words(log, &fd, &last_words, &n))
        cli_interrupt_writes(fd, last_words, n);
    if (!options->outputs.n && !options->render.explain)
        return cts_fail(err, CTS_ERR_USAGE, "render: no output (give -o FILE, ending in %s)",
                        cts_value_lists("{outputs}", lists));
    if ((st = cts_options_one_job(options, preset, job, report, err)) ||
        (st = cli_standard_output_begin(standard_output, options, job, err)))
        return st;
    if (options->from.given)
        cli_interrupt_sets_stop(); /* from now on there is a folder to clear away */
    return CTS_OK;
}

/* Steps after the job: standard output, sending, and messages. */
static CtsStatus hand_over(const CtsOptions *options, CtsLog *log, const CtsJob *job,
                           const CliStandardOutput *standard_output, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    uint64_t bytes;
    const size_t n_diagnostics = report->diagnostics.n;
    if (options->render.explain) {
        print_plan(job, report);
        return CTS_OK;
    }
    print_verified(report);
    if (standard_output->path) {
        if ((st = cli_standard_output_write(standard_output, &bytes, err)))
            return st;
        cts_log_output(log, "-", standard_output->format, bytes);
    }
    st = cts_options_send(options, report, err);
    cli_print_diagnostics(&report->diagnostics, n_diagnostics);
    return st;
}

static CtsStatus end_log(const CtsOptions *options, CtsLog *log, const CtsReport *report, CtsStatus st, CtsError *err)
{
    CtsError log_err;
    cts_log_report(log, report);
    if (st)
        cts_log_failed(log, cts_exit_code(st), err->text);
    else
        cts_log_done(log, options->render.n_threads);
    const CtsStatus log_st = cts_log_close(&log, &log_err);
    if (st || !log_st)
        return st;
    *err = log_err;
    return log_st;
}

CtsStatus cli_render(const CtsOptions *options, int *exit_code, CtsError *err)
{
    (void)exit_code;
    CtsJob job;
    CtsReport report = {0};
    CtsLog *log = NULL;
    CtsNames names = {0}; /* names that the log must not contain */
    CliStandardOutput standard_output = {0};
    CtsPreset preset;
    /* The meter covers the whole run: time outside any stage is added to the last one. */
    const CtsStageTimer whole = {.wall_ms = cts_wall_ms()};
    CtsStatus st = cts_log_open(&log, options->log, options->export.key, true, whole.wall_ms, err);
    for (int i = 0; log && !options->show_paths && i < options->paths.n; i++)
        cts_names_add(&names, options->paths.items[i]);
    cts_log_without_names(log, &names);
    if (!st)
        st = begin_render(options, log, &preset, &job, &standard_output, &report, err);
    cts_stage_timer_stop(whole, &report, CTS_STAGE_SCAN);
    if (!st) {
        CliWatch cli = {.log = log,
                        .job = &job,
                        .reported_later = standard_output.path,
                        .names = options->show_paths ? NULL : &names,
                        .summed_up = options->summary || isatty(STDERR_FILENO),
                        .picture_start_ms = whole.wall_ms};
        const CtsWatch watch = cli_watch(&cli);
        st = cts_options_run_job(options, &preset, &job, &watch, &report, err);
        cli_progress_clear();
    }
    if (!st)
        st = hand_over(options, log, &job, &standard_output, &report, err);
    cli_standard_output_end(&standard_output);
    cli_interrupt_writes(0, NULL, 0);
    cts_log_run(log, NULL, report.series_uid[0] ? report.series_uid : NULL);
    cts_stage_timer_stop(whole, &report, CTS_STAGE_EXPORT);
    st = end_log(options, log, &report, st, err);
    cts_report_free(&report);
    cts_names_free(&names);
    return st;
}
