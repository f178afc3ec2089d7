/* One series in a process of its own, and what it tells its parent. */
#ifndef CTS_BATCH_CHILD_H
#define CTS_BATCH_CHILD_H

#include "app/batch/batch.h"
#include "app/batch/batch_plan.h"
#include "app/batch/journal.h"
#include "app/contact/contact_sheet.h"
#include "output/report/info.h"
#include "output/report/masked.h"
#include <jansson.h>
#include <stdbool.h>
#include <sys/types.h>

/* How it exits when memory ran out and was lacking for a message, too. */
enum { CTS_CHILD_NO_MEMORY = 3 };

/* Messages to the parent, each a line. A line of the journal stands behind the last four, with all that it might tell
 * (cts_line_forget()): */
#define CTS_CHILD_LOADED "loaded"  /* the volume is read: waits for a byte */
#define CTS_CHILD_BEGUN "begun "   /* what is known of the series; not for the journal yet */
#define CTS_CHILD_LINE "line "     /* not final: there is more to come of this series */
#define CTS_CHILD_LAST "last "     /* final */
#define CTS_CHILD_STANDS "stands " /* final, and nothing had to be made */

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
    bool passed;       /* there is nothing of it to show */
} CtsBatchChild;

/* run is called in the new process, and does not return. */
CtsStatus cts_child_fork(CtsBatchChild *child, void (*run)(CtsBatchChild *child), pid_t *pid, int *socket,
                         CtsError *err);
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

/* What a process tells of a series that it makes: cts_child_begin(), then the volume is read,
 * cts_child_loaded(), then for each picture its files and cts_child_picture_done(), and cts_child_end() with what came
 * of it. What has to be made of a series: the child's pictures. None: it all stands, or it cannot be rendered; then
 * cts_child_end() comes next. */
CtsStatus cts_child_begin(CtsBatchChild *child, const CtsSeries *series, CtsError *err);
/* The volume is in memory: waits until it is this process's turn to render. */
CtsStatus cts_child_loaded(CtsBatchChild *child, const CtsPixelFacts *facts, CtsError *err);
/* A file of a picture that is whole, or one of its thumbnails. frame: of a rotation, else -1. */
CtsStatus cts_child_output(CtsBatchChild *child, const CtsBatchPicture *picture, const char *path, int frame,
                           CtsError *err);
CtsStatus cts_child_thumbnail(CtsBatchChild *child, const CtsBatchPicture *picture, const CtsThumbnailFile *file,
                              CtsError *err);
/* The series' slices with its labels' outlines. */
CtsStatus cts_child_label_slices(CtsBatchChild *child, const char *path, uint64_t bytes, CtsError *err);
/* All files of a picture are whole: they are the batch's from here on. The report knows what its verification found,
 * and its findings from first_finding on are the picture's. */
CtsStatus cts_child_picture_done(CtsBatchChild *child, const CtsBatchPicture *picture, const CtsReport *report,
                                 size_t first_finding, CtsError *err);
/* A series came to its end: status and why are what its rendering ended with. */
CtsStatus cts_child_end(CtsBatchChild *child, const CtsReport *report, CtsStatus status, const CtsError *why);

typedef enum CtsWorkerPhase {
    CTS_WORKER_READS,
    CTS_WORKER_WAITS, /* to render */
    CTS_WORKER_RENDERS,
    CTS_WORKER_SENDS /* and nothing else, in all its life */
} CtsWorkerPhase;

typedef struct CtsWorker {
    pid_t pid; /* 0: none */
    int socket;
    CtsWorkerPhase phase;
    CtsPlanSeries series; /* empty where it sends */
    int n_ended;          /* series of which the last line came: the files of one UID may hold several */
    int n_left;           /* pictures to be made of the series under way, as far as is known */
    bool counted;         /* it is known */
    json_t *line;         /* what was told last of the series under way; NULL: nothing yet */
    double deadline_ms;   /* INFINITY while it waits */
    double stop_ms;       /* it was asked to end; 0: not yet */
    const char *killed;   /* why, or NULL */
    double bytes;         /* what it may take, guessed */
    char *text;           /* of messages, as far as they came */
    size_t n_text, capacity;
} CtsWorker;

/* Calls take for each message that came, without the end of its line; false when no more will come. */
bool cts_worker_read(CtsWorker *worker, void (*take)(void *context, CtsWorker *worker, const char *message),
                     void *context);
/* Why a process that ended so told nothing. */
void cts_worker_reason(const CtsWorker *worker, int how, char *reason, size_t size);
/* Asks it to end, and after a while makes it. */
void cts_worker_stop(CtsWorker *worker, double now_ms);
void cts_worker_kill(CtsWorker *worker, const char *why);
/* After its process has ended. */
void cts_worker_free(CtsWorker *worker);

#endif
