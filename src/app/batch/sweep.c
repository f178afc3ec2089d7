#define _GNU_SOURCE
#include "app/batch/sweep.h"

#include "app/batch/batch_plan.h"
#include <dirent.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* .NAME.PID.XXXXXX.tmp; the process's number, or 0. */
static pid_t owner_of(const char *name)
{
    const size_t n = strlen(name);
    if (name[0] != '.' || n < 14 || strcmp(name + n - 4, ".tmp") || name[n - 11] != '.')
        return 0;
    size_t i = n - 11;
    while (i > 1 && name[i - 1] >= '0' && name[i - 1] <= '9')
        i--;
    return i > 1 && name[i - 1] == '.' && i < n - 11 ? (pid_t)atol(name + i) : 0;
}

void cts_sweep(const char *folder, pid_t pid, const char *prefix)
{
    const struct dirent *entry;
    DIR *dir = opendir(folder);
    while (dir && (entry = readdir(dir))) {
        const pid_t owner = owner_of(entry->d_name);
        if (owner && (!pid || owner == pid) && !strncmp(entry->d_name, prefix, strlen(prefix)))
            unlinkat(dirfd(dir), entry->d_name, 0);
    }
    if (dir)
        closedir(dir);
}

/* A folder's name tells its UID, or the key of one that cannot be a name; parts of a UID have a number behind it. */
static bool is_mine(const char *name, int shard, int n_shards)
{
    char uid[256];
    uint64_t key;
    if (sscanf(name, "uid-%16llx", (unsigned long long *)&key) != 1) {
        snprintf(uid, sizeof uid, "%s", name);
        uid[strcspn(uid, "-")] = 0;
        if (uid[strspn(uid, "0123456789.")] || cts_plan_key(uid, &key, NULL))
            return false;
    }
    return key % (uint64_t)n_shards == (uint64_t)shard;
}

void cts_sweep_all(const char *folder, int shard, int n_shards)
{
    char path[PATH_MAX + 300], prefix[80];
    const struct dirent *entry;
    DIR *dir = opendir(folder);
    if (n_shards == 1)
        snprintf(prefix, sizeof prefix, ".");
    else
        snprintf(prefix, sizeof prefix, ".batch-%d-of-%d.", shard, n_shards);
    cts_sweep(folder, 0, prefix);
    while (dir && (entry = readdir(dir))) {
        if (!is_mine(entry->d_name, shard, n_shards))
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        cts_sweep(path, 0, "");
        snprintf(path, sizeof path, "%s/%s/thumbs", folder, entry->d_name);
        cts_sweep(path, 0, "");
    }
    if (dir)
        closedir(dir);
}
