#include "base/json.h"

#include "base/text.h"
#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

CtsStatus cts_json_open(CtsJson *json, CtsError *err)
{
    json_error_t error;
    json->root = json_loadb(json->text, json->size, JSON_REJECT_DUPLICATES, &error);
    if (!json->root)
        return cts_fail(err, json->status, "%s: line %d: %s", json->name, error.line > 0 ? error.line : 1, error.text);
    return CTS_OK;
}

void cts_json_close(CtsJson *json)
{
    json_decref(json->root);
    json->root = NULL;
}

CtsJsonAt cts_json_root(const CtsJson *json)
{
    return (CtsJsonAt){.json = json, .value = json->root};
}

bool cts_json_member(const CtsJsonAt *object, const char *key, CtsJsonAt *member)
{
    *member =
        (CtsJsonAt){.json = object->json, .parent = object, .key = key, .value = json_object_get(object->value, key)};
    return member->value;
}

CtsJsonAt cts_json_element(const CtsJsonAt *array, size_t index)
{
    return (CtsJsonAt){
        .json = array->json, .parent = array, .index = index, .value = json_array_get(array->value, index)};
}

static size_t skip_blanks(const CtsJson *json, size_t at)
{
    while (at < json->size && strchr(" \t\r\n,:", json->text[at]) && json->text[at])
        at++;
    return at;
}

/* The value at an offset of a valid text, and the offset after it. */
static json_t *decode_at(const CtsJson *json, size_t at, size_t *end)
{
    json_error_t error;
    json_t *value = json_loadb(json->text + at, json->size - at, JSON_DECODE_ANY | JSON_DISABLE_EOF_CHECK, &error);
    *end = at + (value && error.position > 0 ? (size_t)error.position : 0);
    return value;
}

/* Offset of a value in the text, or of its key. On any surprise the parent's, which is near enough. */
static size_t find_offset(const CtsJsonAt *at, bool of_key)
{
    const CtsJson *json = at->json;
    if (!at->parent)
        return skip_blanks(json, 0);
    const size_t start = find_offset(at->parent, false);
    size_t here = skip_blanks(json, start + 1);
    for (size_t i = 0; here < json->size; i++) {
        const size_t key_offset = here;
        bool found = !at->key && i == at->index;
        size_t end;
        json_t *item;
        if (at->key) {
            if (!(item = decode_at(json, here, &end)))
                return start;
            found = json_is_string(item) && !strcmp(json_string_value(item), at->key);
            json_decref(item);
            here = skip_blanks(json, end);
        }
        if (found)
            return of_key ? key_offset : here;
        if (!(item = decode_at(json, here, &end)))
            return start;
        json_decref(item);
        here = skip_blanks(json, end);
    }
    return start;
}

static CtsStatus fail_at(const CtsJsonAt *at, bool of_key, CtsError *err, const char *text)
{
    const size_t offset = find_offset(at, of_key);
    int line = 1;
    for (size_t i = 0; i < offset && i < at->json->size; i++)
        line += at->json->text[i] == '\n';
    return cts_fail(err, at->json->status, "%s: line %d: %s", at->json->name, line, text);
}

CtsStatus cts_json_fail(const CtsJsonAt *at, CtsError *err, const char *format, ...)
{
    char text[600];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return fail_at(at, false, err, text);
}

typedef struct PlaceName {
    char text[80];
} PlaceName;

/* "opacity", or "points 3" (counted from 1) for the third element of points. */
static PlaceName place_of(const CtsJsonAt *at)
{
    PlaceName name = {"the file"};
    if (at->key)
        snprintf(name.text, sizeof name.text, "%.60s", at->key);
    else if (at->parent)
        snprintf(name.text, sizeof name.text, "%.50s %zu", at->parent->key ? at->parent->key : "element",
                 at->index + 1);
    return name;
}

CtsStatus cts_json_check_keys(const CtsJsonAt *at, const char *const *keys, size_t n_keys, CtsError *err)
{
    char text[600];
    if (!json_is_object(at->value))
        return cts_json_fail(at, err, "%s is not an object { }", place_of(at).text);
    const char *key;
    json_t *value;
    json_object_foreach(at->value, key, value)
    {
        size_t known = 0;
        while (known < n_keys && strcmp(key, keys[known]))
            known++;
        if (known < n_keys)
            continue;
        snprintf(text, sizeof text, "unknown key \"%.60s\" (known:", key);
        for (size_t k = 0; k < n_keys; k++)
            cts_text_append(text, sizeof text, " ", "%s%s", keys[k], k + 1 < n_keys ? "" : ")");
        CtsJsonAt member;
        cts_json_member(at, key, &member);
        return fail_at(&member, true, err, text);
    }
    return CTS_OK;
}

CtsStatus cts_json_need(const CtsJsonAt *object, const char *key, CtsJsonAt *member, CtsError *err)
{
    return cts_json_member(object, key, member)
               ? CTS_OK
               : cts_json_fail(object, err, "%s has no %s", place_of(object).text, key);
}

CtsStatus cts_json_check_array(const CtsJsonAt *at, size_t low, size_t high, CtsError *err)
{
    if (!json_is_array(at->value))
        return cts_json_fail(at, err, "%s is not a list [ ]", place_of(at).text);
    const size_t n = json_array_size(at->value);
    if (n >= low && n <= high)
        return CTS_OK;
    if (low == high)
        return cts_json_fail(at, err, "%s has %zu values, not %zu", place_of(at).text, n, low);
    return cts_json_fail(at, err, "%s has %zu entries (%zu to %zu)", place_of(at).text, n, low, high);
}

CtsStatus cts_json_number(const CtsJsonAt *at, double low, double high, double *value, CtsError *err)
{
    if (!json_is_number(at->value))
        return cts_json_fail(at, err, "%s is not a number", place_of(at).text);
    *value = json_number_value(at->value);
    if (!(*value >= low && *value <= high))
        return cts_json_fail(at, err, "%s is %.10g (%g to %g)", place_of(at).text, *value, low, high);
    return CTS_OK;
}

CtsStatus cts_json_numbers(const CtsJsonAt *at, size_t n, double low, double high, double *values, CtsError *err)
{
    CtsStatus st = cts_json_check_array(at, n, n, err);
    for (size_t i = 0; i < n && !st; i++) {
        const CtsJsonAt element = cts_json_element(at, i);
        st = cts_json_number(&element, low, high, &values[i], err);
    }
    return st;
}

CtsStatus cts_json_bool(const CtsJsonAt *at, bool *value, CtsError *err)
{
    if (!json_is_boolean(at->value))
        return cts_json_fail(at, err, "%s is neither true nor false", place_of(at).text);
    *value = json_is_true(at->value);
    return CTS_OK;
}

CtsStatus cts_json_string(const CtsJsonAt *at, const char **value, CtsError *err)
{
    if (!json_is_string(at->value))
        return cts_json_fail(at, err, "%s is not a text in quotes", place_of(at).text);
    *value = json_string_value(at->value);
    return CTS_OK;
}

json_t *cts_json_new_text(const char *text)
{
    json_t *value = json_string(text);
    if (value)
        return value;
    char *copy = strdup(text);
    for (char *c = copy; c && *c; c++)
        if (!isascii((unsigned char)*c))
            *c = '?';
    value = copy ? json_string(copy) : json_null();
    free(copy);
    return value;
}

json_t *cts_json_new_number(double value)
{
    if (floor(value) == value && fabs(value) < 1e15)
        return json_integer((json_int_t)value);
    return json_real(value);
}
