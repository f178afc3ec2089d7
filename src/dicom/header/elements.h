/* The elements of a data set as the reader (dicom/reader) passes them on: plain records, one after the other. A record
 * may hold anything, since the reader works on untrusted bytes: nothing beyond the given ones is ever read. */
#pragma once

#include "ctsplat/api.h"
#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

typedef enum CtsValueKind {
    CTS_VALUE_TEXT,
    CTS_VALUE_NUMBERS, /* doubles: of a binary VR, or of a text (DS, IS) of nothing but numbers */
    CTS_VALUE_BYTES,   /* those of words with the lower one first */
    CTS_VALUE_ITEMS,   /* of a sequence: records of tag 0 and kind CTS_VALUE_ITEM */
    CTS_VALUE_ITEM     /* records */
} CtsValueKind;

/* In front of each value, which n bytes follow, and zeros up to a multiple of 8. */
typedef struct CtsRecord {
    uint32_t tag, kind;
    uint64_t n;
} CtsRecord;

/* The SOP class in the meta header, as the first record. */
enum { CTS_TAG_META_CLASS = 0x00020002 };

/* Records that are not yet read: of a data set, an item or, as items, of a sequence. */
typedef struct CtsElements {
    const uint8_t *at, *end;
} CtsElements;

typedef struct CtsElement {
    uint32_t tag; /* group << 16 | element */
    CtsValueKind kind;
    CtsElements value;
} CtsElement;

/* The next element, or item of a sequence; false at the end. */
bool cts_elements_next(CtsElements *rest, CtsElement *element);
bool cts_items_next(CtsElements *sequence, CtsElements *item);

/* The first element of this tag; false if missing. */
bool cts_elements_get(CtsElements elements, uint32_t tag, CtsElement *element);
/* Its value; an empty one if missing. */
CtsElements cts_elements_find(CtsElements elements, uint32_t tag);
/* The first item of a sequence. */
CtsElements cts_elements_item(CtsElements elements, uint32_t sequence_tag);

/* Values: text (or bytes) without surrounding blanks, truncated to size; false if there is none. */
bool cts_element_text(const CtsElement *element, char *text, size_t size);
bool cts_elements_text(CtsElements elements, uint32_t tag, char *text, size_t size);
/* A single whole number; false where there is none. */
bool cts_elements_integer(CtsElements elements, uint32_t tag, int *value);
/* Exactly n numbers of 16 bits without a sign; at most 3. */
bool cts_elements_shorts(CtsElements elements, uint32_t tag, int *values, size_t n);
/* Exactly n finite numbers. */
bool cts_elements_decimals(CtsElements elements, uint32_t tag, double *values, size_t n);

/* Records that are written one after the other. Zero-initialise; free bytes. */
typedef struct CtsRecords {
    uint8_t *bytes;
    size_t n, capacity;
    CtsStatus status; /* memory was short: the records are useless */
} CtsRecords;

/* Starts a record, whose value follows; cts_put_end() completes the last one that is not yet complete. */
size_t cts_put_begin(CtsRecords *to, uint32_t tag, CtsValueKind kind);
void cts_put_more(CtsRecords *to, const void *bytes, size_t n);
void cts_put_end(CtsRecords *to, size_t value);

void cts_put_bytes(CtsRecords *to, uint32_t tag, CtsValueKind kind, const void *bytes, size_t n);

CTS_C_END
