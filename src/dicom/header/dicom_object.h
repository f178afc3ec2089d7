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

/* The data set of a slice up to its pixels, in the uncompressed syntax `native`. */
typedef struct CtsDataSet {
    const uint8_t *bytes;
    size_t n;
    const CtsSyntax *native;
} CtsDataSet;

/* The data set of a slice, whose file must be the one that was scanned; its bytes are for cts_free(). CTS_ERR_READ with
 * the path. */
CtsStatus cts_slice_data_set(const CtsSlice *slice, uint8_t **bytes, CtsDataSet *data_set, CtsError *err);

/* The UIDs of an object: "" where missing. CTS_ERR_READ, with the path, for a file that is not DICOM. */
typedef struct CtsDcmIds {
    char class_uid[65], sop_uid[65], syntax_uid[65];
} CtsDcmIds;
CtsStatus cts_dcm_ids(const char *path, CtsDcmIds *ids, CtsError *err);

CTS_C_END
