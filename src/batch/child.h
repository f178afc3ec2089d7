/* One series in a process of its own, and what it tells its parent: lines of the journal, and that it is ready. */
#ifndef CTS_BATCH_CHILD_H
#define CTS_BATCH_CHILD_H

#include "batch/batch.h"
#include "batch/journal.h"
#include "batch/batch_plan.h"
#include <sys/types.h>

/* Messages to the parent, each a line: */
#define CTS_CHILD_LOADED "loaded" /* and nothing behind it: waits for a byte */
#define CTS_CHILD_LINE "line "    /* a line of the journal, not final: there is more to come of this series */
#define CTS_CHILD_LAST "last "    /* the same, final */

/* Starts a process for the series with this many threads. *socket is the parent's end; non-blocking. */
CtsStatus cts_child_start(const CtsBatchSettings *settings, CtsJournal *journal, const CtsPlanSeries *series,
                          int n_threads, pid_t *pid, int *socket, CtsError *err);

/* A line of a series of which nothing but its files and this is known. The caller's to release; NULL without memory. */
json_t *cts_child_failed_line(const CtsBatchSettings *settings, const CtsPlanSeries *series, const char *reason,
                              int exit_code);
/* Date and time as the journal has them. */
json_t *cts_child_now(void);

#endif
