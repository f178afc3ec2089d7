#include "cli/terminal_watch.h"

#include "cli/interrupt.h"
#include "cli/message.h"
#include "cli/progress.h"
#include <string.h>

static void step(void *context, double done, int all, const char *what)
{
    (void)context;
    cli_progress(done, all, what);
}

static void findings(void *context, const CtsReport *report)
{
    CliWatch *seen = context;
    cli_print_findings(&report->findings, seen->n_findings);
    seen->n_findings = report->findings.n;
}

static void found(void *context, const CtsSeriesList *list)
{
    const CliWatch *seen = context;
    for (size_t i = 0; seen->log && seen->names && i < list->n_paths; i++)
        cts_names_add(seen->names, list->paths[i]);
}

static void loaded(void *context)
{
    (void)context;
    cli_interrupt_asks();
}

static void output(void *context, const char *path, const char *format, uint64_t bytes)
{
    const CliWatch *seen = context;
    if (!seen->told_later || strcmp(path, seen->told_later))
        cts_log_output(seen->log, path, format, bytes);
}

CtsWatch cli_watch(CliWatch *seen)
{
    return (CtsWatch){.context = seen,
                      .step = cli_progress_shows() ? step : NULL,
                      .findings = findings,
                      .found = found,
                      .loaded = loaded,
                      .output = output};
}
