/* What people see and do while the program runs: lines and a progress bar on stderr, output on stdout, signals. */
#ifndef CTS_CLI_TERMINAL_H
#define CTS_CLI_TERMINAL_H

#include "app/job/render_job.h"
#include "app/words/options.h"
#include "output/report/log.h"
#include "output/report/masked.h"
#include <jansson.h>
#include <signal.h>

/* Messages of the library name options of ctsplat without dashes, and settings by their fields. text with what stands
 * there as `max_error` written as an option, cut to size, in out; returns out. What is no option
 * stays as it is. */
const char *cli_with_options(const char *text, char *out, size_t size);

/* A progress bar, drawn only where stderr is a terminal. Step done of all is at hand: what says what happens in it. */
void cli_progress(double done, int all, const char *what);
/* Whether there is a terminal to draw it on. */
bool cli_progress_shows(void);
/* ", about 40 seconds left"; "" where seconds < 0, as it is not known. */
typedef struct CliTimeLeft {
    char text[48];
} CliTimeLeft;
CliTimeLeft cli_time_left(double seconds);
/* Take the bar off the line, before a message and at the end. */
void cli_progress_clear(void);

/* Prints value and a newline; takes over the reference. NULL, as from json_pack without memory, is CTS_ERR_MEMORY. */
CtsStatus cli_print_json(json_t *value, CtsError *err);

void cli_error(const CtsError *err);
void cli_warning(const char *format, ...) __attribute__((format(printf, 1, 2)));
void cli_note(const char *format, ...) __attribute__((format(printf, 1, 2)));
/* Warnings among findings[from..n), each text once. */
void cli_print_findings(const CtsFindings *findings, size_t from);

/* A job seen from the terminal: a progress bar, warnings as they come, outputs into the log. */
typedef struct CliWatch {
    CtsLog *log;            /* NULL: none */
    const char *told_later; /* an output that is not told yet, or NULL */
    size_t n_findings;      /* of the report, printed so far */
    CtsNames *names;        /* of input files, for the log to leave out; or NULL */
    double frames_start_ms; /* when the first frame began */
} CliWatch;

/* From its loading on, a job is asked to stop by signals. */
CtsWatch cli_watch(CliWatch *seen);

/* -o -: a picture on standard output. It is made in a folder of its own, so that nothing of it is written before it is
 * whole. */
typedef struct CliStandardOutput {
    char *folder, *path; /* NULL: nothing goes there */
    const char *format;
    const char **outputs; /* the job's, with path in the place of - */
} CliStandardOutput;

/* Does nothing where no output is -. Free with cli_standard_output_end(), also after a failure. */
CtsStatus cli_standard_output_begin(CliStandardOutput *to, const CtsOptions *options, CtsJob *job, CtsError *err);
/* The picture, now that it is whole. */
CtsStatus cli_standard_output_write(const CliStandardOutput *to, uint64_t *bytes, CtsError *err);
void cli_standard_output_end(CliStandardOutput *to);

/* SIGINT, SIGTERM and SIGHUP: stop cleanly, exit 130, leave no temporary file. Set once a signal asked to stop; for
 * CtsRenderSettings.stop. */
extern volatile sig_atomic_t cli_stop;

void cli_interrupt_init(void);
/* At first a signal ends the process at once, which suits work that leaves nothing behind and cannot be asked to stop,
 * such as reading a series. From this call on it sets cli_stop. */
void cli_interrupt_asks(void);

/* What a signal that ends the program at once writes before, to this file; text must stay. NULL: nothing. */
void cli_interrupt_says(int fd, const char *text, size_t size);
/* An empty folder that it removes then; must stay. NULL: none. */
void cli_interrupt_removes(const char *folder);

#endif
