#include "ctsplat/series.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "base/string_pool.h"
#include "base/text.h"
#include "input/files/file_header.h"
#include "input/files/scan.h"
#include "input/series/series_check.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void clear_series(CtsSeries *series)
{
    for (int i = 0; i < series->n_slices; i++)
        cts_slice_free(series->slices[i]);
    free(series->slices);
    free(series->description);
    cts_diagnostics_free(&series->diagnostics);
    *series = (CtsSeries){0};
}

void cts_series_list_free(CtsSeriesList **list)
{
    if (!*list)
        return;
    for (size_t i = 0; i < (*list)->n; i++)
        clear_series(&(*list)->items[i]);
    free((*list)->items);
    cts_archives_free(&(*list)->archives);
    if ((*list)->texts)
        cts_string_pool_free((*list)->texts);
    free((*list)->texts);
    free((*list)->others);
    free((*list)->paths);
    cts_diagnostics_free(&(*list)->diagnostics);
    free(*list);
    *list = NULL;
}

typedef struct HeaderSearch {
    CtsFileList files;
    CtsHeaderRead *headers; /* files.n of them, once read; in order of the files, for any number of threads */
    size_t n_headers;
    uint64_t bytes_read;
    CtsSeriesList *list;
    const CtsSeriesSearch *asked;
    CtsStudyNumbers numbers; /* of all objects; used where asked has none */
} HeaderSearch;

/* Reads the headers not yet read. */
static CtsStatus read_new_headers(HeaderSearch *s, int n_threads, CtsError *err)
{
    const size_t first = s->n_headers, n = s->files.n;
    CtsHeaderRead *headers = realloc(s->headers, (n ? n : 1) * sizeof *headers);
    if (!headers)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    memset(headers + first, 0, (n - first) * sizeof *headers);
    s->headers = headers;
    s->n_headers = n;
    if (n == first)
        return CTS_OK;
    CtsHeaderReader *readers = calloc((size_t)n_threads, sizeof *readers);
    if (!readers)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    cts_file_headers_read(s->files.items + first, n - first, s->asked->rules.nifti_form, readers, n_threads,
                          headers + first);
    for (int t = 0; t < n_threads; t++) {
        s->bytes_read += readers[t].bytes_read;
        cts_string_pool_join(s->list->texts, &readers[t].texts);
        cts_header_reader_free(&readers[t]);
    }
    free(readers);
    /* Failures that are not a file's. */
    for (size_t i = first; i < n; i++)
        if (headers[i].why.status == CTS_ERR_MEMORY || headers[i].why.status == CTS_ERR_INTERNAL)
            return cts_fail(err, headers[i].why.status, "%s, while headers were read", headers[i].why.text);
    return CTS_OK;
}

/* Adds the files that DICOMDIRs name. */
static CtsStatus follow_directories(HeaderSearch *s, int n_threads, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const size_t n = s->n_headers;
    for (size_t i = 0; !st && i < n; i++) {
        const char *const path = s->files.items[i].path;
        CtsDirectoryCounts counts;
        if (!s->files.items[i].named || s->headers[i].object.kind != CTS_OBJECT_DIRECTORY)
            continue;
        st = cts_directory_files(path, cts_file_list_add, &s->files, &counts, err);
        if (counts.n_missing)
            cts_diagnostics_add(&s->list->diagnostics, CTS_DIAGNOSTIC_UNREADABLE_FILE, CTS_DIRECTORY_MISSING_TEXT, path,
                                counts.n_missing);
        s->files.scan.n_unreadable += (int)counts.n_missing;
        if (counts.n_refused)
            cts_diagnostics_add(&s->list->diagnostics, CTS_DIAGNOSTIC_DIRECTORY_ESCAPES,
                                "%s: %zu of its files do not lie in its folder; left out", path, counts.n_refused);
    }
    return !st && s->files.n > n ? read_new_headers(s, n_threads, err) : st;
}

/* Files without a series UID belong together by folder; a NIfTI file is alone. */
static size_t home_length(const CtsSlice *s)
{
    return s->kind == CTS_OBJECT_NIFTI ? strlen(s->path) : (size_t)(cts_slice_name(s) - s->path);
}

static int by_series(const void *a, const void *b)
{
    const CtsSlice *x = *(CtsSlice *const *)a, *y = *(CtsSlice *const *)b;
    int order = strcmp(x->series_uid, y->series_uid);
    if (!order && !x->series_uid[0]) {
        const size_t nx = home_length(x), ny = home_length(y);
        order = memcmp(x->path, y->path, nx < ny ? nx : ny);
        if (!order)
            order = (nx > ny) - (nx < ny);
    }
    order = order ? order : (int)x->kind - (int)y->kind;
    order = order ? order : (int)x->modality_id - (int)y->modality_id;
    /* A stack is a volume of its own (PS3.3 C.7.6.16.2.2.2). */
    return order ? order : strcmp(x->stack_id, y->stack_id);
}

static int by_series_and_path(const void *a, const void *b)
{
    const CtsSlice *x = *(CtsSlice *const *)a, *y = *(CtsSlice *const *)b;
    int order = by_series(a, b);
    order = order ? order : strcmp(x->path, y->path);
    return order ? order : x->frame - y->frame;
}

static bool is_planar(const CtsSeries *series)
{
    return series->slices[0]->kind == CTS_OBJECT_IMAGE;
}

static const char NOT_DICOM[] = "not DICOM";

/* Counts n more of a kind, in words. */
static CtsStatus add_other(CtsSeriesList *list, const char *what, int n, CtsError *err)
{
    size_t i = 0;
    while (i < list->n_others && strcmp(list->others[i].what, what))
        i++;
    if (n && i == list->n_others) {
        if (cts_grow(&list->others, i, err))
            return CTS_ERR_MEMORY;
        list->others[i] = (CtsFileCount){.n = 0};
        snprintf(list->others[i].what, sizeof list->others[i].what, "%s", what);
        list->n_others++;
    }
    if (n)
        list->others[i].n += n;
    return CTS_OK;
}

/* Counts a file that this program probably packed, or "NIfTI". */
static CtsStatus add_packed(CtsSeriesList *list, const char *packed, CtsError *err)
{
    char what[40];
    if (!strcmp(packed, "NIfTI"))
        return add_other(list, "NIfTI (name the file itself)", 1, err);
    snprintf(what, sizeof what, "packed with %s (unpack first)", packed);
    return add_other(list, what, 1, err);
}

/* The most frequent first, then by name. */
static int by_count(const void *a, const void *b)
{
    const CtsFileCount *x = a, *y = b;
    return x->n != y->n ? (x->n < y->n) - (x->n > y->n) : strcmp(x->what, y->what);
}

void cts_series_list_others(const CtsSeriesList *list, char *text, size_t size)
{
    text[0] = 0;
    for (size_t i = 0; i < list->n_others; i++)
        cts_text_append(text, size, ", ", "%d %s", list->others[i].n, list->others[i].what);
}

/* Counts a file without slices, and names an unreadable one. */
static CtsStatus count_other(const HeaderSearch *s, size_t i, CtsError *err)
{
    const CtsHeaderRead *const h = &s->headers[i];
    if (h->why.status) {
        s->list->n_unreadable++;
        cts_diagnostics_add(&s->list->diagnostics, CTS_DIAGNOSTIC_UNREADABLE_FILE, "%s: %s", s->files.items[i].path,
                            h->why.text);
        return CTS_OK;
    }
    s->list->n_not_ct++;
    if (h->object.packed)
        return add_packed(s->list, h->object.packed, err);
    return add_other(s->list, h->object.class_name ? h->object.class_name : NOT_DICOM, 1, err);
}

/* The slices of all objects move to *slices; other files are counted, images that are not asked for among them. */
static CtsStatus collect(HeaderSearch *s, CtsSlice ***slices, size_t *n_slices, CtsError *err)
{
    CtsSeriesList *const list = s->list;
    list->n_not_ct = s->files.scan.n_special + s->files.scan.n_other;
    list->n_files = (int)s->n_headers + list->n_not_ct;
    list->n_unreadable = s->files.scan.n_unreadable;
    CtsStatus st = add_other(list, "links to folders or devices (name them)", s->files.scan.n_special, err);
    if (!st)
        st = add_other(list, NOT_DICOM, s->files.scan.n_other, err);
    for (size_t i = 0; !st && i < s->n_headers; i++) {
        CtsObject *const object = &s->headers[i].object;
        if (object->kind == CTS_OBJECT_IMAGE && object->n_slices && !s->asked->images)
            cts_slice_free(object->slices[--object->n_slices]);
        if (object->has_number && !s->asked->numbers)
            st = cts_study_numbers_add(&s->numbers, object->study_uid, object->instance_number, err);
        if (!st && !object->n_slices)
            st = count_other(s, i, err);
        while (!st && object->n_slices && !(st = cts_grow(slices, *n_slices, err)))
            (*slices)[(*n_slices)++] = object->slices[--object->n_slices];
    }
    if (list->n_others)
        qsort(list->others, list->n_others, sizeof *list->others, by_count);
    cts_study_numbers_sort(&s->numbers);
    return st;
}

/* Images beside slices of one UID, such as screens stored with a scan, are a part of their own behind the volumes. */
static void number_images(CtsSeries *images, int part, CtsSeries *volume)
{
    images->part = part;
    cts_diagnostics_add(&volume->diagnostics, CTS_DIAGNOSTIC_PAGES_DROPPED,
                        "%d image%s of other classes %s no slice%s of the volume (`series` UID#%d)", images->n_slices,
                        images->n_slices == 1 ? "" : "s", images->n_slices == 1 ? "is" : "are",
                        images->n_slices == 1 ? "" : "s", part);
}

/* Volumes of one UID get numbers: stacks, phases, single slices beside frames. */
static void number_parts(CtsSeriesList *list)
{
    for (size_t first = 0, end; first < list->n; first = end) {
        for (end = first + 1; end < list->n && strcmp(list->items[first].uid, list->items[end].uid) == 0;)
            end++;
        const bool has_uid = list->items[first].uid[0];
        const bool has_images = has_uid && end - first > 1 && is_planar(&list->items[end - 1]);
        const int n = has_uid ? (int)(end - first) - has_images : 1;
        for (int p = 0; n > 1 && p < n; p++) {
            CtsSeries *s = &list->items[first + (size_t)p];
            s->part = p + 1;
            cts_diagnostics_add(&s->diagnostics, CTS_DIAGNOSTIC_SEVERAL_VOLUMES,
                                "the series holds %d volumes; this is volume %d (`series` UID#%d picks another)", n,
                                p + 1, p == 0 ? 2 : 1);
        }
        if (has_images)
            number_images(&list->items[end - 1], n + 1, &list->items[first]);
    }
}

/* CT before PET before MR, then the most slices; images last, so that numbers of volumes do not depend on them. */
static int by_size(const void *a, const void *b)
{
    const CtsSeries *x = a, *y = b;
    static const int ranks[CTS_N_MODALITIES] = {[CTS_MODALITY_CT] = 0, [CTS_MODALITY_PT] = 1, [CTS_MODALITY_MR] = 2};
    if (is_planar(x) != is_planar(y))
        return is_planar(x) - is_planar(y);
    if (x->modality_id != y->modality_id)
        return ranks[x->modality_id] - ranks[y->modality_id];
    if (x->n_slices != y->n_slices)
        return x->n_slices < y->n_slices ? 1 : -1;
    const int order = strcmp(x->uid, y->uid);
    return order ? order : x->part - y->part;
}

/* The slices move to the list's series. */
static CtsStatus group(const HeaderSearch *s, CtsSlice **slices, size_t n, CtsError *err)
{
    CtsSeriesList *const list = s->list;
    CtsStatus st = cts_concatenations_check(slices, n, list->texts, err);
    if (n)
        qsort(slices, n, sizeof *slices, by_series_and_path);
    for (size_t first = 0, end; !st && first < n; first = end) {
        for (end = first + 1; end < n && by_series(&slices[first], &slices[end]) == 0;)
            end++;
        CtsSliceSet set = {malloc((end - first) * sizeof *set.items), (int)(end - first)};
        if (!set.items)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        memcpy(set.items, slices + first, (end - first) * sizeof *slices);
        memset(slices + first, 0, (end - first) * sizeof *slices);
        st = cts_series_check(&set, &s->asked->rules, s->asked->numbers ? s->asked->numbers : &s->numbers, list, err);
    }
    if (!st)
        number_parts(list);
    if (!st && list->n)
        qsort(list->items, list->n, sizeof *list->items, by_size);
    return st ? st : cts_single_slices_report(list, err);
}

static CtsStatus list_paths(const HeaderSearch *s, CtsError *err)
{
    if (!(s->list->paths = malloc((s->files.n + 1) * sizeof *s->list->paths)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (size_t i = 0; i < s->files.n; i++)
        s->list->paths[s->list->n_paths++] = s->files.items[i].path;
    return CTS_OK;
}

/* The slices of all files below the paths, and the counts of other files. */
static CtsStatus find_slices(HeaderSearch *s, CtsSlice ***slices, size_t *n_slices, CtsError *err)
{
    const CtsSeriesSearch *const asked = s->asked;
    const int n_threads = cts_threads(asked->n_threads);
    CtsStatus st = cts_scan_paths(asked->archives, asked->paths, asked->n_paths, &s->files, err);
    if (st)
        return st;
    s->list->archives = s->files.archives;
    s->files.archives = NULL;
    s->list->diagnostics = s->files.scan.diagnostics;
    s->files.scan.diagnostics = (CtsDiagnostics){0};
    if (!(st = read_new_headers(s, n_threads, err)) && !(st = follow_directories(s, n_threads, err)) &&
        !(st = list_paths(s, err)))
        st = collect(s, slices, n_slices, err);
    cts_string_pool_join(s->list->texts, &s->files.texts); /* the slices' paths */
    return st;
}

static CtsStatus nothing_found(const HeaderSearch *s, CtsError *err)
{
    const CtsSeriesList *list = s->list;
    const char *first = "";
    char others[400];
    cts_series_list_others(list, others, sizeof others);
    for (size_t i = 0; !first[0] && i < list->diagnostics.n; i++)
        first = list->diagnostics.items[i].text;
    if (list->n_unreadable)
        return cts_fail(err, CTS_ERR_READ, "%s (no CT, MR or PET slice among %d files: %d unreadable%s%s)", first,
                        list->n_files, list->n_unreadable, others[0] ? ", " : "", others);
    return cts_fail(err, CTS_ERR_NO_SERIES, "no CT, MR or PET slice among %d file%s%s%s", list->n_files,
                    list->n_files == 1 ? "" : "s", others[0] ? ": " : "", others);
}

CtsStatus cts_series_find(const char *const *paths, int n_paths, int n_threads, CtsSeriesList **list, CtsReport *report,
                          CtsError *err)
{
    const CtsSeriesSearch search = {.paths = paths, .n_paths = n_paths, .n_threads = n_threads};
    return cts_series_search(&search, list, report, err);
}

CtsStatus cts_series_search(const CtsSeriesSearch *search, CtsSeriesList **list, CtsReport *report, CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    HeaderSearch s = {.asked = search};
    CtsSlice **slices = NULL;
    size_t n_slices = 0;
    *list = NULL;
    if (!(s.list = calloc(1, sizeof *s.list)) || !(s.list->texts = calloc(1, sizeof *s.list->texts))) {
        cts_series_list_free(&s.list);
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    CtsStatus st = find_slices(&s, &slices, &n_slices, err);
    for (size_t i = 0; i < s.n_headers; i++)
        cts_object_free(&s.headers[i].object);
    free(s.headers);
    cts_file_list_free(&s.files);
    if (!st)
        st = group(&s, slices, n_slices, err);
    if (!st && s.list->n == 0) {
        st = nothing_found(&s, err);
        if (search->n_paths == 1)
            cts_context(err, "%s", search->paths[0]);
    }
    if (!st) {
        *list = s.list;
        s.list = NULL;
    }
    cts_report_stage(report, CTS_STAGE_SCAN, cts_wall_ms() - wall, cts_cpu_ms() - cpu, s.n_headers, s.bytes_read);
    for (size_t i = 0; i < n_slices; i++)
        if (slices[i])
            cts_slice_free(slices[i]);
    free(slices);
    cts_study_numbers_free(&s.numbers);
    cts_series_list_free(&s.list);
    return st;
}

/* The series of option `series`: UID, UID#VOLUME, or a number as `ctsplat info` numbers them. NULL: none. */
static const CtsSeries *named_series(const CtsSeriesList *list, const char *name)
{
    char *end;
    const unsigned long number = strtoul(name, &end, 10);
    for (size_t i = 0; i < list->n; i++) {
        const CtsSeries *s = &list->items[i];
        char numbered[sizeof s->uid + 16];
        snprintf(numbered, sizeof numbered, "%s#%d", s->uid, s->part);
        if ((s->part > 0 && !strcmp(numbered, name)) || (s->part <= 1 && !strcmp(s->uid, name)))
            return s;
    }
    return *end || number < 1 || number > list->n ? NULL : &list->items[number - 1];
}

/* True if nothing but the order of their UIDs puts one series before the other. */
static bool is_equal_right(const CtsSeries *a, const CtsSeries *b)
{
    return b->renderable && a->n_slices == b->n_slices && !strcmp(a->modality, b->modality) && strcmp(a->uid, b->uid);
}

/* Refuses a choice that only the order of UIDs would make. */
static CtsStatus check_choice(const CtsSeriesList *list, const CtsSeries *series, CtsError *err)
{
    char equals[700] = "";
    size_t n = 0;
    for (size_t i = 0; i < list->n; i++) {
        const CtsSeries *s = &list->items[i];
        if (s != series && !is_equal_right(series, s))
            continue;
        n++;
        cts_text_append(equals, sizeof equals, "; ", "%zu (%s, UID %s)", i + 1, s->traits,
                        s->uid[0] ? s->uid : "missing");
    }
    if (n < 2)
        return CTS_OK;
    return cts_fail(err, CTS_ERR_USAGE,
                    "%zu series have %d slices each, and none comes first: %s%s (choose one by its number or UID with "
                    "`series`)",
                    n, series->n_slices, equals, strlen(equals) + 1 < sizeof equals ? "" : "...");
}

CtsStatus cts_series_choose(const CtsSeriesList *list, const char *uid, const CtsSeries **series, CtsError *err)
{
    *series = uid ? named_series(list, uid) : NULL;
    if (uid && !*series)
        return cts_fail(err, CTS_ERR_USAGE, "no series %.80s among the %zu found (ctsplat info lists them)", uid,
                        list->n);
    for (size_t i = 0; i < list->n && !*series; i++)
        if (list->items[i].renderable)
            *series = &list->items[i];
    if (!*series && list->n)
        *series = &list->items[0];
    if (!*series)
        return cts_fail(err, CTS_ERR_NO_SERIES, "no series");
    return uid || !(*series)->renderable ? CTS_OK : check_choice(list, *series, err);
}

int cts_series_count(const CtsSeries *series, const char *sop_uid, int frame)
{
    int n = 0;
    for (int i = 0; i < series->n_slices; i++)
        n += !strcmp(series->slices[i]->sop_uid, sop_uid) && (!frame || series->slices[i]->frame + 1 == frame);
    return n;
}
