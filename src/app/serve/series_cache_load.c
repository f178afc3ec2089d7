/* Loading of series: find or fetch, read, process volumes, and free others to make room. */
#include "app/serve/series_cache.h"

#include "base/clock.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Idle renderers of one volume: as many presets as a page has at hand. */
enum { IDLE_LENSES = 6 };

static void free_lens(CtsCachedRenderer *lens)
{
    cts_render_end(&lens->prepared.renderer);
    free(lens->preset);
    free(lens);
}

static void free_cut(CtsProcessedVolume *cut)
{
    for (CtsCachedRenderer *l = cut->lenses, *next; l; l = next) {
        next = l->next;
        free_lens(l);
    }
    cts_volume_free(&cut->volume);
    free(cut->choice);
    free(cut);
}

/* Frees the least recently used ones that are idle. */
static void drop_idle(CtsProcessedVolume *cut)
{
    int n = 0;
    CtsCachedRenderer **oldest = NULL;
    for (CtsCachedRenderer **l = &cut->lenses; *l; l = &(*l)->next)
        if (!(*l)->in_use) {
            n++;
            if (!oldest || (*l)->used_ms < (*oldest)->used_ms)
                oldest = l;
        }
    if (n <= IDLE_LENSES)
        return;
    CtsCachedRenderer *const gone = *oldest;
    *oldest = gone->next;
    free_lens(gone);
}

CtsCachedRenderer *cts_cached_renderer_get(CtsProcessedVolume *cut, const CtsJob *job, const char *preset_json,
                                           bool *is_new)
{
    CtsCachedRenderer *l = cut->lenses;
    while (l && (l->in_use || strcmp(l->preset, preset_json) || !cts_job_again(job, &l->prepared)))
        l = l->next;
    *is_new = !l;
    if (!l && (l = calloc(1, sizeof *l))) {
        if (!(l->preset = strdup(preset_json))) {
            free(l);
            return NULL;
        }
        l->next = cut->lenses;
        cut->lenses = l;
    }
    if (l)
        l->in_use = true;
    return l;
}

void cts_cached_renderer_give_back(CtsProcessedVolume *cut, CtsCachedRenderer *lens, bool failed)
{
    lens->in_use = false;
    lens->used_ms = cut->used_ms = cts_wall_ms();
    CtsCachedRenderer **link = &cut->lenses;
    while (*link != lens)
        link = &(*link)->next;
    if (failed) {
        *link = lens->next;
        free_lens(lens);
    }
    drop_idle(cut);
}

static void drop_cut(CtsSeriesCache *shelf, CtsCachedSeries *s, CtsProcessedVolume *cut)
{
    CtsProcessedVolume **link = &s->cuts;
    while (*link != cut)
        link = &(*link)->next;
    *link = cut->next;
    shelf->bytes -= cut->bytes;
    free_cut(cut);
}

void cts_series_cache_drop(CtsSeriesCache *shelf, CtsCachedSeries *s)
{
    while (s->cuts)
        drop_cut(shelf, s, s->cuts);
    shelf->bytes -= s->bytes;
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

static bool is_idle(const CtsCachedSeries *s)
{
    return !s->busy && s->n_running == 0 && (s->bytes || s->cuts);
}

/* Frees the least recently used volume of a series. */
static bool drop_one_cut(CtsSeriesCache *shelf, CtsCachedSeries *s)
{
    CtsProcessedVolume *oldest = NULL;
    for (CtsProcessedVolume *c = s->cuts; c; c = c->next)
        if (c->n_users == 0 && (!oldest || c->used_ms < oldest->used_ms))
            oldest = c;
    if (oldest)
        drop_cut(shelf, s, oldest);
    return oldest;
}

static bool make_room(CtsSeriesCache *shelf, CtsCachedSeries *own, uint64_t bytes)
{
    while (shelf->bytes + bytes > shelf->most_bytes) {
        CtsCachedSeries *oldest = NULL;
        for (CtsCachedSeries *s = shelf->first; s; s = s->next)
            if (s != own && is_idle(s) && (!oldest || s->used_ms < oldest->used_ms))
                oldest = s;
        if (oldest)
            cts_series_cache_drop(shelf, oldest);
        else if (!drop_one_cut(shelf, own))
            return false;
    }
    shelf->bytes += bytes;
    return true;
}

static CtsStatus reserve(CtsSeriesCache *shelf, pthread_mutex_t *lock, CtsCachedSeries *own, uint64_t bytes,
                         CtsError *err)
{
    pthread_mutex_lock(lock);
    const bool has = make_room(shelf, own, bytes);
    const uint64_t most = shelf->most_bytes;
    pthread_mutex_unlock(lock);
    if (has)
        return CTS_OK;
    return cts_fail(err, CTS_ERR_MEMORY, "there is no room for %llu MiB more, `memory` allows %llu MiB in total",
                    (unsigned long long)(bytes >> 20), (unsigned long long)(most >> 20));
}

static void give_up(CtsSeriesCache *shelf, pthread_mutex_t *lock, uint64_t bytes)
{
    pthread_mutex_lock(lock);
    shelf->bytes -= bytes;
    pthread_mutex_unlock(lock);
}

static CtsStatus look_in(const char *path, const CtsSource *source, CtsCachedSeries *s, CtsReport *report,
                         CtsError *err)
{
    const CtsSeriesSearch search = {
        .paths = &path, .n_paths = 1, .n_threads = source->n_threads, .rules = source->rules};
    const CtsStatus st = cts_series_search(&search, &s->loaded.list, report, err);
    return st ? st : cts_series_choose(s->loaded.list, s->uid, &s->loaded.series, err);
}

/* Tries each possible location in turn. */
static CtsStatus find_on_demand(const CtsSeriesCache *shelf, const CtsSource *source, CtsCachedSeries *s,
                                CtsReport *report, CtsError *err)
{
    const CtsOptions *const o = shelf->options;
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
        st = cts_net_fetch(&o->from.peer, &o->net, s->study_uid, s->uid, &s->loaded.fetched, report, err);
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

static CtsStatus read_slices(CtsSeriesCache *shelf, pthread_mutex_t *lock, CtsCachedSeries *s, const CtsSource *source,
                             CtsReport *report, CtsError *err)
{
    const uint64_t bytes =
        (uint64_t)s->series->columns * (uint64_t)s->series->rows * (uint64_t)s->series->n_slices * sizeof(uint16_t);
    CtsStatus st = s->bytes ? CTS_OK : reserve(shelf, lock, s, bytes, err);
    if (st)
        return st;
    const bool reserved = !s->bytes;
    CtsSource whole = *source;
    whole.remove_table = true;
    whole.paths = shelf->options->paths.items;
    whole.n_paths = shelf->options->paths.n;
    whole.labels = shelf->options->labels.items;
    whole.n_labels = shelf->options->labels.n;
    whole.label_names = shelf->options->source.label_names;
    whole.labels_unnamed = true;
    whole.choice = (CtsLabelChoice){0};
    if (!s->loaded.labels)
        st = cts_source_labels(&whole, &s->loaded, report, err);
    if (!st)
        st = cts_source_read(&whole, &s->loaded, report, err);
    if (st && reserved)
        give_up(shelf, lock, bytes);
    else if (!st)
        s->bytes = bytes;
    return st;
}

static CtsStatus read_once(CtsSeriesCache *shelf, pthread_mutex_t *lock, CtsCachedSeries *s, const CtsSource *source,
                           CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (!s->series && !(st = find_on_demand(shelf, source, s, report, err))) {
        pthread_mutex_lock(lock);
        s->series = s->loaded.series;
        pthread_mutex_unlock(lock);
    }
    if (!st && !s->series->renderable)
        st = cts_fail(err, s->series->refusal ? s->series->refusal : CTS_ERR_GEOMETRY, "%s", s->series->reason);
    if (!st && !(s->loaded.scanned && s->loaded.scanned->even->grey))
        st = read_slices(shelf, lock, s, source, report, err);
    return st;
}

CtsStatus cts_series_cache_make(CtsSeriesCache *shelf, pthread_mutex_t *lock, CtsCachedSeries *s,
                                const CtsSource *source, CtsProcessedVolume **cut, CtsReport *report, CtsError *err)
{
    CtsProcessedVolume *made = calloc(1, sizeof *made);
    if (made && !(made->choice = cts_source_choice(source))) {
        free(made);
        made = NULL;
    }
    CtsStatus st = made ? read_once(shelf, lock, s, source, report, err) : CTS_ERR_MEMORY;
    if (!st && !(st = reserve(shelf, lock, s, bytes_of(s->loaded.scanned->even), err))) {
        const uint64_t expected = bytes_of(s->loaded.scanned->even);
        CtsLoaded part = {
            .list = s->loaded.list, .series = s->series, .scanned = s->loaded.scanned, .labels = s->loaded.labels};
        if ((st = cts_source_view(source, false, &part, report, err))) {
            cts_volume_free(&part.volume);
            give_up(shelf, lock, expected);
        } else {
            pthread_mutex_lock(lock);
            made->volume = part.volume;
            made->bytes = bytes_of(part.volume);
            shelf->bytes += made->bytes - expected;
            made->next = s->cuts;
            s->cuts = made;
            pthread_mutex_unlock(lock);
        }
    }
    if (st && made)
        free_cut(made);
    *cut = st ? NULL : made;
    return st;
}
