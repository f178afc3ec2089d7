#include "app/batch/sweep.h"

#include <dirent.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* .NAME.PID.XXXXXX.tmp */
static bool is_temporary(const char *name)
{
    const size_t n = strlen(name);
    if (name[0] != '.' || n < 14 || strcmp(name + n - 4, ".tmp") || name[n - 11] != '.')
        return false;
    size_t i = n - 11;
    while (i > 1 && name[i - 1] >= '0' && name[i - 1] <= '9')
        i--;
    return i > 1 && name[i - 1] == '.' && i < n - 11;
}

void cts_sweep(const char *folder, const char *prefix)
{
    const struct dirent *entry;
    DIR *dir = opendir(folder);
    while (dir && (entry = readdir(dir)))
        if (is_temporary(entry->d_name) && !strncmp(entry->d_name, prefix, strlen(prefix)))
            unlinkat(dirfd(dir), entry->d_name, 0);
    if (dir)
        closedir(dir);
}

void cts_sweep_all(const char *folder, int shard, int n_shards)
{
    char path[PATH_MAX + 300];
    const struct dirent *entry;
    if (n_shards > 1) {
        snprintf(path, sizeof path, ".batch-%d-of-%d.", shard, n_shards);
        cts_sweep(folder, path);
        return;
    }
    DIR *dir = opendir(folder);
    cts_sweep(folder, ".");
    while (dir && (entry = readdir(dir)))
        for (int deep = 0; deep < 2 && entry->d_name[0] != '.'; deep++) {
            snprintf(path, sizeof path, "%s/%s%s", folder, entry->d_name, deep ? "/thumbs" : "");
            cts_sweep(path, "");
        }
    if (dir)
        closedir(dir);
}
