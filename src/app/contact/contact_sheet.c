#include "app/contact/contact_sheet.h"

#include "app/contact/journal_lines.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/json.h"
#include "output/report/info.h"
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Escapes < in JSON, so that an HTML parser finds no markup in it. */
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

static const char *const kept[] = {"series_uid", "status",  "reason",  "reason_file",   "exit_code",
                                   "ended",      "files",   "sources", "unfinished",    "geometry",
                                   "findings",   "wall_ms", "labels",  "peak_rss_bytes"};

/* The entry of this preset and view in the array, added where missing. Searches backwards, since neighbours mostly
 * match. */
static json_t *picture_of(json_t *pictures, const json_t *file)
{
    const char *preset = cts_json_text_of(file, "preset"), *view = cts_json_text_of(file, "view");
    for (size_t i = json_array_size(pictures); i-- > 0;) {
        json_t *picture = json_array_get(pictures, i);
        if (!strcmp(cts_json_text_of(picture, "preset"), preset) && !strcmp(cts_json_text_of(picture, "view"), view))
            return picture;
    }
    json_t *picture = json_pack("{s:s, s:s, s:{}}", "preset", preset, "view", view, "files");
    json_array_append_new(pictures, picture);
    return picture;
}

/* Frames of a rotation are one entry: the first one's path, and how many there are. */
static void add_output(json_t *pictures, const json_t *output, const char *folder)
{
    const char *path = cts_json_text_of(output, "path");
    if (!cts_journal_path_is_safe(path))
        return;
    json_t *files = json_object_get(picture_of(pictures, output), "files");
    json_t *entry = json_object_get(files, cts_json_text_of(output, "format"));
    if (entry)
        json_object_set_new(entry, "frames", json_integer(json_integer_value(json_object_get(entry, "frames")) + 1));
    else
        json_object_set_new(files, cts_json_text_of(output, "format"),
                            json_pack("{s:s+, s:i}", "first", folder, path, "frames", 1));
}

static void add_thumbnail(json_t *card, json_t *pictures, const json_t *thumbnail, const char *folder)
{
    const char *path = cts_json_text_of(thumbnail, "path");
    if (!cts_journal_path_is_safe(path))
        return;
    static const char *const kinds[] = {"sections", "image"};
    for (int k = 0; k < 2; k++)
        if (json_object_get(thumbnail, kinds[k])) {
            json_object_set_new(card, kinds[k], json_pack("s+", folder, path));
            return;
        }
    json_t *picture = picture_of(pictures, thumbnail);
    if (json_is_real(json_object_get(thumbnail, "error_255")))
        json_object_set(picture, "error_255", json_object_get(thumbnail, "error_255"));
    if (json_integer_value(json_object_get(thumbnail, "frames")) <= 1) {
        json_object_set_new(picture, "thumb", json_pack("s+", folder, path));
        return;
    }
    json_t *turn = json_pack("{s:s+}", "path", folder, path);
    static const char *const numbers[] = {"frames", "width", "height"};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        json_object_set(turn, numbers[i], json_object_get(thumbnail, numbers[i]));
    json_object_set_new(picture, "turn", turn);
}

/* Notes of pictures that another version made: a run renders what it is asked for, and keeps other pictures as they
 * are. */
static void note_other_versions(json_t *notes, const json_t *outputs)
{
    const char *noted = "";
    size_t i;
    json_t *output;
    json_array_foreach(outputs, i, output)
    {
        const char *const version = cts_json_text_of(output, "version"), *const preset =
                                                                             cts_json_text_of(output, "preset");
        CtsDiagnostics one = {0};
        if (!strcmp(version, CTS_VERSION) || !strcmp(noted, preset))
            continue;
        noted = preset;
        cts_diagnostics_add(&one, CTS_DIAGNOSTIC_OTHER_VERSION,
                            "rendered by ctsplat %.20s, not by " CTS_VERSION ": it may look different (a run of this "
                            "preset renders it again)",
                            *version ? version : "before 0.4.0");
        json_t *const note = one.n ? cts_diagnostic_json(one.items) : NULL;
        json_object_set_new(note, "preset", json_string(preset));
        json_array_append_new(notes, note);
        cts_diagnostics_free(&one);
    }
}

/* The page's data for one series, from its journal record: the record without hashes and sizes, and with outputs and
 * thumbnails gathered to pictures, one for each preset and view:
 * {"preset", "view", "files":{"png":{"first":PATH, "frames":N}, ...}, "thumb":PATH, "turn":{"path", "frames", "width",
 * "height"}}
 * Paths are below folder ("", or with a slash at its end); paths that leave it are omitted. A new reference; NULL when
 * memory runs out. */
static json_t *card_of(const json_t *line, const char *folder)
{
    json_t *card = json_object(), *pictures = json_array(), *file;
    size_t i;
    for (i = 0; i < sizeof kept / sizeof *kept; i++) {
        json_t *value = json_object_get(line, kept[i]);
        if (value)
            json_object_set(card, kept[i], value);
    }
    json_t *const findings =
        json_object_get(card, "findings") ? json_copy(json_object_get(card, "findings")) : json_array();
    note_other_versions(findings, json_object_get(line, "outputs"));
    json_object_set_new(card, "findings", findings);
    json_array_foreach(json_object_get(line, "outputs"), i, file) add_output(pictures, file, folder);
    json_array_foreach(json_object_get(line, "thumbnails"), i, file) add_thumbnail(card, pictures, file, folder);
    if (json_object_set_new(card, "pictures", pictures)) {
        json_decref(card);
        return NULL;
    }
    return card;
}

static CtsStatus write_card(CtsTempFile *temp, const CtsJournalLines *j, const CtsJournalLine *line, bool first,
                            const CtsContactWanted *wanted, CtsError *err)
{
    CtsStatus st;
    json_t *json = cts_journal_lines_load(j, line);
    if (json && wanted->change)
        wanted->change(wanted->context, json);
    json_t *card = json ? card_of(json, j->files[line->file].folder) : NULL;
    if (!json)
        st = cts_fail(err, CTS_ERR_READ, "a journal changed while it was read (try again)");
    else if (!card)
        st = cts_fail(err, CTS_ERR_MEMORY, "the contact sheet: out of memory");
    else if (!(st = cts_temp_write(temp, first ? "\n" : ",\n", first ? 1 : 2, err)))
        st = write_json(temp, card, err);
    json_decref(card);
    json_decref(json);
    return st;
}

/* Prints the JSON before the series and opens their array. */
static int print_head(char *text, size_t size, const CtsJournalLines *j, const CtsContactWanted *wanted)
{
    char so_far[160] = "";
    if (wanted->n_series)
        snprintf(so_far, sizeof so_far, "\"run\":{\"at\":\"%s\",\"ended\":%zu,\"series\":%zu,\"goes_on\":%s},",
                 cts_utc_now().text, wanted->n_ended, wanted->n_series, wanted->goes_on ? "true" : "false");
    return snprintf(text, size, "{\"version\":\"%s\",\"unreadable\":%d,\"objects\":%" PRIu64 ",%s\"series\":[",
                    CTS_VERSION, j->n_unreadable, wanted->n_objects, so_far);
}

static CtsStatus write_page(CtsTempFile *temp, const CtsJournalLines *j, const CtsContactWanted *wanted, CtsError *err)
{
    char start[300];
    CtsStatus st;
    const int n = print_head(start, sizeof start, j, wanted);
    if ((st = cts_temp_write(temp, cts_contact_head, cts_contact_head_bytes, err)) ||
        (st = cts_temp_write(temp, start, (size_t)n, err)))
        return st;
    for (size_t i = 0; i < j->n && !st; i++)
        st = write_card(temp, j, &j->items[i], i == 0, wanted, err);
    if (!st && !(st = cts_temp_write(temp, "]}\n", 3, err)))
        st = cts_temp_write(temp, cts_contact_tail, cts_contact_tail_bytes, err);
    return st;
}

CtsStatus cts_contact_sheet_write(const char *dir, const CtsContactWanted *wanted, CtsError *err)
{
    CtsJournalLines journals = {0};
    CtsTempFile *temp = NULL;
    char *path = NULL;
    CtsStatus st = cts_journal_lines_read_folder(&journals, dir, "", true, NULL, err);
    if (!st && !journals.n_files)
        st = cts_fail(err, CTS_ERR_READ, "%s: holds no journal (give the folder that `ctsplat batch -O` wrote)", dir);
    cts_journal_lines_sort(&journals);
    if (!st && asprintf(&path, "%s/index.html", dir) < 0)
        st = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", dir);
    if (!st && !(st = cts_temp_open(&temp, path, err)) && !(st = write_page(temp, &journals, wanted, err)))
        st = cts_temp_commit(&temp, true, NULL, err);
    cts_temp_discard(&temp);
    free(path);
    cts_journal_lines_free(&journals);
    return st;
}
