/* Loads DCMTK's plug-in and its function tables (dicom/header/dcm_readers.h). */
#include "base/load_part.h"
#include "dicom/codec/dcm_decoder.h"
#include "dicom/header/dcm_readers.h"
#include "dicom/objects/objects.h"

CTS_PART_DOOR(CtsDcmReaders, cts_dcm_readers, CTS_DCMTK_PART)
CTS_PART_DOOR(CtsDcmDecoder, cts_dcm_decoder, CTS_DCMTK_PART)
CTS_PART_DOOR(CtsDcmWriters, cts_dcm_writers, CTS_DCMTK_PART)
