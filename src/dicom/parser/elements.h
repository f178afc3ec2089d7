/* A DICOM data set walked plainly: elements and items as places in memory. For objects whose values are few and whose
 * items are many; what is not asked for costs nothing. */
#ifndef CTS_DICOM_ELEMENTS_H
#define CTS_DICOM_ELEMENTS_H

#include "ctsplat/api.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

/* Elements that have not been looked at yet: of a data set, an item or, as items, of a sequence. */
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

/* The first element of this tag; false where there is none. */
bool cts_elements_get(CtsElements elements, uint32_t tag, CtsElement *element);
/* Its value; an empty one where there is none. */
CtsElements cts_elements_find(CtsElements elements, uint32_t tag);
/* The first item of a sequence. */
CtsElements cts_elements_item(CtsElements elements, uint32_t sequence_tag);

/* Values: text without the blanks around it, cut to its size; whether there was any. */
bool cts_elements_text(CtsElements elements, uint32_t tag, char *text, size_t size);
/* US, UL or IS; false where there is no such number. */
bool cts_elements_integer(CtsElements elements, uint32_t tag, int *value);
/* US, exactly n of them. */
bool cts_elements_shorts(CtsElements elements, uint32_t tag, int *values, int n);
/* DS or IS, exactly n of them. */
bool cts_elements_decimals(CtsElements elements, uint32_t tag, double *values, int n);

/* A decimal string (DS, PS3.5 6.2) of exactly n_values numbers: whole text, finite, '.' as the decimal point whatever
 * the locale. More than 16 bytes a value, blanks around it and a sign are accepted. */
int cts_dcm_parse_ds(const char *text, size_t n_bytes, double *values, int n_values);
/* An integer string (IS). */
int cts_dcm_parse_is(const char *text, size_t n_bytes, int *value);

CTS_C_END
#endif
