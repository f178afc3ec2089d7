#include "app/serve/shelf.h"

#include "base/clock.h"
#include "base/mem.h"
#include "input/header/slice.h"
#include "output/report/masked.h"
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

/* Idle renderers of one volume: as many presets as a page has at hand. */
enum { IDLE_LENSES = 6 };

static const char PLACE[] = "{series_uid}";

static void free_lens(CtsLens *lens)
{
    cts_render_end(&lens->prepared.renderer);
    free(lens->preset);
    free(lens);
}

static void free_cut(CtsCut *cut)
{
    for (CtsLens *l = cut->lenses, *next; l; l = next) {
        next = l->next;
        free_lens(l);
    }
    cts_volume_free(&cut->volume);
    free(cut->choice);
    free(cut);
}

static void drop_cut(CtsShelf *shelf, CtsShelved *s, CtsCut *cut)
{
    CtsCut **link = &s->cuts;
    while (*link != cut)
        link = &(*link)->next;
    *link = cut->next;
    shelf->bytes -= cut->bytes;
    free_cut(cut);
}

static void drop_loaded(CtsShelf *shelf, CtsShelved *s)
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

static CtsStatus name_it(CtsShelf *shelf, CtsShelved *s, int part, CtsError *err)
{
    char text[96];
    snprintf(text, sizeof text, "%s#%d", s->uid, part);
    char *hash = cts_uid_hash(&shelf->key, text);
    if (!hash)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    snprintf(s->id, sizeof s->id, "%s", hash);
    free(hash);
    return CTS_OK;
}

static CtsStatus add(CtsShelf *shelf, const char *study_uid, const char *uid, int part, CtsShelved **added,
                     CtsError *err)
{
    CtsShelved *s = calloc(1, sizeof *s), **end = &shelf->first;
    if (!s)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    snprintf(s->uid, sizeof s->uid, "%s", uid);
    snprintf(s->study_uid, sizeof s->study_uid, "%s", study_uid);
    const CtsStatus st = name_it(shelf, s, part, err);
    if (st) {
        free(s);
        return st;
    }
    while (*end)
        end = &(*end)->next;
    *end = *added = s;
    return CTS_OK;
}

/* Where a key cannot be had, names last as long as the server. */
static CtsStatus find_key(CtsShelf *shelf, CtsError *err)
{
    CtsError why;
    if (!cts_key_load(shelf->options->export.key, !shelf->options->export.key, &shelf->key, &why))
        return CTS_OK;
    if (shelf->options->export.key) {
        *err = why;
        return why.status;
    }
    return getrandom(shelf->key.bytes, sizeof shelf->key.bytes, 0) == sizeof shelf->key.bytes
               ? CTS_OK
               : cts_fail(err, CTS_ERR_READ, "no random numbers can be had");
}

static int by_text(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* The files of all slices, in order; *n of them. */
static const char **slice_paths(const CtsSeriesList *list, size_t *n)
{
    size_t k = 0;
    *n = 0;
    for (size_t i = 0; i < list->n; i++)
        *n += (size_t)list->items[i].n_slices;
    const char **paths = calloc(*n + 1, sizeof *paths);
    for (size_t i = 0; paths && i < list->n; i++)
        for (int s = 0; s < list->items[i].n_slices; s++)
            paths[k++] = list->items[i].slices[s]->path;
    if (paths)
        qsort(paths, *n, sizeof *paths, by_text);
    return paths;
}

/* Presentation states are among what is passed over. */
static CtsStatus find_states(CtsShelf *shelf, CtsError *err)
{
    const CtsSeriesList *const list = shelf->list;
    size_t n_slices;
    const char **slices = slice_paths(list, &n_slices);
    shelf->states = calloc((size_t)list->n_not_ct + 1, sizeof *shelf->states);
    if (!slices || !shelf->states) {
        free(slices);
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    for (size_t i = 0; i < list->n_paths && shelf->n_states < (size_t)list->n_not_ct; i++) {
        CtsShelvedState *const state = &shelf->states[shelf->n_states];
        if (!bsearch(&list->paths[i], slices, n_slices, sizeof *slices, by_text) &&
            !cts_state_uid(list->paths[i], state->sop_uid, NULL)) {
            state->path = list->paths[i];
            shelf->n_states++;
        }
    }
    free(slices);
    return CTS_OK;
}

const char *cts_shelf_state(const CtsShelf *shelf, const char *sop_uid)
{
    for (size_t i = 0; i < shelf->n_states; i++)
        if (!strcmp(shelf->states[i].sop_uid, sop_uid))
            return shelf->states[i].path;
    return NULL;
}

int cts_shelved_count(const CtsShelved *shelved, const char *sop_uid)
{
    const CtsSeries *const s = shelved->series;
    int n = 0;
    for (int i = 0; i < s->n_slices; i++)
        n += !strcmp(s->slices[i]->sop_uid, sop_uid);
    return n;
}

CtsStatus cts_shelf_fill(CtsShelf *shelf, const CtsOptions *options, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    const char **paths = calloc((size_t)options->paths.n + 1, sizeof *paths);
    int n = 0;
    shelf->options = options;
    shelf->most_bytes = options->memory_bytes ? options->memory_bytes : cts_memory_available() / 2;
    if (!paths)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (!shelf->most_bytes) {
        free(paths);
        return cts_fail(err, CTS_ERR_USAGE, "how much memory is free is not known here (give `memory` SIZE)");
    }
    for (int i = 0; i < options->paths.n; i++)
        if (!strstr(options->paths.items[i], PLACE))
            paths[n++] = options->paths.items[i];
    st = find_key(shelf, err);
    if (!st && n)
        st = cts_series_find(paths, n, options->render.n_threads, &shelf->list, report, err);
    for (size_t i = 0; !st && shelf->list && i < shelf->list->n; i++) {
        CtsSeries *const series = &shelf->list->items[i];
        CtsShelved *s;
        if (!(st = add(shelf, series->study_uid, series->uid, series->part, &s, err)))
            s->series = s->loaded.series = series;
    }
    if (!st && shelf->list)
        st = find_states(shelf, err);
    free(paths);
    return st;
}

void cts_shelf_free(CtsShelf *shelf)
{
    for (CtsShelved *s = shelf->first, *next; s; s = next) {
        next = s->next;
        drop_loaded(shelf, s);
        free(s);
    }
    free(shelf->states);
    cts_series_list_free(&shelf->list);
    *shelf = (CtsShelf){0};
}

CtsShelved *cts_shelf_by_id(CtsShelf *shelf, const char *id)
{
    CtsShelved *s = shelf->first;
    while (s && strcmp(s->id, id))
        s = s->next;
    return s;
}

void cts_shelf_sweep(CtsShelf *shelf)
{
    for (CtsShelved **link = &shelf->first; *link;) {
        CtsShelved *const s = *link;
        if (s->on_demand && !s->series && s->n_asked == 0) {
            *link = s->next;
            free(s);
        } else {
            link = &s->next;
        }
    }
}

static bool is_uid(const char *text)
{
    const size_t n = strlen(text);
    return n > 0 && n <= 64 && strspn(text, "0123456789.") == n && text[0] != '.';
}

static bool can_be_had(const CtsShelf *shelf)
{
    bool can = shelf->options->from.given;
    for (int i = 0; i < shelf->options->paths.n; i++)
        can |= strstr(shelf->options->paths.items[i], PLACE) != NULL;
    return can;
}

/* Of several volumes under one UID the first that can be rendered. */
static CtsShelved *find_uid(const CtsShelf *shelf, const char *study_uid, const char *uid)
{
    CtsShelved *found = NULL;
    for (CtsShelved *s = shelf->first; s; s = s->next)
        if (!strcmp(s->uid, uid) && !strcmp(s->study_uid, study_uid) &&
            (!found || (found->series && !found->series->renderable && s->series && s->series->renderable)))
            found = s;
    return found;
}

CtsStatus cts_shelf_by_uid(CtsShelf *shelf, const char *study_uid, const char *uid, CtsShelved **found, CtsError *err)
{
    *found = find_uid(shelf, study_uid, uid);
    if (*found)
        return CTS_OK;
    if (!is_uid(study_uid) || !is_uid(uid) || !can_be_had(shelf))
        return cts_fail(err, CTS_ERR_NO_SERIES, "there is no such series here");
    const CtsStatus st = add(shelf, study_uid, uid, 0, found, err);
    if (!st)
        (*found)->on_demand = true;
    return st;
}

CtsStatus cts_shelf_of_study(CtsShelf *shelf, const char *study_uid, CtsShelved **found, CtsError *err)
{
    int n = 0;
    *found = NULL;
    for (CtsShelved *s = shelf->first; s; s = s->next)
        if (!strcmp(s->study_uid, study_uid) && s->series && s->series->renderable) {
            *found = s;
            n++;
        }
    if (n == 0)
        return cts_fail(err, CTS_ERR_NO_SERIES, "there is no volume of such a study here");
    return n == 1 ? CTS_OK
                  : cts_fail(err, CTS_ERR_USAGE, "the study has %d volumes (ask for one: /studies/.../series/...)", n);
}

static bool same_cut(const CtsSource *a, const CtsSource *b)
{
    return a->remove_table == b->remove_table && a->interpolation == b->interpolation && a->smooth_mm == b->smooth_mm &&
           a->crop == b->crop &&
           (!a->crop || (!memcmp(a->crop_low_lps, b->crop_low_lps, sizeof a->crop_low_lps) &&
                         !memcmp(a->crop_high_lps, b->crop_high_lps, sizeof a->crop_high_lps)));
}

CtsCut *cts_shelf_cut(const CtsShelved *s, const CtsSource *source)
{
    CtsCut *c = s->cuts;
    char *const choice = cts_source_choice(source);
    while (c && choice && (!same_cut(&c->source, source) || strcmp(c->choice, choice)))
        c = c->next;
    c = choice ? c : NULL;
    free(choice);
    return c;
}

static uint64_t bytes_of(const CtsVolume *v)
{
    const uint64_t n = (uint64_t)v->dims[0] * (uint64_t)v->dims[1] * (uint64_t)v->dims[2];
    return n * sizeof *v->grey + n / 4; /* macro-cells, and what renderers keep */
}

static bool is_idle(const CtsShelved *s)
{
    return !s->busy && s->n_running == 0 && (s->bytes || s->cuts);
}

/* Of the series whose turn it is, the volume that was not asked for longest. */
static bool drop_one_cut(CtsShelf *shelf, CtsShelved *s)
{
    CtsCut *oldest = NULL;
    for (CtsCut *c = s->cuts; c; c = c->next)
        if (c->n_users == 0 && (!oldest || c->used_ms < oldest->used_ms))
            oldest = c;
    if (oldest)
        drop_cut(shelf, s, oldest);
    return oldest;
}

static bool make_room(CtsShelf *shelf, CtsShelved *own, uint64_t bytes)
{
    while (shelf->bytes + bytes > shelf->most_bytes) {
        CtsShelved *oldest = NULL;
        for (CtsShelved *s = shelf->first; s; s = s->next)
            if (s != own && is_idle(s) && (!oldest || s->used_ms < oldest->used_ms))
                oldest = s;
        if (oldest)
            drop_loaded(shelf, oldest);
        else if (!drop_one_cut(shelf, own))
            return false;
    }
    shelf->bytes += bytes;
    return true;
}

static CtsStatus reserve(CtsShelf *shelf, pthread_mutex_t *lock, CtsShelved *own, uint64_t bytes, CtsError *err)
{
    pthread_mutex_lock(lock);
    const bool has = make_room(shelf, own, bytes);
    const uint64_t most = shelf->most_bytes;
    pthread_mutex_unlock(lock);
    if (has)
        return CTS_OK;
    return cts_fail(err, CTS_ERR_MEMORY, "there is no room for %llu MiB more, `memory` leaves %llu MiB in all",
                    (unsigned long long)(bytes >> 20), (unsigned long long)(most >> 20));
}

static void give_up(CtsShelf *shelf, pthread_mutex_t *lock, uint64_t bytes)
{
    pthread_mutex_lock(lock);
    shelf->bytes -= bytes;
    pthread_mutex_unlock(lock);
}

/* PATH with the series' own UID in it; the caller's to free. */
static char *path_for(const char *pattern, const char *uid)
{
    const char *place = strstr(pattern, PLACE);
    char *path = malloc(strlen(pattern) + strlen(uid) + 1);
    if (path)
        sprintf(path, "%.*s%s%s", (int)(place - pattern), pattern, uid, place + strlen(PLACE));
    return path;
}

static CtsStatus find_in_path(const char *pattern, const CtsSource *source, CtsShelved *s, CtsReport *report,
                              CtsError *err)
{
    char *const path = path_for(pattern, s->uid);
    if (!path)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    CtsStatus st = cts_series_find((const char *const *)&path, 1, source->n_threads, &s->loaded.list, report, err);
    if (!st)
        st = cts_series_choose(s->loaded.list, s->uid, &s->loaded.series, err);
    free(path);
    return st;
}

static CtsStatus fetch(const CtsOptions *o, const CtsSource *source, CtsShelved *s, CtsReport *report, CtsError *err)
{
    CtsStatus st = cts_net_fetch(&o->from.peer, &o->net, s->study_uid, s->uid, &s->loaded.fetched, report, err);
    if (!st)
        st = cts_series_find((const char *const *)&s->loaded.fetched, 1, source->n_threads, &s->loaded.list, report,
                             err);
    return st ? st : cts_series_choose(s->loaded.list, s->uid, &s->loaded.series, err);
}

/* Where it may be, one place after the other. */
static CtsStatus find_on_demand(const CtsOptions *o, const CtsSource *source, CtsShelved *s, CtsReport *report,
                                CtsError *err)
{
    CtsStatus st = CTS_ERR_NO_SERIES;
    for (int i = 0; st && i < o->paths.n; i++)
        if (strstr(o->paths.items[i], PLACE)) {
            cts_loaded_free(&s->loaded);
            st = find_in_path(o->paths.items[i], source, s, report, err);
        }
    if (st && o->from.given) {
        cts_loaded_free(&s->loaded);
        st = fetch(o, source, s, report, err);
    }
    if (!st && strcmp(s->loaded.series->study_uid, s->study_uid))
        st = CTS_ERR_NO_SERIES;
    if (st) {
        cts_loaded_free(&s->loaded);
        return st == CTS_ERR_MEMORY ? st : cts_fail(err, CTS_ERR_NO_SERIES, "there is no such series here");
    }
    return CTS_OK;
}

static CtsStatus read_slices(CtsShelf *shelf, pthread_mutex_t *lock, CtsShelved *s, const CtsSource *source,
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
    whole.label_names = shelf->options->label_names;
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

static CtsStatus read_once(CtsShelf *shelf, pthread_mutex_t *lock, CtsShelved *s, const CtsSource *source,
                           CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (!s->series && !(st = find_on_demand(shelf->options, source, s, report, err))) {
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

CtsStatus cts_shelf_make(CtsShelf *shelf, pthread_mutex_t *lock, CtsShelved *s, const CtsSource *source, CtsCut **cut,
                         CtsReport *report, CtsError *err)
{
    CtsCut *made = calloc(1, sizeof *made);
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
            made->source = *source;
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

/* Those that were not used longest go, but those in use. */
static void drop_idle(CtsCut *cut)
{
    int n = 0;
    CtsLens **oldest = NULL;
    for (CtsLens **l = &cut->lenses; *l; l = &(*l)->next)
        if (!(*l)->in_use) {
            n++;
            if (!oldest || (*l)->used_ms < (*oldest)->used_ms)
                oldest = l;
        }
    if (n <= IDLE_LENSES)
        return;
    CtsLens *const gone = *oldest;
    *oldest = gone->next;
    free_lens(gone);
}

CtsLens *cts_cut_lens(CtsCut *cut, const CtsJob *job, const char *preset_json, bool *is_new)
{
    CtsLens *l = cut->lenses;
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

void cts_cut_give_back(CtsCut *cut, CtsLens *lens, bool failed)
{
    lens->in_use = false;
    lens->used_ms = cut->used_ms = cts_wall_ms();
    CtsLens **link = &cut->lenses;
    while (*link != lens)
        link = &(*link)->next;
    if (failed) {
        *link = lens->next;
        free_lens(lens);
    }
    drop_idle(cut);
}
