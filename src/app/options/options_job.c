#include "app/options/options.h"

#include "base/cpu.h"
#include "base/stage_timer.h"
#include <stdlib.h>
#include <string.h>

CtsSource cts_options_source(const CtsOptions *options)
{
    CtsSource source = options->source;
    source.paths = options->paths.items;
    source.n_paths = options->paths.n;
    source.from = options->from.given ? &options->from.peer : NULL;
    source.net = &options->net;
    source.state = options->state;
    source.fetched = &options->find;
    source.labels = options->labels.items;
    source.n_labels = options->labels.n;
    source.choice.appearances = options->label_appearances.items;
    source.choice.n_appearances = options->label_appearances.n;
    source.stop = options->net.stop;
    source.n_threads = options->render.n_threads;
    source.table_kept_by = options->remove_table == CTS_OFF ? "--remove-table off" : "the preset";
    return source;
}

CtsJob cts_options_job(const CtsOptions *options)
{
    CtsJob job = {
        .source = cts_options_source(options),
        .render = options->render,
        .export = options->export,
        .outputs = {.paths = options->outputs.items,
                    .n = options->outputs.n,
                    .state = options->write_state,
                    .rotation = options->rotation},
        .swivel_step_deg = options->swivel_step_deg,
        .options = options->recipe,
        .n_options = options->n_recipe,
        .annotate = options->annotate,
        .montage = options->montage.n ? &options->montage : NULL,
    };
    /* The preset has them. */
    job.render.mode = -1;
    job.render.shade = CTS_AS_PRESET;
    job.render.occlusion = CTS_OCCLUSION_AS_PRESET;
    return job;
}

static void settle_preset(const CtsOptions *options, CtsPreset *preset, CtsReport *report)
{
    const bool was_inverted = preset->window_low_hu > preset->window_high_hu;
    if (options->background.given) {
        preset->background_none = options->background.none;
        memcpy(preset->background, options->background.rgb, sizeof preset->background);
    }
    if (options->window.given) {
        preset->window_low_hu = options->window.low_hu;
        preset->window_high_hu = options->window.high_hu;
        preset->window_absolute = true;
    } else if (options->render.mode > CTS_MODE_COMPOSITE && !options->preset) {
        preset->window_low_hu = preset->window_high_hu = 0; /* empty: one that fits (app/job/auto_window.h) */
    }
    if (options->render.mode >= 0) {
        /* The air around the body would be all that minip and average show. */
        preset->remove_table |= options->render.mode >= CTS_MODE_MINIP && preset->mode < CTS_MODE_MINIP;
        preset->mode = (CtsMode)options->render.mode;
    }
    const bool is_inverted = preset->window_low_hu > preset->window_high_hu;
    if (is_inverted != was_inverted && preset->mode != CTS_MODE_COMPOSITE && !options->background.given)
        for (int c = 0; c < 3; c++)
            preset->background[c] = is_inverted; /* as the lowest values */
    if (options->render.shade != CTS_AS_PRESET)
        preset->shade = options->render.shade == CTS_ON;
    if (options->render.occlusion != CTS_OCCLUSION_AS_PRESET)
        preset->occlusion = options->render.occlusion;
    if (options->render.occlusion > 0 && !(preset->shade && preset->mode == CTS_MODE_COMPOSITE))
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_OCCLUSION_UNUSED,
            "preset %s: `ambient-occlusion` darkens a lit picture alone (`shade` on lights mode composite)",
            preset->name);
    if (options->remove_table != CTS_AS_PRESET)
        preset->remove_table = options->remove_table == CTS_ON;
    if (options->window.given && preset->mode == CTS_MODE_COMPOSITE && options->render.grey_bits == 16)
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_WINDOW_UNUSED,
            "preset %s: `window` changes nothing in mode composite, where the preset gives each HU its "
            "colour and opacity (`mode` mip, minip or average shows HU by the window)",
            preset->name);
}

CtsStatus cts_options_preset(const CtsOptions *options, const char *name_or_file, CtsPreset *preset, CtsReport *report,
                             CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (options->state && options->state->preset.name[0])
        *preset = options->state->preset;
    else
        st = cts_preset_load(name_or_file ? name_or_file : "bone", preset, err);
    if (!st)
        settle_preset(options, preset, report);
    return st;
}

void cts_options_report_objects(const CtsOptions *options, bool any_object, const char *but, CtsReport *report)
{
    char endings[CTS_VALUE_LISTS_MAX];
    for (const CtsOption *o = cts_options; o->name && !any_object; o++)
        if (o->remakes == CTS_REMAKES_OBJECT && cts_options_given(options, o->name) && strcmp(o->name, but))
            cts_report_diagnostic(report, CTS_DIAGNOSTIC_NO_OBJECT_OUTPUT, "`%s` acts on %s outputs, and there is none",
                                  o->name, cts_value_lists("{objects}", endings));
}

CtsStatus cts_options_one_job(const CtsOptions *options, CtsPreset *preset, CtsJob *job, CtsReport *report,
                              CtsError *err)
{
    CtsStatus st;
    *job = cts_options_job(options);
    if ((st = cts_options_preset(options, options->preset, preset, options->preset ? report : NULL, err)))
        return st;
    cts_job_set_preset(job, preset);
    /* Determined once, since reading the control groups is slow. */
    job->source.n_threads = job->render.n_threads = cts_threads(options->render.n_threads);
    bool any = options->write_state != NULL, shown = options->format && options->format->is_object;
    for (int i = 0; i < options->outputs.n; i++)
        any |= cts_output_is_dicom(&job->outputs, i);
    cts_options_report_objects(options, any || shown, "", report);
    return options->send.given && !any
               ? cts_fail(err, CTS_ERR_USAGE, "`send`: there is no DICOM output to send (give `output` FILE.dcm)")
               : CTS_OK;
}

CtsStatus cts_options_settle(const CtsOptions *options, CtsModality modality, CtsQuantity quantity, CtsPreset *preset,
                             CtsJob *job, CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (int i = 0; i < options->montage.n && !st; i++)
        if (options->montage.tiles[i].preset)
            st = cts_preset_check(options->montage.tiles[i].preset, modality, quantity, err);
    if (st || options->preset)
        return st ? st : cts_preset_check(preset, modality, quantity, err);
    const char *const name = cts_preset_default(modality, quantity, options->render.mode == CTS_MODE_COMPOSITE);
    if ((st = cts_options_preset(options, name, preset, report, err)))
        return st;
    cts_job_set_preset(job, preset);
    return cts_job_check(job, report, err);
}

CtsStatus cts_options_run_job(const CtsOptions *options, CtsPreset *preset, CtsJob *job, const CtsWatch *watch,
                              CtsReport *report, CtsError *err)
{
    CtsLoaded loaded = {0};
    CtsStatus st = cts_job_find(job, watch, &loaded, report, err);
    const CtsSeries *const s = loaded.series;
    if (!st && s->renderable)
        st = cts_options_settle(options, s->modality_id, s->quantity, preset, job, report, err);
    cts_watch_diagnostics(watch, report);
    if (!st)
        st = cts_job_run(job, watch, &loaded, report, err);
    const CtsStageTimer meter = cts_stage_timer_start(report);
    cts_loaded_free(&loaded);
    cts_stage_timer_stop(meter, report, CTS_STAGE_EXPORT);
    return st;
}

CtsStatus cts_options_send(const CtsOptions *options, CtsReport *report, CtsError *err)
{
    CtsNet net = options->net;
    int n = 0, n_sent = 0;
    const CtsOutputs outputs = {.paths = options->outputs.items, .n = options->outputs.n};
    if (!options->send.given)
        return CTS_OK;
    const char **paths = calloc((size_t)outputs.n + 1, sizeof *paths);
    if (!paths)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int i = 0; i < outputs.n; i++)
        if (cts_output_is_dicom(&outputs, i))
            paths[n++] = outputs.paths[i];
    if (options->write_state)
        paths[n++] = options->write_state;
    net.report = report;
    const CtsStatus st = cts_net_send(&options->send.peer, &net, paths, n, &n_sent, err);
    free(paths);
    return st;
}
