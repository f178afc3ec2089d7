/* ctsplat info: headers of every series, and the HU range of those that can be rendered. */
#include "app/job/pipeline.h"
#include "app/options/options.h"
#include "base/json.h"
#include "base/text.h"
#include "cli/commands.h"
#include "cli/terminal.h"
#include "output/report/info.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A series whose pixels are refused is a fact about it, not a failure of info; labels that are refused are one. */
static CtsStatus read_pixels(const CtsSource *source, const CtsSeries *series, CtsPixelFacts *facts, CtsError *err)
{
    CtsReport report = {0};
    CtsError why = {0};
    CtsLoaded loaded = {.series = series};
    CtsStatus st = cts_source_labels(source, &loaded, &report, err);
    if (st)
        goto end;
    st = loaded.labels ? cts_source_read(source, &loaded, &report, &why)
                       : cts_series_scan(series, NULL, source->n_threads, &loaded.scanned, &report, &why);
    if (!st) {
        cts_pixel_facts(facts, loaded.scanned->even);
        cts_source_report_fill(source, loaded.scanned, &report);
        facts->has_labels = loaded.labels;
    } else if (st == CTS_ERR_MEMORY || st == CTS_ERR_INTERRUPTED || st == CTS_ERR_INTERNAL) {
        *err = why;
    } else {
        facts->refused = true;
        snprintf(facts->reason, sizeof facts->reason, "%s", why.text);
        cts_diagnostics_add(&facts->diagnostics, CTS_DIAGNOSTIC_PIXELS_REFUSED, "%s", why.text);
        st = CTS_OK;
    }
    facts->labels = report.labels;
    facts->n_labels = report.n_labels;
    report.labels = NULL;
    report.n_labels = 0;
    for (size_t i = 0; i < report.diagnostics.n; i++) {
        const CtsDiagnostic *d = &report.diagnostics.items[i];
        if (!cts_diagnostics_have(&series->diagnostics, d) && !cts_diagnostics_have(&facts->diagnostics, d))
            cts_diagnostics_add(&facts->diagnostics, d->id, "%s", d->text);
    }
end:
    cts_loaded_free(&loaded);
    cts_report_free(&report);
    return st;
}

/* Labels belong to the series that they refer to; with `auto` each has its own. */
static CtsStatus read_each_series(const CtsOptions *options, const CtsSeriesList *list, CtsPixelFacts *facts,
                                  CtsError *err)
{
    const CtsSource source = cts_options_source(options);
    CtsSource plain = source;
    const CtsSeries *labelled = NULL;
    const CtsLabelRequest request = {.paths = source.labels, .n_paths = source.n_labels};
    plain.n_labels = 0;
    CtsStatus st = source.n_labels ? cts_labels_choose(&request, list, &labelled, err) : CTS_OK;
    bool beside = true;
    for (int i = 0; i < source.n_labels; i++)
        beside &= !strcmp(source.labels[i], "auto");
    for (size_t i = 0; i < list->n && !st; i++) {
        const CtsSeries *const s = &list->items[i];
        cli_progress((int)i, (int)list->n, "reading");
        if (s->renderable && !facts[i].left_out)
            st = read_pixels(beside || s == labelled ? &source : &plain, s, &facts[i], err);
    }
    return st;
}

/* Text from a peer must not contain control sequences for the terminal. */
static void print_text(const char *name, const char *text)
{
    char clean[80];
    snprintf(clean, sizeof clean, "%s", text);
    cts_text_clean(clean);
    printf("  %-16s %s\n", name, clean);
}

static void print_found(const CtsFound *found, bool show_patient)
{
    printf("%d series found\n", found->n);
    for (int i = 0; i < found->n; i++) {
        const CtsFoundSeries *s = &found->items[i];
        printf("\nseries %s\n", s->series_uid);
        print_text("study", s->study_uid);
        print_text("modality", s->modality);
        if (s->n_objects)
            printf("  %-16s %d\n", "objects", s->n_objects);
        if (show_patient)
            print_text("study date", s->study_date);
        if (show_patient)
            print_text("description", s->description);
    }
}

static json_t *found_json(const CtsFound *found, bool show_patient)
{
    json_t *series = json_array();
    for (int i = 0; i < found->n; i++) {
        const CtsFoundSeries *s = &found->items[i];
        json_array_append_new(series, json_pack("{s:s,s:s,s:o,s:o,s:o*,s:o*}", "series_uid", s->series_uid, "study_uid",
                                                s->study_uid, "modality", cts_json_new_text(s->modality), "objects",
                                                s->n_objects ? json_integer(s->n_objects) : json_null(), "study_date",
                                                show_patient ? cts_json_new_text(s->study_date) : NULL, "description",
                                                show_patient ? cts_json_new_text(s->description) : NULL));
    }
    return json_pack("{s:o}", "series", series);
}

/* Lists the peer's series without fetching any. */
static CtsStatus report_found(const CtsOptions *options, CtsError *err)
{
    CtsFound found;
    CtsReport report = {0};
    CtsNet net = options->net;
    net.report = &report;
    cli_interrupt_sets_stop();
    CtsStatus st = cts_net_find(&options->from.peer, &net, &options->find, &found, err);
    cli_print_diagnostics(&report.diagnostics, 0);
    cts_report_free(&report);
    if (!st && !found.n)
        st = cts_fail(err, CTS_ERR_NO_SERIES, "the peer has no such series");
    if (st)
        st = cts_context(err, "`from`");
    else if (options->json)
        st = cli_print_json(found_json(&found, options->show_patient), err);
    else
        print_found(&found, options->show_patient);
    cts_found_free(&found);
    return st;
}

/* Leaves out series of other modalities than those of a list (NULL: none). */
static CtsStatus choose_modalities(const char *modalities, const CtsSeriesList *list, CtsPixelFacts *facts,
                                   CtsError *err)
{
    size_t n = 0;
    for (size_t i = 0; i < list->n; i++) {
        facts[i].left_out = modalities && !cts_text_lists(modalities, list->items[i].modality);
        n += !facts[i].left_out;
    }
    return n ? CTS_OK
             : cts_fail(err, CTS_ERR_NO_SERIES, "none of the %zu series is of `modality` %s", list->n, modalities);
}

CtsStatus cli_info(const CtsOptions *options, int *exit_code, CtsError *err)
{
    (void)exit_code;
    CtsStatus st;
    if (options->from.given)
        return report_found(options, err);
    CtsSeriesList *list = NULL;
    CtsPixelFacts *facts = NULL;
    const CtsSeriesSearch search = {.paths = options->paths.items,
                                    .n_paths = options->paths.n,
                                    .n_threads = options->render.n_threads,
                                    .images = true,
                                    .rules = options->source.rules};
    if ((st = cts_series_search(&search, &list, NULL, err)))
        goto end;
    facts = calloc(list->n + 1, sizeof *facts);
    if (!facts) {
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        goto end;
    }
    if ((st = choose_modalities(cts_options_given(options, "modality"), list, facts, err)) ||
        (st = read_each_series(options, list, facts, err)))
        goto end;
    cli_progress_clear();
    if (options->json)
        st = cli_print_json(cts_info_list_json(list, facts, options->show_patient), err);
    else
        cts_info_print(stdout, list, facts, options->show_patient);
end:
    cli_progress_clear();
    for (size_t i = 0; facts && i < list->n; i++) {
        cts_report_free(&(CtsReport){.labels = facts[i].labels, .n_labels = facts[i].n_labels});
        cts_diagnostics_free(&facts[i].diagnostics);
    }
    free(facts);
    cts_series_list_free(&list);
    return st;
}
