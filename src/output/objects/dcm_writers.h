/* Objects by DCMTK, as input/header/dcm_readers.h. */
#ifndef CTS_DICOM_DCM_WRITERS_H
#define CTS_DICOM_DCM_WRITERS_H

#include "ctsplat/api.h"
#include "output/objects/dcm_sc.h"
#include "output/objects/dcm_state.h"

CTS_C_BEGIN

typedef struct CtsDcmWriters {
    __typeof__(cts_dcm_sc_write) *sc_write;
    __typeof__(cts_dcm_sc_encode) *sc_encode;
    __typeof__(cts_dcm_state_write) *state_write;
} CtsDcmWriters;

CtsStatus cts_dcm_writers(const CtsDcmWriters **writers, CtsError *err);

CTS_C_END
#endif
