/* Thousands of series, each in a process of its own, with a journal that a run can take up where another was stopped.
 *
 * The batch knows series, pictures to be made and what stands of them; how a picture is made is its caller's. */
#ifndef CTS_BATCH_BATCH_H
#define CTS_BATCH_BATCH_H

#include "ctsplat/preset.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "output/report/info.h"
#include <signal.h>

/* More series at once are not started, whatever is asked for. */
enum { CTS_BATCH_MOST_JOBS = 256 };

typedef struct CtsBatchView {
    const char *name; /* as the user wrote it; part of file names */
    double azimuth_deg, elevation_deg;
} CtsBatchView;

/* A picture, or a rotation, that has to be made of a series. */
typedef struct CtsBatchPicture {
    int preset, view;   /* places in the settings */
    const char **paths; /* of the formats that do not stand; NULL-terminated; a rotation's frames get their numbers */
    const char *thumb_stem; /* of its thumbnails */
} CtsBatchPicture;

/* A segmentation or a structure set that the search has met, and the study that it is of. */
typedef struct CtsBatchLabelFile {
    char *path, *study_uid;
} CtsBatchLabelFile;

/* What a worker is given: one series. paths are its files. */
typedef struct CtsBatchTask {
    const char *uid; /* "" stands for files without one */
    const char *const *paths;
    int n_paths, n_threads;
    const CtsArchives *archives;          /* that hold some of them */
    const CtsBatchLabelFile *label_files; /* n_label_files, of all series */
    size_t n_label_files;
    struct CtsBatchChild *child; /* for the calls below */
} CtsBatchTask;

/* Runs in the series' own process. Searches paths, and for each series that it finds there: cts_batch_begin(), reads
 * the volume, cts_batch_loaded(), makes the pictures, cts_batch_output() and cts_batch_picture_done() for each, then
 * cts_batch_end() with what came of it. A status that it returns itself is that of a series that was not even found. */
typedef CtsStatus (*CtsBatchWork)(void *context, const CtsBatchTask *task, CtsError *err);

/* What has to be made of a series; the list stays the child's. Nothing: it all stands, or it cannot be rendered; then
 * cts_batch_end() comes next. */
CtsStatus cts_batch_begin(struct CtsBatchChild *child, const CtsSeries *series, const CtsBatchPicture **pictures,
                          int *n, CtsError *err);
/* The volume is in memory: waits until it is this process's turn to render. */
CtsStatus cts_batch_loaded(struct CtsBatchChild *child, const CtsPixelFacts *facts, CtsError *err);
/* The last picture is rendered, though not all of it is written: another series may render. */
CtsStatus cts_batch_rendered(struct CtsBatchChild *child, CtsError *err);
/* A file of a picture that is whole, or one of its thumbnails. frame: of a rotation, else -1. */
CtsStatus cts_batch_output(struct CtsBatchChild *child, const CtsBatchPicture *picture, const char *path, int frame,
                           uint64_t bytes, CtsError *err);
CtsStatus cts_batch_thumbnail(struct CtsBatchChild *child, const CtsBatchPicture *picture, const char *path,
                              int n_frames, const int size[2], uint64_t bytes, CtsError *err);
/* The series' slices with its labels' outlines. */
CtsStatus cts_batch_label_slices(struct CtsBatchChild *child, const char *path, uint64_t bytes, CtsError *err);
/* All files of a picture are whole: they are the batch's from here on. The report knows what its verification found,
 * and its findings from first_finding on are the picture's. */
CtsStatus cts_batch_picture_done(struct CtsBatchChild *child, const CtsBatchPicture *picture, const CtsReport *report,
                                 size_t first_finding, CtsError *err);
/* A series came to its end: status and why are what its rendering ended with. */
CtsStatus cts_batch_end(struct CtsBatchChild *child, const CtsReport *report, CtsStatus status, const CtsError *why);

/* Runs in a process of its own: stores files to the PACS and calls sent for each that it has. */
typedef CtsStatus (*CtsBatchSend)(void *context, const char *const *paths, int n,
                                  void (*sent)(void *sent_context, const char *path), void *sent_context,
                                  CtsError *err);

/* Series are counted by their UIDs, so that how many there are does not change when one turns out to hold several
 * volumes. */
typedef struct CtsBatchProgress {
    size_t n_ended, n_series;
    size_t n_pictures;   /* that this run made */
    double seconds_left; /* by the pictures that are to come; negative: not known yet */
} CtsBatchProgress;

/* For people: lines and a forecast. Any may be NULL but warning. */
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
    const char *const *paths;
    int n_paths;
    const char *folder;        /* -O; is made where it is missing */
    const char *series_uid;    /* this one alone; NULL: all */
    const char *const *labels; /* n_labels label paths, as --labels has them */
    int n_labels;
    const CtsPreset *presets;
    int n_presets;
    const CtsBatchView *views;
    int n_views;
    const char *const *formats; /* endings, without the dot */
    int n_formats;
    int rotation;                 /* frames; 0: off */
    const char *options_text;     /* of all options that act on a picture, and */
    const char *dcm_options_text; /* those that act on .dcm files alone: a change makes the files anew */
    int shard, n_shards;          /* 0 of 1: all */
    int n_jobs;                   /* series rendered at once; 0: one more than there are threads */
    int n_threads;                /* of all together; 0: the cores this process may use */
    double series_timeout_s;      /* 0: none */
    uint64_t series_bytes;        /* memory of one series; 0: what the machine has */
    bool fresh, show_patient, show_paths;
    bool deidentify; /* folders, journal and sheet name series by UIDs under a key, */
    const char *key; /* of this file, or the site's own */
    CtsBatchWork work;
    const char *send_to; /* the PACS that .dcm files go to, as the journal names it; NULL: none */
    CtsBatchSend send;
    void *context;
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

/* A series that is refused or fails is counted; a failure of the batch itself is the status. The contact sheet is
 * written now and then on the way, unless this is one shard of several. */
CtsStatus cts_batch_run(const CtsBatchSettings *settings, CtsBatchResult *result, CtsError *err);

#endif
