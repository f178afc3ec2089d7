/* JSON text read with jansson, with the file and line in every error message.
 *
 * jansson gives positions for syntax errors only. A CtsJsonAt therefore records the path to a value, and for a message
 * the line is found by parsing the text again with jansson as the tokeniser. */
#pragma once

#include "ctsplat/status.h"
#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

typedef struct CtsJson {
    const char *name; /* name of the file in messages; the caller's */
    const char *text; /* the caller's, size bytes, any bytes */
    size_t size;
    json_t *root;
    CtsStatus status; /* of every failure */
} CtsJson;

/* A value in a document. Points at the place it was reached from, which must outlive it. */
typedef struct CtsJsonAt {
    const CtsJson *json;
    const struct CtsJsonAt *parent; /* NULL: the root */
    const char *key;                /* member of an object, or NULL: */
    size_t index;                   /* element of an array */
    json_t *value;
} CtsJsonAt;

/* Keys given twice are an error. Fill name, text, size and status first; close in any case. */
CtsStatus cts_json_open(CtsJson *json, CtsError *err);
void cts_json_close(CtsJson *json);

CtsJsonAt cts_json_root(const CtsJson *json);
/* False when there is no such member, or object is not an object. */
bool cts_json_member(const CtsJsonAt *object, const char *key, CtsJsonAt *member);
/* The same where there has to be one. */
CtsStatus cts_json_need(const CtsJsonAt *object, const char *key, CtsJsonAt *member, CtsError *err);
CtsJsonAt cts_json_element(const CtsJsonAt *array, size_t index);

/* "NAME: line N: ..." */
CtsStatus cts_json_fail(const CtsJsonAt *at, CtsError *err, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* An object with no keys but these. */
CtsStatus cts_json_check_keys(const CtsJsonAt *at, const char *const *keys, size_t n_keys, CtsError *err);
/* An array of low..high elements. */
CtsStatus cts_json_check_array(const CtsJsonAt *at, size_t low, size_t high, CtsError *err);
CtsStatus cts_json_number(const CtsJsonAt *at, double low, double high, double *value, CtsError *err);
/* An array of n of them. */
CtsStatus cts_json_numbers(const CtsJsonAt *at, size_t n, double low, double high, double *values, CtsError *err);
CtsStatus cts_json_bool(const CtsJsonAt *at, bool *value, CtsError *err);
/* Stays the document's. */
CtsStatus cts_json_string(const CtsJsonAt *at, const char **value, CtsError *err);

/* Text from outside; invalid UTF-8 becomes question marks. */
json_t *cts_json_new_text(const char *text);
/* An object's text under this key, "" if missing. */
static inline const char *cts_json_text_of(const json_t *object, const char *key)
{
    const char *text = json_string_value(json_object_get(object, key));
    return text ? text : "";
}
/* A number as people write it: without a point when it is whole. */
json_t *cts_json_new_number(double value);
