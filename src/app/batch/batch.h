/* Thousands of series, each in a process of its own, with a journal that a run can take up where another was stopped.
 */
#ifndef CTS_BATCH_BATCH_H
#define CTS_BATCH_BATCH_H

#include "app/job/render_job.h"
#include "app/words/options.h"
#include <signal.h>

typedef struct CtsBatchView {
    const char *name; /* as the user wrote it; part of file names */
    double azimuth_deg, elevation_deg;
} CtsBatchView;

typedef struct CtsBatchLists {
    char *texts[3]; /* copies that the names point into */
    const char **preset_names, **view_texts, **formats;
    CtsPreset *presets;
    CtsBatchView *views;
    int n_presets, n_views, n_formats;
    char *options, *dcm_options; /* the words that act on pictures, and on .dcm files alone: a change makes them anew */
    char send_to[1100];          /* the PACS that .dcm files go to, as the journal names it; "": none */
} CtsBatchLists;

/* Free with cts_batch_lists_free(), also after a failure. */
CtsStatus cts_batch_lists(const CtsOptions *options, CtsBatchLists *lists, CtsReport *report, CtsError *err);
void cts_batch_lists_free(CtsBatchLists *lists);

/* More series at once are not started, whatever is asked for. */
enum { CTS_BATCH_MOST_JOBS = 256 };

/* Series are counted by their UIDs, so that how many there are does not change when one turns out to hold several
 * volumes. */
typedef struct CtsBatchProgress {
    size_t n_ended, n_series;
    size_t n_pictures;   /* that this run made */
    double seconds_left; /* by the pictures that are to come; negative: not known yet */
} CtsBatchProgress;

/* For people: lines and a forecast. */
typedef struct CtsBatchTold {
    void (*warning)(void *context, const char *text);
    /* A series came to its end; text is one line on it. */
    void (*series)(void *context, const char *text, bool failed);
    /* The search goes on, and how many series there are is not known yet. */
    void (*searching)(void *context, uint64_t n_files);
    void (*progress)(void *context, const CtsBatchProgress *progress);
    void *context;
} CtsBatchTold;

typedef struct CtsBatchSettings {
    const CtsOptions *options;
    const CtsBatchLists *lists;
    CtsJob job;          /* what all pictures share; the batch fills in preset, view, paths and threads */
    const char *command; /* as the log has it */
    CtsBatchTold told;
    const volatile sig_atomic_t *stop;
} CtsBatchSettings;

typedef struct CtsBatchResult {
    size_t n_series, n_uids;                               /* the files of one UID may hold several series */
    size_t n_done, n_stood, n_passed, n_refused, n_failed; /* n_stood of n_done needed nothing */
    uint64_t n_unreadable, n_packed;                       /* files that no series has: as CtsArchiveCounts has them */
} CtsBatchResult;

/* Makes -O where it is missing; refuses one that cannot be written, or that is itself searched for series. */
CtsStatus cts_batch_open_folder(const CtsBatchSettings *settings, CtsError *err);
/* Whether it takes a file at all: else a failure to write is not the series' own. */
CtsStatus cts_folder_probe(const CtsBatchSettings *settings, CtsError *err);

/* All that can be refused before any series is read. */
CtsStatus cts_batch_check(const CtsBatchSettings *settings, CtsReport *report, CtsError *err);

/* What comes of it is added to the result. A series that is refused or fails is counted; a failure of the batch itself
 * is the status. The contact sheet is written now and then on the way, unless this is one shard of several. */
CtsStatus cts_batch_run(const CtsBatchSettings *settings, CtsBatchResult *result, CtsError *err);

/* Removes those whose names begin so; nobody else may be writing there. */
void cts_sweep(const char *folder, const char *prefix);
/* All of them below -O; of a shard its journal's alone, as other shards are at work: the folder of a series is swept
 * when the series is made. */
void cts_sweep_all(const char *folder, int shard, int n_shards);

#endif
