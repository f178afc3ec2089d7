/* What the library of DCMTK shows of itself. */
#include "output/dcmtk/dcm_part.h"

static const CtsDcmPart part = {
    .start = cts_dcm_start,
    .start_decoders = cts_dcm_start_decoders,
    .parse_header = cts_dcm_parse_header,
    .read_frames = cts_dcm_read_frames,
    .directory = cts_dcm_directory,
    .class_name = cts_dcm_class_name,
    .convert = cts_dcm_convert,
    .decode = cts_dcm_decode,
    .ids = cts_dcm_ids,
    .sc_source = cts_dcm_sc_source,
    .sc_header = cts_dcm_sc_header,
    .sc_write = cts_dcm_sc_write,
    .sc_encode = cts_dcm_sc_encode,
    .state_write = cts_dcm_state_write,
    .state_read = cts_dcm_state_read,
};

__attribute__((visibility("default"))) const CtsDcmPart *cts_dcm_part(void);

const CtsDcmPart *cts_dcm_part(void)
{
    return &part;
}
