#include "input/labels/label_reading.h"

#include "base/file.h"
#include "base/json.h"
#include "base/mem.h"
#include <expat.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* MAX_NAMES: the largest number of a label, of 16 bits. MAX_BYTES: 256 for each. */
enum { MAX_NAMES = 65535, MAX_BYTES = 16 << 20 };

static CtsStatus add_name(CtsLabelNames *names, int number, const char *name, size_t n, CtsError *err)
{
    if (names->n >= MAX_NAMES)
        return cts_fail(err, CTS_ERR_USAGE, "more than %d names", MAX_NAMES);
    char *const copy = cts_grow(&names->items, names->n, NULL) ? NULL : strndup(name, n);
    if (!copy)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    names->items[names->n++] = (CtsLabelName){.number = number, .name = copy};
    return CTS_OK;
}

/* Of the name that was added last; values of 0 to most. */
static void colour(CtsLabelNames *names, const double rgb[3], double most)
{
    CtsLabelName *const last = &names->items[names->n - 1];
    last->coloured = true;
    for (int c = 0; c < 3; c++) {
        last->coloured &= rgb[c] >= 0 && rgb[c] <= most;
        last->rgb[c] = rgb[c] / most;
    }
}

static bool is_number(const json_t *value)
{
    return json_is_integer(value) && json_integer_value(value) >= 0 && json_integer_value(value) <= MAX_NAMES;
}

/* nnU-Net's regions: {"whole tumor": [1, 2, 3]}. */
static CtsStatus add_region(const char *what, const char *name, const json_t *list, CtsLabelNames *names, CtsError *err)
{
    const size_t n = json_array_size(list);
    CtsStatus st = names->n_regions < MAX_NAMES ? cts_grow(&names->regions, names->n_regions, err)
                                                : cts_fail(err, CTS_ERR_USAGE, "more than %d names", MAX_NAMES);
    CtsLabelRegion region = {.n = n};
    if (!st)
        st = cts_alloc_array(&region.numbers, n ? n : 1, err);
    for (size_t i = 0; !st && i < n; i++) {
        const json_t *const number = json_array_get(list, i);
        if (!is_number(number))
            st = cts_fail(err, CTS_ERR_USAGE, "%s: \"%s\" is no list of numbers of labels", what, name);
        else
            region.numbers[i] = (int)json_integer_value(number);
    }
    if (!st && !(region.name = strdup(name)))
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (st)
        cts_free(&region.numbers);
    else
        names->regions[names->n_regions++] = region;
    return st;
}

void cts_label_names_free(CtsLabelNames *names)
{
    for (size_t i = 0; i < names->n; i++)
        free(names->items[i].name);
    free(names->items);
    cts_label_regions_free(names->regions, names->n_regions);
    *names = (CtsLabelNames){0};
}

const CtsLabelName *cts_label_names_find(const CtsLabelNames *names, int number)
{
    for (size_t i = 0; i < names->n; i++)
        if (names->items[i].number == number)
            return &names->items[i];
    return NULL;
}

static bool number_of(const char *text, int *number)
{
    char *end;
    const long value = strtol(text, &end, 10);
    *number = (int)value;
    return end != text && !*end && value >= 0 && value <= MAX_NAMES;
}

static CtsStatus parse_names(const char *what, const char *text, size_t n, CtsLabelNames *names, CtsError *err)
{
    CtsJson json = {.name = what, .text = text, .size = n, .status = CTS_ERR_USAGE};
    CtsStatus st = cts_json_open(&json, err);
    if (st)
        return st;
    json_t *list = json_object_get(json.root, "labels"), *value;
    const char *key;
    list = json_is_object(list) ? list : json.root;
    if (!json_is_object(list))
        st = cts_fail(err, CTS_ERR_USAGE, "%s: names of labels stand in an object: {\"1\": \"liver\"}", what);
    json_object_foreach(list, key, value)
    {
        int number;
        if (st)
            break;
        if (json_is_string(value) && number_of(key, &number))
            st = add_name(names, number, json_string_value(value), json_string_length(value), err);
        else if (is_number(value))
            st = add_name(names, (int)json_integer_value(value), key, strlen(key), err);
        else if (json_is_array(value))
            st = add_region(what, key, value, names, err);
        else
            st = cts_fail(err, CTS_ERR_USAGE, "%s: \"%s\" is neither a number of a label nor named by one", what, key);
    }
    cts_json_close(&json);
    return st;
}

/* IDX R G B A VIS MSH "NAME", and lines that begin with #. */
static CtsStatus parse_table(const char *what, const char *text, size_t n, CtsLabelNames *names, CtsError *err)
{
    CtsStatus st = CTS_OK;
    int line = 1;
    for (const char *p = text, *end = text + n; p < end && !st; line++) {
        const char *const stop = memchr(p, '\n', (size_t)(end - p)) ? memchr(p, '\n', (size_t)(end - p)) : end;
        char row[512];
        int number = -1;
        double rgb[3];
        snprintf(row, sizeof row, "%.*s", (int)(stop - p), p);
        const char *open = strchr(row, '"'), *close = open ? strchr(open + 1, '"') : NULL;
        const char *first = row + strspn(row, " \t\r");
        p = stop + 1;
        if (!*first || *first == '#')
            continue;
        const int n_read = close ? sscanf(first, "%d %lf %lf %lf", &number, &rgb[0], &rgb[1], &rgb[2]) : 0;
        if (n_read < 1 || number < 0)
            return cts_fail(err, CTS_ERR_USAGE,
                            "%s: line %d is neither JSON nor a row of an ITK-SNAP table (1 255 0 0 1 1 1 \"liver\")",
                            what, line);
        st = add_name(names, number, open + 1, (size_t)(close - open - 1), err);
        if (!st && n_read == 4)
            colour(names, rgb, 255);
    }
    return st;
}

CtsStatus cts_label_names_parse(const char *what, const char *text, size_t n, CtsLabelNames *names, CtsError *err)
{
    size_t blank = 0;
    while (blank < n && strchr(" \t\r\n", text[blank]) && text[blank])
        blank++;
    CtsStatus st = blank < n && text[blank] == '{' ? parse_names(what, text, n, names, err)
                                                   : parse_table(what, text, n, names, err);
    if (!st && names->n == 0 && names->n_regions == 0)
        st = cts_fail(err, CTS_ERR_USAGE, "%s: names no label", what);
    return st;
}

typedef struct Xml {
    CtsLabelNames *names;
    CtsStatus status;
    CtsError *err;
    int number;    /* of the open label element; -1: none */
    double rgb[3]; /* 0 to 1; below 0: none */
    char name[256];
    size_t n;
} Xml;

/* An attribute's number, or -1. */
static double part_of_colour(const char *text)
{
    char *end;
    const double value = strtod(text, &end);
    return end != text && !*end ? value : -1;
}

static void XMLCALL on_start(void *context, const char *element, const char **attributes)
{
    Xml *const x = context;
    static const char *const colours[] = {"Red", "Green", "Blue"};
    x->number = -1;
    x->n = 0;
    for (int c = 0; c < 3; c++)
        x->rgb[c] = -1;
    for (; !strcmp(element, "Label") && *attributes; attributes += 2) {
        if (!strcmp(attributes[0], "Key") && !number_of(attributes[1], &x->number))
            x->number = -1;
        for (int c = 0; c < 3; c++)
            if (!strcmp(attributes[0], colours[c]))
                x->rgb[c] = part_of_colour(attributes[1]);
    }
}

static void XMLCALL on_text(void *context, const char *text, int n)
{
    Xml *const x = context;
    for (int i = 0; x->number >= 0 && i < n && x->n + 1 < sizeof x->name; i++)
        x->name[x->n++] = text[i];
}

static void XMLCALL on_end(void *context, const char *element)
{
    Xml *const x = context;
    (void)element;
    if (x->number >= 0 && x->n && !x->status && !(x->status = add_name(x->names, x->number, x->name, x->n, x->err)))
        colour(x->names, x->rgb, 1);
    x->number = -1;
}

/* Bombs of entities are expat's to refuse. */
CtsStatus cts_label_names_xml(const char *text, size_t n, CtsLabelNames *names, CtsError *err)
{
    XML_Parser parser = XML_ParserCreate(NULL);
    if (!parser)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    Xml x = {.names = names, .err = err, .number = -1};
    XML_SetUserData(parser, &x);
    XML_SetElementHandler(parser, on_start, on_end);
    XML_SetCharacterDataHandler(parser, on_text);
    XML_Parse(parser, text, (int)(n < MAX_BYTES ? n : MAX_BYTES), 1);
    XML_ParserFree(parser);
    return x.status;
}

CtsStatus cts_label_names_read(const char *path, CtsLabelNames *names, CtsError *err)
{
    char *text;
    size_t n;
    CtsStatus st = cts_file_text(path, MAX_BYTES, CTS_ERR_READ, &text, &n, err);
    if (!st && n > MAX_BYTES)
        st = cts_fail(err, CTS_ERR_USAGE, "%s: is no file of names", path);
    if (!st)
        st = cts_label_names_parse(path, text, n, names, err);
    free(text);
    return st;
}
