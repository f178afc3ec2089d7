/* A scan of the framing of a DICOM file before its elements are read: tags and lengths, no values.
 *
 * Lengths are untrusted, and sequences may be nested as deep as a file's bytes allow. This scanner walks the tags up to
 * PixelData without recursion, compares every length with the size of the file, and finds the offset of the pixels.
 * Data that pass it may be given to DCMTK 3.6.7, which allocates whatever a length claims and recurses once for each
 * nested sequence. */
#pragma once

#include "dicom/protocol/dicom_begin.h"

CTS_C_BEGIN

enum {
    CTS_MAX_NESTING = 64 /* sequences inside sequences, as in DCMTK from 3.7.0 on */
};

enum { CTS_N_CHECKED_TAGS = 33 };

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
    CtsPixelFraming pixels;
} CtsDataScan;

/* The data set from `start` on. `total`: the number of bytes in the file (n or more), `most`: the limit of bytes before
 * the pixels. */
CtsScanResult cts_scan_data(const uint8_t *bytes, size_t n, uint64_t total, size_t start, const CtsSyntax *syntax,
                            size_t most, CtsDataScan *scan);

CTS_C_END
