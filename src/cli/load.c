#include "cli/load.h"

#include "cli/message.h"
#include "report/log.h"

static CtsStatus find(const CliOptions *options, CliLoaded *loaded, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    if ((st = cts_series_find(options->operands, options->n_operands, options->render.n_threads, &loaded->list, report,
                              err)) ||
        (st = cts_series_choose(loaded->list, options->series_uid, &loaded->series, err)))
        return st;
    cli_print_findings(&loaded->list->findings, 0);
    if (loaded->list->n > 1 && !options->series_uid)
        cli_note("%zu series found; taking %s, the one with the most slices (%d); --series takes another",
                 loaded->list->n, loaded->series->uid, loaded->series->n_slices);
    return CTS_OK;
}

/* The patient alone, and of it the part that is asked for. */
static CtsStatus cut(const CliOptions *options, const CtsPreset *preset, CtsVolume *volume, CtsReport *report,
                     CtsError *err)
{
    if (options->remove_table != CTS_OFF && preset->remove_table)
        cts_report_skip(report, "table removal", "not in this build");
    if (options->crop_given)
        return cts_volume_crop(volume, options->crop_low_lps, options->crop_high_lps, err);
    return CTS_OK;
}

CtsStatus cli_load(const CliOptions *options, const CtsPreset *preset, void (*step)(void *context, const char *what),
                   void *context, CliLoaded *loaded, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    step(context, "searching");
    CtsMeter meter = cts_meter_start(report);
    if ((st = find(options, loaded, report, err)))
        return st;
    cts_meter_stop(meter, report, CTS_STAGE_SCAN);
    step(context, "reading");
    meter = cts_meter_start(report);
    st = cts_series_load(loaded->series, options->render.n_threads, &loaded->volume, report, err);
    cts_meter_stop(meter, report, CTS_STAGE_DECODE);
    cli_print_findings(&report->findings, 0);
    if (st)
        return st;
    meter = cts_meter_start(report);
    st = cut(options, preset, loaded->volume, report, err);
    cts_meter_stop(meter, report, CTS_STAGE_GREY);
    return st;
}

void cli_loaded_free(CliLoaded *loaded)
{
    cts_volume_free(&loaded->volume);
    cts_series_list_free(&loaded->list);
    loaded->series = NULL;
}
