#include "app/batch/idle.h"

#include "app/batch/journal.h"
#include "base/bytes.h"
#include "base/file.h"
#include "output/export/sc_texts.h"
#include <dirent.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { MAX_DEPTH = 32 }; /* of folders, as in input/files/scan.c */

static uint64_t hash_name(uint64_t hash, const char *name)
{
    return cts_fnv(hash, name, strlen(name) + 1);
}

static uint64_t hash_stat(uint64_t hash, const struct stat *info)
{
    const int64_t facts[] = {info->st_size, info->st_mtim.tv_sec, info->st_mtim.tv_nsec, info->st_ctim.tv_sec,
                             info->st_ctim.tv_nsec};
    return cts_fnv(hash, facts, sizeof facts);
}

static uint64_t sum_folder(int fd, uint64_t seed, int depth, bool hidden);

/* A link counts with its own number, which a new link has not, and the times of its target. */
static uint64_t hash_entry(int folder_fd, const struct dirent *entry, uint64_t seed, int depth)
{
    const uint64_t hash = hash_name(seed, entry->d_name);
    struct stat info;
    if (entry->d_type == DT_DIR && depth < MAX_DEPTH)
        return sum_folder(openat(folder_fd, entry->d_name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC), hash,
                          depth + 1, true);
    return fstatat(folder_fd, entry->d_name, &info, 0)
               ? hash
               : hash_stat(cts_fnv(hash, &entry->d_ino, sizeof entry->d_ino), &info);
}

/* Sum over the entries, so that their order does not matter. Closes fd. hidden: with names that begin with a point. */
static uint64_t sum_folder(int fd, uint64_t seed, int depth, bool hidden)
{
    DIR *dir = fd < 0 ? NULL : fdopendir(fd);
    const struct dirent *entry;
    uint64_t sum = seed + (dir != NULL);
    if (fd >= 0 && !dir)
        close(fd);
    while (dir && (entry = readdir(dir)))
        if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0 && (hidden || entry->d_name[0] != '.'))
            sum += hash_entry(fd, entry, seed, depth);
    if (dir)
        closedir(dir);
    return sum;
}

static uint64_t sum_path(const char *path, bool hidden)
{
    const uint64_t hash = hash_name(CTS_FNV, path);
    struct stat info;
    if (stat(path, &info))
        return hash;
    return S_ISDIR(info.st_mode) ? sum_folder(open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC), hash, 0, hidden)
                                 : hash_stat(hash, &info);
}

/* Label files may lie anywhere, and depend on the series. */
static bool hash_settings(const CtsBatchSettings *s, const CtsKey *key, char hex[65])
{
    const CtsOptions *const o = s->options;
    char common[65], name[80] = "", numbers[64];
    const CtsUtc today = cts_utc_now();
    if (!o->settled_s || o->fresh || o->labels.n || cts_journal_record_hash(s, NULL, true, common, NULL) ||
        (key && cts_uid_keyed(key, "series of a batch", "1", name, NULL)))
        return false;
    CtsHash *hash = cts_hash_start(NULL);
    snprintf(numbers, sizeof numbers, "%d %d %d %d %.10s", o->settled_s, o->show_patient, o->show_paths, o->forget_days,
             o->forget_days ? today.text : "");
    const char *const texts[] = {common, name, numbers, s->lists->send_to, o->source.series_uid};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        cts_hash_text(hash, texts[i] ? texts[i] : "");
    return !cts_hash_hex(&hash, hex, NULL);
}

static void state_path(const CtsOptions *o, char path[PATH_MAX])
{
    if (o->shard.n == 1)
        snprintf(path, PATH_MAX, "%.4000s/.batch.idle", o->output_dir);
    else
        snprintf(path, PATH_MAX, "%.4000s/.batch-%d-of-%d.idle", o->output_dir, o->shard.i, o->shard.n);
}

bool cts_idle_begin(CtsIdle *idle, const CtsBatchSettings *settings, const CtsKey *key, CtsBatchResult *result)
{
    const CtsOptions *const o = settings->options;
    char path[PATH_MAX], last[65], due[24];
    uint64_t inputs, outputs;
    CtsBatchResult r = {.is_idle = true};
    *idle = (CtsIdle){0};
    if (!hash_settings(settings, key, idle->settings))
        idle->settings[0] = 0;
    for (int i = 0; idle->settings[0] && i < o->paths.n; i++)
        idle->inputs += sum_path(o->paths.items[i], true);
    state_path(o, path);
    FILE *file = idle->settings[0] ? fopen(path, "re") : NULL;
    const int n = file ? fscanf(file, "%64s %" SCNx64 " %" SCNx64 " %23s %zu %zu", last, &inputs, &outputs, due,
                                &r.n_series, &r.n_done)
                       : 0;
    if (file)
        fclose(file);
    if (n != 6 || strcmp(last, idle->settings) || inputs != idle->inputs ||
        (strcmp(due, "never") && strcmp(due, cts_utc_now().text) <= 0) || outputs != sum_path(o->output_dir, false))
        return false;
    *result = r;
    return true;
}

void cts_idle_end(const CtsIdle *idle, const CtsBatchSettings *settings, const CtsLater *later, const CtsBatchResult *r)
{
    char path[PATH_MAX], text[400];
    CtsTempFile *temp = NULL;
    if (!idle->settings[0])
        return;
    state_path(settings->options, path);
    snprintf(text, sizeof text, "%s %" PRIx64 " %" PRIx64 " %s %zu %zu\n", idle->settings, idle->inputs,
             sum_path(settings->options->output_dir, false), later->due.text[0] ? later->due.text : "never",
             r->n_series, r->n_done + r->n_thumbnails + r->n_skipped + r->n_waiting);
    if (!cts_temp_open(&temp, path, NULL) && !cts_temp_write(temp, text, strlen(text), NULL))
        cts_temp_commit(&temp, true, NULL, NULL);
    cts_temp_discard(&temp);
}
