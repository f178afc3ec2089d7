#include "dicom/codec/dcm_decoder.h"

#include "base/load_plugin.h"
#include "dicom/header/dcm_read.h"

CTS_PLUGIN_TABLE(CtsDcmDecoder, cts_dcm_decoder, cts_dcm_start_decoders, cts_dcm_decode)
