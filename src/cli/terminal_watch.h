/* A job seen from the terminal: a progress bar, warnings as they come, outputs into the log. */
#ifndef CTS_CLI_TERMINAL_WATCH_H
#define CTS_CLI_TERMINAL_WATCH_H

#include "app/job/watch.h"
#include "output/report/log.h"
#include "output/report/masked.h"

typedef struct CliWatch {
    CtsLog *log;            /* NULL: none */
    const char *told_later; /* an output that is not told yet, or NULL */
    size_t n_findings;      /* of the report, printed so far */
    CtsNames *names;        /* of input files, for the log to leave out; or NULL */
    double frames_start_ms; /* when the first frame began */
} CliWatch;

/* From its loading on, a job is asked to stop by signals (cli/interrupt.h). */
CtsWatch cli_watch(CliWatch *seen);

#endif
