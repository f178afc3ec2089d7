/* A DICOM file whose elements in front of the pixels are read as a whole by the reader's process (dicom/reader): label
 * objects, DICOMDIR, captures, presentation states. */
#pragma once

#include "dicom/header/elements.h"
#include "dicom/header/header_answer.h"

CTS_C_BEGIN

typedef struct CtsDicomObject {
    CtsFileBytes file; /* open until the end */
    CtsHeaderFacts facts;
    const CtsSyntax *syntax; /* NULL: not known */
    CtsElements elements;    /* in front of the pixels; the first is the SOP class in the meta header */
    uint8_t *records;        /* of the elements; owned */
} CtsDicomObject;

/* max_header: limit of bytes in front of the pixels. CTS_ERR_READ, without the path, for a file that cannot be opened,
 * is damaged or is no DICOM file. Close in any case. */
CtsStatus cts_dicom_object_open(CtsDicomObject *object, const CtsFile *source, uint64_t max_header, CtsError *err);
void cts_dicom_object_close(CtsDicomObject *object);

/* Encodes an object up to its pixels: its attributes, order.n_records bytes of records, and what is copied of a slice,
 * whose file must be the one that was scanned. `elements` are the bytes. CTS_ERR_READ with the path. Close in any case.
 */
CtsStatus cts_dicom_object_make(CtsDicomObject *object, const CtsSlice *source, CtsReaderOrder order,
                                const uint8_t *records, CtsError *err);

/* The UIDs of an object: "" where missing. CTS_ERR_READ, with the path, for a file that is not DICOM. */
typedef struct CtsDcmIds {
    char class_uid[65], sop_uid[65], syntax_uid[65];
} CtsDcmIds;
CtsStatus cts_dcm_ids(const char *path, CtsDcmIds *ids, CtsError *err);

CTS_C_END
