/* ctsplat info: headers of every series, and the HU range of those that can be rendered. */
#include "cli/commands.h"
#include "cli/progress.h"
#include "output/report/info.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool has_finding(const CtsFindings *findings, const CtsFinding *finding)
{
    for (size_t i = 0; i < findings->n; i++)
        if (!strcmp(findings->items[i].code, finding->code) && !strcmp(findings->items[i].text, finding->text))
            return true;
    return false;
}

/* A series whose pixels are refused is a fact about it, not a failure of info. */
static CtsStatus read_pixels(const CtsSeries *series, int n_threads, CtsPixelFacts *facts, CtsError *err)
{
    CtsReport report = {0};
    CtsError why = {0};
    CtsScanned *scanned = NULL;
    CtsStatus st = cts_series_measure(series, n_threads, &scanned, &report, &why);
    if (!st) {
        cts_pixel_facts(facts, scanned->even);
    } else if (st == CTS_ERR_MEMORY || st == CTS_ERR_INTERRUPTED || st == CTS_ERR_INTERNAL) {
        *err = why;
    } else {
        facts->refused = true;
        snprintf(facts->reason, sizeof facts->reason, "%s", why.text);
        cts_findings_add(&facts->findings, "pixels_refused", CTS_REFUSAL, "%s", why.text);
        st = CTS_OK;
    }
    for (size_t i = 0; i < report.findings.n; i++) {
        const CtsFinding *f = &report.findings.items[i];
        if (!has_finding(&series->findings, f) && !has_finding(&facts->findings, f))
            cts_findings_add(&facts->findings, f->code, f->severity, "%s", f->text);
    }
    cts_scanned_free(&scanned);
    cts_report_free(&report);
    return st;
}

CtsStatus cli_info(const CtsOptions *options, int *exit_code, CtsError *err)
{
    (void)exit_code;
    CtsStatus st;
    CtsSeriesList *list = NULL;
    CtsPixelFacts *facts = NULL;
    if ((st = cts_series_find(options->paths.items, options->paths.n, options->render.n_threads, &list, NULL, err)))
        goto end;
    facts = calloc(list->n + 1, sizeof *facts);
    if (!facts) {
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        goto end;
    }
    for (size_t i = 0; i < list->n; i++) {
        cli_progress((int)i, (int)list->n, "reading");
        if (list->items[i].renderable && (st = read_pixels(&list->items[i], options->render.n_threads, &facts[i], err)))
            goto end;
    }
    cli_progress_clear();
    if (options->json)
        st = cts_info_print_json(stdout, list, facts, options->show_patient, err);
    else
        cts_info_print(stdout, list, facts, options->show_patient);
end:
    cli_progress_clear();
    for (size_t i = 0; facts && i < list->n; i++)
        cts_findings_free(&facts[i].findings);
    free(facts);
    cts_series_list_free(&list);
    return st;
}
