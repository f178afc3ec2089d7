/* The terminal: messages and a progress bar on stderr, output on stdout, signals. */
#pragma once

#include "app/job/render_job.h"
#include "app/options/options.h"
#include "output/report/log.h"
#include "output/report/redact.h"
#include <jansson.h>
#include <signal.h>

/* Copies text to out, truncated to size, with each option that the library's messages write as `max-error` written as
 * --max-error; returns out. */
const char *cli_with_options(const char *text, char *out, size_t size);

/* Draws a progress bar if stderr is a terminal: done of all steps; what describes the current step. */
void cli_progress(double done, int all, const char *what);
/* True if a progress bar is shown. */
bool cli_progress_shows(void);
/* ", about 40 seconds left"; "" for negative seconds: unknown. */
typedef struct CliTimeLeft {
    char text[48];
} CliTimeLeft;
CliTimeLeft cli_time_left(double seconds);
/* Removes the bar, before a message and at the end. */
void cli_progress_clear(void);

/* Prints value and a newline; takes over the reference. NULL, as from json_pack without memory, is CTS_ERR_MEMORY. */
CtsStatus cli_print_json(json_t *value, CtsError *err);

/* Prints a message on one line, whatever a header or a file name contains. kind: "error: ", "warning: " or "". */
void cli_message(const char *kind, const char *format, ...) __attribute__((format(printf, 2, 3)));
#define cli_warning(...) cli_message("warning: ", __VA_ARGS__)
#define cli_note(...) cli_message("", __VA_ARGS__)
/* Warnings among findings[from..n), each text once. */
void cli_print_diagnostics(const CtsDiagnostics *diagnostics, size_t from);

/* A job as the terminal shows it: a progress bar, warnings as they come, outputs into the log. */
typedef struct CliWatch {
    CtsLog *log;                /* NULL: none */
    const char *reported_later; /* an output that is not yet reported, or NULL */
    size_t n_diagnostics;       /* of the report, printed so far */
    CtsNames *names;            /* of input files, for the log to leave out; or NULL */
    double frames_start_ms;     /* when the first frame began */
    const CtsJob *job;          /* in the log, and of summed_up; NULL: not in the log */
    bool summed_up;             /* a line for each of the job's pictures */
    double picture_start_ms;    /* when the picture began: the program's start, or the end of the one before */
    char files[400];            /* of the picture, by name; cut where there are many */
} CliWatch;

/* From loading on, signals ask the job to stop. */
CtsWatch cli_watch(CliWatch *cli);

/* -o -: a picture on standard output. It is made in a folder of its own, so that nothing of it is written before it is
 * whole. */
typedef struct CliStandardOutput {
    char *folder, *path; /* NULL: no picture goes to standard output */
    const char *format;
    const char **outputs; /* the job's, with path in the place of - */
} CliStandardOutput;

/* Does nothing where no output is -. Free with cli_standard_output_end(), also after a failure. */
CtsStatus cli_standard_output_begin(CliStandardOutput *to, const CtsOptions *options, CtsJob *job, CtsError *err);
/* The picture, now that it is whole. */
CtsStatus cli_standard_output_write(const CliStandardOutput *to, uint64_t *bytes, CtsError *err);
void cli_standard_output_end(CliStandardOutput *to);

/* SIGINT, SIGTERM and SIGHUP: a clean stop with exit code 130 and without temporary files. Set by the signal handler;
 * for CtsRenderSettings.stop. */
extern volatile sig_atomic_t cli_stop;

void cli_interrupt_init(void);
/* Initially a signal ends the process at once, which suits work without temporary files and without a stop flag, such
 * as reading a series. After this call signals set cli_stop instead. */
void cli_interrupt_sets_stop(void);

/* A line that a signal which ends the program at once writes to this file before; text must stay valid. NULL:
 * nothing. */
void cli_interrupt_writes(int fd, const char *text, size_t size);
/* An empty folder that such a signal removes; must stay valid. NULL: none. */
void cli_interrupt_removes(const char *folder);
