/* One series in a process of its own, and what it tells its parent. */
#ifndef CTS_BATCH_CHILD_H
#define CTS_BATCH_CHILD_H

#include "app/batch/batch.h"
#include "app/batch/batch_plan.h"
#include "app/batch/journal.h"
#include "app/batch/line.h"
#include "output/report/masked.h"
#include <sys/types.h>

/* How it exits when memory ran out and was lacking for a message, too. */
enum { CTS_CHILD_NO_MEMORY = 3 };

/* Messages to the parent, each a line. A line of the journal stands behind the last four, with all that it might tell
 * (cts_line_forget()): */
#define CTS_CHILD_LOADED "loaded"     /* the volume is read: waits for a byte */
#define CTS_CHILD_BEGUN "begun "      /* what is known of the series; not for the journal yet */
#define CTS_CHILD_LINE "line "        /* not final: there is more to come of this series */
#define CTS_CHILD_LAST "last "        /* final */
#define CTS_CHILD_STANDS "stands "    /* final, and nothing had to be made */

/* What the process knows. */
typedef struct CtsBatchChild {
    const CtsBatchSettings *settings;
    CtsJournal *journal;
    const CtsArchives *archives;
    const CtsPlanSeries *series; /* NULL where it only sends */
    int socket, n_threads;
    double start_wall_ms, start_cpu_ms, waited_ms;
    /* Of the series under way, of which the files may hold several: */
    const CtsSeries *now;
    json_t *line, *known; /* known: what an earlier run told of the same files */
    CtsNames names;       /* of its files */
    char folder[96];
    CtsBatchPicture *pictures;
    int n_pictures, n_left;
    size_t n_findings; /* of the report that the line has */
    bool told;         /* a last line was sent */
} CtsBatchChild;

/* run is called in the new process, and does not return. */
CtsStatus cts_child_fork(CtsBatchChild *child, void (*run)(CtsBatchChild *child), pid_t *pid, int *socket,
                         CtsError *err);
CtsStatus cts_child_send(const CtsBatchChild *child, const char *message, CtsError *err);
/* The word and the line behind it. */
CtsStatus cts_child_send_line(const CtsBatchChild *child, const char *word, CtsError *err);

/* An empty line of a series. The caller's to release; NULL without memory. */
json_t *cts_child_new_line(const CtsBatchSettings *settings, const CtsPlanSeries *series, const char *uid,
                           const char *folder);
/* How a series ended, and when. */
void cts_child_set_status(json_t *line, int exit_code, const char *reason);
/* The same, where the reason may name a file of the series. */
void cts_child_tell_status(CtsBatchChild *child, CtsStatus status, const char *reason);

/* Starts a process that makes the series with this many threads, or one that sends what the line's series has and the
 * PACS has not. *socket is the parent's end; non-blocking. */
CtsStatus cts_work_start(const CtsBatchSettings *settings, CtsJournal *journal, const CtsArchives *archives,
                         const CtsPlanSeries *series, int n_threads, pid_t *pid, int *socket, CtsError *err);
CtsStatus cts_sender_start(const CtsBatchSettings *settings, CtsJournal *journal, const json_t *line, pid_t *pid,
                           int *socket, CtsError *err);

#endif
