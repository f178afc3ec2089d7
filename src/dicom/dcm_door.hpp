/* What the C++ files of the door share. Include after dcmtk/config/osconfig.h. */
#ifndef CTS_DICOM_DCM_DOOR_HPP
#define CTS_DICOM_DCM_DOOR_HPP

#include "dicom/syntax.h"

#include <cstddef>
#include <cstdint>
#include <dcmtk/dcmdata/dcdatset.h>
#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dcxfer.h>

/* Warnings and errors that DCMTK logged in this thread since the last reset, and the first one's text. */
struct CtsDcmLog {
    unsigned n;
    char first[120];
};

CtsDcmLog &cts_dcm_log();
void cts_dcm_log_reset();

/* Parse a data set that is whole in memory. */
inline OFCondition cts_dcm_parse(DcmDataset &data_set, const uint8_t *bytes, size_t n, const CtsSyntax *syntax)
{
    DcmInputBufferStream in;
    in.setBuffer(bytes, static_cast<offile_off_t>(n));
    in.setEos();
    data_set.transferInit();
    const OFCondition result = data_set.read(in, DcmXfer(syntax->uid).getXfer(), EGL_noChange);
    data_set.transferEnd();
    return result;
}

#endif
