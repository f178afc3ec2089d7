#include "app/options/options.h"

#include "base/file.h"
#include "base/json.h"
#include "ctsplat/preset.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* MAX_NAMES: the largest number of a label, of 16 bits. MAX_BYTES: 256 for each. */
enum { MAX_NAMES = 65535, MAX_BYTES = 16 << 20 };

void cts_appearance_file_free(CtsAppearanceFile *look)
{
    for (int i = 0; i < look->n; i++)
        free(look->texts[i]);
    free(look->texts);
    free(look->options);
    *look = (CtsAppearanceFile){.n = 0};
}

/* Adds an option; the arrays have room. Takes ownership of text. */
static CtsStatus add_option(CtsAppearanceFile *look, const CtsJson *json, const char *option, char *text, CtsError *err)
{
    if (!text)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    look->texts[look->n] = text;
    look->options[look->n++] = (CtsJobOption){.name = option, .value = text, .from = json->name};
    return CTS_OK;
}

static CtsStatus take_list(const CtsJsonAt *root, const char *key, const char *option, CtsAppearanceFile *look,
                           CtsError *err)
{
    CtsJsonAt list;
    if (!cts_json_member(root, key, &list))
        return CTS_OK;
    CtsStatus st = cts_json_check_array(&list, 1, MAX_NAMES, err);
    for (size_t i = 0; !st && i < json_array_size(list.value); i++) {
        const CtsJsonAt at = cts_json_element(&list, i);
        const char *name;
        if (!(st = cts_json_string(&at, &name, err)) && !*name)
            st = cts_json_fail(&at, err, "\"\" is not a name");
    }
    return st ? st : add_option(look, root->json, option, json_dumps(list.value, JSON_COMPACT), err);
}

/* Checks a preset in the file itself, while its position is known. */
static CtsStatus check_preset(const CtsJsonAt *at, const char *text, CtsError *err)
{
    CtsError why;
    CtsPreset preset;
    return cts_preset_load(text, &preset, &why) ? cts_json_fail(at, err, "%s", why.text) : CTS_OK;
}

static CtsStatus take_label(const CtsJsonAt *at, CtsAppearanceFile *look, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const char *name = NULL;
    char *text = NULL, *own = NULL;
    if (!*at->key)
        return cts_json_fail(at, err, "\"\" names no label");
    if (!json_is_object(at->value))
        st = cts_json_string(at, &name, err);
    else if ((own = json_dumps(at->value, JSON_COMPACT)))
        st = check_preset(at, own, err);
    if (!st && asprintf(&text, "%s=%s", at->key, own ? own : name ? name : "") < 0)
        text = NULL;
    free(own);
    return st ? st : add_option(look, at->json, "label", text, err);
}

static CtsStatus take_label_looks(const CtsJsonAt *root, CtsAppearanceFile *look, CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsJsonAt labels;
    const char *key;
    json_t *value;
    if (cts_json_member(root, "label", &labels) && !json_is_object(labels.value))
        return cts_json_fail(&labels, err, "label is not an object { } of names and appearances");
    json_object_foreach(labels.value, key, value)
    {
        CtsJsonAt at;
        if (!st && cts_json_member(&labels, key, &at))
            st = take_label(&at, look, err);
    }
    return st;
}

static CtsStatus take_all(const CtsJsonAt *root, CtsAppearanceFile *look, CtsError *err)
{
    static const char *const keys[] = {"show", "hide", "label", "label_colours", "label_order"};
    bool coloured = false;
    CtsStatus st;
    CtsJsonAt at;
    const size_t room = json_object_size(json_object_get(root->value, "label")) + 4;
    if ((st = cts_json_check_keys(root, keys, sizeof keys / sizeof *keys, err)))
        return st;
    look->options = calloc(room, sizeof *look->options);
    look->texts = calloc(room, sizeof *look->texts);
    if (!look->options || !look->texts)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if ((st = take_list(root, "show", "show", look, err)) || (st = take_list(root, "hide", "hide", look, err)) ||
        (st = take_list(root, "label_order", "label-order", look, err)) || (st = take_label_looks(root, look, err)))
        return st;
    if (cts_json_member(root, "label_colours", &at) && (st = cts_json_bool(&at, &coloured, err)))
        return st;
    return coloured ? add_option(look, root->json, "label-colours", strdup(""), err) : CTS_OK;
}

static CtsStatus parse_appearances(const char *name, const char *text, size_t size, CtsAppearanceFile *look,
                                   CtsError *err)
{
    CtsJson json = {.name = name, .text = text, .size = size, .status = CTS_ERR_USAGE};
    CtsStatus st = cts_json_open(&json, err);
    if (!st) {
        const CtsJsonAt root = cts_json_root(&json);
        st = take_all(&root, look, err);
    }
    cts_json_close(&json);
    return st;
}

CtsStatus cts_appearance_file_read(const char *file_or_json, CtsAppearanceFile *look, CtsError *err)
{
    if (*file_or_json == '{')
        return parse_appearances("`look`", file_or_json, strlen(file_or_json), look, err);
    char *text;
    size_t n;
    CtsStatus st = cts_file_text(file_or_json, MAX_BYTES, CTS_ERR_USAGE, &text, &n, err);
    if (st)
        cts_context(err, "`look`");
    else
        st = parse_appearances(file_or_json, text, n, look, err);
    free(text);
    return st;
}
