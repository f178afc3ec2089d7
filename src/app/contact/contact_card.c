#include "app/contact/contact_card.h"

#include "app/contact/journal_lines.h"
#include "base/json.h"
#include <string.h>

static const char *const kept[] = {"series_uid", "status",         "reason",     "reason_file", "exit_code", "ended",
                                   "files",      "sources",        "unfinished", "geometry",    "findings",  "stages",
                                   "wall_ms",    "peak_rss_bytes", "threads",    "labels"};

/* The picture of this preset and view, a new one where there is none; the array's. Neighbours are mostly the same. */
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
    if (json_object_get(thumbnail, "labels")) {
        json_object_set_new(card, "label_slices", json_pack("s+", folder, path));
        return;
    }
    json_t *picture = picture_of(pictures, thumbnail);
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

json_t *cts_contact_card(const json_t *line, const char *folder)
{
    json_t *card = json_object(), *pictures = json_array(), *file;
    size_t i;
    for (i = 0; i < sizeof kept / sizeof *kept; i++) {
        json_t *value = json_object_get(line, kept[i]);
        if (value)
            json_object_set(card, kept[i], value);
    }
    json_array_foreach(json_object_get(line, "outputs"), i, file) add_output(pictures, file, folder);
    json_array_foreach(json_object_get(line, "thumbnails"), i, file) add_thumbnail(card, pictures, file, folder);
    if (json_object_set_new(card, "pictures", pictures)) {
        json_decref(card);
        return NULL;
    }
    return card;
}
