#define _GNU_SOURCE
#include "app/batch/journal.h"

#include "app/batch/batch_plan.h"
#include "base/file.h"
#include "base/mem.h"
#include <dirent.h>
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

/* How long a run that is ending is waited for. */
enum { LOCK_TRIES = 20, LOCK_PAUSE_MS = 100 };

/* A place in one of the journals; key 0 of an empty slot. */
typedef struct Slot {
    uint64_t key, offset;
    int file;
    uint32_t size;
} Slot;

struct CtsJournal {
    char folder[PATH_MAX], path[PATH_MAX];
    int lock_all, lock_own; /* descriptors, or -1 */
    int *files;             /* 0: this shard's; then those of others */
    int n_files;
    uint64_t end; /* of file 0 */
    Slot *slots;  /* a power of two of them, half of them empty at least */
    size_t n_slots, n_used;
};

static CtsStatus fail_errno(CtsError *err, const char *path, const char *what)
{
    return cts_fail(err, CTS_ERR_OUTPUT, "%s: %s: %s", path, what, strerror(errno));
}

static Slot *find_slot(Slot *slots, size_t n, uint64_t key)
{
    size_t i = key & (n - 1);
    while (slots[i].size && slots[i].key != key)
        i = (i + 1) & (n - 1);
    return &slots[i];
}

static CtsStatus put(CtsJournal *j, Slot slot, CtsError *err)
{
    if (2 * (j->n_used + 1) > j->n_slots) {
        const size_t n = j->n_slots ? 2 * j->n_slots : 256;
        Slot *grown = calloc(n, sizeof *grown);
        if (!grown)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory for the journal");
        for (size_t i = 0; i < j->n_slots; i++)
            if (j->slots[i].size)
                *find_slot(grown, n, j->slots[i].key) = j->slots[i];
        free(j->slots);
        j->slots = grown;
        j->n_slots = n;
    }
    Slot *at = find_slot(j->slots, j->n_slots, slot.key);
    j->n_used += !at->size;
    *at = slot;
    return CTS_OK;
}

/* Takes the whole lines of a file; *end is where the last one ends. */
static CtsStatus read_lines(CtsJournal *j, int file, uint64_t *end, CtsError *err)
{
    CtsStatus st = CTS_OK;
    char *text = NULL;
    size_t capacity = 0;
    uint64_t offset = 0;
    const int fd = dup(j->files[file]);
    FILE *stream = fd < 0 ? NULL : fdopen(fd, "r");
    if (!stream)
        return fail_errno(err, j->path, "cannot be read");
    rewind(stream);
    for (ssize_t n; !st && (n = getline(&text, &capacity, stream)) > 0 && text[n - 1] == '\n';) {
        json_t *line = json_loadb(text, (size_t)n, 0, NULL);
        const char *uid = json_string_value(json_object_get(line, "series_uid"));
        uint64_t key;
        if (uid && !(st = cts_plan_key(uid, &key, err))) {
            /* This shard's own word counts before that of others. */
            const Slot *known = j->n_slots ? find_slot(j->slots, j->n_slots, key) : NULL;
            if (file == 0 || !known || !known->size || known->file != 0)
                st = put(j, (Slot){key, offset, file, (uint32_t)n}, err);
        }
        json_decref(line);
        offset += (uint64_t)n;
    }
    if (!st && ferror(stream))
        st = fail_errno(err, j->path, "cannot be read");
    free(text);
    fclose(stream);
    *end = offset;
    return st;
}

static bool is_journal(const char *name)
{
    int shard, n_shards, n = 0;
    return !strcmp(name, "batch.jsonl") ||
           (sscanf(name, "batch-%d-of-%d.jsonl%n", &shard, &n_shards, &n) == 2 && n && !name[n]);
}

/* What other shards did, or this one when there were more or fewer of them, need not be done again. */
static CtsStatus read_others(CtsJournal *j, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const struct dirent *entry;
    DIR *dir = opendir(j->folder);
    while (!st && dir && (entry = readdir(dir))) {
        char path[PATH_MAX + 260];
        snprintf(path, sizeof path, "%s/%s", j->folder, entry->d_name);
        if (!is_journal(entry->d_name) || !strcmp(path, j->path))
            continue;
        const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
        uint64_t end;
        if (fd < 0)
            continue;
        if ((st = cts_grow(&j->files, j->n_files, err))) {
            close(fd);
            break;
        }
        j->files[j->n_files++] = fd;
        st = read_lines(j, j->n_files - 1, &end, err);
    }
    if (dir)
        closedir(dir);
    return st;
}

/* Whether a lock could be had within a moment. */
static bool try_lock(int fd, int how)
{
    const struct timespec pause = {0, LOCK_PAUSE_MS * 1000000L};
    for (int i = 0; i < LOCK_TRIES; i++) {
        if (!flock(fd, how | LOCK_NB))
            return true;
        if (errno != EWOULDBLOCK && errno != EINTR)
            return false;
        nanosleep(&pause, NULL);
    }
    return false;
}

static CtsStatus open_lock(const char *folder, const char *name, int *fd, CtsError *err)
{
    char path[PATH_MAX + 64];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    *fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    return *fd < 0 ? fail_errno(err, path, "cannot be written") : CTS_OK;
}

/* A lock whose file is gone keeps nobody out: the next batch makes another one. */
static CtsStatus check_locks(const CtsJournal *j, CtsError *err)
{
    const int fds[] = {j->lock_all, j->lock_own};
    struct stat info;
    for (int i = 0; i < 2; i++)
        if (fds[i] >= 0 && !fstat(fds[i], &info) && info.st_nlink == 0)
            return cts_fail(err, CTS_ERR_INTERNAL,
                            "%s: the batch's lock was removed while it was at work (run it again; it goes on)",
                            j->folder);
    return CTS_OK;
}

/* Shards of one and the same number go beside each other; the first writes the number down. */
static CtsStatus lock_shards(CtsJournal *j, int n_shards, CtsError *err)
{
    char text[32] = "";
    if (try_lock(j->lock_all, LOCK_EX)) {
        const int n = snprintf(text, sizeof text, "%d\n", n_shards);
        if (ftruncate(j->lock_all, 0) || pwrite(j->lock_all, text, (size_t)n, 0) != n)
            return fail_errno(err, j->folder, "its lock cannot be written");
        return flock(j->lock_all, LOCK_SH) ? fail_errno(err, j->folder, "cannot be locked") : CTS_OK;
    }
    if (!try_lock(j->lock_all, LOCK_SH))
        return cts_fail(err, CTS_ERR_INTERNAL, "%s: another batch is at work there (wait for it, or choose another -O)",
                        j->folder);
    if (pread(j->lock_all, text, sizeof text - 1, 0) <= 0 || atoi(text) != n_shards)
        return cts_fail(err, CTS_ERR_INTERNAL, "%s: a batch of %d shards is at work there (--shard I/%d joins it)",
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
        return try_lock(j->lock_all, LOCK_EX)
                   ? CTS_OK
                   : cts_fail(err, CTS_ERR_INTERNAL,
                              "%s: another batch is at work there (wait for it, or choose another -O)", j->folder);
    if ((st = lock_shards(j, n_shards, err)))
        return st;
    snprintf(name, sizeof name, ".batch-%d-of-%d.lock", shard, n_shards);
    if ((st = open_lock(j->folder, name, &j->lock_own, err)))
        return st;
    return try_lock(j->lock_own, LOCK_EX)
               ? CTS_OK
               : cts_fail(err, CTS_ERR_INTERNAL, "%s: another batch is at work on shard %d/%d there (wait for it)",
                          j->folder, shard, n_shards);
}

static CtsStatus read_own(CtsJournal *j, bool fresh, CtsError *err)
{
    CtsStatus st;
    if ((st = cts_grow(&j->files, 0, err)))
        return st;
    j->files[0] = open(j->path, O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (j->files[0] < 0)
        return fail_errno(err, j->path, "cannot be written");
    j->n_files = 1;
    if (fresh && ftruncate(j->files[0], 0))
        return fail_errno(err, j->path, "cannot be written");
    if ((st = read_lines(j, 0, &j->end, err)))
        return st;
    /* What a killed run left of its last line. */
    if (ftruncate(j->files[0], (off_t)j->end))
        return fail_errno(err, j->path, "cannot be written");
    return CTS_OK;
}

CtsStatus cts_journal_open(CtsJournal **journal, const char *folder, int shard, int n_shards, bool fresh, CtsError *err)
{
    CtsStatus st;
    CtsJournal *j = *journal = calloc(1, sizeof *j);
    if (!j)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    j->lock_all = j->lock_own = -1;
    snprintf(j->folder, sizeof j->folder, "%s", folder);
    if (n_shards == 1)
        snprintf(j->path, sizeof j->path, "%.4000s/batch.jsonl", folder);
    else
        snprintf(j->path, sizeof j->path, "%.4000s/batch-%d-of-%d.jsonl", folder, shard, n_shards);
    if ((st = lock(j, shard, n_shards, err)) || (st = check_locks(j, err)) || (st = read_own(j, fresh, err)) ||
        (!fresh && (st = read_others(j, err))))
        cts_journal_close(journal);
    return st;
}

/* The text of a line, to be freed, without its end. */
static char *line_text(const CtsJournal *j, const Slot *slot)
{
    char *text = malloc(slot->size);
    if (text && pread(j->files[slot->file], text, slot->size, (off_t)slot->offset) == (ssize_t)slot->size) {
        text[slot->size - 1] = 0;
        return text;
    }
    free(text);
    return NULL;
}

json_t *cts_journal_find(const CtsJournal *journal, const char *series_uid)
{
    uint64_t key;
    if (!journal->n_slots || cts_plan_key(series_uid, &key, NULL))
        return NULL;
    const Slot *slot = find_slot(journal->slots, journal->n_slots, key);
    char *text = slot->size ? line_text(journal, slot) : NULL;
    json_t *line = text ? json_loads(text, 0, NULL) : NULL;
    free(text);
    return line;
}

bool cts_journal_holds(const CtsJournal *journal, const char *series_uid)
{
    uint64_t key;
    if (!journal->n_slots || cts_plan_key(series_uid, &key, NULL))
        return false;
    const Slot *slot = find_slot(journal->slots, journal->n_slots, key);
    return slot->size && slot->file == 0;
}

static CtsStatus append(CtsJournal *j, const char *text, size_t n, CtsError *err)
{
    if (cts_write_all(j->files[0], text, n))
        return CTS_OK;
    const CtsStatus st = fail_errno(err, j->path, "cannot be written");
    if (ftruncate(j->files[0], (off_t)j->end))
        cts_context(err, "%s: its last line is torn", j->path);
    return st;
}

CtsStatus cts_journal_add(CtsJournal *journal, const json_t *line, CtsError *err)
{
    uint64_t key;
    CtsStatus st = cts_plan_key(json_string_value(json_object_get(line, "series_uid")), &key, err);
    char *object = json_dumps(line, JSON_COMPACT | JSON_REAL_PRECISION(12)), *text = NULL;
    const int n = object ? asprintf(&text, "%s\n", object) : -1;
    if (!st && n < 0)
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory for a line of the journal");
    if (!st && !(st = append(journal, text, (size_t)n, err)) &&
        !(st = put(journal, (Slot){key, journal->end, 0, (uint32_t)n}, err)))
        journal->end += (uint64_t)n;
    if (n >= 0)
        free(text);
    free(object);
    return st;
}

CtsStatus cts_journal_sync(CtsJournal *journal, CtsError *err)
{
    const CtsStatus st = check_locks(journal, err);
    if (st)
        return st;
    return fdatasync(journal->files[0]) ? fail_errno(err, journal->path, "cannot be written") : CTS_OK;
}

typedef struct Line {
    char *uid;
    const Slot *slot;
} Line;

static int by_uid(const void *a, const void *b)
{
    return strcmp(((const Line *)a)->uid, ((const Line *)b)->uid);
}

static CtsStatus write_line(CtsTempFile *temp, const CtsJournal *j, const Slot *slot,
                            void (*change)(void *context, json_t *line), void *context, CtsError *err)
{
    char *text = line_text(j, slot);
    json_t *line = text ? json_loads(text, 0, NULL) : NULL;
    free(text);
    if (line)
        change(context, line);
    text = line ? json_dumps(line, JSON_COMPACT | JSON_REAL_PRECISION(12)) : NULL;
    json_decref(line);
    CtsStatus st = text ? CTS_OK : cts_fail(err, CTS_ERR_OUTPUT, "%s: a line cannot be read again", j->path);
    if (!st && !(st = cts_temp_write(temp, text, strlen(text), err)))
        st = cts_temp_write(temp, "\n", 1, err);
    free(text);
    return st;
}

/* The UIDs of this shard's lines, in order. */
static CtsStatus list_lines(const CtsJournal *j, Line **lines, size_t *n, CtsError *err)
{
    *n = 0;
    if (!(*lines = calloc(j->n_used + 1, sizeof **lines)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory for the journal");
    for (size_t i = 0; i < j->n_slots; i++) {
        const Slot *slot = &j->slots[i];
        char *text = slot->size && slot->file == 0 ? line_text(j, slot) : NULL;
        json_t *line = text ? json_loads(text, 0, NULL) : NULL;
        const char *uid = json_string_value(json_object_get(line, "series_uid"));
        if (uid && ((*lines)[*n].uid = strdup(uid)))
            (*lines)[(*n)++].slot = slot;
        json_decref(line);
        free(text);
    }
    if (*n)
        qsort(*lines, *n, sizeof **lines, by_uid);
    return CTS_OK;
}

CtsStatus cts_journal_finish(CtsJournal *journal, void (*change)(void *context, json_t *line), void *context,
                             CtsError *err)
{
    CtsTempFile *temp = NULL;
    Line *lines = NULL;
    size_t n = 0;
    CtsStatus st = check_locks(journal, err);
    if (!st)
        st = list_lines(journal, &lines, &n, err);
    if (!st)
        st = cts_temp_open(&temp, journal->path, err);
    for (size_t i = 0; i < n && !st; i++)
        st = write_line(temp, journal, lines[i].slot, change, context, err);
    if (!st)
        st = cts_temp_commit(&temp, true, NULL, err);
    cts_temp_discard(&temp);
    for (size_t i = 0; lines && i < n; i++)
        free(lines[i].uid);
    free(lines);
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
    for (int i = 0; i < j->n_files; i++)
        if (j->files[i] >= 0)
            close(j->files[i]);
    cts_journal_leave(j);
    free(j->files);
    free(j->slots);
    free(j);
    *journal = NULL;
}
