#include "dicom/net/peer.h"

#include "base/file.h"
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

static const char prefix[] = "ctsplat-from-";
enum { TRIES = 8 }; /* to lock a new folder that others may remove */

/* Locks a folder of this program; -1 when it belongs to another program, is in use, or does not exist. Where the file
 * system has no locks, a new one is taken without, and another stays. */
static int lock_folder(const char *path, bool is_new)
{
    struct stat info;
    const int fd = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (fd < 0)
        return -1;
    if (!fstat(fd, &info) && info.st_uid == geteuid() &&
        (!flock(fd, LOCK_EX | LOCK_NB) || (is_new && errno != EWOULDBLOCK && errno != EINTR)) && !fstat(fd, &info) &&
        info.st_nlink > 0)
        return fd;
    close(fd);
    return -1;
}

/* Removes folders of killed programs. */
static void remove_stale(void)
{
    DIR *dir = opendir(cts_temp_root());
    const struct dirent *entry;
    while (dir && (entry = readdir(dir))) {
        char *path = NULL;
        if (strncmp(entry->d_name, prefix, strlen(prefix)) ||
            asprintf(&path, "%s/%s", cts_temp_root(), entry->d_name) < 0)
            continue;
        CtsFetched stale = {path, lock_folder(path, false)};
        if (stale.lock >= 0)
            cts_net_fetched_remove(&stale);
        free(stale.folder);
    }
    if (dir)
        closedir(dir);
}

CtsStatus cts_fetch_folder_make(CtsFetched *fetched, CtsError *err)
{
    CtsStatus st = CTS_OK;
    *fetched = (CtsFetched){.lock = -1};
    remove_stale();
    /* Another program's sweep may remove the folder before it is locked. */
    for (int i = 0; !st && fetched->lock < 0 && i < TRIES; i++) {
        free(fetched->folder);
        if (!(st = cts_temp_folder(prefix, &fetched->folder, err)))
            fetched->lock = lock_folder(fetched->folder, true);
    }
    if (!st && fetched->lock < 0)
        st = cts_fail(err, CTS_ERR_OUTPUT, "%s: a folder there cannot be locked (set TMPDIR to another one)",
                      cts_temp_root());
    return st;
}

CtsStatus cts_fetch_folder_grows(const CtsFetchFolder *fetch_folder, uint64_t n_bytes, CtsError *err)
{
    struct statvfs disk;
    if (fetch_folder->n_files > CTS_FETCH_MAX_FILES)
        return cts_fail(err, CTS_ERR_READ, "the peer sends more than %d files (give `series-uid`)",
                        CTS_FETCH_MAX_FILES);
    if (n_bytes >> 20 >= CTS_FETCH_MAX_FILE_MIB)
        return cts_fail(err, CTS_ERR_READ, "the peer sends a file of more than %d GiB", CTS_FETCH_MAX_FILE_MIB >> 10);
    if ((fetch_folder->n_bytes + n_bytes) >> 20 >= CTS_FETCH_MAX_MIB)
        return cts_fail(err, CTS_ERR_READ, "the peer sends more than %d GiB (give `series-uid`)",
                        CTS_FETCH_MAX_MIB >> 10);
    if (statvfs(fetch_folder->folder, &disk) == 0 && disk.f_bavail < disk.f_blocks / 10)
        return cts_fail(err, CTS_ERR_READ, "%s: the disk is nearly full (set TMPDIR to another one)",
                        fetch_folder->folder);
    return CTS_OK;
}

CtsStatus cts_fetch_folder_next(CtsFetchFolder *fetch_folder, char **path, CtsError *err)
{
    fetch_folder->n_files++;
    *path = NULL;
    const CtsStatus st = cts_fetch_folder_grows(fetch_folder, 0, err);
    if (st)
        return st;
    if (asprintf(path, "%s/%06d.dcm", fetch_folder->folder, fetch_folder->n_files) < 0) {
        *path = NULL;
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    return CTS_OK;
}

CtsStatus cts_fetch_folder_keep(CtsFetchFolder *fetch_folder, const char *path, CtsError *err)
{
    struct stat file;
    if (stat(path, &file))
        return cts_fail(err, CTS_ERR_READ, "%s: what was fetched is gone: %s", path, strerror(errno));
    /* Equal objects give equal files (size and time), so that a batch does not render them again. */
    const struct timespec never[2] = {{0}, {0}};
    utimensat(AT_FDCWD, path, never, 0);
    const CtsStatus st = cts_fetch_folder_grows(fetch_folder, (uint64_t)file.st_size, err);
    fetch_folder->n_bytes += (uint64_t)file.st_size;
    return st;
}

void cts_fetch_folder_limit(CtsFetchFolder *fetch_folder, int n)
{
    char path[4200];
    for (; fetch_folder->n_files > n; fetch_folder->n_files--) {
        snprintf(path, sizeof path, "%s/%06d.dcm", fetch_folder->folder, fetch_folder->n_files);
        unlink(path);
    }
}

void cts_net_fetched_remove(CtsFetched *fetched)
{
    DIR *dir = fetched->folder ? opendir(fetched->folder) : NULL;
    const struct dirent *entry;
    while (dir && (entry = readdir(dir)))
        if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0)
            unlinkat(dirfd(dir), entry->d_name, 0);
    if (dir)
        closedir(dir);
    if (fetched->folder)
        rmdir(fetched->folder);
    if (fetched->folder && fetched->lock >= 0)
        close(fetched->lock);
    free(fetched->folder);
    *fetched = (CtsFetched){.lock = -1};
}
