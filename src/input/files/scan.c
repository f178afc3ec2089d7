#include "input/files/scan.h"

#include "base/mem.h"
#include "input/files/archive.h"
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { MAX_DEPTH = 32 }; /* each level of folders holds an open file */

void cts_file_list_free(CtsFileList *list)
{
    free(list->items);
    cts_string_pool_free(&list->texts);
    cts_archives_free(&list->archives);
    cts_diagnostics_free(&list->scan.diagnostics);
    *list = (CtsFileList){0};
}

CtsStatus cts_file_list_add(void *context, const CtsFile *file, const char *archive, CtsError *err)
{
    CtsFileList *const list = context;
    (void)archive;
    const char *const path = cts_string_pool_add(&list->texts, file->path, strlen(file->path));
    if (!path || cts_grow(&list->items, list->n, NULL))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    list->items[list->n] = *file;
    list->items[list->n++].path = path;
    return CTS_OK;
}

static char *join_path(const char *folder, const char *name)
{
    char *path;
    const size_t n = strlen(folder);
    return asprintf(&path, "%s%s%s", folder, n && folder[n - 1] == '/' ? "" : "/", name) < 0 ? NULL : path;
}

/* The kind of a directory entry, without stat() where the file system provides it; a link counts as its target, but a
 * link to a folder as special. */
static unsigned char entry_type(int folder_fd, const struct dirent *entry)
{
    struct stat info;
    if (entry->d_type != DT_UNKNOWN && entry->d_type != DT_LNK)
        return entry->d_type;
    if (fstatat(folder_fd, entry->d_name, &info, AT_SYMLINK_NOFOLLOW))
        return DT_REG; /* opening it will report the error */
    if (S_ISLNK(info.st_mode))
        return fstatat(folder_fd, entry->d_name, &info, 0) || S_ISREG(info.st_mode) ? DT_REG : DT_LNK;
    return S_ISREG(info.st_mode) ? DT_REG : S_ISDIR(info.st_mode) ? DT_DIR : DT_SOCK;
}

static CtsStatus scan_folder(CtsScan *scan, const char *folder, int depth, CtsError *err);

static CtsStatus scan_entries(CtsScan *scan, const char *folder, DIR *dir, int depth, CtsError *err)
{
    CtsStatus st = CTS_OK;
    char **subfolders = NULL;
    size_t n_subfolders = 0;
    const struct dirent *entry;
    while (!st && (entry = readdir(dir))) {
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0)
            continue;
        const unsigned char type = entry_type(dirfd(dir), entry);
        if (type != DT_REG && type != DT_DIR) {
            scan->n_special++;
            continue;
        }
        char *path = join_path(folder, entry->d_name);
        if (!path || (type == DT_DIR && cts_grow(&subfolders, n_subfolders, NULL)))
            st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        else if (type == DT_REG)
            st = scan->found(scan->context, &(CtsFile){.path = path}, NULL, err);
        if (!st && type == DT_DIR)
            subfolders[n_subfolders++] = path;
        else
            free(path);
    }
    for (size_t i = 0; i < n_subfolders; i++) {
        if (!st)
            st = scan_folder(scan, subfolders[i], depth + 1, err);
        free(subfolders[i]);
    }
    free(subfolders);
    return st;
}

static CtsStatus scan_folder(CtsScan *scan, const char *folder, int depth, CtsError *err)
{
    if (depth > MAX_DEPTH) {
        scan->n_unreadable++;
        cts_diagnostics_add(&scan->diagnostics, CTS_DIAGNOSTIC_FOLDER_TOO_DEEP,
                            "%s: not searched, more than %d folders deep", folder, MAX_DEPTH);
        return CTS_OK;
    }
    DIR *dir = opendir(folder);
    if (!dir) {
        const int e = errno;
        if (depth == 0)
            return cts_fail(err, CTS_ERR_READ, "%s: the folder cannot be listed: %s", folder, strerror(e));
        scan->n_unreadable++;
        cts_diagnostics_add(&scan->diagnostics, CTS_DIAGNOSTIC_UNREADABLE_FOLDER, "%s: the folder cannot be listed: %s",
                            folder, strerror(e));
        return CTS_OK;
    }
    const CtsStatus st = scan_entries(scan, folder, dir, depth, err);
    closedir(dir);
    return st;
}

/* The members of a zip file, as if it were a folder. */
static CtsStatus scan_archive(CtsScan *scan, const char *path, CtsError *err)
{
    CtsArchive *archive;
    CtsStatus st = cts_archive_open(path, &archive, err);
    if (st)
        return st;
    scan->n_other += archive->n_other;
    for (int i = 0; !st && i < archive->n_members; i++) {
        const CtsMember m = archive->members[i];
        if (m.is_bad) {
            scan->n_unreadable++;
            cts_diagnostics_add(&scan->diagnostics, CTS_DIAGNOSTIC_UNREADABLE_FILE, "%s: %s: cannot be unpacked: %s",
                                path, m.name, (const char *)m.bytes);
            continue;
        }
        char *name = join_path(path, m.name);
        const CtsFile file = {.path = name, .memory = m.bytes, .n_memory = m.n_bytes};
        st = name ? scan->found(scan->context, &file, path, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        free(name);
    }
    const CtsStatus kept = cts_archives_add(scan->kept, path, archive, err);
    return st ? st : kept;
}

static int by_path(const void *a, const void *b)
{
    const CtsFile *x = a, *y = b;
    const int order = strcmp(x->path, y->path);
    return order ? order : (int)y->named - (int)x->named;
}

CtsStatus cts_scan_each(CtsScan *scan, const char *const *paths, int n_paths, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (int i = 0; !st && i < n_paths; i++) {
        struct stat info;
        CtsFile file = {.path = paths[i], .named = true};
        const bool is_member = cts_archives_find(scan->archives, paths[i], &file);
        if (!is_member && stat(paths[i], &info) && lstat(paths[i], &info))
            st = cts_fail(err, CTS_ERR_READ, "%s: cannot be read: %s", paths[i], strerror(errno));
        else if (!is_member && S_ISDIR(info.st_mode))
            st = scan_folder(scan, paths[i], 0, err);
        else if (!is_member && S_ISREG(info.st_mode) && cts_archive_is_zip(paths[i]))
            st = scan_archive(scan, paths[i], err);
        else if (is_member || S_ISREG(info.st_mode) || S_ISLNK(info.st_mode)) /* opening a dangling link fails */
            st = scan->found(scan->context, &file, NULL, err);
        else
            st = cts_fail(err, CTS_ERR_READ, "%s: is neither a file nor a folder", paths[i]);
    }
    return st;
}

CtsStatus cts_scan_paths(const struct CtsArchives *archives, const char *const *paths, int n_paths, CtsFileList *list,
                         CtsError *err)
{
    *list = (CtsFileList){
        .scan = {.found = cts_file_list_add, .context = list, .kept = &list->archives, .archives = archives}};
    const CtsStatus st = cts_scan_each(&list->scan, paths, n_paths, err);
    if (st) {
        cts_file_list_free(list);
        return st;
    }
    if (list->n)
        qsort(list->items, list->n, sizeof *list->items, by_path);
    size_t kept = 0;
    for (size_t i = 0; i < list->n; i++)
        if (!kept || strcmp(list->items[kept - 1].path, list->items[i].path) != 0)
            list->items[kept++] = list->items[i];
    list->n = kept;
    return CTS_OK;
}
