#define _GNU_SOURCE
#include "app/contact/contact_sheet.h"

#include "app/contact/contact_card.h"
#include "app/contact/contact_page.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/mem.h"
#include <dirent.h>
#include <errno.h>
#include <stdbool.h>
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

typedef struct Journal {
    FILE *file;
    char *folder; /* of the batch, below the page's: "" or "NAME/" */
} Journal;

typedef struct Journals {
    Journal *items;
    int n;
    Line *lines;
    size_t n_lines;
    int n_unreadable; /* lines that are no series */
} Journals;

static bool is_journal(const char *name)
{
    int shard, n_shards, n = 0;
    return !strcmp(name, "batch.jsonl") ||
           (sscanf(name, "batch-%9d-of-%9d.jsonl%n", &shard, &n_shards, &n) == 2 && n > 0 && !name[n]);
}

static void close_journals(Journals *j)
{
    for (int i = 0; i < j->n; i++) {
        fclose(j->items[i].file);
        free(j->items[i].folder);
    }
    for (size_t i = 0; i < j->n_lines; i++)
        free(j->lines[i].series_uid);
    free(j->items);
    free(j->lines);
}

static CtsStatus add_journal(Journals *j, const char *dir, const char *folder, const char *name, CtsError *err)
{
    Journal new = {0};
    char *path = NULL;
    CtsStatus st = cts_grow(&j->items, j->n, err);
    if (!st && (asprintf(&path, "%s/%s%s", dir, folder, name) < 0 || !(new.folder = strdup(folder))))
        st = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", dir);
    else if (!st && !(new.file = fopen(path, "re")))
        st = cts_fail(err, CTS_ERR_READ, "%s: cannot be opened: %s", path, strerror(errno));
    if (st)
        free(new.folder);
    else
        j->items[j->n++] = new;
    free(path);
    return st;
}

static int is_visible(const struct dirent *entry)
{
    return entry->d_name[0] != '.';
}

/* The journals of the batch in dir/folder, and where deep is set of those one folder below. */
static CtsStatus open_journals(Journals *j, const char *dir, const char *folder, bool deep, CtsError *err)
{
    struct dirent **entries = NULL;
    char *path = NULL;
    CtsStatus st = CTS_OK;
    if (asprintf(&path, "%s/%s", dir, folder) < 0)
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", dir);
    const int n = scandir(path, &entries, is_visible, versionsort);
    if (n < 0 && (deep || errno != ENOTDIR))
        st = cts_fail(err, CTS_ERR_READ, "%s: cannot be listed: %s", path, strerror(errno));
    for (int i = 0; i < n; i++) {
        char *below = NULL;
        if (!st && is_journal(entries[i]->d_name))
            st = add_journal(j, dir, folder, entries[i]->d_name, err);
        else if (!st && deep && asprintf(&below, "%s/", entries[i]->d_name) < 0)
            st = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", dir);
        else if (!st && deep)
            st = open_journals(j, dir, below, false, err);
        free(below);
        free(entries[i]);
    }
    free(entries);
    free(path);
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
    const CtsStatus st = cts_grow(&j->lines, j->n_lines, err);
    if (st)
        return st;
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
    FILE *file = j->items[journal].file;
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

static CtsStatus write_card(CtsTempFile *temp, const Journals *j, const Line *line, bool first,
                            const CtsContactWanted *wanted, CtsError *err)
{
    FILE *file = j->items[line->journal].file;
    char *text = NULL;
    size_t allocated = 0;
    ssize_t n = -1;
    CtsStatus st;
    if (!fseeko(file, line->at, SEEK_SET))
        n = getline(&text, &allocated, file);
    json_t *json = n > 0 ? parse_line(text, (size_t)n) : NULL;
    if (json && wanted->change)
        wanted->change(wanted->context, json);
    json_t *card = json ? cts_contact_card(json, j->items[line->journal].folder) : NULL;
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

static CtsStatus write_cards(CtsTempFile *temp, Journals *j, const CtsContactWanted *wanted, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (j->n_lines)
        qsort(j->lines, j->n_lines, sizeof *j->lines, by_series);
    for (size_t i = 0, n; i < j->n_lines && !st; i += n) {
        for (n = 1; i + n < j->n_lines && !strcmp(j->lines[i + n].series_uid, j->lines[i].series_uid);)
            n++;
        st = write_card(temp, j, last_word(j->lines + i, n), i == 0, wanted, err);
    }
    return st;
}

/* What stands in front of the series, whose array it opens. */
static int print_head(char *text, size_t size, const Journals *j, const CtsContactRun *run)
{
    char so_far[160] = "";
    if (run)
        snprintf(so_far, sizeof so_far, "\"run\":{\"at\":\"%s\",\"ended\":%zu,\"series\":%zu,\"goes_on\":%s},",
                 cts_utc_now().text, run->n_ended, run->n_series, run->goes_on ? "true" : "false");
    return snprintf(text, size, "{\"version\":\"%s\",\"unreadable\":%d,%s\"series\":[", CTS_VERSION, j->n_unreadable,
                    so_far);
}

static CtsStatus write_page(CtsTempFile *temp, Journals *j, const CtsContactWanted *wanted, CtsError *err)
{
    char start[300];
    CtsStatus st;
    const int n = print_head(start, sizeof start, j, wanted->run);
    if ((st = cts_temp_write(temp, cts_contact_head, cts_contact_head_bytes, err)) ||
        (st = cts_temp_write(temp, start, (size_t)n, err)) || (st = write_cards(temp, j, wanted, err)) ||
        (st = cts_temp_write(temp, "]}\n", 3, err)))
        return st;
    return cts_temp_write(temp, cts_contact_tail, cts_contact_tail_bytes, err);
}

CtsStatus cts_contact_sheet_write(const char *dir, const CtsContactWanted *wanted, CtsError *err)
{
    Journals journals = {0};
    CtsTempFile *temp = NULL;
    char *path = NULL;
    CtsStatus st = open_journals(&journals, dir, "", true, err);
    if (!st && !journals.n)
        st = cts_fail(err, CTS_ERR_READ, "%s: holds no journal (give the folder that `ctsplat batch -O` wrote)", dir);
    for (int i = 0; i < journals.n && !st; i++)
        st = index_journal(&journals, i, err);
    if (!st && asprintf(&path, "%s/index.html", dir) < 0)
        st = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", dir);
    if (!st && !(st = cts_temp_open(&temp, path, err)) && !(st = write_page(temp, &journals, wanted, err)))
        st = cts_temp_commit(&temp, true, NULL, err);
    cts_temp_discard(&temp);
    free(path);
    close_journals(&journals);
    return st;
}
