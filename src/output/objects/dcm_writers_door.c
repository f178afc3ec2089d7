#include "base/load_part.h"
#include "output/objects/objects.h"

CTS_PART_DOOR(CtsDcmWriters, cts_dcm_writers, CTS_DCMTK_PART)
