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
#include <unistd.h>

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
    CtsPicture **frames;  /* kept for multi-frame outputs; NULL entries else */
    CtsVerified verified; /* of all frames so far */
    int done, steps;      /* for the progress bar */
} Job;

static void step(void *context, const char *what)
{
    Job *job = context;
    cli_progress(job->done++, job->steps, what);
}

/* Frames that wait for a multi-frame object must fit into memory together. */
static CtsStatus check_frames_fit(const Job *job, CtsError *err)
{
    bool kept = false;
    for (int i = 0; i < job->options->n_outputs; i++)
        kept |= cli_output_is_multi_frame(job->options->outputs[i]);
    const double bytes = 16.0 * job->settings.width * job->settings.height * job->n_frames;
    const double memory = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    if (kept && job->n_frames > 1 && memory > 0 && bytes > memory / 2)
        return cts_fail(err, CTS_ERR_USAGE,
                        "--rotation %d: the frames of a multi-frame object take %.1f GB, more than half of the memory "
                        "(fewer views or a smaller --size)",
                        job->n_frames, bytes / 1e9);
    return CTS_OK;
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
    if (!options->render.explain &&
        ((st = cli_outputs_check(options, &job->export, err)) || (st = check_frames_fit(job, err))))
        return st;
    if (!(job->preset = malloc(sizeof *job->preset)) ||
        !(job->frames = calloc((size_t)job->n_frames, sizeof *job->frames)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if ((st = cts_preset_load(options->preset, job->preset, err)))
        return st;
    if (job->preset->note[0])
        cli_warning("preset %s: left out: %s", job->preset->name, job->preset->note);
    if (options->background_given) {
        job->preset->background_none = options->background_none;
        memcpy(job->preset->background, options->background, sizeof options->background);
    }
    return CTS_OK;
}

static CtsStatus export_frames(Job *job, const char *path, int first, int n, CtsError *err)
{
    uint64_t bytes;
    const CtsMeter meter = cts_meter_start(&job->report);
    const CtsStatus st =
        cts_export((const CtsPicture *const *)&job->frames[first], n, path, &job->export, &bytes, &job->report, err);
    cts_meter_stop(meter, &job->report, CTS_STAGE_EXPORT);
    if (!st)
        cts_log_output(job->log, path, cts_export_format(path), bytes);
    return st;
}

/* The frame's own files; a multi-frame object waits for the last frame. */
static CtsStatus write_frame(Job *job, int frame, CtsError *err)
{
    CtsStatus st = CTS_OK;
    bool keep = false;
    for (int i = 0; i < job->options->n_outputs && !st; i++) {
        const char *path = job->options->outputs[i];
        if (cli_output_is_multi_frame(path)) {
            keep = true;
            if (frame == job->n_frames - 1)
                st = export_frames(job, path, 0, job->n_frames, err);
            continue;
        }
        char *name = cli_output_name(path, frame, job->options->rotation);
        st = name ? export_frames(job, name, frame, 1, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        free(name);
        if (!st)
            st = cli_interrupted(err);
    }
    if (!keep)
        cts_picture_free(&job->frames[frame]);
    return st;
}

/* What --void key loses is measured, asked for or not: so many pixels when --verify does not say. */
enum { KEY_PIXELS = 256 };

static CtsStatus verify_key(Job *job, double azimuth_deg, const CtsPicture *picture, CtsError *err)
{
    CtsRenderSettings settings = job->settings;
    CtsReference *reference = NULL;
    CtsStatus st;
    settings.azimuth_deg = azimuth_deg;
    if (!(st = cts_reference_new(&reference, job->loaded.volume, job->preset, &settings, KEY_PIXELS, err)))
        st = cts_reference_compare(reference, picture, &job->report.verified, err);
    cts_reference_free(&reference);
    return st;
}

/* One verdict on all frames: pooled rmse, largest maximum. */
static void add_verified(CtsVerified *all, const CtsVerified *frame)
{
    const uint64_t n = all->pixels + frame->pixels;
    if (!n)
        return;
    const bool worse = frame->max >= all->max;
    const CtsVerified before = *all;
    if (worse)
        *all = *frame;
    const double a = (double)before.pixels / (double)n, b = (double)frame->pixels / (double)n;
    all->rmse = sqrt(a * before.rmse * before.rmse + b * frame->rmse * frame->rmse);
    all->share_above = a * before.share_above + b * frame->share_above;
    all->wall_ms = before.wall_ms + frame->wall_ms;
    all->pixels = n;
}

static CtsStatus render_frame(Job *job, int frame, CtsError *err)
{
    CtsStatus st;
    CtsPicture **picture = &job->frames[frame];
    const double azimuth_deg = job->settings.azimuth_deg + 360.0 * frame / job->n_frames;
    step(job, "rendering");
    const size_t n_findings = job->report.findings.n;
    CtsMeter meter = cts_meter_start(&job->report);
    st = cts_render_frame(job->renderer, azimuth_deg, job->settings.elevation_deg, picture, &job->report, err);
    if (!st && *picture && !job->settings.verify && job->report.key_loss > 0)
        st = verify_key(job, azimuth_deg, *picture, err);
    cts_meter_stop(meter, &job->report, CTS_STAGE_COMPOSITE);
    cli_print_findings(&job->report.findings, n_findings);
    if (st || job->settings.explain)
        return st;
    add_verified(&job->verified, &job->report.verified);
    meter = cts_meter_start(&job->report);
    if (!job->preset->background_none)
        cts_picture_over(*picture, job->preset->background);
    if (job->options->annotate_orientation || job->options->annotate_scale)
        st = cts_annotate(*picture, job->options->annotate_orientation, job->options->annotate_scale, err);
    cts_meter_stop(meter, &job->report, CTS_STAGE_EXPORT);
    if (st || (st = cli_interrupted(err)))
        return st;
    return write_frame(job, frame, err);
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
    for (size_t i = 0; i < job->report.n_skips; i++)
        printf("left out: %s: %s\n", job->report.skips[i].what, job->report.skips[i].why);
}

static void print_verified(const CtsVerified *v)
{
    if (!v->pixels)
        return;
    char psnr[32] = "";
    if (v->rmse > 0)
        snprintf(psnr, sizeof psnr, " (%.1f dB)", -20 * log10(v->rmse));
    cli_note("verified %llu pixels: rmse %.3g%s, largest %.3g at pixel %d,%d", (unsigned long long)v->pixels, v->rmse,
             psnr, v->max, v->worst_x, v->worst_y);
}

static void job_free(Job *job)
{
    for (int f = 0; job->frames && f < job->n_frames; f++)
        cts_picture_free(&job->frames[f]);
    free(job->frames);
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
    for (int frame = 0; frame < n_frames && !st; frame++)
        st = render_frame(&job, frame, err);
    job.report.verified = job.verified;
    cli_progress_clear();
    if (!st && options->render.explain)
        print_plan(&job);
    else if (!st)
        print_verified(&job.verified);
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
