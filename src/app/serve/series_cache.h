/* The series cache: available series, and for loaded ones the scanned slices, processed volumes and renderers. The
 * least recently used is freed first. Not thread-safe: the caller holds its lock except where noted. */
#pragma once

#include "app/job/render_job.h"
#include "app/options/options.h"
#include "base/site_key.h"
#include <pthread.h>

/* Marker in a PATH for the UID of the requested series. */
#define CTS_SERIES_UID_MARKER "{series_uid}"

/* A renderer of one preset, cached for further pictures. */
typedef struct CtsCachedRenderer {
    CtsPrepared prepared;
    bool in_use;
    double used_ms; /* when it was given back last; 0: never */
} CtsCachedRenderer;

/* Largest number of renderers of one volume, each of one preset: ctsplat's own six for volumes, bone to metal. */
enum { CTS_CACHED_RENDERERS = 6 };

/* A volume processed from the scanned slices. */
typedef struct CtsProcessedVolume {
    char *choice; /* identifies the processing (cts_source_choice()) */
    CtsModel model;
    CtsCachedRenderer renderers[CTS_CACHED_RENDERERS];
    uint64_t bytes;
    int n_users;
    double used_ms;
    struct CtsProcessedVolume *next;
} CtsProcessedVolume;

typedef struct CtsCachedSeries {
    char id[17]; /* an opaque name: a hash under the site's key */
    char uid[65], study_uid[65];
    const CtsSeries *series;    /* NULL: not fetched yet */
    CtsLoaded loaded;           /* without a volume */
    bool on_demand;             /* found or fetched on request, and removed with its volumes */
    bool busy;                  /* one thread reads it, or makes a volume */
    int n_requested, n_running; /* queued and running pictures; running pictures */
    uint64_t bytes;             /* of the scanned slices */
    double used_ms;
    CtsProcessedVolume *processed_volumes;
    struct CtsCachedSeries *next;
} CtsCachedSeries;

/* A presentation state among the files that are no slices. */
typedef struct CtsCachedState {
    char sop_uid[65];
    const char *path; /* the series list's */
} CtsCachedState;

typedef struct CtsSeriesCache {
    const CtsOptions *options;
    pthread_mutex_t *lock; /* the caller's */
    CtsSeriesList *list;
    CtsKey key;
    CtsCachedSeries *first;
    CtsCachedState *states;
    size_t n_states;
    uint64_t max_bytes, bytes;
} CtsSeriesCache;

/* Searches the paths. Free with cts_series_cache_free(), also after a failure. */
CtsStatus cts_series_cache_fill(CtsSeriesCache *cache, const CtsOptions *options, CtsReport *report, CtsError *err);
void cts_series_cache_free(CtsSeriesCache *cache);

/* NULL if there is none. */
CtsCachedSeries *cts_series_cache_by_id(CtsSeriesCache *cache, const char *id);
/* Finds by UIDs, that of an object may be "", its frame, from 1, 0; adds a series known only to a peer, or to a path
 * with {series_uid} in it. */
CtsStatus cts_series_cache_by_uid(CtsSeriesCache *cache, const char *study_uid, const char *uid, const char *sop_uid,
                                  int frame, CtsCachedSeries **found, CtsError *err);
/* PATH with a series' UID in place of {series_uid}, and more behind it; NULL where it has no such place, or without
 * memory. */
char *cts_series_cache_path(const char *pattern, const char *uid, const char *more);
/* The path of a presentation state among the paths, or SOP_UID.dcm in a path with {series_uid}; free with free(). NULL
 * if there is none. */
char *cts_series_cache_state(const CtsSeriesCache *cache, const char *series_uid, const char *sop_uid);
/* The one volume of a study; for a thumbnail the largest, or its first series without a volume. */
CtsStatus cts_series_cache_of_study(CtsSeriesCache *cache, const char *study_uid, bool thumbnail,
                                    CtsCachedSeries **found, CtsError *err);

/* Removes series loaded on demand that are no longer available. */
void cts_series_cache_sweep(CtsSeriesCache *cache);

/* The volume of these, or NULL. */
CtsProcessedVolume *cts_series_cache_volume(const CtsCachedSeries *cached, const CtsSource *source);

/* Without the lock, by the holder of cached->busy: finds the series if needed; reads one that was found, and processes
 * its volume. Take the lock where they need it. CTS_ERR_MEMORY without enough memory. */
CtsStatus cts_series_cache_find(const CtsSeriesCache *cache, CtsCachedSeries *cached, const CtsSource *source,
                                CtsReport *report, CtsError *err);
CtsStatus cts_series_cache_load(CtsSeriesCache *cache, CtsCachedSeries *cached, const CtsSource *source,
                                CtsProcessedVolume **processed, CtsReport *report, CtsError *err);

/* Frees the loaded data of a series that is not in use. */
void cts_series_cache_drop(CtsSeriesCache *cache, CtsCachedSeries *cached);

/* An idle renderer for the job, whose preset's window is set: one that is prepared for it, else the least recently
 * used, which the caller prepares without the lock. Users are fewer than renderers. */
CtsCachedRenderer *cts_cached_renderer_get(CtsProcessedVolume *processed, const CtsJob *job);
void cts_cached_renderer_give_back(CtsProcessedVolume *processed, CtsCachedRenderer *renderer);
