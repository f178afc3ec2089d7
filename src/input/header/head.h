/* The header of a DICOM file: read as far as its pixels, its framing looked over, a deflated one inflated. */
#ifndef CTS_HEADER_HEAD_H
#define CTS_HEADER_HEAD_H

#include "ctsplat/api.h"
#include "input/files/file_bytes.h"
#include "input/files/scan.h"
#include "input/header/dcm_read.h"
#include "input/header/elements.h"

CTS_C_BEGIN

typedef struct CtsHead {
    CtsFileBytes file; /* open until the end */
    CtsFileKind kind;  /* the rest is of DICOM alone */
    CtsScratch *scratch;
    size_t n; /* bytes from the file's start that are in scratch */
    CtsMetaScan meta;
    const CtsSyntax *syntax; /* NULL: not known */
    const char *syntax_uid;
    unsigned odd; /* CTS_ODD_... of the file */
    CtsDataScan scan;
    CtsDataSet data_set; /* in scratch */
} CtsHead;

/* CTS_ERR_READ, without the path, for what cannot be opened or is damaged. Close in any case. */
CtsStatus cts_head_open(CtsHead *head, const CtsFile *source, CtsScratch *scratch, CtsError *err);
void cts_head_close(CtsHead *head);

/* All elements in front of the pixels. */
CtsElements cts_head_elements(const CtsHead *head);

/* The header of a slice's file, which must be the one that was scanned. CTS_ERR_READ with its path. Close in any
 * case. */
typedef struct CtsSliceHead {
    CtsScratch scratch;
    CtsHead head;
} CtsSliceHead;
CtsStatus cts_slice_head_open(CtsSliceHead *slice_head, const CtsSlice *slice, CtsError *err);
void cts_slice_head_close(CtsSliceHead *slice_head);

/* What an object is called: "" where it does not say. CTS_ERR_READ, with the path, for what is no DICOM file. */
typedef struct CtsDcmIds {
    char class_uid[65], sop_uid[65], syntax_uid[65];
} CtsDcmIds;
CtsStatus cts_dcm_ids(const char *path, CtsDcmIds *ids, CtsError *err);

CTS_C_END
#endif
