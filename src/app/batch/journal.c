#include "app/batch/journal.h"

#include "app/contact/journal_lines.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/json.h"
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

/* Time to wait for a run that is ending: 2 s, like GRACE_MS of its workers (worker.c). */
enum { LOCK_TRIES = 20, LOCK_PAUSE_MS = 100 };

struct CtsJournal {
    const CtsBatchSettings *settings;
    const char *folder;
    char path[PATH_MAX];
    int lock_all, lock_own; /* descriptors, or -1 */
    int lock_error;         /* errno of a file system that has no locks, or 0 */
    int fd;                 /* this shard's, which is the first of the lines' */
    uint64_t end;           /* of it */
    CtsJournalLines lines;  /* of others', too */
};

static CtsStatus fail_journal(CtsError *err, const char *path, const char *what)
{
    return cts_fail(err, CTS_ERR_OUTPUT, "%s: %s: %s", path, what, strerror(errno));
}

/* Tries to get a lock, with a few repetitions; true, too, where the file system has none (ENOSYS: Lustre, ENOLCK: NFS,
 * EOPNOTSUPP: FUSE). */
static bool try_lock(CtsJournal *j, int fd, int how)
{
    const struct timespec pause = {0, LOCK_PAUSE_MS * 1000000L};
    for (int i = 0; i < LOCK_TRIES; i++) {
        if (!flock(fd, how | LOCK_NB))
            return true;
        if (errno != EWOULDBLOCK && errno != EINTR) {
            j->lock_error = errno;
            return true;
        }
        nanosleep(&pause, NULL);
    }
    return false;
}

static CtsStatus open_lock(const char *folder, const char *name, int *fd, CtsError *err)
{
    char path[PATH_MAX + 64];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    *fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    return *fd < 0 ? fail_journal(err, path, "cannot be written") : CTS_OK;
}

/* Fails if a lock file was removed: it would not exclude another batch, which creates a new one. */
static CtsStatus check_locks(const CtsJournal *j, CtsError *err)
{
    const int fds[] = {j->lock_all, j->lock_own};
    struct stat info;
    for (int i = 0; i < 2; i++)
        if (fds[i] >= 0 && !fstat(fds[i], &info) && info.st_nlink == 0)
            return cts_fail(err, CTS_ERR_INTERNAL,
                            "%s: the batch's lock was removed while it ran (run it again; it resumes)", j->folder);
    return CTS_OK;
}

static void warn_without_locks(const CtsJournal *j)
{
    const CtsBatchListener *const listener = &j->settings->listener;
    char text[PATH_MAX + 200];
    snprintf(text, sizeof text,
             "%s: its file system has no locks (flock: %s): do not run two batches, or shards of different numbers, "
             "there at once",
             j->folder, strerror(j->lock_error));
    if (j->lock_error)
        listener->message(listener->context, true, text);
}

static CtsStatus another_batch(const CtsJournal *j, CtsError *err)
{
    return cts_fail(err, CTS_ERR_INTERNAL, "%s: another batch is running there (wait for it, or choose another -O)",
                    j->folder);
}

/* Only shards of the same total number may run together; the first one writes the number to the lock file. */
static CtsStatus lock_shards(CtsJournal *j, int n_shards, CtsError *err)
{
    char text[32] = "";
    if (try_lock(j, j->lock_all, LOCK_EX)) {
        const int n = snprintf(text, sizeof text, "%d\n", n_shards);
        if (ftruncate(j->lock_all, 0) || pwrite(j->lock_all, text, (size_t)n, 0) != n)
            return fail_journal(err, j->folder, "its lock cannot be written");
        return try_lock(j, j->lock_all, LOCK_SH) ? CTS_OK : another_batch(j, err);
    }
    if (!try_lock(j, j->lock_all, LOCK_SH))
        return another_batch(j, err);
    if (pread(j->lock_all, text, sizeof text - 1, 0) <= 0 || atoi(text) != n_shards)
        return cts_fail(err, CTS_ERR_INTERNAL, "%s: a batch of %d shards is running there (--shard I/%d joins it)",
                        j->folder, atoi(text), atoi(text));
    return CTS_OK;
}

static CtsStatus lock(CtsJournal *j, int shard, int n_shards, CtsError *err)
{
    char name[80];
    CtsStatus st;
    if ((st = open_lock(j->folder, ".batch.lock", &j->lock_all, err)))
        return st;
    if (n_shards == 1)
        return try_lock(j, j->lock_all, LOCK_EX) ? CTS_OK : another_batch(j, err);
    if ((st = lock_shards(j, n_shards, err)))
        return st;
    snprintf(name, sizeof name, ".batch-%d-of-%d.lock", shard, n_shards);
    if ((st = open_lock(j->folder, name, &j->lock_own, err)))
        return st;
    return try_lock(j, j->lock_own, LOCK_EX)
               ? CTS_OK
               : cts_fail(err, CTS_ERR_INTERNAL, "%s: another batch is running on shard %d/%d there (wait for it)",
                          j->folder, shard, n_shards);
}

static CtsStatus read_own(CtsJournal *j, bool fresh, CtsError *err)
{
    CtsStatus st;
    j->fd = open(j->path, O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW | (fresh ? O_TRUNC : 0), 0666);
    if (j->fd < 0)
        return fail_journal(err, j->path, "cannot be written");
    j->lines.own_first = true;
    if ((st = cts_journal_lines_read(&j->lines, j->fd, "", &j->end, err)))
        return st;
    /* Truncate an incomplete last line of a killed run. */
    return ftruncate(j->fd, (off_t)j->end) ? fail_journal(err, j->path, "cannot be written") : CTS_OK;
}

CtsStatus cts_journal_open(CtsJournal **journal, const CtsBatchSettings *settings, CtsError *err)
{
    CtsStatus st;
    const CtsOptions *const o = settings->options;
    CtsJournal *j = *journal = calloc(1, sizeof *j);
    if (!j)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    j->lock_all = j->lock_own = -1;
    j->settings = settings;
    j->folder = o->output_dir;
    if (o->shard.n == 1)
        snprintf(j->path, sizeof j->path, "%.4000s/batch.jsonl", j->folder);
    else
        snprintf(j->path, sizeof j->path, "%.4000s/batch-%d-of-%d.jsonl", j->folder, o->shard.i, o->shard.n);
    if ((st = lock(j, o->shard.i, o->shard.n, err)) || (st = check_locks(j, err)) ||
        (st = read_own(j, o->fresh, err)) ||
        /* Those of other shards, so that their series are not rendered again when the number of shards changes. */
        (!o->fresh &&
         (st = cts_journal_lines_read_folder(&j->lines, j->folder, "", false, strrchr(j->path, '/') + 1, err))))
        cts_journal_close(journal);
    else
        warn_without_locks(j);
    return st;
}

json_t *cts_journal_find(const CtsJournal *journal, const char *series_uid, bool *is_own)
{
    const CtsJournalLine *line = cts_journal_lines_find(&journal->lines, series_uid);
    if (is_own)
        *is_own = line && line->file == 0;
    return line ? cts_journal_lines_load(&journal->lines, line) : NULL;
}

static CtsStatus append_to_journal(CtsJournal *j, const char *text, size_t n, CtsError *err)
{
    if (cts_write_all(j->fd, text, n))
        return CTS_OK;
    const CtsStatus st = fail_journal(err, j->path, "cannot be written");
    if (ftruncate(j->fd, (off_t)j->end))
        cts_context(err, "%s: its last line is incomplete", j->path);
    return st;
}

/* The record without the details that the settings exclude, as a line of the journal; NULL without memory. */
static char *new_line(const CtsJournal *j, json_t *record)
{
    cts_journal_record_redact(j->settings, record);
    char *object = json_dumps(record, JSON_COMPACT | JSON_REAL_PRECISION(12)), *line = NULL;
    if (object && asprintf(&line, "%s\n", object) < 0)
        line = NULL;
    free(object);
    return line;
}

CtsStatus cts_journal_add(CtsJournal *journal, const json_t *record, CtsError *err)
{
    json_t *kept = json_deep_copy(record);
    char *line = kept ? new_line(journal, kept) : NULL;
    const size_t n = line ? strlen(line) : 0;
    CtsStatus st = line ? append_to_journal(journal, line, n, err)
                        : cts_fail(err, CTS_ERR_MEMORY, "out of memory for a line of the journal");
    if (!st && !(st = cts_journal_lines_put(&journal->lines, record,
                                            (CtsJournalLine){.offset = journal->end, .size = n}, err)))
        journal->end += n;
    free(line);
    json_decref(kept);
    return st;
}

CtsStatus cts_journal_sync(CtsJournal *journal, CtsError *err)
{
    const CtsStatus st = check_locks(journal, err);
    if (st)
        return st;
    return cts_sync_file(journal->fd) ? CTS_OK : fail_journal(err, journal->path, "cannot be written");
}

static CtsStatus write_line(CtsTempFile *temp, const CtsJournal *j, const CtsJournalLine *at, CtsError *err)
{
    json_t *line = cts_journal_lines_load(&j->lines, at);
    char *text = line ? new_line(j, line) : NULL;
    json_decref(line);
    const CtsStatus st = text ? cts_temp_write(temp, text, strlen(text), err)
                              : cts_fail(err, CTS_ERR_OUTPUT, "%s: a line cannot be read back", j->path);
    free(text);
    return st;
}

/* True if the series of a record, of which "UID#2" is a part, is a key. */
static bool is_planned(const json_t *planned, const char *series_uid)
{
    char uid[80];
    snprintf(uid, sizeof uid, "%.*s", (int)strcspn(series_uid, "#"), series_uid);
    return json_object_get(planned, uid);
}

/* Removes the pictures of a record, and their folders. */
static void remove_pictures(const CtsJournal *j, json_t *record)
{
    const char *const folder = cts_json_text_of(record, "folder");
    char path[PATH_MAX];
    cts_journal_record_drop(record, "outputs", j->settings, NULL, NULL);
    cts_journal_record_drop(record, "thumbnails", j->settings, NULL, NULL);
    for (int deep = 2; deep-- > 0 && cts_journal_path_is_safe(folder);)
        if (snprintf(path, sizeof path, "%s/%s%s", j->folder, folder, deep ? "/thumbs" : "") < PATH_MAX)
            rmdir(path);
}

void cts_journal_forget(CtsJournal *journal, const json_t *planned)
{
    CtsJournalLines *const j = &journal->lines;
    const int64_t days_s = (int64_t)journal->settings->options->forget_days * 24 * 3600;
    const CtsUtc before = cts_utc_at((int64_t)time(NULL) - days_s);
    for (size_t i = 0; i < j->n; i++) {
        if (j->items[i].file || strcmp(j->items[i].ended, before.text) >= 0 ||
            is_planned(planned, j->items[i].series_uid))
            continue;
        json_t *record = cts_journal_lines_load(j, &j->items[i]);
        if (record)
            remove_pictures(journal, record);
        json_decref(record);
        j->items[i].size = 0;
    }
}

CtsStatus cts_journal_finish(CtsJournal *journal, CtsError *err)
{
    CtsTempFile *temp = NULL;
    CtsJournalLines *const j = &journal->lines;
    CtsStatus st = check_locks(journal, err);
    if (!st)
        st = cts_temp_open(&temp, journal->path, err);
    cts_journal_lines_sort(j);
    for (size_t i = 0; i < j->n && !st; i++)
        if (j->items[i].file == 0 && j->items[i].size)
            st = write_line(temp, journal, &j->items[i], err);
    if (!st)
        st = cts_temp_commit(&temp, true, NULL, err);
    cts_temp_discard(&temp);
    return st;
}

void cts_journal_leave(CtsJournal *journal)
{
    const int fds[] = {journal->lock_all, journal->lock_own};
    for (int i = 0; i < 2; i++)
        if (fds[i] >= 0)
            close(fds[i]);
    journal->lock_all = journal->lock_own = -1;
}

void cts_journal_close(CtsJournal **journal)
{
    CtsJournal *j = *journal;
    if (!j)
        return;
    cts_journal_leave(j);
    cts_journal_lines_free(&j->lines);
    free(j);
    *journal = NULL;
}
