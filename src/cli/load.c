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
        cli_warning("%zu series found; taking %s, the one with the most slices (%d); --series takes another",
                    loaded->list->n, loaded->series->uid, loaded->series->n_slices);
    return CTS_OK;
}

/* The patient alone, and of it the part that is asked for. */
static CtsStatus cut(const CliOptions *options, const CtsPreset *preset, CtsVolume *volume, CtsReport *report,
                     CtsError *err)
{
    CtsStatus st = CTS_OK;
    const bool remove_table =
        options->remove_table == CTS_AS_PRESET ? preset->remove_table : options->remove_table == CTS_ON;
    const size_t n_findings = report->findings.n;
    /* The table is told from the patient by the whole, so it goes before the crop. */
    if (remove_table && options->crop_given)
        st = cts_volume_remove_table_within(volume, options->crop_low_lps, options->crop_high_lps,
                                            options->render.n_threads, report, err);
    else if (remove_table)
        st = cts_volume_remove_table(volume, options->render.n_threads, report, err);
    else
        cts_report_skip(report, "table removal", "off by %s",
                        options->remove_table == CTS_OFF ? "--remove-table off" : "the preset");
    cli_print_findings(&report->findings, n_findings);
    if (!st && options->crop_given)
        st = cts_volume_crop(volume, options->crop_low_lps, options->crop_high_lps, err);
    return st;
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
