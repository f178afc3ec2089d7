/* The door to DCMTK. DCMTK, and what of the tree calls it, is a library of its own (base/load_part.h): linking it takes
 * longer than all else that starting the program takes, and a plain series needs none of it. Each room that calls DCMTK
 * shows a table of its functions; the program's side of the door loads the library, and finds it there. Tests have the
 * tables in them. */
#ifndef CTS_DICOM_DCM_READERS_H
#define CTS_DICOM_DCM_READERS_H

#include "ctsplat/api.h"
#include "dicom/header/dcm_read.h"

CTS_C_BEGIN

typedef struct CtsDcmReaders {
    __typeof__(cts_dcm_start) *start;
    __typeof__(cts_dcm_class_name) *class_name;
    __typeof__(cts_dcm_convert) *convert;
} CtsDcmReaders;

/* CTS_ERR_INTERNAL when the library is not there. */
CtsStatus cts_dcm_readers(const CtsDcmReaders **readers, CtsError *err);

CTS_C_END
#endif
