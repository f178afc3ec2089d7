/* Series that can be asked for, and what is loaded of them: what was scanned, volumes made of it, renderers of those.
 * What was not asked for longest goes first. Not thread-safe: the caller holds its lock wherever nothing else is said.
 */
#ifndef CTS_SERVE_SHELF_H
#define CTS_SERVE_SHELF_H

#include "app/job/render_job.h"
#include "app/words/options.h"
#include "base/site_key.h"
#include <pthread.h>

/* What stands in a PATH for the UID of the series that is asked for. */
#define CTS_SHELF_PLACE "{series_uid}"

/* A renderer of one preset; what it keeps serves the next picture. */
typedef struct CtsLens {
    char *preset; /* as JSON, as it was asked for */
    CtsPrepared prepared;
    bool in_use;
    double used_ms;
    struct CtsLens *next;
} CtsLens;

/* A volume made of what was scanned. */
typedef struct CtsCut {
    char *choice; /* what it was made by */
    CtsVolume *volume;
    CtsLens *lenses;
    uint64_t bytes;
    int n_users;
    double used_ms;
    struct CtsCut *next;
} CtsCut;

typedef struct CtsShelved {
    char id[17]; /* a name that tells nothing: a hash under the site's key */
    char uid[65], study_uid[65];
    const CtsSeries *series; /* NULL: not fetched yet */
    CtsLoaded loaded;        /* without a volume */
    bool on_demand;          /* found or fetched when it is asked for, and forgotten with its volumes */
    bool busy;               /* one thread reads it, or makes a volume */
    int n_asked, n_running;  /* pictures that wait or are under way, and the latter alone */
    uint64_t bytes;          /* of what was scanned */
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

/* NULL for none. */
CtsShelved *cts_shelf_by_id(CtsShelf *shelf, const char *id);
/* By its UIDs; one that is only known to a peer, or to a path with {series_uid} in it, gets its place. */
CtsStatus cts_shelf_by_uid(CtsShelf *shelf, const char *study_uid, const char *uid, CtsShelved **found, CtsError *err);
/* PATH with a series' UID in place of {series_uid}, and more behind it; NULL where it has no such place, or without
 * memory. */
char *cts_shelf_path(const char *pattern, const char *uid, const char *more);
/* The file of a presentation state among the paths, or SOP_UID.dcm in a path with {series_uid}; to be freed with
 * free(). NULL for none. */
char *cts_shelf_state(const CtsShelf *shelf, const char *series_uid, const char *sop_uid);
/* How many slices of a series that is found this object holds. */
int cts_shelved_count(const CtsShelved *shelved, const char *sop_uid);
/* The one volume of a study. */
CtsStatus cts_shelf_of_study(CtsShelf *shelf, const char *study_uid, CtsShelved **found, CtsError *err);

/* Forgets what is nowhere to be found. */
void cts_shelf_sweep(CtsShelf *shelf);

/* The volume of these, or NULL. */
CtsCut *cts_shelf_cut(const CtsShelved *shelved, const CtsSource *source);

/* Without the lock, for shelved->busy's owner: read what is not read, and make the volume. Takes lock where it needs
 * it. CTS_ERR_MEMORY where there is no room for it. */
CtsStatus cts_shelf_make(CtsShelf *shelf, pthread_mutex_t *lock, CtsShelved *shelved, const CtsSource *source,
                         CtsCut **cut, CtsReport *report, CtsError *err);

/* What is loaded of a series goes; nobody uses it. */
void cts_shelf_drop(CtsShelf *shelf, CtsShelved *shelved);

/* A renderer for the job, whose preset's window is known: one that is idle, else *lens is a new one that the caller
 * prepares without the lock. NULL without memory. */
CtsLens *cts_cut_lens(CtsCut *cut, const CtsJob *job, const char *preset_json, bool *is_new);
/* failed: it is of no use. */
void cts_cut_give_back(CtsCut *cut, CtsLens *lens, bool failed);

#endif
