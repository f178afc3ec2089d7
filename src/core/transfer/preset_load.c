/* Finds a preset by name or file and reads it in any format. */
#include "core/transfer/preset_read.h"

#include "base/did_you_mean.h"
#include "base/file.h"
#include "base/text.h"
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

static bool user_folder(char *path, size_t size)
{
    return cts_user_path(path, size, "XDG_CONFIG_HOME", ".config", "presets", false);
}

static const CtsPreset *find_builtin(const char *name)
{
    const CtsPreset *preset;
    for (size_t i = 0; (preset = cts_preset_builtin(i)); i++)
        if (!strcmp(preset->name, name))
            return preset;
    return NULL;
}

static int is_json(const struct dirent *entry)
{
    const size_t n = strlen(entry->d_name);
    return n > 5 && entry->d_name[0] != '.' && !strcmp(entry->d_name + n - 5, ".json");
}

static int by_name(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*a)->d_name, (*b)->d_name);
}

char **cts_preset_user_names(void)
{
    char folder[4096];
    struct dirent **entries = NULL;
    int n = user_folder(folder, sizeof folder) ? scandir(folder, &entries, is_json, by_name) : 0;
    if (n < 0)
        n = 0;
    size_t bytes = ((size_t)n + 1) * sizeof(char *);
    for (int i = 0; i < n; i++)
        bytes += strlen(entries[i]->d_name) + 1;
    char **names = calloc(1, bytes);
    char *text = names ? (char *)(names + n + 1) : NULL;
    for (int i = 0; i < n; i++) {
        if (names) {
            const size_t length = strlen(entries[i]->d_name) - 5;
            names[i] = memcpy(text, entries[i]->d_name, length);
            text += length + 1;
        }
        free(entries[i]);
    }
    free(entries);
    return names;
}

static CtsStatus fail_unknown_preset(const char *name, CtsError *err)
{
    char list[800] = "";
    CtsDidYouMean nearest_word = {.written = name, .length = strlen(name)};
    char **names = cts_preset_user_names();
    for (size_t i = 0; cts_preset_builtin(i); i++) {
        cts_text_append(list, sizeof list, " ", "%s", cts_preset_builtin(i)->name);
        cts_did_you_mean_try(&nearest_word, cts_preset_builtin(i)->name);
    }
    for (size_t i = 0; names && names[i]; i++) {
        cts_text_append(list, sizeof list, " ", "%s", names[i]);
        cts_did_you_mean_try(&nearest_word, names[i]);
    }
    cts_fail(err, CTS_ERR_PRESET, "preset %.60s: no such preset%s; there are: %s", name,
             cts_did_you_mean_hint(&nearest_word).text, list);
    free(names);
    return CTS_ERR_PRESET;
}

/* The name from a file's name, without folder and ending. */
static void name_after_file(CtsPreset *preset, const char *path)
{
    char stem[sizeof preset->name];
    const char *slash = strrchr(path, '/');
    snprintf(stem, sizeof stem, "%s", slash ? slash + 1 : path);
    char *dot = strrchr(stem, '.');
    if (dot && dot != stem)
        *dot = 0;
    if (!cts_preset_set_name(preset, stem))
        cts_preset_set_name(preset, "preset");
}

/* Slicer's files say only by their names what their numbers are. */
static void scale_of_slicer(CtsPreset *preset)
{
    if (strncasecmp(preset->name, "MR-", 3) != 0)
        return;
    preset->scale = CTS_SCALE_STORED;
    preset->modality = CTS_MODALITY_MR;
}

static CtsStatus parse_json(const char *text, size_t size, const char *name, const char *which, bool *is_slicer,
                            CtsPreset *preset, CtsError *err)
{
    CtsJson json = {.name = name, .text = text, .size = size, .status = CTS_ERR_PRESET};
    CtsStatus st = cts_json_open(&json, err);
    if (st)
        goto end;
    *is_slicer = json_object_get(json.root, "volumeProperties");
    if (*is_slicer)
        st = cts_preset_from_slicer_json(&json, which, preset, err);
    else
        st = cts_preset_from_json(&json, which, preset, err);
end:
    cts_json_close(&json);
    return st;
}

CtsStatus cts_preset_parse(const char *text, size_t size, const char *name, const char *which, CtsPreset *preset,
                           CtsError *err)
{
    CtsStatus st;
    bool is_slicer = true;
    *preset = (CtsPreset){0};
    if (size > CTS_PRESET_MAX_BYTES)
        return cts_fail(err, CTS_ERR_PRESET, "%s: a preset of more than 1 MiB", name);
    if (size >= 3 && !memcmp(text, "\xef\xbb\xbf", 3)) {
        text += 3;
        size -= 3;
    }
    size_t first = 0;
    while (first < size && memchr(" \t\r\n", text[first], 4))
        first++;
    if (first == size)
        return cts_fail(err, CTS_ERR_PRESET, "%s: line 1: the preset is empty", name);
    if (text[first] == '<') {
        st = cts_preset_from_xml(text, size, name, which, preset, err);
    } else if (text[first] >= '0' && text[first] <= '9' && !which) {
        st = cts_preset_from_vp(text, size, name, preset, err);
    } else {
        st = parse_json(text, size, name, which, &is_slicer, preset, err);
    }
    if (!st && !preset->name[0])
        name_after_file(preset, name);
    if (!st && is_slicer)
        scale_of_slicer(preset);
    return st;
}

static CtsStatus load_file(const char *path, const char *which, CtsPreset *preset, CtsError *err)
{
    char *text;
    size_t n;
    CtsStatus st = cts_file_text(path, CTS_PRESET_MAX_BYTES, CTS_ERR_PRESET, &text, &n, err);
    if (!st)
        st = cts_preset_parse(text, n, path, which, preset, err);
    free(text);
    return st;
}

static bool exists(const char *path)
{
    struct stat status;
    return !stat(path, &status);
}

CtsStatus cts_preset_load(const char *name, CtsPreset *preset, CtsError *err)
{
    const bool has_folder = strchr(name, '/'), is_file = has_folder || strchr(name, '.');
    const CtsPreset *builtin = find_builtin(name);
    char path[4096];
    if (*name == '{')
        return cts_preset_parse(name, strlen(name), "preset", NULL, preset, err);
    if (builtin) {
        *preset = *builtin;
        return CTS_OK;
    }
    if (!has_folder && *name && user_folder(path, sizeof path)) {
        const size_t n = strlen(path);
        if (snprintf(path + n, sizeof path - n, "/%s.json", name) < (int)(sizeof path - n) && exists(path))
            return load_file(path, NULL, preset, err);
    }
    if (exists(name))
        return load_file(name, NULL, preset, err);
    const char *hash = strrchr(name, '#');
    if (hash && hash > name && snprintf(path, sizeof path, "%.*s", (int)(hash - name), name) < (int)sizeof path &&
        exists(path))
        return load_file(path, hash + 1, preset, err);
    return is_file ? load_file(name, NULL, preset, err) : fail_unknown_preset(name, err);
}
