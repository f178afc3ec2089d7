#include "base/load_part.h"
#include "input/header/dcm_readers.h"

CTS_PART_DOOR(CtsDcmReaders, cts_dcm_readers, CTS_DCMTK_PART)
