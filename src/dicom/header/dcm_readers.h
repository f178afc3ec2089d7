/* DCMTK, and the code that calls it, is a plug-in library (base/load_plugin.h): linking it takes longer than the rest
 * of the program's start, and a plain series does not need it. Each folder that calls DCMTK exports a table of its
 * functions; the program loads the library and calls them through the table. Tests link the tables directly. */
#pragma once

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
