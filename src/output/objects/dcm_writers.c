#include "output/objects/objects.h"

#include "base/load_part.h"

CTS_PART_TABLE(CtsDcmWriters, cts_dcm_writers, .sc_write = cts_dcm_sc_write, .sc_encode = cts_dcm_sc_encode,
               .state_write = cts_dcm_state_write)
