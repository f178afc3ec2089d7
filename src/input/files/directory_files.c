/* The files that a DICOMDIR names, under the names that their way to this disk gave them. */
#include "input/files/scan.h"

#include "dicom/header/dicom_object.h"
#include <ctype.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

enum { RECORDS = 0x00041220, FILE_ID = 0x00041500 };

typedef struct DirectoryFiles {
    const char *folder; /* its path, with the last / */
    size_t n_folder;    /* letters of it */
    cts_file_fn found;
    void *context;
    CtsFileList list; /* of all files below the folder, once one was not found by its name */
    json_t *by_key;   /* their numbers in the list by the keys of their paths below the folder (name_key()) */
    CtsDirectoryCounts *counts;
} DirectoryFiles;

/* The ending of a name: behind its last dot if that has a letter (numbers belong to a UID), or the version of CDs,
 * ";1".
 */
static char *ending_of(char *path)
{
    char *const slash = strrchr(path, '/'), *const name = slash ? slash + 1 : path, *const version = strchr(name, ';');
    char *const dot = strrchr(name, '.');
    for (const char *c = dot ? dot : ""; *c; c++)
        if (dot > name && isalpha((unsigned char)*c))
            return dot;
    if (!version)
        return name + strlen(name);
    return version > name && version[-1] == '.' ? version - 1 : version;
}

/* In small letters, without an ending. */
static char *name_key(const char *path)
{
    char *const key = strdup(path);
    for (char *c = key; c && *c; c++)
        *c = (char)tolower((unsigned char)*c);
    if (key)
        *ending_of(key) = 0;
    return key;
}

static CtsStatus list_folder(DirectoryFiles *d, CtsError *err)
{
    const char *const folder = *d->folder ? d->folder : ".";
    const CtsStatus st = cts_scan_paths(NULL, &folder, 1, &d->list, err);
    bool good = !st && (d->by_key = json_object());
    for (size_t i = 0; good && i < d->list.n; i++) {
        char *const key = name_key(d->list.items[i].path + (*d->folder ? d->n_folder : 2));
        json_t *same = key ? json_object_get(d->by_key, key) : NULL;
        if (key && !same && json_object_set_new_nocheck(d->by_key, key, same = json_array()))
            same = NULL;
        good = same && !json_array_append_new(same, json_integer((json_int_t)i));
        free(key);
    }
    return st || good ? st : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

/* The best of the files with a name's key: by case alone, else with the ending .dcm, else the first; NULL: none. */
static const char *find_known(const DirectoryFiles *d, const char *path, const char *key)
{
    const json_t *const same = json_object_get(d->by_key, key);
    const char *best = NULL;
    int best_rank = 0;
    for (size_t i = 0; i < json_array_size(same); i++) {
        const char *const one = d->list.items[json_integer_value(json_array_get(same, i))].path;
        const char *const dot = strrchr(one, '.');
        const int rank = !strcasecmp(one, path) ? 3 : dot && !strncasecmp(dot, ".dcm", 4) ? 2 : 1;
        best = rank > best_rank ? one : best;
        best_rank = rank > best_rank ? rank : best_rank;
    }
    return best;
}

/* Hands on a file under the name that it has by now. */
static CtsStatus add_as_present(DirectoryFiles *d, const char *path, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (!access(path, F_OK))
        return d->found(d->context, &(CtsFile){.path = path}, NULL, err);
    if (!d->by_key && (st = list_folder(d, err)))
        return st;
    char *const key = name_key(path + d->n_folder);
    if (!key)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const char *const is = find_known(d, path, key);
    free(key);
    d->counts->n_missing += !is;
    return is ? d->found(d->context, &(CtsFile){.path = is}, NULL, err) : CTS_OK;
}

/* A file ID is untrusted: it must name a file below the DICOMDIR's own folder. Its components are joined in place. */
static bool make_relative(char *id)
{
    char *to = id;
    for (const char *part = id, *end; part; part = *end ? end + 1 : NULL) {
        end = strchrnul(part, '\\');
        size_t n = (size_t)(end - part);
        while (n && part[n - 1] == ' ')
            n--;
        if (!n || (n == 1 && part[0] == '.') || (n == 2 && !memcmp(part, "..", 2)) || memchr(part, '/', n))
            return false;
        if (to != id)
            *to++ = '/';
        memmove(to, part, n);
        to += n;
    }
    *to = 0;
    return true;
}

static CtsStatus add_listed_file(DirectoryFiles *d, CtsElements record, CtsError *err)
{
    char id[256], *path;
    if (!cts_elements_text(record, FILE_ID, id, sizeof id))
        return CTS_OK;
    if (!make_relative(id)) {
        d->counts->n_refused++;
        return CTS_OK;
    }
    if (asprintf(&path, "%s%s", d->folder, id) < 0)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const CtsStatus st = add_as_present(d, path, err);
    free(path);
    return st;
}

static CtsStatus read_records(DirectoryFiles *d, const char *path, CtsError *err)
{
    CtsDicomObject object;
    CtsElement records;
    CtsElements record;
    CtsStatus st = cts_dicom_object_open(&object, &(CtsFile){.path = path}, CTS_MAX_HEADER_BYTES, err);
    if (!st && !cts_elements_get(object.elements, RECORDS, &records))
        st = cts_fail(err, CTS_ERR_READ, "cannot be read as a DICOMDIR (name the folder instead)");
    if (st)
        cts_context(err, "%s", path);
    while (!st && cts_items_next(&records.value, &record))
        st = add_listed_file(d, record, err);
    cts_dicom_object_close(&object);
    return st;
}

CtsStatus cts_directory_files(const char *path, cts_file_fn found, void *context, CtsDirectoryCounts *counts,
                              CtsError *err)
{
    const char *const slash = strrchr(path, '/');
    DirectoryFiles d = {
        .n_folder = slash ? (size_t)(slash - path) + 1 : 0, .found = found, .context = context, .counts = counts};
    char *const folder = strndup(path, d.n_folder);
    *counts = (CtsDirectoryCounts){0};
    d.folder = folder;
    const CtsStatus st = folder ? read_records(&d, path, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    json_decref(d.by_key);
    free(folder);
    cts_file_list_free(&d.list);
    return st;
}
