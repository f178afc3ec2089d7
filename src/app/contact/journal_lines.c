#include "app/contact/journal_lines.h"

#include "base/mem.h"
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static bool is_journal(const char *name)
{
    int shard, n_shards, n = 0;
    return !strcmp(name, "batch.jsonl") ||
           (sscanf(name, "batch-%9d-of-%9d.jsonl%n", &shard, &n_shards, &n) == 2 && n > 0 && !name[n]);
}

bool cts_journal_path_is_safe(const char *path)
{
    if (*path == '/')
        return false;
    for (const char *part = path;; part++) {
        const size_t n = strcspn(part, "/");
        if (n == 0 || (n == 1 && *part == '.') || (n == 2 && !strncmp(part, "..", 2)))
            return false;
        part += n;
        if (!*part)
            return true;
    }
}

const CtsJournalLine *cts_journal_lines_find(const CtsJournalLines *lines, const char *series_uid)
{
    const json_t *place = json_object_get(lines->places, series_uid);
    return place ? &lines->items[json_integer_value(place)] : NULL;
}

static bool counts(const CtsJournalLines *j, const CtsJournalLine *known, const CtsJournalLine *line)
{
    if (known->file == line->file)
        return true;
    if (j->own_first && (known->file == 0 || line->file == 0))
        return line->file == 0;
    return strcmp(line->ended, known->ended) >= 0;
}

static CtsStatus add_journal_series(CtsJournalLines *j, const char *uid, CtsError *err)
{
    const CtsStatus st = cts_grow(&j->items, j->n, err);
    if (st)
        return st;
    if (!j->places)
        j->places = json_object();
    j->items[j->n] = (CtsJournalLine){.series_uid = strdup(uid)};
    if (!j->items[j->n].series_uid || json_object_set_new(j->places, uid, json_integer((json_int_t)j->n))) {
        free(j->items[j->n].series_uid);
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory for the journal");
    }
    j->n++;
    return CTS_OK;
}

CtsStatus cts_journal_lines_put(CtsJournalLines *j, const json_t *json, CtsJournalLine line, CtsError *err)
{
    const char *uid = json_string_value(json_object_get(json, "series_uid"));
    const char *ended = json_string_value(json_object_get(json, "ended"));
    const json_t *place = json_object_get(j->places, uid);
    CtsStatus st;
    snprintf(line.ended, sizeof line.ended, "%s", ended ? ended : "");
    if (!place && (st = add_journal_series(j, uid, err)))
        return st;
    CtsJournalLine *known = &j->items[place ? (size_t)json_integer_value(place) : j->n - 1];
    line.series_uid = known->series_uid;
    if (!place || counts(j, known, &line))
        *known = line;
    return CTS_OK;
}

/* The line as JSON when it is that of a series, or NULL. */
static json_t *parse_line(const char *text, size_t n)
{
    json_t *line = json_loadb(text, n, JSON_ALLOW_NUL, NULL);
    if (json_is_string(json_object_get(line, "series_uid")))
        return line;
    json_decref(line);
    return NULL;
}

static CtsStatus take_lines(CtsJournalLines *j, FILE *stream, uint64_t *end, CtsError *err)
{
    CtsStatus st = CTS_OK;
    char *text = NULL;
    size_t capacity = 0;
    /* Ignores an incomplete last line, as a power cut leaves. */
    for (ssize_t n; !st && (n = getline(&text, &capacity, stream)) > 0 && text[n - 1] == '\n'; *end += (uint64_t)n) {
        json_t *line = parse_line(text, (size_t)n);
        j->n_unreadable += !line;
        if (line)
            st = cts_journal_lines_put(
                j, line, (CtsJournalLine){.file = j->n_files - 1, .offset = *end, .size = (size_t)n}, err);
        json_decref(line);
    }
    if (!st && ferror(stream))
        st = cts_fail(err, CTS_ERR_READ, "a journal cannot be read: %s", strerror(errno));
    free(text);
    return st;
}

CtsStatus cts_journal_lines_read(CtsJournalLines *lines, int fd, const char *folder, uint64_t *end, CtsError *err)
{
    const CtsJournalFile file = {fdopen(fd, "r"), strdup(folder)};
    *end = 0;
    if (!file.stream || !file.folder || cts_grow(&lines->files, lines->n_files, err)) {
        free(file.folder);
        file.stream ? fclose(file.stream) : close(fd);
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory for the journal");
    }
    lines->files[lines->n_files++] = file;
    return take_lines(lines, file.stream, end, err);
}

static CtsStatus add_journal(CtsJournalLines *j, const char *dir, const char *folder, const char *name, CtsError *err)
{
    char *path = NULL;
    uint64_t end;
    if (asprintf(&path, "%s/%s%s", dir, folder, name) < 0)
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", dir);
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    const CtsStatus st = fd < 0 ? cts_fail(err, CTS_ERR_READ, "%s: cannot be opened: %s", path, strerror(errno))
                                : cts_journal_lines_read(j, fd, folder, &end, err);
    free(path);
    return st;
}

CtsStatus cts_journal_lines_read_folder(CtsJournalLines *j, const char *dir, const char *folder, bool deep,
                                        const char *except, CtsError *err)
{
    struct dirent **entries = NULL;
    char *path = NULL;
    CtsStatus st = CTS_OK;
    if (asprintf(&path, "%s/%s", dir, folder) < 0)
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", dir);
    const int n = scandir(path, &entries, NULL, versionsort);
    if (n < 0 && (deep || errno != ENOTDIR))
        st = cts_fail(err, CTS_ERR_READ, "%s: cannot be listed: %s", path, strerror(errno));
    for (int i = 0; i < n; i++) {
        char *below = NULL;
        const char *const name = entries[i]->d_name;
        const bool into = deep && name[0] != '.';
        if (!st && is_journal(name) && (!except || strcmp(name, except)))
            st = add_journal(j, dir, folder, name, err);
        else if (!st && into && asprintf(&below, "%s/", name) < 0)
            st = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", dir);
        else if (!st && into)
            st = cts_journal_lines_read_folder(j, dir, below, false, NULL, err);
        free(below);
        free(entries[i]);
    }
    free(entries);
    free(path);
    return st;
}

json_t *cts_journal_lines_load(const CtsJournalLines *lines, const CtsJournalLine *line)
{
    char *text = malloc(line->size);
    json_t *json = NULL;
    if (text &&
        pread(fileno(lines->files[line->file].stream), text, line->size, (off_t)line->offset) == (ssize_t)line->size)
        json = parse_line(text, line->size);
    free(text);
    return json;
}

static int by_uid(const void *a, const void *b)
{
    return strcmp(((const CtsJournalLine *)a)->series_uid, ((const CtsJournalLine *)b)->series_uid);
}

void cts_journal_lines_sort(CtsJournalLines *lines)
{
    json_decref(lines->places);
    lines->places = NULL;
    if (lines->n)
        qsort(lines->items, lines->n, sizeof *lines->items, by_uid);
}

void cts_journal_lines_free(CtsJournalLines *lines)
{
    for (int i = 0; i < lines->n_files; i++) {
        fclose(lines->files[i].stream);
        free(lines->files[i].folder);
    }
    for (size_t i = 0; i < lines->n; i++)
        free(lines->items[i].series_uid);
    json_decref(lines->places);
    free(lines->files);
    free(lines->items);
    *lines = (CtsJournalLines){0};
}
