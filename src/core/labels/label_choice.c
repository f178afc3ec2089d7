#include "core/labels/label_set.h"

#include "base/near_word.h"
#include <ctype.h>
#include <stdio.h>
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

/* * stands for any letters. */
static bool is_called(const char *name, const char *pattern, size_t length)
{
    if (!length)
        return !*name;
    if (*pattern == '*')
        return is_called(name, pattern + 1, length - 1) || (*name && is_called(name + 1, pattern, length));
    return tolower((unsigned char)*name) == tolower((unsigned char)*pattern) && *name &&
           is_called(name + 1, pattern + 1, length - 1);
}

static bool is_word(const Item *item, const char *word)
{
    return !item->file && item->length == strlen(word) && !strncmp(item->text, word, item->length);
}

static bool is_meant(const Item *item, const CtsLabelFact *f)
{
    if (item->file && f->file != item->file)
        return false;
    return is_word(item, "all") || f->number == item->number || is_called(f->name, item->text, item->length);
}

static CtsStatus fail_unknown(const CtsLabels *labels, const char *option, const char *item, size_t length,
                              CtsError *err)
{
    CtsNear near = {.written = item, .length = length};
    for (size_t i = 0; i < labels->n; i++)
        cts_near_try(&near, labels->items[i].fact.name);
    return cts_fail(err, CTS_ERR_USAGE, "`%s` %.*s: no label is called so, nor has that number%s", option,
                    (int)(length < 64 ? length : 64), item,
                    near.word ? cts_near_hint(&near).text : " (ctsplat info with `labels` lists them)");
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
        if (!is_meant(&item, f))
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
    return any || is_word(&item, "all") ? CTS_OK : fail_unknown(labels, option, text, length, err);
}

CtsStatus cts_label_find_list(const CtsLabels *labels, const char *option, const char *list, uint32_t *hit,
                              CtsError *err)
{
    CtsStatus st = CTS_OK;
    uint32_t value = 1;
    for (const char *item = list; !st; value++) {
        const size_t length = strcspn(item, ",");
        st = length ? cts_label_find(labels, option, item, length, value, hit, err)
                    : cts_fail(err, CTS_ERR_USAGE, "`%s` %s: an empty name", option, list);
        if (!item[length])
            break;
        item += length + 1;
    }
    return st;
}
