#include "dicom/header/dcm_readers.h"

#include "base/load_part.h"

CTS_PART_TABLE(CtsDcmReaders, cts_dcm_readers, .start = cts_dcm_start, .class_name = cts_dcm_class_name,
               .convert = cts_dcm_convert)
