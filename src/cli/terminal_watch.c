#include "cli/terminal_watch.h"

#include "base/clock.h"
#include "cli/interrupt.h"
#include "cli/message.h"
#include "cli/progress.h"
#include <stdio.h>
#include <string.h>

/* Steps after searching and reading are frames, which take about as long each. */
static void step(void *context, double done, int all, const char *what)
{
    enum { FIRST_FRAME = 2 };
    CliWatch *seen = context;
    char text[128];
    const double now_ms = cts_wall_ms(), frames = done - FIRST_FRAME;
    if (frames <= 0)
        seen->frames_start_ms = now_ms;
    const bool knows = all > FIRST_FRAME + 1 && frames >= 1;
    snprintf(text, sizeof text, "%s%s", what,
             cli_time_left(knows ? (now_ms - seen->frames_start_ms) / 1000 / frames * (all - done) : -1).text);
    cli_progress(done, all, text);
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
