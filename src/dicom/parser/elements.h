/* A DICOM data set parsed in place: elements and items as positions in memory. For objects with few values and many
 * items; elements that are not requested cost nothing. */
#pragma once

#include "ctsplat/api.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

/* Elements not yet parsed: of a data set, an item or, as items, of a sequence. */
typedef struct CtsElements {
    const uint8_t *at, *end;
    bool explicit_vr, big_endian;
    bool damaged; /* the walk ended before `end` */
} CtsElements;

typedef struct CtsElement {
    uint32_t tag;  /* group << 16 | element */
    uint8_t vr[2]; /* zeros where it is implicit */
    CtsElements value;
    bool undefined; /* its length: fragments, or a sequence */
} CtsElement;

/* The next element, or item of a sequence; false at the end, or where the bytes make no sense. */
bool cts_elements_next(CtsElements *rest, CtsElement *element);
bool cts_items_next(CtsElements *sequence, CtsElements *item);

/* The first element of this tag; false if missing. */
bool cts_elements_get(CtsElements elements, uint32_t tag, CtsElement *element);
/* Its value; an empty one if missing. */
CtsElements cts_elements_find(CtsElements elements, uint32_t tag);
/* The first item of a sequence. */
CtsElements cts_elements_item(CtsElements elements, uint32_t sequence_tag);

/* Values: text without surrounding blanks, truncated to size; false if there is none. */
bool cts_elements_text(CtsElements elements, uint32_t tag, char *text, size_t size);
/* US, UL or IS; false where there is no such number. */
bool cts_elements_integer(CtsElements elements, uint32_t tag, int *value);
/* US, exactly n of them. */
bool cts_elements_shorts(CtsElements elements, uint32_t tag, int *values, int n);
/* DS or IS, exactly n of them. */
bool cts_elements_decimals(CtsElements elements, uint32_t tag, double *values, int n);

/* A decimal string (DS, PS3.5 6.2) of exactly n_values numbers: the whole text, finite, with '.' as the decimal point
 * in any locale. Accepts more than 16 bytes per value, surrounding blanks and a sign. */
int cts_dcm_parse_ds(const char *text, size_t n_bytes, double *values, int n_values);
/* An integer string (IS). */
int cts_dcm_parse_is(const char *text, size_t n_bytes, int *value);

CTS_C_END
