/* Headers of DICOM files, and the slices and pixels that they describe. */
#pragma once

#include "base/file_bytes.h"
#include "ctsplat/api.h"
#include "dicom/header/dcm_read.h"
#include "dicom/header/slice.h"
#include "dicom/parser/elements.h"

/* The header of a DICOM file: read up to its pixels, with its framing checked, inflated if deflated. */

CTS_C_BEGIN

typedef struct CtsDicomHeader {
    CtsFileBytes file; /* open until the end */
    CtsFileKind kind;  /* DICOM or not; the following fields are for DICOM only */
    CtsScratch *scratch;
    size_t n; /* bytes from the file's start that are in scratch */
    CtsMetaScan meta;
    const CtsSyntax *syntax; /* NULL: not known */
    const char *syntax_uid;
    unsigned odd; /* CTS_ODD_... of the file */
    CtsDataScan scan;
    CtsDataSet data_set; /* in scratch */
} CtsDicomHeader;

/* CTS_ERR_READ, without the path, for a file that cannot be opened or is damaged. Close in any case. */
CtsStatus cts_dicom_header_open(CtsDicomHeader *head, const CtsFile *source, CtsScratch *scratch, CtsError *err);
void cts_dicom_header_close(CtsDicomHeader *head);

/* All elements in front of the pixels. */
CtsElements cts_dicom_header_elements(const CtsDicomHeader *head);

/* The header of a slice's file, which must be the one that was scanned. CTS_ERR_READ with its path. Close in any
 * case. */
typedef struct CtsSliceHeader {
    CtsScratch scratch;
    CtsDicomHeader head;
} CtsSliceHeader;
CtsStatus cts_slice_header_open(CtsSliceHeader *slice_head, const CtsSlice *slice, CtsError *err);
void cts_slice_header_close(CtsSliceHeader *slice_head);

/* The UIDs of an object: "" where missing. CTS_ERR_READ, with the path, for a file that is not DICOM. */
typedef struct CtsDcmIds {
    char class_uid[65], sop_uid[65], syntax_uid[65];
} CtsDcmIds;
CtsStatus cts_dcm_ids(const char *path, CtsDcmIds *ids, CtsError *err);

/* Offsets of the frames' pixels in the file. */

/* n frames' places among the fragments of the value at pixel_offset: those of frame k lie between offset[k] and
 * offset[k + 1], each with the 8 bytes of its item. n + 1 numbers, for cts_free(). */
CtsStatus cts_find_frames(const CtsFileBytes *file, uint64_t pixel_offset, int n, uint64_t **offset, CtsError *err);

/* For the n frames of one object, in order, whose pixel_offset and pixel_bytes are those of the whole value of
 * PixelData: sets them to each frame's own. Sets a fault where the bytes do not contain the frames, or the first
 * fragment of each frame is unknown. */
CtsStatus cts_place_fragments(const CtsFileBytes *file, CtsSlice *const *frames, int n, CtsError *err);
void cts_place_native(const CtsFileBytes *file, CtsSlice *const *frames, int n);

CTS_C_END
