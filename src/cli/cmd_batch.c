/* ctsplat batch: the command line as a batch, its progress, its contact sheet. */
#include "app/batch/batch.h"
#include "app/batch/work.h"
#include "cli/interrupt.h"
#include "cli/job_options.h"
#include "cli/message.h"
#include "cli/progress.h"
#include "cli/values.h"
#include "app/contact/contact_sheet.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* What the lists of the command line say. */
typedef struct Lists {
    char *texts[3]; /* copies that the names point into */
    const char **preset_names, **view_texts, **formats;
    CtsPreset *presets;
    CtsBatchView *views;
    int n_presets, n_views, n_formats;
    char *options, *dcm_options;
    char send_to[1100]; /* "": nothing is sent */
} Lists;

static void lists_free(Lists *l)
{
    for (int i = 0; i < 3; i++)
        free(l->texts[i]);
    free(l->preset_names);
    free(l->view_texts);
    free(l->formats);
    free(l->presets);
    free(l->views);
    free(l->options);
    free(l->dcm_options);
}

/* The parts of text between commas; *items points into *copy. */
static CtsStatus split(const char *option, const char *text, char **copy, const char ***items, int *n, CtsError *err)
{
    *n = 0;
    *copy = strdup(text);
    *items = calloc(strlen(text) + 2, sizeof **items);
    if (!*copy || !*items)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (char *at = *copy; at;) {
        char *comma = strchr(at, ',');
        if (comma)
            *comma++ = 0;
        if (!*at)
            return cts_fail(err, CTS_ERR_USAGE, "--%s %s: an empty name between commas", option, text);
        (*items)[(*n)++] = at;
        at = comma;
    }
    return CTS_OK;
}

static CtsStatus take_presets(const CliOptions *options, Lists *l, CtsError *err)
{
    CtsStatus st = split("presets", options->presets ? options->presets : options->preset, &l->texts[0],
                         &l->preset_names, &l->n_presets, err);
    if (st)
        return st;
    if (!(l->presets = calloc((size_t)l->n_presets, sizeof *l->presets)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int i = 0; i < l->n_presets && !st; i++) {
        if ((st = cts_preset_load(l->preset_names[i], &l->presets[i], err)))
            break;
        cli_settle_preset(options, &l->presets[i], true);
        for (int k = 0; k < i && !st; k++)
            if (!strcmp(l->presets[k].name, l->presets[i].name))
                st = cts_fail(err, CTS_ERR_USAGE, "--presets: two are called %s (give one of them another name)",
                              l->presets[i].name);
    }
    return st;
}

/* A view by numbers holds a comma itself. */
static CtsStatus take_views(const CliOptions *options, Lists *l, CtsError *err)
{
    const char *text = options->views ? options->views : "anterior";
    for (int i = 0; !options->views && cli_options[i].name; i++)
        if (!strcmp(cli_options[i].name, "view") && options->given[i])
            text = options->given[i];
    CtsStatus st = split("views", text, &l->texts[1], &l->view_texts, &l->n_views, err);
    if (st)
        return st;
    if (!(l->views = calloc((size_t)l->n_views, sizeof *l->views)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    int n = 0;
    for (int i = 0; i < l->n_views && !st; i++) {
        CliOptions parsed = {0};
        double number;
        const char *name = l->view_texts[i];
        if (cli_number(name, &number) && i + 1 < l->n_views)
            l->texts[1][l->view_texts[++i] - l->texts[1] - 1] = ',';
        st = cli_parse_view(&parsed, name, err);
        for (int k = 0; k < n && !st; k++)
            if (!strcmp(l->views[k].name, name))
                st = cts_fail(err, CTS_ERR_USAGE, "--views: %s twice", name);
        l->views[n++] = (CtsBatchView){name, parsed.render.azimuth_deg, parsed.render.elevation_deg};
    }
    l->n_views = n;
    return st;
}

static CtsStatus take_formats(const CliOptions *options, Lists *l, CtsError *err)
{
    static const char *const known[] = {"png", "exr", "dcm"};
    CtsStatus st =
        split("formats", options->formats ? options->formats : "png", &l->texts[2], &l->formats, &l->n_formats, err);
    for (int i = 0; i < l->n_formats && !st; i++) {
        bool found = false;
        for (int k = 0; k < 3; k++)
            found |= !strcmp(l->formats[i], known[k]);
        if (!found)
            return cts_fail(err, CTS_ERR_USAGE, "--formats %s: not one of: png exr dcm", l->formats[i]);
        for (int k = 0; k < i; k++)
            if (!strcmp(l->formats[k], l->formats[i]))
                return cts_fail(err, CTS_ERR_USAGE, "--formats: %s twice", l->formats[i]);
    }
    return st;
}

static CtsStatus take_peer(const CliOptions *options, Lists *l, CtsError *err)
{
    const CtsPeer *p = &options->send;
    bool any = false;
    if (!options->send_given)
        return CTS_OK;
    for (int i = 0; i < l->n_formats; i++)
        any |= !strcmp(l->formats[i], "dcm");
    if (!any)
        return cts_fail(err, CTS_ERR_USAGE, "--send: there is no DICOM output to send (give --formats dcm)");
    if (p->web)
        snprintf(l->send_to, sizeof l->send_to, "%s", p->url);
    else
        snprintf(l->send_to, sizeof l->send_to, "%s@%s:%d", p->aet, p->host, p->port);
    return cts_net_check(&options->net, err);
}

static CtsStatus take_lists(const CliOptions *options, Lists *l, CtsError *err)
{
    CtsStatus st;
    if ((st = take_presets(options, l, err)) || (st = take_views(options, l, err)) ||
        (st = take_formats(options, l, err)) || (st = take_peer(options, l, err)))
        return st;
    l->options = cli_options_text(options, CLI_TOUCHES_PICTURES);
    l->dcm_options = cli_options_text(options, CLI_TOUCHES_DCM);
    return l->options && l->dcm_options ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

static void on_warning(void *context, const char *text)
{
    (void)context;
    cli_progress_clear();
    cli_warning("%s", text);
}

static void on_series(void *context, const char *text, bool failed)
{
    (void)context;
    if (failed) {
        cli_progress_clear();
        cli_warning("%s", text);
    } else if (!cli_progress_shows()) {
        cli_note("%s", text);
    }
}

static void on_progress(void *context, size_t done, size_t all, double seconds_left)
{
    char text[120], left[48] = "";
    (void)context;
    if (seconds_left >= 5400)
        snprintf(left, sizeof left, ", about %.1f hours left", seconds_left / 3600);
    else if (seconds_left >= 90)
        snprintf(left, sizeof left, ", about %.0f minutes left", seconds_left / 60);
    else if (seconds_left >= 0)
        snprintf(left, sizeof left, ", about %.0f seconds left", seconds_left);
    snprintf(text, sizeof text, "%zu of %zu series%s", done, all, left);
    cli_progress((int)done, (int)all, text);
}

static CtsJob base_job(const CliOptions *options)
{
    const CtsPreset none = {0};
    CtsJob job = {
        .source = cli_source(options, &none),
        .render = options->render,
        .export = {.compression = (CtsScCompression)options->compression,
                   .new_uids = options->new_uids,
                   .deidentify = options->deidentify,
                   .series_number = options->series_number,
                   .series_description = options->series_description,
                   .force = true},
        .outputs = {.rotation = options->rotation},
        .annotate_orientation = options->annotate_orientation,
        .annotate_scale = options->annotate_scale,
    };
    /* The presets have them. */
    job.render.mode = -1;
    job.render.shade = CTS_AS_PRESET;
    job.render.stop = &cli_stop;
    return job;
}

static CtsStatus run(const CliOptions *options, Lists *lists, CtsBatchResult *result, CtsError *err)
{
    CtsReport report = {0};
    CtsBatchJob job = {.job = base_job(options),
                       .log = options->log,
                       .command = options->command,
                       .peer = &options->send,
                       .net = &options->net};
    const CtsBatchSettings settings = {
        .paths = options->operands,
        .n_paths = options->n_operands,
        .folder = options->output_dir,
        .series_uid = options->series_uid,
        .presets = lists->presets,
        .n_presets = lists->n_presets,
        .views = lists->views,
        .n_views = lists->n_views,
        .formats = lists->formats,
        .n_formats = lists->n_formats,
        .rotation = options->rotation,
        .options_text = lists->options,
        .dcm_options_text = lists->dcm_options,
        .shard = options->shard,
        .n_shards = options->n_shards,
        .n_jobs = options->jobs,
        .n_threads = options->render.n_threads,
        .series_timeout_s = options->series_timeout_s,
        .series_bytes = (uint64_t)(options->series_mib * 1048576),
        .fresh = options->fresh,
        .show_patient = options->show_patient,
        .work = cts_batch_render,
        .send_to = lists->send_to[0] ? lists->send_to : NULL,
        .send = cts_batch_send,
        .context = &job,
        .told = {.warning = on_warning, .series = on_series, .progress = on_progress},
        .stop = &cli_stop,
    };
    job.settings = &settings;
    CtsStatus st = cts_batch_open_folder(&settings, err);
    if (!st)
        st = cts_batch_check(&job, &report, err);
    cli_print_findings(&report.findings, 0);
    cts_report_free(&report);
    return st ? st : cts_batch_run(&settings, result, err);
}

static void print_summary(const CliOptions *options, const CtsBatchResult *r)
{
    char bad[80] = "", stood[64] = "";
    if (r->n_stood)
        snprintf(stood, sizeof stood, " (%zu of them before)", r->n_stood);
    if (r->n_refused || r->n_failed)
        snprintf(bad, sizeof bad, ", %zu refused, %zu failed", r->n_refused, r->n_failed);
    cli_note("%zu of %zu series done%s%s: %s", r->n_done, r->n_series, stood, bad, options->output_dir);
}

CtsStatus cli_batch(const CliOptions *options, int *exit_code, CtsError *err)
{
    CtsStatus st;
    Lists lists = {0};
    CtsBatchResult result = {0};
    if (options->merge) {
        if (options->n_operands || options->output_dir)
            return cts_fail(err, CTS_ERR_USAGE, "batch: --merge DIR renders nothing (leave PATH and -O away)");
        return cts_contact_sheet_write(options->merge, err);
    }
    if (!options->n_operands)
        return cts_fail(err, CTS_ERR_USAGE, "batch: PATH is missing (see ctsplat batch --help)");
    if (!options->output_dir)
        return cts_fail(err, CTS_ERR_USAGE, "batch: no folder to write into (give -O DIR)");
    if (options->fresh && options->resume)
        return cts_fail(err, CTS_ERR_USAGE, "batch: --fresh starts over, --resume does not: give one of them");
    cli_interrupt_asks();
    if (!(st = take_lists(options, &lists, err)))
        st = run(options, &lists, &result, err);
    cli_progress_clear();
    if (result.n_series && options->n_shards == 1) {
        CtsError sheet_err;
        const CtsStatus sheet = cts_contact_sheet_write(options->output_dir, &sheet_err);
        if (sheet && !st) {
            *err = sheet_err;
            st = sheet;
        }
    }
    if (result.n_series)
        print_summary(options, &result);
    if (!st && result.n_done < result.n_series)
        *exit_code = 8;
    lists_free(&lists);
    return st;
}
