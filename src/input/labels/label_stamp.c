/* What changes where label files do. */
#include "base/mem.h"
#include "ctsplat/label_files.h"
#include "input/files/scan.h"
#include "input/labels/label_reading.h"
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static void put_file(FILE *out, const char *path)
{
    struct stat info;
    if (!stat(path, &info))
        fprintf(out, "%s %llu %lld.%09ld\n", path, (unsigned long long)info.st_size, (long long)info.st_mtim.tv_sec,
                info.st_mtim.tv_nsec);
}

static CtsStatus put(FILE *out, const char *path, CtsError *err)
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

CtsStatus cts_labels_stamp(const char *pattern, const char *series_uid, char **stamp, CtsError *err)
{
    glob_t found = {0};
    size_t size;
    *stamp = NULL;
    char *path = cts_label_path(pattern, series_uid);
    FILE *out = path ? open_memstream(stamp, &size) : NULL;
    CtsStatus st = out ? put(out, path, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (!st && strpbrk(path, "*?[") && !glob(path, 0, NULL, &found))
        for (size_t i = 0; !st && i < found.gl_pathc; i++)
            st = put(out, found.gl_pathv[i], err);
    globfree(&found);
    if (out && fclose(out) && !st)
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (st) {
        free(*stamp);
        *stamp = NULL;
    }
    free(path);
    return st;
}
