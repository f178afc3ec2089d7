/* DCMTK's codecs, as dicom/header/dcm_readers.h. */
#pragma once

#include "ctsplat/api.h"
#include "dicom/codec/codec.h"

CTS_C_BEGIN

typedef struct CtsDcmDecoder {
    CtsStatus (*start)(CtsError *err); /* before the first decoding */
    cts_decode_fn decode;
} CtsDcmDecoder;

CtsStatus cts_dcm_decoder(const CtsDcmDecoder **decoder, CtsError *err);

CTS_C_END
