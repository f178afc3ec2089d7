#include "app/batch/idle.h"

#include "app/batch/journal.h"
#include "base/bytes.h"
#include "base/file.h"
#include "output/export/sc_texts.h"
#include <fts.h>
#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

/* Sum over a path and all below it, so that their order does not matter: names, and of files sizes and times. A link
 * counts with its own number, which a new link has not, and the times of its target. hidden: with names directly below
 * it that begin with a point. */
static uint64_t sum_path(const char *path, bool hidden)
{
    char *const paths[] = {(char *)(uintptr_t)path, NULL};
    FTS *const walk = fts_open(paths, FTS_PHYSICAL | FTS_COMFOLLOW | FTS_NOCHDIR, NULL);
    uint64_t sum = 0;
    for (FTSENT *e; walk && (e = fts_read(walk));) {
        struct stat info = *e->fts_statp;
        uint64_t hash = cts_fnv(CTS_FNV, e->fts_path, strlen(e->fts_path) + 1);
        hash = cts_fnv(hash, &e->fts_info, sizeof e->fts_info);
        if (!hidden && e->fts_level == 1 && e->fts_name[0] == '.') {
            fts_set(walk, e, FTS_SKIP);
            continue;
        }
        if (!S_ISDIR(info.st_mode) && (!S_ISLNK(info.st_mode) || !stat(e->fts_accpath, &info))) {
            const int64_t facts[] = {(int64_t)e->fts_statp->st_ino, info.st_size,        info.st_mtim.tv_sec,
                                     info.st_mtim.tv_nsec,          info.st_ctim.tv_sec, info.st_ctim.tv_nsec};
            hash = cts_fnv(hash, facts, sizeof facts);
        }
        sum += hash;
    }
    if (walk)
        fts_close(walk);
    return sum;
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

void cts_idle_end(const CtsIdle *idle, const CtsBatchSettings *settings, const CtsUtc *due, const CtsBatchResult *r)
{
    char path[PATH_MAX], text[400];
    CtsTempFile *temp = NULL;
    if (!idle->settings[0])
        return;
    state_path(settings->options, path);
    snprintf(text, sizeof text, "%s %" PRIx64 " %" PRIx64 " %s %zu %zu\n", idle->settings, idle->inputs,
             sum_path(settings->options->output_dir, false), due->text[0] ? due->text : "never", r->n_series,
             r->n_done + r->n_thumbnails + r->n_skipped + r->n_waiting);
    if (!cts_temp_open(&temp, path, NULL) && !cts_temp_write(temp, text, strlen(text), NULL))
        cts_temp_commit(&temp, true, NULL, NULL);
    cts_temp_discard(&temp);
}
