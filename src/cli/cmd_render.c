/* ctsplat render: the command line as a job, its progress, its log and what it prints. */
#include "base/clock.h"
#include "base/exit_code.h"
#include "cli/interrupt.h"
#include "cli/job_options.h"
#include "cli/message.h"
#include "cli/options.h"
#include "cli/progress.h"
#include "cli/remote.h"
#include "cli/terminal_watch.h"
#include "cli/words.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* What --explain tells: the task, the engine's plan, and what is left out with its reason. */
static void print_plan(const CtsJob *job, const CtsReport *report)
{
    char line[sizeof report->findings.items->text + 64];
    const CtsRenderSettings *s = &job->render;
    const CtsMode mode = s->mode >= 0 ? (CtsMode)s->mode : job->preset->mode;
    printf("preset %s, mode %s, engine %s, kernel %s\n", job->preset->name, cts_mode_names[mode],
           cts_engine_names[s->engine], cts_kernel_names[s->kernel]);
    printf("%d x %d pixels, azimuth %g, elevation %g degrees", s->width, s->height, s->azimuth_deg, s->elevation_deg);
    if (job->outputs.rotation > 1)
        printf(", and %d more views of a rotation", job->outputs.rotation - 1);
    printf("\n%s", report->plan ? report->plan : "");
    for (size_t i = 0; i < report->findings.n; i++)
        if (report->findings.items[i].severity == CTS_NOTE)
            printf("note: %s\n", cli_with_options(report->findings.items[i].text, line, sizeof line));
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
    cli_note("verified %llu pixels: rmse %.3g%s, 95 %% interval %.3g to %.3g; 99.9 %% of them within %.3g; "
             "%.3g %% of the picture off by more than 1/255; largest %.3g at pixel %d,%d",
             (unsigned long long)v->pixels, v->rmse, psnr, v->rmse_low, v->rmse_high, v->p999, 100 * v->share_above,
             v->max, v->worst_x, v->worst_y);
    if (v->cpu_ms >= picture_cpu_ms)
        cli_note("verification took %.2f s of processor time, more than the picture's %.2f s", v->cpu_ms / 1000,
                 picture_cpu_ms / 1000);
}

CtsStatus cli_render(const CliOptions *options, int *exit_code, CtsError *err)
{
    (void)exit_code;
    CtsStatus st;
    CtsJob job;
    CtsReport report = {0};
    CtsLog *log = NULL;
    int fd;
    const char *words;
    size_t n;
    const double start_ms = cts_wall_ms();
    CtsPreset *preset = malloc(sizeof *preset);
    if (!preset)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if ((st = cli_job(options, preset, &job, err)) || (st = cts_log_open(&log, options->log, start_ms, err)))
        goto end;
    if (options->from_given)
        cli_interrupt_asks(); /* from now on there is a folder to clear away */
    cts_log_run(log, options->command, NULL);
    if (cts_log_last_words(log, &fd, &words, &n))
        cli_interrupt_says(fd, words, n);
    CliWatch seen = {.log = log};
    const CtsWatch watch = cli_watch(&seen);
    st = cts_job_run(&job, &watch, &report, err);
    cli_progress_clear();
    if (!st && options->render.explain)
        print_plan(&job, &report);
    else if (!st) {
        print_verified(&report);
        st = cli_send(options, err);
    }
end:
    cts_log_report(log, &report);
    cli_interrupt_says(0, NULL, 0);
    cts_log_run(log, NULL, report.series_uid[0] ? report.series_uid : NULL);
    if (st)
        cts_log_failed(log, cts_exit_code(st), err->text);
    else
        cts_log_done(log, options->render.n_threads);
    CtsError log_err;
    const CtsStatus log_st = cts_log_close(&log, &log_err);
    if (log_st && !st) {
        *err = log_err;
        st = log_st;
    }
    cts_report_free(&report);
    free(preset);
    return st;
}
