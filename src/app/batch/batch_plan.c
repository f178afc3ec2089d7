#include "app/batch/batch_plan.h"

#include "base/bytes.h"
#include "base/mem.h"
#include "base/text.h"
#include "ctsplat/label_files.h"
#include "output/export/sc_texts.h"
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

/* Folders that cannot be searched and are named; the rest is counted. */
enum { MAX_WARNINGS = 12 };

/* A file; its record in the list has the details. */
typedef struct Entry {
    uint64_t key, offset;
} Entry;

/* Files of a series. */
typedef struct Unit {
    const Entry *first; /* the one that was met first */
    size_t n;
} Unit;

/* Slices of a series in a folder, met one after the other; in the end, series of a single slice. */
typedef struct Stretch {
    uint64_t folder, study, series, sop; /* by their keys */
    uint64_t offset;                     /* of the first one's record, if it is recorded */
    bool is_single;                      /* one slice, whose place is known: */
    CtsSlicePlace place;
    int n_stacked; /* slices of the stack that it lies in; 0: in none */
} Stretch;

struct CtsBatchPlan {
    const CtsBatchSettings *settings;
    const CtsOptions *options;
    const CtsKey *key;
    FILE *list;
    uint64_t list_bytes;
    const char *records; /* the list as memory, once it is complete */
    Entry *entries;
    Unit *units;
    size_t n_entries, n_units;
    CtsArchives *archives;
    Entry *unreadable; /* files that cannot be read, by their folder's key */
    size_t n_unreadable, n_stretches;
    Stretch *stretches;
    CtsBatchLabelFile *label_files;
    size_t n_label_files;
    CtsStudyNumbers numbers;
    CtsBatchProgress progress;
    int n_warnings;
};

/* A record: these numbers, then path, series UID and SOP UID with their zeros. */
typedef struct FileRecord {
    uint64_t bytes, n_voxels;
    int64_t mtime_ns, came_ns;
    bool unreadable; /* it cannot be read; its name is that of its folder */
} FileRecord;

/* A record in memory. */
typedef struct File {
    FileRecord record;
    const char *path, *name, *sop_uid;
} File;

static File file_of(const CtsBatchPlan *p, uint64_t offset)
{
    File file;
    memcpy(&file.record, p->records + offset, sizeof file.record);
    file.path = p->records + offset + sizeof file.record;
    file.name = file.path + strlen(file.path) + 1;
    file.sop_uid = file.name + strlen(file.name) + 1;
    return file;
}

static CtsStatus fail_list(const CtsBatchPlan *p, CtsError *err)
{
    return cts_fail(err, CTS_ERR_OUTPUT, "%s: the list of files cannot be kept: %s", p->options->output_dir,
                    strerror(errno));
}

static int compare(uint64_t x, uint64_t y)
{
    return (x > y) - (x < y);
}

/* The first 64 bits of the SHA-256 of a UID, for the assignment to shards and the 16 hex digits of names. */
static CtsStatus plan_key(const char *uid, uint64_t *key, CtsError *err)
{
    CtsHash *hash = cts_hash_start(NULL);
    char hex[65];
    cts_hash_bytes(hash, uid, strlen(uid));
    const CtsStatus st = cts_hash_hex(&hash, hex, err);
    hex[16] = 0;
    *key = st ? 0 : strtoull(hex, NULL, 16);
    return st;
}

static uint64_t folder_key(const char *path)
{
    const char *const slash = strrchr(path, '/');
    return cts_fnv(CTS_FNV, path, slash ? (size_t)(slash - path) : 0);
}

/* Files without a series UID form a series per folder; a single one is a series of its own. */
static CtsStatus name_series(const CtsArchiveFile *file, char name[80], uint64_t *key, CtsError *err)
{
    CtsStatus st;
    if (file->series_uid[0]) {
        snprintf(name, 80, "%s", file->series_uid);
        return plan_key(name, key, err);
    }
    const char *const path = file->path, *const slash = file->is_alone ? path + strlen(path) : strrchr(path, '/');
    char *folder = slash ? strndup(path, (size_t)(slash - path)) : strdup(".");
    uint64_t folder_key = 0;
    st = folder ? plan_key(folder, &folder_key, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    free(folder);
    if (st)
        return st;
    snprintf(name, 80, "uid-%016llx", (unsigned long long)folder_key);
    return plan_key(name, key, err);
}

static CtsStatus add_entry(Entry **entries, size_t *n, Entry entry, CtsError *err)
{
    const CtsStatus st = cts_grow(entries, *n, err);
    if (!st)
        (*entries)[(*n)++] = entry;
    return st;
}

/* Time at which a file came to its folder: no program can set its last change of status, which a copy with the times of
 * its original has, too. A member of a zip file came with that. */
static int64_t came_ns(const CtsArchiveFile *file)
{
    struct stat info;
    return lstat(file->path, &info) ? file->mtime_ns : (int64_t)info.st_ctim.tv_sec * 1000000000 + info.st_ctim.tv_nsec;
}

static CtsStatus keep_record(CtsBatchPlan *p, const CtsArchiveFile *file, const char *name, uint64_t key, CtsError *err)
{
    const FileRecord record = {file->bytes, file->n_voxels, file->mtime_ns, p->options->settled_s ? came_ns(file) : 0,
                               file->why};
    const Entry entry = {key, p->list_bytes};
    if (fwrite(&record, sizeof record, 1, p->list) != 1)
        return fail_list(p, err);
    const int n = fprintf(p->list, "%s%c%s%c%s%c", file->path, 0, name, 0, file->sop_uid, 0);
    if (n < 0)
        return fail_list(p, err);
    p->list_bytes += sizeof record + (size_t)n;
    return file->why ? add_entry(&p->unreadable, &p->n_unreadable, entry, err)
                     : add_entry(&p->entries, &p->n_entries, entry, err);
}

/* Counts a slice of a series, before it is recorded: one of one SOP UID stays single. */
static CtsStatus add_slice(CtsBatchPlan *p, const CtsArchiveFile *file, uint64_t key, CtsError *err)
{
    Stretch *const last = p->n_stretches ? &p->stretches[p->n_stretches - 1] : NULL;
    const uint64_t folder = folder_key(file->path), sop = cts_fnv(CTS_FNV, file->sop_uid, strlen(file->sop_uid));
    if (last && last->series == key && last->folder == folder) {
        last->is_single &= last->sop == sop;
        return CTS_OK;
    }
    const char *const study = file->study_uid ? file->study_uid : "";
    if (cts_grow(&p->stretches, p->n_stretches, err))
        return err->status;
    Stretch *const added = &p->stretches[p->n_stretches++];
    *added = (Stretch){folder, cts_fnv(CTS_FNV, study, strlen(study)), key, sop, .offset = p->list_bytes};
    added->is_single = file->place && study[0] && file->series_uid[0];
    if (added->is_single)
        added->place = *file->place;
    return CTS_OK;
}

/* Records an unreadable file, which may be a slice of the series in its folder and is reported with it. */
static CtsStatus take_unreadable(CtsBatchPlan *p, const CtsArchiveFile *file, CtsError *err)
{
    CtsArchiveFile unreadable = *file;
    char name[80];
    uint64_t unused;
    struct stat info;
    CtsStatus st;
    if (!file->path[0]) {
        if (p->n_warnings++ < MAX_WARNINGS)
            p->settings->listener.message(p->settings->listener.context, true, file->why);
        return CTS_OK;
    }
    if (!lstat(file->path, &info)) {
        unreadable.bytes = (uint64_t)info.st_size;
        unreadable.mtime_ns = (int64_t)info.st_mtim.tv_sec * 1000000000 + info.st_mtim.tv_nsec;
    }
    if ((st = name_series(&unreadable, name, &unused, err)))
        return st;
    return keep_record(p, &unreadable, name, folder_key(file->path), err);
}

static CtsStatus plan_labels(CtsBatchPlan *p, const CtsArchiveFile *file, CtsError *err)
{
    const CtsStatus st = cts_grow(&p->label_files, p->n_label_files, err);
    if (st)
        return st;
    CtsBatchLabelFile *const added = &p->label_files[p->n_label_files++];
    *added = (CtsBatchLabelFile){strdup(file->path), strdup(file->labels_of)};
    return added->path && added->study_uid ? CTS_OK
                                           : cts_fail(err, CTS_ERR_MEMORY, "out of memory for the list of label files");
}

static bool is_mine(const CtsBatchPlan *p, uint64_t key)
{
    return key % (uint64_t)p->options->shard.n == (uint64_t)p->options->shard.i;
}

static CtsStatus take_file(void *context, const CtsArchiveFile *file, CtsError *err)
{
    CtsBatchPlan *const p = context;
    CtsStatus st;
    char name[80];
    uint64_t key;
    p->progress.n_files++;
    p->settings->listener.progress(p->settings->listener.context, &p->progress);
    if (file->why)
        return take_unreadable(p, file, err);
    if (file->labels_of)
        return plan_labels(p, file, err);
    if ((st = name_series(file, name, &key, err)) ||
        (file->has_number && (st = cts_study_numbers_add(&p->numbers, file->study_uid, file->instance_number, err))) ||
        (st = add_slice(p, file, key, err)) ||
        (p->options->source.series_uid && strcmp(file->series_uid, p->options->source.series_uid)))
        return st;
    return is_mine(p, key) ? keep_record(p, file, name, key, err) : CTS_OK;
}

static int by_key(const void *a, const void *b)
{
    const Entry *x = a, *y = b;
    const int order = compare(x->key, y->key);
    return order ? order : compare(x->offset, y->offset);
}

static int by_first_file(const void *a, const void *b)
{
    return compare(((const Unit *)a)->first->offset, ((const Unit *)b)->first->offset);
}

static int by_folder(const void *a, const void *b)
{
    return compare(((const Stretch *)a)->folder, ((const Stretch *)b)->folder);
}

/* The series that unreadable files are reported with: the one in their folder; where the folder has none or several, a
 * series named after the folder. */
static CtsStatus owner_of(const CtsBatchPlan *p, const Entry *unreadable, uint64_t *key, bool *is_apart, CtsError *err)
{
    const Stretch wanted = {.folder = unreadable->key}, *const end = p->stretches + p->n_stretches;
    const Stretch *const found =
        p->n_stretches ? bsearch(&wanted, p->stretches, p->n_stretches, sizeof wanted, by_folder) : NULL;
    *is_apart = !found;
    for (const Stretch *s = found; s && s < end && s->folder == wanted.folder; s++)
        *is_apart |= s->series != found->series;
    for (const Stretch *s = found; s && s >= p->stretches && s->folder == wanted.folder; s--)
        *is_apart |= s->series != found->series;
    if (*is_apart)
        return plan_key(file_of(p, unreadable->offset).name, key, err);
    *key = found->series;
    return CTS_OK;
}

static CtsStatus place_unreadable(CtsBatchPlan *p, CtsError *err)
{
    CtsStatus st = CTS_OK;
    uint64_t asked_for = 0;
    if (p->n_stretches)
        qsort(p->stretches, p->n_stretches, sizeof *p->stretches, by_folder);
    if (p->options->source.series_uid)
        st = plan_key(p->options->source.series_uid, &asked_for, err);
    for (size_t k = 0; k < p->n_unreadable && !st; k++) {
        const Entry *unreadable = &p->unreadable[k];
        uint64_t key;
        bool is_apart;
        if ((st = owner_of(p, unreadable, &key, &is_apart, err)))
            return st;
        if (is_mine(p, key) && (!p->options->source.series_uid || (!is_apart && key == asked_for)))
            st = add_entry(&p->entries, &p->n_entries, (Entry){key, unreadable->offset}, err);
    }
    return st;
}

static CtsStatus make_units(CtsBatchPlan *p, CtsError *err)
{
    if (p->n_entries)
        qsort(p->entries, p->n_entries, sizeof *p->entries, by_key);
    for (size_t i = 0; i < p->n_entries; i++) {
        if (i == 0 || p->entries[i].key != p->entries[i - 1].key) {
            if (cts_grow(&p->units, p->n_units, err))
                return err->status;
            p->units[p->n_units++] = (Unit){&p->entries[i], 0};
        }
        p->units[p->n_units - 1].n++;
    }
    if (p->n_units)
        qsort(p->units, p->n_units, sizeof *p->units, by_first_file);
    return CTS_OK;
}

static int by_study_and_series(const void *a, const void *b)
{
    const Stretch *x = a, *y = b;
    const int order = compare(x->study, y->study);
    return order ? order : compare(x->series, y->series);
}

/* Keeps series of one slice, once each, in order of study and series. */
static void filter_singles(CtsBatchPlan *p)
{
    size_t n = 0;
    if (p->n_stretches)
        qsort(p->stretches, p->n_stretches, sizeof *p->stretches, by_study_and_series);
    for (size_t first = 0, end; first < p->n_stretches; first = end) {
        Stretch single = p->stretches[first];
        for (end = first + 1; end < p->n_stretches && !by_study_and_series(&single, &p->stretches[end]); end++)
            single.is_single &= p->stretches[end].is_single && p->stretches[end].sop == single.sop;
        if (single.is_single)
            p->stretches[n++] = single;
    }
    p->n_stretches = n;
}

/* The series' own UID, or one under the key. */
static CtsStatus name_in_batch(const CtsBatchPlan *p, const char *own_uid, char uid[80], CtsError *err)
{
    snprintf(uid, 80, "%s", own_uid);
    return p->key ? cts_uid_keyed(p->key, "series of a batch", own_uid, uid, err) : CTS_OK;
}

/* Names a stack by the first of its series, in the shard that has this series. */
static CtsStatus note_stack(CtsBatchPlan *p, const Stretch *first, int n, CtsError *err)
{
    CtsStatus st;
    char uid[80], text[300];
    if (!is_mine(p, first->series) || p->options->source.series_uid)
        return CTS_OK;
    if ((st = name_in_batch(p, file_of(p, first->offset).name, uid, err)))
        return st;
    snprintf(text, sizeof text, CTS_SINGLE_SLICES_TEXT, uid, n - 1, n);
    p->settings->listener.message(p->settings->listener.context, false, text);
    return CTS_OK;
}

/* Finds the stacks among n single slices of one study. */
static CtsStatus stack_study(CtsBatchPlan *p, Stretch *singles, size_t n, CtsError *err)
{
    CtsSlicePlace *places = malloc(n * sizeof *places);
    int *stack = malloc(n * sizeof *stack), n_stacks = 0;
    CtsStatus st = places && stack ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory for single slices");
    for (size_t i = 0; i < n && !st; i++)
        places[i] = singles[i].place;
    if (!st)
        st = cts_single_slices_find(places, n, stack, &n_stacks, err);
    for (int k = 1; k <= n_stacks && !st; k++) {
        const Stretch *first = NULL;
        int n_slices = 0;
        for (size_t i = 0; i < n; i++) {
            first = !first && stack[i] == k ? &singles[i] : first;
            n_slices += stack[i] == k;
        }
        for (size_t i = 0; i < n; i++)
            if (stack[i] == k)
                singles[i].n_stacked = n_slices;
        if (first)
            st = note_stack(p, first, n_slices, err);
    }
    free(places);
    free(stack);
    return st;
}

static int by_series(const void *a, const void *b)
{
    return compare(((const Stretch *)a)->series, ((const Stretch *)b)->series);
}

static CtsStatus find_stacks(CtsBatchPlan *p, CtsError *err)
{
    CtsStatus st = CTS_OK;
    filter_singles(p);
    for (size_t first = 0, end; first < p->n_stretches && !st; first = end) {
        for (end = first + 1; end < p->n_stretches && p->stretches[end].study == p->stretches[first].study;)
            end++;
        st = stack_study(p, p->stretches + first, end - first, err);
    }
    if (p->n_stretches)
        qsort(p->stretches, p->n_stretches, sizeof *p->stretches, by_series);
    return st;
}

/* A file that ends with this process, however that ends. */
static FILE *nameless_file(const char *folder)
{
    char *path;
    if (asprintf(&path, "%s/.files.%ld.XXXXXX.tmp", folder, (long)getpid()) < 0)
        return NULL;
    const int fd = mkostemps(path, 4, O_CLOEXEC);
    if (fd >= 0)
        unlink(path);
    free(path);
    return fd < 0 ? NULL : fdopen(fd, "w+");
}

static CtsStatus map_list(CtsBatchPlan *p, CtsError *err)
{
    if (fflush(p->list))
        return fail_list(p, err);
    if (!p->list_bytes)
        return CTS_OK;
    void *const records = mmap(NULL, p->list_bytes, PROT_READ, MAP_PRIVATE, fileno(p->list), 0);
    if (records == MAP_FAILED)
        return fail_list(p, err);
    p->records = records;
    return CTS_OK;
}

CtsStatus cts_plan_new(CtsBatchPlan **plan, const CtsBatchSettings *settings, const CtsKey *key, CtsPlanFound *found,
                       CtsError *err)
{
    CtsStatus st;
    const CtsOptions *const o = settings->options;
    CtsBatchPlan *p = *plan = calloc(1, sizeof *p);
    if (!p)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    p->settings = settings;
    p->options = o;
    p->key = key;
    if (!(p->list = nameless_file(o->output_dir))) {
        st = cts_fail(err, CTS_ERR_OUTPUT, "%s: no file can be created there: %s", o->output_dir, strerror(errno));
        goto end;
    }
    const CtsArchiveSearch search = {.paths = o->paths.items,
                                     .n_paths = o->paths.n,
                                     .n_threads = o->render.n_threads,
                                     .found = take_file,
                                     .context = p,
                                     .archives = &p->archives,
                                     .stop = o->render.stop};
    if ((st = cts_archive_search(&search, &found->counts, err)) || (st = map_list(p, err)))
        goto end;
    cts_study_numbers_sort(&p->numbers);
    if (!(st = place_unreadable(p, err)) && !(st = find_stacks(p, err)))
        st = make_units(p, err);
    found->n_series = p->n_units;
    found->archives = p->archives;
    if (p->n_warnings > MAX_WARNINGS) {
        char text[80];
        snprintf(text, sizeof text, "%d more folders cannot be searched", p->n_warnings - MAX_WARNINGS);
        settings->listener.message(settings->listener.context, true, text);
    }
end:
    if (st)
        cts_plan_free(plan);
    return st;
}

void cts_plan_free(CtsBatchPlan **plan)
{
    CtsBatchPlan *p = *plan;
    if (!p)
        return;
    if (p->records)
        munmap((void *)(uintptr_t)p->records, p->list_bytes);
    if (p->list)
        fclose(p->list);
    free(p->entries);
    free(p->unreadable);
    free(p->stretches);
    free(p->units);
    for (size_t i = 0; i < p->n_label_files; i++) {
        free(p->label_files[i].path);
        free(p->label_files[i].study_uid);
    }
    free(p->label_files);
    cts_study_numbers_free(&p->numbers);
    cts_archives_free(&p->archives);
    free(p);
    *plan = NULL;
}

static int by_content(const void *a, const void *b)
{
    const File *x = a, *y = b;
    const int order = strcmp(x->sop_uid, y->sop_uid), by_size = compare(x->record.bytes, y->record.bytes);
    if (order || by_size)
        return order ? order : by_size;
    return x->record.mtime_ns < y->record.mtime_ns ? -1 : x->record.mtime_ns > y->record.mtime_ns;
}

/* PATHs may hold one another. */
static int by_path(const void *a, const void *b)
{
    const int order = strcmp(((const File *)a)->path, ((const File *)b)->path);
    return order ? order : by_content(a, b);
}

/* The label files of a series are its input, too. */
static CtsStatus hash_labels(const CtsBatchPlan *p, CtsHash *hash, const char *uid, const char *ct, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (int i = 0; !st && i < p->options->labels.n; i++) {
        char *stamp;
        if (!(st = cts_labels_stamp(p->options->labels.items[i], uid, ct, &stamp, err)))
            cts_hash_text(hash, stamp);
        free(stamp);
    }
    return st;
}

/* n_members: of the stack, which the series' record names. */
static CtsStatus hash_files(const CtsBatchPlan *p, File *files, int n, const char *uid, int n_members, char hex[65],
                            CtsError *err)
{
    CtsHash *hash = cts_hash_start(NULL);
    qsort(files, (size_t)n, sizeof *files, by_content);
    for (int i = 0; i < n; i++) {
        char numbers[64];
        snprintf(numbers, sizeof numbers, "%llu %lld", (unsigned long long)files[i].record.bytes,
                 (long long)files[i].record.mtime_ns);
        cts_hash_text(hash, files[i].sop_uid);
        cts_hash_text(hash, numbers);
    }
    if (n_members) {
        char number[16];
        snprintf(number, sizeof number, "%d", n_members);
        cts_hash_text(hash, number);
    }
    const CtsStatus st = hash_labels(p, hash, uid, n == 1 ? files[0].path : NULL, err);
    const CtsStatus ended = cts_hash_hex(&hash, hex, st ? NULL : err);
    return st ? st : ended;
}

CtsStatus cts_plan_series(const CtsBatchPlan *plan, size_t i, CtsPlanSeries *series, CtsError *err)
{
    const Unit *unit = &plan->units[i];
    CtsStatus st = CTS_OK;
    *series = (CtsPlanSeries){.paths = malloc(unit->n * sizeof *series->paths),
                              .label_files = plan->label_files,
                              .n_label_files = plan->n_label_files,
                              .numbers = &plan->numbers};
    File *files = malloc(unit->n * sizeof *files);
    if (!series->paths || !files) {
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory for the files of a series");
        goto end;
    }
    for (size_t k = 0; k < unit->n; k++)
        files[k] = file_of(plan, unit->first[k].offset);
    size_t own = 0;
    while (own + 1 < unit->n && files[own].record.unreadable)
        own++;
    const Stretch wanted = {.series = unit->first->key};
    const Stretch *const single =
        plan->n_stretches ? bsearch(&wanted, plan->stretches, plan->n_stretches, sizeof wanted, by_series) : NULL;
    series->n_stacked = single ? single->n_stacked : 0;
    snprintf(series->own_uid, sizeof series->own_uid, "%s", files[own].name);
    if ((st = name_in_batch(plan, series->own_uid, series->uid, err)))
        goto end;
    if (cts_uid_is_valid(series->uid))
        snprintf(series->folder, sizeof series->folder, "%s", series->uid);
    else
        snprintf(series->folder, sizeof series->folder, "uid-%016llx", (unsigned long long)unit->first->key);
    qsort(files, unit->n, sizeof *files, by_path);
    for (size_t k = 0; k < unit->n; k++) {
        series->n_voxels += files[k].record.n_voxels;
        if (files[k].record.came_ns > series->newest_ns)
            series->newest_ns = files[k].record.came_ns;
        if (series->n_paths && !strcmp(series->paths[series->n_paths - 1], files[k].path))
            continue;
        series->paths[series->n_paths] = files[k].path;
        files[series->n_paths++] = files[k];
    }
    st = hash_files(plan, files, series->n_paths, series->own_uid, series->n_stacked, series->input_sha256, err);
end:
    free(files);
    if (st)
        cts_plan_series_free(series);
    return st;
}

void cts_plan_series_free(CtsPlanSeries *series)
{
    free(series->paths);
    series->paths = NULL;
}
