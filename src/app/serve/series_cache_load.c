/* Loading of series: find or fetch, read, process volumes, and free others to make room. */
#include "app/serve/series_cache.h"

#include "base/clock.h"
#include <stdlib.h>
#include <string.h>

static void free_processed(CtsProcessedVolume *processed)
{
    for (int i = 0; i < CTS_CACHED_RENDERERS; i++)
        cts_prepared_free(&processed->renderers[i].prepared);
    cts_model_free(&processed->model);
    free(processed->choice);
    free(processed);
}

CtsCachedRenderer *cts_cached_renderer_get(CtsProcessedVolume *processed, const CtsJob *job)
{
    CtsCachedRenderer *found = NULL, *oldest = NULL;
    for (int i = 0; i < CTS_CACHED_RENDERERS && !found; i++) {
        CtsCachedRenderer *const r = &processed->renderers[i];
        if (r->in_use)
            continue;
        oldest = !oldest || r->used_ms < oldest->used_ms ? r : oldest;
        found = cts_job_is_prepared(job, &r->prepared) ? r : NULL;
    }
    found = found ? found : oldest;
    found->in_use = true;
    return found;
}

void cts_cached_renderer_give_back(CtsProcessedVolume *processed, CtsCachedRenderer *renderer)
{
    renderer->in_use = false;
    renderer->used_ms = processed->used_ms = cts_wall_ms();
}

static void drop_processed(CtsSeriesCache *cache, CtsCachedSeries *s, CtsProcessedVolume *processed)
{
    CtsProcessedVolume **link = &s->processed_volumes;
    while (*link != processed)
        link = &(*link)->next;
    *link = processed->next;
    cache->bytes -= processed->bytes;
    free_processed(processed);
}

void cts_series_cache_drop(CtsSeriesCache *cache, CtsCachedSeries *s)
{
    while (s->processed_volumes)
        drop_processed(cache, s, s->processed_volumes);
    cache->bytes -= s->bytes;
    s->bytes = 0;
    cts_scanned_free(&s->loaded.scanned);
    cts_labels_free(&s->loaded.labels);
    if (!s->on_demand)
        return;
    cts_loaded_free(&s->loaded);
    s->series = NULL;
}

static uint64_t bytes_of(const CtsVolume *v)
{
    const uint64_t n = (uint64_t)v->dims[0] * (uint64_t)v->dims[1] * (uint64_t)v->dims[2];
    return n * sizeof *v->grey + n / 4; /* macro-cells, and data of renderers */
}

/* Frees the least recently used volume of a series. */
static bool drop_one_processed(CtsSeriesCache *cache, CtsCachedSeries *s)
{
    CtsProcessedVolume *oldest = NULL;
    for (CtsProcessedVolume *c = s->processed_volumes; c; c = c->next)
        if (c->n_users == 0 && (!oldest || c->used_ms < oldest->used_ms))
            oldest = c;
    if (oldest)
        drop_processed(cache, s, oldest);
    return oldest;
}

static bool make_room(CtsSeriesCache *cache, CtsCachedSeries *own, uint64_t bytes)
{
    while (cache->bytes + bytes > cache->max_bytes) {
        CtsCachedSeries *oldest = NULL;
        for (CtsCachedSeries *s = cache->first; s; s = s->next)
            if (s != own && !s->busy && !s->n_running && (s->bytes || s->processed_volumes) &&
                (!oldest || s->used_ms < oldest->used_ms))
                oldest = s;
        if (oldest)
            cts_series_cache_drop(cache, oldest);
        else if (!drop_one_processed(cache, own))
            return false;
    }
    cache->bytes += bytes;
    return true;
}

static CtsStatus reserve(CtsSeriesCache *cache, CtsCachedSeries *own, uint64_t bytes, CtsError *err)
{
    pthread_mutex_lock(cache->lock);
    const bool has = make_room(cache, own, bytes);
    const uint64_t most = cache->max_bytes;
    pthread_mutex_unlock(cache->lock);
    if (has)
        return CTS_OK;
    return cts_fail(err, CTS_ERR_MEMORY, "there is no room for %llu MiB more, `memory` allows %llu MiB in total",
                    (unsigned long long)(bytes >> 20), (unsigned long long)(most >> 20));
}

static void give_up_memory(CtsSeriesCache *cache, uint64_t bytes)
{
    pthread_mutex_lock(cache->lock);
    cache->bytes -= bytes;
    pthread_mutex_unlock(cache->lock);
}

static CtsStatus look_in(const char *path, const CtsSource *source, CtsCachedSeries *s, CtsReport *report,
                         CtsError *err)
{
    const CtsSeriesSearch search = {
        .paths = &path, .n_paths = 1, .n_threads = source->n_threads, .images = true, .rules = source->rules};
    const CtsStatus st = cts_series_search(&search, &s->loaded.list, report, err);
    return st ? st : cts_series_choose(s->loaded.list, s->uid, &s->loaded.series, err);
}

/* Tries each possible location in turn. */
static CtsStatus find_on_demand(const CtsSeriesCache *cache, const CtsSource *source, CtsCachedSeries *s,
                                CtsReport *report, CtsError *err)
{
    const CtsOptions *const o = cache->options;
    CtsStatus st = CTS_ERR_NO_SERIES;
    char *path;
    for (int i = 0; st && i < o->paths.n; i++)
        if ((path = cts_series_cache_path(o->paths.items[i], s->uid, ""))) {
            cts_loaded_free(&s->loaded);
            st = look_in(path, source, s, report, err);
            free(path);
        }
    if (st && o->from.given) {
        cts_loaded_free(&s->loaded);
        const CtsSeriesQuery wanted = {.study_uid = s->study_uid, .series_uid = s->uid};
        st = cts_net_fetch(&o->from.peer, &o->net, &wanted, &s->loaded.fetched, report, err);
        if (!st)
            st = look_in(s->loaded.fetched.folder, source, s, report, err);
    }
    if (!st && strcmp(s->loaded.series->study_uid, s->study_uid))
        st = CTS_ERR_NO_SERIES;
    if (st) {
        cts_loaded_free(&s->loaded);
        return st == CTS_ERR_MEMORY ? st : cts_fail(err, CTS_ERR_NO_SERIES, "there is no such series here");
    }
    return CTS_OK;
}

static CtsStatus read_cached_slices(CtsSeriesCache *cache, CtsCachedSeries *s, const CtsSource *source,
                                    CtsReport *report, CtsError *err)
{
    const uint64_t bytes =
        (uint64_t)s->series->columns * (uint64_t)s->series->rows * (uint64_t)s->series->n_slices * sizeof(uint16_t);
    CtsStatus st = s->bytes ? CTS_OK : reserve(cache, s, bytes, err);
    if (st)
        return st;
    const bool reserved = !s->bytes;
    CtsSource whole = *source;
    whole.remove_table = true;
    whole.paths = cache->options->paths.items;
    whole.n_paths = cache->options->paths.n;
    whole.labels = cache->options->labels.items;
    whole.n_labels = cache->options->labels.n;
    whole.label_names = cache->options->source.label_names;
    whole.labels_unnamed = true;
    whole.choice = (CtsLabelChoice){0};
    if (!s->loaded.labels)
        st = cts_source_labels(&whole, &s->loaded, report, err);
    if (!st)
        st = cts_source_read(&whole, &s->loaded, report, err);
    if (st && reserved)
        give_up_memory(cache, bytes);
    else if (!st)
        s->bytes = bytes;
    return st;
}

CtsStatus cts_series_cache_find(const CtsSeriesCache *cache, CtsCachedSeries *s, const CtsSource *source,
                                CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (!s->series && !(st = find_on_demand(cache, source, s, report, err))) {
        pthread_mutex_lock(cache->lock);
        s->series = s->loaded.series;
        pthread_mutex_unlock(cache->lock);
    }
    return st;
}

static CtsStatus make_processed(CtsSeriesCache *cache, CtsCachedSeries *s, const CtsSource *source,
                                CtsProcessedVolume **processed, CtsReport *report, CtsError *err)
{
    const uint64_t expected = bytes_of(s->loaded.scanned->even);
    CtsLoaded part = {
        .list = s->loaded.list, .series = s->series, .scanned = s->loaded.scanned, .labels = s->loaded.labels};
    CtsProcessedVolume *const made = calloc(1, sizeof *made);
    if (!made || !(made->choice = cts_source_choice(source))) {
        free(made);
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    CtsStatus st = reserve(cache, s, expected, err);
    if (!st && (st = cts_source_view(source, false, &part, report, err)))
        give_up_memory(cache, expected);
    made->model = part.model;
    if (st) {
        free_processed(made);
        return st;
    }
    pthread_mutex_lock(cache->lock);
    made->bytes = bytes_of(part.model.volume);
    cache->bytes += made->bytes - expected;
    made->next = s->processed_volumes;
    s->processed_volumes = *processed = made;
    pthread_mutex_unlock(cache->lock);
    return CTS_OK;
}

CtsStatus cts_series_cache_load(CtsSeriesCache *cache, CtsCachedSeries *s, const CtsSource *source,
                                CtsProcessedVolume **processed, CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (!s->series->renderable)
        st = cts_fail(err, s->series->refusal ? s->series->refusal : CTS_ERR_GEOMETRY, "%s", s->series->reason);
    if (!st && !(s->loaded.scanned && s->loaded.scanned->even->grey))
        st = read_cached_slices(cache, s, source, report, err);
    if (st)
        return st;
    pthread_mutex_lock(cache->lock);
    *processed = cts_series_cache_volume(s, source); /* it may be there since */
    pthread_mutex_unlock(cache->lock);
    return *processed ? CTS_OK : make_processed(cache, s, source, processed, report, err);
}
