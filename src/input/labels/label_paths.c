/* Paths of label files with places in them that each series fills, and a text that changes when such files do. */
#include "base/mem.h"
#include "base/text.h"
#include "ctsplat/label_files.h"
#include "input/files/scan.h"
#include "input/labels/label_reading.h"
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

void cts_label_stem(const char *path, char *stem, size_t size)
{
    static const char *const endings[] = {".nii.gz", ".nii"};
    const char *const slash = strrchr(path, '/'), *const name = slash ? slash + 1 : path;
    size_t n = strlen(name);
    for (size_t i = 0; i < sizeof endings / sizeof *endings; i++) {
        const size_t n_ending = strlen(endings[i]);
        if (n > n_ending && !strcasecmp(name + n - n_ending, endings[i])) {
            n -= n_ending;
            break;
        }
    }
    snprintf(stem, size, "%.*s", (int)n, name);
}

/* Writes the value of a pattern's part: unchanged, or with glob()'s special characters escaped. */
static void put_part(FILE *out, const char *text, bool for_glob)
{
    for (; *text; text++)
        fprintf(out, "%s%c", for_glob && strchr("*?[]\\", *text) ? "\\" : "", *text);
}

/* The pattern with its places filled in, to be freed with free(); NULL without memory. */
static char *fill_pattern(const char *pattern, const char *uid, const char *stem, bool for_glob)
{
    const char *const places[] = {"{series_uid}", "{stem}"}, *const texts[] = {uid, stem};
    char *path = NULL;
    size_t size;
    FILE *const out = open_memstream(&path, &size);
    while (out && *pattern) {
        int i = 0;
        while (i < 2 && strncmp(pattern, places[i], strlen(places[i])) != 0)
            i++;
        if (i < 2)
            put_part(out, texts[i], for_glob);
        else
            fputc(*pattern, out);
        pattern += i < 2 ? strlen(places[i]) : 1;
    }
    return cts_text_end(out, &path);
}

static CtsStatus add_path(CtsLabelPaths *paths, const char *path, CtsError *err)
{
    CtsStatus st = cts_grow(&paths->items, paths->n, err);
    if (!st && !(paths->items[paths->n] = strdup(path)))
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    paths->n += !st;
    return st;
}

/* *found: files are there that it names. */
static CtsStatus add_for(const char *pattern, const char *uid, const char *stem, CtsLabelPaths *paths, bool *found,
                         CtsError *err)
{
    struct stat info;
    glob_t list = {0};
    char *const path = fill_pattern(pattern, uid, stem, false), *const wild = fill_pattern(pattern, uid, stem, true);
    CtsStatus st = path && wild ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    *found = !st && !stat(path, &info);
    if (!st && (*found || !strpbrk(pattern, "*?[")))
        st = add_path(paths, path, err);
    else if (!st && !glob(wild, 0, NULL, &list))
        *found = list.gl_pathc;
    for (size_t i = 0; !st && i < list.gl_pathc; i++)
        st = add_path(paths, list.gl_pathv[i], err);
    globfree(&list);
    free(path);
    free(wild);
    return st;
}

CtsStatus cts_label_paths(const char *pattern, const char *uid, const char *ct, CtsLabelPaths *paths, CtsError *err)
{
    static const char channel[] = "_0000"; /* suffix of nnU-Net's images, which its label maps lack */
    char stem[256] = "";
    bool found = false;
    *paths = (CtsLabelPaths){0};
    if (ct)
        cts_label_stem(ct, stem, sizeof stem);
    else if (strstr(pattern, "{stem}"))
        return CTS_OK;
    const size_t n = strlen(stem), n_channel = strlen(channel);
    CtsStatus st = add_for(pattern, uid, stem, paths, &found, err);
    if (!st && !found && n > n_channel && !strcmp(stem + n - n_channel, channel) && strstr(pattern, "{stem}")) {
        CtsLabelPaths others = {0};
        stem[n - n_channel] = 0;
        st = add_for(pattern, uid, stem, &others, &found, err);
        if (found) {
            cts_label_paths_free(paths);
            *paths = others;
        } else {
            cts_label_paths_free(&others);
        }
    }
    if (st)
        cts_label_paths_free(paths);
    return st;
}

void cts_label_paths_free(CtsLabelPaths *paths)
{
    for (size_t i = 0; i < paths->n; i++)
        free(paths->items[i]);
    free(paths->items);
    *paths = (CtsLabelPaths){0};
}

static void put_file(FILE *out, const char *path)
{
    struct stat info;
    if (!stat(path, &info))
        fprintf(out, "%s %llu %lld.%09ld\n", path, (unsigned long long)info.st_size, (long long)info.st_mtim.tv_sec,
                info.st_mtim.tv_nsec);
}

static CtsStatus put_file_facts(FILE *out, const char *path, CtsError *err)
{
    struct stat info;
    CtsFileList list = {0};
    if (stat(path, &info) || !S_ISDIR(info.st_mode)) {
        put_file(out, path);
        return CTS_OK;
    }
    const CtsStatus st = cts_scan_paths(NULL, &path, 1, &list, err);
    for (size_t i = 0; !st && i < list.n; i++)
        put_file(out, list.items[i].path);
    cts_file_list_free(&list);
    return st;
}

CtsStatus cts_labels_stamp(const char *pattern, const char *series_uid, const char *ct, char **stamp, CtsError *err)
{
    CtsLabelPaths paths;
    size_t size;
    CtsStatus st = cts_label_paths(pattern, series_uid, ct, &paths, err);
    FILE *const out = open_memstream(stamp, &size);
    for (size_t i = 0; !st && out && i < paths.n; i++)
        st = put_file_facts(out, paths.items[i], err);
    cts_label_paths_free(&paths);
    if (!cts_text_end(out, stamp) && !st)
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (st) {
        free(*stamp);
        *stamp = NULL;
    }
    return st;
}
