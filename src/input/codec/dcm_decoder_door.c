#include "base/load_part.h"
#include "input/codec/dcm_decoder.h"

CtsStatus cts_dcm_decoder(const CtsDcmDecoder **decoder, CtsError *err)
{
    static const void *kept;
    const void *table = NULL;
    const CtsStatus st = cts_part_table(CTS_DCMTK_PART, "cts_dcm_decoder", &kept, &table, err);
    *decoder = table;
    return st;
}
