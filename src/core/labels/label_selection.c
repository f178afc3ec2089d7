#include "core/labels/label_set.h"

#include "base/did_you_mean.h"
#include "base/json.h"
#include "base/mem.h"
#include "base/text.h"
#include <ctype.h>
#include <stdlib.h>
#include <string.h>

/* A name, as one item of a list writes it. */
typedef struct Item {
    const char *text;
    size_t length;
    int file;   /* 0: any */
    int number; /* -1: no number */
} Item;

static size_t digits(const char *text, size_t length)
{
    size_t n = 0;
    while (n < length && isdigit((unsigned char)text[n]))
        n++;
    return n;
}

static Item item_of(const char *text, size_t length)
{
    Item item = {.text = text, .length = length, .number = -1};
    const size_t n = digits(text, length);
    if (n > 0 && n < 9 && n + 1 < length && text[n] == ':') {
        item.file = atoi(text);
        item.text += n + 1;
        item.length -= n + 1;
    }
    if (item.length > 0 && item.length < 10 && digits(item.text, item.length) == item.length)
        item.number = atoi(item.text);
    return item;
}

static bool is_called(const char *name, const char *pattern, size_t length)
{
    return cts_text_matches(&(CtsPattern){.text = pattern, .n = length, .ignores_case = true}, name, strlen(name));
}

static bool is_word(const Item *item, const char *word)
{
    return !item->file && item->length == strlen(word) && !strncmp(item->text, word, item->length);
}

static bool holds(const CtsLabelRegion *region, int number)
{
    for (size_t i = 0; i < region->n; i++)
        if (region->numbers[i] == number)
            return true;
    return false;
}

static bool is_meant(const CtsLabels *labels, const Item *item, const CtsLabelFact *f)
{
    if (item->file && f->file != item->file)
        return false;
    if (is_word(item, "all") || f->number == item->number || is_called(f->name, item->text, item->length))
        return true;
    for (size_t r = 0; r < labels->n_regions; r++)
        if (labels->regions[r].file == f->file && is_called(labels->regions[r].name, item->text, item->length) &&
            holds(&labels->regions[r], f->number))
            return true;
    return false;
}

/* 1 + the index of a label that was left out; 0: the item names none. */
static uint32_t left_out(const CtsLabels *labels, const Item *item)
{
    for (size_t i = 0; i < labels->n_left_out && !is_word(item, "all"); i++)
        if (is_meant(labels, item, &labels->left_out[i].fact))
            return (uint32_t)i + 1;
    return 0;
}

/* True if an item names a label, one that was left out, a region, all or rest. */
static bool is_item_known(const CtsLabels *labels, const char *text, size_t length)
{
    const Item item = item_of(text, length);
    bool fits = is_word(&item, "all") || is_word(&item, "rest");
    for (size_t i = 0; !fits && i < labels->n; i++)
        fits = is_meant(labels, &item, &labels->items[i].fact);
    return fits || left_out(labels, &item);
}

size_t cts_label_name_length(const CtsLabels *labels, const char *text, char separator)
{
    enum { LONGEST = 512 + 10 }; /* a name as the readers take it, and the number of its file in front */
    size_t fitting = 0, n_letters = 0;
    bool last = false;
    for (size_t n = 0; !last && n_letters <= LONGEST; n_letters += text[n] != '*', n++) {
        last = !text[n];
        if ((text[n] == separator || (last && separator == ',')) && is_item_known(labels, text, n))
            fitting = n;
    }
    return fitting;
}

/* Fails with a suggestion for the item, or for a longer part of the list that begins with it. */
static CtsStatus fail_unknown_label(const CtsLabels *labels, const char *option, const char *item, size_t length,
                                    CtsError *err)
{
    CtsDidYouMean nearest_word = {.written = item, .length = length}, all = {.written = item, .length = strlen(item)};
    for (size_t i = 0; i < labels->n + labels->n_regions; i++) {
        const char *const name = i < labels->n ? labels->items[i].fact.name : labels->regions[i - labels->n].name;
        cts_did_you_mean_try(&nearest_word, name);
        cts_did_you_mean_try(&all, name);
    }
    if (all.word && (!nearest_word.word || all.distance <= nearest_word.distance)) {
        nearest_word = all;
        length = all.length;
    }
    return cts_fail(err, CTS_ERR_USAGE, "`%s` %.*s: no label has this name or number%s", option,
                    (int)(length < 64 ? length : 64), item,
                    nearest_word.word ? cts_did_you_mean_hint(&nearest_word).text
                                      : " (ctsplat info with `labels` lists them)");
}

CtsStatus cts_label_find(const CtsLabels *labels, const char *option, const char *text, size_t length, uint32_t value,
                         uint32_t *hit, CtsError *err)
{
    const Item item = item_of(text, length);
    const bool several = is_word(&item, "all") || memchr(item.text, '*', item.length);
    int file = 0;
    bool any = is_word(&item, "rest");
    if (any && !hit[labels->n])
        hit[labels->n] = value;
    for (size_t i = 0; i < labels->n; i++) {
        const CtsLabelFact *const f = &labels->items[i].fact;
        if (!is_meant(labels, &item, f))
            continue;
        if (file && f->file != file && !several && !item.file)
            return cts_fail(err, CTS_ERR_USAGE, "`%s` %.*s: label files %d and %d both have it (%d:%.*s or %d:%.*s)",
                            option, (int)length, text, file, f->file, file, (int)length, text, f->file, (int)length,
                            text);
        file = f->file;
        any = true;
        if (!hit[i])
            hit[i] = value;
    }
    const uint32_t without = any ? 0 : left_out(labels, &item);
    hit[labels->n + 1] = without ? without : hit[labels->n + 1];
    return any || without || is_word(&item, "all") ? CTS_OK : fail_unknown_label(labels, option, text, length, err);
}

/* One item of a list; with `lacking` an unknown name is written there instead of refused. */
static CtsStatus take_item(const CtsLabels *labels, const char *option, const char *item, size_t length, uint32_t value,
                           uint32_t *hit, char *lacking, CtsError *err)
{
    if (!lacking || is_item_known(labels, item, length))
        return cts_label_find(labels, option, item, length, value, hit, err);
    cts_text_append(lacking, CTS_LACKING_TEXT, ", ", "%.*s", (int)length, item);
    return CTS_OK;
}

static CtsStatus find_json_names(const CtsLabels *labels, const char *option, const json_t *names, uint32_t *hit,
                                 char *lacking, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (size_t i = 0; !st && i < json_array_size(names); i++) {
        const char *const name = json_string_value(json_array_get(names, i));
        st = name && *name ? take_item(labels, option, name, strlen(name), (uint32_t)i + 1, hit, lacking, err)
                           : cts_fail(err, CTS_ERR_USAGE, "`%s`: name %zu of the array is empty", option, i + 1);
    }
    return st;
}

CtsStatus cts_label_find_list(const CtsLabels *labels, const char *option, const char *list, uint32_t *hit,
                              char *lacking, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (lacking)
        *lacking = 0;
    json_t *const names = *list == '[' ? json_loads(list, 0, NULL) : NULL;
    if (json_is_array(names))
        st = find_json_names(labels, option, names, hit, lacking, err);
    else
        for (uint32_t value = 1; !st; value++) {
            const size_t fitting = cts_label_name_length(labels, list, ','), n = fitting ? fitting : strcspn(list, ",");
            st = n ? take_item(labels, option, list, n, value, hit, lacking, err)
                   : cts_fail(err, CTS_ERR_USAGE, "`%s` %s: an empty name", option, list);
            if (!list[n])
                break;
            list += n + 1;
        }
    json_decref(names);
    return st;
}

CtsStatus cts_label_check_shown(const CtsLabels *labels, const uint32_t *hit, CtsError *err)
{
    bool any = false;
    for (size_t i = 0; i <= labels->n; i++)
        any |= hit[i];
    if (any || !hit[labels->n + 1])
        return CTS_OK;
    const CtsLabelLeftOut *const one = &labels->left_out[hit[labels->n + 1] - 1];
    return cts_fail(err, CTS_ERR_GEOMETRY, "`show`: %s cannot be drawn: %s", one->fact.name, one->reason);
}

CtsStatus cts_labels_lacking(const CtsLabels *labels, const char *show, char lacking[CTS_LACKING_TEXT], bool *any,
                             CtsError *err)
{
    uint32_t *hit = NULL;
    *any = false;
    CtsStatus st = cts_alloc_zeroed(&hit, labels->n + 2, err);
    if (!st && !(st = cts_label_find_list(labels, "show", show, hit, lacking, err)))
        st = cts_label_check_shown(labels, hit, err);
    for (size_t i = 0; !st && i <= labels->n; i++)
        *any |= hit[i];
    cts_free(&hit);
    return st;
}
