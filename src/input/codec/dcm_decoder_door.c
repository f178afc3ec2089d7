#include "base/load_part.h"
#include "input/codec/dcm_decoder.h"

CTS_PART_DOOR(CtsDcmDecoder, cts_dcm_decoder, CTS_DCMTK_PART)
