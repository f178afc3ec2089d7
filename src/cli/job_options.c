#include "cli/job_options.h"

#include "base/cpu.h"
#include "cli/interrupt.h"
#include "cli/message.h"
#include "cli/remote.h"
#include "cli/words.h"
#include <string.h>

CtsSource cli_source(const CliOptions *options, const CtsPreset *preset)
{
    CtsSource source = {
        .paths = options->operands,
        .n_paths = options->n_operands,
        .from = options->from_given ? &options->from : NULL,
        .net = &options->net,
        .study_uid = options->study_uid,
        .peer_series_uid = options->peer_series_uid,
        .series_uid = options->series_uid,
        .n_threads = options->render.n_threads,
        .remove_table = options->remove_table == CTS_AS_PRESET ? preset->remove_table : options->remove_table == CTS_ON,
        .table_kept_by = options->remove_table == CTS_OFF ? "--remove-table off" : "the preset",
        .linear = options->interpolation == 1,
        .smooth_mm = options->smooth_mm,
        .crop = options->crop_given,
    };
    memcpy(source.crop_low_lps, options->crop_low_lps, sizeof source.crop_low_lps);
    memcpy(source.crop_high_lps, options->crop_high_lps, sizeof source.crop_high_lps);
    return source;
}

void cli_settle_preset(const CliOptions *options, CtsPreset *preset, bool everything)
{
    if (options->background_given) {
        preset->background_none = options->background_none;
        memcpy(preset->background, options->background, sizeof options->background);
    }
    if (options->window_given) {
        preset->window_low_hu = options->window_low_hu;
        preset->window_high_hu = options->window_high_hu;
    }
    const CtsMode mode = options->render.mode >= 0 ? (CtsMode)options->render.mode : preset->mode;
    if (options->window_given && mode == CTS_MODE_COMPOSITE && options->render.grey_bits == 16)
        cli_warning("preset %s: --window changes nothing in mode composite, where the preset says what each HU looks "
                    "like (--mode mip, minip or average shows HU by the window)",
                    preset->name);
    if (everything && options->render.mode >= 0)
        preset->mode = (CtsMode)options->render.mode;
    if (everything && options->render.shade != CTS_AS_PRESET)
        preset->shade = options->render.shade == CTS_ON;
    if (everything && options->remove_table != CTS_AS_PRESET)
        preset->remove_table = options->remove_table == CTS_ON;
}

CtsStatus cli_job(const CliOptions *options, CtsPreset *preset, CtsJob *job, CtsError *err)
{
    CtsStatus st;
    char words[CLI_WORDS_MAX];
    if (!options->n_outputs && !options->render.explain)
        return cts_fail(err, CTS_ERR_USAGE, "render: no output (give -o FILE, ending in %s)",
                        cli_words("{outputs}", words));
    if ((st = cli_remote_check(options, err)))
        return st;
    if (options->state && options->state->preset.name[0])
        *preset = options->state->preset;
    else if ((st = cts_preset_load(options->preset, preset, err)))
        return st;
    cli_settle_preset(options, preset, false);
    *job = (CtsJob){
        .source = cli_source(options, preset),
        .preset = preset,
        .render = options->render,
        .export = {.compression = (CtsScCompression)options->compression,
                   .new_uids = options->new_uids,
                   .deidentify = options->deidentify,
                   .series_number = options->series_number,
                   .series_description = options->series_description,
                   .force = options->force},
        .outputs = {.paths = options->outputs,
                    .n = options->n_outputs,
                    .state = options->write_state,
                    .rotation = options->rotation},
        .options = options->recipe,
        .n_options = options->n_recipe,
        .annotate_orientation = options->annotate_orientation,
        .annotate_scale = options->annotate_scale,
    };
    /* Asked once: what the control groups say takes the system a while. */
    job->source.n_threads = job->render.n_threads = cts_threads(options->render.n_threads);
    job->render.stop = &cli_stop;
    return CTS_OK;
}
