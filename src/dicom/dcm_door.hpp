/* What the C++ files of the door share. */
#ifndef CTS_DICOM_DCM_DOOR_HPP
#define CTS_DICOM_DCM_DOOR_HPP

#include "dicom/syntax.h"

#include <cstddef>
#include <cstdint>

class DcmDataset;
class OFCondition;

/* Warnings and errors that DCMTK logged in this thread since the last reset, and the first one's text. */
struct CtsDcmLog {
    unsigned n;
    char first[120];
};

CtsDcmLog &cts_dcm_log();
void cts_dcm_log_reset();

/* Parse a data set that is whole in memory. */
OFCondition cts_dcm_parse(DcmDataset &data_set, const uint8_t *bytes, size_t n, const CtsSyntax *syntax);

#endif
