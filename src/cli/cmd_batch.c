/* ctsplat batch: the command line as a batch, its progress, its contact sheet. */
#include "app/batch/batch.h"
#include "app/contact/contact_sheet.h"
#include "base/clock.h"
#include "cli/commands.h"
#include "cli/terminal.h"
#include <stdio.h>
#include <string.h>

static void on_message(void *context, bool is_warning, const char *text)
{
    (void)context;
    cli_message(is_warning ? "warning: " : "", "%s", text);
}

static void on_series(void *context, const char *text, bool failed)
{
    (void)context;
    if (failed)
        cli_warning("%s", text);
    else if (!cli_progress_shows())
        cli_note("%s", text);
}

static void on_progress(void *context, const CtsBatchProgress *p)
{
    double *const reported_ms = context;
    char text[160];
    if (p->n_files)
        snprintf(text, sizeof text, "searching: %llu files so far, still counting", (unsigned long long)p->n_files);
    else
        snprintf(text, sizeof text, "%zu of %zu series, %zu pictures%s", p->n_ended, p->n_series, p->n_pictures,
                 cli_time_left(p->seconds_left).text);
    /* On a terminal at once, else a line a minute. */
    if (cli_progress_shows()) {
        cli_progress((double)p->n_ended, p->n_files ? 1 : (int)p->n_series, text);
    } else if (cts_wall_ms() - *reported_ms >= 60000) {
        *reported_ms = cts_wall_ms();
        cli_note("%s", text);
    }
}

static CtsStatus run_batch(const CtsOptions *options, CtsBatchLists *lists, CtsReport *report, CtsBatchResult *result,
                           CtsError *err)
{
    double reported_ms = cts_wall_ms();
    CtsBatchSettings settings = {
        .options = options,
        .lists = lists,
        .listener = {.message = on_message, .series = on_series, .progress = on_progress, .context = &reported_ms}};
    CtsStatus st = cts_batch_open_folder(&settings, err);
    if (!st)
        st = cts_batch_check(&settings, report, err);
    cli_print_diagnostics(&report->diagnostics, 0);
    cts_diagnostics_free(&report->diagnostics);
    return st ? st : cts_batch_run(&settings, result, err);
}

/* Fetches and renders one series after the other, so that no more than one is on the disk. Reports and counts those
 * that cannot be fetched. */
static CtsStatus run_each(const CtsOptions *options, const CtsFound *found, CtsBatchLists *lists, CtsReport *report,
                          CtsBatchResult *all, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (int i = 0; i < found->n && !st; i++) {
        const CtsFoundSeries *s = &found->items[i];
        CtsFetched fetched;
        CtsOptions one = *options;
        const CtsSeriesQuery wanted = {
            .study_uid = s->study_uid, .series_uid = s->series_uid, .patient_id = options->find.patient_id};
        st = cts_net_fetch(&options->from.peer, &options->net, &wanted, &fetched, report, err);
        if (!st) {
            one.paths = (CtsTextList){(const char **)&fetched.folder, 1};
            st = run_batch(&one, lists, report, all, err);
        } else if (st == CTS_ERR_READ || st == CTS_ERR_NO_SERIES) {
            cli_warning("%s: not fetched: %s", s->series_uid, err->text);
            all->n_series++;
            all->n_uids++;
            all->n_failed++;
            st = CTS_OK;
        }
        cts_net_fetched_remove(&fetched);
    }
    return st;
}

static CtsStatus run_found(const CtsOptions *options, CtsBatchLists *lists, CtsReport *report, CtsBatchResult *all,
                           CtsError *err)
{
    CtsFound found;
    CtsNet net = options->net;
    net.report = report;
    CtsStatus st = cts_net_find(&options->from.peer, &net, &options->find, &found, err);
    cli_print_diagnostics(&report->diagnostics, 0);
    cts_diagnostics_free(&report->diagnostics);
    if (!st && !found.n)
        st = cts_fail(err, CTS_ERR_NO_SERIES, "the peer has no such series (ctsplat info --from lists what it has)");
    st = st ? cts_context(err, "`from`") : run_each(options, &found, lists, report, all, err);
    cts_found_free(&found);
    return st;
}

/* Appends a count that is not 0. */
static void add_count(char *text, size_t size, const char *before, size_t n, const char *after)
{
    const size_t used = strlen(text);
    if (n)
        snprintf(text + used, size - used, "%s%zu%s", before, n, after);
}

static void print_summary(const CtsOptions *options, const CtsBatchResult *r)
{
    char text[300] = "";
    add_count(text, sizeof text, " (", r->n_up_to_date, " of them in earlier runs)");
    add_count(text, sizeof text, ", ", r->n_thumbnails,
              r->n_thumbnails == 1 ? " thumbnail (no volumes)" : " thumbnails (no volumes)");
    add_count(text, sizeof text, ", ", r->n_skipped, " skipped");
    add_count(text, sizeof text, ", ", r->n_waiting, " waiting for their last files");
    if (r->n_refused || r->n_failed)
        snprintf(text + strlen(text), sizeof text - strlen(text), ", %zu refused, %zu failed", r->n_refused,
                 r->n_failed);
    cli_note("%zu of %zu series%s done%s: %s (index.html shows them, batch.jsonl lists files and reasons)", r->n_done,
             r->n_series, r->n_series > r->n_uids ? " (some UIDs hold several)" : "", text, options->output_dir);
    if (r->n_unreadable)
        cli_note("files that cannot be read: %llu", (unsigned long long)r->n_unreadable);
    if (r->n_objects)
        cli_note("objects without an image (reports, plans, labels): %llu", (unsigned long long)r->n_objects);
    if (r->n_packed)
        cli_note("packed files that are not looked into: %llu (a zip file may be a PATH; unpack others)",
                 (unsigned long long)r->n_packed);
}

CtsStatus cli_batch(const CtsOptions *options, int *exit_code, CtsError *err)
{
    CtsStatus st;
    CtsBatchLists lists = {0};
    CtsReport report = {0};
    CtsBatchResult result = {0};
    if (options->merge) {
        if (options->paths.n || options->output_dir)
            return cts_fail(err, CTS_ERR_USAGE, "batch: --merge DIR renders nothing (leave PATH and -O away)");
        return cts_contact_sheet_write(options->merge, &(CtsContactWanted){0}, err);
    }
    if (!options->paths.n && !options->from.given)
        return cts_fail(err, CTS_ERR_USAGE, "batch: PATH is missing (see ctsplat batch --help)");
    if (!options->output_dir)
        return cts_fail(err, CTS_ERR_USAGE, "batch: no folder to write into (give -O DIR)");
    if (options->settled_s && options->from.given)
        return cts_fail(err, CTS_ERR_USAGE, "batch: --settled is about files that come to a PATH, not for --from");
    cli_interrupt_sets_stop();
    if (!(st = cts_batch_lists(options, &lists, &report, err)))
        st = options->from.given ? run_found(options, &lists, &report, &result, err)
                                 : run_batch(options, &lists, &report, &result, err);
    cli_progress_clear();
    if (result.n_series && !result.is_idle)
        print_summary(options, &result);
    if (st == CTS_ERR_INTERRUPTED)
        cts_fail(err, st, "interrupted (the same command resumes the batch)");
    if (!st && result.n_done + result.n_thumbnails + result.n_skipped + result.n_waiting < result.n_series)
        *exit_code = 8;
    cts_batch_lists_free(&lists);
    cts_report_free(&report);
    return st;
}
