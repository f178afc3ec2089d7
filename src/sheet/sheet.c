#define _GNU_SOURCE
#include "sheet/sheet.h"

#include "base/file.h"
#include "sheet/card.h"
#include "sheet/page.h"
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* One line of a journal, found again by its place. */
typedef struct Line {
    char *series_uid;
    char ended[32];
    int journal; /* among the journals */
    off_t at;
} Line;

typedef struct Journals {
    FILE **files;
    int n_files;
    Line *lines;
    size_t n_lines, n_allocated;
    int n_unreadable; /* lines that are no series */
} Journals;

static int is_journal(const struct dirent *entry)
{
    int shard, n_shards, n = 0;
    const char *name = entry->d_name;
    return !strcmp(name, "batch.jsonl") ||
           (sscanf(name, "batch-%9d-of-%9d.jsonl%n", &shard, &n_shards, &n) == 2 && n > 0 && !name[n]);
}

static void close_journals(Journals *j)
{
    for (int i = 0; i < j->n_files; i++)
        fclose(j->files[i]);
    for (size_t i = 0; i < j->n_lines; i++)
        free(j->lines[i].series_uid);
    free(j->files);
    free(j->lines);
}

static CtsStatus open_journals(Journals *j, const char *dir, CtsError *err)
{
    struct dirent **names = NULL;
    const int n = scandir(dir, &names, is_journal, versionsort);
    CtsStatus st = CTS_OK;
    if (n <= 0)
        st = n < 0 ? cts_fail(err, CTS_ERR_READ, "%s: cannot be listed: %s", dir, strerror(errno))
                   : cts_fail(err, CTS_ERR_READ, "%s: holds no journal (give the folder that `ctsplat batch -O` wrote)",
                              dir);
    else if (!(j->files = calloc((size_t)n, sizeof *j->files)))
        st = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", dir);
    for (int i = 0; i < n; i++) {
        char *path = NULL;
        if (!st && asprintf(&path, "%s/%s", dir, names[i]->d_name) < 0)
            st = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", dir);
        if (!st && !(j->files[j->n_files] = fopen(path, "re")))
            st = cts_fail(err, CTS_ERR_READ, "%s: cannot be opened: %s", path, strerror(errno));
        j->n_files += !st;
        free(path);
        free(names[i]);
    }
    free(names);
    return st;
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

static CtsStatus add_line(Journals *j, const json_t *json, int journal, off_t at, CtsError *err)
{
    const char *ended = json_string_value(json_object_get(json, "ended"));
    if (j->n_lines == j->n_allocated) {
        const size_t n = j->n_allocated ? 2 * j->n_allocated : 1024;
        Line *lines = reallocarray(j->lines, n, sizeof *lines);
        if (!lines)
            return cts_fail(err, CTS_ERR_MEMORY, "the journal's %zu lines: out of memory", j->n_lines);
        j->lines = lines;
        j->n_allocated = n;
    }
    Line *line = &j->lines[j->n_lines];
    *line = (Line){.journal = journal, .at = at};
    snprintf(line->ended, sizeof line->ended, "%s", ended ? ended : "");
    if (!(line->series_uid = strdup(json_string_value(json_object_get(json, "series_uid")))))
        return cts_fail(err, CTS_ERR_MEMORY, "the journal's %zu lines: out of memory", j->n_lines);
    j->n_lines++;
    return CTS_OK;
}

static CtsStatus index_journal(Journals *j, int journal, CtsError *err)
{
    FILE *file = j->files[journal];
    char *text = NULL;
    size_t allocated = 0;
    CtsStatus st = CTS_OK;
    off_t at = 0;
    for (ssize_t n; !st && (n = getline(&text, &allocated, file)) > 0; at += n) {
        json_t *line = text[n - 1] == '\n' ? parse_line(text, (size_t)n) : NULL;
        if (line)
            st = add_line(j, line, journal, at, err);
        else if (text[n - 1] == '\n') /* else torn off by a power cut */
            j->n_unreadable++;
        json_decref(line);
    }
    if (!st && ferror(file))
        st = cts_fail(err, CTS_ERR_READ, "a journal cannot be read: %s", strerror(errno));
    free(text);
    return st;
}

static int by_series(const void *a, const void *b)
{
    const Line *x = a, *y = b;
    const int order = strcmp(x->series_uid, y->series_uid);
    if (order)
        return order;
    return x->journal != y->journal ? x->journal - y->journal : (x->at > y->at) - (x->at < y->at);
}

/* Of lines[0..n), all of one series in order of journals: the one that counts. */
static const Line *last_word(const Line *lines, size_t n)
{
    const Line *best = &lines[0];
    for (size_t i = 1; i < n; i++)
        if (lines[i].journal == best->journal || strcmp(lines[i].ended, best->ended) >= 0)
            best = &lines[i];
    return best;
}

/* JSON that no HTML parser takes for markup. */
static CtsStatus write_json(CtsTempFile *temp, const json_t *value, CtsError *err)
{
    char *text = json_dumps(value, JSON_COMPACT | JSON_ENSURE_ASCII);
    if (!text)
        return cts_fail(err, CTS_ERR_MEMORY, "the contact sheet: out of memory");
    CtsStatus st = CTS_OK;
    for (const char *c = text; *c && !st;) {
        const size_t n = strcspn(c, "<");
        st = cts_temp_write(temp, c, n, err);
        c += n;
        if (*c && !st) {
            st = cts_temp_write(temp, "\\u003c", 6, err);
            c++;
        }
    }
    free(text);
    return st;
}

static CtsStatus write_card(CtsTempFile *temp, const Journals *j, const Line *line, bool first, CtsError *err)
{
    FILE *file = j->files[line->journal];
    char *text = NULL;
    size_t allocated = 0;
    ssize_t n = -1;
    CtsStatus st;
    if (!fseeko(file, line->at, SEEK_SET))
        n = getline(&text, &allocated, file);
    json_t *json = n > 0 ? parse_line(text, (size_t)n) : NULL, *card = json ? cts_sheet_card(json) : NULL;
    if (!json)
        st = cts_fail(err, CTS_ERR_READ, "a journal changed while it was read (try again)");
    else if (!card)
        st = cts_fail(err, CTS_ERR_MEMORY, "the contact sheet: out of memory");
    else if (!(st = cts_temp_write(temp, first ? "\n" : ",\n", first ? 1 : 2, err)))
        st = write_json(temp, card, err);
    json_decref(card);
    json_decref(json);
    free(text);
    return st;
}

static CtsStatus write_cards(CtsTempFile *temp, Journals *j, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (j->n_lines)
        qsort(j->lines, j->n_lines, sizeof *j->lines, by_series);
    for (size_t i = 0, n; i < j->n_lines && !st; i += n) {
        for (n = 1; i + n < j->n_lines && !strcmp(j->lines[i + n].series_uid, j->lines[i].series_uid);)
            n++;
        st = write_card(temp, j, last_word(j->lines + i, n), i == 0, err);
    }
    return st;
}

static CtsStatus write_page(CtsTempFile *temp, Journals *j, CtsError *err)
{
    char start[128];
    CtsStatus st;
    const int n = snprintf(start, sizeof start, "{\"version\":\"%s\",\"unreadable\":%d,\"series\":[", CTS_VERSION,
                           j->n_unreadable);
    if ((st = cts_temp_write(temp, cts_sheet_head, cts_sheet_head_bytes, err)) ||
        (st = cts_temp_write(temp, start, (size_t)n, err)) || (st = write_cards(temp, j, err)) ||
        (st = cts_temp_write(temp, "]}\n", 3, err)))
        return st;
    return cts_temp_write(temp, cts_sheet_tail, cts_sheet_tail_bytes, err);
}

CtsStatus cts_sheet_write(const char *dir, CtsError *err)
{
    Journals journals = {0};
    CtsTempFile *temp = NULL;
    char *path = NULL;
    CtsStatus st = open_journals(&journals, dir, err);
    for (int i = 0; i < journals.n_files && !st; i++)
        st = index_journal(&journals, i, err);
    if (!st && asprintf(&path, "%s/index.html", dir) < 0)
        st = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", dir);
    if (!st && !(st = cts_temp_open(&temp, path, err)) && !(st = write_page(temp, &journals, err)))
        st = cts_temp_commit(&temp, true, NULL, err);
    cts_temp_discard(&temp);
    free(path);
    close_journals(&journals);
    return st;
}
