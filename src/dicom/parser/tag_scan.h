/* A scan of the framing of a DICOM file before its elements are read: tags and lengths, no values.
 *
 * Lengths are untrusted, and sequences may be nested as deep as a file's bytes allow. This scanner walks the tags up to
 * PixelData without recursion, compares every length with the size of the file, and finds the offset of the pixels.
 * Data that pass it may be walked plainly, and given to DCMTK 3.6.7, which allocates whatever a length claims and
 * recurses once for each nested sequence. */
#pragma once

#include "ctsplat/api.h"
#include "dicom/parser/syntax.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

enum {
    CTS_MAX_NESTING = 64 /* sequences inside sequences, as in DCMTK from 3.7.0 on */
};

typedef enum CtsScanResult {
    CTS_SCAN_DONE,
    CTS_SCAN_MORE,      /* call again with at least `need` bytes of the file */
    CTS_SCAN_NOT_DICOM, /* from cts_scan_meta() alone */
    CTS_SCAN_BAD        /* DICOM, but broken: see why */
} CtsScanResult;

/* Preamble and meta header (group 0002), read by tag: its group length is often wrong and never needed. */
typedef struct CtsMetaScan {
    size_t need;
    char why[112];
    bool has_preamble, has_meta;
    char syntax_uid[65];    /* (0002,0010), "" where missing */
    char sop_class_uid[65]; /* (0002,0002) */
    size_t data_offset;     /* offset of the data set */
} CtsMetaScan;

/* False for a file whose first n bytes are clearly not DICOM. */
bool cts_scan_begins_dicom(const uint8_t *bytes, size_t n);

CtsScanResult cts_scan_meta(const uint8_t *bytes, size_t n, uint64_t file_bytes, CtsMetaScan *scan);

/* An element's own 8 or 12 bytes. */
typedef struct CtsRawElement {
    uint32_t tag;
    uint8_t vr[2];
    uint32_t length;  /* 0xFFFFFFFF: undefined */
    uint32_t n_bytes; /* of tag, VR and length */
} CtsRawElement;

/* False when more bytes are needed (12 always do). */
bool cts_read_element(const uint8_t *p, uint64_t n, bool explicit_vr, bool big, CtsRawElement *element);

/* The encoding of the data set at p, detected from its first element; NULL when it is neither. */
const CtsSyntax *cts_scan_guess(const uint8_t *p, size_t n);

enum { CTS_N_CHECKED_TAGS = 25 };

/* The place of a value among the bytes; offset 0: none. */
typedef struct CtsScannedValue {
    size_t offset;
    uint32_t n;
} CtsScannedValue;

typedef struct CtsDataScan {
    uint64_t need;
    char why[112];
    CtsScannedValue checked[CTS_N_CHECKED_TAGS];
    size_t header_end; /* offset of PixelData's tag, or the end of the data set */
    bool has_pixels, pixel_words, encapsulated;
    uint64_t pixel_offset, pixel_bytes; /* of the value; pixel_bytes 0 when encapsulated */
    uint32_t float_pixels;              /* the tag of Float or Double Float Pixel Data, where used instead; else 0 */
    int depth;                          /* deepest nesting met */
} CtsDataScan;

/* The data set from `start` on. `total`: the number of bytes in the file (n or more), `most`: the limit of bytes before
 * the pixels. */
CtsScanResult cts_scan_data(const uint8_t *bytes, size_t n, uint64_t total, size_t start, const CtsSyntax *syntax,
                            size_t most, CtsDataScan *scan);

/* Number of bytes of a value of undefined length that begins here, including its delimiter's 8; is_item: an item;
 * is_raw: its items are fragments. 0: no end among the n bytes, or damage. */
size_t cts_scan_undefined(const uint8_t *bytes, size_t n, bool explicit_vr, bool big, bool is_item, bool is_raw);

CTS_C_END
