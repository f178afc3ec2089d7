#include "dicom/codec/dcm_decoder.h"

#include "base/load_part.h"
#include "dicom/header/dcm_read.h"

CTS_PART_TABLE(CtsDcmDecoder, cts_dcm_decoder, cts_dcm_start_decoders, cts_dcm_decode)
