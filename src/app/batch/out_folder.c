#include "app/batch/batch.h"

#include "base/file.h"
#include <errno.h>
#include <fcntl.h>
#include <fnmatch.h>
#include <fts.h>
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
    snprintf(path, sizeof path, "%.4000s/.", o->output_dir);
    if (!realpath(path, folder))
        return cts_fail(err, CTS_ERR_OUTPUT, "%s: %s (-O names a folder)", o->output_dir, strerror(errno));
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

/* Removes temporary files whose names begin with prefix, in a folder and in those so many levels below it, of the last
 * level those of thumbnails alone. */
static void sweep(const char *folder, int depth, const char *prefix)
{
    static const char temporary[] = ".*.[0-9]*.??????.tmp"; /* .NAME.PID.XXXXXX.tmp (base/file.c) */
    char *const paths[] = {(char *)(uintptr_t)folder, NULL};
    FTS *const walk = fts_open(paths, FTS_PHYSICAL | FTS_NOCHDIR, NULL);
    for (FTSENT *e; walk && (e = fts_read(walk));) {
        const bool is_last = e->fts_level == depth && strcmp(e->fts_name, "thumbs");
        if (e->fts_info == FTS_D && e->fts_level && (is_last || e->fts_level > depth || e->fts_name[0] == '.'))
            fts_set(walk, e, FTS_SKIP);
        else if (e->fts_info == FTS_F && !fnmatch(temporary, e->fts_name, 0) &&
                 !strncmp(e->fts_name, prefix, strlen(prefix)))
            unlink(e->fts_accpath);
    }
    if (walk)
        fts_close(walk);
}

void cts_sweep_series(const char *output_dir, const char *folder)
{
    char path[PATH_MAX + 300];
    snprintf(path, sizeof path, "%s/%s", output_dir, folder);
    sweep(path, 1, "");
}

void cts_sweep_all(const char *folder, int shard, int n_shards)
{
    char prefix[64] = "";
    if (n_shards > 1)
        snprintf(prefix, sizeof prefix, ".batch-%d-of-%d.", shard, n_shards);
    sweep(folder, n_shards > 1 ? 0 : 2, prefix);
}
