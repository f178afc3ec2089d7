/* A process of the batch as its parent sees it. */
#ifndef CTS_BATCH_WORKER_H
#define CTS_BATCH_WORKER_H

#include "app/batch/batch_plan.h"
#include <jansson.h>
#include <stdbool.h>
#include <sys/types.h>

typedef enum CtsWorkerPhase {
    CTS_WORKER_READS,
    CTS_WORKER_WAITS, /* to render */
    CTS_WORKER_RENDERS,
    CTS_WORKER_SENDS   /* and nothing else, in all its life */
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
