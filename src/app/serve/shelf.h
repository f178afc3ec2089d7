/* The series cache: available series, and for loaded ones the scanned slices, processed volumes and renderers. The
 * least recently used is freed first. Not thread-safe: the caller holds its lock except where noted. */
#ifndef CTS_SERVE_SHELF_H
#define CTS_SERVE_SHELF_H

#include "app/job/render_job.h"
#include "app/words/options.h"
#include "base/site_key.h"
#include <pthread.h>

/* Marker in a PATH for the UID of the requested series. */
#define CTS_SHELF_PLACE "{series_uid}"

/* A renderer of one preset, cached for further pictures. */
typedef struct CtsLens {
    char *preset; /* as JSON, as given in the request */
    CtsPrepared prepared;
    bool in_use;
    double used_ms;
    struct CtsLens *next;
} CtsLens;

/* A volume processed from the scanned slices. */
typedef struct CtsCut {
    char *choice; /* identifies the processing (cts_source_choice()) */
    CtsVolume *volume;
    CtsLens *lenses;
    uint64_t bytes;
    int n_users;
    double used_ms;
    struct CtsCut *next;
} CtsCut;

typedef struct CtsShelved {
    char id[17]; /* an opaque name: a hash under the site's key */
    char uid[65], study_uid[65];
    const CtsSeries *series; /* NULL: not fetched yet */
    CtsLoaded loaded;        /* without a volume */
    bool on_demand;          /* found or fetched on request, and removed with its volumes */
    bool busy;               /* one thread reads it, or makes a volume */
    int n_asked, n_running;  /* queued and running pictures; running pictures */
    uint64_t bytes;          /* of the scanned slices */
    double used_ms;
    CtsCut *cuts;
    struct CtsShelved *next;
} CtsShelved;

/* A presentation state among the files that are no slices. */
typedef struct CtsShelvedState {
    char sop_uid[65];
    const char *path; /* the series list's */
} CtsShelvedState;

typedef struct CtsShelf {
    const CtsOptions *options;
    CtsSeriesList *list;
    CtsKey key;
    CtsShelved *first;
    CtsShelvedState *states;
    size_t n_states;
    uint64_t most_bytes, bytes;
} CtsShelf;

/* Searches the paths. Free with cts_shelf_free(), also after a failure. */
CtsStatus cts_shelf_fill(CtsShelf *shelf, const CtsOptions *options, CtsReport *report, CtsError *err);
void cts_shelf_free(CtsShelf *shelf);

/* NULL if there is none. */
CtsShelved *cts_shelf_by_id(CtsShelf *shelf, const char *id);
/* Finds by UIDs; adds a series known only to a peer, or to a path with {series_uid} in it. */
CtsStatus cts_shelf_by_uid(CtsShelf *shelf, const char *study_uid, const char *uid, CtsShelved **found, CtsError *err);
/* PATH with a series' UID in place of {series_uid}, and more behind it; NULL where it has no such place, or without
 * memory. */
char *cts_shelf_path(const char *pattern, const char *uid, const char *more);
/* The path of a presentation state among the paths, or SOP_UID.dcm in a path with {series_uid}; free with free(). NULL
 * if there is none. */
char *cts_shelf_state(const CtsShelf *shelf, const char *series_uid, const char *sop_uid);
/* The number of slices of a series that this object contains. */
int cts_shelved_count(const CtsShelved *shelved, const char *sop_uid);
/* The one volume of a study. */
CtsStatus cts_shelf_of_study(CtsShelf *shelf, const char *study_uid, CtsShelved **found, CtsError *err);

/* Removes series loaded on demand that are no longer available. */
void cts_shelf_sweep(CtsShelf *shelf);

/* The volume of these, or NULL. */
CtsCut *cts_shelf_cut(const CtsShelved *shelved, const CtsSource *source);

/* Without the lock, by the owner of shelved->busy: reads the series if needed, and processes the volume. Takes lock
 * where it needs it. CTS_ERR_MEMORY without enough memory. */
CtsStatus cts_shelf_make(CtsShelf *shelf, pthread_mutex_t *lock, CtsShelved *shelved, const CtsSource *source,
                         CtsCut **cut, CtsReport *report, CtsError *err);

/* Frees the loaded data of a series that is not in use. */
void cts_shelf_drop(CtsShelf *shelf, CtsShelved *shelved);

/* A renderer for the job, whose preset's window is set: an idle one, else a new one that the caller prepares without
 * the lock. NULL without memory. */
CtsLens *cts_cut_lens(CtsCut *cut, const CtsJob *job, const char *preset_json, bool *is_new);
/* failed: it is of no use. */
void cts_cut_give_back(CtsCut *cut, CtsLens *lens, bool failed);

#endif
