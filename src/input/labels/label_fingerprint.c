/* A text that changes when label files change. */
#include "ctsplat/label_files.h"
#include "input/files/scan.h"
#include "input/labels/label_reading.h"
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

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
    *stamp = NULL;
    CtsStatus st = cts_label_paths(pattern, series_uid, ct, &paths, err);
    FILE *const out = st ? NULL : open_memstream(stamp, &size);
    if (!st && !out)
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (size_t i = 0; !st && i < paths.n; i++)
        st = put_file_facts(out, paths.items[i], err);
    cts_label_paths_free(&paths);
    if (out && fclose(out) && !st)
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (st) {
        free(*stamp);
        *stamp = NULL;
    }
    return st;
}
