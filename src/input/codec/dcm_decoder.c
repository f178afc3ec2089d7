#include "input/codec/dcm_decoder.h"

#include "input/header/dcm_read.h"

__attribute__((visibility("default"))) CtsStatus cts_dcm_decoder(const CtsDcmDecoder **decoder, CtsError *err)
{
    static const CtsDcmDecoder here = {cts_dcm_start_decoders, cts_dcm_decode};
    (void)err;
    *decoder = &here;
    return CTS_OK;
}
