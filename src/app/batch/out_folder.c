#include "app/batch/batch.h"

#include "base/file.h"
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <fnmatch.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

CtsStatus cts_batch_open_folder(const CtsBatchSettings *settings, CtsError *err)
{
    const CtsOptions *const o = settings->options;
    char folder[PATH_MAX], path[PATH_MAX];
    if (mkdir(o->output_dir, 0777) && errno != EEXIST)
        return cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be made: %s", o->output_dir, strerror(errno));
    if (!realpath(o->output_dir, folder))
        return cts_fail(err, CTS_ERR_OUTPUT, "%s: %s", o->output_dir, strerror(errno));
    for (int i = 0; i < o->paths.n; i++)
        if (realpath(o->paths.items[i], path) && !strcmp(path, folder))
            return cts_fail(err, CTS_ERR_USAGE,
                            "%s: is searched for series, and nothing is written there "
                            "(choose another folder for -O)",
                            o->output_dir);
    snprintf(path, sizeof path, "%.4000s/batch.jsonl", o->output_dir);
    return cts_file_check_writable(path, true, err);
}

CtsStatus cts_folder_probe(const CtsBatchSettings *settings, CtsError *err)
{
    enum { PROBE = 1 << 20 }; /* bytes, about a picture's */
    char path[PATH_MAX];
    CtsTempFile *temp = NULL;
    if (snprintf(path, sizeof path, "%s/probe", settings->options->output_dir) >= PATH_MAX)
        return CTS_OK;
    CtsStatus st = cts_temp_open(&temp, path, err);
    if (!st && ((errno = posix_fallocate(cts_temp_fd(temp), 0, PROBE)) || !cts_sync_file(cts_temp_fd(temp))))
        st = cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be written: %s", path, strerror(errno));
    if (st)
        cts_context(err, "%s takes no more files", settings->options->output_dir);
    cts_temp_discard(&temp);
    return st;
}

/* Removes files whose names begin with prefix. */
static void sweep(const char *folder, const char *prefix)
{
    const struct dirent *entry;
    DIR *dir = opendir(folder);
    while (dir && (entry = readdir(dir)))
        if (!fnmatch(".*.[0-9]*.??????.tmp", entry->d_name, 0) && /* .NAME.PID.XXXXXX.tmp (base/file.c) */
            !strncmp(entry->d_name, prefix, strlen(prefix)))
            unlinkat(dirfd(dir), entry->d_name, 0);
    if (dir)
        closedir(dir);
}

void cts_sweep_series(const char *output_dir, const char *folder)
{
    char path[PATH_MAX + 300];
    for (int deep = 0; deep < 2; deep++) {
        snprintf(path, sizeof path, "%s/%s%s", output_dir, folder, deep ? "/thumbs" : "");
        sweep(path, "");
    }
}

void cts_sweep_all(const char *folder, int shard, int n_shards)
{
    char prefix[64];
    const struct dirent *entry;
    if (n_shards > 1) {
        snprintf(prefix, sizeof prefix, ".batch-%d-of-%d.", shard, n_shards);
        sweep(folder, prefix);
        return;
    }
    DIR *dir = opendir(folder);
    sweep(folder, ".");
    while (dir && (entry = readdir(dir)))
        if (entry->d_name[0] != '.')
            cts_sweep_series(folder, entry->d_name);
    if (dir)
        closedir(dir);
}
