#include "cli/terminal.h"

#include "base/clock.h"
#include "output/report/info.h"
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

const char *cli_with_options(const char *text, char *out, size_t size)
{
    snprintf(out, size, "%s", text);
    for (char *at = out; (at = strchr(at, '`')); at++) {
        const size_t n = strcspn(at + 1, "`");
        if (n == 0 || at[1 + n] != '`' || !cts_option(at + 1, n))
            continue;
        memmove(at + 2, at + 1, n);
        at[0] = at[1] = '-';
        at += 1 + n;
    }
    return out;
}

static const char full_bar[] = "########################";
enum { BAR_WIDTH = sizeof full_bar - 1 };

/* The bar on the terminal, "" for none: it is drawn again only when it changes. */
static char drawn[200];

bool cli_progress_shows(void)
{
    const char *term = getenv("TERM");
    return isatty(STDERR_FILENO) && term && strcmp(term, "dumb");
}

void cli_progress(double done, int all, const char *what)
{
    if (!cli_progress_shows())
        return;
    const int filled = all > 0 ? (int)(BAR_WIDTH * done / all) : 0;
    char line[sizeof drawn];
    snprintf(line, sizeof line, "[%-*.*s] %s", BAR_WIDTH, filled, full_bar, what);
    if (!strcmp(line, drawn))
        return;
    fprintf(stderr, "\r\033[K%s", line);
    fflush(stderr);
    memcpy(drawn, line, sizeof drawn);
}

CliTimeLeft cli_time_left(double seconds)
{
    CliTimeLeft left = {""};
    if (seconds >= 5400)
        snprintf(left.text, sizeof left.text, ", about %.1f hours left", seconds / 3600);
    else if (seconds >= 90)
        snprintf(left.text, sizeof left.text, ", about %.0f minutes left", seconds / 60);
    else if (seconds >= 0)
        snprintf(left.text, sizeof left.text, ", about %.0f seconds left", seconds);
    return left;
}

void cli_progress_clear(void)
{
    if (!cli_progress_shows())
        return;
    fputs("\r\033[K", stderr);
    fflush(stderr);
    drawn[0] = 0;
}

void cli_message(const char *kind, const char *format, ...)
{
    char text[1200], line[1200];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    cli_with_options(text, line, sizeof line);
    for (char *c = line; *c; c++)
        if ((unsigned char)*c < 0x20 || *c == 0x7f)
            *c = '?';
    cli_progress_clear();
    fprintf(stderr, "ctsplat: %s%s\n", kind, line);
}

void cli_print_diagnostics(const CtsDiagnostics *diagnostics, size_t from)
{
    for (size_t i = from; i < diagnostics->n; i++) {
        const CtsDiagnostic *const d = &diagnostics->items[i];
        if (d->severity == CTS_WARNING && !cts_diagnostics_have(&(CtsDiagnostics){diagnostics->items, i}, d))
            cli_warning("%s", d->text);
    }
}

CtsStatus cli_print_json(json_t *value, CtsError *err)
{
    char *text = value ? json_dumps(value, JSON_INDENT(2) | JSON_REAL_PRECISION(15)) : NULL;
    json_decref(value);
    if (!text)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    printf("%s\n", text);
    free(text);
    return CTS_OK;
}

/* Steps after searching and reading are frames, which take about as long each. */
static void step(void *context, double done, int all, const char *what)
{
    enum { FIRST_FRAME = 2 };
    CliWatch *cli = context;
    char text[128];
    const double now_ms = cts_wall_ms(), frames = done - FIRST_FRAME;
    if (frames <= 0)
        cli->frames_start_ms = now_ms;
    const bool knows = all > FIRST_FRAME + 1 && frames >= 1;
    snprintf(text, sizeof text, "%s%s", what,
             cli_time_left(knows ? (now_ms - cli->frames_start_ms) / 1000 / frames * (all - done) : -1).text);
    cli_progress(done, all, text);
}

static void diagnostics(void *context, const CtsReport *report)
{
    CliWatch *cli = context;
    cli_print_diagnostics(&report->diagnostics, cli->n_diagnostics);
    cli->n_diagnostics = report->diagnostics.n;
}

static void found(void *context, const CtsSeriesList *list)
{
    const CliWatch *cli = context;
    for (size_t i = 0; cli->log && cli->names && i < list->n_paths; i++)
        cts_names_add(cli->names, list->paths[i]);
}

static void loaded(void *context)
{
    const CliWatch *cli = context;
    const CtsJob *const job = cli->job;
    if (job)
        cts_log_picture(cli->log, job->preset->name, &job->render, job->outputs.rotation ? job->outputs.rotation : 1);
    cli_interrupt_sets_stop();
}

static CtsStatus output(void *context, int of_frame, const char *path, const char *format, uint64_t bytes,
                        CtsError *err)
{
    (void)of_frame, (void)err;
    CliWatch *cli = context;
    const bool later = cli->reported_later && !strcmp(path, cli->reported_later);
    const size_t n = strlen(cli->files);
    if (!later)
        cts_log_output(cli->log, path, format, bytes);
    snprintf(cli->files + n, sizeof cli->files - n, "%s%s", n ? ", " : "", later ? "standard output" : path);
    return CTS_OK;
}

/* One line a picture: files, size, error and what was asked, time. Without files, those of a rotation's last frame hold
 * it. */
static CtsStatus frame(void *context, const CtsErrorBound *bound, CtsError *err)
{
    CliWatch *cli = context;
    (void)err;
    const CtsRenderSettings *const s = &cli->job->render;
    const double now_ms = cts_wall_ms(), error = 255 * bound->rmse;
    const double asked = s->max_error > 0 ? s->max_error : CTS_DEFAULT_ERROR;
    char text[120] = "error not estimated";
    if (bound->known)
        snprintf(text, sizeof text, "error %.3g/255 (%s %.3g%s)", error, s->max_error > 0 ? "asked" : "default", asked,
                 error > asked ? ", not met" : "");
    cli_note("%s%s%dx%d  %s  %.2f s", cli->files, cli->files[0] ? "  " : "", s->width, s->height, text,
             (now_ms - cli->picture_start_ms) / 1000);
    cli->picture_start_ms = now_ms;
    cli->files[0] = 0;
    return CTS_OK;
}

CtsWatch cli_watch(CliWatch *cli)
{
    return (CtsWatch){.context = cli,
                      .step = cli_progress_shows() ? step : NULL,
                      .diagnostics = diagnostics,
                      .found = found,
                      .loaded = loaded,
                      .output = output,
                      .frame = cli->summed_up ? frame : NULL};
}
