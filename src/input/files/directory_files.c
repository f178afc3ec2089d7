/* The files that a DICOMDIR names, under the names that their way to this disk gave them. */
#include "input/files/scan.h"

#include <ctype.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

typedef struct DirectoryFiles {
    const char *folder;
    size_t n_folder; /* letters of the folder's path, with the last / */
    cts_named_file_fn found;
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

static CtsStatus add_as_present(void *context, const char *path, CtsError *err)
{
    DirectoryFiles *const d = context;
    CtsStatus st = CTS_OK;
    if (!access(path, F_OK))
        return d->found(d->context, path, err);
    if (!d->by_key && (st = list_folder(d, err)))
        return st;
    char *const key = name_key(path + d->n_folder);
    if (!key)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const char *const is = find_known(d, path, key);
    free(key);
    d->counts->n_missing += !is;
    return is ? d->found(d->context, is, err) : CTS_OK;
}

CtsStatus cts_directory_files(const char *path, cts_named_file_fn found, void *context, CtsDirectoryCounts *counts,
                              CtsError *err)
{
    const char *const slash = strrchr(path, '/');
    DirectoryFiles d = {
        .n_folder = slash ? (size_t)(slash - path) + 1 : 0, .found = found, .context = context, .counts = counts};
    char *const folder = strndup(path, d.n_folder);
    *counts = (CtsDirectoryCounts){0};
    d.folder = folder;
    const CtsStatus st = folder ? cts_slice_read_directory(path, add_as_present, &d, &counts->n_refused, err)
                                : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    json_decref(d.by_key);
    free(folder);
    cts_file_list_free(&d.list);
    return st;
}
