/* The beginning of a DICOM file: preamble, meta header, and the encoding of its data set. */
#pragma once

#include "ctsplat/api.h"
#include "dicom/protocol/syntax.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

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
    bool has_preamble;
    char syntax_uid[65];    /* (0002,0010), "" where missing */
    char sop_class_uid[65]; /* (0002,0002) */
    size_t data_offset;     /* offset of the data set */
} CtsMetaScan;

/* False for a file whose first n bytes are clearly not DICOM. */
bool cts_scan_begins_dicom(const uint8_t *bytes, size_t n);

CtsScanResult cts_scan_meta(const uint8_t *bytes, size_t n, uint64_t file_bytes, CtsMetaScan *scan);

/* The pixels of a data set by its framing. */
typedef struct CtsPixelFraming {
    bool found;     /* PixelData (7FE0,0010) */
    bool are_words; /* VR OW */
    bool encapsulated;
    uint64_t offset, n_bytes; /* of the value, in the inflated data set when deflated; n_bytes 0 when encapsulated */
    uint32_t float_tag;       /* the tag of Float or Double Float Pixel Data, where used instead; else 0 */
} CtsPixelFraming;

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

uint32_t cts_read_tag(const uint8_t *p, bool big);
/* True for the two letters of a VR of the standard. */
bool cts_vr_is_known(const uint8_t vr[2]);

CTS_C_END
