/* Rendering of many series, each in a process of its own, with a journal from which a stopped run resumes. */
#pragma once

#include "app/job/render_job.h"
#include "app/options/options.h"

typedef struct CtsBatchView {
    const char *name; /* as given; part of file names */
    double azimuth_deg, elevation_deg;
    bool is_montage; /* the last one, of the options' montage and the first preset that a series takes */
} CtsBatchView;

typedef struct CtsBatchLists {
    const char **view_texts, **formats; /* each with its texts in one block */
    CtsPreset *presets;                 /* n_presets: n_named as given, then those of series that none of these suits */
    CtsBatchView *views;
    int n_presets, n_named, n_views, n_formats;
    const CtsMontage *montage;
    /* options that affect all pictures, the montage, and .dcm files only: after a change these are rendered again */
    char *options, *montage_options, *dcm_options;
    char send_to[1100]; /* the PACS that gets .dcm files, as named in the journal; "": none */
} CtsBatchLists;

/* Free with cts_batch_lists_free(), also after a failure. */
CtsStatus cts_batch_lists(const CtsOptions *options, CtsBatchLists *lists, CtsReport *report, CtsError *err);
void cts_batch_lists_free(CtsBatchLists *lists);
/* True if a series of this kind has the picture: of a preset of those given that suit it, or of its default; of a
 * montage all presets must suit it. */
bool cts_batch_takes(const CtsBatchLists *lists, int preset, int view, CtsModality modality, CtsQuantity quantity);

/* Largest number of concurrent series, more than the cores of most machines; each is a process. */
enum { CTS_BATCH_MAX_JOBS = 256 };

/* Series are counted by UID, so that their number does not change when one turns out to contain several volumes. */
typedef struct CtsBatchProgress {
    uint64_t n_files; /* met so far, while the search is running; then 0 */
    size_t n_ended, n_series;
    size_t n_pictures;   /* rendered in this run */
    double seconds_left; /* for the remaining pictures; negative: unknown */
} CtsBatchProgress;

/* For people: lines and a forecast. */
typedef struct CtsBatchListener {
    void (*message)(void *context, bool is_warning, const char *text);
    /* A series has ended; text is a line about it. */
    void (*series)(void *context, const char *text, bool failed);
    void (*progress)(void *context, const CtsBatchProgress *progress);
    void *context;
} CtsBatchListener;

typedef struct CtsBatchSettings {
    const CtsOptions *options;
    const CtsBatchLists *lists;
    CtsBatchListener listener;
} CtsBatchSettings;

typedef struct CtsBatchResult {
    size_t n_series, n_uids; /* the files of one UID may hold several series */
    size_t n_done, n_up_to_date, n_thumbnails, n_skipped, n_refused,
        n_failed;                               /* n_up_to_date of n_done needed nothing */
    size_t n_waiting;                           /* left to a later run by `settled` */
    bool is_idle;                               /* nothing has changed since the last run */
    uint64_t n_unreadable, n_objects, n_packed; /* files that no series has: as CtsArchiveCounts has them */
} CtsBatchResult;

/* Makes -O where it is missing; refuses one that cannot be written, or that is itself searched for series. */
CtsStatus cts_batch_open_folder(const CtsBatchSettings *settings, CtsError *err);
/* Checks that the folder can hold files; otherwise a failure to write is not the fault of a series. */
CtsStatus cts_folder_probe(const CtsBatchSettings *settings, CtsError *err);

/* All checks that need no file of a series. */
CtsStatus cts_batch_check(const CtsBatchSettings *settings, CtsReport *report, CtsError *err);

/* Adds to the result. A series that is refused or fails is counted; a failure of the batch itself is the status. Writes
 * the contact sheet periodically, unless this is one shard of several. */
CtsStatus cts_batch_run(const CtsBatchSettings *settings, CtsBatchResult *result, CtsError *err);

/* Removes temporary files of a series; no other process may be writing there. */
void cts_sweep_series(const char *output_dir, const char *folder);
/* All of them below -O; of a shard its journal's alone, as other shards are at work: the folder of a series is swept
 * when the series is made. */
void cts_sweep_all(const char *folder, int shard, int n_shards);
