#include "app/serve/series_cache.h"

#include "base/mem.h"
#include "base/text.h"
#include "dicom/header/slice.h"
#include "output/report/redact.h"
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

static CtsStatus add_cached(CtsSeriesCache *cache, const char *study_uid, const char *uid, int part,
                            CtsCachedSeries **added, CtsError *err)
{
    CtsCachedSeries *s = calloc(1, sizeof *s), **end = &cache->first;
    char text[96];
    snprintf(text, sizeof text, "%s#%d", uid, part);
    char *const hash = s ? cts_uid_hash(&cache->key, text) : NULL;
    if (!hash) {
        free(s);
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    snprintf(s->id, sizeof s->id, "%s", hash);
    snprintf(s->uid, sizeof s->uid, "%s", uid);
    snprintf(s->study_uid, sizeof s->study_uid, "%s", study_uid);
    free(hash);
    while (*end)
        end = &(*end)->next;
    *end = *added = s;
    return CTS_OK;
}

/* Without a site key, series names last as long as the server. */
static CtsStatus find_site_key(CtsSeriesCache *cache, CtsError *err)
{
    CtsError why;
    if (!cts_key_load(cache->options->export.key, !cache->options->export.key, &cache->key, &why))
        return CTS_OK;
    if (cache->options->export.key) {
        *err = why;
        return why.status;
    }
    return getrandom(cache->key.bytes, sizeof cache->key.bytes, 0) == sizeof cache->key.bytes
               ? CTS_OK
               : cts_fail(err, CTS_ERR_READ, "no random numbers are available");
}

/* Presentation states are among the files that the search skips. */
static CtsStatus find_states(CtsSeriesCache *cache, CtsError *err)
{
    const CtsSeriesList *const list = cache->list;
    json_t *const slices = json_object(); /* paths of files with slices */
    for (size_t i = 0; i < list->n; i++)
        for (int s = 0; s < list->items[i].n_slices; s++)
            json_object_set_new_nocheck(slices, list->items[i].slices[s]->path, json_true());
    cache->states = calloc((size_t)list->n_not_ct + 1, sizeof *cache->states);
    for (size_t i = 0; cache->states && i < list->n_paths && cache->n_states < (size_t)list->n_not_ct; i++) {
        CtsCachedState *const state = &cache->states[cache->n_states];
        state->path = list->paths[i];
        cache->n_states += !json_object_get(slices, state->path) && !cts_state_uid(state->path, state->sop_uid, NULL);
    }
    json_decref(slices);
    return cache->states ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

char *cts_series_cache_path(const char *pattern, const char *uid, const char *more)
{
    const char *at = strstr(pattern, CTS_SERIES_UID_MARKER);
    char *path;
    if (!at ||
        asprintf(&path, "%.*s%s%s%s", (int)(at - pattern), pattern, uid, at + strlen(CTS_SERIES_UID_MARKER), more) < 0)
        return NULL;
    return path;
}

char *cts_series_cache_state(const CtsSeriesCache *cache, const char *series_uid, const char *sop_uid)
{
    const CtsTextList *const paths = &cache->options->paths;
    char name[80], uid[65];
    for (size_t i = 0; i < cache->n_states; i++)
        if (!strcmp(cache->states[i].sop_uid, sop_uid))
            return strdup(cache->states[i].path);
    snprintf(name, sizeof name, "/%s.dcm", sop_uid);
    for (int i = 0; i < paths->n && cts_uid_is_valid(series_uid) && cts_uid_is_valid(sop_uid); i++) {
        char *const path = cts_series_cache_path(paths->items[i], series_uid, name);
        if (path && !cts_state_uid(path, uid, NULL) && !strcmp(uid, sop_uid))
            return path;
        free(path);
    }
    return NULL;
}

CtsStatus cts_series_cache_fill(CtsSeriesCache *cache, const CtsOptions *options, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    const char **paths = calloc((size_t)options->paths.n + 1, sizeof *paths);
    int n = 0;
    cache->options = options;
    cache->max_bytes = options->memory_bytes ? options->memory_bytes : cts_memory_available() / 2;
    if (!paths)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (!cache->max_bytes) {
        free(paths);
        return cts_fail(err, CTS_ERR_USAGE, "the amount of free memory is unknown (give `memory` SIZE)");
    }
    for (int i = 0; i < options->paths.n; i++)
        if (!strstr(options->paths.items[i], CTS_SERIES_UID_MARKER))
            paths[n++] = options->paths.items[i];
    st = find_site_key(cache, err);
    const CtsSeriesSearch search = {.paths = paths,
                                    .n_paths = n,
                                    .n_threads = options->render.n_threads,
                                    .images = true,
                                    .rules = options->source.rules};
    if (!st && n)
        st = cts_series_search(&search, &cache->list, report, err);
    for (size_t i = 0; !st && cache->list && i < cache->list->n; i++) {
        CtsSeries *const series = &cache->list->items[i];
        CtsCachedSeries *s;
        if (!(st = add_cached(cache, series->study_uid, series->uid, series->part, &s, err)))
            s->series = s->loaded.series = series;
    }
    if (!st && cache->list)
        st = find_states(cache, err);
    free(paths);
    return st;
}

void cts_series_cache_free(CtsSeriesCache *cache)
{
    for (CtsCachedSeries *s = cache->first, *next; s; s = next) {
        next = s->next;
        cts_series_cache_drop(cache, s);
        free(s);
    }
    free(cache->states);
    cts_series_list_free(&cache->list);
    *cache = (CtsSeriesCache){0};
}

CtsCachedSeries *cts_series_cache_by_id(CtsSeriesCache *cache, const char *id)
{
    CtsCachedSeries *s = cache->first;
    while (s && strcmp(s->id, id))
        s = s->next;
    return s;
}

void cts_series_cache_sweep(CtsSeriesCache *cache)
{
    for (CtsCachedSeries **link = &cache->first; *link;) {
        CtsCachedSeries *const s = *link;
        if (s->on_demand && !s->bytes && !s->processed_volumes && s->n_requested == 0) {
            *link = s->next;
            cts_series_cache_drop(cache, s);
            free(s);
        } else {
            link = &s->next;
        }
    }
}

static bool can_be_had(const CtsSeriesCache *cache)
{
    bool can = cache->options->from.given;
    for (int i = 0; i < cache->options->paths.n; i++)
        can |= strstr(cache->options->paths.items[i], CTS_SERIES_UID_MARKER) != NULL;
    return can;
}

/* Of several volumes under one UID the one with the object, or the first that can be rendered. */
static CtsCachedSeries *find_uid(const CtsSeriesCache *cache, const char *study_uid, const char *uid,
                                 const char *sop_uid, int frame)
{
    CtsCachedSeries *found = NULL;
    for (CtsCachedSeries *s = cache->first; s; s = s->next)
        if (!strcmp(s->uid, uid) && !strcmp(s->study_uid, study_uid) &&
            (!found || (sop_uid[0] && s->series && cts_series_count(s->series, sop_uid, frame)) ||
             (found->series && !found->series->renderable && s->series && s->series->renderable)))
            found = s;
    return found;
}

CtsStatus cts_series_cache_by_uid(CtsSeriesCache *cache, const char *study_uid, const char *uid, const char *sop_uid,
                                  int frame, CtsCachedSeries **found, CtsError *err)
{
    *found = find_uid(cache, study_uid, uid, sop_uid, frame);
    if (*found)
        return CTS_OK;
    if (!cts_uid_is_valid(study_uid) || !cts_uid_is_valid(uid) || !can_be_had(cache))
        return cts_fail(err, CTS_ERR_NO_SERIES, "there is no such series here");
    const CtsStatus st = add_cached(cache, study_uid, uid, 0, found, err);
    if (!st)
        (*found)->on_demand = true;
    return st;
}

static double volume_size(const CtsCachedSeries *s)
{
    return s->series->renderable ? (double)s->series->columns * s->series->rows * s->series->n_slices : 0;
}

CtsStatus cts_series_cache_of_study(CtsSeriesCache *cache, const char *study_uid, bool thumbnail,
                                    CtsCachedSeries **found, CtsError *err)
{
    int n = 0;
    *found = NULL;
    for (CtsCachedSeries *s = cache->first; s; s = s->next)
        if (!strcmp(s->study_uid, study_uid) && s->series && (thumbnail || s->series->renderable)) {
            if (!*found || volume_size(s) > volume_size(*found))
                *found = s;
            n++;
        }
    if (n == 0)
        return cts_fail(err, CTS_ERR_NO_SERIES, "there is no volume of such a study here");
    return thumbnail || n == 1
               ? CTS_OK
               : cts_fail(err, CTS_ERR_USAGE, "the study has %d volumes (ask for one: /studies/.../series/...)", n);
}

CtsProcessedVolume *cts_series_cache_volume(const CtsCachedSeries *s, const CtsSource *source)
{
    CtsProcessedVolume *c = s->processed_volumes;
    char *const choice = cts_source_choice(source);
    while (c && choice && strcmp(c->choice, choice))
        c = c->next;
    c = choice ? c : NULL;
    free(choice);
    return c;
}
