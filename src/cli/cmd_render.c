/* ctsplat render: one series, one preset, one view or a rotation, any number of files. */
#include "base/clock.h"
#include "base/cpu.h"
#include "cli/interrupt.h"
#include "cli/load.h"
#include "cli/message.h"
#include "cli/options.h"
#include "cli/outputs.h"
#include "cli/progress.h"
#include "report/log.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct Job {
    const CliOptions *options;
    CtsRenderSettings settings;
    CtsExportSettings export;
    CtsPreset *preset;
    CliLoaded loaded;
    CtsRenderer *renderer; /* of loaded's volume */
    CtsReport report;
    CtsLog *log;
    int n_frames;         /* 1 without --rotation */
    int frame;            /* the one under way */
    CtsExport **exports;  /* by output: the file being written, or NULL */
    CtsVerified verified; /* of all frames so far */
    int done, steps;      /* for the progress bar */
} Job;

static void step(void *context, const char *what)
{
    Job *job = context;
    cli_progress(job->done++, job->steps, what);
}

/* What one file is to hold must fit its format. */
static CtsStatus check_sizes(const Job *job, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const CtsPreset *p = job->preset;
    const CtsMode mode = job->settings.mode >= 0 ? (CtsMode)job->settings.mode : p->mode;
    const bool grey_behind =
        p->background_none || (p->background[0] == p->background[1] && p->background[1] == p->background[2]);
    const bool grey = cts_preset_is_grey(p, mode) && grey_behind;
    for (int i = 0; i < job->options->n_outputs && !st; i++) {
        const char *path = job->options->outputs[i];
        st = cts_export_check_size(path, job->settings.width, job->settings.height,
                                   cli_output_is_multi_frame(path) ? job->n_frames : 1, grey, &job->export, err);
    }
    return st;
}

/* All that can be refused before any file is read. */
static CtsStatus prepare(Job *job, CtsError *err)
{
    CtsStatus st;
    const CliOptions *options = job->options;
    job->export = (CtsExportSettings){
        .compression = (CtsScCompression)options->compression,
        .new_uids = options->new_uids,
        .deidentify = options->deidentify,
        .force = options->force,
        .n_threads = cts_threads(options->render.n_threads),
    };
    job->settings = options->render;
    job->settings.stop = &cli_stop;
    job->settings.want_depth = cli_outputs_hold_depth(options);
    job->n_frames = options->rotation ? options->rotation : 1;
    job->steps = 2 + job->n_frames;
    if (!options->n_outputs && !options->render.explain)
        return cts_fail(err, CTS_ERR_USAGE, "render: no output (give -o FILE, ending in .png, .exr or .dcm)");
    if (!options->render.explain && (st = cli_outputs_check(options, &job->export, err)))
        return st;
    if (!(job->preset = malloc(sizeof *job->preset)) ||
        !(job->exports = calloc((size_t)options->n_outputs + 1, sizeof *job->exports)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if ((st = cts_preset_load(options->preset, job->preset, err)))
        return st;
    if (job->preset->note[0])
        cli_warning("preset %s: left out: %s", job->preset->name, job->preset->note);
    if (options->background_given) {
        job->preset->background_none = options->background_none;
        memcpy(job->preset->background, options->background, sizeof options->background);
    }
    return options->render.explain ? CTS_OK : check_sizes(job, err);
}

/* Rows of one output: begin its file at the first, end it at the last. A multi-frame object takes all frames. */
static CtsStatus write_rows(Job *job, int output, const CtsPicture *band, CtsError *err)
{
    const char *path = job->options->outputs[output];
    CtsExport **export = &job->exports[output];
    const bool multi = cli_output_is_multi_frame(path);
    const bool last = band->first_row + band->height == band->whole_height;
    CtsStatus st = CTS_OK;
    char *name = cli_output_name(path, job->frame, multi ? 0 : job->options->rotation);
    if (!name)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (!*export)
        st = cts_export_begin(export, name, band, multi ? job->n_frames : 1, &job->export, &job->report, err);
    if (!st)
        st = cts_export_rows(*export, band, err);
    if (!st && last && (!multi || job->frame == job->n_frames - 1)) {
        uint64_t bytes;
        if (!(st = cts_export_end(export, &bytes, err)))
            cts_log_output(job->log, name, cts_export_format(path), bytes);
    }
    free(name);
    return st;
}

static CtsStatus annotate(const Job *job, CtsPicture *band, CtsError *err)
{
    const bool orientation = job->options->annotate_orientation, scale = job->options->annotate_scale;
    int n_left_out = 0;
    const CtsStatus st = cts_annotate(band, orientation, scale, &n_left_out, err);
    if (n_left_out > 0 && job->frame == 0 && band->first_row == 0)
        cli_warning("--annotate: %d of %d marks left out, for which the picture has no room (a larger --size)",
                    n_left_out, 4 * orientation + scale);
    return st;
}

/* A band as the engine made it: over the background, marked, into all files. */
static CtsStatus finish_band(void *context, CtsPicture *band, CtsError *err)
{
    Job *job = context;
    const CliOptions *options = job->options;
    const CtsMeter meter = cts_meter_start(&job->report);
    CtsStatus st = CTS_OK;
    if (!job->preset->background_none)
        cts_picture_over(band, job->preset->background, options->render.n_threads);
    if (options->annotate_orientation || options->annotate_scale)
        st = annotate(job, band, err);
    for (int i = 0; i < options->n_outputs && !st; i++)
        if (!(st = cli_interrupted(err)))
            st = write_rows(job, i, band, err);
    cts_meter_stop(meter, &job->report, CTS_STAGE_EXPORT);
    return st;
}

/* Half the width of the interval in the logarithm, back as a share of the mean square. */
static double spread_of(const CtsVerified *v)
{
    return v->rmse > 0 ? log(v->rmse_high / v->rmse_low) : 0;
}

/* One verdict on all frames: pooled rmse and interval, largest maximum and percentile. */
static void add_verified(CtsVerified *all, const CtsVerified *frame)
{
    const uint64_t n = all->pixels + frame->pixels;
    if (!n)
        return;
    const CtsVerified before = *all;
    const double a = (double)before.pixels / (double)n, b = (double)frame->pixels / (double)n;
    const double square[2] = {a * before.rmse * before.rmse, b * frame->rmse * frame->rmse};
    const double mean = square[0] + square[1];
    const double spread = mean > 0 ? hypot(square[0] * spread_of(&before), square[1] * spread_of(frame)) / mean : 0;
    if (frame->max >= all->max)
        *all = *frame;
    all->rmse = sqrt(mean);
    all->rmse_low = all->rmse * exp(-0.5 * spread);
    all->rmse_high = all->rmse * exp(0.5 * spread);
    all->p999 = fmax(before.p999, frame->p999);
    all->share_above = a * before.share_above + b * frame->share_above;
    all->wall_ms = before.wall_ms + frame->wall_ms;
    all->cpu_ms = before.cpu_ms + frame->cpu_ms;
    all->pixels = n;
}

static CtsStatus render_frame(Job *job, CtsError *err)
{
    const double azimuth_deg = job->settings.azimuth_deg + 360.0 * job->frame / job->n_frames;
    step(job, "rendering");
    const size_t n_findings = job->report.findings.n;
    const CtsMeter meter = cts_meter_start(&job->report);
    const CtsStatus st = cts_render_bands(job->renderer, azimuth_deg, job->settings.elevation_deg, 0, finish_band, job,
                                          &job->report, err);
    cts_meter_stop(meter, &job->report, CTS_STAGE_COMPOSITE);
    cli_print_findings(&job->report.findings, n_findings);
    if (!st)
        add_verified(&job->verified, &job->report.verified);
    return st ? st : cli_interrupted(err);
}

/* What --explain tells: the task, the engine's plan, and what is left out with its reason. */
static void print_plan(const Job *job)
{
    const CtsRenderSettings *s = &job->settings;
    const CtsMode mode = s->mode >= 0 ? (CtsMode)s->mode : job->preset->mode;
    printf("preset %s, mode %s, engine %s, kernel %s\n", job->preset->name, cts_mode_names[mode],
           cts_engine_names[s->engine], cts_kernel_names[s->kernel]);
    printf("%d x %d pixels, azimuth %g, elevation %g degrees", s->width, s->height, s->azimuth_deg, s->elevation_deg);
    if (job->n_frames > 1)
        printf(", and %d more views of a rotation", job->n_frames - 1);
    printf("\n%s", job->report.plan ? job->report.plan : "");
    for (size_t i = 0; i < job->report.findings.n; i++)
        if (job->report.findings.items[i].severity == CTS_NOTE)
            printf("note: %s\n", job->report.findings.items[i].text);
    for (size_t i = 0; i < job->report.n_skips; i++)
        printf("left out: %s: %s\n", job->report.skips[i].what, job->report.skips[i].why);
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

static void job_free(Job *job)
{
    for (int i = 0; job->exports && i < job->options->n_outputs; i++)
        cts_export_discard(&job->exports[i]);
    free(job->exports);
    free(job->preset);
    cts_render_end(&job->renderer);
    cli_loaded_free(&job->loaded);
}

CtsStatus cli_render(const CliOptions *options, int *exit_code, CtsError *err)
{
    (void)exit_code;
    CtsStatus st;
    Job job = {.options = options};
    const double start_ms = cts_wall_ms();
    CtsMeter meter = cts_meter_start(&job.report);
    if ((st = prepare(&job, err)) || (st = cts_log_open(&job.log, options->log, start_ms, err)))
        goto end;
    cts_meter_stop(meter, &job.report, CTS_STAGE_SCAN);
    st = cli_load(options, job.preset, step, &job, &job.loaded, &job.report, err);
    job.export.source = job.loaded.series;
    cli_interrupt_asks();
    if (st || (st = cli_interrupted(err)))
        goto end;
    if ((st = cts_render_begin(&job.renderer, job.loaded.volume, job.preset, &job.settings, err)))
        goto end;
    if (job.n_frames > 1)
        cts_report_skip(&job.report, "loading again", "%d frames share one volume, cropped and without its table once",
                        job.n_frames);
    /* The plan of one view stands for all of a rotation. */
    const int n_frames = options->render.explain ? 1 : job.n_frames;
    for (; job.frame < n_frames && !st; job.frame++)
        st = render_frame(&job, err);
    job.report.verified = job.verified;
    cli_progress_clear();
    if (!st && options->render.explain)
        print_plan(&job);
    else if (!st)
        print_verified(&job.report);
end:
    cli_progress_clear();
    meter = cts_meter_start(&job.report);
    job_free(&job);
    cts_meter_stop(meter, &job.report, CTS_STAGE_EXPORT);
    cts_log_report(job.log, &job.report);
    if (!st)
        cts_log_done(job.log, cts_threads(options->render.n_threads));
    CtsError log_err;
    const CtsStatus log_st = cts_log_close(&job.log, &log_err);
    if (log_st && !st) {
        *err = log_err;
        st = log_st;
    }
    cts_report_free(&job.report);
    return st;
}
