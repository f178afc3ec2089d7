/* Worker process of a series, and its messages to the batch. */
#pragma once

#include "app/batch/batch.h"
#include "app/batch/batch_plan.h"
#include "app/batch/journal.h"
#include "app/contact/contact_sheet.h"
#include "output/report/info.h"
#include "output/report/log.h"
#include "output/report/redact.h"
#include <jansson.h>
#include <stdbool.h>
#include <sys/types.h>

/* Exit code when memory ran out, even for a message. */
enum { CTS_WORKER_NO_MEMORY = 3 };

/* Messages to the parent, one per line, by their first byte, which a journal record follows, with all details that
 * cts_journal_record_redact() may remove: */
enum {
    CTS_WORKER_BEGUN = 'b',       /* data of the series so far; not for the journal */
    CTS_WORKER_RECORD = 'r',      /* not final: more records of this series follow */
    CTS_WORKER_LAST_RECORD = 'l', /* final */
    CTS_WORKER_UP_TO_DATE = 's'   /* final, and nothing had to be rendered */
};

/* State of the worker process. */
typedef struct CtsWorkerProcess {
    const CtsBatchSettings *settings;
    CtsJournal *journal;
    const CtsArchives *archives;
    const CtsPlanSeries *series; /* NULL where it only sends */
    int socket, n_threads;
    CtsNames names; /* of the series' files */
    bool is_final;  /* a last record was sent */
    double start_wall_ms, start_cpu_ms;
    /* Of the current series, since the files may contain several; all 0 until it begins: */
    const CtsSeries *now;
    json_t *record, *known; /* known: the record of an earlier run of the same files */
    char folder[96];
    CtsBatchPicture *pictures;
    int n_pictures, n_left;
    const char **label_paths; /* of its study; n_label_paths, owned */
    int n_label_paths;
    CtsLoaded loaded;
    bool is_loaded, skipped; /* the volume is read; the series has nothing to show */
    CtsReport report;
    size_t n_diagnostics; /* of the report that the record has */
    CtsLog *log;
    CtsPrepared prepared; /* for pictures of one preset, and of one volume */
    /* Of the current picture: */
    const CtsBatchPicture *picture;
    CtsThumbnail *thumb;
    double error; /* the picture's rms limit, of its frames the largest; negative: not estimated */
} CtsWorkerProcess;

typedef struct CtsWorker {
    pid_t pid; /* 0: none */
    int socket;
    bool sends;           /* and nothing else */
    CtsPlanSeries series; /* empty where it sends */
    int n_ended;          /* series with a final record: the files of one UID may contain several */
    int n_left;           /* pictures still to be rendered of the current series, if counted */
    bool counted;         /* n_left is known */
    json_t *record;       /* last record of the current series; NULL: none yet */
    double deadline_ms;   /* INFINITY: none */
    double stop_ms;       /* time of the request to end; 0: none */
    const char *killed;   /* why, or NULL */
    double bytes;         /* estimated memory */
    char *text;           /* partly received message */
    size_t n_text, capacity;
} CtsWorker;

/* Starts a process that runs cts_worker_render(), of its series, or cts_worker_send(), of the unsent captures of its
 * record; neither returns. Sets the worker's pid and socket, a non-blocking one. */
CtsStatus cts_worker_fork(CtsWorkerProcess *worker_process, void (*run)(CtsWorkerProcess *worker_process),
                          CtsWorker *worker, CtsError *err);
void cts_worker_render(CtsWorkerProcess *worker_process);
void cts_worker_send(CtsWorkerProcess *worker_process);
/* Sends a message of this kind with the record. */
CtsStatus cts_worker_send_record(const CtsWorkerProcess *worker_process, char kind, CtsError *err);

/* An empty line of a series. The caller's to release; NULL without memory. */
json_t *cts_worker_new_record(const CtsBatchSettings *settings, const CtsPlanSeries *series, const char *uid,
                              const char *folder);
/* Adds a diagnostic; an equal one is counted, and its file is added to the list. preset: whose pictures it concerns, or
 * NULL. */
void cts_worker_add_diagnostic(CtsWorkerProcess *worker_process, const CtsDiagnostic *diagnostic, const char *preset);
/* Sets status and end time. */
void cts_worker_set_status(json_t *record, int exit_code, const char *reason);
/* The same, where the reason may name a file of the series. */
void cts_worker_report_status(CtsWorkerProcess *worker_process, CtsStatus status, const char *reason);

/* Sequence of calls for a series: cts_worker_begin_series(), reading of the volume, cts_worker_loaded(), for each
 * picture its files and cts_worker_picture_done(), and cts_worker_end_series() with the result.
 * cts_worker_begin_series() determines the missing pictures; if there are none, because all are up to date or the
 * series cannot be rendered, cts_worker_end_series() follows. */
CtsStatus cts_worker_begin_series(CtsWorkerProcess *worker_process, CtsError *err);
/* True for a series that is no volume, whose image shows no patient's name, or may show it. */
bool cts_worker_shows_image(const CtsWorkerProcess *worker_process);
/* The volume is in memory. */
void cts_worker_loaded(CtsWorkerProcess *worker_process, const CtsPixelFacts *facts);
/* A file of the picture that is whole, or one of its thumbnails. frame: of a rotation, else -1. */
CtsStatus cts_worker_output(CtsWorkerProcess *worker_process, const char *path, int frame, CtsError *err);
CtsStatus cts_worker_thumbnail(CtsWorkerProcess *worker_process, const CtsThumbnailFile *file, CtsError *err);
/* A picture of the card beside the thumbnails, by its kind: "sections", or "image" of a series that is no volume. */
CtsStatus cts_worker_card_picture(CtsWorkerProcess *worker_process, const char *kind, const char *stem,
                                  const CtsThumbnailFile *file, CtsError *err);
/* All files of the picture are complete and recorded from here on. The report contains its verification; its findings
 * from first_diagnostic on belong to the picture. */
CtsStatus cts_worker_picture_done(CtsWorkerProcess *worker_process, size_t first_diagnostic, CtsError *err);
/* The series has ended: status and why are the result of its rendering. Frees what belongs to the record. */
CtsStatus cts_worker_end_series(CtsWorkerProcess *worker_process, CtsStatus status, const CtsError *why);

/* Calls take for each complete message, without the end of its line; false after the last one. */
bool cts_worker_read(CtsWorker *worker, void (*take)(void *context, CtsWorker *worker, const char *message),
                     void *context);
/* A reason for a worker that ended without a report, from its wait status. */
void cts_worker_reason(const CtsWorker *worker, int how, char *reason, size_t size);
/* Asks it to end, and kills it after a while. */
void cts_worker_stop(CtsWorker *worker, double now_ms);
/* After its process has ended. */
void cts_worker_free(CtsWorker *worker);
